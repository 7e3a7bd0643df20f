"""Steps of the angle in flight, and what the log says about them."""

import math
import statistics

from sitl import read_log

STEP_RAD = math.radians(10.0)
HOLD_S = 1.5
ANGLE = {"roll": ("DesRoll", "Roll", "ROut"), "pitch": ("DesPitch", "Pitch", "POut"), "yaw": ("DesYaw", "Yaw", "YOut")}


def fly_steps(vehicle, axis, pairs=3):
    """Steps of 10 degrees up and down without shaping of the target, so that the loop alone is seen.

    Returns the time of the log at which they begin and end.
    """
    shaped = vehicle.set("ATC_RATE_FF_ENAB", 0)
    yaw_rad = vehicle.attitude.yaw
    began_s = vehicle.time_s
    try:
        for sign in [1, -1] * pairs:
            for angle in (sign * STEP_RAD, 0.0):
                wanted = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": yaw_rad}
                wanted[axis + "_rad"] += angle
                vehicle.sleep(HOLD_S, lambda: vehicle.hold_attitude(**wanted))  # noqa: B023
    finally:
        vehicle.set("ATC_RATE_FF_ENAB", shaped)
    return began_s, vehicle.time_s


def response(rows, axis, window):
    """Rise (10 to 90 %, s), overshoot (%), ISE over the square of the step (s), of the steps inside the window."""
    wanted_name, angle_name, _ = ANGLE[axis]
    rows = [row for row in rows if window[0] <= row["t"] <= window[1]]
    starts = [i for i in range(1, len(rows)) if abs(turn(rows[i][wanted_name] - rows[i - 1][wanted_name])) > 5.0]
    found = []
    for i, following in zip(starts, [*starts[1:], None]):
        # On a busy computer a command may come late, and the next one too soon after it.
        if following is not None and rows[following]["t"] - rows[i]["t"] < 0.95 * HOLD_S:
            continue
        first, size = rows[i - 1][wanted_name], turn(rows[i][wanted_name] - rows[i - 1][wanted_name])
        part = [row for row in rows[i:] if row["t"] < rows[i]["t"] + 0.95 * HOLD_S]
        if part[-1]["t"] - part[0]["t"] > 0.9 * HOLD_S:
            found.append(one_step([(row["t"], turn(row[angle_name] - first) / size) for row in part]))
    if not found:
        raise ValueError(f"no step of {axis} between {window[0]:.1f} and {window[1]:.1f} s of the log")
    return {key: statistics.median(step[key] for step in found) for key in found[0]} | {"steps": len(found)}


def one_step(points):
    """Figures of one step from (time, response), the response relative to the step."""
    def reached(level):
        return next((t for t, y in points if y >= level), math.inf)

    ise = sum((t1 - t0) * (1.0 - y0) ** 2 for (t0, y0), (t1, _) in zip(points, points[1:]))
    return {"rise_s": reached(0.9) - reached(0.1), "overshoot": 100.0 * max(0.0, max(y for _, y in points) - 1.0),
            "ise_s": ise}


def turn(degrees):
    """An angle between -180 and 180 degrees."""
    return (degrees + 180.0) % 360.0 - 180.0


def evaluate(log, axis, windows):
    """Figures of the steps in each of the windows, with the standard deviation of the torque."""
    found = read_log(log, "ANG", "RATE")
    results = []
    for window in windows:
        torque = [row[ANGLE[axis][2]] for row in found["RATE"] if window[0] <= row["t"] <= window[1]]
        results.append(response(found["ANG"], axis, window) | {"torque_std": statistics.pstdev(torque)})
    return results


def table(rows):
    """Lines of a table from (name, figures)."""
    lines = ["| gains | rise (ms) | overshoot (%) | ISE (ms) | torque std |", "| --- | --- | --- | --- | --- |"]
    for name, row in rows:
        lines.append(f"| {name} | {1e3 * row['rise_s']:.0f} | {row['overshoot']:.1f} | {1e3 * row['ise_s']:.1f} "
                     f"| {row['torque_std']:.3f} |")
    return lines
