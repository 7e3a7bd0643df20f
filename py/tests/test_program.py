"""The program in the wheel, and what Python has by it."""

import json
import os
import re
import subprocess
import sys
import time
import venv
from pathlib import Path

import numpy as np
import pytest

import onecycle
from conftest import HOVER, ROOT
from onecycle.__main__ import program as installed

pytestmark = pytest.mark.usefixtures("root")
FOPTD = onecycle.Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)


def test_one_wheel_is_the_whole_product(tmp_path, program, capfd):
    (wheel,) = Path(os.environ["ONECYCLE_WHEELS"]).glob("onecycle-*.whl")
    assert "-cp310-abi3-" in wheel.name
    venv.create(tmp_path / "venv", with_pip=True)
    scripts = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin")
    # Neither a compiler nor another Python.
    environment = {**os.environ, "PATH": str(scripts)}

    def run(*words):
        return subprocess.run(list(map(str, words)), capture_output=True, text=True, env=environment, cwd=ROOT)

    begin = time.perf_counter()
    made = run(scripts / "python", "-m", "pip", "install", "-q", wheel)
    assert made.returncode == 0, made.stderr
    with capfd.disabled():
        print(f"\ninstalled in {time.perf_counter() - begin:.1f} s")
    told = run(scripts / "python", "-m", "onecycle", "identify", HOVER)
    assert told.returncode == 0 and told.stdout == program("identify", HOVER), told.stderr
    assert run(scripts / "onecycle", "--version").stdout == f"onecycle {onecycle.__version__}\n"
    assert run(scripts / "python", "-m", "onecycle", "identify", "missing.csv").returncode == 3
    # What belongs to the research is another program.
    told = run(scripts / "python", "-m", "onecycle", "train")
    assert told.returncode == 2 and "train is a command of onecycle-lab" in told.stderr
    assert run(scripts / "python", "-c", f"import onecycle; print(onecycle.identify({HOVER!r}).structure)").stdout == "soiptd\n"


def test_the_lab_has_its_program_too():
    told = subprocess.run([sys.executable, "-m", "onecycle_lab", "certify", "--help"], capture_output=True, text=True)
    assert told.returncode == 0 and "certify" in told.stdout


def test_a_package_without_a_program_says_so():
    assert installed().name.startswith("onecycle")
    with pytest.raises(onecycle.OnecycleError, match="built without the program numpy"):
        installed("numpy")


EXPERIMENTS = [
    (FOPTD, {"excitation": "step", "duration": 20, "sample_rate": 20, "noise": 0.05, "offset": "30%"},
     "--process=foptd --k=2 --t-body=1.5 --tau=0.3 --excitation=step --duration=20 --sample-rate=20 --noise=0.05 --offset=30%"),
    (onecycle.Model("soiptd", k_over_t_body=40.0, t_prop_s=0.05, t_body_s=np.inf, tau_s=0.015),
     {"noise": "1%", "bias": "30%", "seed": 7, "asymmetry": 0.2, "second_amplitude": 0.6, "disturbance": {"walk": "5%", "w1": 3.0}},
     "--k-over-t-body=40 --t-prop=0.05 --t-body=inf --tau=0.015 --noise=1% --bias=30% --seed=7 --asymmetry=0.2 --second-amplitude=0.6 "
     "--disturbance=walk=5%,w1=3"),
    (onecycle.Model("double_integrator_lag", k_over_t_body=40.0, t_prop_s=0.05, tau_s=0.015),
     {"excitation": "chirp", "band": (0.5, 10), "duration": 8, "loop": (0.5, 0.1), "inject": "setpoint", "gust": (0.05, 0.5), "bare": False},
     "--process=double_integrator_lag --k-over-t-body=40 --t-prop=0.05 --tau=0.015 --excitation=chirp --band=0.5,10 --duration=8 "
     "--loop=0.5,0.1 --inject=setpoint --gust=0.05,0.5"),
    (onecycle.Model("resonant", k=1.5, natural_frequency_rad_per_s=6.0, zeta=0.2, tau_s=0.01),
     {"beta": -0.5, "duration": 9, "no_trim": True, "outliers": ("1%", 2.0), "drop_outs": 0.01, "jitter": "1%"},
     "--process=resonant --k=1.5 --natural-frequency=6 --zeta=0.2 --tau=0.01 --beta=-0.5 --duration=9 --no-trim "
     "--outliers=1%,2 --drop-outs=0.01 --jitter=1%"),
]


@pytest.mark.parametrize(("model", "options", "words"), EXPERIMENTS, ids=lambda of: getattr(of, "structure", ""))
def test_experiments_are_those_of_the_program(model, options, words, program, tmp_path):
    (tmp_path / "x.csv").write_text(program("simulate", *words.split()))
    ours, theirs = onecycle.experiment(model, **options), onecycle.read(tmp_path / "x.csv")
    assert np.array_equal(ours.t, theirs.t) and np.array_equal(ours.u, theirs.u) and np.array_equal(ours.y, theirs.y)
    assert (ours.r is None) == ("loop" not in options) and len(ours) > 100


def test_every_option_of_simulate_is_a_keyword(program):
    from onecycle._options import ExperimentOptions

    options = set(re.findall(r"^  (?:-\w, |    )--([a-z0-9-]+)", program("simulate", "--help"), flags=re.M))
    # Of the process, of the output, and `expect`, which is a function.
    process = {"process", "k", "k-over-t-body", "t-prop", "t-prop2", "t-body", "tau", "natural-frequency", "zeta"}
    others = {"out", "help", "expect", "json"}
    assert process | others < options
    assert options - process - others == {name.replace("_", "-") for name in ExperimentOptions.__annotations__}


def test_intervals_to_expect_are_those_of_the_program(program):
    model, options, words = EXPERIMENTS[0]
    options = options | {"preroll": 5}
    expected = onecycle.expect(model, **options)
    told = json.loads(program("simulate", *words.split(), "--preroll=5", "--expect", "--json"))
    assert told.pop("structure") == "foptd" and list(told) == list(expected) and len(told) > 2
    for key, of in expected.items():
        assert (of.estimate, of.low, of.high) == (told[key]["estimate"], told[key]["low"], told[key]["high"])
    # An efficient estimator reaches them: of 40 recordings 90 % agree, and at least 30 with a probability of 99.5 %.
    recordings = [onecycle.experiment(model, **options, seed=seed) for seed in range(40)]
    reports = onecycle.identify_many(recordings, structure="foptd", design=False)
    assert sum(expected["tau_s"].low < found.params["tau_s"] < expected["tau_s"].high for found in reports) >= 30
    with pytest.raises(onecycle.OnecycleError, match="`noise`"):
        onecycle.expect(model, excitation="step", duration=20)


def test_an_experiment_that_cannot_be_made_is_a_sentence():
    with pytest.raises(onecycle.OnecycleError, match="`pulse`") as caught:
        onecycle.experiment(FOPTD, excitation="prbs", duration=10)
    assert "--" not in str(caught.value) and "error" not in str(caught.value)
    with pytest.raises(TypeError, match="do you mean 'noise'"):
        onecycle.experiment(FOPTD, niose=1)
