"""Tables of what `fly.py` printed: medians over the flights of a tuner. Margins and load are those of the gains found on the model that the
simulator itself uses (SIH's default parameters), not on a model that any tuner identified.

    python compare.py stock=flights/stock*.json autotune=flights/autotune*.json onecycle=flights/onecycle*.json
"""

import glob
import json
import math
import statistics
import sys

import numpy

from fly import AXES, INNER

GRAVITY = 9.81
# SIH: lag of the motors (s), the default parameters' acceleration for a full set-point, and the body's damping (1/s).
MOTOR_S = 0.05
ACCELERATION = {"roll": 113.1, "pitch": 113.1, "yaw": 13.3, "altitude": 20.0}
DAMPING = {"roll": 1.0, "pitch": 1.0, "yaw": 1 / 1.2, "altitude": 1.0}
HOVER = 0.49
# A tick of the estimator, and half of one in which the output is held (s); the gyro's filter is of second order (rad/s).
DELAY_S = 0.006
GYRO = 2 * math.pi * 40
TICK_S = 0.001


def law(axis, gains):
    """Outer gain, inner gain on the rate, inner integral, and the cut-off of the output (Hz, 0: none)."""
    if axis == "altitude":
        share = HOVER / GRAVITY
        return gains["MPC_Z_P"], share * gains["MPC_Z_VEL_P_ACC"], share * gains["MPC_Z_VEL_I_ACC"], 0.0
    inner = INNER[axis]
    overall = gains[f"{inner}_K"]
    cut_off = gains["MC_YAW_TQ_CUTOFF"] if axis == "yaw" else 0.0
    return gains[f"MC_{axis.upper()}_P"], overall * gains[f"{inner}_P"], overall * gains[f"{inner}_I"], cut_off


def margins(axis, gains):
    """Phase margin (deg) and maximum sensitivity of the loop, cut at the process input."""
    outer, inner, integral, cut_off = law(axis, gains)
    s = 1j * numpy.logspace(-1, 2.7, 40000)
    process = ACCELERATION[axis] * numpy.exp(-DELAY_S * s) / (s * (s + DAMPING[axis]) * (MOTOR_S * s + 1))
    measured = s if axis == "altitude" else s / ((s / GYRO) ** 2 + math.sqrt(2) * s / GYRO + 1)
    output = 1 / (s / (2 * math.pi * cut_off) + 1) if cut_off > 0 else 1
    loop = process * output * (inner + integral / s) * (outer + measured)
    crossings = numpy.flatnonzero(numpy.diff(numpy.sign(abs(loop) - 1)))
    margin = min(180 + math.degrees(numpy.angle(loop[k])) if numpy.angle(loop[k]) < 0 else math.degrees(numpy.angle(loop[k])) - 180 for k in crossings)
    return margin, abs(1 / (1 + loop)).max()


def load(axis, gains, seconds=4.0):
    """Largest deviation of the output after a step of a tenth of the full input."""
    outer, inner, integral, cut_off = law(axis, gains)
    line = [0.0] * round(DELAY_S / TICK_S)
    sum_, motor, rate, value, output, largest = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(round(seconds / TICK_S)):
        error = -outer * value - rate
        sum_ += integral * error * TICK_S
        wanted = min(max(inner * error + sum_, -1.0), 1.0)
        output = output + TICK_S * 2 * math.pi * cut_off * (wanted - output) if cut_off > 0 else wanted
        line.append(output)
        motor += TICK_S * (line.pop(0) + 0.1 - motor) / MOTOR_S
        rate += TICK_S * (ACCELERATION[axis] * motor - DAMPING[axis] * rate)
        value += TICK_S * rate
        largest = max(largest, abs(value))
    return largest


def median(values):
    values = [value for value in values if value is not None and not math.isnan(value)]
    return statistics.median(values) if values else math.nan


def main():
    groups = {}
    for argument in sys.argv[1:]:
        name, pattern = argument.split("=")
        lines = [open(path).read() for path in sorted(glob.glob(pattern))]
        groups[name] = [json.loads(line) for line in lines if line.strip()]
    for axis in AXES:
        unit = "m" if axis == "altitude" else "deg"
        print(f"\n{axis}\n| tuner | tuned | time (s) | rise (s) | overshoot | ISE (s) | noise of the input | margin (deg) | Ms | load ({unit}) |")
        print("| --- " * 10 + "|")
        for name, flights in groups.items():
            flights = [flight for flight in flights if "gains" in flight]
            tuned = [flight for flight in flights if axis in flight["tuned_s"]]
            counted = tuned or flights
            steps = [flight["steps"][axis] for flight in counted if axis in flight["steps"]]
            of_steps = lambda key: median(step[key] for step in steps)
            robust = [margins(axis, flight["gains"]) for flight in counted]
            scale = 1 if axis == "altitude" else 180 / math.pi
            loads = median(scale * load(axis, flight["gains"]) for flight in counted)
            time_s = median(flight["tuned_s"].get(axis) for flight in tuned)
            share = f"{len(tuned)} of {len(flights)}" if tuned else "-"
            print(
                f"| {name} | {share} | {time_s:.1f} | {of_steps('rise_s'):.3f} | {100 * of_steps('overshoot'):.0f} % | {of_steps('ise_s'):.3f} "
                f"| {of_steps('input_noise'):.4f} | {median(m for m, _ in robust):.0f} | {median(s for _, s in robust):.2f} | {loads:.2f} |"
            )


if __name__ == "__main__":
    main()
