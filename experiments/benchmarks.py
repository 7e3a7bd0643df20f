"""Runs the commands of docs/benchmarks.md and of the tables in docs/benchmarks/, which are the list: nothing is named twice.

    cargo build --release && (cd research && cargo build --release)
    pip install scipy control                   # of other people, in the comparisons
    python experiments/benchmarks.py            # an hour on two cores
    python experiments/benchmarks.py d_test     # those that contain this text
    python experiments/benchmarks.py --quick    # seconds each: every command exists and starts
    python experiments/benchmarks.py --write heaters   # puts the tables that the commands print into docs/benchmarks/

A command is a code span or a block `sh` that begins with one of PROGRAMS. In a table headed by
`onecycle-lab campaign experiments/...` the span of the first cell stands for the rest of the command. The
output has the date, the revision, the machine and its load, the seed of each campaign, and the time of
each command; each table prints its own spread. With --write a Markdown table of the output replaces the next table with the same
head behind the command, in each page that has both.

Commands of cargo on the research run in its folder. With --quick campaigns and benchmarks have a few cases; tests are listed (at least
one must carry the name); benches and examples must be targets of their crate; scripts, recipes and options must exist. The status is 1
if a command fails.
"""

import argparse
import datetime
import functools
import json
import os
import pathlib
import platform
import re
import shlex
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESEARCH = ROOT / "research"
PROGRAMS = ("onecycle", "cargo", "python", "pip", "sh", "onboard/", "experiments/", "cli/tests/", "web/")
# The programs of this repository.
BUILT = ("onecycle", "onecycle-lab")
CAMPAIGNS = "onecycle-lab campaign experiments/..."
# Parts of commands that the full run leaves out, and why.
LEFT_OUT = {
    "--cases=1000000": "half an hour",
    "--cases=17829": "minutes, and shows one case only",
    "hundred_thousand": "hours in one thread",
    "--ignored": "minutes to hours; by hand",
    "killed.py": "ten minutes",
    "onecycle-lab train": "minutes to hours; by hand",
    "onecycle-lab reproduce": "some twenty minutes, and 75 for the paper's network; writes docs/benchmarks/reproduction.md",
    "any_peers.py": "needs SIPPY and Octave",
    "train_classifier.py": "needs PyTorch",
    "--method sippy": "needs SIPPY",
    "cargo install": "installs the program",
    "random_starts": "minutes; by hand",
    "overhead.py": "needs the Python package",
    "python_control": "needs python-control",
    "peers/Cargo.toml": "needs onnxruntime",
    "valgrind": "needs valgrind",
    "experiments/benchmarks.py": "this program",
    "ardupilot/altitude.py": "needs ArduPilot",
    "pip install": "installs packages",
    "py/test.sh": "a step of .ci/run",
    "web/test.sh": "a step of .ci/run",
    "run.sh": "a step of .ci/run",
    "callgrind.sh": "needs valgrind",
}
# Options that make a command small.
FEW = {"campaign": ["--cases", "1"], "bench make": ["--cases", "2"], "fly": ["--seeds", "1"]}
SMALLER = [(r"--check \d+", "--check 100"), (r"--deterioration \S+", "--deterioration 30%")]
# Too long for a quick run whatever the options: their files and options are looked up.
LOOKED_UP = ("train", "reproduce", "dataset")


def spans(text):
    """Commands of the page, in order, each once."""
    found = []
    for block in re.findall(r"```sh\n(.*?)```", text, re.S):
        joined = re.sub(r"\\\n\s*", "", block)
        found += [line for line in joined.splitlines() if line.strip()]
    text = re.sub(r"```.*?```", "", text, flags=re.S)
    prefix = None
    for line in text.splitlines():
        cells = re.findall(r"`([^`]+)`", line)
        if not line.startswith("|"):
            prefix = None
        elif line.startswith(f"| `{CAMPAIGNS}`"):
            prefix = CAMPAIGNS.removesuffix("...")
        elif prefix and re.match(r"\| `[^` ]+\.toml", line):
            found.append(prefix + cells[0])
        found += cells
    # A span may continue on the next line.
    found += [" ".join(span.split()) for span in re.findall(r"`([^`|]+\n[^`|]+)`", text)]
    commands = [re.sub(r"\s+#.*|;$", "", one).strip() for one in found]
    begins = PROGRAMS + ("for n in ",)
    shown = [one for one in commands if one.startswith(begins) and "..." not in one]
    # A program or a subcommand in a sentence is no command.
    named = ("onecycle identify", "onecycle fly")
    return [one for one in dict.fromkeys(shown) if " " in one and one not in named or one.endswith(".sh")]


