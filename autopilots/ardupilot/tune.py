"""Tunes a simulated copter by one of three methods and flies the same steps before and after.

    python tune.py --ardupilot DIR --method onecycle|autotune|quiktune [--axes roll,pitch,yaw] [--out FOLDER]

onecycle is the backend of AC_CustomControl (see apply.py), autotune the flight mode AUTOTUNE, quiktune the script of ArduPilot.
"""

import argparse
import pathlib
import sys
import tempfile

import measure
from sitl import AUTOTUNE, GUIDED, LOITER, FlightError, Vehicle

BIT = {"roll": 1, "pitch": 2, "yaw": 4}
SHORT = {"roll": "RLL", "pitch": "PIT", "yaw": "YAW"}
CUSTOM_CONTROLLER = 109
LOW, MIDDLE, HIGH = 0, 1, 2


def names(axes):
    """Parameters that a method may change on these axes."""
    return [name.format(SHORT[axis]) for axis in axes for name in (
        "ATC_ANG_{}_P", "ATC_RAT_{}_P", "ATC_RAT_{}_I", "ATC_RAT_{}_D", "ATC_RAT_{}_FLTT", "ATC_RAT_{}_FLTE",
        "ATC_RAT_{}_FLTD", "ATC_RAT_{}_SMAX")]


def mask(axes):
    """Bits of the axes."""
    return sum(BIT[axis] for axis in axes)


def by_onecycle(vehicle, axes):
    """The relay test, the switch to the middle and then high."""
    del axes
    began_s = vehicle.time_s
    vehicle.switch(CUSTOM_CONTROLLER, MIDDLE)
    vehicle.wait(lambda: vehicle.said("switch high", began_s) or vehicle.said("old gains", began_s)
                 or vehicle.said("try again", began_s), 120, "relay tests")
    took_s = vehicle.time_s - began_s
    if not vehicle.said("switch high", began_s):
        raise FlightError(vehicle.last_messages(2))
    vehicle.switch(CUSTOM_CONTROLLER, HIGH)
    vehicle.sleep(1.0)
    return took_s


def by_autotune(vehicle, axes):
    """The flight mode AUTOTUNE; it saves its gains at disarm."""
    del axes
    vehicle.mode(LOITER)
    vehicle.sleep(3.0)
    began_s = vehicle.time_s
    vehicle.mode(AUTOTUNE)
    vehicle.wait(lambda: vehicle.said("AutoTune: Success", began_s) or vehicle.said("AutoTune: Failed", began_s),
                 1200, "AUTOTUNE")
    took_s = vehicle.time_s - began_s
    if vehicle.said("AutoTune: Failed", began_s):
        raise FlightError(vehicle.last_messages(2))
    vehicle.disarm()
    vehicle.sleep(2.0)
    return took_s


def by_quiktune(vehicle, axes):
    """The script VTOL-quicktune.lua on a switch of three positions (scripting 1)."""
    del axes
    vehicle.mode(LOITER)
    vehicle.sleep(3.0)
    vehicle.switch(300, LOW)
    vehicle.sleep(2.0)
    began_s = vehicle.time_s
    vehicle.switch(300, MIDDLE)
    vehicle.wait(lambda: vehicle.said("Tuning: done", began_s) or vehicle.said("Tuning: reverted", began_s),
                 1200, "QuikTune")
    took_s = vehicle.time_s - began_s
    vehicle.switch(300, HIGH)
    vehicle.sleep(5.0)
    return took_s


def settings(method, axes, ardupilot):
    """Parameters at the start and the Lua script of a method."""
    if method == "onecycle":
        return {"CC_TYPE": 3, "CC_AXIS_MASK": mask(axes)}, None
    if method == "autotune":
        return {"AUTOTUNE_AXES": mask(axes), "AUTOTUNE_AGGR": 0.1}, None
    script = pathlib.Path(ardupilot) / "libraries/AP_Scripting/applets/VTOL-quicktune.lua"
    return {"QUIK_ENABLE": 1, "QUIK_AXES": mask(axes), "QUIK_RC_FUNC": 300}, script


def tune(method, axes, folder, options):
    """One flight; returns its time (s) and the parameters that it changed."""
    parameters, script = settings(method, axes, options.ardupilot)
    with Vehicle(options.ardupilot, folder, options.port, options.speedup, parameters=parameters, lua=script) as vehicle:
        vehicle.take_off(20.0)
        for change in options.set:
            name, value = change.split("=")
            vehicle.set(name, float(value))
        old = {name: vehicle.get(name) for name in names(axes)}
        try:
            took_s = {"onecycle": by_onecycle, "autotune": by_autotune, "quiktune": by_quiktune}[method](vehicle, axes)
        finally:
            for at_s, text in vehicle.messages:
                if any(word in text for word in ("onecycle", "AutoTune", "Tuning")):
                    print(f"  {at_s:7.1f} s  {text}")
        new = {name: vehicle.get(name) for name in old}
        vehicle.disarm()
        return took_s, {name: value for name, value in new.items() if value != old[name]}


def fly(axes, file, folder, options):
    """Steps of each axis with the gains of the firmware and with those of the file; figures by axis."""
    with Vehicle(options.ardupilot, folder, options.port, options.speedup) as vehicle:
        vehicle.take_off(20.0)
        windows = {axis: [measure.fly_steps(vehicle, axis)] for axis in axes}
        vehicle.mode(GUIDED)
        vehicle.sleep(3.0)
        vehicle.load(file)
        for axis in axes:
            windows[axis].append(measure.fly_steps(vehicle, axis))
        vehicle.disarm()
        return {axis: measure.evaluate(vehicle.log(), axis, windows[axis]) for axis in axes}


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ardupilot", required=True, help="checkout of ArduPilot with build/sitl/bin/arducopter")
    parser.add_argument("--method", choices=("onecycle", "autotune", "quiktune"), default="onecycle")
    parser.add_argument("--axes", default="roll,pitch,yaw", help="axes, separated by commas")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="parameter before the test")
    parser.add_argument("--out", help="folder for logs and parameter files; default: a temporary one")
    parser.add_argument("--port", type=int, default=14650)
    parser.add_argument("--speedup", type=float, default=5)
    options = parser.parse_args()
    out = pathlib.Path(options.out or tempfile.mkdtemp(prefix="onecycle-"))
    axes = options.axes.split(",")
    if unknown := set(axes) - set(BIT):
        sys.exit(f"tune: unknown axis {', '.join(unknown)}; choose from roll, pitch, yaw")
    try:
        took_s, new = tune(options.method, axes, out / options.method, options)
        file = out / f"{options.method}.param"
        file.write_text("".join(f"{name},{value:.6g}\n" for name, value in new.items()))
        print(f"{options.method}: {took_s:.1f} s for {options.axes}")
        print(file.read_text().rstrip())
        figures = fly(axes, file, out / f"{options.method}-steps", options)
    except (FlightError, ValueError) as error:
        sys.exit(f"tune: {options.method}: {error}")
    rows = [(f"{axis}, {name}", row) for axis in axes
            for name, row in zip(("gains of the firmware", options.method), figures[axis])]
    print("\n".join(measure.table(rows)))


if __name__ == "__main__":
    main()
