"""Flies PX4's simulated quadrotor (SIH) into what can go wrong in a test of onecycle_tune. Every case must end with one message that
says why, the old gains in force, and the vehicle flying on. Prints a line for each case, and fails if one does not hold.

Run it by run.sh, which gives each flight a network of its own.
"""

import argparse
import os
import pathlib
import threading
import time

from fly import Vehicle

GAINS = (
    [f"MC_{axis}_P" for axis in ("ROLL", "PITCH", "YAW")]
    + [f"MC_{axis}RATE_{gain}" for axis in ("ROLL", "PITCH", "YAW") for gain in "KPID"]
    + ["MC_YAW_TQ_CUTOFF", "MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC"]
)


class Sticks:
    """A joystick over MAVLink, in its centre unless moved."""

    def __init__(self, station):
        self.roll = 0
        self.station = station
        self.runs = True
        self.thread = threading.Thread(target=self.send, daemon=True)

    def send(self):
        while self.runs:
            self.station.send(self.station.pack.manual_control_encode(1, 0, self.roll, 500, 0, 0))
            time.sleep(0.05)

    def close(self):
        self.runs = False
        self.thread.join(2)


def in_test(vehicle, axis, seconds):
    """Begins a test and waits until the relay has run for so many seconds."""
    vehicle.run("onecycle_tune", "run")
    vehicle.wait(lambda: f"onecycle: {axis}: test begins" in vehicle.said(), 10, "the test does not begin")
    time.sleep(1.5 + seconds)


def finished(vehicle, most_s=120):
    vehicle.wait(lambda: "onecycle: finished" in vehicle.said() or "no test:" in vehicle.said(), most_s, "the test does not end")
    time.sleep(0.5)


def on_the_ground(vehicle):
    vehicle.run("onecycle_tune", "run")
    finished(vehicle)


def aborted(vehicle):
    in_test(vehicle, "roll", 1)
    vehicle.run("onecycle_tune", "abort")
    finished(vehicle)


def another_mode(vehicle):
    in_test(vehicle, "pitch", 1)
    vehicle.run("commander", "mode", "posctl")
    finished(vehicle)


def stick_moved(vehicle):
    in_test(vehicle, "roll", 1)
    vehicle.sticks.roll = 600
    time.sleep(1)
    vehicle.sticks.roll = 0
    finished(vehicle)


def no_satellites(vehicle):
    in_test(vehicle, "roll", 0.5)
    vehicle.run("sensor_gps_sim", "stop")
    finished(vehicle)


def less_thrust(vehicle):
    # The motors lose a third of their thrust in the middle of the test.
    in_test(vehicle, "altitude", 1)
    vehicle.run("param", "set", "SIH_T_MAX", 0.67 * vehicle.parameter("SIH_T_MAX"))
    finished(vehicle)


def changed(parameter, value, axis="roll", seconds=1.0, until_s=None):
    """A parameter of the simulator changes in the test, and changes back after some time or at its end."""

    def case(vehicle):
        before = vehicle.parameter(parameter)
        in_test(vehicle, axis, seconds)
        vehicle.run("param", "set", parameter, value(before))
        if until_s is None:
            finished(vehicle)
        else:
            time.sleep(until_s)
        vehicle.run("param", "set", parameter, before)
        finished(vehicle)

    return case


def heading_reset(vehicle):
    in_test(vehicle, "roll", 1)
    vehicle.run("commander", "set_heading", 15)
    finished(vehicle)


def as_it_is(vehicle):
    in_test(vehicle, "roll", 0)
    finished(vehicle)


def finished_at_once(vehicle):
    vehicle.run("onecycle_tune", "run")
    finished(vehicle)


def weak_motor(vehicle):
    # The test takes place all the same; what it finds is checked in flight and does not outlive it.
    changed("SIH_MOT_PART", lambda _: 0.55)(vehicle)
    landed(vehicle)


def nobody_accepts(vehicle):
    in_test(vehicle, "roll", 0)
    finished(vehicle)


def landed_without_acceptance(vehicle):
    in_test(vehicle, "roll", 0)
    finished(vehicle)
    if vehicle.gains() == vehicle.old:
        raise RuntimeError("no gains were found, so nothing can be restored")
    landed(vehicle)


def landed(vehicle):
    vehicle.run("commander", "land")
    vehicle.wait(lambda: "Disarmed" in vehicle.said(), 60, "the vehicle does not land")
    time.sleep(1)


