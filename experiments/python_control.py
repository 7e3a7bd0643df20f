"""The relay experiment and a PD loop in python-control, for comparison.

Needs `pip install control` (and the numpy and scipy that it brings). Prints one line of JSON: steps
a second of each simulation, and what they found. Exits with an error if the limit cycle is not the
one expected.

The process is the paper's hover process, K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1)) sampled at
1 ms: exact under a held input, the delay of 23.7 samples as a chain of whole ones and two input
columns for the part of one.
"""

import json
import time

import control
import numpy as np
from scipy.linalg import expm

K, T_PROP, T_BODY, TAU = 1.0, 0.0321, 1.6886, 0.0237
SAMPLE_S = 1e-3
BETA = -0.73
# The steady period of the bare relay on this process, K = h = 1, sampled at 1 ms.
PERIOD_S = 0.420
# The optimal PD of the process at a phase margin of 20 deg.
KP, KD = 192.918, 29.523


def sampled_process():
    """Discrete state space: y, dy/dt, force, then the inputs on their way, latest first."""
    a = np.array([[0.0, 1.0, 0.0], [0.0, -1 / T_BODY, K / T_BODY], [0.0, 0.0, -1 / T_PROP]])
    b = np.array([0.0, 0.0, 1 / T_PROP])

    def held(duration):
        augmented = np.zeros((4, 4))
        augmented[:3, :3], augmented[:3, 3] = a, b
        e = expm(augmented * duration)
        return e[:3, :3], e[:3, 3]

    whole = int(np.floor(TAU / SAMPLE_S))
    fraction = TAU / SAMPLE_S - whole
    _, early = held(fraction * SAMPLE_S)
    late_a, late = held((1 - fraction) * SAMPLE_S)
    step_a, _ = held(SAMPLE_S)
    n = 3 + whole + 1
    big_a, big_b = np.zeros((n, n)), np.zeros((n, 1))
    big_a[:3, :3] = step_a
    # Input k of the chain is k + 1 samples old; over a step the one of `whole` + 1 samples ago
    # acts first, then the one of `whole` samples ago.
    big_a[:3, 3 + whole] = late_a @ early
    big_a[:3, 3 + whole - 1] = late
    for k in range(1, whole + 1):
        big_a[3 + k, 3 + k - 1] = 1.0
    big_b[3, 0] = 1.0
    c = np.zeros((2, n))
    c[0, 0] = c[1, 1] = 1.0
    return big_a, big_b, c


def relay_decision(x, e):
    """Level and peak from the last ones and the error: the relay without protection."""
    sign, peak = x
    if sign == 0.0:  # Kick: high until the error leaves zero, then against it.
        return (np.sign(e), abs(e)) if e != 0.0 else (0.0, 0.0)
    peak = max(peak, sign * e)
    if peak > 0.0 and sign * e <= -BETA * peak:
        return -sign, -sign * e
    return sign, peak


def relay():
    def update(_t, x, u, _params):
        return np.array(relay_decision(x, u[0]))

    def output(_t, x, u, _params):
        sign, _ = relay_decision(x, u[0])
        return np.array([sign if sign != 0.0 else 1.0])

    return control.nlsys(
        update, output, name="relay", states=2, inputs=["e"], outputs=["u"], dt=SAMPLE_S
    )


def relay_loop(steps):
    a, b, c = sampled_process()
    process = control.ss(
        a, b, c[:1], 0.0, SAMPLE_S, name="process", inputs=["u"], outputs=["y"]
    )
    error = control.summing_junction(["r", "-y"], "e", name="error", dt=SAMPLE_S)
    loop = control.interconnect(
        [process, relay(), error], inputs=["r"], outputs=["y", "u"], dt=SAMPLE_S
    )
    times = np.arange(steps) * SAMPLE_S
    begin = time.perf_counter()
    response = control.input_output_response(loop, times, np.zeros(steps))
    seconds = time.perf_counter() - begin
    return steps / seconds, response.outputs[0], response.outputs[1]


def pd_loop(steps):
    a, b, c = sampled_process()
    gain = np.array([[KP, KD]])
    closed = control.ss(a - b @ gain @ c, KP * b, c[:1], 0.0, SAMPLE_S)
    times = np.arange(steps) * SAMPLE_S
    begin = time.perf_counter()
    response = control.forced_response(closed, times, np.ones(steps))
    seconds = time.perf_counter() - begin
    return steps / seconds, response.outputs


def main():
    relay_steps, pd_steps = 10_000, 200_000
    relay_rate, y, u = relay_loop(relay_steps)
    rises = np.flatnonzero(np.diff(u) > 0) + 1
    period_s = float(np.mean(np.diff(rises[-6:]))) * SAMPLE_S
    if abs(period_s - PERIOD_S) > SAMPLE_S:
        raise SystemExit(f"the limit cycle has a period of {period_s} s, not {PERIOD_S} s")
    tail = y[rises[-6] : rises[-1]]
    pd_rate, step = pd_loop(pd_steps)
    print(
        json.dumps(
            {
                "control": control.__version__,
                "relay_steps_per_s": round(relay_rate),
                "relay_period_s": round(period_s, 6),
                "relay_amplitude": float(0.5 * (tail.max() - tail.min())),
                "pd_steps_per_s": round(pd_rate),
                "pd_output_at_300_ms": float(step[300]),
            }
        )
    )


if __name__ == "__main__":
    main()
