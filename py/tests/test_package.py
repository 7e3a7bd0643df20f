"""The package against the program, python-control and SciPy."""

import os
import subprocess
from pathlib import Path

import control
import numpy as np
import pytest
import scipy.signal

import onecycle

ROOT = Path(__file__).parents[2]
HOVER = "examples/simulated_hover.csv"
MODEL = onecycle.Model("soiptd", k=1.0, t_prop_s=0.0321, t_body_s=1.6886, tau_s=0.0237)
FOPTD = onecycle.Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)


@pytest.fixture(autouse=True)
def at_root(monkeypatch):
    monkeypatch.chdir(ROOT)


def program(*words):
    return subprocess.run([os.environ["ONECYCLE"], *words], capture_output=True, text=True).stdout


def test_the_json_is_that_of_the_program():
    assert onecycle.identify(HOVER).to_json() == program("identify", "--json", HOVER)
    assert onecycle.identify(onecycle.read(HOVER)).to_json() == program("identify", "--json", HOVER)


def test_samples_in_memory_give_the_same_model():
    of_file = onecycle.read(HOVER)
    again = onecycle.Recording(of_file.t, of_file.u, of_file.y)
    assert onecycle.identify(again, cycles=2).intervals == onecycle.identify(HOVER, cycles=2).intervals


def test_result_holds_truth():
    found = onecycle.identify(HOVER, cycles=2)
    tau = found.intervals["tau_s"]
    assert tau["low"] < 0.0237 < tau["high"]
    # 5 to 95 % of the draws lie within about the interval.
    low, high = np.quantile(found.posterior["tau_s"], [0.05, 0.95])
    assert low == pytest.approx(tau["low"], abs=0.2 * (tau["high"] - tau["low"]))
    assert high == pytest.approx(tau["high"], abs=0.2 * (tau["high"] - tau["low"]))
    assert found.refusal is None and found.remarks == found.to_dict()["remarks"]


def test_page(tmp_path):
    onecycle.identify(HOVER).report(tmp_path / "x.html")
    program("identify", HOVER, "--report", str(tmp_path / "y.html"))
    assert (tmp_path / "x.html").read_bytes() == (tmp_path / "y.html").read_bytes()


def test_errors_are_sentences():
    with pytest.raises(onecycle.OnecycleError, match="missing.csv"):
        onecycle.read("missing.csv")
    with pytest.raises(onecycle.OnecycleError, match="--colour"):
        onecycle.identify(HOVER, colour="red")
    with pytest.raises(onecycle.OnecycleError, match="no parameter speed"):
        onecycle.Model("foptd", speed=1.0)
    t = np.arange(1000) * 1e-3
    assert onecycle.identify(onecycle.Recording(t, 0 * t + 0.2, 0 * t)).refusal


@pytest.mark.parametrize("model", [MODEL, FOPTD])
def test_frequency_response_against_control_and_scipy(model):
    w = np.logspace(-2, 2, 200)
    delay = np.exp(-1j * w * model.dead_time_s)
    own = model.frequency_response(w)
    np.testing.assert_allclose(own, model.to_control()(1j * w) * delay, rtol=1e-11)
    np.testing.assert_allclose(own, scipy.signal.freqresp(model.to_scipy(), w)[1] * delay, rtol=1e-11)


def test_margins_against_control():
    controller = onecycle.Controller(50.0, 0.0, 15.0)
    own = onecycle.margins(MODEL, controller)
    w = np.logspace(-1, 3, 400_001)
    response = MODEL.frequency_response(w) * (50.0 + 15.0j * w)
    gain_margin, phase_margin, _, _, _, crossover = control.stability_margins(control.frd(response, w))[:6]
    assert own["gain_margin"] == pytest.approx(gain_margin, rel=1e-4)
    assert np.degrees(own["phase_margin_rad"]) == pytest.approx(phase_margin, rel=1e-4)
    assert own["ms"] == pytest.approx(np.max(1 / np.abs(1 + response)), rel=1e-6)


def test_step_against_scipy():
    t, y, _ = onecycle.step(onecycle.Model("foptd", k=1.0, t_body_s=1.5, tau_s=0.3), onecycle.Controller(2.0))
    # Before the second dead time has passed, the loop is open: y = 2 (1 - exp(-(t - 0.3) / 1.5)).
    early = (t > 0.3) & (t < 0.6)
    assert early.sum() > 3
    np.testing.assert_allclose(y[early], 2 * (1 - np.exp(-(t[early] - 0.3) / 1.5)), rtol=1e-6)


def test_simulation_against_the_exact_ramp():
    model = onecycle.Model("soiptd", k=1.0, t_prop_s=0.05, t_body_s=1.0, tau_s=0.02)
    y = onecycle.simulate(model, np.ones(20_000), 1e-3)
    # After the lags the output is a ramp that is late by their sum.
    assert y[-1] == pytest.approx(19.999 - 0.05 - 1.0 - 0.02, rel=1e-6)


def test_design_is_that_of_the_program():
    best = onecycle.design(FOPTD, form="pi")
    assert best["controller"]["form"] == "pi"
    own = onecycle.margins(FOPTD, onecycle.Controller(*(best["controller"][k] for k in ("kp", "ki", "kd", "filter_s"))))
    assert own["ms"] == pytest.approx(best["margins"]["ms"], rel=1e-9)


def test_pandas_there_and_back():
    frame = onecycle.read(HOVER).to_pandas()
    again = onecycle.Recording.from_pandas(frame)
    assert np.array_equal(again.t, onecycle.read(HOVER).t)
