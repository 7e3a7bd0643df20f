"""Tables of what `fly.py` printed: medians over the flights of a tuner. Margins and load are those of the gains found on the simulator's
own equations (`sih.py`), not on a model that any tuner identified.

    python compare.py stock=flights/stock*.json autotune=flights/autotune*.json onecycle=flights/onecycle*.json
"""

import collections
import glob
import json
import math
import statistics
import sys

import sih
from fly import AXES, INNER

GRAVITY = 9.81
HOVER = 0.49


def law(axis, gains):
    """Outer P, and P, I, D of the rate, and the cut-off of the output (Hz, 0: none)."""
    if axis == "altitude":
        share = HOVER / GRAVITY
        return gains["MPC_Z_P"], share * gains["MPC_Z_VEL_P_ACC"], share * gains["MPC_Z_VEL_I_ACC"], 0.0, 0.0
    inner = INNER[axis]
    overall = gains[f"{inner}_K"]
    cut_off = gains["MC_YAW_TQ_CUTOFF"] if axis == "yaw" else 0.0
    return gains[f"MC_{axis.upper()}_P"], *(overall * gains[f"{inner}_{gain}"] for gain in "PID"), cut_off


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
            steps = [flight["steps"][axis] for flight in counted if axis in flight.get("steps", {})]
            if not (tuned or steps):
                continue
            of_steps = lambda key: median(step[key] for step in steps)
            laws = [law(axis, flight["gains"]) for flight in counted]
            robust = [sih.margins(axis, gains) for gains in laws]
            scale = 1 if axis == "altitude" else 180 / math.pi
            loads = median(scale * sih.largest_deviation(axis, gains) for gains in laws)
            time_s = median(flight["tuned_s"].get(axis) for flight in tuned)
            share = f"{len(tuned)} of {len(flights)}" if tuned else "-"
            print(
                f"| {name} | {share} | {time_s:.1f} | {of_steps('rise_s'):.3f} | {100 * of_steps('overshoot'):.0f} % | {of_steps('ise_s'):.3f} "
                f"| {of_steps('input_noise'):.4f} | {median(m for m, _ in robust):.0f} | {median(s for _, s in robust):.2f} | {loads:.2f} |"
            )
    for name, flights in groups.items():
        reasons = collections.Counter(flight["failed"] for flight in flights if "failed" in flight)
        for reason, count in reasons.items():
            print(f"\n{name}: {count} of {len(flights)} flights not counted: {reason}")


if __name__ == "__main__":
    main()
