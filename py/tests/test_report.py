"""Reports, models and controllers as values; keywords; exceptions."""

import copy
import inspect
import pickle
import re
import subprocess
import sys
from pathlib import Path

import control
import numpy as np
import pandas as pd
import pytest
import scipy.signal

import onecycle
from conftest import HOVER, ROOT

pytestmark = pytest.mark.usefixtures("root")
FOPTD = onecycle.Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)
DOUBLE = onecycle.Model("double_integrator_lag", k_over_t_body=3.0, t_prop_s=0.1, tau_s=0.02)
CALM = onecycle.Recording(np.arange(1000) * 1e-3, np.full(1000, 0.2), np.zeros(1000))


def equal(one, other):
    assert one == other and repr(one) == repr(other)
    if isinstance(one, onecycle.Report):
        assert one.params == other.params and one.took_s == other.took_s and str(one) == str(other)
        assert one.to_json() == other.to_json() and one.recording == other.recording
        assert all(np.array_equal(one.rows[key], other.rows[key], equal_nan=True) for key in one.rows)
    return True


@pytest.mark.parametrize("kind", ["report", "refused", "design", "flight", "model", "double integrator", "controller", "error"])
def test_values_are_pickled_copied_and_compared(kind, found):
    value = {
        "report": lambda: found,
        "refused": lambda: onecycle.identify(CALM),
        "design": lambda: onecycle.design(FOPTD),
        "flight": lambda: onecycle.identify_flight("examples/logs/ap_sysid_roll.bin"),
        "model": lambda: found.model,
        "double integrator": lambda: DOUBLE,
        "controller": lambda: found.controller,
        "error": lambda: pytest.raises(onecycle.OnecycleError, onecycle.read, "missing.csv").value,
    }[kind]()
    again = pickle.loads(pickle.dumps(value))
    if kind == "error":
        assert str(again) == str(value) and again.__dict__ == value.__dict__
        return
    assert all(equal(value, other) for other in (again, copy.copy(value), copy.deepcopy(value)))
    assert value != FOPTD and value != "text"
    if kind in ("report", "flight", "model"):
        with pytest.raises(AttributeError, match="immutable"):
            value.model = None
    for name in {"report": ("intervals", "posterior", "rows"), "design": ("controllers",)}.get(kind, ()):
        for one in (value, again):
            with pytest.raises(TypeError, match="does not support item assignment"):
                getattr(one, name)["k"] = None
    if kind == "report":
        for array in (again.posterior["k"], again.rows["time_s"], value.rows["time_s"]):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0


