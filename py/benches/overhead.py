"""What Python and Dask cost: `python py/benches/overhead.py`, with the package built with `pip install ./py[cluster]`."""

import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

from distributed import Client, LocalCluster

import onecycle

ROOT = Path(__file__).parents[2]


def of_identify():
    recording = onecycle.read(ROOT / "examples/simulated_hover.csv")
    onecycle.identify(recording)
    beyond, took = [], []
    for _ in range(30):
        begin = time.perf_counter()
        found = onecycle.identify(recording)
        beyond.append(time.perf_counter() - begin - found.took_s)
        took.append(found.took_s)
    print(f"identify: {1e3 * statistics.median(took):.1f} ms in Rust, and {1e3 * statistics.median(beyond):.2f} ms "
          f"(at most {1e3 * max(beyond):.2f} ms) from Python to Rust and back")


def of_campaign(client, workers, tasks_each, text):
    """Seconds that the cluster takes beyond the work, as a share. A shard is about a second of work."""
    path = Path(tempfile.mkdtemp()) / "campaign.toml"
    path.write_text(text)
    begin = time.perf_counter()
    onecycle._onecycle.Campaign(str(path), []).cases(0, 200)
    case_s = (time.perf_counter() - begin) / 200
    shard = max(1, round(1 / case_s))
    cases = shard * tasks_each * workers
    # Once without measuring, so that every worker has loaded the package.
    onecycle.campaign(path, client=client, shard=1, cases=4 * workers)
    begin = time.perf_counter()
    onecycle.campaign(path, client=client, shard=shard, cases=cases)
    took = time.perf_counter() - begin
    print(f"{workers} worker(s): {cases} relay experiments in {cases // shard} tasks of {1e3 * shard * case_s:.0f} ms: "
          f"{took:.2f} s, {cases / took:.0f} experiments a second")
    return cases / took


def of_scheduler(client):
    """Tasks a second without work."""
    count = 3000
    begin = time.perf_counter()
    client.gather(client.map(len, [[n] for n in range(count)], pure=False))
    print(f"empty tasks: {count / (time.perf_counter() - begin):.0f} a second")


def main():
    of_identify()
    text = (ROOT / "experiments/relay.toml").read_text()
    rates = {}
    for workers in sorted({1, os.cpu_count() or 1}):
        with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
            with Client(cluster) as client:
                rates[workers] = of_campaign(client, workers, 10, text)
                of_scheduler(client)
    path = ROOT / "experiments/relay.toml"
    campaign = onecycle._onecycle.Campaign(str(path), [])
    begin = time.perf_counter()
    lines = campaign.cases(0, 2000)
    alone = 2000 / (time.perf_counter() - begin)
    print(f"without Dask, one thread: {alone:.0f} experiments a second; an outcome has {len(lines[0])} bytes")
    for workers, rate in rates.items():
        print(f"{workers} worker(s): overhead {100 * (alone * workers / rate - 1):.1f} %")


if __name__ == "__main__":
    sys.exit(main())
