"""Flies `onecycle live` against a simulated vehicle, PX4 (SIH) or ArduCopter (SITL): state, parameters written and read back, a
missing parameter, an armed vehicle, a signed link (ArduPilot), the relay test of the altitude, the log of the flight, and steps of the
height with the gains of the test (PX4; those of ArduCopter are flown by ardupilot/altitude.py). Prints a line of JSON for each case and
fails if one is not as it must be.

The relay test may be refused: the line says why. Run it by run.sh of px4 and ardupilot; PX4 needs a network of its own.
"""

import argparse
import hashlib
import json
import pathlib
import subprocess
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
PASSPHRASE = "hangar"
# Parameters, with a value to write; their names are those of `onecycle identify --write`.
GAINS = {"px4": {"MC_ROLLRATE_P": 0.12, "MC_ROLLRATE_I": 0.25}, "ardupilot": {"ATC_RAT_RLL_P": 0.12, "ATC_RAT_RLL_I": 0.12}}
MISSING = {"px4": "MC_ROLLRATE_X", "ardupilot": "ATC_RAT_RLL_X"}


class Px4:
    """PX4's own simulator; the ground station's port is free for onecycle."""

    connection = "udp:14550"
    ending = "params"

    def __init__(self, build, folder):
        sys.path.insert(0, str(HERE / "px4"))
        import fly

        self.fly = fly
        self.vehicle = fly.Vehicle(build, folder, station=False)
        self.parameter = self.vehicle.parameter

    def wait_for(self, process):
        return process.communicate()[0]

    def hover(self):
        self.vehicle.hover()

    def land(self):
        self.vehicle.run("commander", "land")
        self.vehicle.wait(lambda: "Disarmed" in self.vehicle.run("commander", "status"), 90, "the vehicle does not land")
        time.sleep(2)  # the log of the flight is closed

    def step(self):
        """Takes off, commands steps of the height, lands. Returns their figures."""
        self.hover()
        link = self.fly.offboard_link()
        self.fly.command_heights(self.vehicle, link)
        link.close()
        self.land()
        return self.fly.measure(max(self.vehicle.folder.glob("log/*/*.ulg")))["altitude"]

    def close(self):
        self.vehicle.close()


class ArduPilot:
    """ArduCopter; its second link is onecycle's. The first one is pymavlink's, which must be read all the time."""

    connection = "udp:14660"
    ending = "param"

    def __init__(self, source, folder):
        sys.path.insert(0, str(HERE / "ardupilot"))
        import sitl

        self.sitl = sitl
        self.vehicle = sitl.Vehicle(source, folder, speedup=1, serial1="udpclient:127.0.0.1:14660")
        self.vehicle.__enter__()
        self.parameter = self.vehicle.get

    def wait_for(self, process):
        said = []
        reader = threading.Thread(target=lambda: said.append(process.communicate()[0]))
        reader.start()
        while reader.is_alive():
            self.vehicle.poll(0.1)
        return said[0]

    def hover(self):
        self.vehicle.take_off(15.0)

    def land(self):
        self.vehicle.mode(self.sitl.LAND)
        self.vehicle.wait(lambda: self.vehicle.height_m() < 0.3, 120, "landing")
        self.vehicle.disarm()

    def sign(self):
        """Gives the vehicle the key, as Mission Planner does."""
        key = hashlib.sha256(PASSPHRASE.encode()).digest()
        link = self.vehicle.link
        link.mav.setup_signing_send(link.target_system, 1, key, int((time.time() - 1420070400) * 1e5))
        link.setup_signing(key, sign_outgoing=True, allow_unsigned_callback=lambda *_: True)
        self.vehicle.sleep(2.0)

    def close(self):
        self.vehicle.close()


