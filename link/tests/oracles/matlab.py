"""MAT-files of version 5 for the tests: SciPy (plain and compressed), and GNU Octave where it is installed.

    pip install scipy            (made with SciPy 1.17.1 and GNU Octave 7.3)
    python matlab.py ../data     writes the files and prints nothing
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.io import savemat

folder = Path(sys.argv[1])
rows = 400
t = 0.1 * np.arange(rows)
u = np.where(np.arange(rows) // 5 % 2 == 0, 1.5, -1.5)
y = np.sin(t).astype(np.float32)
y[7] = np.nan
table = {"t": t[:, None], "u": u[:, None], "y": y[:, None]}
more = {"note": "a text", "gain": 3.0, "A": np.eye(3), "cells": np.array([1, "x"], dtype=object)}
savemat(folder / "scipy_plain.mat", {**table, **more})
# In a row, as integers of several sizes, compressed.
counts = np.arange(rows)
wide = {"t": (100 * t).round().astype(np.int16), "u": (2 * u).astype(np.int8), "y": (1000 * np.cos(t)).round().astype(np.int64)}
savemat(folder / "scipy_rows.mat", {**wide, **more}, do_compression=True)
# Two loops as structures, and one time for both.
loops = {"LIC101": {"PV": y, "OP": u, "SP": 0 * t}, "TIC205": {"PV": 2 * y, "OP": u + counts, "SP": 0 * t + 1}}
savemat(folder / "scipy_loops.mat", {"time": t, **loops}, do_compression=True)
script = f"""
t = 0.1 * (0:{rows - 1})'; u = 1.5 * (1 - 2 * mod(floor((0:{rows - 1})' / 5), 2)); ydat = [sin(t) cos(t)];
data = struct('time', t, 'u', u, 'ydat', ydat);
cd {folder.resolve()}; save('-v7', 'octave_struct.mat', 'data');
"""
subprocess.run(["octave", "--quiet", "--eval", script], check=True)
