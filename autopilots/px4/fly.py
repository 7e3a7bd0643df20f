"""Flies PX4's simulated quadrotor (SIH) and tunes it: with onecycle, with PX4's own autotune, or not at all. Then it commands steps
of the attitude and prints a line of JSON: what was tuned, how long it took, and what the steps were like.

Run it by run.sh, which gives each flight a network of its own.
"""

import argparse
import json
import math
import os
import pathlib
import re
import socket
import struct
import subprocess
import threading
import time

import numpy
os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil
from pyulog import ULog

AXES = ("roll", "pitch", "yaw", "altitude")
ANGLES = AXES[:3]
INNER = {"roll": "MC_ROLLRATE", "pitch": "MC_PITCHRATE", "yaw": "MC_YAWRATE"}
SETTINGS = {
    "NAV_DLL_ACT": 0,
    "COM_RC_IN_MODE": 4,
    "COM_OF_LOSS_T": 5,
    "COM_DISARM_PRFLT": 60,
    "MIS_TAKEOFF_ALT": 8,
    "OC_RECORD": 1,
    "OC_AXES": 15,
}
# Read at the start only: the log begins at arming, with set-points and inputs at every tick.
EARLY = {"SDLOG_MODE": 0, "SDLOG_PROFILE": 17}
# Steps of the set-points (rad, m), and the time over which a response is judged (s).
STEP = {"roll": math.radians(10), "pitch": math.radians(10), "yaw": math.radians(20), "altitude": 0.5}
JUDGED_S = {"roll": 1.0, "pitch": 1.0, "yaw": 1.0, "altitude": 4.0}
STEPS = 4
STEP_S = 1.5
CLIMB_S = 5.0


# Message EVENT of MAVLink's common messages, which pymavlink does not know: number, time, sequence, receiver, log levels, arguments.
EVENT = 410
EVENT_HEAD = struct.Struct("<IIHBBB")
EVENT_BYTES = EVENT_HEAD.size + 40
EVENT_TYPES = {"uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I", "int32_t": "i", "float": "f"}
# Bytes of a MAVLink 2 frame before and after its payload, which ends before its last zeros.
HEAD, TAIL = 10, 2


class Station:
    """A ground station: hears PX4's events and translates them, as QGroundControl does, with the file that the firmware carries."""

    def __init__(self, build):
        groups = json.loads((build / "events/all_events.json").read_text())["components"]["1"]["event_groups"]
        events = [event for group in groups.values() for event in group["events"].items()]
        self.texts = {int(number): event for number, event in events if event["name"].startswith("onecycle")}
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 14550))
        self.socket.settimeout(0.2)
        self.pack = mavutil.mavlink.MAVLink(None, srcSystem=255)
        self.heard, self.last, self.vehicle, self.runs = [], None, None, True
        self.thread = threading.Thread(target=self.listen, daemon=True)
        self.thread.start()

    def listen(self):
        while self.runs:
            try:
                frames, self.vehicle = self.socket.recvfrom(65536)
            except TimeoutError:
                continue
            while len(frames) > HEAD and frames[0] == 0xFD:
                end = HEAD + frames[1]
                if int.from_bytes(frames[7:HEAD], "little") == EVENT:
                    self.hear(frames[HEAD:end].ljust(EVENT_BYTES, b"\0"))
                frames = frames[end + TAIL:]

    def send(self, message):
        if self.vehicle:
            self.socket.sendto(message.pack(self.pack), self.vehicle)

    def hear(self, payload):
        number, _, sequence, *_ = EVENT_HEAD.unpack_from(payload)
        event = self.texts.get(number & 0xFFFFFF)
        # An event that nobody confirmed in time comes again.
        if event is None or sequence == self.last:
            return
        self.last = sequence
        kinds = "<" + "".join(EVENT_TYPES[argument["type"]] for argument in event.get("arguments", []))
        values = struct.unpack_from(kinds, payload, EVENT_HEAD.size)

        def value(place):
            found = values[int(place[1]) - 1]
            return f"{found:.{place[2]}f}" if place[2] else str(found)

        self.heard.append(re.sub(r"\{(\d)(?::\.(\d))?\}", value, event["message"]))

    def close(self):
        self.runs = False
        self.thread.join(2)
        self.socket.close()


