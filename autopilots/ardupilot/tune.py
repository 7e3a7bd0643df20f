"""Tunes a simulated copter by one of three methods, several times, and flies the same steps with the gains of each flight.

    python tune.py --ardupilot DIR --method onecycle|autotune|quiktune [--axes roll,pitch,yaw] [--flights N] [--out FOLDER]

onecycle is the backend of AC_CustomControl (see apply.py), autotune the flight mode AUTOTUNE, quiktune the script of ArduPilot.
A test that is refused is a result too: the old gains stay in force. The table has the medians of the axes that were tuned.
"""

import pathlib
import statistics
import sys
import tempfile

import measure
from sitl import AUTOTUNE, LOITER, FlightError, Vehicle, command_line

BIT = {"roll": 1, "pitch": 2, "yaw": 4}
SHORT = {"roll": "RLL", "pitch": "PIT", "yaw": "YAW"}
CUSTOM_CONTROLLER = 109
SCRIPTING_1 = 300
LOW, MIDDLE, HIGH = 0, 1, 2
# Between two flights, so that each meets other noise (s).
APART_S = 0.37


def names(axes):
    """Parameters that a method may change on these axes."""
    return [name.format(SHORT[axis]) for axis in axes for name in (
        "ATC_ANG_{}_P", "ATC_RAT_{}_P", "ATC_RAT_{}_I", "ATC_RAT_{}_D", "ATC_RAT_{}_FLTT", "ATC_RAT_{}_FLTE",
        "ATC_RAT_{}_FLTD", "ATC_RAT_{}_SMAX")]


def mask(axes):
    """Bits of the axes."""
    return sum(BIT[axis] for axis in axes)


def by_onecycle(vehicle, axes):
    """The relay test, the switch to the middle and then high. Returns the time (s) of each axis that has gains."""
    began_s = vehicle.time_s
    vehicle.switch(CUSTOM_CONTROLLER, MIDDLE)
    vehicle.wait(lambda: vehicle.said("switch high", began_s) or vehicle.said("old gains", began_s)
                 or vehicle.said("try again", began_s), 120, "relay tests")
    times = {}
    for axis in axes:
        found = vehicle.said(f"{axis} angle P", began_s)
        if found:
            times[axis] = found[0][0] - vehicle.said(f"test of {axis}", began_s)[0][0]
    if times:
        vehicle.switch(CUSTOM_CONTROLLER, HIGH)
        vehicle.sleep(1.0)
    return times


def by_autotune(vehicle, axes):
    """The flight mode AUTOTUNE; it saves its gains at disarm. Returns its time, in equal parts for the axes."""
    vehicle.mode(LOITER)
    vehicle.sleep(3.0)
    began_s = vehicle.time_s
    vehicle.mode(AUTOTUNE)
    vehicle.wait(lambda: vehicle.said("AutoTune: Success", began_s) or vehicle.said("AutoTune: Failed", began_s),
                 1200, "AUTOTUNE")
    took_s = vehicle.time_s - began_s
    if vehicle.said("AutoTune: Failed", began_s):
        return {}
    vehicle.disarm()
    vehicle.sleep(2.0)
    return dict.fromkeys(axes, took_s / len(axes))


def by_quiktune(vehicle, axes):
    """The script VTOL-quicktune.lua on a switch of three positions. Returns its time, in equal parts for the axes."""
    vehicle.mode(LOITER)
    vehicle.sleep(3.0)
    vehicle.switch(SCRIPTING_1, LOW)
    vehicle.sleep(2.0)
    began_s = vehicle.time_s
    vehicle.switch(SCRIPTING_1, MIDDLE)
    ends = ("Tuning: DONE", "Tuning: reverted", "ABORTING")
    vehicle.wait(lambda: any(vehicle.said(words, began_s) for words in ends), 1200, "QuikTune")
    took_s = vehicle.time_s - began_s
    if not vehicle.said("Tuning: DONE", began_s):
        return {}
    vehicle.switch(SCRIPTING_1, HIGH)
    vehicle.sleep(5.0)
    return dict.fromkeys(axes, took_s / len(axes))


METHODS = {"onecycle": by_onecycle, "autotune": by_autotune, "quiktune": by_quiktune}


def settings(method, axes, ardupilot):
    """Parameters at the start, Lua scripts of a method, and parameters in the air: those of a script are not there before."""
    if method == "onecycle":
        return {"CC_TYPE": 3, "CC_AXIS_MASK": mask(axes)}, [], {}
    if method == "autotune":
        return {"AUTOTUNE_AXES": mask(axes), "AUTOTUNE_AGGR": 0.1}, [], {}
    script = pathlib.Path(ardupilot) / "libraries/AP_Scripting/applets/VTOL-quicktune.lua"
    return {}, [script], {"QUIK_ENABLE": 1, "QUIK_AXES": mask(axes), "QUIK_RC_FUNC": SCRIPTING_1}


