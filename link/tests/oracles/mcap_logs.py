"""Writes link/tests/data/px4_*.mcap from examples/logs/px4_chirps.ulg: the same rows as messages of px4_msgs.

pip install pyulog==1.3.0 mcap==1.6.0. The CDR bytes are made by hand with struct.
`python3 mcap_logs.py all FILE` writes every row to FILE.
"""

import struct
import sys
from pathlib import Path

from mcap.writer import CompressionType, Writer
from pyulog import ULog

HERE = Path(__file__).resolve().parent
ULG = HERE.parents[2] / "examples" / "logs" / "px4_chirps.ulg"
START_US, END_US = 203_000_000, 204_000_000

STAMPS = "uint64 timestamp # time since system start (microseconds)\nuint64 timestamp_sample\n"
TYPES = {
    "vehicle_torque_setpoint": (
        "VehicleTorqueSetpoint",
        "uint32 MESSAGE_VERSION = 0\n" + STAMPS + "\nfloat32[3] xyz # normalised\n",
        "QQfff",
        ["timestamp", "timestamp_sample", "xyz[0]", "xyz[1]", "xyz[2]"],
    ),
    "vehicle_angular_velocity": (
        "VehicleAngularVelocity",
        STAMPS + "float32[3] xyz\nfloat32[3] xyz_derivative\n",
        "QQffffff",
        ["timestamp", "timestamp_sample", "xyz[0]", "xyz[1]", "xyz[2]"]
        + [f"xyz_derivative[{at}]" for at in range(3)],
    ),
    "vehicle_rates_setpoint": (
        "VehicleRatesSetpoint",
        "uint64 timestamp\nfloat32 roll\nfloat32 pitch\nfloat32 yaw\nfloat32[3] thrust_body\nbool reset_integral\n",
        "Qffffff?",
        ["timestamp", "roll", "pitch", "yaw"]
        + [f"thrust_body[{at}]" for at in range(3)]
        + ["reset_integral"],
    ),
}


def write(path, compression, start_us, end_us):
    log = ULog(str(ULG))
    rows = []
    for name, (_, _, code, fields) in TYPES.items():
        data = log.get_dataset(name).data
        for row, time_us in enumerate(data["timestamp"]):
            if start_us <= time_us < end_us:
                values = [data[field][row] for field in fields]
                values = [v.item() if hasattr(v, "item") else v for v in values]
                rows.append((int(time_us), name, b"\0\1\0\0" + struct.pack("<" + code, *values)))
    rows.sort(key=lambda row: row[0])
    with open(path, "wb") as file:
        writer = Writer(file, compression=compression, chunk_size=16_384)
        writer.start(profile="ros2", library="mcap_logs.py")
        channels = {}
        for name, (kind, text, _, _) in TYPES.items():
            schema = writer.register_schema(f"px4_msgs/msg/{kind}", "ros2msg", text.encode())
            channels[name] = writer.register_channel(f"/fmu/out/{name}", "cdr", schema)
        text = writer.register_schema("note", "jsonschema", b"{}")
        note = writer.register_channel("/note", "json", text)
        writer.add_message(note, 1, b'{"data": "not of ROS 2"}', 1)
        for time_us, name, data in rows:
            writer.add_message(channels[name], 1000 * time_us, data, 1000 * time_us)
        writer.finish()
    print(path, len(rows), "rows", path.stat().st_size, "bytes")


if sys.argv[1:2] == ["all"]:
    write(Path(sys.argv[2]), CompressionType.ZSTD, 0, 1 << 60)
else:
    data = HERE.parent / "data"
    for name, compression in [
        ("px4_none.mcap", CompressionType.NONE),
        ("px4_lz4.mcap", CompressionType.LZ4),
        ("px4_zstd.mcap", CompressionType.ZSTD),
    ]:
        write(data / name, compression, START_US, END_US)
