#!/usr/bin/env python3
"""Gains from one oscillation of simulated processes, judged on the true process, beside those of Ziegler and Nichols.

    python experiments/ultimate.py PATH/TO/onecycle [--runs N]

Heaters of first order have tau/T of 0.05 to 1, those of second order T1/tau of 10 to 200 and T2/tau of 0.5 to 8, integrators T2/tau
of 0 to 5; all are drawn with fixed seeds. Known is

- the true ultimate gain and period (--ultimate-gain, --ultimate-period),
- period and amplitude under a relay without hysteresis (--relay, --amplitude),
- the same with a hysteresis of 0.3 of the amplitude it had, high for about a third of the time (--hysteresis, --duty),
- 4H/(pi A) and the period of the relay without hysteresis, as if they were true,
- the relay, and the share of the dead time in the sum of the times within a factor of two (--dead-time-share),
- the relay, with the style sharp.

The limit is Ms 1.6 (sharp: 2.0). Ms is computed here, on a grid of frequencies with exact dead time; the IAE of a step of
the load by the program. The gains of Ziegler and Nichols come from the KU and TU that is known by the describing function, with a
filter of TU/80. Prints a row for each kind of process and each knowledge.
"""

import argparse
import cmath
import json
import math
import random
import statistics
import subprocess

STEPS = 4000
PERIODS = 30


def draw(kind, chance):
    """Gain, lags (s, inf: an integrator) and dead time (s)."""
    spread = lambda low, high: math.exp(chance.uniform(math.log(low), math.log(high)))
    tau, slope = spread(0.5, 50), spread(0.01, 100)
    if kind == "first order":
        return slope, tau / spread(0.05, 1), 0.0, tau
    if kind == "second order":
        return slope, tau * spread(10, 200), tau * spread(0.5, 8), tau
    return slope, math.inf, tau * chance.uniform(0, 5), tau


def response(process, omega):
    """The process is slope e^(-tau s)/((s + 1/T1)(T2 s + 1))."""
    slope, t1, t2, tau = process
    s = 1j * omega
    return slope * cmath.exp(-tau * s) / ((s + 1 / t1) * (t2 * s + 1))


def ultimate(process):
    slope, t1, t2, tau = process
    lag = lambda w: tau * w + (math.pi / 2 if math.isinf(t1) else math.atan(t1 * w)) + math.atan(t2 * w)
    low, high = 1e-9 / tau, math.pi / tau
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if lag(middle) < math.pi else (low, middle)
    return 1 / abs(response(process, low)), 2 * math.pi / low


def relay(process, period, hysteresis, high_share):
    """Period, amplitude and duty of the last cycles under a relay of H = 1; the step of the simulation is a part of `period`."""
    slope, t1, t2, tau = process
    dt = period / STEPS
    levels = (2 * (1 - high_share), -2 * high_share)
    late = [0.0] * round(tau / dt)
    keep1 = 1.0 if math.isinf(t1) else math.exp(-dt / t1)
    gain1 = slope * (dt if math.isinf(t1) else t1 * (1 - keep1))
    keep2 = math.exp(-dt / t2) if t2 > 0 else 0.0
    x1 = y = -slope * tau  # Below the thresholds: at rest on them the relay chatters.
    on, rises, falls, low, high, swings = True, [], [], 0.0, 0.0, []
    for index in range(STEPS * PERIODS):
        if on and y >= hysteresis:
            on = False
            falls.append(index)
        elif not on and y <= -hysteresis:
            on = True
            rises.append(index)
            swings.append((high - low) / 2)
            low = high = y
        late.append(levels[0] if on else levels[1])
        before = x1
        x1 = keep1 * x1 + gain1 * late[index]
        # The lag sees the mean of the ramp between the samples.
        y = keep2 * y + (1 - keep2) * (before + x1) / 2 if t2 > 0 else x1
        low, high = min(low, y), max(high, y)
    last = [end - begin for begin, end in zip(rises[-6:], rises[-5:])]
    begin = rises[-2]
    duty = (next(fall for fall in falls if fall > begin) - begin) / last[-1]
    return statistics.mean(last) * dt, swings[-1], duty


