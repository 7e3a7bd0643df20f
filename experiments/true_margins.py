"""Whether the limits of a designed controller hold on the true process.

Random multirotors under a simulated relay test with noise and bias: `onecycle identify` designs a controller from each
recording, `onecycle tune --against` judges it on the process that was simulated. Needs Python 3.9 and the program.

    python experiments/true_margins.py --onecycle target/release/onecycle --cases 120
"""

import argparse
import collections
import json
import random
import subprocess
import tempfile
from pathlib import Path

LIMITS = {"sharp": 2.0, "balanced": 1.6, "calm": 1.4}
# Numerical error of a limit.
ROUNDING = 1e-3


def run(program, *arguments):
    """Standard output of the program."""
    return subprocess.run([program, *arguments], capture_output=True, text=True).stdout


def case(program, folder, seed, style):
    """Larger of Ms and Mt on the truth; or a word: a verdict, `no controller`, `unstable`."""
    draw = random.Random(seed)
    t_prop, t_body = draw.uniform(0.015, 0.06), draw.uniform(0.3, 3.0)
    tau, noise, bias = draw.uniform(0.005, 0.04), draw.uniform(0.2, 3.0), draw.uniform(-50, 50)
    recording = folder / "recording.csv"
    run(
        program, "simulate", "--k", "1", "--t-prop", f"{t_prop:.5f}", "--t-body", f"{t_body:.4f}",
        "--tau", f"{tau:.5f}", "--noise", f"{noise:.2f}%", "--bias", f"{bias:.0f}%", "--duration", "6",
        "--seed", str(seed), "--out", str(recording),
    )
    report = json.loads(run(program, "identify", str(recording), "--style", style, "--json"))
    if report["verdict"]["kind"] != "identified":
        return report["verdict"]["kind"]
    controller = report["controller"]
    if controller is None:
        return "no controller"
    # The hold of the sampled controller delays by half a sample.
    delay = tau + 0.5 * report["assumed"]["sample_period_s"]
    process = f"soiptd,K=1,T_prop={t_prop:.5f},T_body={t_body:.4f},tau={delay:.6f}"
    gains = ",".join(repr(controller[key]) for key in ("kp", "ki", "kd", "filter_s"))
    judged = json.loads(run(program, "tune", "--process", process, f"--against={gains}", "--json"))["against"]
    if not judged["is_stable"]:
        return "unstable"
    return max(judged["margins"]["ms"], judged["margins"]["mt"])


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--onecycle", default="onecycle", help="the program")
    arguments.add_argument("--cases", type=int, default=120)
    arguments.add_argument("--seed", type=int, default=1000, help="seed of the first case")
    arguments.add_argument("--style", choices=LIMITS, default="balanced")
    chosen = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = [
            case(chosen.onecycle, Path(folder), chosen.seed + index, chosen.style)
            for index in range(chosen.cases)
        ]
    peaks = [peak for peak in found if not isinstance(peak, str)]
    others = collections.Counter(word for word in found if isinstance(word, str))
    kept = sum(peak <= LIMITS[chosen.style] * (1 + ROUNDING) for peak in peaks)
    designed = len(peaks) + others["unstable"]
    print(f"{chosen.style}: the limit of Ms and Mt holds on the truth for {kept} of {designed} controllers")
    print(f"largest: {max(peaks, default=float('nan')):.3f}; others: {dict(others)}")


if __name__ == "__main__":
    main()