# Name: what happens, its settings, whether it has sticks, words of the message, whether it still flies at the end.
CASES = {
    "ground": (on_the_ground, {}, False, "hover first", False),
    "abort": (aborted, {"OC_AXES": 1}, False, "aborted by the operator", True),
    "mode": (another_mode, {"OC_AXES": 2}, True, "the flight mode changed", True),
    "stick": (stick_moved, {"OC_AXES": 1, "COM_RC_OVERRIDE": 0}, True, "a stick was moved", True),
    "satellites": (no_satellites, {"OC_AXES": 1, "OC_CYCLES": 4, "EKF2_NOAID_TOUT": 500000}, False, "the old gains are in force", True),
    "thrust": (less_thrust, {"OC_AXES": 8}, False, "the old gains are in force", True),
    "motor": (weak_motor, {"OC_AXES": 1, "SIH_MOT_BAD": 1}, False, "the old gains are in force", False),
    "motor-off": (changed("SIH_MOT_PART", lambda _: 0.0), {"OC_AXES": 1, "SIH_MOT_BAD": 1}, False, "the old gains are in force", False),
    "gyro": (changed("SIH_GYRO_HELD", lambda _: 1, until_s=0.3), {"OC_AXES": 1}, False, "the old gains are in force", False),
    "sign": (changed("SIH_L_ROLL", lambda before: -before), {"OC_AXES": 1}, False, "the old gains are in force", False),
    "heading": (heading_reset, {"OC_AXES": 1}, False, "the estimator was reset", True),
    "missing": (finished_at_once, {"OC_AXES": 1}, False, "the firmware lacks one of its gains", True),
    "small": (as_it_is, {"OC_AXES": 1, "OC_AMP": 0.005}, False, "the old gains are in force", True),
    "large": (as_it_is, {"OC_AXES": 1, "OC_AMP": 0.5, "MC_ROLLRATE_MAX": 60}, False, "the old gains are in force", True),
    "unanswered": (nobody_accepts, {"OC_AXES": 1, "OC_APPLY": 1}, False, "nobody accepted", True),
    "landed": (landed_without_acceptance, {"OC_AXES": 1, "OC_APPLY": 2}, False, "not accepted", False),
}


def fly(build, folder, name):
    case, settings, has_sticks, words, flies = CASES[name]
    if name == "missing":
        os.environ["ONECYCLE_MISSING"] = "MC_ROLLRATE_K"
    vehicle = Vehicle(build, folder)
    os.environ.pop("ONECYCLE_MISSING", None)
    vehicle.sticks = Sticks(vehicle.station) if has_sticks else None
    try:
        vehicle.run("param", "set", "OC_APPLY", 2)
        for setting, value in {**settings, **({"COM_RC_IN_MODE": 1} if has_sticks else {})}.items():
            vehicle.run("param", "set", setting, value)
        vehicle.begin_module()
        if has_sticks:
            vehicle.sticks.thread.start()
        if case is not on_the_ground:
            vehicle.hover()
        vehicle.gains = lambda: {gain: vehicle.parameter(gain) for gain in GAINS}
        vehicle.old = vehicle.gains()
        case(vehicle)
        new = vehicle.gains()
        time.sleep(3)
        messages = vehicle.messages()
        faults = []
        if new != vehicle.old:
            faults.append("gains differ: " + ", ".join(gain for gain in GAINS if new[gain] != vehicle.old[gain]))
        if sum(words in message for message in messages) != 1:
            faults.append(f"not one message with '{words}'")
        if len(vehicle.station.heard) != len(messages):
            faults.append("events: " + " | ".join(vehicle.station.heard))
        if flies and "Disarmed" in vehicle.said():
            faults.append("the vehicle no longer flies")
        print(f"{name:11} {'; '.join(faults) or 'holds'}: {' | '.join(messages)}", flush=True)
        return not faults
    except RuntimeError as error:
        # The other cases still tell something.
        print(f"{name:11} {error}", flush=True)
        return False
    finally:
        if vehicle.sticks:
            vehicle.sticks.close()
        vehicle.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", help="PX4's build folder, with the module onecycle_tune in it")
    parser.add_argument("folder", help="new folder for the flights")
    parser.add_argument("cases", nargs="*", choices=[[], *CASES], help="cases to fly [default: all]")
    arguments = parser.parse_args()
    held = [fly(arguments.build, pathlib.Path(arguments.folder) / name, name) for name in arguments.cases or CASES]
    raise SystemExit(0 if all(held) else 1)


if __name__ == "__main__":
    main()