def test_a_pickled_report_makes_what_it_does_not_hold(found, tmp_path):
    stored = pickle.dumps(found)
    again = pickle.loads(stored)
    assert "_inner" not in again.__dict__
    assert again.summary() == found.summary()
    for report, name in ((found, "one"), (again, "other")):
        report.write_html(tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()
    # Draws and rows are most of it: 8 bytes for each of 7 columns.
    assert len(stored) < 8 * (7 * 4000 + 6 * found.rows["time_s"].size + 3 * len(found.recording)) + 50_000


def test_estimates_and_intervals(found):
    report = found.to_dict()["process"]
    assert found.structure == report["structure"] == "soiptd" == found.model.structure
    assert found.params == {key: of["estimate"] for key, of in report.items() if key != "structure"}
    frame = found.conf_int()
    assert isinstance(frame, pd.DataFrame) and list(frame.columns) == ["low", "high"]
    assert frame.loc["tau_s"].tolist() == [report["tau_s"]["low"], report["tau_s"]["high"]]
    levels = [found.conf_int(level) for level in (0.5, 0.9, 0.99)]
    assert all((one.low >= other.low).all() and (one.high <= other.high).all() for one, other in zip(levels, levels[1:]))
    assert (levels[0].low < levels[0].high).all()
    with pytest.raises(ValueError, match="level is 90"):
        found.conf_int(90)
    draws = found.posterior
    assert draws.keys() == found.params.keys() and {values.shape for values in draws.values()} == {(4000,)}
    dataset = found.to_xarray()
    assert dict(dataset.sizes) == {"chain": 1, "draw": 4000} and np.array_equal(dataset["k"][0], draws["k"])
    with pytest.raises(ValueError, match="read-only"):
        draws["k"][0] = 1.0


def test_without_pandas_intervals_are_pairs(found, monkeypatch):
    frame = found.conf_int()
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert found.conf_int() == {key: (frame.low[key], frame.high[key]) for key in found.params}


def test_help_has_every_keyword_with_its_unit():
    for function in (onecycle.read, onecycle.identify, onecycle.identify_many, onecycle.identify_flight, onecycle.design,
                     onecycle.experiment, onecycle.expect, onecycle.campaign):
        text = inspect.getdoc(function)
        given = [name for name, of in inspect.signature(function).parameters.items() if of.kind is of.KEYWORD_ONLY]
        assert given and all(re.search(rf"^{name} : .+\n    \S", text, flags=re.M) for name in given), function
    assert "output_filter : float\n    Cutoff of a low-pass that the output passed (Hz)" in inspect.getdoc(onecycle.identify)
    # One name, three meanings.
    notes = [re.search(r"^noise : .*\n    (.*)", inspect.getdoc(of), flags=re.M)[1] for of in (onecycle.identify, onecycle.design, onecycle.experiment)]
    assert len(set(notes)) == 3


def test_draws_for_arviz(found):
    arviz = pytest.importorskip("arviz")
    table = arviz.summary(found.to_xarray())
    assert table.loc["k", "mean"] == pytest.approx(found.posterior["k"].mean(), rel=1e-2)


def test_all_of_it_for_arviz(found):
    made = found.to_arviz()
    assert np.array_equal(made.posterior["k"][0], found.posterior["k"])
    assert np.array_equal(made.observed_data["y"], found.recording.y) and np.array_equal(made.constant_data["u"], found.recording.u)
    assert np.array_equal(made.observed_data["time_s"], found.recording.t)


def test_a_frequency_response_has_bands(found):
    w = np.logspace(-1, 2, 40).reshape(4, 10)
    bands = found.frequency_response(w)
    assert np.array_equal(bands.response, found.model.frequency_response(w)) and bands.phase_low_rad.shape == w.shape
    magnitude, phase_rad = np.abs(bands.response), np.angle(bands.response)
    assert (bands.magnitude_low < magnitude).all() and (magnitude < bands.magnitude_high).all()
    assert (bands.phase_low_rad < phase_rad).all() and (phase_rad < bands.phase_high_rad).all()
    wider = found.frequency_response(w, 0.99)
    assert (wider.magnitude_low < bands.magnitude_low).all() and (wider.phase_high_rad > bands.phase_high_rad).all()
    # The draws of the table make the same band; a few of them are the nearest process to one that is none.
    draws = [onecycle.Model("soiptd", **{key: values[n] for key, values in found.posterior.items() if key not in ("k", "input_bias")})
             for n in range(4000)]
    gains = np.abs([model.frequency_response(3.0) for model in draws])
    np.testing.assert_allclose(np.quantile(gains, [0.05, 0.95]),
                               [found.frequency_response(3.0).magnitude_low[0], found.frequency_response(3.0).magnitude_high[0]], rtol=2e-3)
    with pytest.raises(onecycle.OnecycleError, match="there is no process"):
        onecycle.identify(CALM).frequency_response(w)
    with pytest.raises(ValueError, match="level is 90"):
        found.frequency_response(w, 90)


def test_rows_are_those_of_the_program(found, program):
    import json

    text = program("identify", "--json", "--rows", HOVER)
    assert onecycle.identify(HOVER).to_json(rows=True) == text
    for key, values in json.loads(text)["rows"].items():
        assert np.array_equal(found.rows[key], np.array(values, dtype=float), equal_nan=True), key
    np.testing.assert_allclose(found.fittedvalues + found.resid, found.rows["measured"], rtol=1e-12, atol=1e-15)
    assert np.array_equal(found.fittedvalues, found.rows["predicted"])
    # What the model predicts from the rows before is left with about the noise that it found: 7e-5 a sample.
    assert 0.2 < np.std(found.resid) / found.to_dict()["noise"]["sigma"] < 2
    cycles = onecycle.identify(HOVER, cycles=4)
    assert cycles.rows.keys() == {"time_s", "measured", "simulated"} and np.std(cycles.resid) < 0.1 * np.std(cycles.rows["measured"])


def test_a_refused_recording_is_a_report():
    refused = onecycle.identify(CALM)
    assert refused.model is refused.controller is refused.structure is None
    assert refused.params == refused.intervals == refused.posterior == refused.rows == {}
    assert refused.resid.size == refused.fittedvalues.size == 0 and len(refused.conf_int()) == 0
    assert refused.answer.verdict == "not_yet" and refused.answer.gains == ()
    assert refused.verdict["kind"] == "no_relay" and refused.refusal.startswith(refused.verdict["message"])


def test_the_answer_and_the_card(found, program):
    assert found.answer.verdict == found.to_dict()["answer"]["verdict"] == "first_gains"
    assert found.answer.gains[0] == onecycle.Gain("Kp", "", None, None, found.answer.gains[0].full)
    assert found.answer.gains[0].full == found.controller.kp
    card, summary = str(found).splitlines(), found.summary().splitlines()
    assert card[:9] == summary[:9] and "`summary()`" in card[-1] and len(summary) > 2 * len(card)
    assert str(onecycle.identify(HOVER)).splitlines()[:9] == program("identify", HOVER).splitlines()[:9]
    assert found._repr_html_().startswith("<pre>") and "FIRST GAINS" in found._repr_html_()


def test_a_hostile_file_name_is_text_in_a_notebook(tmp_path):
    path = tmp_path / "<img src=x onerror=alert(1)>\x1b[2J\n.csv"
    path.write_bytes((ROOT / HOVER).read_bytes())
    found = onecycle.identify(path, design=False)
    assert found.model and "<img" in str(found)
    assert "<img" not in found._repr_html_() and "&lt;img" in found._repr_html_()
    assert "\x1b" not in str(found) and "\x1b" not in found.summary()


@pytest.mark.parametrize("options", [{}, {"against": (40, 5, 12)}, {"overshoot": 0.02}, {"style": "paper"}])
def test_texts_name_keywords(options):
    found = onecycle.identify(HOVER, **options)
    for text in (str(found), found.summary(), *found.remarks, *found.details, found.answer.next):
        assert "--" not in text and '""' not in text, text
    assert "`" in str(found)


def test_a_plot_has_the_recording_and_the_model(found):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    above, _ = found.plot()
    measured, simulated = above.get_lines()
    assert np.array_equal(measured.get_ydata(), found.recording.y) and np.array_equal(simulated.get_ydata(), found.rows["simulated"])
    # Of a refused recording, into the same axes: the samples alone.
    assert len(onecycle.identify(CALM).plot(found.plot())[0].get_lines()) == 3


@pytest.mark.parametrize("options", [{}, {"style": "calm"}, {"sample_period": 0.01}, {"controller": "pd", "style": "paper"}, {"controller": "cascade_pid"}])
def test_margins_are_those_of_the_report(options):
    found = onecycle.identify(HOVER, **options)
    report = found.to_dict()["margins"]
    own = onecycle.margins(found.model, found.controller)
    assert own.is_stable
    for key in ("ms", "mt", "gain_margin", "delay_margin_s"):
        assert getattr(own, key) == pytest.approx(report[key], rel=1e-9), key
    assert np.degrees(own.phase_margin_rad) == pytest.approx(report["phase_margin_deg"], rel=1e-9)


def test_an_unstable_loop_has_no_margins():
    assert onecycle.margins(FOPTD, onecycle.Controller(1e3)) == onecycle.Margins(is_stable=False)
    with pytest.raises(onecycle.OnecycleError, match="unstable"):
        onecycle.step(FOPTD, onecycle.Controller(1e3))


def test_parameters_that_contradict_each_other_are_refused():
    of = dict(t_body_s=1.5, tau_s=0.3)
    assert onecycle.Model("foptd", k=2.0, k_over_t_body=2.0 / 1.5, **of) == FOPTD
    for given, words in [
        ({"k": 1.0, "k_over_t_body": 9.0}, "k is 1, but the other parameters make it 13.5"),
        ({}, "foptd needs k,"),
        ({"k": 0.0}, "k must be finite and not zero, but is 0"),
        ({"k": 1.0, "speed": 1.0}, "foptd has no parameter speed: its parameters are k, "),
    ]:
        with pytest.raises(onecycle.OnecycleError, match=words) as caught:
            onecycle.Model("foptd", **given, **of)
        assert caught.value.kind == "request"
    with pytest.raises(onecycle.OnecycleError, match="no structure chaos: take one of iptd"):
        onecycle.Model("chaos", k=1.0)


def test_a_double_integrator_has_a_controller():
    assert eval(repr(DOUBLE), {"Model": onecycle.Model}) == DOUBLE and DOUBLE.structure == "double_integrator_lag"
    undamped = onecycle.Model("soiptd", k_over_t_body=3.0, t_prop_s=0.1, t_body_s=np.inf, tau_s=0.02)
    assert undamped.parameters["k"] == np.inf and eval(repr(undamped), {"Model": onecycle.Model}) == undamped
    for model in (DOUBLE, undamped):
        best = onecycle.design(model)
        assert onecycle.margins(model, best.controller).ms == best.to_dict()["margins"]["ms"] < 2
        assert "Infinity" not in best.to_json()


def test_a_dead_time_is_asked_for():
    for transfer in (FOPTD.to_control, FOPTD.to_scipy):
        with pytest.raises(onecycle.OnecycleError, match=r"dead time of 0.3 s is not rational.*`pade=4`"):
            transfer()
    num, den = control.pade(0.3, 4)
    ours, theirs = FOPTD.to_control(pade=4), control.tf(2.0, [1.5, 1.0]) * control.tf(num, den)
    w = 1j * np.logspace(-2, 1, 50)
    np.testing.assert_allclose(ours(w), theirs(w), rtol=1e-9)
    # Without a dead time there is nothing to ask for.
    assert onecycle.Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.0).to_control().num[0][0].size == 1


