"""Flies ArduCopter's simulated quadrotor into what can go wrong in a test. Every case must end with one message that says why, the
old gains in force, and, where it can, the vehicle flying on. Prints a row for each case, and fails if one does not hold.

    python faults.py --ardupilot DIR [--out FOLDER] [CASE ...]
"""

import pathlib
import sys
import tempfile

from altitude import SLOW
from sitl import ALT_HOLD, LAND, FlightError, Vehicle, command_line
from tune import CUSTOM_CONTROLLER, HIGH, LOW, MIDDLE, names

SCRIPTS = pathlib.Path(__file__).resolve().parent / "scripts"
ALTITUDE, PARAMETERS = 300, 301
EKF_YAW_RESET = 104
ROLL = {"CC_TYPE": 3, "CC_AXIS_MASK": 1, "CC3_AMP_RP": 0.15}
GAINS = [*names(["roll", "pitch", "yaw"]), "PSC_ACCZ_P", "PSC_ACCZ_I", "PSC_VELZ_P", "PSC_POSZ_P"]
GOOD = "ATC_RAT_RLL_P,0.2\nATC_RAT_RLL_I,0.2\nPSC_VELZ_P,6\n"


def in_test(vehicle, delay_s=0.3):
    """Begins the test of roll and waits until the relay has run for some time."""
    vehicle.switch(CUSTOM_CONTROLLER, MIDDLE)
    vehicle.wait(lambda: vehicle.said("test of"), 10, "test")
    vehicle.sleep(1.5 + delay_s)


def ended(vehicle, limit_s=40):
    """Waits for the end of a test, with gains or without."""
    vehicle.wait(lambda: vehicle.said("switch high") or vehicle.said("old gains") or vehicle.said("try again"), limit_s, "end of the test")
    vehicle.move_stick(1500)
    vehicle.sleep(2.0)


def on_the_ground(vehicle):
    vehicle.switch(CUSTOM_CONTROLLER, MIDDLE)
    vehicle.sleep(2.0)


def switched_off(vehicle):
    in_test(vehicle)
    vehicle.switch(CUSTOM_CONTROLLER, LOW)
    ended(vehicle)


def stick(vehicle):
    in_test(vehicle)
    vehicle.move_stick(1700)
    ended(vehicle)


def mode(vehicle):
    in_test(vehicle)
    vehicle.mode(ALT_HOLD)
    ended(vehicle)


def whole(vehicle):
    vehicle.switch(CUSTOM_CONTROLLER, MIDDLE)
    ended(vehicle)


def reversed_axis(vehicle):
    """The left and the right motor change places, for as long as the test runs."""
    vehicle.set("SIM_SPEEDUP", SLOW)
    in_test(vehicle, 0.0)
    for name, value in (("SERVO1_FUNCTION", 34), ("SERVO2_FUNCTION", 33)):
        vehicle.send(name, value)
    vehicle.wait(lambda: vehicle.said("old gains"), 10, "end of the test")
    for name, value in (("SERVO1_FUNCTION", 33), ("SERVO2_FUNCTION", 34)):
        vehicle.send(name, value)
    vehicle.sleep(1.0)
    vehicle.set("SIM_SPEEDUP", 1)
    vehicle.sleep(5.0)


def estimator(vehicle):
    """The heading is reset to the one that follows from the motion, which must be known: so some motion before the test."""
    north_m, east_m = vehicle.position.x, vehicle.position.y
    for away_m in (20.0, 0.0):
        vehicle.go(north_m + away_m, east_m, 20.0)
        vehicle.sleep(8.0)
    in_test(vehicle, 0.0)
    vehicle.switch(EKF_YAW_RESET, HIGH)
    ended(vehicle)


def simulated(name, value, delay_s=0.3):
    """A case in which a parameter of the simulator changes in the middle of the test."""
    def case(vehicle):
        in_test(vehicle, delay_s)
        vehicle.set(name, value)
        ended(vehicle)

    return case


def not_accepted(vehicle):
    whole(vehicle)
    vehicle.mode(LAND)
    vehicle.throttle = 1000
    vehicle.wait(lambda: not vehicle.is_armed, 60, "landing")
    vehicle.sleep(1.0)


def dropped(vehicle):
    whole(vehicle)
    vehicle.switch(CUSTOM_CONTROLLER, HIGH)
    vehicle.sleep(1.0)
    vehicle.switch(CUSTOM_CONTROLLER, LOW)
    vehicle.sleep(1.0)


def with_file(text, *positions):
    """A case of the script that writes parameters: this file, and the switch moved so."""
    def case(vehicle):
        (vehicle.folder / "scripts/onecycle.param").write_text(text)
        for position in positions:
            vehicle.switch(PARAMETERS, position)
            vehicle.sleep(1.0)

    return case


def not_saved(vehicle):
    with_file(GOOD, MIDDLE)(vehicle)
    vehicle.disarm()
    vehicle.sleep(2.0)


