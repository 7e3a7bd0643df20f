"""Tunes vehicle models of other simulators with the tuner for firmware in the loop: run.py ARCHIVE [--rotorpy]"""

import sys
import tempfile

import f450
from mission import report
from tuner import Interface


def main():
    archive, *options = sys.argv[1:]
    with tempfile.TemporaryDirectory() as scratch:
        interface = Interface(archive, scratch)
        is_right = report("JSBSim F450", f450.F450(), f450.AXES, interface)
        if "--rotorpy" in options:
            import quadrotor

            for title, vehicle, axes in quadrotor.VEHICLES:
                is_right = report(title, vehicle(), axes, interface) and is_right
    return 0 if is_right else 1


if __name__ == "__main__":
    sys.exit(main())
