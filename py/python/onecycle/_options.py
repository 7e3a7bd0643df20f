"""The settings of a request as keywords. One that is a word of Python ends with an underscore: `from_`."""

from __future__ import annotations

import ast
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from functools import lru_cache
from operator import index
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar, Union

if TYPE_CHECKING:
    from ._model import Controller

Path = Union[str, "os.PathLike[str]"]
#: A share of a whole: 0.05 or "5%".
Share = Union[float, str]
Structure = Literal[
    "iptd", "integrator_lag", "double_integrator_lag", "soiptd", "toiptd", "foptd", "soptd", "toptd", "resonant", "resonant_lag"
]


class TableOptions(TypedDict, total=False):
    """How a table is read."""

    time: str | int
    """Time column: its name, or its number from 1."""
    input: str | int
    """Column of the process input."""
    output: str | int
    """Column of the process output."""
    set_point: str | int
    """Column of the set-point of a closed loop."""
    tag: str
    """Control loop of a table with the signals of many, such as "LIC101"."""
    sample_rate: float
    """Samples per second (Hz), instead of a time column."""
    time_unit: Literal["d", "h", "min", "s", "ms", "us", "ns"]
    """Unit of the time column."""
    dbc: str
    """Path of the DBC file that names the signals of a CAN bus."""


class LogOptions(TypedDict, total=False):
    """The loop of a flight log."""

    axis: Literal["roll", "pitch", "yaw"]
    """Axis of the vehicle."""
    loop: Literal["rate", "attitude", "altitude"]
    """What the loop controls."""
    flight: int
    """Flight of the log, from 1; else the longest."""


class PartOptions(TypedDict, total=False):
    """The part of a recording."""

    from_: float
    """First time to use (s)."""
    to: float
    """Last time to use (s)."""


class ControllerOptions(TypedDict, total=False):
    """What is asked of a controller."""

    style: Literal["paper", "sharp", "balanced", "calm"]
    """Compromise between speed and robustness; else "balanced"."""
    controller: Literal["p", "pi", "pd", "pid", "cascade_pi", "cascade_pid"]
    """Its form."""
    ms: float
    """Limit of Ms and Mt, 1.05 to 10."""
    phase_margin: float
    """Least phase margin (deg)."""
    gain_margin: float
    """Least gain margin, as a factor."""
    input_peak: float
    """Largest controller output after a unit step of the reference (input unit)."""
    overshoot: Share
    """Largest overshoot, as a share of the step."""
    sample_period: float
    """Sample period of the controller (s); its output leaves one period after the sample."""
    against: Controller | tuple[float, float, float] | tuple[float, float, float, float] | Path
    """Gains in force to compare with: a controller, (kp, ki, kd) or (kp, ki, kd, filter_s), or a file that has them."""
    vendor: str
    """Controller that takes the gains, such as "klipper"."""
    output_range: tuple[float, float] | str
    """Range of its measurement, (0, 200) or "0..200"."""
    input_range: tuple[float, float] | str
    """Range of its output."""


class DesignOptions(ControllerOptions, total=False):
    """The keywords of `design`."""

    noise: float
    """Standard deviation of the measurement noise of one sample (output unit); needs `sample_period`."""
    input_amplitude: float
    """Amplitude of the input with which noise at the actuator is compared (input unit); else 1."""


class EstimateOptions(PartOptions, ControllerOptions, total=False):
    """The keywords of `identify` for a recording in memory."""

    noise: Share
    """Largest noise at the actuator, as a share of the input's amplitude."""
    structure: Structure
    """Structure of the process; else the simplest that explains the recording."""
    unstable: bool
    """The process is known to be unstable without its controller: a model with one unstable pole is fitted."""
    hold: Literal["held", "interpolated"]
    """Input between two samples; else the likelihood decides."""
    input_late: float
    """Time by which the input was logged late (s)."""
    input_before: float
    """Input before the first row, under which the process was at rest (input unit)."""
    output_filter: float
    """Cutoff of a low-pass that the output passed (Hz); 0 for none."""
    beta: float
    """Switching ratio of the relay, between -1 and 1."""
    cycles: int
    """Take the last cycles of a relay test, 1 to 50, with the estimator of the board."""
    method: Literal["map", "refine", "classify"]
    """Its method."""
    pack: Path
    """Its network."""


class ReadOptions(TableOptions, LogOptions, PartOptions, total=False):
    """The keywords of `read`."""


class FlightOptions(LogOptions, EstimateOptions, total=False):
    """The keywords of `identify_flight`."""

    write: Path
    """File for the parameters with the proposed gains; one that restores the old ones is written beside it."""
    step: Share
    """Share of the way to the proposed gains that is written; else 0.5."""
    below_limits: bool
    """Write gains that break a limit of the style."""


class IdentifyOptions(TableOptions, FlightOptions, total=False):
    """The keywords of `identify`."""

    design: bool
    """False leaves out the controllers to choose from."""