def tune(folder, wait_s, options):
    """One flight; returns the time (s) of each axis tuned, and writes the changed parameters of these axes into a file."""
    parameters, scripts, changes = settings(options.method, options.axes, options.ardupilot)
    changes |= {name: float(value) for name, value in (change.split("=") for change in options.set)}
    with Vehicle(options.ardupilot, folder, options.port, options.speedup, parameters=parameters, lua=scripts) as vehicle:
        vehicle.take_off(20.0)
        for name, value in changes.items():
            vehicle.set(name, value)
        vehicle.sleep(wait_s)
        old = {name: vehicle.get(name) for name in names(options.axes)}
        try:
            times = METHODS[options.method](vehicle, options.axes)
        finally:
            for at_s, text in vehicle.messages:
                if any(word in text for word in ("onecycle", "AutoTune", "Tuning")):
                    print(f"  {at_s:7.1f} s  {text}", flush=True)
        new = {name: vehicle.get(name) for name in names(times)}
        vehicle.disarm()
    lines = [f"{name},{value:.6g}\n" for name, value in new.items() if value != old[name]]
    (folder / "gains.param").write_text("".join(lines))
    return times


def fly(folder, axes, file, options):
    """Steps of each axis with the gains of the file, None for those of the firmware; figures by axis."""
    with Vehicle(options.ardupilot, folder, options.port, options.speedup) as vehicle:
        vehicle.take_off(20.0)
        if file is not None:
            vehicle.load(file)
        windows = {axis: [measure.fly_steps(vehicle, axis)] for axis in axes}
        vehicle.disarm()
        return {axis: measure.evaluate(vehicle.log(), axis, windows[axis])[0] for axis in axes}


def fly_all(out, options):
    """All flights; prints each, then the table."""
    stock = fly(out / "stock", options.axes, None, options)
    times, figures = [], []
    for i in range(options.flights):
        folder = out / f"{options.method}{i + 1}"
        try:
            times.append(tune(folder, APART_S * i, options))
            tuned = times[-1]
            figures.append(fly(out / f"{options.method}{i + 1}-steps", tuned, folder / "gains.param", options) if tuned else {})
        except (FlightError, ValueError) as error:
            times.append({})
            figures.append({})
            print(f"{options.method}: {error}")
        tuned = ", ".join(f"{axis} {took_s:.1f} s" for axis, took_s in times[-1].items())
        print(f"flight {i + 1} of {options.flights}: {tuned or 'no gains'}", flush=True)
    print("\n".join(table(options, stock, times, figures)))


def table(options, stock, times, figures):
    """Lines of the table: medians of the flights in which the axis was tuned, and the range of its ISE."""
    lines = ["| axis | gains | tuned | time (s) | rise (ms) | overshoot (%) | ISE (ms) | torque std |", "| --- " * 8 + "|"]
    for axis in options.axes:
        rows = [figure[axis] for figure in figures if axis in figure]
        lines.append(f"| {axis} | of the firmware | | | {shown([stock[axis]])} |")
        if rows:
            took = [time[axis] for time in times if axis in time]
            span = f"{statistics.median(took):.1f} ({min(took):.1f} to {max(took):.1f})"
            lines.append(f"| {axis} | {options.method} | {len(rows)} of {len(times)} | {span} | {shown(rows)} |")
        else:
            lines.append(f"| {axis} | {options.method} | 0 of {len(times)} | | | | | |")
    return lines


def shown(rows):
    """Cells of some steps: medians."""
    def of(key, scale):
        return statistics.median(scale * row[key] for row in rows)

    ise = [1e3 * row["ise_s"] for row in rows]
    span = f" ({min(ise):.0f} to {max(ise):.0f})" if len(ise) > 1 else ""
    return f"{of('rise_s', 1e3):.0f} | {of('overshoot', 1):.1f} | {of('ise_s', 1e3):.1f}{span} | {of('torque_std', 1):.3f}"


def main():
    """Command line."""
    parser = command_line(__doc__.splitlines()[0], settings=True)
    parser.add_argument("--method", choices=METHODS, default="onecycle")
    parser.add_argument("--axes", default="roll,pitch,yaw", help="axes, separated by commas")
    parser.add_argument("--flights", type=int, default=1)
    options = parser.parse_args()
    options.axes = options.axes.split(",")
    if unknown := set(options.axes) - set(BIT):
        sys.exit(f"tune: unknown axis {', '.join(unknown)}; choose from roll, pitch, yaw")
    try:
        fly_all(pathlib.Path(options.out or tempfile.mkdtemp(prefix="onecycle-")), options)
    except (FlightError, ValueError) as error:
        sys.exit(f"tune: {options.method}: {error}")


if __name__ == "__main__":
    main()
