"""Processes and controllers."""

from __future__ import annotations

import json
import re
import subprocess
import tempfile
from dataclasses import dataclass
from math import comb, factorial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _onecycle
from ._onecycle import OnecycleError
from ._options import ExperimentOptions, as_keywords, settings
from ._recording import Recording, _column

if TYPE_CHECKING:
    from collections.abc import Mapping

    import control
    import scipy.signal
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

    from ._options import Structure

    Filter = tuple[int, float] | None
    Polynomials = tuple[NDArray[np.float64], NDArray[np.float64]]


def _refused(sentence: str) -> OnecycleError:
    error = OnecycleError(sentence)
    error.kind = "request"
    return error


def _product(factors: list[list[float]]) -> NDArray[np.float64]:
    product: NDArray[np.float64] = np.ones(1)
    for factor in factors:
        product = np.polymul(product, factor).astype(np.float64)
    return product


def _with_delay(polynomials: Polynomials, dead_time_s: float, pade: int | None) -> Polynomials:
    """With the dead time as a Pade approximation of this order, 0 leaves it out."""
    if dead_time_s == 0.0 or pade == 0:
        return polynomials
    if pade is None or pade < 0 or dead_time_s < 0.0:
        raise _refused(
            f"the dead time of {dead_time_s:.4g} s is not rational: name the order of its Pade approximation, such as `pade=4`, or "
            "leave it out with `pade=0`"
        )
    # (2n - k)! n! / ((2n)! k! (n - k)!) (tau s)^k, from the highest power down; G. Baker, "Essentials of Pade Approximants" (1975).
    count = range(pade, -1, -1)
    below = np.array([comb(pade, k) * factorial(2 * pade - k) / factorial(2 * pade) * dead_time_s**k for k in count])
    above = below * [(-1.0) ** k for k in count]
    return np.polymul(polynomials[0], above), np.polymul(polynomials[1], below)


class _Rational:
    """What has a transfer function."""

    def _polynomials(self, pade: int | None) -> Polynomials:
        raise NotImplementedError

    def to_scipy(self, *, pade: int | None = None) -> scipy.signal.TransferFunction:
        """`scipy.signal.TransferFunction`. A dead time needs `pade`, the order of its approximation; 0 leaves it out."""
        from scipy.signal import TransferFunction

        return TransferFunction(*self._polynomials(pade))

    def to_control(self, *, pade: int | None = None) -> control.TransferFunction:
        """`control.TransferFunction`. A dead time needs `pade`, the order of its approximation; 0 leaves it out."""
        import control

        return control.tf(*self._polynomials(pade))


@dataclass(frozen=True)
class Controller(_Rational):
    """`u = kp (b r - yf) + ki int (r - yf) - kd dyf/dt`, with how it runs.

    Parameters
    ----------
    kp, ki, kd : float
        Gains: input unit over output unit, the same per second, the same times seconds.
    filter_s : float
        Time `Tf` of the measurement filter `1/(1 + Tf s + (Tf s)^2/2)` (s); 0: none.
    setpoint_weight : float
        `b`.
    sample_period_s, computation_delay_s : float
        Sample period (s), 0: continuous; and delay from a sample to its output (s), beside the hold.
    sensor_filter, recorded_filter, derivative_filter : (order, time in s), optional
        Low-pass before the controller; one that the recording contains and the model has as dead time; one of the derivative.
    cascade : (angle_p, rate_p, rate_i_per_s, rate_d_s), optional
        Gains of an angle loop around a rate loop, of which `kp`, `ki` and `kd` are the equivalent.
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    filter_s: float = 0.0
    setpoint_weight: float = 1.0
    sample_period_s: float = 0.0
    computation_delay_s: float = 0.0
    sensor_filter: Filter = None
    recorded_filter: Filter = None
    derivative_filter: Filter = None
    cascade: tuple[float, float, float, float] | None = None

    @property
    def dead_time_s(self) -> float:
        """Dead time of sampling (s): half a period of the hold and the computation; less that which the recording's filter is."""
        recorded_s = self.recorded_filter[1] if self.recorded_filter else 0.0
        return 0.5 * self.sample_period_s + self.computation_delay_s - recorded_s

    def _polynomials(self, pade: int | None) -> Polynomials:
        """From `-y` to `u`."""

        def low_pass(of: Filter) -> list[float]:
            if of is None:
                return [1.0]
            order, time_s = of
            return [time_s, 1.0] if order == 1 else [0.5 * time_s**2, time_s, 1.0]

        lag = low_pass(self.derivative_filter)
        plain = [self.kp, self.ki] if self.ki else [self.kp]
        # Of a cascade, the filter is that of the second derivative alone.
        slow, fast = [0.0], [self.kd, 0.0]
        if self.cascade is not None:
            slow, fast = fast, [self.cascade[1] * self.cascade[3], 0.0, 0.0]
        integral = [1.0, 0.0] if self.ki else [1.0]
        above = np.polymul(np.polyadd(plain, np.polymul(integral, slow)), lag)
        above = np.polyadd(above, np.polymul(integral, fast))
        own = (2, self.filter_s) if self.filter_s else None
        filters = [low_pass(of) for of in (own, self.sensor_filter, self.recorded_filter)]
        return _with_delay((above.astype(np.float64), _product([integral, lag, *filters])), self.dead_time_s, pade)


