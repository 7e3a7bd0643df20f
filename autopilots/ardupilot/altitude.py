"""From a relay test of the altitude in Guided, by a script on unmodified ArduCopter, to better gains, written by another script.

    python altitude.py --ardupilot DIR --onecycle target/release/onecycle [--out FOLDER]

1. First flight: hover in Guided; scripts/onecycle_altitude.lua tests and writes a CSV file.
2. `onecycle identify` on that file; altitude_gains.py makes the parameters of the cascade.
3. Second flight: a step of the height and a push with the gains of the firmware; scripts/onecycle_params.lua puts the new ones in
   force; the same again; the switch high saves them.

In the simulator scripts run in a thread that sleeps in real time: the relay test is flown slower than that.
"""

import json
import math
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile

import altitude_gains
from sitl import GUIDED, FlightError, Vehicle, command_line, read_log

SCRIPTS = pathlib.Path(__file__).resolve().parent / "scripts"
ALTITUDE, PARAMETERS = 300, 301
LOW, MIDDLE, HIGH = 0, 1, 2
FILTERS = ("PSC_VELZ_FLTE", "PSC_ACCZ_FLTE")
SLOW = 0.1  # speed of the simulation during the relay test
STEP_M = 1.0
STEP_S = 8.0
STRUCTURE = ["--structure", "double_integrator_lag"]
# A push of 3 m/s^2 for a second, downwards.
PUSH = {"SIM_SHOVE_Z": 3.0, "SIM_SHOVE_TIME": 1000}
PUSH_S = 6.0


def test(folder, options):
    """One flight with the relay test; returns the recording and the filters of the cascade."""
    with Vehicle(options.ardupilot, folder, options.port, options.speedup, lua=[SCRIPTS / "onecycle_altitude.lua"]) as vehicle:
        vehicle.switch(ALTITUDE, LOW)
        vehicle.take_off(20.0)
        for change in options.set:
            name, value = change.split("=")
            vehicle.set(name, float(value))
        vehicle.set("SIM_SPEEDUP", SLOW)
        began_s = vehicle.time_s
        vehicle.switch(ALTITUDE, HIGH)
        vehicle.wait(lambda: len(vehicle.said("onecycle: altitude", began_s)) > 1, 60, "relay test")
        vehicle.set("SIM_SPEEDUP", options.speedup)
        text = vehicle.said("onecycle: altitude", began_s)[-1][1]
        print(f"{text} after {vehicle.time_s - began_s:.1f} s")
        if "done" not in text:
            raise FlightError(text)
        vehicle.sleep(3.0)
        filters = [vehicle.get(name) for name in FILTERS]
        vehicle.disarm()
        return folder / text.split()[-1], filters


def identify(recording, options):
    """The identified process; prints what the program says about it."""
    call = [options.onecycle, "identify", str(recording), *STRUCTURE]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise FlightError(f"{' '.join(call)}: {(done.stderr or done.stdout).strip()}")
    print("$ " + " ".join(call))
    print(done.stdout[:done.stdout.index("Controllers")].rstrip(), flush=True)
    return json.loads(subprocess.run([*call, "--json"], capture_output=True, text=True, check=True).stdout)["process"]


def fly_step(vehicle):
    """A step of the height in Guided and a push; returns the times at which they begin."""
    north_m, east_m, height_m = vehicle.position.x, vehicle.position.y, vehicle.height_m()
    step_s = vehicle.time_s
    vehicle.go(north_m, east_m, height_m + STEP_M)
    vehicle.sleep(STEP_S)
    push_s = vehicle.time_s
    for name, value in PUSH.items():
        vehicle.set(name, value)
    vehicle.sleep(PUSH_S)
    vehicle.go(north_m, east_m, height_m)
    vehicle.sleep(STEP_S)
    return step_s, push_s


def evaluate(log, windows):
    """Figures of each step and push from the position controller's log."""
    found = read_log(log, "PSCD", "RATE")
    results = []
    for step_s, push_s in windows:
        step = [row for row in found["PSCD"] if step_s <= row["t"] < push_s]
        first = step[0]["PD"]
        reached = [-(row["PD"] - first) / STEP_M for row in step]
        until = next((row["t"] for row, y in zip(step, reached) if y >= 0.9), math.inf)
        push = [row for row in found["PSCD"] if push_s <= row["t"] < push_s + PUSH_S]
        off = [row["PD"] - push[0]["TPD"] for row in push]
        seconds = [b["t"] - a["t"] for a, b in zip(push, push[1:])]
        throttle = [row["AOut"] for row in found["RATE"] if push_s - 2.0 <= row["t"] < push_s]
        results.append({
            "to_90_s": until - step[0]["t"],
            "overshoot": 100.0 * max(0.0, max(reached) - 1.0),
            "lag_m": math.sqrt(statistics.fmean((row["PD"] - row["TPD"]) ** 2 for row in step)),
            "push_m": max(map(abs, off)),
            "push_ms": 1e3 * sum(dt * abs(y) for dt, y in zip(seconds, off)),
            "throttle_std": statistics.pstdev(throttle),
        })
    return results


def compare(folder, file, options):
    """One flight: step and push, the new values in force by the script, step and push, saved. Returns the figures."""
    with Vehicle(options.ardupilot, folder, options.port, options.speedup, lua=[SCRIPTS / "onecycle_params.lua"]) as vehicle:
        vehicle.give(file, "onecycle.param")
        vehicle.switch(PARAMETERS, LOW)
        vehicle.take_off(20.0)
        windows = [fly_step(vehicle)]
        began_s = vehicle.time_s
        vehicle.switch(PARAMETERS, MIDDLE)
        vehicle.wait(lambda: vehicle.said("onecycle:", began_s), 5, "new values")
        if not vehicle.said("values in force", began_s):
            raise FlightError(vehicle.last_messages(1))
        vehicle.mode(GUIDED)
        vehicle.sleep(3.0)
        windows.append(fly_step(vehicle))
        vehicle.switch(PARAMETERS, HIGH)
        vehicle.wait(lambda: vehicle.said("values saved", began_s), 5, "values saved")
        vehicle.disarm()
        return evaluate(vehicle.log(), windows)


def tune(out, options):
    """Both flights; returns the figures with the gains of the firmware, then with the new ones."""
    recording, filters = test(out / "relay", options)
    shutil.copyfile(recording, out / "altitude.csv")
    gains = altitude_gains.cascade(identify(recording, options), *filters)
    file = out / "altitude.param"
    file.write_text("".join(f"{name},{value:.4g}\n" for name, value in gains.items()))
    print(file.read_text().rstrip())
    return list(zip(("gains of the firmware", "new gains"), compare(out / "steps", file, options)))


def main():
    """Command line."""
    parser = command_line(__doc__.splitlines()[0], program=True, settings=True)
    options = parser.parse_args()
    out = pathlib.Path(options.out or tempfile.mkdtemp(prefix="onecycle-"))
    try:
        rows = tune(out, options)
    except (FlightError, ValueError) as error:
        sys.exit(f"altitude: {error}")
    print("| gains | 90 % of 1 m (s) | overshoot (%) | lag (mm, rms) | push: largest (mm) | push: area (mm s) | throttle std |")
    print("| --- " * 7 + "|")
    for name, row in rows:
        print(f"| {name} | {row['to_90_s']:.2f} | {row['overshoot']:.1f} | {1e3 * row['lag_m']:.0f} | {1e3 * row['push_m']:.0f} "
              f"| {row['push_ms']:.0f} | {row['throttle_std']:.4f} |")
    print(f"logs and parameter files: {out}")


if __name__ == "__main__":
    main()