def peak(process, gains):
    """Ms, or None if the loop is unstable: the locus turns about -1, or passes on its left."""
    kp, ki, kd, filter_s = gains
    omega = 2 * math.pi / ultimate(process)[1]
    count, worst, turned, last = 6000, 0.0, 0.0, None
    for k in range(count):
        w = omega * 10 ** (-5 + 7.5 * k / (count - 1))
        s = 1j * w
        controller = (kp + ki / s + kd * s) / (1 + filter_s * s + (filter_s * s) ** 2 / 2)
        difference = 1 + controller * response(process, w)
        worst = max(worst, 1 / abs(difference))
        if last is not None:
            turned += cmath.phase(difference / last)
        last = difference
    # 1 + L starts near -90 deg (one integrator) or -180 deg (two) and ends at 1; a stable loop turns by as much.
    poles = 2 if math.isinf(process[1]) else 1
    return worst if abs(turned - poles * math.pi / 2) < 0.5 else None


def named(process):
    slope, t1, t2, tau = process
    if math.isinf(t1):
        return f"integrator_lag,K={slope},T_prop={t2},tau={tau}" if t2 > 0 else f"iptd,K={slope},tau={tau}"
    both = f"K={slope * t1},T_body={t1},tau={tau}"
    return f"soptd,{both},T_prop={t2}" if t2 > 0 else f"foptd,{both}"


def program(path, arguments):
    run = subprocess.run([path, "tune", "--json", *arguments], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


def load_iae(path, process, gains):
    report = program(path, ["--process", named(process), "--against", ",".join(map(repr, gains))])
    return report["against"]["load_iae"]


def knowledge(process):
    """Name, arguments of the program, and the KU and TU of a describing function."""
    gain, period = ultimate(process)
    text = lambda **options: [f"--{name.replace('_', '-')}={value!r}" for name, value in options.items()]
    yield "true KU, TU", text(ultimate_gain=gain, ultimate_period=period), (gain, period)
    period, amplitude, _ = relay(process, period, 0.0, 0.5)
    described = 4 / (math.pi * amplitude)
    test = text(relay=1.0, amplitude=amplitude, ultimate_period=period)
    yield "relay", test, (described, period)
    share = process[3] / sum(process[1:])
    yield "relay, dead-time share", [*test, f"--dead-time-share={share / 2}..{min(2 * share, 0.95) or 0.05}"], (described, period)
    yield "relay, sharp", [*test, "--style=sharp"], (described, period)
    yield "relay as true KU, TU", text(ultimate_gain=described, ultimate_period=period), (described, period)
    hysteresis = 0.3 * amplitude
    period, amplitude, duty = relay(process, period, hysteresis, 0.35)
    options = text(relay=1.0, amplitude=amplitude, hysteresis=hysteresis, duty=duty, ultimate_period=period)
    yield "relay, hysteresis, duty", options, (4 / (math.pi * math.sqrt(amplitude**2 - hysteresis**2)), period)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("program")
    arguments.add_argument("--runs", type=int, default=20)
    asked = arguments.parse_args()
    print("| process | known | runs | within the limit | median Ms | largest Ms | Ziegler-Nichols: within | median Ms | largest Ms | load IAE, ours / theirs |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    rows = {}
    for kind in ("first order", "second order", "integrator"):
        for run in range(asked.runs):
            process = draw(kind, random.Random(f"{kind} {run}"))
            for name, options, (gain, period) in knowledge(process):
                controller = program(asked.program, options)["controller"]
                ours = [controller[key] for key in ("kp", "ki", "kd", "filter_s")]
                theirs = [0.6 * gain, 1.2 * gain / period, 0.075 * gain * period, period / 80]
                peaks = peak(process, ours), peak(process, theirs)
                costs = [load_iae(asked.program, process, gains) if peaks[1] else math.nan for gains in (ours, theirs)]
                rows.setdefault((kind, name), []).append((*peaks, costs[0] / costs[1]))
    for (kind, name), found in rows.items():
        ours = [of[0] or math.inf for of in found]
        theirs = [of[1] or math.inf for of in found]
        ratios = [of[2] for of in found if of[2] == of[2]]
        limit = 2.0 if name.endswith("sharp") else 1.6
        figures = lambda peaks: "%d | %.2f | %.2f" % (sum(of < 1.01 * limit for of in peaks), statistics.median(peaks), max(peaks))
        print(f"| {kind} | {name} | {len(found)} | {figures(ours)} | {figures(theirs)} | {statistics.median(ratios):.1f} |")


if __name__ == "__main__":
    main()