class ExperimentOptions(TypedDict, total=False):
    """The keywords of `experiment`. A size is a number in its unit, or a text such as "5%": of the test's amplitude at the input, of the
    noise-free amplitude at the output."""

    excitation: Literal["relay", "step", "doublet", "3-2-1-1", "prbs", "chirp", "multisine"]
    """Test signal; else a relay."""
    amplitude: float
    """Its amplitude (input unit; output unit at the set-point); else 1."""
    second_amplitude: float
    """Amplitude of the relay in the second half of the test."""
    pulse: float
    """Half of a doublet, unit of 3-2-1-1, bit of a PRBS (s)."""
    band: tuple[float, float]
    """Lowest and highest frequency of a chirp or a multisine (Hz)."""
    sines: int
    """Number of sines of a multisine, 2 to 1000; else 12."""
    loop: tuple[float, float] | tuple[float, float, float]
    """Closes the loop with a PD controller: kp, kd and the time of its filter (s)."""
    inject: Literal["input", "setpoint"]
    """Where the test signal enters the closed loop; else at the input."""
    beta: float
    """Switching ratio of the relay, between -1 and 1."""
    no_trim: bool
    """Keep the centre of the relay fixed."""
    asymmetry: Share
    """Difference of high and low time that the trim leaves, as a share of the cycle, 0 to 0.5."""
    bare: bool
    """Plain relay, without smoothing and minimum switching time."""
    preroll: float
    """Time before the test signal (s); else 0.1."""
    bias: Share
    """Constant input disturbance, not recorded (input unit)."""
    gust: tuple[Share, float]
    """Gusts at the input: standard deviation (input unit) and correlation time (s)."""
    disturbance: Mapping[Literal["walk", "white", "output-walk", "w1", "w0", "wy"], Share]
    """Further disturbances, each by its strength: `onecycle simulate --help`."""
    noise: Share
    """Standard deviation of the measurement noise (output unit)."""
    quantum: Share
    """Resolution of the sensor (output unit)."""
    outliers: Share | tuple[Share, Share]
    """Share of the samples with an outlier, and its size (output unit)."""
    drop_outs: Share
    """Share of the samples that the sensor drops."""
    jitter: Share
    """Standard deviation of the sample period (s, or a share of it as text)."""
    offset: Share
    """Initial output (output unit)."""
    reference: float
    """Reference of the output (output unit)."""
    sample_rate: float
    """Sample rate (Hz); else 1000."""
    duration: float
    """Duration (s)."""
    seed: int
    """Seed of noise, disturbances and jitter; else 0."""


class CampaignOptions(TypedDict, total=False):
    """The keywords of `campaign`, instead of what its file says."""

    cases: int
    """Number of cases, 1 to ten million."""
    cycles: int
    """Number of cycles to fit, 1 to 50."""
    method: Literal["map", "refine", "classify"]
    """Identification method."""
    sigma: Share
    """Standard deviation of the noise, as a share of the amplitude."""
    time_scale: float
    """Factor of all times, the sample period included."""


def as_keywords(sentence: str) -> str:
    """A sentence of the program with its options as keywords."""
    return re.sub(r"--([a-z][a-z0-9-]*)(?: <[A-Z,_]+>)?", lambda found: f"`{found[1].replace('-', '_')}`", sentence)


def _text(name: str, value: Any) -> str:
    """A value as the settings of the library have it."""
    if getattr(value, "ndim", None) == 0:
        # A scalar of NumPy.
        value = value.item()
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if hasattr(value, "kp"):
        value = (value.kp, value.ki, value.kd, value.filter_s)
    if isinstance(value, Mapping):
        return ",".join(f"{key}={_text(name, one)}" for key, one in value.items())
    if isinstance(value, Iterable):
        between = ".." if name.endswith("_range") else ","
        return between.join(_text(name, one) for one in value)
    if isinstance(value, bool):
        return str(value).lower()
    try:
        return str(index(value))
    except TypeError:
        pass
    try:
        return repr(float(value))
    except (TypeError, ValueError):
        raise TypeError(f"{name} is a {type(value).__name__}: give a number or a text") from None


def settings(function: str, kind: Any, given: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The given keywords as settings of the library. A TypeError names one that there is not."""
    known = inspect.get_annotations(kind)
    for name in given:
        if name not in known:
            near = get_close_matches(name, known, 1)
            hint = f": do you mean {near[0]!r}?" if near else ""
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{hint}")
    return [(name.rstrip("_"), _text(name, value)) for name, value in given.items() if value is not None]


def _source(annotation: Any) -> str:
    return str(getattr(annotation, "__forward_arg__", annotation))


@lru_cache(maxsize=1)
def _notes() -> dict[str, dict[str, str]]:
    """What stands below the keywords of each class of this file, and of those that it extends."""
    try:
        body = ast.parse(inspect.getsource(sys.modules[__name__])).body
    except (OSError, TypeError):
        return {}
    notes: dict[str, dict[str, str]] = {}
    for kind in body:
        if isinstance(kind, ast.ClassDef):
            of = notes[kind.name] = {}
            for base in kind.bases:
                of |= notes.get(getattr(base, "id", ""), {})
            for keyword, note in zip(kind.body, kind.body[1:]):
                if isinstance(keyword, ast.AnnAssign) and isinstance(note, ast.Expr):
                    of[ast.unparse(keyword.target)] = inspect.cleandoc(ast.literal_eval(note.value))
    return notes


F = TypeVar("F", bound=Callable[..., object])


def keywords(kind: Any) -> Callable[[F], F]:
    """Shows the keywords of `kind` in the signature and the documentation of a function that takes them as `**options`."""

    def shown(function: F) -> F:
        signature = inspect.signature(function)
        fixed = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        types = inspect.get_annotations(kind)
        named = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_source(types[name])) for name in types]
        function.__signature__ = signature.replace(parameters=[*fixed, *named])  # type: ignore[attr-defined]
        notes = _notes().get(kind.__name__, {})
        about = "".join(f"\n{name} : {_source(types[name])}\n    {notes[name]}" for name in types if name in notes)
        function.__doc__ = f"{inspect.cleandoc(function.__doc__ or '')}\n\nKeywords\n--------{about}\n"
        return function

    return shown