def altitude(what):
    """A case of the altitude test: something happens in its middle."""
    def case(vehicle):
        vehicle.set("SIM_SPEEDUP", SLOW)
        vehicle.switch(ALTITUDE, HIGH)
        vehicle.sleep(4.0)
        what(vehicle)
        vehicle.wait(lambda: any(vehicle.said("altitude " + word) for word in ("stopped", "refused", "done")), 40, "end of the test")
        vehicle.move_stick(1500)
        vehicle.set("SIM_SPEEDUP", 1)
        vehicle.sleep(2.0)

    return case




# Name: what happens, its settings, words of the message, whether it still flies at the end.
CASES = {
    "ground": (on_the_ground, ROLL, "not flying", False),
    "switch": (switched_off, ROLL, "stopped by the switch", True),
    "stick": (stick, ROLL, "stick moved", True),
    "mode": (mode, ROLL, "flight mode changed", True),
    "sign": (whole, ROLL | {"CC3_AMP_RP": -0.15}, "must be positive", True),
    "reversed": (reversed_axis, ROLL, "onecycle: roll:", True),
    "small": (whole, ROLL | {"CC3_AMP_RP": 0.0002}, "raise CC3_AMP_RP", True),
    "large": (whole, ROLL | {"CC3_AMP_RP": 0.9}, "lower CC3_AMP_RP", True),
    "estimator": (estimator, ROLL, "the estimator was reset", True),
    "thrust": (simulated("SIM_ENGINE_FAIL", 1), ROLL | {"SIM_ENGINE_MUL": 0.75}, "onecycle: roll:", True),
    "gyro": (simulated("SIM_GYR_FAIL_MSK", 1), ROLL, "roll angle P", True),  # the second gyro takes over
    "unanswered": (not_accepted, ROLL, "not accepted", False),
    "dropped": (dropped, ROLL, "old gains restored", True),
    "file-unknown": (with_file(GOOD + "ATC_RAT_RLL_X,0.1\n", MIDDLE), {}, "no parameter ATC_RAT_RLL_X", True),
    "file-no-gain": (with_file(GOOD + "FRAME_CLASS,2\n", MIDDLE), {}, "FRAME_CLASS is no gain", True),
    "file-broken": (with_file(GOOD + "ATC_RAT_PIT_P;0.1\n", MIDDLE), {}, "not NAME,VALUE", True),
    "file-dropped": (with_file(GOOD, MIDDLE, LOW), {}, "old values", True),
    "file-not-saved": (not_saved, {}, "disarmed before they were saved", False),
    "altitude-stick": (altitude(lambda vehicle: vehicle.move_stick(1700)), {}, "stick moved", True),
    "altitude-mode": (altitude(lambda vehicle: vehicle.mode(ALT_HOLD)), {}, "mode changed", True),
    "altitude-switch": (altitude(lambda vehicle: vehicle.switch(ALTITUDE, LOW)), {}, "switch low", True),
    "altitude-small": (altitude(lambda vehicle: None), {"OCA_AMP": 0.001}, "OCA_AMP too small", True),
    "altitude-large": (altitude(lambda vehicle: None), {"OCA_AMP": 0.3, "OCA_H_MAX": 0.1}, "out of OCA_H_MAX", True),
}


def fly(name, folder, options):
    """Flies one case; prints its row and returns whether it holds."""
    case, settings, words, flies = CASES[name]
    uses_scripts = name.startswith(("file", "altitude"))
    scripts = list(SCRIPTS.glob("*.lua")) if uses_scripts else []
    own = {key: value for key, value in settings.items() if key.startswith("OCA_")}
    first = {key: value for key, value in settings.items() if key not in own}
    speedup = 1 if uses_scripts else options.speedup
    with Vehicle(options.ardupilot, folder, options.port, speedup, parameters=first, lua=scripts) as vehicle:
        for function in (ALTITUDE, PARAMETERS) if uses_scripts else ():
            vehicle.switch(function, LOW)
        if case is not on_the_ground:
            vehicle.take_off(20.0)
        for key, value in own.items():
            vehicle.set(key, value)
        old = {gain: vehicle.get(gain) for gain in GAINS}
        problem = None
        try:
            case(vehicle)
        except FlightError as error:
            problem = str(error)
        faults = [problem] if problem else []
        new = {gain: vehicle.get(gain) for gain in GAINS}
        if new != old:
            faults.append("gains differ: " + ", ".join(gain for gain in GAINS if new[gain] != old[gain]))
        messages = [text for _, text in vehicle.messages if "onecycle" in text]
        if sum(words in message for message in messages) != 1:
            faults.append(f"not one message with '{words}'")
        if flies and not (vehicle.is_armed and vehicle.height_m() > 10):
            faults.append("no longer flies")
        said = next((message for message in messages if words in message), "; ".join(messages))
        print(f"| {name} | {'; '.join(faults) or 'holds'} | {said} |", flush=True)
        return not faults


def main():
    """Command line."""
    parser = command_line(__doc__.splitlines()[0], speedup=3)
    parser.add_argument("cases", nargs="*", choices=[[], *CASES], help="cases to fly [default: all]")
    options = parser.parse_args()
    out = pathlib.Path(options.out or tempfile.mkdtemp(prefix="onecycle-"))
    held = [fly(name, out / name, options) for name in options.cases or CASES]
    sys.exit(0 if all(held) else 1)


if __name__ == "__main__":
    main()
