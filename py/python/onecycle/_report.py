"""Reports: what an identification, a flight and a design tell."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cached_property
from html import escape
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from . import _onecycle
from ._model import Controller, Interval, Model
from ._onecycle import OnecycleError
from ._recording import Recording

if TYPE_CHECKING:
    from collections.abc import Mapping

    import matplotlib.axes
    import pandas
    import xarray
    from numpy.typing import ArrayLike, NDArray

    Arrays = Mapping[str, NDArray[np.float64]]

T = TypeVar("T")


def _read_only(values: dict[str, T]) -> Mapping[str, T]:
    """A dict that nobody changes, nor its arrays."""
    for value in values.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return MappingProxyType(values)


def bare(source: Any) -> Any:
    """A recording, a model or the name of a file as the module takes it."""
    if isinstance(source, Recording):
        return source.name, source._inner
    return source._inner if isinstance(source, Model) else os.fspath(source)


class _Shown:
    """A report. It is immutable, and equal to another one that says the same.

    It is read from the result in Rust as it is asked for. That is not pickled: what a pickled report does not hold is identified again
    from what it was made of, which gives the same bits.
    """

    #: What is pickled.
    _kept: tuple[str, ...] = ("_again", "_raw", "_card")
    #: The function of the module that made it, from what, and with which settings.
    _again: tuple[str, Any, list[tuple[str, str]]]

    def __init__(self, call: str, source: Any, asked: list[tuple[str, str]], inner: Any = None) -> None:
        self.__dict__["_again"] = (call, source, asked)
        self.__dict__["_inner"] = self._made() if inner is None else inner

    def _made(self) -> Any:
        call, source, asked = self._again
        return getattr(_onecycle, call)(bare(source), asked)

    @cached_property
    def _inner(self) -> Any:
        return self._made()

    @cached_property
    def _raw(self) -> str:
        return str(self._inner.raw())

    @cached_property
    def _card(self) -> str:
        return str(self._inner.text(False))

    @cached_property
    def _dict(self) -> dict[str, Any]:
        """Read once, for what is looked up in it."""
        return self.to_dict()

    def to_dict(self) -> dict[str, Any]:
        """The JSON report of the program as a new dict: docs/identify-json.md. Its sentences name settings in backticks."""
        made: dict[str, Any] = json.loads(self._raw)
        return made

    def to_json(self) -> str:
        """The text that the program prints with `--json`."""
        return _onecycle.with_options(self._raw)

    def summary(self) -> str:
        """The report in full, as text."""
        return str(self._inner.text(True))

    def __str__(self) -> str:
        return self._card

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self._raw == other._raw

    __hash__ = None  # type: ignore[assignment]

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a {type(self).__name__} is immutable: {name} cannot be set")

    def __copy__(self: T) -> T:
        return self

    def __deepcopy__(self: T, memo: object) -> T:
        return self

    def __getstate__(self) -> dict[str, Any]:
        kept = {name: getattr(self, name) for name in self._kept}
        return {name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in kept.items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Dicts and arrays forget in a pickle that they are read-only.
        self.__dict__.update({name: _read_only(value) if isinstance(value, dict) else value for name, value in state.items()})


@dataclass(frozen=True)
class Gain:
    """A gain to type in: in force, half of the way, and proposed; None if not known, or out of the firmware's range."""

    name: str
    unit: str
    now: float | None
    half: float | None
    full: float | None


@dataclass(frozen=True)
class Answer:
    """What to do."""

    verdict: Literal["change", "keep", "first_gains", "not_yet"]
    reason: str
    gains: tuple[Gain, ...]
    sure: str | None
    """How well the process is known."""
    watch: str | None
    """The remark that matters most."""
    next: str


@dataclass(frozen=True)
class Bands:
    """A frequency response with pointwise bands; arrays over `w`."""

    w: NDArray[np.float64]
    """Frequency (rad/s)."""
    response: NDArray[np.complex128]
    """Complex gain of the process."""
    magnitude_low: NDArray[np.float64]
    magnitude_high: NDArray[np.float64]
    phase_low_rad: NDArray[np.float64]
    """On the turn of `numpy.angle(response)`."""
    phase_high_rad: NDArray[np.float64]


def _check_level(level: float) -> None:
    if not 0.0 < level < 1.0:
        raise ValueError(f"level is {level}: give a number between 0 and 1, such as 0.9")


