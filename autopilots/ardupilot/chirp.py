"""From the chirp of SYSTEMID to better gains, without a line of code in the autopilot.

    python chirp.py --ardupilot DIR --onecycle target/release/onecycle [--axis roll] [--out FOLDER]

1. First flight: hover, and the chirp of the mode SYSTEMID on the output of the rate controller.
2. `onecycle identify LOG --axis AXIS --write FILE` gives the gains of the rate loop; angle.py the angle gain around it.
3. Second flight: steps of 10 degrees with the gains of the firmware, with the new rate gains, and with all new gains.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import angle
import measure
from sitl import GUIDED, STABILIZE, SYSTEMID, FlightError, Vehicle, command_line

SHORT = {"roll": "RLL", "pitch": "PIT", "yaw": "YAW"}
SID_AXIS = {"roll": 10, "pitch": 11, "yaw": 12}
CHIRP = {"SID_MAGNITUDE": 0.06, "SID_F_START_HZ": 0.5, "SID_F_STOP_HZ": 15, "SID_T_FADE_IN": 2, "SID_T_REC": 22,
         "SID_T_FADE_OUT": 1}


def hold_height(vehicle, wanted_m, hover_us):
    """Throttle of the pilot in a mode with manual throttle: proportional to the error of height and climb rate."""
    climb = -vehicle.position.vz
    vehicle.throttle = int(min(1700, max(1250, hover_us + 30 * (wanted_m - vehicle.height_m()) - 60 * climb)))


def fly_chirp(folder, axis, options):
    """One flight with the chirp; returns its log and the filters of target and derivative (Hz)."""
    with Vehicle(options.ardupilot, folder, options.port, options.speedup, parameters=CHIRP) as vehicle:
        vehicle.set("SID_AXIS", SID_AXIS[axis])
        vehicle.take_off(20.0)
        height_m = vehicle.height_m()
        hover_us = 1500  # the middle of the stick is the hover throttle, MOT_THST_HOVER
        vehicle.mode(STABILIZE)
        vehicle.mode(SYSTEMID)
        began_s = vehicle.time_s

        def finished():
            hold_height(vehicle, height_m, hover_us)
            return vehicle.said("SystemID Finished", began_s)

        vehicle.wait(finished, 60, "end of the chirp")
        vehicle.mode(GUIDED)  # at once: the quiet after the chirp tells nothing
        vehicle.sleep(2.0)
        print(f"chirp on {axis}: {vehicle.time_s - began_s:.0f} s")
        filters = [vehicle.get(f"ATC_RAT_{SHORT[axis]}_{name}") for name in ("FLTT", "FLTD")]
        vehicle.disarm()
        return vehicle.log(), filters


def fly_steps(folder, axis, files, options):
    """One flight: steps with the gains of the firmware, then after each of the files. Returns the log and the windows."""
    with Vehicle(options.ardupilot, folder, options.port, options.speedup) as vehicle:
        vehicle.take_off(20.0)
        windows = [measure.fly_steps(vehicle, axis)]
        for file in files:
            vehicle.mode(GUIDED)
            vehicle.sleep(3.0)
            vehicle.load(file)
            windows.append(measure.fly_steps(vehicle, axis))
        vehicle.disarm()
        return vehicle.log(), windows


def identify(log, axis, file, options):
    """Gains of the rate loop from the log into the file; prints what the program says about them. Returns its answer."""
    call = [options.onecycle, "identify", str(log), "--axis", axis]
    done = subprocess.run([*call, "--write", str(file), "--step", "1"], capture_output=True, text=True, check=False)
    if done.returncode != 0 or not file.exists():
        raise FlightError(f"{' '.join(call)}: {(done.stderr or done.stdout).strip()}")
    print("$ " + " ".join([*call, "--write", str(file)]))
    print(done.stdout[done.stdout.index("Parameters"):].rstrip(), flush=True)
    answer = json.loads(subprocess.run([*call, "--json"], capture_output=True, text=True, check=True).stdout)
    if answer["structure"] != "foptd":
        raise FlightError(f"the structure {answer['structure']} has no angle gain here; keep the one in force")
    return answer


def tune(out, options):
    """Two flights; returns the figures of the steps with the gains of the firmware, then with the new ones."""
    axis = options.axis
    rate, both = out / f"{axis}-rate.param", out / f"{axis}.param"
    log, filters = fly_chirp(out / "chirp", axis, options)
    answer = identify(log, axis, rate, options)
    closed = angle.rate_loop(answer["process"], answer["controller"], *filters)
    line = f"ATC_ANG_{SHORT[axis]}_P,{angle.gain(closed):.4g}"
    print("angle loop: " + line)
    both.write_text(rate.read_text() + line + "\n")
    log, windows = fly_steps(out / "steps", axis, [rate, both], options)
    return list(zip(("gains of the firmware", "new rate gains", "new rate and angle gains"),
                    measure.evaluate(log, axis, windows)))


def main():
    """Command line."""
    parser = command_line(__doc__.splitlines()[0], program=True)
    parser.add_argument("--axis", choices=SID_AXIS, default="roll")
    options = parser.parse_args()
    out = pathlib.Path(options.out or tempfile.mkdtemp(prefix="onecycle-"))
    try:
        rows = tune(out, options)
    except (FlightError, ValueError) as error:
        sys.exit(f"chirp: {error}")
    print("\n".join(measure.table(rows)))
    print(f"logs and parameter files: {out}")


if __name__ == "__main__":
    main()
