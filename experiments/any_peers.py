"""The likelihood beside other programs, on the same recordings.

    python any_peers.py --onecycle PATH/TO/onecycle -o any-peers           # all methods
    python any_peers.py --onecycle PATH/TO/onecycle -o any-peers-w0 --disturbance w0=10 --methods onecycle,scipy-filtered

Makes recordings by `onecycle simulate` (those that are there already stay), identifies them by each method, and prints
a table for each kind of recording: error of K/T_body, T_prop and tau in per cent (median, worst), how often 90 %
intervals hold the truth, processor time of one recording. Answers go to OUT/METHOD.csv.

Process: K/T_body e^(-tau s) / (s (T_prop s + 1)(s + 1/T_body)), which all methods are told. 100 Hz, 20 s, noise of 1 % of
the amplitude, constant input bias. Needs numpy and scipy; `sippy_unipi` for sippy; Octave with its control package
for octave-*. Versions that the table was made with: numpy 2.4.6, scipy 1.17.1, sippy_unipi 1.0.1, Octave 7.3 with control
3.4.0.

onecycle       the likelihood, structure given
onecycle-auto  `onecycle identify` without any option
scipy          output error: `least_squares` on the logarithms of T_prop, T_body and tau, with x_scale and diff_step set;
               exact response to the held input at any delay; gain, input bias and the three initial states are linear
               and solved for; the best of five starts and of one at the truth. Intervals from its Jacobian.
scipy-filtered the same; output and response first pass a high-pass filter (Butterworth, second order, 0.5 Hz)
sippy          ARMAX of the differences of the output (the integrator is given, so that a bias is a mean), at 25 Hz, for
               several dead times, the one of least error; then the process with the nearest frequency response, by
               `least_squares` from the same six starts. Its output-error models and other rates were worse
octave-arx, octave-moen4
               the same by functions of Octave's control package (any_peers.m); n4sid answers as moen4 does

Only the process nearest to a discrete model and one start of scipy see the truth: their users start near it.
"""

import argparse
import csv
import json
import pathlib
import resource
import subprocess
import time

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import butter, lfilter

SAMPLE_S = 0.01
DURATION_S = 20
KEYS = ["k_over_t_body", "t_prop_s", "tau_s"]
LOOP = ["--loop", "4,2.5,0.02"]
# The strength is that of the option --disturbance.
WALK = ["--disturbance", "w1=3"]
KINDS = {
    "open loop, calm": ["--excitation", "multisine", "--band", "0.2,5"],
    "open loop, disturbed": ["--excitation", "multisine", "--band", "0.2,5", *WALK],
    "closed loop, set-point steps, disturbed": [
        *LOOP, "--excitation", "prbs", "--pulse", "0.5", "--inject", "setpoint", "--amplitude", "0.3",
        *WALK,
    ],
    "closed loop, multisine, disturbed": [
        *LOOP, "--excitation", "multisine", "--band", "0.2,5", *WALK,
    ],
    "steady relay": ["--excitation", "relay"],
}  # fmt: skip
# T_prop, T_body, tau (s).
STARTS = [[0.03, 0.3, 0.01], [0.1, 0.3, 0.005], [0.05, 1.0, 0.03], [0.02, 0.6, 0.05], [0.15, 2.0, 0.01]]
BOUNDS = np.log([[2e-3, 2e-2, 1e-4], [1.0, 50.0, 0.2]])
# The largest delay: outputs before it depend on an input that was not recorded.
SKIPPED = 21
# Samples that are averaged for the discrete models: at 100 Hz the noise of a sample is larger than its change.
EVERY = 4
# Half width of a 90 % interval in standard deviations.
HALF_WIDTH = 1.6449
# Frequencies at which a process is fitted to a discrete model: those that the tests excite.
OMEGA = 2 * np.pi * np.geomspace(0.3, 3.0, 30)


def make(onecycle, folder, cases, disturbance="w1=3"):
    """Recordings of all kinds: their files and true processes."""
    folder.mkdir(parents=True, exist_ok=True)
    recordings = []
    for index, (kind, test) in enumerate(KINDS.items()):
        rng = np.random.default_rng(index)
        for case in range(cases):
            truth = {
                "k_over_t_body": rng.uniform(0.5, 2),
                "t_prop_s": rng.uniform(0.03, 0.08),
                "tau_s": rng.uniform(0.01, 0.03),
                "t_body_s": rng.uniform(0.3, 0.8),
            }
            bias = rng.uniform(-0.1, 0.1)
            file = folder / f"{index}_{case:03}.csv"
            recordings.append((kind, file, truth))
            if file.exists():
                continue
            process = [f"--{key[:-2] if key.endswith('_s') else key}={value}" for key, value in truth.items()]
            common = ["--noise=1%", f"--bias={bias}", f"--seed={case}", "--preroll=0", "--sample-rate=100"]
            test = [disturbance if argument == WALK[1] else argument for argument in test]
            arguments = [argument.replace("_", "-") for argument in process] + test + common
            command = [onecycle, "simulate", *arguments, f"--duration={DURATION_S}", "--out", file]
            subprocess.run(command, check=True)
    return recordings


