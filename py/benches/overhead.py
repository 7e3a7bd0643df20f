"""What Python and Dask cost: `python py/benches/overhead.py`, with the package built with `pip install ./py ./research/py`. A word runs
one part: `call`, `options`, `many`, `memory`, `dask`, `thousand`; `install WHEEL` installs a wheel into a clean environment."""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

from distributed import Client, LocalCluster, get_task_stream

import onecycle
import onecycle_lab
from onecycle import _cluster, _table

ROOT = Path(__file__).parents[2]


def of_identify():
    recording = onecycle.read(ROOT / "examples/simulated_hover.csv")
    onecycle.identify(recording)
    beyond, took, reports = [], [], []
    for _ in range(30):
        begin = time.perf_counter()
        found = onecycle.identify(recording)
        beyond.append(time.perf_counter() - begin - found.took_s)
        took.append(found.took_s)
        # Not freed while the clock runs.
        reports.append(found)
    print(f"identify: {1e3 * statistics.median(took):.1f} ms in Rust, and {1e3 * statistics.median(beyond):.2f} ms "
          f"(at most {1e3 * max(beyond):.2f} ms) from Python to Rust and back")


def of_options():
    """Settings of the controller cost no second identification."""
    recording = onecycle.read(ROOT / "examples/simulated_hover.csv")
    took_s = {}
    for name, options in {"none": {}, "output_filter": {"output_filter": 0.0}, "hold": {"hold": "held"}, "noise": {"noise": 0.2}}.items():
        of = []
        for _ in range(15):
            begin = time.perf_counter()
            onecycle.identify(recording, structure="soiptd", **options)
            of.append(time.perf_counter() - begin)
        took_s[name] = statistics.median(of)
    print("identify with a setting, beside one without: "
          + ", ".join(f"{name} {took_s[name] / took_s['none']:.2f}" for name in list(took_s)[1:]))


def of_install(wheel):
    """Seconds until a wheel and NumPy are in a clean environment without a compiler: with an empty cache of pip, and with a full one."""
    with tempfile.TemporaryDirectory() as folder:
        took_s = []
        for turn in ("empty", "full"):
            venv.create(Path(folder, turn), with_pip=True)
            python = Path(folder, turn, "bin", "python")
            begin = time.perf_counter()
            subprocess.run([python, "-m", "pip", "install", "-q", "--cache-dir", Path(folder, "cache"), wheel], check=True,
                           env={"PATH": str(python.parent)})
            took_s.append(time.perf_counter() - begin)
        subprocess.run([python, "-m", "onecycle", "--version"], check=True, stdout=subprocess.DEVNULL)
    print(f"{Path(wheel).name} and NumPy installed in {took_s[0]:.1f} s, from pip's cache in {took_s[1]:.1f} s")


def simulated(cases):
    """A campaign of relay tests, and its recordings."""
    campaign = onecycle_lab.Campaign(str(ROOT / "experiments/refine_1pct.toml"), [f"--cases={cases}"])
    return campaign, [onecycle.Recording(*campaign.recording(n)[0]) for n in range(cases)]


def of_many(cases=1000):
    """One thread each: what the campaign in Rust takes, and what Python takes for the same recordings."""
    begin = time.perf_counter()
    campaign, recordings = simulated(cases)
    simulated_s = time.perf_counter() - begin
    begin = time.perf_counter()
    campaign.cases(0, cases)
    in_rust_s = time.perf_counter() - begin
    took_s = {}
    for design in (False, True):
        begin = time.perf_counter()
        reports = onecycle.identify_many(recordings, n_jobs=1, cycles=2, style="paper", design=design)
        took_s[design] = time.perf_counter() - begin
    print(f"{cases} recordings: the campaign in Rust {in_rust_s:.1f} s, of which simulation is some {simulated_s:.1f} s; identify_many "
          f"without controllers {took_s[False]:.1f} s, with all {took_s[True]:.1f} s ({sum(bool(of.model) for of in reports)} identified)")


def of_memory(count=5000):
    """Memory after the first identifications and after all (MB)."""
    _, recordings = simulated(10)

    def resident():
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 1e6

    for n in range(count):
        found = onecycle.identify(recordings[n % 10], cycles=2, design=n % 5 == 0)
        found.posterior, found.rows, found.remarks
        if n == count // 10:
            before = resident()
    print(f"{count} identifications: {before:.0f} MB after a tenth of them, {resident():.0f} MB after all")


