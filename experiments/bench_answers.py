"""Answers to the relay benchmark by scipy and by SIPPY, for comparison.

    onecycle bench make -o relay-benchmark
    python bench_answers.py relay-benchmark --method scipy -o scipy.csv
    onecycle bench run relay-benchmark --methods onecycle-2 --answers scipy=scipy.csv

Needs `pip install numpy scipy`, and `sippy_unipi` for `--method sippy`. Nothing of truth.csv is read.

scipy: an output-error fit over the last two cycles, as a careful user would write it. `least_squares`
searches for the logarithms of T_prop, T_body and tau; the gain, a constant input bias and the three
initial states are linear and solved for at each step; simulated by `scipy.signal` as zero-order hold, a
delay of any part of a sample included; the best of several starts.
sippy: its output-error model of third order, 40 samples a cycle, for several dead times, the one of least
error; the process with the frequency response nearest to it from the oscillation to its third harmonic.
"""

import argparse
import csv
import pathlib
import time

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

SAMPLE_S = 1e-3
CYCLES = 2
# T_prop, T_body, tau (s): spread over what the benchmark's README allows.
STARTS = np.log(
    [[0.05, 0.5, 0.005], [0.05, 1.5, 0.05], [0.15, 0.5, 0.05], [0.2, 1.2, 0.01], [0.1, 1.0, 0.03]]
)
# Dead times that SIPPY is given, in its samples: a relay's cycle hides up to a sixth of itself.
DELAYS = [0, 2, 4, 6]
BOUNDS = np.log([[1e-3, 1e-2, 1e-4], [5.0, 50.0, 0.5]])


def rises(u):
    """Indices where the input rises: a relay's complete cycles lie between them."""
    return np.flatnonzero(np.diff(u) > 1.0) + 1


def delayed(u, delay_s, first):
    """Mean of the held input over each sample from `first` on, `delay_s` ago."""
    whole, part = divmod(delay_s / SAMPLE_S, 1.0)
    at = np.arange(first, len(u)) - int(whole)
    return (1 - part) * u[np.clip(at, 0, None)] + part * u[np.clip(at - 1, 0, None)]


def by_scipy(u, y):
    first = rises(u)[-1 - CYCLES]
    measured = y[first:]

    def solve(x):
        """The gain, and what the model leaves of the output."""
        t_prop, t_body, tau = np.exp(x)
        process = ([1.0], np.polymul([1.0, 0.0], np.polymul([t_prop, 1.0], [t_body, 1.0])))
        b, a, _ = cont2discrete(process, SAMPLE_S)
        none = np.zeros(len(measured))
        columns = [lfilter(b[0], a, one) for one in (delayed(u, tau, first), none + 1.0)]
        columns += [lfilter(b[0], a, none, zi=state)[0] for state in np.eye(3)]
        columns = np.stack(columns, axis=1)
        sizes = np.linalg.norm(columns, axis=0)
        factors = np.linalg.lstsq(columns / sizes, measured, rcond=None)[0] / sizes
        return factors[0], (measured - columns @ factors) / measured.std()

    fits = [least_squares(lambda x: solve(x)[1], start, bounds=BOUNDS) for start in STARTS]
    best = min(fits, key=lambda found: found.cost)
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
    bounds = np.concatenate([[[-20.0], [20.0]], BOUNDS], axis=1)
    fits = [least_squares(residual, start, bounds=bounds) for start in starts]
    return np.exp(min(fits, key=lambda found: found.cost).x)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--method", choices=["scipy", "sippy"], default="scipy")
    parser.add_argument("--experiments", type=int, default=None)
    parser.add_argument("-o", "--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    identify = {"scipy": by_scipy, "sippy": by_sippy}[arguments.method]
    files = sorted((arguments.folder / "recordings").glob("*.csv"))[: arguments.experiments]
    with arguments.out.open("w", newline="", buffering=1) as out:
        table = csv.writer(out)
        table.writerow(["experiment", "K", "T_prop_s", "T_body_s", "tau_s", "seconds"])
        for file in files:
            _, y, u = np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)
            begin = time.perf_counter()
            process = identify(u, y)
            seconds = time.perf_counter() - begin
            table.writerow([int(file.stem), *map(float, process), round(seconds, 3)])


if __name__ == "__main__":
    main()