def read(file):
    """Input and output."""
    with file.open() as lines:
        skip = next(n for n, line in enumerate(lines) if line.startswith("time_s")) + 1
    return np.loadtxt(file, delimiter=",", skiprows=skip, usecols=(2, 1), unpack=True)


def held_response(u, t_prop, t_body, tau):
    """Output of 1 / (s (T_prop s + 1)(s + 1/T_body)) to the held input, exact at the samples, from rest."""
    whole, part = divmod(tau / SAMPLE_S, 1.0)
    whole, part = int(whole), part * SAMPLE_S
    p, q = 1 / t_prop, 1 / t_body
    if abs(p / q - 1) < 1e-6:
        p *= 1 + 1e-6
    late = np.concatenate([np.zeros(whole), u])[: len(u)]
    later = np.concatenate([[0.0], late[:-1]])
    # 1 / (s + a): over a sample the older value acts for `part`, then the newer one for the rest.
    y = np.zeros(len(u))
    for a, residue in [(0.0, 1 / q), (p, p / (p * (p - q))), (q, -p / (q * (p - q)))]:
        rest = SAMPLE_S - part
        newer = rest if a == 0 else -np.expm1(-a * rest) / a
        older = part if a == 0 else np.exp(-a * rest) * -np.expm1(-a * part) / a
        state = lfilter([1.0], [1.0, -np.exp(-a * SAMPLE_S)], newer * late + older * later)
        y[1:] += residue * state[:-1]
    return y


def by_scipy(u, y, near, high_pass=([1.0], [1.0])):
    time_s = np.arange(len(u)) * SAMPLE_S
    measured = lfilter(*high_pass, y[SKIPPED:])

    def columns(x):
        t_prop, t_body, tau = np.exp(x)
        free = [time_s, np.ones(len(u)), np.exp(-time_s / t_prop), np.exp(-time_s / t_body)]
        table = np.stack([held_response(u, t_prop, t_body, tau), *free], axis=1)[SKIPPED:]
        return lfilter(*high_pass, table, axis=0)

    def solve(x):
        table = columns(x)
        sizes = np.linalg.norm(table, axis=0)
        factors = np.linalg.lstsq(table / sizes, measured, rcond=None)[0] / sizes
        return table, factors, (measured - table @ factors) / measured.std()

    fits = [
        least_squares(lambda x: solve(x)[2], start, bounds=BOUNDS, diff_step=1e-4, x_scale=[1.0, 1.0, 1.0])
        for start in np.log([*STARTS, near[1:]])
    ]
    best = min(fits, key=lambda found: found.cost)
    table, factors, residual = solve(best.x)
    # Jacobian of the output in the logarithms, beside the linear columns.
    steps = 1e-4 * np.eye(3)
    slopes = [(columns(best.x + d) - columns(best.x - d)) @ factors / 2e-4 for d in steps]
    jacobian = np.column_stack([*slopes, table])
    sizes = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.pinv((jacobian / sizes).T @ (jacobian / sizes))
    variance = (residual * measured.std()).var(ddof=8)
    deviation = np.sqrt(variance * np.diag(inverse)) / sizes
    t_prop, _, tau = np.exp(best.x)
    wide = HALF_WIDTH * np.array([deviation[3], t_prop * deviation[0], tau * deviation[2]])
    found = np.array([factors[0], t_prop, tau])
    return found, found - wide, found + wide


def nearest(wanted, near):
    """The process with the frequency response nearest to `wanted` at OMEGA, the hold taken out of it."""
    s = 1j * OMEGA
    step_s = EVERY * SAMPLE_S
    wanted = wanted / ((1 - np.exp(-s * step_s)) / (s * step_s))

    def residual(x):
        gain, t_prop, t_body, tau = np.exp(x)
        found = gain * np.exp(-tau * s) / (s * (t_prop * s + 1) * (s + 1 / t_body))
        error = (found / wanted - 1) * OMEGA[0] / OMEGA
        return np.concatenate([error.real, error.imag])

    bounds = np.concatenate([[[-20.0], [20.0]], BOUNDS], axis=1)
    starts = np.log([[near[0], *start] for start in STARTS] + [near])
    fits = [least_squares(residual, start, bounds=bounds) for start in starts]
    gain, t_prop, _, tau = np.exp(min(fits, key=lambda found: found.cost).x)
    return np.array([gain, t_prop, tau]), None, None


def by_sippy(u, y, near):
    from sippy_unipi import system_identification

    count = len(u) // EVERY
    rates = np.diff(y[: count * EVERY : EVERY])
    inputs = u[: count * EVERY].reshape(count, EVERY).mean(axis=1)[:-1]
    best = None
    for delay in range(4):
        model = system_identification(
            rates - rates.mean(), inputs - inputs.mean(), "ARMAX", ARMAX_orders=[2, 3, 3, delay],
            ARMAX_mod="ILLS", tsample=EVERY * SAMPLE_S, max_iterations=300,
        )  # fmt: skip
        if best is None or model.Vn < best.Vn:
            best = model
    z = np.exp(1j * OMEGA * EVERY * SAMPLE_S)
    return nearest(np.squeeze(best.G(z)) / (z - 1), near)