class Trial:
    """Runs the program and compares its exit code."""

    def __init__(self, program, firmware, vehicle, folder):
        self.program, self.firmware, self.vehicle, self.folder = program, firmware, vehicle, pathlib.Path(folder)
        self.is_right = True

    def run(self, case, arguments, codes=(0,), key=None):
        action, *others = arguments
        signed = ["--key", str(key)] if key else []
        process = subprocess.Popen(
            [self.program, "live", action, self.vehicle.connection, "--wait", "30", *signed, *map(str, others)],
            cwd=self.folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )
        said = self.vehicle.wait_for(process)
        self.tell(case, process.returncode in codes, exit=process.returncode, said=said[-1500:])
        return said

    def tell(self, case, is_right, **facts):
        self.is_right &= is_right
        print(json.dumps({"firmware": self.firmware, "case": case, "right": is_right, **facts}), flush=True)

    def file(self, name, values):
        lines = [f"1\t1\t{key}\t{value}\t9" if self.firmware == "px4" else f"{key},{value}" for key, value in values.items()]
        path = self.folder / f"{name}.{self.vehicle.ending}"
        path.write_text("\n".join(lines) + "\n")
        return path

    def values(self, case, wanted):
        found = {name: self.vehicle.parameter(name) for name in wanted}
        self.tell(case, all(abs(found[name] - value) < 1e-6 for name, value in wanted.items()), found=found)

    def ground(self):
        gains = GAINS[self.firmware]
        old = {name: self.vehicle.parameter(name) for name in gains}
        self.run("state", ["state"])
        new = self.file("new", gains)
        self.run("write", ["write", new])
        self.values("written", gains)
        self.run("missing parameter", ["write", self.file("missing", {**old, MISSING[self.firmware]: 1.0})], codes=(4,))
        self.values("unchanged", gains)
        self.run("old values", ["write", self.folder / f"new.old.{self.vehicle.ending}"])
        self.values("restored", old)

    def flight(self):
        self.vehicle.hover()
        self.run("armed", ["write", self.file("armed", GAINS[self.firmware])], codes=(4,))
        amplitudes = ("10%", "20%")
        for number, amplitude in enumerate(amplitudes):
            recording = self.folder / f"altitude{number}.csv"
            relay = ["relay", "--axis", "altitude", "-o", recording, "--amplitude", amplitude]
            if self.firmware == "px4":
                time.sleep(10)  # until it hovers again
                # A test of ten cycles does not resolve the slow lag.
                relay += ["--band", "3", "--below-limits", "--write", self.folder / f"altitude{number}.params"]
                relay += ["--", "--structure", "double_integrator_lag", "--style", "calm"]
            # 4: the test ended early, or no process was identified.
            self.run(f"relay {amplitude}", relay, codes=(0, 4))
        self.vehicle.land()
        log = self.folder / "flight.log"
        self.run("log", ["log", "-o", log])
        self.tell("log file", log.exists() and log.stat().st_size > 100_000, bytes=log.stat().st_size if log.exists() else 0)

    def gains_of_the_test(self):
        """Steps of the height with the old gains and with those that a relay test wrote."""
        files = sorted(self.folder.glob("altitude?.params"))
        self.tell("gains of a relay test", bool(files), files=[file.name for file in files])
        if not files:
            return
        before = self.vehicle.step()
        self.run("write the gains of the test", ["write", files[-1]])
        after = self.vehicle.step()
        # Noise of the estimated height alone changes the figures of a flight by a third.
        is_right = after["steps"] > 1 and bool(after["ise_s"] < 1.5 * before["ise_s"])
        self.tell("steps of the height", is_right, before=before, after=after)

    def signing(self):
        key, other = self.folder / "key.txt", self.folder / "other.txt"
        key.write_text(PASSPHRASE + "\n")
        other.write_text("another\n")
        self.run("key before the vehicle has one", ["state"], codes=(3,), key=key)
        self.vehicle.sign()
        self.run("signed", ["state"], key=key)
        self.run("another key", ["state"], codes=(3,), key=other)
        self.run("no key", ["state"], codes=(3,))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("firmware", choices=["px4", "ardupilot"])
    parser.add_argument("place", help="PX4's build folder, or ArduPilot's source folder")
    parser.add_argument("folder", help="new folder for this flight")
    parser.add_argument("--onecycle", default="onecycle", help="the program")
    arguments = parser.parse_args()
    folder = pathlib.Path(arguments.folder)
    folder.mkdir(parents=True, exist_ok=True)
    make = Px4 if arguments.firmware == "px4" else ArduPilot
    vehicle = make(arguments.place, folder)
    trial = Trial(arguments.onecycle, arguments.firmware, vehicle, folder)
    try:
        trial.ground()
        trial.flight()
        if arguments.firmware == "px4":
            trial.gains_of_the_test()
        else:
            trial.signing()
    finally:
        vehicle.close()
    sys.exit(0 if trial.is_right else 1)


if __name__ == "__main__":
    main()
