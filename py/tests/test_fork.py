"""Processes that were forked or spawned after work in their parent."""

import multiprocessing
import subprocess
import sys

import pytest

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
    import onecycle

    with multiprocessing.get_context(method).Pool(2) as pool:
        reports = pool.map_async(onecycle.identify, [found.recording] * 3).get(timeout=300)
    assert all(report == found for report in reports)
