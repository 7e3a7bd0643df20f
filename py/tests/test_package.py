"""The package against the program, python-control and SciPy."""

import re
import subprocess
import sys
from pathlib import Path

import control
import numpy as np
import pytest
import scipy.signal

import onecycle

from conftest import HOVER, ROOT

pytestmark = pytest.mark.usefixtures("root")
MODEL = onecycle.Model("soiptd", k=1.0, t_prop_s=0.0321, t_body_s=1.6886, tau_s=0.0237)
FOPTD = onecycle.Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)


def test_the_json_is_that_of_the_program(program):
    assert onecycle.identify(HOVER).to_json() == program("identify", "--json", HOVER)
    assert onecycle.identify(onecycle.read(HOVER)).to_json() == program("identify", "--json", HOVER)


def test_samples_in_memory_give_the_same_model():
    of_file = onecycle.read(HOVER)
    again = onecycle.Recording(of_file.t, of_file.u, of_file.y)
    assert onecycle.identify(again, cycles=2).intervals == onecycle.identify(HOVER, cycles=2).intervals


def test_result_holds_truth():
    found = onecycle.identify(HOVER, cycles=2)
    tau = found.intervals["tau_s"]
    assert tau.low < 0.0237 < tau.high
    # 5 to 95 % of the draws lie within about the interval.
    low, high = np.quantile(found.posterior["tau_s"], [0.05, 0.95])
    assert low == pytest.approx(tau.low, abs=0.2 * (tau.high - tau.low))
    assert high == pytest.approx(tau.high, abs=0.2 * (tau.high - tau.low))
    assert found.refusal is None and found.remarks == found.to_dict()["remarks"]
    assert found.details == found.to_dict()["details"] != []


def test_page(tmp_path, program):
    onecycle.identify(HOVER).write_html(tmp_path / "x.html")
    program("identify", HOVER, "--report", str(tmp_path / "y.html"))
    assert (tmp_path / "x.html").read_bytes() == (tmp_path / "y.html").read_bytes()


def test_errors_are_sentences():
    with pytest.raises(onecycle.OnecycleError, match="missing.csv"):
        onecycle.read("missing.csv")
    t = np.arange(1000) * 1e-3
    assert onecycle.identify(onecycle.Recording(t, 0 * t + 0.2, 0 * t)).refusal


@pytest.mark.parametrize("model", [MODEL, FOPTD])
def test_frequency_response_against_control_and_scipy(model):
    w = np.logspace(-2, 2, 200)
    delay = np.exp(-1j * w * model.dead_time_s)
    own = model.frequency_response(w)
    np.testing.assert_allclose(own, model.to_control(pade=0)(1j * w) * delay, rtol=1e-11)
    np.testing.assert_allclose(own, scipy.signal.freqresp(model.to_scipy(pade=0), w)[1] * delay, rtol=1e-11)


def test_margins_against_control():
    controller = onecycle.Controller(50.0, 0.0, 15.0)
    own = onecycle.margins(MODEL, controller)
    w = np.logspace(-1, 3, 4001)
    response = MODEL.frequency_response(w) * (50.0 + 15.0j * w)
    gain_margin, phase_margin, _, _, _, crossover = control.stability_margins(control.frd(response, w))[:6]
    assert own.gain_margin == pytest.approx(gain_margin, rel=1e-4)
    assert np.degrees(own.phase_margin_rad) == pytest.approx(phase_margin, rel=1e-4)
    assert own.ms == pytest.approx(np.max(1 / np.abs(1 + response)), rel=1e-4)


def test_step_against_scipy():
    t, y, _ = onecycle.step(onecycle.Model("foptd", k=1.0, t_body_s=1.5, tau_s=0.3), onecycle.Controller(2.0))
    # Before the second dead time has passed, the loop is open: y = 2 (1 - exp(-(t - 0.3) / 1.5)).
    early = (t > 0.3) & (t < 0.6)
    assert early.sum() > 3
    np.testing.assert_allclose(y[early], 2 * (1 - np.exp(-(t[early] - 0.3) / 1.5)), rtol=1e-6)


STRUCTURES = {
    "soiptd": {"k": 1.3, "t_prop_s": 0.05, "t_body_s": 0.8},
    "foptd": {"k": 2.0, "t_body_s": 1.5},
    "soptd": {"k": 2.0, "t_prop_s": 0.2, "t_body_s": 1.5},
    "integrator_lag": {"k": 0.7, "t_prop_s": 0.1},
    "resonant": {"k": 1.5, "natural_frequency_rad_per_s": 6.0, "zeta": 0.2},
}


