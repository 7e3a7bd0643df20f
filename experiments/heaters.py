#!/usr/bin/env python3
"""Relay and step tests of simulated heaters, identified with default options.

    python experiments/heaters.py PATH/TO/onecycle [--runs N]

A heater above its ambient temperature is K e^(-tau s)/((T1 s + 1)(T2 s + 1)). Each parameter is drawn within 20 % of its value.
Tests: a relay between 0 and full power with hysteresis, and a step to half power after 0 to 30 rows of rest. Logs: every
decision of the relay, a value a second (room: 20 s) rounded to 0.1 degree, and what a display shows: rounded to 1 degree (room: 0.25).

An answer is right if the process comes to rest by itself, K is within 10 %, and tau within 5 % or one row. A display does not
tell a dead time from a short lag: there tau with the shorter lags is within 20 % or one row of tau + T2. Counted beside: how often
the 90 % intervals of K and tau hold both. Prints a row for each test, log and heater.
"""

import argparse
import json
import math
import random
import subprocess
import tempfile

# K (degrees at full power), T1, T2, tau (s), set-point, hysteresis, ambient (degrees), decision of the relay, end (s).
HEATERS = {
    "hot end": (588, 220, 8, 1.0, 210, 5, 22, 0.3, 400),
    "bed": (120, 600, 20, 5.0, 60, 5, 22, 0.3, 2500),
    "boiler": (300, 900, 40, 12.0, 95, 2, 20, 0.6, 3000),
    "room": (15, 3600, 300, 120.0, 21, 0.5, 18, 6.0, 60000),
}
NOISE = {"room": 0.02}
# Steps a degree that a display shows, if not one.
DISPLAYED = {"room": 4}
SELF_REGULATING = ("foptd", "soptd", "toptd", "resonant", "resonant_lag")


def heater(name, chance):
    k, t1, t2, tau, *rest = HEATERS[name]
    return [value * chance.uniform(0.8, 1.2) for value in (k, t1, t2, tau)], rest


def relay(name, chance):
    """Rows of time, power and temperature at every decision. The input is held, so both lags are exact."""
    (k, t1, t2, tau), (setpoint, hysteresis, ambient, dt, end) = heater(name, chance)
    steps = round(tau / dt)
    tau = steps * dt
    late = [0.0] * (steps + 1)
    slow = fast = 0.0
    on, rows = True, []
    for index in range(int(end / dt)):
        value = ambient + k * (t1 * slow - t2 * fast) / (t1 - t2) + chance.gauss(0, NOISE.get(name, 0.05))
        if on and value > setpoint + hysteresis / 2 or not on and value < setpoint - hysteresis / 2:
            on = not on
        rows.append((index * dt, float(on), value))
        late.append(float(on))
        power = late[-1 - steps]
        slow += (1 - math.exp(-dt / t1)) * (power - slow)
        fast += (1 - math.exp(-dt / t2)) * (power - fast)
    return rows, (k, tau, t2)


def step(name, chance):
    """Rows of a step to half power: the response is in closed form."""
    (k, t1, t2, tau), (_, _, ambient, dt, _) = heater(name, chance)
    count = int(5 * t1 / dt)
    thin = max(1, count // 4000)
    at = chance.randrange(0, 31) * thin * dt
    rows = []
    for index in range(0, count, thin):
        since = max(0.0, index * dt - at - tau)
        response = 1 - (t1 * math.exp(-since / t1) - t2 * math.exp(-since / t2)) / (t1 - t2)
        value = ambient + 0.5 * k * response + chance.gauss(0, NOISE.get(name, 0.05))
        rows.append((index * dt, 0.5 if index * dt >= at else 0.0, value))
    return rows, (k, tau, t2)


def coarse(rows, name, steps):
    """The last row before each second (room: 20 s), rounded to that many steps a degree."""
    period = 20.0 if name == "room" else 1.0
    kept, due = [], 0.0
    for time, power, value in rows:
        if time >= due - 1e-9:
            kept.append((time, power, round(value * steps) / steps))
            due += period
    return kept


def judge(program, rows, truth, is_displayed):
    k, tau, t2 = truth
    with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
        file.write("time_s,input,output\n")
        file.writelines("%.7g,%.7g,%.7g\n" % row for row in rows)
        file.flush()
        run = subprocess.run([program, "identify", file.name, "--json"], capture_output=True, text=True)
    if run.returncode != 0:
        return False, False, False
    process = json.loads(run.stdout)["process"]
    gain, delay = process.get("k") or {}, process["tau_s"]
    row_s = rows[1][0] - rows[0][0]
    estimate = gain.get("estimate")
    if is_displayed:
        lags = sum((process.get(name) or {}).get("estimate") or 0 for name in ("t_prop_s", "t_prop2_s"))
        is_timed = abs(delay["estimate"] + lags - tau - t2) < max(0.2 * (tau + t2), row_s)
    else:
        is_timed = abs(delay["estimate"] - tau) < max(0.05 * tau, row_s)
    is_gain = estimate is not None and abs(estimate / k - 1) < 0.1
    right = process["structure"] in SELF_REGULATING and is_gain and is_timed
    holds = all(
        interval.get("low") is not None and interval.get("high") is not None
        and interval["low"] <= value <= interval["high"]
        for interval, value in ((gain, k), (delay, tau))
    )
    return True, right, holds


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("program")
    arguments.add_argument("--runs", type=int, default=6)
    asked = arguments.parse_args()
    total = [0, 0, 0, 0]
    print("| test, log | heater | runs | answered | right | K and tau held |\n| --- | --- | --- | --- | --- | --- |")
    for test in (relay, step):
        for log in ("every row", "coarse", "display"):
            for name in HEATERS:
                counts = [0, 0, 0]
                for run in range(asked.runs):
                    chance = random.Random(f"{test.__name__} {name} {run}")
                    rows, truth = test(name, chance)
                    if log != "every row":
                        rows = coarse(rows, name, 10 if log == "coarse" else DISPLAYED.get(name, 1))
                    judged = judge(asked.program, rows, truth, log == "display")
                    counts = [a + b for a, b in zip(counts, judged)]
                total = [a + b for a, b in zip(total, [asked.runs, *counts])]
                print(f"| {test.__name__}, {log} | {name} | {asked.runs} | " + " | ".join(map(str, counts)) + " |", flush=True)
    print(f"| all | | {total[0]} | {total[1]} | {total[2]} | {total[3]} |")


if __name__ == "__main__":
    main()
