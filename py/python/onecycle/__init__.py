"""From a recording of a control loop to a process model with 90 % intervals and a controller.

    found = onecycle.identify("flight.csv")
    print(found)
    found.model.frequency_response([1.0, 10.0])

Keywords are the settings of a request, the options of `onecycle identify` with underscores: `structure="foptd"`,
`sample_rate=100`. Sentences name them in backticks.
"""

from __future__ import annotations

import os
from functools import cached_property
from math import isfinite

import numpy as np

from . import _onecycle
from ._onecycle import OnecycleError, __version__

__all__ = [
    "Controller", "Flight", "Identification", "Model", "OnecycleError", "Recording", "__version__",
    "campaign", "dataset", "design", "identify", "identify_flight", "margins", "read", "simulate", "step",
]


def _settings(given):
    """Settings of a request: `sample_rate=100`; an underscore at the end is left out, as of `from_=10.5`."""
    plain = (bool, int, float, str, list, tuple)
    return {
        name.rstrip("_"): value if isinstance(value, plain) else str(value)
        for name, value in given.items() if value is not None
    }


def _finite(value):
    """As JSON has it: lists, and None for infinite numbers."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _samples(values):
    return np.ascontiguousarray(values, dtype=np.float64)


class Recording:
    """Time stamps `t` (s), process input `u` and process output `y`, and for a closed loop its set-point `r`."""

    def __init__(self, t, u, y, r=None):
        r = None if r is None else _samples(r)
        self._inner = _onecycle.Recording(_samples(t), _samples(u), _samples(y), r)
        self.name = "recording"

    @classmethod
    def from_pandas(cls, frame, input="u", output="y", set_point=None):
        """Columns of a DataFrame whose index is the time, in seconds or as dates."""
        index = frame.index
        if hasattr(index, "asi8") and not np.issubdtype(index.dtype, np.number):
            t = (index - index[0]).total_seconds()
        else:
            t = index
        return cls(t, frame[input], frame[output], None if set_point is None else frame[set_point])

    def to_pandas(self):
        import pandas

        columns = {"u": self.u, "y": self.y}
        if self.r is not None:
            columns["r"] = self.r
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    t = property(lambda self: self._inner.t)
    u = property(lambda self: self._inner.u)
    y = property(lambda self: self._inner.y)
    r = property(lambda self: self._inner.r)
    sample_period_s = property(lambda self: self._inner.sample_period_s)

    def __len__(self):
        return len(self._inner)


def read(path, **options) -> Recording:
    """Reads a table, or a loop of a flight log: `read("flight.ulg", axis="roll", loop="rate")`. Of a flight log it is the part
    that tells most about the loop, or the one that `from_` and `to` choose."""
    recording = Recording.__new__(Recording)
    recording._inner = _onecycle.read(os.fspath(path), _settings(options))
    recording.name = os.fspath(path)
    return recording


class Controller:
    """`u = kp (b r - yf) + ki int (r - yf) - kd dyf/dt` with the measurement filter of docs/identify-json.md."""

    def __init__(self, kp, ki=0.0, kd=0.0, filter_s=0.0, setpoint_weight=1.0):
        self.kp, self.ki, self.kd = float(kp), float(ki), float(kd)
        self.filter_s, self.setpoint_weight = float(filter_s), float(setpoint_weight)

    def _gains(self):
        return [self.kp, self.ki, self.kd, self.filter_s, self.setpoint_weight]

    def __repr__(self):
        return "Controller(kp=%r, ki=%r, kd=%r, filter_s=%r, setpoint_weight=%r)" % tuple(self._gains())


class Model:
    """A process: `Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)`, keys as in docs/identify-json.md."""

    def __init__(self, structure, **parameters):
        self._inner = _onecycle.Model(structure, **parameters)

    @classmethod
    def _of(cls, inner):
        model = cls.__new__(cls)
        model._inner = inner
        return model

    @property
    def structure(self) -> str:
        return self._inner.structure

    @property
    def parameters(self) -> dict:
        return dict(self._inner.parameters)

    @property
    def dead_time_s(self) -> float:
        return self._inner.factors()[2]

    def _polynomials(self):
        gain, factors, _ = self._inner.factors()
        denominator = np.ones(1)
        for factor in factors:
            denominator = np.polymul(denominator, factor)
        return [gain], denominator

    def to_scipy(self):
        """`scipy.signal.TransferFunction` of the process without its dead time, which is `dead_time_s`."""
        from scipy.signal import TransferFunction

        return TransferFunction(*self._polynomials())

    def to_control(self, pade=0):
        """`control.TransferFunction`; `pade` is the order of the approximation of the dead time, 0 leaves it out."""
        import control

        process = control.tf(*self._polynomials())
        return process * control.tf(*control.pade(self.dead_time_s, pade)) if pade else process

    def frequency_response(self, w) -> np.ndarray:
        """Complex gain at the frequencies `w` (rad/s), with the exact dead time."""
        w = np.asarray(w, dtype=np.float64)
        return self._inner.frequency_response(np.ascontiguousarray(w).reshape(-1)).reshape(w.shape)

    def __repr__(self):
        given = "".join(f", {key}={value!r}" for key, value in self.parameters.items())
        return f"Model({self.structure!r}{given})"


class Flight:
    """What a flight log says about each of its loops. `print(flight)` shows the table of the program."""

    def __init__(self, inner):
        self._inner = inner

    def to_dict(self) -> dict:
        """The JSON report `onecycle.flight/1` of the program: docs/identify-json.md."""
        return _finite(self._inner.dict())

    def to_json(self) -> str:
        """The text that `onecycle identify LOG --json` prints."""
        return self._inner.json()

    def __str__(self):
        return self._inner.text()

    def _repr_html_(self):
        return _preformatted(str(self))


def _preformatted(text):
    from html import escape

    return f"<pre>{escape(text)}</pre>"


class Identification:
    """What a recording says about its process."""

    def __init__(self, inner):
        self._inner = inner

    @cached_property
    def _dict(self):
        return _finite(self._inner.dict())

    @property
    def model(self) -> Model | None:
        inner = self._inner.model()
        return None if inner is None else Model._of(inner)

    @property
    def intervals(self) -> dict:
        """Estimate, low and high of every parameter; a value that is unbounded is None."""
        found = self._dict["process"] or {}
        return {key: value for key, value in found.items() if isinstance(value, dict)}

    @property
    def posterior(self) -> dict:
        """Draws from the posterior: one array for each parameter."""
        return dict(self._inner.posterior())

    @property
    def controller(self) -> Controller | None:
        given = self._dict["controller"]
        keys = ("kp", "ki", "kd", "filter_s", "setpoint_weight")
        return None if given is None else Controller(**{key: given[key] for key in keys})

    @property
    def verdict(self):
        return self._dict["verdict"]

    @property
    def refusal(self) -> str | None:
        """Why no process was identified and what to do; None if one was."""
        return self._inner.refusal()

    @property
    def remarks(self) -> list:
        """Reasons to suspect the result, in sentences; their fixed names are `to_dict()["remark_kinds"]`."""
        return self._dict["remarks"]

    @property
    def details(self) -> list:
        """All other remarks, in sentences: how the result was found, what no such test shows, what the controller asks for."""
        return self._dict["details"]

    @property
    def took_s(self) -> float:
        """Time that the identification took (s)."""
        return self._inner.took_s

    def to_dict(self) -> dict:
        """The JSON report of the program: docs/identify-json.md; its sentences name settings as keywords."""
        return _finite(self._inner.dict())

    def to_json(self) -> str:
        """The text that `onecycle identify --json` prints."""
        return self._inner.json()

    def report(self, path):
        """Writes the HTML page of `onecycle identify --report`."""
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(self._inner.page())

    def __str__(self):
        return self._inner.text()

    def _repr_html_(self):
        return _preformatted(str(self))


def identify(recording, **options) -> Identification:
    """Identifies from a `Recording` or from a file. Of a flight log, choose a loop: `axis="roll"`, `loop="rate"`; its gains
    in force are judged too."""
    asked = _settings(options)
    if isinstance(recording, Recording):
        return Identification(_onecycle.identify_recording(recording.name, recording._inner, asked))
    return Identification(_onecycle.identify_file(os.fspath(recording), asked))


def identify_flight(path, **options) -> Flight:
    """Identifies every loop of a flight log from the parts of the flight worth using."""
    return Flight(_onecycle.identify_flight(os.fspath(path), _settings(options)))


def design(model: Model, **options) -> dict:
    """The JSON report of `onecycle tune` for a process: `design(model, controller="pi", style="calm")`."""
    return _finite(_onecycle.design(model._inner, _settings(options)))


_MARGINS = (
    "phase_margin_rad", "gain_crossover_rad_per_s", "gain_margin", "phase_crossover_rad_per_s", "delay_margin_s",
    "ms", "mt",
)


def margins(model: Model, controller: Controller) -> dict | None:
    """Stability margins with the exact dead time; None without positive gain."""
    values = model._inner.margins(controller._gains())
    return None if values is None else dict(zip(_MARGINS, values))


def step(model: Model, controller: Controller):
    """Time (s), output and input of the loop after a unit step of the reference."""
    return tuple(np.array(column) for column in model._inner.step(controller._gains()))


def simulate(model: Model, u, sample_s) -> np.ndarray:
    """Output at every tick, from rest, under an input held over each tick of `sample_s` seconds. Exact, with the dead time."""
    return model._inner.simulate(_samples(u), float(sample_s))


def campaign(recipe, client=None, out=None, shard=64, progress=None, **options):
    """Runs a campaign (a TOML file) on Dask and returns its outcomes.

    `client` is a `distributed.Client`; without one, workers are started on this machine. A task is `shard` cases. In the
    folder `out` every shard leaves a Parquet file, and finished shards found there are not computed again.
    `progress(done, count)` is called after each shard. Options are those of `onecycle-lab campaign`: `cases=1000`.
    """
    from ._cluster import run

    words = [f"--{name.replace('_', '-')}={value}" for name, value in _settings(options).items()]
    return run(recipe, client, out, shard, progress, tuple(words))


def dataset(recipe, examples, into, client=None, progress=None, restart=False):
    """Makes a training set on Dask in the folder `into`: the files of `onecycle-lab dataset`, to the bit.

    `recipe` is a TOML file, or None for the paper's multirotors. The same call resumes an interrupted run.
    """
    from ._cluster import fill

    return fill(recipe, examples, into, client, progress, restart)