@pytest.mark.parametrize(
    "controller",
    [
        onecycle.Controller(2.0, 0.7, 0.3, 0.05, sensor_filter=(1, 0.02), derivative_filter=(2, 0.03)),
        onecycle.Controller(2.0, kd=0.3, filter_s=0.05),
        onecycle.Controller(2.0),
        onecycle.Controller(6.0, 4.0, 2.0, 0.05, cascade=(2.0, 2.0, 1.0, 0.01), derivative_filter=(1, 0.004)),
    ],
)
def test_the_transfer_function_of_a_controller(controller):
    # Ms of the loop made of both transfer functions is that of the exact margins.
    process = onecycle.Model("soptd", k=1.0, t_prop_s=0.2, t_body_s=1.5, tau_s=0.0)
    w = np.logspace(-3, 3, 20001)
    law = controller.to_scipy()
    loop = process.frequency_response(w) * np.polyval(law.num, 1j * w) / np.polyval(law.den, 1j * w)
    assert onecycle.margins(process, controller).ms == pytest.approx(np.max(1 / np.abs(1 + loop)), rel=1e-6)
    if law.num.size <= law.den.size:
        assert scipy.signal.freqresp(law, [1.0])[1][0] == pytest.approx(controller.to_control()(1j), rel=1e-9)


