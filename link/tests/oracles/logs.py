"""Counts and sums of chosen signals of the logs in examples/logs, by other programs.

    pip install pyulog==1.3.0 pymavlink==2.4.50 numpy
    pip install orangebox==0.5.0    # its entry point is malformed: pip complains after the module is in place
    python link/tests/oracles/logs.py > link/tests/oracles/logs.txt

Rows: file, flight, topic, column, rows, sum, least, greatest, first, last. `sum` leaves out what is not finite.
"""

import math
import pathlib
import sys
from importlib.metadata import version

import numpy as np
from orangebox import Parser
from pymavlink import DFReader
from pyulog import ULog

LOGS = pathlib.Path(__file__).parents[3] / "examples" / "logs"
DATAFLASH = {"RATE", "SIDD", "SIDS", "EV", "PARM"}


def row(file, flight, topic, column, values):
    values = np.asarray(values, dtype=np.float64)
    finite = values[np.isfinite(values)]
    numbers = [math.fsum(finite), finite.min(), finite.max(), values[0], values[-1]]
    print(file.name, flight, topic, column, len(values), *(repr(float(n)) for n in numbers))


def ulog(file):
    for topic in ULog(str(file)).data_list:
        for column, values in topic.data.items():
            if topic.multi_id == 0 and "_padding" not in column and np.isfinite(values).any():
                row(file, 1, topic.name, column, values)


def dataflash(file):
    log, topics = DFReader.DFReader_binary(str(file)), {}
    while (message := log.recv_msg()) is not None:
        if message.get_type() in DATAFLASH:
            topics.setdefault(message.get_type(), []).append(message.to_dict())
    for topic, rows in topics.items():
        for column, value in rows[0].items():
            if isinstance(value, (int, float)):
                row(file, 1, topic, column, [r[column] for r in rows])


def blackbox(file):
    log = Parser.load(str(file))
    frames = [frame.data for frame in log.frames()]
    for at, column in enumerate(log.field_names):
        if not column.startswith("GPS") and at < 42:
            row(file, 1, "main", column, [frame[at] for frame in frames])


print("#", *(f"{name} {version(name)}" for name in ("pyulog", "pymavlink", "orangebox")))
for path in sorted(LOGS.iterdir()):
    print(path, file=sys.stderr)
    if path.suffix == ".ulg":
        ulog(path)
    elif path.suffix == ".bin":
        dataflash(path)
    elif path.name == "betaflight_acro.bfl":
        blackbox(path)