class Model(_Rational):
    """A process, such as `Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)`.

    Structures and the keys of their parameters are those of docs/identify-json.md. The gain may be given as `k` or as
    `k_over_t_body`; parameters that contradict each other are refused.
    """

    __slots__ = ("_inner",)
    _inner: _onecycle.Model

    def __init__(self, structure: Structure, **parameters: float) -> None:
        given = {key: float(value) for key, value in parameters.items()}
        object.__setattr__(self, "_inner", _onecycle.Model(structure, given))

    @classmethod
    def _of(cls, inner: _onecycle.Model) -> Self:
        model = cls.__new__(cls)
        object.__setattr__(model, "_inner", inner)
        return model

    @property
    def structure(self) -> str:
        return self._inner.structure

    @property
    def parameters(self) -> dict[str, float]:
        """Every parameter of the structure by its key; gain and lag of an integrator without damping are infinite."""
        return {key: value for key, value in self._inner.parameters if value is not None}

    @property
    def dead_time_s(self) -> float:
        """Dead time (s)."""
        return self._inner.factors()[2]

    def _polynomials(self, pade: int | None) -> Polynomials:
        gain, factors, dead_time_s = self._inner.factors()
        return _with_delay((np.array([gain]), _product(factors)), dead_time_s, pade)

    def frequency_response(self, w: ArrayLike) -> NDArray[np.complex128]:
        """Complex gain at the frequencies `w` (rad/s), in their shape, with the exact dead time."""
        at = np.asarray(w, dtype=np.float64)
        return self._inner.frequency_response(np.ascontiguousarray(at).reshape(-1)).reshape(at.shape)

    def __eq__(self, other: object) -> bool:
        return self._inner == other._inner if isinstance(other, Model) else NotImplemented

    def __hash__(self) -> int:
        return hash(repr(self._inner.state()))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Model is immutable: {name} cannot be set")

    def __reduce__(self) -> tuple[Any, ...]:
        return _model, (self._inner.state(),)

    def __repr__(self) -> str:
        def shown(value: float) -> str:
            return repr(value) if np.isfinite(value) else f"float('{value}')"

        given = "".join(f", {key}={shown(value)}" for key, value in self.parameters.items())
        return f"Model({self.structure!r}{given})"


def _model(state: Any) -> Model:
    return Model._of(_onecycle.Model.of_state(state))


@dataclass(frozen=True)
class Interval:
    """Estimate and 90 % interval of a parameter; None is unbounded."""

    estimate: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Margins:
    """Stability margins of a loop; all but `is_stable` are None of an unstable one."""

    is_stable: bool
    phase_margin_rad: float | None = None
    gain_crossover_rad_per_s: float | None = None
    gain_margin: float | None = None
    """A factor; None too if nothing limits the gain."""
    phase_crossover_rad_per_s: float | None = None
    delay_margin_s: float | None = None
    ms: float | None = None
    mt: float | None = None


def margins(model: Model, controller: Controller) -> Margins:
    """Stability margins with the exact dead times of process and sampling."""
    values = model._inner.margins(controller)
    return Margins(False) if values is None else Margins(True, *values)


def step(model: Model, controller: Controller) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Time (s), output and input of the loop after a unit step of the reference. OnecycleError if the loop is unstable."""
    t, y, u = model._inner.step(controller)
    return t, y, u


def _simulate(function: str, model: Model, options: ExperimentOptions, *more: str) -> str:
    """What `onecycle simulate` prints."""
    from .__main__ import program

    keys = model.parameters
    if "k" in keys:
        # Of both gains the one that is finite.
        keys.pop("k" if np.isinf(keys["k"]) else "k_over_t_body", None)
    words = [f"--process={model.structure}", *more]
    for key, value in keys.items():
        # The option is the key without its unit: `t_prop_s` is `--t-prop`.
        words.append(f"--{re.sub('(_rad_per)?_s$', '', key).replace('_', '-')}={value!r}")
    for name, text in settings(function, ExperimentOptions, options):
        option = f"--{name.replace('_', '-')}"
        words += {"true": [option], "false": []}.get(text, [f"{option}={text}"])
    run = subprocess.run([program(), "simulate", *words], capture_output=True, text=True)
    if run.returncode != 0:
        sentence = run.stderr.strip().removeprefix("error: ").removeprefix("onecycle: ").split("\n\n")[0]
        raise _refused(as_keywords(sentence))
    return run.stdout


def experiment(model: Model, options: ExperimentOptions) -> Recording:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "experiment.csv")
        _simulate("experiment", model, options, f"--out={path}")
        return Recording._of("experiment", _onecycle.read(path, []))


def expect(model: Model, options: ExperimentOptions) -> Mapping[str, Interval]:
    known = json.loads(_simulate("expect", model, options, "--expect", "--json"))
    ends = ("estimate", "low", "high")
    return MappingProxyType({key: Interval(*(of[end] for end in ends)) for key, of in known.items() if key != "structure"})


def simulate(model: Model, u: ArrayLike, sample_s: float) -> NDArray[np.float64]:
    """Output at every tick, from rest, under an input held over each tick of `sample_s` seconds. Exact, with the dead time."""
    return model._inner.simulate(_column("u", u), float(sample_s))
