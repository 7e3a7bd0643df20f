"""ArduCopter in simulation (SITL): start, parameters, flight modes and waiting in simulated time.

A vehicle runs in its own folder on its own UDP port, so that several can fly side by side. Nothing leaves the machine.
"""

import argparse
import math
import os
import pathlib
import subprocess
import time

from pymavlink import DFReader, mavutil

STABILIZE, ALT_HOLD, GUIDED, LOITER, LAND, AUTOTUNE, SYSTEMID = 0, 2, 4, 5, 9, 15, 25
ACCEPTED = mavutil.mavlink.MAV_RESULT_ACCEPTED

# For a vehicle without a pilot: no radio, no ground station to lose, everything logged at the rate of the loop.
PARAMETERS = {
    "FS_THR_ENABLE": 0,
    "FS_GCS_ENABLE": 0,
    "LOG_DISARMED": 0,
    "LOG_BITMASK": 176127 | 1,
    "RC_OVERRIDE_TIME": -1,
    "SCHED_LOOP_RATE": 400,
    # Noise of the gyros in hover, about 1 deg/s per sample, as on a real vehicle; without it the simulator has 0.04.
    "SIM_GYR1_RND": 3,
    "SIM_GYR2_RND": 3,
}


def command_line(description, speedup=5, program=False, settings=False):
    """Parser of a script's command line, with the options that all scripts have; `program` and `settings` add one each."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--ardupilot", required=True, help="checkout of ArduPilot with build/sitl/bin/arducopter")
    parser.add_argument("--out", help="folder for logs and parameter files; default: a temporary one")
    parser.add_argument("--port", type=int, default=14650, help="UDP port of the vehicle [default: 14650]")
    parser.add_argument("--speedup", type=float, default=speedup, help=f"simulated seconds a second [default: {speedup}]")
    if program:
        parser.add_argument("--onecycle", default="onecycle", help="the program")
    if settings:
        parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="parameter before the test")
    return parser


class FlightError(Exception):
    """The vehicle did not do what the flight needs."""


class Vehicle:
    """One simulated copter. Use as a context manager: the simulation ends with it."""

    def __init__(self, ardupilot, folder, port=14650, speedup=5, parameters=None, lua=(), serial1=None):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.messages = []
        self.time_s = 0.0
        self.attitude = None
        self.position = None
        self.roll = 1500
        self.throttle = 1000
        self.is_armed = False
        self._said = 0
        defaults = self.folder / "extra.parm"
        wanted = {**PARAMETERS, **(parameters or {})}
        for script in lua:
            self.give(script)
            wanted.update(SCR_ENABLE=1, SCR_HEAP_SIZE=400000, SCR_VM_I_COUNT=1000000)
        defaults.write_text("".join(f"{name} {value}\n" for name, value in wanted.items()))
        ardupilot = pathlib.Path(ardupilot)
        self._out = open(self.folder / "out.log", "w")
        self.process = subprocess.Popen(
            [
                str(ardupilot / "build/sitl/bin/arducopter"),
                *("-w", "--model", "quad", "--speedup", str(speedup)),
                *("--home", "47.397742,8.545594,489.4,0"),
                *("--base-port", str(port + 100)),
                *("--defaults", f"{ardupilot}/Tools/autotest/default_params/copter.parm,{defaults.resolve()}"),
                *("--serial0", f"udpclient:127.0.0.1:{port}"),
                *(["--serial1", serial1] if serial1 else []),
            ],
            cwd=self.folder,
            stdout=self._out,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
        )
        os.environ["MAVLINK20"] = "1"
        self.link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255, dialect="all")

    def __enter__(self):
        try:
            self._connect()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Ends the simulation."""
        self.process.terminate()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.link.close()
        self._out.close()

    def _connect(self):
        if self.link.wait_heartbeat(timeout=60) is None:
            raise FlightError("the simulation gives no heartbeat within 60 s; see out.log")
        for stream, rate_hz in (("ATTITUDE", 50), ("LOCAL_POSITION_NED", 20), ("SYSTEM_TIME", 20)):
            number = getattr(mavutil.mavlink, "MAVLINK_MSG_ID_" + stream)
            self.command(mavutil.mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / rate_hz)

    def give(self, file, name=None):
        """Copies a file into the vehicle's folder of scripts."""
        scripts = self.folder / "scripts"
        scripts.mkdir(exist_ok=True)
        (scripts / (name or pathlib.Path(file).name)).write_bytes(pathlib.Path(file).read_bytes())

    # Messages and time

    def poll(self, timeout_s=1.0):
        """Takes in one message, and sends the radio's sticks and the heartbeat of a ground station every 0.2 s."""
        now = time.monotonic()
        if now - self._said > 0.2:
            self._said = now
            self.link.mav.heartbeat_send(6, 8, 0, 0, 0)
            self.link.mav.rc_channels_override_send(
                self.link.target_system, 1, self.roll, 1500, self.throttle, 1500, *[0] * 4)
        message = self.link.recv_match(blocking=True, timeout=timeout_s)
        if message is None:
            if self.process.poll() is not None:
                raise FlightError("the simulation has ended; see out.log")
            return None
        kind = message.get_type()
        if kind == "STATUSTEXT":
            self._take_text(message)
        elif kind == "ATTITUDE":
            self.attitude, self.time_s = message, 1e-3 * message.time_boot_ms
        elif kind == "LOCAL_POSITION_NED":
            self.position = message
        elif kind == "HEARTBEAT" and message.get_srcComponent() == 1:
            self.is_armed = bool(message.base_mode & mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        return message

    def _take_text(self, message):
        """A text, or the next 50 characters of a long one."""
        if message.id != 0 and message.chunk_seq > 0 and self.messages:
            at_s, text = self.messages.pop()
            self.messages.append((at_s, text + message.text))
        else:
            self.messages.append((self.time_s, message.text))

    def move_stick(self, roll):
        """Moves the stick of roll, at once (1000 to 2000, middle 1500)."""
        self.roll, self._said = roll, 0
        self.poll()

    def wait(self, condition, limit_s, what):
        """Takes in messages until the condition holds, for at most limit_s of simulated time."""
        since, began = self.time_s, time.monotonic()
        while not condition():
            self.poll()
            if self.time_s - since > limit_s or time.monotonic() - began > 60 + 3 * limit_s:
                raise FlightError(f"{what}: not within {limit_s:.0f} s; last messages: {self.last_messages()}")

    def sleep(self, duration_s, each=None):
        """Lets simulated time pass; calls each() at every message."""
        until = self.time_s + duration_s
        began = time.monotonic()
        while self.time_s < until:
            self.poll()
            if each is not None:
                each()
            if time.monotonic() - began > 60 + 10 * duration_s:
                raise FlightError(f"simulated time stands still; see {self.folder / 'out.log'}")

    def last_messages(self, count=3):
        """The last texts of the vehicle."""
        return " | ".join(text for _, text in self.messages[-count:]) or "none"

    def said(self, words, after_s=0.0):
        """Texts of the vehicle with these words since a time."""
        return [(at_s, text) for at_s, text in self.messages if words in text and at_s >= after_s]

    # Commands

    def command(self, number, *arguments):
        """Sends a command and waits for its answer; returns whether it was accepted."""
        for _ in range(5):
            self.link.mav.command_long_send(
                self.link.target_system, 1, number, 0, *arguments, *[0] * (7 - len(arguments)))
            until = time.monotonic() + 2.0
            while time.monotonic() < until:
                message = self.poll(0.2)
                if message is not None and message.get_type() == "COMMAND_ACK" and message.command == number:
                    return message.result == ACCEPTED
        return False

    def get(self, name):
        """Value of a parameter; raises if the firmware does not have it."""
        for _ in range(5):
            self.link.mav.param_request_read_send(self.link.target_system, 1, name.encode(), -1)
            until = time.monotonic() + 1.0
            while time.monotonic() < until:
                message = self.poll(0.2)
                if message is not None and message.get_type() == "PARAM_VALUE" and message.param_id == name:
                    return message.param_value
        raise FlightError(f"the firmware has no parameter {name}")

    def send(self, name, value):
        """Writes a parameter without reading it back."""
        self.link.mav.param_set_send(self.link.target_system, 1, name.encode(), value, 9)

    def set(self, name, value):
        """Writes a parameter and reads it back."""
        old = self.get(name)
        for _ in range(5):
            self.send(name, value)
            if math.isclose(self.get(name), value, rel_tol=1e-5, abs_tol=1e-9):
                return old
        raise FlightError(f"{name} does not take {value}")

    def load(self, file):
        """Writes a parameter file (NAME,VALUE lines); on a failure the old values are in force again. Returns them."""
        old = {}
        try:
            for line in pathlib.Path(file).read_text().splitlines():
                line = line.split("#")[0].strip()
                if line:
                    name, value = line.replace(",", " ").split()[:2]
                    old[name] = self.set(name, float(value))
        except FlightError:
            for name, value in old.items():
                self.set(name, value)
            raise
        return old

    def mode(self, number):
        """Changes the flight mode."""
        if not self.command(mavutil.mavlink.MAV_CMD_DO_SET_MODE, 1, number):
            raise FlightError(f"mode {number} is refused; last messages: {self.last_messages()}")

    def switch(self, function, position):
        """Moves the switch of an auxiliary function: 0 low, 1 middle, 2 high."""
        if not self.command(mavutil.mavlink.MAV_CMD_DO_AUX_FUNCTION, function, position):
            raise FlightError(f"the firmware does not take auxiliary function {function}")

    # Flight

    def height_m(self):
        """Height above the start."""
        return -self.position.z if self.position is not None else 0.0

    def take_off(self, height_m=20.0):
        """Arms in GUIDED, once the position is estimated, and climbs."""
        began_s = self.time_s
        while not (self.command(mavutil.mavlink.MAV_CMD_DO_SET_MODE, 1, GUIDED)
                   and self.command(mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)):
            self.sleep(1.0)
            if self.time_s - began_s > 180.0:
                raise FlightError(f"does not arm in GUIDED: {self.last_messages()}")
        self.throttle = 1500
        if not self.command(mavutil.mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m):
            raise FlightError(f"does not take off: {self.last_messages()}")
        self.wait(lambda: self.height_m() > height_m - 0.5, 60, "climb")
        self.sleep(5.0)

    def disarm(self):
        """Ends the flight in the air and with it the log."""
        self.command(mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196)
        self.sleep(1.0)

    def hold_attitude(self, roll_rad=0.0, pitch_rad=0.0, yaw_rad=None):
        """Commands an attitude in GUIDED with the height held."""
        yaw_rad = self.attitude.yaw if yaw_rad is None else yaw_rad
        half = [0.5 * angle for angle in (roll_rad, pitch_rad, yaw_rad)]
        (cr, sr), (cp, sp), (cy, sy) = [(math.cos(angle), math.sin(angle)) for angle in half]
        quaternion = [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
        self.link.mav.set_attitude_target_send(
            int(1e3 * self.time_s), self.link.target_system, 1, 7, quaternion, 0, 0, 0, 0.5)

    def go(self, north_m, east_m, height_m):
        """Flies to a place in GUIDED (m from the origin)."""
        self.link.mav.set_position_target_local_ned_send(
            int(1e3 * self.time_s), self.link.target_system, 1, 1, 0b110111111000, north_m, east_m, -height_m, *[0] * 8)

    def log(self):
        """The newest log of the vehicle's card."""
        logs = sorted((self.folder / "logs").glob("*.BIN"))
        if not logs:
            raise FlightError("the vehicle has written no log")
        return logs[-1]


def read_log(path, *kinds):
    """Messages of these kinds in a DataFlash log, as lists of dictionaries by kind; times in seconds as `t`."""
    reader = DFReader.DFReader_binary(str(path))
    found = {kind: [] for kind in kinds}
    while (message := reader.recv_match(type=list(kinds))) is not None:
        values = message.to_dict()
        values["t"] = 1e-6 * values.get("TimeUS", 0)
        found[message.get_type()].append(values)
    return found
