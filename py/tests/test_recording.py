"""Samples: every kind of time is read right or refused with a sentence; recordings are values."""

import copy
import pickle
import zoneinfo
from datetime import date, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import polars as pl
import pytest
import xarray as xr

import onecycle

N = 100
STEP = np.arange(N)
#: 10 ms between samples, as every kind of time counts it.
BERLIN = zoneinfo.ZoneInfo("Europe/Berlin")
KINDS = {
    "seconds": 0.01 * STEP,
    "list": [0.01 * n for n in range(N)],
    **{f"timedelta64[{unit}]": (STEP * step).astype(f"timedelta64[{unit}]") for unit, step in {"ms": 10, "us": 10_000, "ns": 10_000_000}.items()},
    **{f"datetime64[{unit}]": np.datetime64("2026-11-26T12:00", unit) + STEP * step
       for unit, step in {"ms": 10, "us": 10_000, "ns": 10_000_000}.items()},
    "timedelta": [timedelta(milliseconds=10 * n) for n in range(N)],
    "datetime": [datetime(2026, 11, 26) + timedelta(milliseconds=10 * n) for n in range(N)],
    "datetime with zone": [datetime(2026, 11, 26, tzinfo=timezone.utc) + timedelta(milliseconds=10 * n) for n in range(N)],
    # Over both changes of the clock.
    **{f"datetime in {month}": [(datetime(2026, month, day, 0, 59, 59, 500_000, timezone.utc) + timedelta(milliseconds=10 * n)).astimezone(BERLIN)
                                for n in range(N)] for month, day in ((3, 29), (10, 25))},
    "Timestamps": [pd.Timestamp("2026-11-26 00:00:00.000000001") + pd.Timedelta(milliseconds=10 * n) for n in range(N)],
    "TimedeltaIndex": pd.to_timedelta(10 * STEP, unit="ms"),
    "TimedeltaIndex[ms]": pd.to_timedelta(10 * STEP, unit="ms").as_unit("ms"),
    "DatetimeIndex": pd.date_range("2026-11-26", periods=N, freq="10ms"),
    "DatetimeIndex[ms]": pd.date_range("2026-11-26", periods=N, freq="10ms").as_unit("ms"),
    # Over the end of daylight saving time, when the clock shows an hour twice.
    "DatetimeIndex with zone": pd.date_range("2026-10-25 00:59:59.5", periods=N, freq="10ms", tz="UTC").tz_convert("Europe/Berlin"),
    "Series": pd.Series(pd.date_range("2026-11-26", periods=N, freq="10ms")),
    "Series with zone": pd.Series(pd.date_range("2026-11-26", periods=N, freq="10ms", tz="Asia/Kolkata")),
    "Series of timedelta": pd.Series(pd.to_timedelta(10 * STEP, unit="ms")),
    "polars datetime": pl.Series([datetime(2026, 11, 26) + timedelta(milliseconds=10 * n) for n in range(N)]),
    "polars datetime[ms]": pl.Series([datetime(2026, 11, 26) + timedelta(milliseconds=10 * n) for n in range(N)]).dt.cast_time_unit("ms"),
    "polars with zone": pl.Series([datetime(2026, 11, 26) + timedelta(milliseconds=10 * n) for n in range(N)]).dt.replace_time_zone("Asia/Tokyo"),
    "polars duration": pl.Series([timedelta(milliseconds=10 * n) for n in range(N)]),
    "xarray": xr.DataArray(pd.date_range("2026-11-26", periods=N, freq="10ms"), dims="time"),
    "xarray of timedelta": xr.DataArray(pd.to_timedelta(10 * STEP, unit="ms"), dims="time"),
}


def with_time(t):
    return onecycle.Recording(t, np.ones(N), np.sin(STEP))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_time_is_in_seconds(kind):
    # Dates and durations have at most nanoseconds: a rounding of the quotient remains.
    np.testing.assert_allclose(with_time(KINDS[kind]).t, 0.01 * STEP, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("kind", ["TimedeltaIndex", "DatetimeIndex", "DatetimeIndex with zone", "TimedeltaIndex[ms]"])
def test_an_index_of_a_frame_is_the_time(kind):
    frame = pd.DataFrame({"u": np.ones(N), "y": np.sin(STEP)}, index=KINDS[kind])
    assert onecycle.Recording.from_pandas(frame) == with_time(KINDS[kind])


def test_other_units_are_not_seconds():
    assert with_time(STEP.astype("timedelta64[m]")).sample_period_s == 60
    assert with_time(np.datetime64("2026-11-26") + STEP).sample_period_s == 86_400
    assert with_time([date(2026, 1, 1) + timedelta(days=n) for n in range(N)]).sample_period_s == 86_400
    # Months of a calendar, from January 2025: 31 and then 28 days.
    months = np.datetime64("2025-01") + STEP
    assert list(with_time(months).t[:3]) == [0, 31 * 86_400, 59 * 86_400]
    # Objects of pandas have nanoseconds, with a zone too.
    for zone in (None, BERLIN):
        stamps = [pd.Timestamp("2026-10-25 00:30", tz=zone) + pd.Timedelta(7 * n, "ns") for n in range(N)]
        assert with_time(stamps).sample_period_s == pytest.approx(7e-9, rel=1e-12)


@pytest.mark.parametrize(
    ("t", "words"),
    [
        (STEP.astype("timedelta64[M]"), "months or years"),
        (STEP.astype("timedelta64"), "a unit that is not named"),
        (["12:00"] * N, "`t` holds"),
        (pd.Series(["12:00"] * N), "give numbers"),
        (np.where(STEP == 7, np.datetime64("NaT"), np.datetime64("2026", "s") + STEP), "row 7"),
        (np.zeros((N, 2)), r"shape \(100, 2\)"),
        (1j * STEP, "complex"),
        (pl.Series([datetime(2026, 1, 1).time()] * N), "time: give numbers"),
        ([datetime(2026, 1, 1, tzinfo=BERLIN)] + [datetime(2026, 1, 2)] * (N - 1), "mixes"),
        (pd.period_range("2026-01", periods=N, freq="h"), "Period"),
        ([timedelta(seconds=n) for n in range(N - 1)] + [datetime(2026, 1, 1)], "mixes"),
        ([datetime(1, 1, 1), datetime(9999, 1, 1)] * (N // 2), "mixes"),
    ],
)
def test_other_time_is_refused_with_a_sentence(t, words):
    with pytest.raises(onecycle.OnecycleError, match=words) as caught:
        with_time(t)
    assert caught.value.kind == "recording"


def test_dates_are_no_signal():
    with pytest.raises(onecycle.OnecycleError, match="`u` holds datetime64"):
        onecycle.Recording(STEP, KINDS["datetime64[ns]"], STEP)
    with pytest.raises(onecycle.OnecycleError, match=r"`y` has the shape \(100, 1\)"):
        onecycle.Recording(STEP, STEP, STEP[:, np.newaxis])


@pytest.mark.parametrize("file", ["examples/simulated_hover.csv", "examples/logs/ap_sysid_roll.bin", None])
def test_a_recording_is_a_value(file, root):
    options = {"axis": "roll"} if file and file.endswith("bin") else {}
    recording = onecycle.read(file, **options) if file else with_time(STEP)
    for again in (pickle.loads(pickle.dumps(recording)), copy.copy(recording), copy.deepcopy(recording)):
        assert again == recording and repr(again) == repr(recording)
    assert recording != with_time(2 * STEP)
    with pytest.raises(AttributeError, match="immutable"):
        recording.name = "other"
