"""Many recordings, and processes without controllers."""

import subprocess
import sys

import numpy as np
import pytest

import onecycle
from conftest import HOVER

pytestmark = pytest.mark.usefixtures("root")
PROCESS = onecycle.Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)


def recorded(seed):
    t = np.arange(1000) * 0.04
    u = np.sign(np.sin(0.9 * t + 0.4 * np.sin(0.31 * t)))
    noise = np.random.default_rng(seed).normal(0, 0.01, t.size)
    return onecycle.Recording(t, u, onecycle.simulate(PROCESS, u, 0.04) + noise, name=f"seed {seed}")


@pytest.mark.parametrize("n_jobs", [1, 3, -1])
def test_many_are_as_one_after_the_other(n_jobs):
    recordings = [recorded(seed) for seed in range(4)]
    reports = onecycle.identify_many(recordings, n_jobs, structure="foptd")
    assert [report.recording.name for report in reports] == [f"seed {seed}" for seed in range(4)]
    assert reports == [onecycle.identify(recording, structure="foptd") for recording in recordings]


def test_files_and_generators_are_sources():
    one, other = onecycle.identify_many(source for source in (HOVER, onecycle.read(HOVER)))
    assert one == other and onecycle.identify_many([]) == []


def test_the_first_that_cannot_be_used_is_named():
    with pytest.raises(onecycle.OnecycleError, match="missing.csv") as caught:
        onecycle.identify_many([recorded(1), "missing.csv"], n_jobs=2, structure="foptd")
    assert caught.value.file == "missing.csv"
    with pytest.raises(ValueError, match="n_jobs is 0"):
        onecycle.identify_many([], n_jobs=0)


def test_without_controllers_the_process_is_the_same():
    found = onecycle.identify(recorded(1), structure="foptd", design=False)
    with_controllers = onecycle.identify(recorded(1), structure="foptd", design=True)
    assert with_controllers.controller is not None
    assert found.params == with_controllers.params and found.model == with_controllers.model
    assert np.array_equal(found.posterior["k"], with_controllers.posterior["k"])
    report = found.to_dict()
    assert found.controller is None and found.answer.verdict == "not_yet" and found.answer.gains == ()
    assert all(report[key] is None for key in ("controller", "controllers", "margins", "step", "robustness"))
    assert not [about for about in report["detail_about"] if about == "controller"]
    assert "`design=False`" in str(found) and "Kp" not in str(found) and found.summary()
    for options in ({"against": (1, 1, 0)}, {"write": "x.params"}):
        with pytest.raises(onecycle.OnecycleError, match="`design=False`"):
            onecycle.identify(HOVER, design=False, **options)


LONG = """
import os, signal, threading, time
import onecycle
recording = onecycle.read("examples/simulated_hover.csv")
threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    onecycle.identify_many([recording] * 10_000, n_jobs=2)
except KeyboardInterrupt:
    print("interrupted", flush=True)
# Those that were begun end, and no others begin: the processor rests long before the hour that all would take.
begin = float("-inf")
while time.process_time() - begin > 0.1:
    begin = time.process_time()
    time.sleep(0.5)
"""


def test_ctrl_c_ends_a_batch():
    run = subprocess.run([sys.executable, "-c", LONG], capture_output=True, text=True, timeout=300)
    assert run.stdout == "interrupted\n" and run.returncode == 0, run.stderr
