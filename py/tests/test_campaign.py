"""Campaigns and training sets on a real scheduler with four worker processes."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
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
    counts = []

    # While it grows too.
    def look(done, count):
        schemas = [pyarrow.parquet.read_schema(file) for file in out.glob("*.parquet")]
        assert all(schema.equals(schemas[0]) for schema in schemas)
        counts.append(len(schemas))

    outcomes = onecycle.campaign(path, client=client, out=out, shard=1, cases=9, progress=look)
    assert {file.suffix for file in out.iterdir()} == {".parquet"}
    assert counts == list(range(1, 10))
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


def test_a_case_without_recording_and_other_kinds_of_values_are_rows(tmp_path, client):
    (tmp_path / "campaign.toml").write_text(SMALL["honesty"].replace('"wrong_sign"', '"wrong_sign", strength = [5.0, 9.0]'))

    # A number, a text, a truth value, or nothing.
    def odd(recording, truth):
        return {"value": [1.5, "text", True, None][len(recording) % 4]}

    outcomes = onecycle.campaign(tmp_path / "campaign.toml", client=client, out=tmp_path / "out", cases=12, shard=3, measure=odd)
    assert len(outcomes.cases) == 24
    frame = pandas.read_parquet(tmp_path / "out").set_index("n").sort_index()
    assert len(frame) == 24
    for case, value in zip(outcomes.cases, frame["outcome.value"]):
        assert (case is None or case["value"] is None) == (value is None or value != value), (case, value)


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


def another_build(folder):
    """The packages with a byte more behind their code: they load, and are not those of the client."""
    import onecycle_lab

    for package in (onecycle, onecycle_lab):
        shutil.copytree(Path(package.__file__).parent, folder / package.__name__)
    for code in folder.rglob("*.so"):
        code.write_bytes(code.read_bytes() + b"\0")
    return {**os.environ, "PYTHONPATH": str(folder)}


def scheduler_at(folder, *words):
    """A scheduler in a process of its own, and its address."""
    (folder / "at").unlink(missing_ok=True)
    server = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--scheduler-file", str(folder / "at"), *words]
    process = subprocess.Popen(server, stderr=subprocess.DEVNULL)
    while not (folder / "at").exists():
        time.sleep(0.05)
    return process, json.loads((folder / "at").read_text())["address"]


def worker_of(address, environment=None):
    words = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-dashboard", "--nthreads", "1"]
    return subprocess.Popen(words, stderr=subprocess.DEVNULL, env=environment)


def ended(*processes):
    for process in processes:
        process.kill()
        process.wait()


def test_workers_of_another_build_are_left_out(recipe, tmp_path):
    scheduler, address = scheduler_at(tmp_path, "--port", "0")
    wrong = another_build(tmp_path / "other")
    workers = [worker_of(address, wrong)]
    try:
        with Client(address) as client:
            client.wait_for_workers(1)
            with pytest.raises(onecycle.OnecycleError, match="has another build of onecycle .* no other worker is left"):
                with pytest.warns(UserWarning, match="left out"):
                    onecycle.campaign(recipe, client=client, shard=1)
            workers.append(worker_of(address))
            client.wait_for_workers(2)

            # One more of the other build, which comes when the work has begun.
            def come(done, count):
                if done == 1:
                    workers.append(worker_of(address, wrong))
                    client.wait_for_workers(3)

            with pytest.warns(UserWarning, match="has another build of onecycle .*: it is left out") as told:
                outcomes = onecycle.campaign(recipe, client=client, shard=1, progress=come)
            assert len([one for one in told if "another build" in str(one.message)]) == 2
            assert outcomes.to_json() == program("campaign", recipe, "--json")
    finally:
        ended(scheduler, *workers)


def test_versions_and_code_are_compared():
    from onecycle import _cluster

    own = version, machine, code = _cluster.build()
    assert _cluster._difference(own, own, "") is None
    # Other machines have other code, but one version.
    assert _cluster._difference(own, (version, "another machine", "0"), "") is None
    for other in (("0.1.0", machine, code), ("0.1.0", "another machine", code), (version, machine, "0")):
        assert "another build of onecycle" in _cluster._difference(own, other, "")
    assert "cannot load onecycle" in _cluster._difference(own, ImportError("No module named 'onecycle'"), "")


def test_a_lost_scheduler_is_a_sentence_and_the_next_one_goes_on(recipe, tmp_path):
    out = tmp_path / "out"
    scheduler, address = scheduler_at(tmp_path, "--port", "0")
    worker = worker_of(address)
    words = [sys.executable, "-m", "onecycle.campaign", str(recipe), "--out", str(out), "--shard", "1", "--scheduler"]
    run = subprocess.Popen([*words, address], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        while not list(out.glob("*.parquet")) and run.poll() is None:
            time.sleep(0.01)
        scheduler.kill()
        _, told = run.communicate(timeout=120)
        assert run.returncode == 3 and "error: the scheduler is lost" in told and "Traceback" not in told
        ended(worker, scheduler)
        kept = {path: path.stat().st_mtime_ns for path in out.glob("*.parquet")}
        assert 0 < len(kept) < 24
        scheduler, address = scheduler_at(tmp_path, "--port", "0")
        worker = worker_of(address)
        again = subprocess.run([*words, address], capture_output=True, text=True)
        assert again.stdout == program("campaign", recipe), again.stderr
        assert all(path.stat().st_mtime_ns == before for path, before in kept.items())
    finally:
        ended(run, worker, scheduler)


def test_a_connection_that_times_out_is_a_lost_scheduler():
    from onecycle import _cluster

    class Gone:
        def run(self, *_, **__):
            return {}

        def nthreads(self):
            raise OSError("Timed out trying to connect to tcp://192.0.2.2:8786 after 30 s")

    with pytest.raises(onecycle.OnecycleError, match="^the scheduler is lost"):
        _cluster._spread(Gone(), lambda threads: None, lambda task: (), lambda task, made: None)


def test_ctrl_c_ends_a_campaign_that_is_resumed(recipe, tmp_path, client):
    words = [sys.executable, "-m", "onecycle.campaign", recipe, "--scheduler", client.scheduler.address, "--out", tmp_path / "out"]
    words = [str(word) for word in [*words, "--shard", 1]]
    run = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not list((tmp_path / "out").glob("*.parquet")) and run.poll() is None:
        time.sleep(0.01)
    run.send_signal(signal.SIGINT)
    _, told = run.communicate(timeout=60)
    assert run.returncode == 130 and "the same command goes on" in told and "Traceback" not in told, told
    assert subprocess.run(words, capture_output=True, text=True).stdout == program("campaign", recipe)


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


def test_sets_of_the_classifier_have_the_bytes_of_the_program(tmp_path, client):
    recipe = tmp_path / "recipe.toml"
    text = (ROOT / "research/program/reproduction/literal_small.toml").read_text()
    recipe.write_text(re.sub(r"^(examples|systems) = \d+", r"\1 = 1203", text, flags=re.M))
    here, there = tmp_path / "here", tmp_path / "there"

    class Enough(Exception):
        pass

    def stop(done, count):
        if done == 2:
            raise Enough

    # Interrupted, and gone on with.
    with pytest.raises(Enough):
        onecycle.dataset(recipe, None, here, client=client, progress=stop)
    counts = []
    onecycle.dataset(recipe, None, here, client=client, progress=lambda *of: counts.append(of))
    assert counts[0][0] == 3 and counts[-1][0] == counts[-1][1]
    program("dataset", recipe, "--into", there)
    names = sorted(path.name for path in there.iterdir())
    assert "training.npz" in names and "verification.npz" in names
    assert sorted(path.name for path in here.iterdir()) == names
    assert all((here / name).read_bytes() == (there / name).read_bytes() for name in names)
    with pytest.raises(onecycle.OnecycleError, match="`examples`"):
        onecycle.dataset(recipe, 5, here, client=client)
    with pytest.raises(onecycle.OnecycleError, match="`examples`"):
        onecycle.dataset(None, None, here, client=client)


@pytest.mark.parametrize("lost", ["worker", "other build"])
def test_training_sets_survive_lost_and_wrong_workers(lost, tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    scheduler, address = scheduler_at(tmp_path, "--port", "0")
    workers = [worker_of(address, another_build(tmp_path / "other") if lost == "other build" else None), worker_of(address)]
    try:
        with Client(address) as client, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            client.wait_for_workers(2)
            onecycle.dataset(None, 12_000, here, client=client, progress=lambda done, count: lost == "worker" and workers[0].kill())
    finally:
        ended(scheduler, *workers)
    program("dataset", "--examples", 12_000, "--into", there)
    names = sorted(path.name for path in there.iterdir())
    assert len(names) == 4 and all((here / name).read_bytes() == (there / name).read_bytes() for name in names)


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
    with pytest.raises(TypeError, match="'colour'"):
        onecycle.campaign(path, client=client, colour="red")
    with pytest.raises(onecycle.OnecycleError, match="`cycles` has no effect"):
        onecycle.campaign(ROOT / "experiments/any_open.toml", client=client, cycles=2)
    words = [sys.executable, "-m", "onecycle.campaign", "missing.toml", "--out", str(tmp_path / "out")]
    run = subprocess.run([*words, "--scheduler", client.scheduler.address], capture_output=True, text=True)
    assert run.returncode == 3 and run.stderr.startswith("error: ") and "missing.toml" in run.stderr
    assert not (tmp_path / "out").exists()
    assert json.loads(onecycle.campaign(path, client=client, cases=1).to_json())["cases"]