class Vehicle:
    """PX4 in a folder of its own, until `close`. Without `station` the ground station's port is free."""

    def __init__(self, build, folder, station=True):
        self.build, self.folder = pathlib.Path(build), pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        environment = dict(os.environ, PX4_SIM_MODEL="sihsim_quadx", PATH=f"{self.build}/bin:{os.environ['PATH']}")
        environment |= {f"PX4_PARAM_{name}": str(value) for name, value in EARLY.items()}
        self.output = open(self.folder / "out.log", "w")
        self.process = subprocess.Popen(
            [f"{self.build}/bin/px4", "-d", "-w", self.folder, f"{self.build}/etc"],
            cwd=self.folder, env=environment, stdout=self.output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )
        self.station = Station(self.build) if station else None
        self.wait(lambda: "Ready for takeoff" in self.said(), 90, "PX4 does not become ready")
        for name, value in SETTINGS.items():
            self.run("param", "set", name, value)

    def said(self):
        return (self.folder / "out.log").read_text(errors="replace")

    def messages(self):
        """What onecycle said in status texts."""
        return [line.split("onecycle: ", 1)[1].strip() for line in self.said().splitlines() if "] onecycle: " in line]

    def run(self, command, *arguments):
        result = subprocess.run(
            [f"{self.build}/bin/px4-{command}", *map(str, arguments)], cwd=self.folder, capture_output=True, text=True,
        )
        return result.stdout + result.stderr

    def parameter(self, name):
        for line in self.run("param", "show", name).splitlines():
            if f" {name} [" in line:
                return float(line.rsplit(":", 1)[1])
        return None

    def wait(self, is_so, most_s, otherwise):
        end = time.monotonic() + most_s
        while not is_so():
            if time.monotonic() > end or self.process.poll() is not None:
                raise RuntimeError(otherwise)
            time.sleep(0.2)

    def begin_module(self):
        """Puts onecycle_tune between the rate controller and the allocator."""
        self.run("mc_rate_control", "stop")
        time.sleep(0.3)
        self.run("onecycle_tune", "start")
        self.run("mc_rate_control", "start", "vtol")
        time.sleep(2)

    def hover(self):
        """Takes off, again if a simulated sensor falls silent on a busy machine: PX4 then lands."""
        for left in reversed(range(5)):
            self.run("commander", "takeoff")
            try:
                self.wait(lambda: self.height() > SETTINGS["MIS_TAKEOFF_ALT"] - 0.5, 30, "the vehicle does not take off")
                break
            except RuntimeError:
                if not left:
                    raise
        self.run("commander", "mode", "auto:loiter")
        time.sleep(5)

    def height(self):
        for line in self.run("listener", "vehicle_local_position", 1).splitlines():
            if line.split(":")[0].strip() == "z":
                return -float(line.split(":")[1])
        return 0.0

    def close(self):
        if self.station:
            self.station.close()
        self.run("shutdown")
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
        self.output.close()


def tune_with_onecycle(vehicle):
    vehicle.run("param", "set", "OC_APPLY", 2)
    vehicle.run("onecycle_tune", "run")
    began, said, times = time.monotonic(), len(vehicle.said()), {}

    def finished():
        for axis in AXES:
            if axis not in times and f"onecycle: {axis}: tuned" in vehicle.said()[said:]:
                times[axis] = round(time.monotonic() - began - sum(times.values()), 1)
        return "onecycle: finished" in vehicle.said()[said:]

    vehicle.wait(finished, 300, "onecycle does not finish")
    vehicle.run("onecycle_tune", "accept")
    return times


def tune_with_autotune(vehicle):
    before = {axis: vehicle.parameter(f"{INNER[axis]}_P") for axis in ANGLES}
    vehicle.run("param", "set", "MC_AT_APPLY", 2)
    vehicle.run("mc_autotune_attitude_control", "start")
    began = time.monotonic()
    vehicle.run("param", "set", "MC_AT_START", 1)

    def state():
        for line in vehicle.run("listener", "autotune_attitude_control_status", 1).splitlines():
            if " state:" in line:
                return int(line.split(":")[1].split()[0])
        return 0

    time.sleep(5)
    vehicle.wait(lambda: state() == 0, 150, "autotune does not finish")
    each_s = round((time.monotonic() - began) / len(ANGLES), 1)
    return {axis: each_s for axis in ANGLES if vehicle.parameter(f"{INNER[axis]}_P") != before[axis]}