def relay_campaign(cases):
    return onecycle_lab.Campaign(str(ROOT / "experiments/relay.toml"), [f"--cases={cases}"])


def alone(cases):
    """Seconds that one thread needs for the cases without Dask, and bytes of an outcome."""
    campaign = relay_campaign(cases)
    begin = time.perf_counter()
    lines = campaign.cases(0, cases)
    return time.perf_counter() - begin, sum(len(case) for case, _ in lines) / cases


def of_campaign(client, workers, cases):
    """Seconds of these cases on the cluster, those that the workers computed, and the number of tasks."""
    recipe = ROOT / "experiments/relay.toml"
    # Once without measuring, so that every worker has loaded the package.
    onecycle.campaign(recipe, client=client, shard=1, cases=8 * workers)
    begin = time.perf_counter()
    with get_task_stream(client) as stream:
        onecycle.campaign(recipe, client=client, cases=cases)
        took_s = time.perf_counter() - begin
    spans = [span for task in stream.data for span in task["startstops"] if span["action"] == "compute"]
    return took_s, sum(span["stop"] - span["start"] for span in spans), len(spans)


def of_scheduler(client):
    """Tasks a second without work."""
    count = 3000
    begin = time.perf_counter()
    client.gather(client.map(len, [[n] for n in range(count)], pure=False))
    return count / (time.perf_counter() - begin)


def of_dask(cases=10_000):
    for workers in sorted({1, os.cpu_count() or 1}):
        took_s, size = alone(cases)
        with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
            with Client(cluster) as client:
                on_cluster_s, computed_s, tasks = of_campaign(client, workers, cases)
                tasks_a_second = of_scheduler(client)
        print(f"{workers} worker(s): {cases} relay experiments in {tasks} tasks: "
              f"{on_cluster_s:.2f} s, of which the workers were idle {100 * (1 - computed_s / workers / on_cluster_s):.1f} %; "
              f"{took_s:.2f} s in one thread without Dask; {tasks_a_second:.0f} empty tasks a second; "
              f"{size:.0f} bytes an outcome", flush=True)


def pretended(row, cases, seconds):
    """A task that takes its time and hardly any processor, and outcomes that travel like real ones: each a text of its own."""
    time.sleep(seconds)
    return seconds, [[text[:1] + text[1:] for text in row] for _ in range(cases)]


def of_thousand(threads=1000, processes=8, case_s=0.1):
    """What the client, of which there is one, does for many workers; and a check with threads that sleep instead of computing cases of
    `case_s`, with outcomes of real ones."""
    some = relay_campaign(1000).cases(0, 1000)
    with tempfile.TemporaryDirectory() as out:
        folder = _table.Folder(out, "client")
        folder.add(0, some)
        begin = time.perf_counter()
        folder.add(1000, 10 * some)
        a_case_s = (time.perf_counter() - begin) / 10_000
    print(f"the client needs {1e6 * a_case_s:.0f} us for a case: it keeps up with 1,000 workers if a case takes {1e6 * a_case_s:.0f} ms, and "
          f"with {0.003 / a_case_s:.0f} if it takes 3 ms")
    seconds = _cluster.task_s(threads)
    cases, count = int(seconds / case_s), 2 * threads
    left = iter(range(count))
    with LocalCluster(n_workers=processes, threads_per_worker=threads // processes, dashboard_address=None) as cluster:
        with Client(cluster) as client, tempfile.TemporaryDirectory() as out:
            folder = _table.Folder(out, "thousand")
            begin = time.perf_counter()
            _cluster._spread(client, lambda _: next(left, None), lambda n: (pretended, some[0], cases, seconds),
                             lambda n, made: folder.add(n * cases, made[1]))
            took_s = time.perf_counter() - begin
    print(f"{threads} threads of {processes} processes, {count} tasks of {seconds:.0f} s with {cases} cases: {took_s:.0f} s, "
          f"{100 * (1 - count * seconds / threads / took_s):.1f} % idle, {count * cases / took_s:.0f} cases a second")


def main():
    if sys.argv[1:2] == ["install"]:
        return of_install(sys.argv[2])
    parts = {"call": of_identify, "options": of_options, "many": of_many, "memory": of_memory, "dask": of_dask, "thousand": of_thousand}
    for name in sys.argv[1:] or parts:
        parts[name]()


if __name__ == "__main__":
    sys.exit(main())
