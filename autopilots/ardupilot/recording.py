"""The relay test of an axis from a log of the backend (message OCT), as a CSV file for `onecycle identify` and for tests.

    python recording.py LOG.BIN roll|pitch|yaw > roll.csv

From the relay's start to the end of the identification: time (s), motor input, measurement of the tuner (rad). Several tests of the
axis in one log: the last one.
"""

import sys

from sitl import read_log

AXES = ("roll", "pitch", "yaw")
RELAY, IDENTIFY = 3, 4  # phases of the tuner
PAUSE_S = 1.0


def recording(log, axis):
    """Rows of the last test of this axis: time (s), input, output (rad), estimated angle (rad)."""
    rows, last_s = [], None
    for row in read_log(log, "OCT")["OCT"]:
        if row["Ax"] != AXES.index(axis) or row["Ph"] not in (RELAY, IDENTIFY):
            continue
        if last_s is None or row["t"] - last_s > PAUSE_S:
            rows, first_s = [], row["t"]
        last_s = row["t"]
        rows.append((row["t"] - first_s, row["U"], row["Y"], row["E"]))
    return rows


def main():
    """Command line."""
    if len(sys.argv) != 3 or sys.argv[2] not in AXES:
        sys.exit("usage: python recording.py LOG.BIN roll|pitch|yaw")
    rows = recording(*sys.argv[1:])
    if not rows:
        sys.exit(f"recording: {sys.argv[1]} has no test of {sys.argv[2]}")
    print("time_s,input,output")
    for t, u, y, _ in rows:
        print(f"{t:.4f},{u:.6g},{y:.6g}")


if __name__ == "__main__":
    main()
