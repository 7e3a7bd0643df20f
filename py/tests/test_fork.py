"""Processes that were forked or spawned after work in their parent."""

import multiprocessing
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import distributed
import joblib
import pytest

import onecycle

from conftest import HOVER

pytestmark = pytest.mark.usefixtures("root")

#: A pool of threads is started in the parent: a hung child is killed by its own clock.
FORKED = f"""
import os, signal, warnings
import onecycle
recording = onecycle.read({HOVER!r})
found = onecycle.identify(recording, structure="soiptd")
onecycle.design(found.model)
pid = os.fork()
if pid == 0:
    signal.alarm(60)
    alike = onecycle.identify(recording, structure="soiptd") == found and onecycle.identify_many([recording], 2)[0].answer == \\
        onecycle.identify(recording).answer
    # A child of a child.
    grandchild = os.fork()
    if grandchild == 0:
        signal.alarm(60)
        onecycle.design(found.model)
        os._exit(3)
    os._exit(5 if alike and os.waitstatus_to_exitcode(os.waitpid(grandchild, 0)[1]) == 3 else 1)
child = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
# The parent's threads live on.
print(child, onecycle.identify(recording, structure="soiptd") == found)
"""


def test_a_forked_child_works():
    run = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, timeout=300)
    assert run.stdout.split() == ["5", "True"], run.stderr


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_pools_of_processes_ship_recordings_and_reports(method, found):
    with multiprocessing.get_context(method).Pool(2) as pool:
        reports = pool.map_async(onecycle.identify, [found.recording] * 3).get(timeout=300)
    assert all(report == found for report in reports)


def again(recording, model, report):
    """All three went to the worker, and come back."""
    return onecycle.identify(recording) == report and report.model == model, recording, model, report


def is_shipped(found, shipped):
    return all(is_same and rest == [found.recording, found.model, found] for is_same, *rest in shipped) and len(shipped) == 2


def test_joblib_ships_them(found):
    task = joblib.delayed(again)(found.recording, found.model, found)
    assert is_shipped(found, joblib.Parallel(n_jobs=2)([task, task]))


def test_dask_ships_them(found):
    with distributed.Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
        tasks = [client.submit(again, found.recording, found.model, found, pure=False) for _ in range(2)]
        assert is_shipped(found, client.gather(tasks))


def test_ray_ships_them(found):
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=2, include_dashboard=False)
    try:
        tasks = [ray.remote(again).remote(found.recording, found.model, found) for _ in range(2)]
        assert is_shipped(found, ray.get(tasks))
    finally:
        ray.shutdown()


def test_two_threads_have_the_bits_of_one(found):
    with ThreadPoolExecutor(2) as pool:
        assert all(report == found for report in pool.map(onecycle.identify, [found.recording] * 4))


INTERRUPTED = f"""
import os, signal, threading
import onecycle
recording = onecycle.read({HOVER!r})
threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    while True:
        onecycle.identify(recording)
except KeyboardInterrupt:
    print("interrupted", onecycle.identify(recording).structure)
"""


def test_ctrl_c_ends_an_identification():
    run = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=120)
    assert run.stdout == "interrupted soiptd\n", run.stderr
