"""Campaigns and training sets on a real scheduler with four worker processes."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import duckdb
import numpy as np
import pandas
import polars
import pyarrow.parquet
import pytest
from distributed import Client, LocalCluster

import onecycle

ROOT = Path(__file__).parents[2]
RECIPE = """measure = "identification"
cases = 24
seed = 1
bias = 0.3
sigma = 0.02
trim = true
"""
SMALL = {
    "relay": 'measure = "relay"\ncases = 9\nseed = 3\nbias = 0.3\nsigma = 0.02\ntrim = true\n',
    "unknown": 'measure = "unknown"\ncases = 1\nseed = 3\nbias = 0.3\nsigma = 0.02\ntrim = true\n',
    "honesty": """measure = "honesty"
cases = 1
seed = 1
noise = 0.005
bias = 0.2
periods = 20
samples_per_period = 100
process = { structure = "soiptd", k_over_t_body = 1, t_prop_s = 0.05, t_body_s = 1, tau_s = 0.03 }
kinds = [{ name = "right", control = true }, { name = "wrong sign", fault = "wrong_sign", named_by = ["negative_gain"] }]
""",
}


@pytest.fixture(scope="module")
def client():
    with LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        yield client


@pytest.fixture
def recipe(tmp_path):
    path = tmp_path / "campaign.toml"
    path.write_text(RECIPE)
    return path


def program(*words):
    run = subprocess.run([os.environ["ONECYCLE_LAB"], *map(str, words)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout


def slow():
    os.nice(19)


def test_same_bits_with_a_worker_killed_and_one_slow(recipe, tmp_path):
    out = tmp_path / "out"
    with LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        processes = client.run(os.getpid)
        addresses = list(processes)
        client.run(slow, workers=addresses[:1])
        killed = []

        # The second worker dies when the first results are there: it has work then.
        def kill(done, count):
            if not killed:
                assert done < count
                os.kill(processes[addresses[1]], signal.SIGKILL)
                killed.append(done)

        outcomes = onecycle.campaign(recipe, client=client, out=out, shard=2, progress=kill)
        assert killed
        assert outcomes.to_json() == program("campaign", recipe, "--json")
        assert str(outcomes) == program("campaign", recipe)
        # A resumed run computes only what is missing.
        parts = sorted(out.glob("*.parquet"))
        assert len(parts) == 12
        kept, lost = parts[0].stat().st_mtime_ns, parts[7]
        lost.unlink()
        again = onecycle.campaign(recipe, client=client, out=out, shard=2)
        assert again.to_json() == outcomes.to_json()
        assert lost.exists() and parts[0].stat().st_mtime_ns == kept
        with pytest.raises(onecycle.OnecycleError, match="another recipe"):
            onecycle.campaign(recipe, client=client, out=out, shard=2, sigma=0.01)


def test_numbers_are_columns(recipe, tmp_path, client):
    outcomes = onecycle.campaign(recipe, client=client, out=tmp_path / "out", shard=5, cases=10)
    table = pyarrow.parquet.read_table(tmp_path / "out" / "part-000000005.parquet")
    assert table.column("n").to_pylist() == [5, 6, 7, 8, 9]
    numbers = [name for name in table.column_names if table.schema.field(name).type == pyarrow.float64()]
    assert len(numbers) > 5
    frame = outcomes.to_pandas()
    for name in numbers:
        column = table.column(name).to_pylist()
        assert column == [None if value != value else value for value in frame[name][5:]], name


@pytest.mark.parametrize("measure", ["relay", "identification"])
def test_a_folder_is_one_table(measure, tmp_path, client):
    path, out = tmp_path / "campaign.toml", tmp_path / "out"
    # Noise of the size of the oscillation: cases are refused, and others not.
    path.write_text(RECIPE.replace("0.02", "0.3") if measure == "identification" else SMALL[measure])
    outcomes = onecycle.campaign(path, client=client, out=out, shard=1, cases=9)
    assert {file.suffix for file in out.iterdir()} == {".parquet"}
    assert len({tuple(pyarrow.parquet.read_schema(file).names) for file in out.iterdir()}) == 1
    frame = outcomes.to_pandas()
    of_pandas = pandas.read_parquet(out).set_index("n").sort_index()
    of_polars = polars.read_parquet(out).sort("n")
    of_duckdb = duckdb.sql(f"select * from '{out}/*.parquet' order by n").df().set_index("n")
    assert set(of_pandas.columns) == set(frame.columns) | {"case", "truth"}
    for name in frame:
        values = [None if value != value else value for value in frame[name]]
        assert of_polars[name].to_list() == values, name
        assert [None if value != value else value for value in of_pandas[name].astype(object).fillna(np.nan)] == values, name
        assert [None if value != value else value for value in of_duckdb[name].astype(object).fillna(np.nan)] == values, name


def test_a_finished_campaign_is_extended(recipe, tmp_path, client):
    out = tmp_path / "out"
    few = onecycle.campaign(recipe, client=client, out=out, shard=4, cases=6)
    assert str(few) == program("campaign", recipe, "--cases=6")
    kept = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    done = []
    # Other tasks, and a number in the file instead of the option: the cases are the same.
    more = onecycle.campaign(recipe, client=client, out=out, shard=5, progress=lambda *of: done.append(of))
    assert done[-1] == (24, 24) and len(done) == 4 and done[0][0] > 6
    assert more.to_json() == program("campaign", recipe, "--json") and str(more) == program("campaign", recipe)
    assert all(path.stat().st_mtime_ns == before for path, before in kept.items())
    assert sorted(pandas.read_parquet(out)["n"]) == list(range(24))
    # Fewer again are there already.
    assert str(onecycle.campaign(recipe, client=client, out=out, cases=6)) == str(few)


@pytest.mark.parametrize("name", ["unknown", "honesty"])
def test_kinds_take_turns_so_that_their_campaigns_are_extended_too(name, tmp_path):
    (tmp_path / "campaign.toml").write_text(SMALL[name])
    from onecycle_lab import Campaign

    one, two = (Campaign(str(tmp_path / "campaign.toml"), [f"--cases={n}"]) for n in (1, 2))
    assert one.settings() == two.settings() and len(two) == 2 * len(one)
    assert two.cases(0, len(one)) == one.cases(0, len(one))
    kinds = [json.loads(truth)["kind"] for _, truth in two.cases(0, len(two))]
    assert kinds[len(one):] == kinds[:len(one)] and len(set(kinds)) > 1


def test_truth_is_beside_the_outcome(recipe, tmp_path, client):
    outcomes = onecycle.campaign(recipe, client=client, out=tmp_path / "out", cases=3)
    frame = pandas.read_parquet(tmp_path / "out").sort_values("n")
    for n, truth in enumerate(outcomes.truths):
        assert truth["structure"] == "soiptd" and 0 < truth["t_prop_s"] < truth["t_body_s"] and abs(truth["input_bias"]) <= 0.3
        assert frame["truth.tau_s"].iloc[n] == truth["tau_s"] == outcomes.to_pandas()["truth.tau_s"][n]
    assert len({truth["tau_s"] for truth in outcomes.truths}) == 3
    recordings = onecycle.campaign(ROOT / "experiments/any_open.toml", client=client, cases=4)
    assert {truth["signal"] for truth in recordings.truths} and all(truth["duration_s"] > 0 for truth in recordings.truths)


def test_an_own_measure_is_a_function(recipe, tmp_path, client):
    # A local function travels by value: the workers do not have this file.
    def error(recording, truth):
        found = onecycle.identify(recording, cycles=2, design=False)
        return {"of_tau_s": found.params["tau_s"] - truth["tau_s"], "samples": len(recording)}

    out = tmp_path / "out"
    outcomes = onecycle.campaign(recipe, client=client, out=out, cases=4, measure=error)
    assert len(outcomes.cases) == 4 and all(abs(case["of_tau_s"]) < 0.01 and case["samples"] > 1000 for case in outcomes.cases)
    frame = pandas.read_parquet(out).sort_values("n")
    assert frame["outcome.of_tau_s"].tolist() == [case["of_tau_s"] for case in outcomes.cases]
    assert json.loads(outcomes.to_json()) == {"cases": outcomes.cases} and "of_tau_s" in str(outcomes)
    # The recordings are those of the campaign, and a number alone is an outcome.
    lengths = onecycle.campaign(recipe, client=client, cases=4, measure=lambda recording, truth: np.int64(len(recording)))
    assert lengths.cases == [case["samples"] for case in outcomes.cases]
    with pytest.raises(onecycle.OnecycleError, match="another recipe, option, measure"):
        onecycle.campaign(recipe, client=client, out=out, cases=4)


def test_tasks_are_some_seconds_of_work(tmp_path, client):
    path, out = tmp_path / "campaign.toml", tmp_path / "out"
    path.write_text(SMALL["relay"])
    onecycle.campaign(path, client=client, out=out, cases=2000)
    sizes = sorted(pyarrow.parquet.read_metadata(part).num_rows for part in out.iterdir())
    # One case for each thread, and then groups.
    assert sum(sizes) == 2000 and sizes[:4] == [1] * 4 and len(sizes) < 60 and sizes[-1] > 50


def test_tasks_follow_the_workers_that_come(recipe):
    with LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        threading.Timer(1.0, cluster.scale, [3]).start()
        most = []

        def look(done, count):
            most.append(sum(map(len, client.processing().values())))
            # The first cases wait for all workers.
            client.wait_for_workers(3)

        outcomes = onecycle.campaign(recipe, client=client, shard=1, progress=look)
        # With one worker that was known of it were four.
        assert len(outcomes) == 24 and max(most) > 4


def test_a_worker_of_another_build_is_refused(recipe, client):
    from onecycle import _cluster

    version, machine, code = _cluster.build()
    _cluster.check((version, machine, code))
    _cluster.check((version, "another machine", "0"))
    for other in (("0.1.0", machine, code), (version, machine, "0")):
        with pytest.raises(onecycle.OnecycleError, match="another build of onecycle"):
            _cluster.check(other)
    with pytest.raises(onecycle.OnecycleError, match="another build of onecycle"):
        client.submit(_cluster.shard_cases, ("0.1.0", machine, code), RECIPE, (), 0, 1).result()


def test_a_lost_scheduler_is_a_sentence(recipe, tmp_path):
    out = tmp_path / "out"
    server = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard"]
    scheduler = subprocess.Popen([*server, "--scheduler-file", str(tmp_path / "at")], stderr=subprocess.DEVNULL)
    while not (tmp_path / "at").exists():
        time.sleep(0.05)
    address = json.loads((tmp_path / "at").read_text())["address"]
    words = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-dashboard", "--nthreads", "1"]
    worker = subprocess.Popen(words, stderr=subprocess.DEVNULL)
    words = [sys.executable, "-m", "onecycle.campaign", str(recipe), "--scheduler", address, "--out", str(out), "--shard", "1"]
    run = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        while not list(out.glob("*.parquet")) and run.poll() is None:
            time.sleep(0.01)
        scheduler.kill()
        _, told = run.communicate(timeout=120)
        assert run.returncode == 3 and "error: the scheduler is lost" in told and "Traceback" not in told
    finally:
        for process in (run, worker, scheduler):
            process.kill()
            process.wait()


@pytest.mark.parametrize("measure", ["relay", "unknown", "recording", "honesty"])
def test_every_measure_gives_the_table_of_the_program(measure, tmp_path, client):
    path, options = tmp_path / "campaign.toml", {}
    if measure in SMALL:
        path.write_text(SMALL[measure])
    else:
        path, options = ROOT / "experiments/any_open.toml", {"cases": 4}
    words = [f"--{key}={value}" for key, value in options.items()]
    # All three at a time: of the unknown processes one takes as long as all others.
    with ThreadPoolExecutor() as pool:
        table = pool.submit(program, "campaign", path, *words)
        text = pool.submit(program, "campaign", path, "--json", *words)
        outcomes = onecycle.campaign(path, client=client, shard=2, **options)
        assert str(outcomes) == table.result()
        assert outcomes.to_json() == text.result()


def test_training_sets_have_the_bytes_of_the_program(tmp_path, client):
    here, there = tmp_path / "here", tmp_path / "there"
    onecycle.dataset(None, 4200, here, client=client)
    program("dataset", "--examples", 4200, "--into", there)
    names = sorted(path.name for path in there.iterdir())
    assert names == ["manifest.json", "shard-00000.npz", "shard-00001.npz"]
    assert all((here / name).read_bytes() == (there / name).read_bytes() for name in names)
    # A damaged file is made again.
    (here / names[2]).write_bytes(b"")
    onecycle.dataset(None, 4200, here, client=client)
    assert (here / names[2]).read_bytes() == (there / names[2]).read_bytes()


def test_a_killed_command_is_resumed_without_loss(recipe, tmp_path, client):
    address = client.scheduler.address
    words = [sys.executable, "-m", "onecycle.campaign", recipe, "--scheduler", address, "--out", tmp_path / "out"]
    words = [str(word) for word in [*words, "--shard", 2, "--cases=16"]]
    first = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    while not list((tmp_path / "out").glob("*.parquet")) and first.poll() is None:
        time.sleep(0.01)
    first.kill()
    first.wait()
    parts = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").glob("*.parquet")}
    assert parts
    second = subprocess.run(words, capture_output=True, text=True)
    assert second.stdout == program("campaign", recipe, "--cases=16"), second.stderr
    assert all(path.stat().st_mtime_ns == before for path, before in parts.items())


def test_errors_are_sentences(tmp_path, client):
    path = tmp_path / "campaign.toml"
    path.write_text(RECIPE.replace("cases = 24", "cases = 0"))
    with pytest.raises(onecycle.OnecycleError, match="cases"):
        onecycle.campaign(path, client=client)
    with pytest.raises(onecycle.OnecycleError, match="missing.toml"):
        onecycle.campaign(tmp_path / "missing.toml", client=client)
    path.write_text(RECIPE)
    with pytest.raises(onecycle.OnecycleError, match="--colour"):
        onecycle.campaign(path, client=client, colour="red")
    words = [sys.executable, "-m", "onecycle.campaign", "missing.toml", "--out", str(tmp_path / "out")]
    run = subprocess.run([*words, "--scheduler", client.scheduler.address], capture_output=True, text=True)
    assert run.returncode == 3 and run.stderr.startswith("error: ") and "missing.toml" in run.stderr
    assert not (tmp_path / "out").exists()
    assert json.loads(onecycle.campaign(path, client=client, cases=1).to_json())["cases"]