@pytest.mark.parametrize(("name", "value", "plain"), [
    ("noise", np.float64(0.2), 0.2), ("noise", np.float32(0.25), 0.25), ("ms", np.array(1.5), 1.5),
    ("cycles", np.int64(4), 4), ("cycles", np.uint8(4), 4), ("against", np.array([40.0, 0.0, 12.0]), "40,0,12"),
    ("against", onecycle.Controller(40, 0, 12, 0.002), "40,0,12,0.002"), ("output_range", (0, 200), None), ("structure", np.str_("soiptd"), "soiptd"),
])
def test_scalars_of_numpy_are_settings(name, value, plain):
    if name == "output_range":
        assert onecycle.design(FOPTD, vendor="centum", output_range=value) == onecycle.design(FOPTD, vendor="centum", output_range="0..200")
        return
    assert onecycle.identify(HOVER, **{name: value}) == onecycle.identify(HOVER, **{name: plain})


@pytest.mark.parametrize("options", [
    {"sample_rate": 5}, {"time_unit": "ms"}, {"input": "u"}, {"axis": "roll"}, {"loop": "rate"}, {"flight": 1}, {"write": "x.params"}, {"tag": "A"},
])
def test_settings_of_files_are_refused_for_samples(options):
    (name,) = options
    with pytest.raises(onecycle.OnecycleError, match=f"`{name}` is for a file") as caught:
        onecycle.identify(CALM, **options)
    assert (caught.value.kind, caught.value.setting, caught.value.file) == ("request", name, None)
    assert not Path("x.params").exists()


def test_exceptions_have_attributes():
    with pytest.raises(onecycle.OnecycleError) as caught:
        onecycle.read("missing.csv")
    assert caught.value.file == "missing.csv" and caught.value.kind in ("recording", "unreadable")
    with pytest.raises(onecycle.OnecycleError) as caught:
        onecycle.identify(CALM, from_=2.0, to=1.0)
    assert caught.value.setting == "from_" and "`from_=2`" in str(caught.value)
    with pytest.raises(onecycle.OnecycleError, match="`style`: there is no such style") as caught:
        onecycle.identify(CALM, style="wild")
    assert caught.value.setting == "style"
    with pytest.raises(onecycle.OnecycleError, match="time"):
        onecycle.Recording([0, 2, 1], [0, 1, 0], [0, 0, 0])


