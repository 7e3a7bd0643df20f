#!/usr/bin/env python3
"""What does not change a process must not change the answer. No truth is needed.

    python experiments/continuity.py PATH/TO/onecycle [RECORDING.csv...]

Each recording (default: examples/*.csv) is identified as it is and changed: 1 % cut from either end, seven rows later, in other
units, both signs turned, every second row, and 5 % of rest appended where it ends at rest. An answer stays if the verdict does
and the 90 % interval of the gain (K/T_body, else K) overlaps that of the unchanged recording. Prints a row for each change, and
the recordings whose answer a change moved.
"""

import argparse
import collections
import csv
import glob
import json
import os
import random
import subprocess
import tempfile


def identified(program, path):
    done = subprocess.run([program, "identify", path, "--json"], capture_output=True, text=True)
    return json.loads(done.stdout) if done.stdout else None


def rows_of(program, path):
    """Rows of time, input and output. None unless all are numbers."""
    found = identified(program, path)
    if not found:
        return None
    columns = [found["columns"][kind] for kind in ("time", "input", "output")]
    with open(path, newline="") as file:
        lines = [line for line in file if not line.startswith("#")]
    table = csv.DictReader(lines)
    # The program takes the unit out of a header such as time_s.
    named = {header.removesuffix(f"_{column['unit']}"): header for header in table.fieldnames or [] for column in columns}
    try:
        headers = [column["name"] if column["name"] in table.fieldnames else named[column["name"]] for column in columns]
        return [[float(row[header]) for header in headers] for row in table]
    except (KeyError, TypeError, ValueError):
        return None


def changes(rows):
    """Name, factor of the gain, and rows of each change."""
    cut = max(3, len(rows) // 100)
    yield "start cut", 1, rows[cut:]
    yield "end cut", 1, rows[:-cut]
    yield "seven rows later", 1, rows[7:]
    yield "other units", 1000 / 7, [[t, 7 * u + 3, 1000 * y - 5] for t, u, y in rows]
    yield "both signs turned", 1, [[t, -u, -y] for t, u, y in rows]
    if len(rows) > 1500:
        yield "every second row", 1, rows[::2]
    end = rows[-max(5, len(rows) // 20):]
    spread = [max(column) - min(column) for column in zip(*end)]
    whole = max(row[2] for row in rows) - min(row[2] for row in rows)
    if spread[1] == 0 and spread[2] < 0.02 * whole:
        chance = random.Random(1)
        step = rows[-1][0] - rows[-2][0]
        rest = [[rows[-1][0] + step * k, end[-1][1], chance.choice(end)[2]] for k in range(1, len(end) + 1)]
        yield "rest appended", 1, rows + rest


def gain(found):
    """Name and interval of the gain. None if no process was identified."""
    process = found and found["verdict"]["kind"] == "identified" and found["process"]
    for name in ("k_over_t_body", "k"):
        value = process and process.get(name)
        if value and value["estimate"] is not None:
            ends = [value[end] if value[end] is not None else value["estimate"] for end in ("low", "high")]
            return name, ends
    return None


def moved(before, after, factor):
    """What a change moved, in words. None for nothing."""
    if (before is None) != (after is None):
        return "verdict"
    if before is None:
        return None
    if before[0] != after[0]:
        return "structure"
    low, high = before[1]
    again = sorted(end / factor for end in after[1])
    return None if again[0] <= high and again[1] >= low else "gain"


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("program")
    options.add_argument("recordings", nargs="*", default=sorted(glob.glob("examples/*.csv")))
    arguments = options.parse_args()
    tried, kept, moves = collections.Counter(), collections.Counter(), []
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "changed.csv")

        def answer(rows):
            with open(path, "w") as file:
                file.write("time_s,input,output\n")
                file.writelines(f"{t:.10g},{u:.10g},{y:.10g}\n" for t, u, y in rows)
            return gain(identified(arguments.program, path))

        for recording in arguments.recordings:
            rows = rows_of(arguments.program, recording)
            if rows is None:
                continue
            before = answer(rows)
            for name, factor, changed in changes(rows):
                what = moved(before, answer(changed), factor)
                tried[name] += 1
                kept[name] += what is None
                if what:
                    moves.append(f"{os.path.basename(recording)}: {name} moved the {what}")
    print("| change | recordings | answer stays |\n| --- | --- | --- |")
    for name in tried:
        print(f"| {name} | {tried[name]} | {kept[name]} |")
    print(f"| all | {sum(tried.values())} | {sum(kept.values())} |")
    print("\n".join(["", *moves]))


if __name__ == "__main__":
    main()