def leave_alone(_):
    return {}


TUNERS = {"stock": leave_alone, "autotune": tune_with_autotune, "onecycle": tune_with_onecycle}


def offboard_link():
    """The link of an offboard computer."""
    link = mavutil.mavlink_connection("udpin:127.0.0.1:14540")
    link.wait_heartbeat(timeout=10)
    return link


def command_steps(vehicle):
    """Steps of each angle to either side and back, and of the height, in offboard mode."""
    link = offboard_link()
    thrust = 0.49

    def attitude(roll, pitch, yaw):
        half = [0.5 * angle for angle in (roll, pitch, yaw)]
        (a, b, c), (x, y, z) = map(math.cos, half), map(math.sin, half)
        return [a * b * c + x * y * z, x * b * c - a * y * z, a * y * c + x * b * z, a * b * z - x * y * c]

    def hold(angles, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            # The height is not controlled for these seconds.
            link.mav.set_attitude_target_send(0, 1, 1, 0b111, attitude(*angles), 0, 0, 0, thrust)
            time.sleep(0.02)

    hold((0, 0, 0), 0.6)
    vehicle.run("commander", "mode", "offboard")
    hold((0, 0, 0), 2.5)
    for index, axis in enumerate(ANGLES):
        for sign in (1, -1):
            angles = [0.0, 0.0, 0.0]
            angles[index] = sign * STEP[axis]
            hold(angles, STEP_S)
            hold((0, 0, 0), STEP_S)
    vehicle.run("commander", "mode", "auto:loiter")
    time.sleep(6)
    command_heights(vehicle, link)
    link.close()


def command_heights(vehicle, link):
    """Steps of the height up and down, twice, in offboard mode; then it hovers."""
    while link.recv_match(blocking=False):
        pass
    here = link.recv_match(type="LOCAL_POSITION_NED", blocking=True, timeout=5)
    if here is None:
        raise RuntimeError("PX4 sends no position")

    def hold(climbed, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            # The position counts, nothing else.
            link.mav.set_position_target_local_ned_send(0, 1, 1, 1, 0b110111111000, here.x, here.y, here.z - climbed, 0, 0, 0, 0, 0, 0, 0, 0)
            time.sleep(0.02)

    hold(0, 0.6)
    vehicle.run("commander", "mode", "offboard")
    hold(0, 3)
    for _ in range(2):
        hold(STEP["altitude"], CLIMB_S)
        hold(0, CLIMB_S)
    vehicle.run("commander", "mode", "auto:loiter")


def angles_of(data, prefix):
    w, x, y, z = (data[f"{prefix}[{k}]"] for k in range(4))
    roll = numpy.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = numpy.arcsin(numpy.clip(2 * (w * y - z * x), -1, 1))
    yaw = numpy.unwrap(numpy.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    return roll, pitch, yaw


def topic(log, name):
    return next(data.data for data in log.data_list if data.name == name)


def signals(log):
    """For each axis: set-point, output and input, each with its times (s)."""
    attitude, wanted = topic(log, "vehicle_attitude"), topic(log, "vehicle_attitude_setpoint")
    torque, thrust = topic(log, "vehicle_torque_setpoint"), topic(log, "vehicle_thrust_setpoint")
    position, place = topic(log, "vehicle_local_position"), topic(log, "vehicle_local_position_setpoint")
    seconds = lambda data: 1e-6 * data["timestamp"]
    angles, set_points = angles_of(attitude, "q"), angles_of(wanted, "q_d")
    for index, axis in enumerate(ANGLES):
        yield axis, (seconds(wanted), set_points[index]), (seconds(attitude), angles[index]), (seconds(torque), torque[f"xyz[{index}]"])
    yield "altitude", (seconds(place), -place["z"]), (seconds(position), -position["z"]), (seconds(thrust), -thrust["xyz[2]"])


def measure(path):
    """Rise (10 to 90 %), overshoot, ISE, and largest input of the steps of every axis; noise of the input before the first."""
    names = ["vehicle_attitude", "vehicle_torque_setpoint", "vehicle_thrust_setpoint", "vehicle_local_position"]
    log = ULog(str(path), names + ["vehicle_attitude_setpoint", "vehicle_local_position_setpoint"])
    result = {}
    for axis, (set_times, set_values), (times, values), (input_times, inputs) in signals(log):
        steps = []
        jumps = numpy.flatnonzero(abs(abs(numpy.diff(set_values)) - STEP[axis]) < 0.1 * STEP[axis]) + 1
        # The last ones are the commanded ones: a change of the mode before them may look like a step.
        jumps = jumps[-STEPS:]
        for before, jump, after in zip([0, *jumps[:-1]], jumps, [*jumps[1:], len(set_times) - 1]):
            start, size = set_times[jump], set_values[jump] - set_values[jump - 1]
            # On a slow machine the simulated time lags behind the clock by which the steps are sent.
            if min(start - set_times[before], set_times[after] - start) < JUDGED_S[axis]:
                continue
            inside = (times >= start) & (times < start + JUDGED_S[axis])
            if inside.sum() < 50:
                continue
            since, response = times[inside] - start, values[inside]
            response = (response - response[:3].mean()) / size
            rise = math.nan
            if response.max() >= 0.9:
                rise = since[numpy.argmax(response >= 0.9)] - since[numpy.argmax(response >= 0.1)]
            ise = numpy.sum((1 - response) ** 2 * numpy.gradient(since))
            moved = inputs[(input_times >= start) & (input_times < start + JUDGED_S[axis])]
            steps.append((rise, response.max() - 1, ise, abs(moved).max()))
        if steps:
            rise, overshoot, ise, largest = numpy.nanmean(numpy.array(steps, dtype=float), axis=0)
            first = set_times[jumps[0]]
            quiet = inputs[(input_times > first - 1.2) & (input_times < first - 0.1)]
            result[axis] = {
                "steps": len(steps), "rise_s": round(rise, 4), "overshoot": round(overshoot, 4), "ise_s": round(ise, 4),
                "largest_input": round(float(largest), 3), "input_noise": round(float(numpy.diff(quiet).std()), 4),
            }
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", help="PX4's build folder, with the module onecycle_tune in it")
    parser.add_argument("folder", help="new folder for this flight")
    parser.add_argument("tuner", choices=TUNERS)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter, before the flight")
    parser.add_argument("--hovering", action="append", default=[], metavar="NAME=VALUE", help="a parameter, in the hover")
    parser.add_argument("--no-steps", action="store_true", help="land after the tuning")
    parser.add_argument("--wait", type=float, default=0.0, help="seconds to wait in the hover, so that each flight has other noise")
    arguments = parser.parse_args()
    vehicle = Vehicle(arguments.build, arguments.folder)
    line = {"tuner": arguments.tuner, "folder": arguments.folder}
    try:
        for setting in arguments.set:
            vehicle.run("param", "set", *setting.split("="))
        if arguments.tuner == "onecycle":
            vehicle.begin_module()
        vehicle.hover()
        for setting in arguments.hovering:
            vehicle.run("param", "set", *setting.split("="))
        time.sleep(arguments.wait)
        line["tuned_s"] = TUNERS[arguments.tuner](vehicle)
        names = [f"{inner}_{gain}" for inner in INNER.values() for gain in "KPID"] + [f"MC_{axis.upper()}_P" for axis in ANGLES]
        names += ["MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC", "MC_YAW_TQ_CUTOFF"]
        line["gains"] = {name: vehicle.parameter(name) for name in names}
        time.sleep(2)
        if not arguments.no_steps:
            command_steps(vehicle)
        time.sleep(1)
    except RuntimeError as error:
        line["failed"] = str(error)
    finally:
        vehicle.close()
    logs = sorted(pathlib.Path(arguments.folder).glob("log/*/*.ulg"))
    if logs and not arguments.no_steps:
        line["steps"] = measure(logs[-1])
    line["messages"], line["events"] = vehicle.messages(), vehicle.station.heard
    print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
