"""The parts of a test in a browser, side by side."""

import concurrent.futures
import os
import subprocess
import sys


def runs(parts):
    """Runs this program once more for each part, with `--only PART`, on all cores: a page computes in one thread. Prints
    what each says, in order; ends with status 1 at a part that fails."""
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        command = [sys.executable, *sys.argv, "--only"]
        all_runs = [pool.submit(subprocess.run, [*command, part], capture_output=True, text=True, check=False) for part in parts]
        for part, one in zip(parts, all_runs):
            done = one.result()
            print(done.stdout, end="", flush=True)
            if done.returncode != 0:
                pool.shutdown(cancel_futures=True)
                sys.exit(f"{part}: {done.stderr.strip()}")