def by_onecycle(onecycle, file, options):
    done = subprocess.run([onecycle, "identify", "--json", *options, file], capture_output=True, text=True)
    answer = json.loads(done.stdout)
    process = answer["process"]
    if process is None or any(key not in process for key in KEYS):
        reason = (answer["verdict"] or {}).get("kind") if process is None else process["structure"]
        raise ValueError(f"{file.name}: {reason}")
    table = np.array([[process[key][end] or 0.0 for key in KEYS] for end in ("estimate", "low", "high")])
    return table[0], table[1], table[2]


PEERS = {
    "scipy": by_scipy,
    "scipy-filtered": lambda u, y, near: by_scipy(u, y, near, butter(2, 0.5, "high", fs=1 / SAMPLE_S)),
    "sippy": by_sippy,
}


def by_octave(method, recordings):
    """All recordings in one run of Octave: frequency responses, then processes."""
    files = [str(file) for _, file, _ in recordings]
    script = pathlib.Path(__file__).with_suffix(".m")
    command = ["octave-cli", "-qf", str(script), method, *(repr(float(w)) for w in OMEGA[[0, -1]]), str(len(OMEGA))]
    done = subprocess.run(command, input="\n".join(files), capture_output=True, text=True)
    answers = {}
    for line in done.stdout.splitlines():
        name, seconds, *values = line.split(",")
        values = np.array(values, float)
        answers[name] = (float(seconds), values[: len(OMEGA)] + 1j * values[len(OMEGA) :])
    return answers


def answers_of(method, arguments, recordings):
    """Estimate, ends of the intervals, processor seconds of each recording."""
    octave = by_octave(method.removeprefix("octave-"), recordings) if method.startswith("octave-") else None
    own = {"onecycle": ["--structure", "soiptd"], "onecycle-auto": []}
    for kind, file, truth in recordings:
        near = [truth["k_over_t_body"], truth["t_prop_s"], truth["t_body_s"], truth["tau_s"]]
        u, y = read(file)
        begin = time.process_time()
        of_program = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        seconds = None
        try:
            if method in own:
                answer = by_onecycle(arguments.onecycle, file, own[method])
                seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - of_program
            elif octave is not None:
                extra, response = octave[str(file)]
                answer = nearest(response, near)
                seconds = extra + time.process_time() - begin
            else:
                answer = PEERS[method](u, y, near)
        except (KeyError, ValueError, np.linalg.LinAlgError) as failure:
            print(f"  {method}: no answer: {failure}", flush=True)
            answer = None
        yield kind, file, truth, answer, seconds or time.process_time() - begin


def table_of(method, arguments, recordings):
    errors, held, times = {}, {}, {}
    with (arguments.out / f"{method}.csv").open("w", newline="", buffering=1) as out:
        lines = csv.writer(out)
        lines.writerow(["kind", "file", *KEYS, "seconds"])
        for kind, file, truth, answer, seconds in answers_of(method, arguments, recordings):
            true = np.array([truth[key] for key in KEYS])
            times.setdefault(kind, []).append(seconds)
            if answer is None:
                errors.setdefault(kind, []).append([np.nan] * 3)
                continue
            found, low, high = answer
            errors.setdefault(kind, []).append(100 * np.abs(found / true - 1))
            if low is not None:
                held.setdefault(kind, []).append((low <= true) & (true <= high))
            lines.writerow([kind, file.name, *found, round(seconds, 3)])
    for kind in KINDS:
        error = np.array(errors[kind])
        missing = int(np.isnan(error[:, 0]).sum())
        usable = error[~np.isnan(error[:, 0])]
        if len(usable):
            figures = [f"{np.median(e):.2g}, {e.max():.2g}" for e in usable.T]
        else:
            figures = ["-"] * 3
        coverage = f"{100 * np.mean(held[kind]):.0f}" if kind in held else "-"
        cells = [kind, method, *figures, coverage, str(missing), f"{np.median(times[kind]):.2f}"]
        print("| " + " | ".join(cells) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--onecycle", required=True)
    parser.add_argument("--cases", type=int, default=20, help="recordings of each kind")
    names = "onecycle,onecycle-auto,scipy,scipy-filtered,sippy,octave-arx,octave-moen4"
    parser.add_argument("--methods", default=names)
    parser.add_argument("--disturbance", default=WALK[1], help="as `onecycle simulate` has it; takes a folder of its own")
    parser.add_argument("-o", "--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    recordings = make(arguments.onecycle, arguments.out / "recordings", arguments.cases, arguments.disturbance)
    print("| recording | method | K/T_body (%) | T_prop (%) | tau (%) | intervals hold (%) | no answer | time (s) |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for method in arguments.methods.split(","):
        table_of(method, arguments, recordings)


if __name__ == "__main__":
    main()