@functools.cache
def targets():
    """Names of the targets of each crate."""
    found = {}
    for workspace in (ROOT, RESEARCH):
        made = subprocess.run(
            ["cargo", "metadata", "--no-deps", "--format-version", "1"],
            cwd=workspace, check=True, capture_output=True, text=True,
        )
        for package in json.loads(made.stdout)["packages"]:
            found[package["name"]] = {target["name"] for target in package["targets"]}
    return found


def workspace(words):
    """The folder in which a command of cargo runs."""
    return RESEARCH if "onecycle-lab" in words else ROOT


def missing(words):
    """What a command names that does not exist."""
    if "--manifest-path" in words:
        return [word for word in words if word.endswith("Cargo.toml") and not (ROOT / word).exists()]
    files = [word for word in words if "/" in word and re.search(r"\.(py|sh|toml|csv)$", word)]
    gone = [file for file in files if not (ROOT / file).exists()]
    if words[0] == "cargo" and "-p" in words:
        of = words[words.index("-p") + 1]
        known = targets().get(of, set())
        gone += [] if known else [of]
        for option in ("--test", "--bench", "--example"):
            if option in words and words[words.index(option) + 1] not in known:
                gone.append(f"{option} {words[words.index(option) + 1]}")
    return gone


def of_workspace(words):
    """The words of a command of cargo, for the workspace. A crate by itself is compiled with other features: every crate of the
    list would be compiled once more."""
    if words[0] != "cargo" or "-p" not in words or "--features" in words:
        return words
    at = words.index("-p")
    named = {"--test", "--lib", "--bench", "--doc", "--example"}.intersection(words)
    whole = [] if words[1] == "run" else ["--workspace"]
    return words[:at] + ([] if named else ["--tests"]) + whole + words[at + 2 :]


def quick(command, environment, scratch):
    """Why a command would not run; `None` if it does."""
    if command.startswith("for "):
        # A loop of the shell: its program and the files that are there before it.
        command = re.search(r"do (.*?);? *done", command)[1]
    words = shlex.split(command)
    if gone := missing(words):
        return "there is no " + ", ".join(gone)
    if words[:2] == ["cargo", "test"]:
        where = workspace(words)
        words = of_workspace([word for word in words if word not in ("--release", "--ignored", "--nocapture")])
        listed = [*words[:2], "--release", *words[2:], *([] if "--" in words else ["--"]), "--list"]
        made = subprocess.run(listed, cwd=where, capture_output=True, text=True)
        return None if re.search(r": test$", made.stdout, re.M) else "no test has this name"
    if words[0] not in BUILT:
        return None
    name = words[1]
    if name in LOOKED_UP:
        shown = subprocess.run(
            [words[0], name, "--help"], env=environment, capture_output=True, text=True
        ).stdout
        wrong = [word for word in words if word.startswith("--") and word not in shown]
        return f"no option {', '.join(wrong)}" if wrong else None
    for of, options in FEW.items():
        if " ".join(words[1:]).startswith(of):
            command = re.sub(f"{options[0]}[ =]\\d+", "", command) + " " + " ".join(options)
    # The answers of other programs are not there.
    command = re.sub(r"--answers \S+", "", command)
    for old, new in SMALLER:
        command = re.sub(old, new, command)
    made = subprocess.run(
        ["bash", "-c", command], cwd=scratch, env=environment, capture_output=True, text=True
    )
    return None if made.returncode == 0 else made.stderr.strip() or f"status {made.returncode}"


def head():
    """Date, revision and machine."""
    revision = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    cpu = platform.processor()
    if (info := pathlib.Path("/proc/cpuinfo")).exists():
        cpu = next((l.split(":")[1].strip() for l in info.open() if l.startswith("model name")), cpu)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    date = datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
    return f"{date}, revision {revision}\n{cpu}, {os.cpu_count()} cores, load {load}\n"


