"""Recordings, and their time stamps in seconds."""

from __future__ import annotations

from datetime import date, datetime, timedelta, timezone
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _onecycle
from ._onecycle import OnecycleError

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self


def _refused(sentence: str) -> OnecycleError:
    error = OnecycleError(sentence)
    error.kind = "recording"
    return error


def _column(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values)
    if array.ndim != 1:
        raise _refused(f"`{name}` has the shape {array.shape}: give one number for each sample")
    if array.dtype.kind not in "buifO":
        raise _refused(f"`{name}` holds {array.dtype}: give numbers")
    try:
        return np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise _refused(f"`{name}` holds a {type(array.flat[0]).__name__}: give numbers") from None


def _seconds(t: Any) -> NDArray[np.float64]:
    """Time stamps in seconds: numbers as they are, durations as they are, dates from the first one on."""
    zone = getattr(getattr(t, "dtype", None), "tz", None)
    # pandas keeps zones as objects; the instants are those of UTC.
    array = np.asarray(t, dtype=f"datetime64[{t.dtype.unit}]") if zone is not None else np.asarray(t)
    if array.dtype == object and array.ndim == 1 and len(array) and isinstance(array[0], (date, timedelta)):
        array = _of_objects(array)
    if array.dtype.kind not in "mM" or array.ndim != 1:
        return _column("t", array)
    absent = np.flatnonzero(np.isnat(array))
    if absent.size:
        raise _refused(f"`t` has no time stamp in row {absent[0]} (NaT): leave the row out")
    unit, _ = np.datetime_data(array.dtype)
    if unit == "generic" or (array.dtype.kind == "m" and unit in "YM"):
        raise _refused(f"`t` counts in {'a unit that is not named' if unit == 'generic' else 'months or years'}: give seconds")
    if array.dtype.kind == "M":
        # Months and years have no length of their own, but begin on a day.
        array = array.astype("datetime64[D]") if unit in "YM" else array
        array = array - array[:1]
    return np.ascontiguousarray(array / np.timedelta64(1, "s"))


def _of_objects(array: NDArray[np.object_]) -> NDArray[Any]:
    """Dates and durations of the standard library as those of NumPy."""
    first = array[0]
    try:
        if isinstance(first, date) and not isinstance(first, datetime):
            return array.astype("datetime64[D]")
        if isinstance(first, datetime):
            # In UTC: with one zone, Python takes the difference of what the clocks on the wall show.
            if any((value.tzinfo is None) != (first.tzinfo is None) for value in array):
                raise ValueError
            stamps = [value if value.tzinfo is None else value.astimezone(timezone.utc) for value in array]
            durations = [stamp - stamps[0] for stamp in stamps]
        else:
            durations = list(array)
        # Those of pandas have nanoseconds.
        return np.array([_nanoseconds(value) for value in durations], dtype=object).astype(np.int64).astype("timedelta64[ns]")
    except (AttributeError, OverflowError, TypeError, ValueError):
        raise _refused("`t` mixes kinds of time: give dates with a zone, dates without, or durations") from None


def _nanoseconds(of: timedelta) -> int:
    return (of.days * 86_400 + of.seconds) * 10**9 + of.microseconds * 1000 + getattr(of, "nanoseconds", 0)


class Recording:
    """Samples of a control loop.

    Parameters
    ----------
    t : array of n
        Time stamps: numbers in seconds, or any dates or durations of NumPy, pandas, polars, xarray or `datetime`; dates are
        counted from the first one.
    u, y : arrays of n
        Process input, held from its stamp to the next, and measured process output.
    r : array of n, optional
        Set-point of a closed loop (unit of `y`).
    name : str
        Stands in reports.

    Raises OnecycleError if the lengths differ, time does not increase, or a value is no finite number.
    """

    __slots__ = ("_inner", "name")
    _inner: _onecycle.Recording
    name: str

    def __init__(self, t: Any, u: ArrayLike, y: ArrayLike, r: ArrayLike | None = None, *, name: str = "recording") -> None:
        last = None if r is None else _column("r", r)
        self._set(name, _onecycle.Recording(_seconds(t), _column("u", u), _column("y", y), last))

    def _set(self, name: str, inner: _onecycle.Recording) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "_inner", inner)

    @classmethod
    def _of(cls, name: str, inner: _onecycle.Recording) -> Self:
        made = cls.__new__(cls)
        made._set(name, inner)
        return made

    @classmethod
    def from_pandas(
        cls, frame: pandas.DataFrame, input: str = "u", output: str = "y", set_point: str | None = None
    ) -> Self:
        """Columns of a DataFrame whose index is the time: seconds, dates or durations."""
        return cls(frame.index, frame[input], frame[output], None if set_point is None else frame[set_point])

    def to_pandas(self) -> pandas.DataFrame:
        """Columns `u`, `y` and, if there is one, `r` over the index `t` (s)."""
        import pandas

        columns = {"u": self.u, "y": self.y} | ({} if self.r is None else {"r": self.r})
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    @property
    def t(self) -> NDArray[np.float64]:
        """Time stamps (s)."""
        return self._inner.t

    @property
    def u(self) -> NDArray[np.float64]:
        """Process input."""
        return self._inner.u

    @property
    def y(self) -> NDArray[np.float64]:
        """Process output."""
        return self._inner.y

    @property
    def r(self) -> NDArray[np.float64] | None:
        """Set-point, if it was recorded."""
        return self._inner.r

    @property
    def sample_period_s(self) -> float:
        """Sample period (s)."""
        return self._inner.sample_period_s

    def __len__(self) -> int:
        return len(self._inner)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Recording):
            return NotImplemented
        return self.name == other.name and self._inner == other._inner

    __hash__ = None  # type: ignore[assignment]

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Recording is immutable: {name} cannot be set")

    def __reduce__(self) -> tuple[Any, ...]:
        return _recording, (self.name, self._inner.stored())

    def __repr__(self) -> str:
        return f"<Recording {self.name!r}: {len(self)} samples every {self.sample_period_s:.4g} s>"


def _recording(name: str, stored: bytes) -> Recording:
    return Recording._of(name, _onecycle.Recording.of_stored(stored))
