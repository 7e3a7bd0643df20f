"""Campaigns on a real scheduler with four worker processes."""

import json
import os
import subprocess

import pytest
from distributed import Client, LocalCluster

import onecycle

RECIPE = """measure = "identification"
cases = 60
seed = 1
bias = 0.3
sigma = 0.02
trim = true
"""


@pytest.fixture
def recipe(tmp_path):
    path = tmp_path / "campaign.toml"
    path.write_text(RECIPE)
    return path


def by_program(recipe):
    run = subprocess.run([os.environ["ONECYCLE"], "campaign", str(recipe), "--json"], capture_output=True, text=True)
    return json.loads(run.stdout)["cases"]


def slow(dask_worker):
    os.nice(19)


def test_same_bits_with_a_worker_killed(recipe, tmp_path):
    out = tmp_path / "out"
    with LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        processes = client.run(os.getpid)
        addresses = list(processes)
        client.run(slow, workers=addresses[:1])
        # The second worker dies while it has work.
        killer = subprocess.Popen(["sh", "-c", f"sleep 0.3; kill -9 {processes[addresses[1]]}"])
        cases = onecycle.campaign(recipe, client=client, out=out, shard=2)
        killer.wait()
        assert cases == by_program(recipe)
        # A resumed run computes only what is missing.
        parts = sorted(out.glob("*.parquet"))
        assert len(parts) == 30
        kept, lost = parts[0].stat().st_mtime_ns, parts[7]
        lost.unlink()
        assert onecycle.campaign(recipe, client=client, out=out, shard=2) == cases
        assert lost.exists() and parts[0].stat().st_mtime_ns == kept
        with pytest.raises(onecycle.OnecycleError, match="another"):
            onecycle.campaign(recipe, client=client, out=out, shard=3)