class Report(_Shown):
    """What a recording says about its process. `print(report)` shows the answer, `report.summary()` all else."""

    _kept = (*_Shown._kept, "_data", "posterior", "rows", "recording", "took_s")

    @cached_property
    def _data(self) -> Mapping[str, Any]:
        """What is cheap to read."""
        inner: _onecycle.Found = self._inner
        model, controller, answer = inner.model(), inner.controller(), json.loads(inner.answer())
        gains = tuple(Gain(**gain) for gain in answer["gains"])
        return {
            "model": None if model is None else Model._of(model),
            "controller": None if controller is None else Controller(**controller),
            "intervals": {key: Interval(*ends) for key, ends in inner.intervals()},
            "refusal": inner.refusal(),
            "answer": Answer(answer["verdict"], answer["reason"], gains, answer["sure"], answer["watch"], answer["next"]),
        }

    @property
    def model(self) -> Model | None:
        """The process; None if it was refused."""
        made: Model | None = self._data["model"]
        return made

    @property
    def structure(self) -> str | None:
        """Its structure."""
        return None if self.model is None else self.model.structure

    @property
    def controller(self) -> Controller | None:
        """The proposed controller with its execution; None if no controller keeps the limits or the process was refused."""
        made: Controller | None = self._data["controller"]
        return made

    @property
    def answer(self) -> Answer:
        """What to do, with the gains to type in."""
        made: Answer = self._data["answer"]
        return made

    @property
    def refusal(self) -> str | None:
        """Why no process was identified and what to do; None if one was."""
        made: str | None = self._data["refusal"]
        return made

    @property
    def intervals(self) -> Mapping[str, Interval]:
        """Estimate and 90 % interval of every parameter, by key. Empty if the process was refused."""
        return MappingProxyType(self._data["intervals"])

    @property
    def params(self) -> dict[str, float]:
        """Estimate of every parameter, by key; infinite where no damping is seen."""
        return {key: np.inf if of.estimate is None else of.estimate for key, of in self.intervals.items()}

    def conf_int(self, level: float = 0.9) -> pandas.DataFrame:
        """Ends of the central interval of every parameter: a DataFrame with the columns `low` and `high`; without pandas, a dict of
        pairs. Of 90 % they are those of the report; of other levels quantiles of the draws, not inside (or outside) of them."""
        _check_level(level)
        found = {key: self._ends(key, of, level) for key, of in self.intervals.items()}
        try:
            import pandas
        except ImportError:
            return found
        return pandas.DataFrame.from_dict(found, orient="index", columns=["low", "high"])

    def _ends(self, key: str, of: Interval, level: float) -> tuple[float, float]:
        low = -np.inf if of.low is None else of.low
        high = np.inf if of.high is None else of.high
        draws = self.posterior[key]
        if level == 0.9 or not draws.size:
            return low, high
        within = np.quantile(draws, [0.5 - 0.5 * level, 0.5 + 0.5 * level])
        wider = level > 0.9
        return (min if wider else max)(low, float(within[0])), (max if wider else min)(high, float(within[1]))

    @cached_property
    def posterior(self) -> Arrays:
        """4,000 draws of every parameter, by key: those of one place in the arrays belong together."""
        return _read_only(dict(self._inner.posterior()))

    def to_xarray(self) -> xarray.Dataset:
        """The draws as a Dataset over `chain` (one) and `draw`, which arviz takes: `arviz.summary(report.to_xarray())`."""
        import xarray

        return xarray.Dataset({key: (("chain", "draw"), values[np.newaxis]) for key, values in self.posterior.items()})

    def to_arviz(self) -> Any:
        """The draws and the recording for arviz, in the groups `posterior`, `observed_data` and `constant_data`: its InferenceData, or
        from arviz 1 on a DataTree."""
        import arviz
        import xarray

        of = self.recording
        groups: dict[str, Any] = {"posterior": self.to_xarray()} | {
            group: xarray.Dataset({key: ("time_s", values)}, {"time_s": of.t})
            for group, key, values in (("observed_data", "y", of.y), ("constant_data", "u", of.u))
        }
        return arviz.InferenceData(**groups) if hasattr(arviz, "InferenceData") else xarray.DataTree.from_dict(groups)

    def frequency_response(self, w: ArrayLike, level: float = 0.9) -> Bands:
        """Frequency response of the process at the frequencies `w` (rad/s), with the bands of the posterior at this level. OnecycleError
        if the process was refused."""
        _check_level(level)
        if self.model is None:
            raise OnecycleError(f"there is no process: {self.refusal}")
        at = np.atleast_1d(np.asarray(w, dtype=np.float64))
        response = self.model.frequency_response(at)
        draws = self._inner.responses(np.ascontiguousarray(at.reshape(-1))).reshape(-1, *at.shape)
        ends = [0.5 - 0.5 * level, 0.5 + 0.5 * level]
        phase_rad = np.angle(response)
        # The phase of a draw beside that of the model: no turn lies between them.
        return Bands(at, response, *np.quantile(np.abs(draws), ends, axis=0),
                     *(phase_rad + np.quantile(np.angle(draws / response), ends, axis=0)))

    @cached_property
    def rows(self) -> Arrays:
        """The fit row by row, as arrays of equal length: `time_s`, `measured`, `simulated` (without disturbances),
        and of a fit to the whole recording `predicted` (from the rows before), `innovation` (error of the prediction over its
        deviation) and `disturbance` (at the input). Empty without a fit in time."""
        return _read_only(dict(self._inner.rows()))

    @property
    def fittedvalues(self) -> NDArray[np.float64]:
        """Output of the model in every row: predicted from the rows before, or simulated if cycles were fitted."""
        return self.rows.get("predicted", self.rows.get("simulated", np.empty(0)))

    @property
    def resid(self) -> NDArray[np.float64]:
        """Measured output less `fittedvalues`."""
        return self.rows.get("measured", np.empty(0)) - self.fittedvalues

    @cached_property
    def recording(self) -> Recording:
        """The recording, of a flight log the part that was used."""
        source = self._again[1]
        return source if isinstance(source, Recording) else Recording._of(*self._inner.recording())

    @property
    def verdict(self) -> dict[str, str | None]:
        """`kind`, `message` and `advice` of the JSON report."""
        return dict(self._dict["verdict"])

    @property
    def remarks(self) -> list[str]:
        """Reasons to suspect the result, in sentences; their fixed names are `to_dict()["remark_kinds"]`."""
        return list(self._dict["remarks"])

    @property
    def details(self) -> list[str]:
        """All other remarks, in sentences: how the result was found, what no such test shows, what the controller asks for."""
        return list(self._dict["details"])

    @cached_property
    def took_s(self) -> float:
        """Time that the identification took (s)."""
        return float(self._inner.took_s)

    def to_json(self, *, rows: bool = False) -> str:
        """The text that `onecycle identify --json` prints, with `rows` that of `--rows`."""
        return str(self._inner.json_with_rows()) if rows else super().to_json()

    def write_html(self, path: str | os.PathLike[str]) -> None:
        """Writes the page of `onecycle identify --report`."""
        page = self._inner.page()
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(page)

    def plot(self, axes: Any = None) -> NDArray[np.object_]:
        """Draws measured and simulated output over the input on two `axes`, made if not given, and returns them. Needs matplotlib."""
        if axes is None:
            from matplotlib import pyplot

            _, axes = pyplot.subplots(2, sharex=True, height_ratios=[3, 1])
        above, below = axes
        of = self.recording
        above.plot(of.t, of.y, ".", markersize=2, color="0.6", label="measured")
        if self.rows:
            above.plot(self.rows["time_s"], self.rows["simulated"], label="simulated")
        above.legend()
        above.set_ylabel("output")
        below.step(of.t, of.u, where="post")
        below.set_ylabel("input")
        below.set_xlabel("time (s)")
        return np.asarray(axes)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Report):
            return NotImplemented
        alike = self._raw == other._raw and self.posterior.keys() == other.posterior.keys()
        return alike and all(np.array_equal(values, other.posterior[key]) for key, values in self.posterior.items())

    def __repr__(self) -> str:
        told = f"refused: {self.refusal}" if self.model is None else repr(self.model)
        return f"<Report of {self.recording.name!r}: {told}>"


class Flight(_Shown):
    """What a flight log says about each of its loops. `print(flight)` shows their table."""

    def __repr__(self) -> str:
        return f"<Flight {self._again[1]!r}>"


class Design(_Shown):
    """Controllers of a known process. `print(design)` shows them."""

    _kept = (*_Shown._kept, "controller", "controllers")

    @property
    def model(self) -> Model:
        made: Model = self._again[1]
        return made

    @cached_property
    def controller(self) -> Controller:
        """That of the style."""
        return Controller(**self._inner.controller())

    @cached_property
    def controllers(self) -> Mapping[str, Controller | None]:
        """The controller of every style, to choose from; None if it has none."""
        return MappingProxyType({style: None if law is None else Controller(**law) for style, law in self._inner.controllers()})

    def __repr__(self) -> str:
        return f"<Design {self.controller!r}>"