def test_a_misspelt_keyword_is_a_type_error():
    for call, argument in [(onecycle.identify, CALM), (onecycle.read, HOVER), (onecycle.design, FOPTD), (onecycle.identify_many, [CALM])]:
        with pytest.raises(TypeError, match=rf"{call.__name__}\(\) got an unexpected keyword argument 'stile'"):
            call(argument, stile="calm")
        assert "stile" not in inspect.signature(call).parameters
    with pytest.raises(TypeError, match="do you mean 'structure'"):
        onecycle.identify(CALM, strcture="foptd")
    with pytest.raises(TypeError, match="noise is a object"):
        onecycle.identify(CALM, noise=object())


def test_keywords_are_the_settings_of_the_library():
    rust = (ROOT / "onecycle/src/request.rs").read_text()
    names = {name.rstrip("_") for name in inspect.signature(onecycle.identify).parameters} - {"recording"}
    first, last = rust.split("impl DesignRequest", 1)
    assert names == set(re.findall(r'^            "(\w+)" =>', first, flags=re.M))
    of_design = set(re.findall(r'^            "(\w+)" =>', last, flags=re.M))
    assert of_design <= set(inspect.signature(onecycle.design).parameters)
    assert inspect.signature(onecycle.identify).parameters["cycles"].annotation == "int"


USER = '''
import numpy as np
import onecycle

found = onecycle.identify("a.csv", structure="foptd", cycles=4, noise="10%", from_=1.0)
if found.model is not None and found.controller is not None:
    margin: float | None = onecycle.margins(found.model, found.controller).phase_margin_rad
draws: float = float(np.mean(found.posterior["k"])) + found.params["k"] + found.resid.sum()
reports: list[onecycle.Report] = onecycle.identify_many([onecycle.Recording([0], [1], [2])], n_jobs=2, style="calm")
ends: float = found.conf_int(0.5).loc["k", "low"] + (onecycle.expect(onecycle.Model("foptd", k=1.0), noise="1%")["k"].low or 0.0)
kp: float = onecycle.design(onecycle.Model("foptd", k=1.0, t_body_s=2.0, tau_s=0.1), controller="pi").controller.kp
'''
WRONG = {
    'onecycle.identify("a.csv", strcture="foptd")': "Unexpected keyword argument",
    'onecycle.identify("a.csv", structure="fopdt")': "Argument",
    'onecycle.read("a.csv", cycles=1)': "Unexpected keyword argument",
    "onecycle.identify_flight('a.ulg', sample_rate=5)": "Unexpected keyword argument",
    'onecycle.campaign("a.toml", case=5)': "Unexpected keyword argument",
    'onecycle.identify("a.csv").model.structure': "None",
}


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """What mypy keeps of NumPy's types and others: reading them takes most of the time."""
    return tmp_path_factory.mktemp("cache")


def mypy(cache, path, *words):
    # From another folder: the package is the installed one.
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(cache), *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=path.parent)


def test_types_are_strict_and_catch_misspelt_options(tmp_path, cache):
    user = tmp_path / "user.py"
    user.write_text(USER)
    run = mypy(cache, user, "user.py")
    assert run.returncode == 0, run.stdout
    user.write_text("import onecycle\n" + "\n".join(WRONG) + "\n")
    lines = mypy(cache, user, "user.py").stdout.splitlines()
    for number, words in enumerate(WRONG.values(), start=2):
        assert any(line.startswith(f"user.py:{number}:") and words in line for line in lines), (words, lines)


def test_the_package_is_strict_and_its_stub_is_that_of_the_module(tmp_path, cache):
    settings = tmp_path / "mypy.ini"
    settings.write_text("[mypy]\nignore_missing_imports = True\n")
    run = mypy(cache, settings, "--config-file", "mypy.ini", "-p", "onecycle")
    assert run.returncode == 0, run.stdout
    command = [sys.executable, "-m", "mypy.stubtest", "onecycle._onecycle", "--ignore-disjoint-bases"]
    command += ["--mypy-config-file", str(settings)]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
