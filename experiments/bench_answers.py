"""Answers to the relay benchmark by scipy and by SIPPY, for comparison.

    onecycle-lab bench make -o relay-benchmark
    python bench_answers.py relay-benchmark --method scipy -o scipy.csv
    onecycle-lab bench run relay-benchmark --methods onecycle-2 --answers scipy=scipy.csv

Needs `pip install numpy scipy`, and `sippy_unipi` for `--method sippy`. Nothing of truth.csv is read without `--from-truth`.

scipy: an output-error fit over the last cycles (two), as a careful user would write it. `least_squares`
searches for the logarithms of T_prop, T_body and tau; the gain, a constant input bias and the three
initial states are linear and solved for at each step; the input is held between samples, a delay of any
part of a sample included; the best of several starts. `--step 1e-4` is the relative step of
its finite differences: with SciPy's default (`--step 0`) rounding stops the search far from the optimum.
multistart: the same model at 80 samples a period, from 18 starts over the benchmark's ranges.
`--cycles N` fits the last N complete cycles, `--cycles 0` everything from the first rise of the input on.
`--bounds published` limits the times to the ranges that the benchmark's README states.
`--from-truth` starts at the true process as well, which no user could do: it shows whether the search
finds its optimum.
sippy: its output-error model of third order, 40 samples a cycle, for several dead times, the one of least
error; the process with the frequency response nearest to it from the oscillation to its third harmonic.
"""

import argparse
import concurrent.futures
import csv
import functools
import os
import pathlib
import time

# The matrices are small: more threads only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

SAMPLE_S = 1e-3
# T_prop, T_body, tau (s): spread over what the benchmark's README allows.
STARTS = np.log(
    [[0.05, 0.5, 0.005], [0.05, 1.5, 0.05], [0.15, 0.5, 0.05], [0.2, 1.2, 0.01], [0.1, 1.0, 0.03]]
)
# A wide grid for the fit with many starts.
MANY_STARTS = np.log(
    [
        [t_prop, t_body, tau]
        for t_prop in (0.025, 0.08, 0.22)
        for t_body in (0.35, 1.2)
        for tau in (0.003, 0.02, 0.07)
    ]
)
# Samples a period of the fit with many starts.
BINS = 80
# Dead times that SIPPY is given, in its samples: a relay's cycle hides up to a sixth of itself.
DELAYS = [0, 2, 4, 6]
# T_prop, T_body, tau (s): wide, and what the benchmark's README states.
BOUNDS = {
    "wide": np.log([[1e-3, 1e-2, 1e-4], [5.0, 50.0, 0.5]]),
    "published": np.log([[0.015, 0.2, 0.0005], [0.3, 2.0, 0.1]]),
}


def rises(u):
    """Indices where the input rises: a relay's complete cycles lie between them."""
    return np.flatnonzero(np.diff(u) > 1.0) + 1


def integrals(u):
    """Integral of the held input up to each sample, and the input before the first."""
    return np.concatenate([[0.0], np.cumsum(u)]), u[0]


def delayed(integrated, delay_s, at, every):
    """Mean of the held input over each `every` samples from the indices `at` on, `delay_s` ago."""
    total, before = integrated
    knots = np.arange(len(total))

    def integral(when):
        # The first input has always been there.
        return np.where(when < 0, when * before, np.interp(when, knots, total))

    begin = at - delay_s / SAMPLE_S
    return (integral(begin + every) - integral(begin)) / every


def by_scipy(u, y, settings, starts, bins=None):
    """Output error over the last cycles. With `bins`, at so many points a period: the output is averaged
    over the samples around each point, the input held at its mean from point to point."""
    ups = rises(u)
    every = 1 if bins is None else max(round(np.diff(ups).mean() / bins), 1)
    first = ups[-1 - settings.cycles] if settings.cycles else ups[0]
    # The recording goes on after the last complete cycle, for half a period in the mean.
    end = ups[-1] if settings.cycles else len(u)
    at = np.arange(first, end - every + 1, every)
    measured = y[at[:, None] + np.arange(every)].mean(axis=1)
    # The mean of `every` samples stands at the middle of them.
    centre = at + (every - 1) / 2
    integrated = integrals(u)

    step_s = SAMPLE_S * every
    index = np.arange(len(measured))

    def solve(x):
        """The gain, and what the model leaves of the output."""
        t_prop, t_body, tau = np.exp(x)
        held = delayed(integrated, tau, centre, every)
        # 1/(s (T_prop s + 1) (T_body s + 1)) in partial fractions: an integrator and two lags.
        moved = step_s * np.concatenate([[0.0], np.cumsum(held[:-1])])
        columns = [index, np.ones(len(index))]
        for lag_s, other_s in ((t_prop, t_body), (t_body, t_prop)):
            kept = np.exp(-step_s / lag_s)
            moved += lag_s**2 / (other_s - lag_s) * lfilter([0.0, 1.0 - kept], [1.0, -kept], held)
            columns.append(kept**index)
        # The response to the input, the ramp of its bias, and those of the three initial states.
        columns = np.stack([moved, *columns], axis=1)
        sizes = np.linalg.norm(columns, axis=0)
        factors = np.linalg.lstsq(columns / sizes, measured, rcond=None)[0] / sizes
        return factors[0], (measured - columns @ factors) / measured.std()

    def fit(start):
        return least_squares(
            lambda x: solve(x)[1],
            start,
            bounds=BOUNDS[settings.bounds],
            diff_step=settings.step or None,
        )

    best = min(map(fit, starts), key=lambda found: found.cost)
    return (solve(best.x)[0], *np.exp(best.x))