@pytest.mark.parametrize("structure", STRUCTURES)
def test_simulation_against_scipy(structure):
    sample_s, ticks_late = 0.01, 7
    model = onecycle.Model(structure, tau_s=ticks_late * sample_s, **STRUCTURES[structure])
    u = np.sign(np.sin(np.arange(3000) * 0.031)) + 0.2
    # SciPy holds the input with `interp=False`; a dead time of whole ticks moves the output.
    t = np.arange(u.size) * sample_s
    exact = scipy.signal.lsim(model.to_scipy(pade=0), u, t, interp=False)[1]
    own = onecycle.simulate(model, u, sample_s)
    np.testing.assert_allclose(own[ticks_late:], exact[:-ticks_late], rtol=1e-9, atol=1e-9 * np.abs(exact).max())
    assert not own[: ticks_late + 1].any()


def test_a_closed_loop_has_its_set_point():
    t = np.arange(2000) * 0.01
    r = np.sign(np.sin(t))
    recording = onecycle.Recording(t, 0.1 * r, np.cumsum(r) * 0.01, r)
    assert np.array_equal(recording.r, r)
    frame = recording.to_pandas()
    assert np.array_equal(onecycle.Recording.from_pandas(frame, set_point="r").r, r)
    assert onecycle.Recording(t, r, t).r is None
    with pytest.raises(onecycle.OnecycleError, match="one set-point for each sample"):
        onecycle.Recording(t, r, t, r[1:])


def test_a_flight_log_is_that_of_the_program(program):
    log = "examples/logs/ap_sysid_roll.bin"
    flight = onecycle.identify_flight(log)
    assert flight.to_json() == program("identify", "--json", log)
    table, _ = str(flight).split("Next ")
    assert table == program("identify", log).split("Next ")[0] and "--" not in str(flight)
    found = onecycle.identify(log, axis="roll")
    assert found.to_json() == program("identify", "--json", log, "--axis=roll")
    assert onecycle.identify(onecycle.read(log, axis="roll")).intervals.keys() == found.intervals.keys()
    assert found.to_dict()["against"] is not None
    with pytest.raises(onecycle.OnecycleError, match="`axis`"):
        onecycle.identify(log)
    with pytest.raises(onecycle.OnecycleError, match="not a ULog"):
        onecycle.identify_flight(HOVER)


LONG = """
import os, signal, threading, time
import onecycle_lab
ticks = []
def tick():
    while True:
        ticks.append(time.monotonic())
        time.sleep(0.01)
threading.Thread(target=tick, daemon=True).start()
threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
campaign = onecycle_lab.Campaign("experiments/any_open.toml", [])
begin = time.monotonic()
try:
    campaign.cases(0, len(campaign))
    print("done")
except KeyboardInterrupt:
    print("interrupted", len(ticks), flush=True)
os._exit(0)
"""


def test_long_work_leaves_the_interpreter_free_and_ends_with_ctrl_c():
    run = subprocess.run([sys.executable, "-c", LONG], capture_output=True, text=True, timeout=60)
    word, ticks = run.stdout.split()
    # Another thread went on meanwhile.
    assert word == "interrupted" and int(ticks) > 10


def test_the_snippets_of_the_guide_run(tmp_path, monkeypatch):
    text = Path("docs/guide/python.md").read_text()
    snippets = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    assert len(snippets) >= 4
    # They read the examples; what they write goes elsewhere.
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "experiments").symlink_to(ROOT / "experiments")
    monkeypatch.chdir(tmp_path)
    for n, snippet in enumerate(snippets):
        # As a user runs them: workers import the file of a campaign.
        script = tmp_path / f"snippet_{n}.py"
        script.write_text(snippet)
        run = subprocess.run([sys.executable, script], capture_output=True, text=True)
        assert run.returncode == 0, run.stderr


def test_design_is_that_of_the_program(program):
    best = onecycle.design(FOPTD, controller="pi")
    words = ["tune", "--process=foptd", "--k=2", "--t-body=1.5", "--tau=0.3", "--controller=pi"]
    assert best.to_json() == program(*words, "--json")
    assert best.to_dict()["controller"]["form"] == "pi"
    assert onecycle.margins(FOPTD, best.controller).ms == best.to_dict()["margins"]["ms"]
    assert best.controllers["balanced"] == best.controller and len(best.controllers) == 3


def test_pandas_there_and_back():
    frame = onecycle.read(HOVER).to_pandas()
    again = onecycle.Recording.from_pandas(frame)
    assert np.array_equal(again.t, onecycle.read(HOVER).t)