def seeds(command):
    """Seeds of the campaigns that a command runs."""
    files = [ROOT / word for word in shlex.split(command) if word.endswith(".toml")]
    texts = [file.read_text() for file in files if file.exists()]
    return re.findall(r"^seed = (\d+)", "\n".join(texts), re.M)


def pages():
    """The page of claims, and those of the tables but the one that `onecycle-lab reproduce` writes whole."""
    tables = sorted((ROOT / "docs" / "benchmarks").glob("*.md"))
    return [ROOT / "docs" / "benchmarks.md"] + [page for page in tables if page.name != "reproduction.md"]


def replaced(page, command, printed):
    """A page with the tables that a command has printed in place of those behind its mention."""
    # A span may be broken into lines, and a block `sh` continued.
    gap = r"[\s\\]+"
    mention = re.search(gap.join(map(re.escape, command.split())), page)
    at = mention.end() if mention else len(page)
    for table in re.findall(r"^(?:\|.*\n)+", printed + "\n", re.M):
        head = table.splitlines()[0]
        old = re.compile(rf"^{re.escape(head)}\n(?:\|.*\n)*", re.M).search(page, at)
        if old:
            page = page[: old.start()] + table + page[old.end() :]
            at = old.start() + len(table)
    return page


def full(command, environment, scratch, write):
    """Runs a command; false if it fails."""
    reason = next((why for part, why in LEFT_OUT.items() if part in command), None)
    named = command
    print(f"\n$ {command}", flush=True)
    if reason:
        print(f"left out: {reason}")
        return True
    if found := seeds(command):
        print(f"seed {', '.join(found)}", flush=True)
    where = scratch if command.startswith(("onecycle", "python", "for ")) else ROOT
    if command.startswith("cargo "):
        words = shlex.split(command)
        where, command = workspace(words), shlex.join(of_workspace(words))
    begin = time.perf_counter()
    printed = []
    with subprocess.Popen(
        ["bash", "-c", command], cwd=where, env=environment, stdout=subprocess.PIPE, text=True
    ) as running:
        for line in running.stdout:
            print(line, end="", flush=True)
            printed.append(line)
    status = running.returncode
    print(f"{time.perf_counter() - begin:.0f} s, status {status}", flush=True)
    for page in pages() if write and status == 0 else []:
        text = page.read_text()
        if (new := replaced(text, named, "".join(printed))) != text:
            page.write_text(new)
            print(f"new tables in {page.relative_to(ROOT)}")
    return status == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("containing", nargs="?", default="")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    programs = [target / "release" / name for name in BUILT]
    for program in programs:
        if not program.exists():
            sys.exit(f"there is no {program}: build it as README.md says")
    text = "\n".join(page.read_text() for page in pages())
    commands = [one for one in spans(text) if arguments.containing in one]
    if not commands:
        sys.exit(f"no page of the benchmarks has a command with '{arguments.containing}'")
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        scratch = pathlib.Path(folder)
        (scratch / "bin").mkdir()
        for program in programs:
            (scratch / "bin" / program.name).symlink_to(program)
        # A link would leave a virtual environment, and its packages, behind.
        python = scratch / "bin" / "python"
        python.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} "$@"\n')
        python.chmod(0o755)
        for name in ("autopilots", "experiments", "examples", "cli", "py", "research"):
            (scratch / name).symlink_to(ROOT / name)
        path = f"{scratch / 'bin'}{os.pathsep}{os.environ['PATH']}"
        environment = {**os.environ, "PATH": path}
        print(head(), end="")
        for command in commands:
            if arguments.quick:
                begin = time.perf_counter()
                problem = quick(command, environment, scratch)
                print(f"{problem or 'ok'}: {command} ({time.perf_counter() - begin:.1f} s)", flush=True)
                failures += [command] if problem else []
            elif not full(command, environment, scratch, arguments.write):
                failures.append(command)
    if failures:
        sys.exit(f"\n{len(failures)} of {len(commands)} commands failed:\n" + "\n".join(failures))
    print(f"\nall {len(commands)} commands ran")


if __name__ == "__main__":
    main()
