"""What Python and Dask cost: `python py/benches/overhead.py`, with the package built with `pip install ./py ./research/py`."""

import os
import statistics
import sys
import time
from pathlib import Path

from distributed import Client, LocalCluster, get_task_stream

import onecycle
import onecycle_lab

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


def relay_campaign(cases):
    return onecycle_lab.Campaign(str(ROOT / "experiments/relay.toml"), [f"--cases={cases}"])


def alone(cases):
    """Seconds that one thread needs for the cases without Dask, and bytes of an outcome."""
    campaign = relay_campaign(cases)
    begin = time.perf_counter()
    lines = campaign.cases(0, cases)
    return time.perf_counter() - begin, sum(map(len, lines)) / cases


def of_campaign(client, workers, shard, tasks):
    """Seconds of the same cases on the cluster, and those that the workers computed."""
    recipe = ROOT / "experiments/relay.toml"
    # Once without measuring, so that every worker has loaded the package.
    onecycle.campaign(recipe, client=client, shard=1, cases=8 * workers)
    begin = time.perf_counter()
    with get_task_stream(client) as stream:
        onecycle.campaign(recipe, client=client, shard=shard, cases=shard * tasks)
        took_s = time.perf_counter() - begin
    spans = (span for task in stream.data for span in task["startstops"] if span["action"] == "compute")
    return took_s, sum(span["stop"] - span["start"] for span in spans)


def of_scheduler(client):
    """Tasks a second without work."""
    count = 3000
    begin = time.perf_counter()
    client.gather(client.map(len, [[n] for n in range(count)], pure=False))
    return count / (time.perf_counter() - begin)


def main():
    of_identify()
    took_s, _ = alone(500)
    shard, tasks = max(1, round(500 / took_s)), 20
    cases = shard * tasks
    for workers in sorted({1, os.cpu_count() or 1}):
        took_s, size = alone(cases)
        with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
            with Client(cluster) as client:
                on_cluster_s, computed_s = of_campaign(client, workers, shard, tasks)
                tasks_a_second = of_scheduler(client)
        print(f"{workers} worker(s): {cases} relay experiments in {tasks} tasks of {computed_s / tasks:.2f} s: "
              f"{on_cluster_s:.2f} s, of which the workers were idle {100 * (1 - computed_s / workers / on_cluster_s):.1f} %; "
              f"{took_s:.2f} s in one thread without Dask; {tasks_a_second:.0f} empty tasks a second; "
              f"{size:.0f} bytes an outcome", flush=True)


if __name__ == "__main__":
    sys.exit(main())