def by_sippy(u, y):
    from sippy_unipi import system_identification

    period = np.diff(rises(u)).mean()
    every = max(int(period / 40), 1)
    step_s = every * SAMPLE_S
    # Whole cycles without their means: an integrator oscillates where its input is zero on average.
    whole = slice(rises(u)[0], rises(u)[-1])
    count = (whole.stop - whole.start) // every
    held = u[whole][: count * every].reshape(count, every).mean(axis=1)
    sampled = y[whole][: count * every : every]
    held, sampled = held - held.mean(), sampled - sampled.mean()
    best = None
    for delay in DELAYS:
        model = system_identification(
            sampled, held, "OE", OE_orders=[3, 3, delay], tsample=step_s
        )
        if best is None or model.Vn < best.Vn:
            best = model
    omega = 2 * np.pi / (period * SAMPLE_S) * np.geomspace(0.8, 3.0, 30)
    z = np.exp(1j * omega * step_s)
    # The model is of a held input: without the hold it is the process.
    wanted = np.squeeze(best.G(z)) / ((1 - 1 / z) / (1j * omega * step_s))

    def residual(x):
        gain, t_prop, t_body, tau = np.exp(x)
        s = 1j * omega
        found = gain * np.exp(-tau * s) / (s * (t_prop * s + 1) * (t_body * s + 1))
        error = (found / wanted - 1) * omega[0] / omega
        return np.concatenate([error.real, error.imag])

    starts = [np.concatenate([[0.0], start]) for start in STARTS]
    bounds = np.concatenate([[[-20.0], [20.0]], BOUNDS["wide"]], axis=1)
    fits = [least_squares(residual, start, bounds=bounds) for start in starts]
    return np.exp(min(fits, key=lambda found: found.cost).x)


def identify(u, y, arguments, more):
    """The process by the method asked for; `more` are further starts."""
    if arguments.method == "sippy":
        return by_sippy(u, y)
    if arguments.method == "multistart":
        return by_scipy(u, y, arguments, np.concatenate([MANY_STARTS, more]), BINS)
    return by_scipy(u, y, arguments, np.concatenate([STARTS, more]))


def answered(file, arguments, truth):
    """The row of a recording: its number, the process, and the processor time (s)."""
    _, y, u = np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)
    begin = time.process_time()
    more = truth.get(int(file.stem), np.empty((0, 3)))
    process = identify(u, y, arguments, more)
    return [int(file.stem), *map(float, process), round(time.process_time() - begin, 3)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--method", choices=["scipy", "multistart", "sippy"], default="scipy")
    parser.add_argument("--cycles", type=int, default=2)
    parser.add_argument("--step", type=float, default=1e-4)
    parser.add_argument("--bounds", choices=list(BOUNDS), default="wide")
    parser.add_argument("--from-truth", action="store_true")
    parser.add_argument("--experiments", type=int, default=None)
    parser.add_argument("-o", "--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    truth = {}
    if arguments.from_truth:
        with (arguments.folder / "truth.csv").open(newline="") as file:
            for row in csv.DictReader(file):
                times = [float(row[name]) for name in ("T_prop_s", "T_body_s", "tau_s")]
                truth[int(row["experiment"])] = np.log([times])
    files = sorted((arguments.folder / "recordings").glob("*.csv"))[: arguments.experiments]
    with arguments.out.open("w", newline="", buffering=1) as out:
        table = csv.writer(out)
        table.writerow(["experiment", "K", "T_prop_s", "T_body_s", "tau_s", "seconds"])
        answer = functools.partial(answered, arguments=arguments, truth=truth)
        with concurrent.futures.ProcessPoolExecutor() as workers:
            for row in workers.map(answer, files):
                table.writerow(row)


if __name__ == "__main__":
    main()
