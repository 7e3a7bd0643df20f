"""Kills the long commands of onecycle-lab at random moments until they end: `python3 experiments/killed.py [--times N] [NAME ...]`.

Each command runs once in peace. Then it is started again and again in the same folder, and killed (SIGKILL) after a random part of
the time that is left, until it has been killed N times [default: 20]; a run that ends first starts over. Afterwards, and whenever a run has
ended, its results have to equal those in peace to the byte, times of computation aside, and nothing else may be left in the folder. No
result may exist before a run ends. Then the same command meets a full disk. `onecycle-lab` is the one on the PATH.
"""

import argparse
import json
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
CAMPAIGN = 'measure = "relay"\ncases = 2000\nseed = 1\nbias = 0.3\nsigma = 0.01\ntrim = true\n'


def grid(folder):
    return ["grid", "-o", "grid.json"], ["grid.json"]


def campaign(folder):
    (folder / "campaign.toml").write_text(CAMPAIGN)
    return ["campaign", "campaign.toml", "-o", "table.txt"], ["table.txt"]


def train(folder):
    recipe = ROOT / "research/program/reproduction/paper_network_small.toml"
    return ["train", "--recipe", str(recipe), "-o", "network.onnx", "--json", "scores.json"], ["network.onnx", "scores.json"]


def bench(folder):
    if not (folder / "bench").exists():
        run(["bench", "make", "--out", "bench", "--cases", "40", "--seed", "5"], folder).check_returncode()
    methods = ["--methods", "onecycle-1,onecycle-2,network,rules"]
    return ["bench", "run", "bench", *methods, "-o", "results"], ["results.csv", "results.json", "results.md"]


def reproduce(folder):
    return ["reproduce", "phase", "grid", "--quick", "-o", "out"], ["out/reproduction.html", "out/reproduction.md"]


COMMANDS = {one.__name__: one for one in (grid, campaign, train, bench, reproduce)}


class Wrong(Exception):
    """A command that lost work, left a half-written file or gave other results."""


def run(arguments, folder):
    return subprocess.run(["onecycle-lab", *arguments], cwd=folder, capture_output=True, text=True, check=False)


def results(folder, names):
    """The contents of the results, without times of computation."""
    return {name: timeless(name, (folder / name).read_bytes()) for name in names}


def timeless(name, content):
    if name.endswith(".json"):
        return json.dumps(without_seconds(json.loads(content)))
    if name.endswith(".csv"):
        rows = [line.split(",") for line in content.decode().splitlines()]
        kept = [at for at, title in enumerate(rows[0]) if "seconds" not in title]
        return "\n".join(",".join(row[at] for at in kept) for row in rows)
    if name == "results.md":
        # The last column is the time of a method.
        return re.sub(rb"\|[^|]*\|$", b"|", content, flags=re.MULTILINE)
    if name.endswith((".md", ".html")):
        return re.sub(rb"[0-9.]+ (ns|us|ms|s|min|h)\b", b"", content)
    return content


def without_seconds(value):
    if isinstance(value, dict):
        return {key: without_seconds(one) for key, one in value.items() if "seconds" not in key and "_us" not in key}
    return [without_seconds(one) for one in value] if isinstance(value, list) else value


def killed(name, times, chance):
    """Kills a command; returns how often it was killed, how often it ended, and its time in peace."""
    with tempfile.TemporaryDirectory() as peace, tempfile.TemporaryDirectory() as war:
        peace, war = pathlib.Path(peace), pathlib.Path(war)
        arguments, made = COMMANDS[name](peace)
        begin = time.monotonic()
        run(arguments, peace).check_returncode()
        took_s = time.monotonic() - begin
        expected = results(peace, made)
        arguments, _ = COMMANDS[name](war)
        before = {path.name for path in war.iterdir()}
        kills = ends = 0
        while kills < times or ends == 0:
            process = subprocess.Popen(["onecycle-lab", *arguments], cwd=war, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
            try:
                # Without kills to come it may end.
                said = process.communicate(timeout=None if kills >= times else chance.uniform(0, took_s))[1]
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.communicate()
                kills += 1
                whole = [one for one in made if (war / one).exists()]
                for one in whole:
                    if timeless(one, (war / one).read_bytes()) != expected[one]:
                        raise Wrong(f"{name}: {one} is there, half-written, after kill {kills}")
                continue
            if process.returncode != 0:
                raise Wrong(f"{name}: status {process.returncode} after {kills} kills: {said.decode()[-500:]}")
            ends += 1
            if results(war, made) != expected:
                raise Wrong(f"{name}: other results after {kills} kills")
            left = {path.name for path in war.iterdir()} - before - {pathlib.Path(one).parts[0] for one in made}
            if left:
                raise Wrong(f"{name}: {left} is left behind")
            for one in {war / pathlib.Path(one).parts[0] for one in made}:
                shutil.rmtree(one) if one.is_dir() else one.unlink()
        return kills, ends, took_s


def full_disk(name):
    """What a command says on a disk without room: its folder takes files of a kilobyte at most."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        arguments, made = COMMANDS[name](folder)
        limit = "ulimit -f 1; trap '' XFSZ; exec onecycle-lab \"$@\""
        done = subprocess.run(["bash", "-c", limit, "bash", *arguments], cwd=folder, capture_output=True, text=True, check=False)
        said = done.stderr.strip().splitlines()[-1:]
        if done.returncode <= 0 or not said or "panicked" in done.stderr:
            raise Wrong(f"{name} on a full disk: status {done.returncode}: {done.stderr[-500:]}")
        half = [one for one in made if (folder / one).exists()]
        if half:
            raise Wrong(f"{name} on a full disk leaves {half}")
        return said[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", choices=[*COMMANDS, []], metavar="NAME", help=f"of {', '.join(COMMANDS)} [default: all]")
    parser.add_argument("--times", type=int, default=20, metavar="N")
    parser.add_argument("--seed", type=int, default=1)
    told = parser.parse_args()
    for name in told.names or COMMANDS:
        kills, ends, took_s = killed(name, told.times, random.Random(told.seed))
        print(f"{name}: killed {kills} times, ended {ends} times with the bits of a run in peace ({took_s:.1f} s)", flush=True)
        print(f"    full disk: {full_disk(name)}", flush=True)


if __name__ == "__main__":
    try:
        main()
    except Wrong as wrong:
        sys.exit(f"fault: {wrong}")
