"""Loops of PX4 in its own simulator (SIH quadrotor), tick for tick: margins of gains, load, steps. Filters and order of calls are those
of PX4 and SIH, so steps and noise agree with flights to some percent.

    python sih.py

prints the least ISE of a step of roll that a P-PI cascade can have at a margin and a noise of the torque.
"""

import functools
import math

import numpy

TICK_S = 0.004
# Lag of the motors (s); acceleration for a full set-point and damping (1/s) of the default parameters.
MOTOR_S = 0.05
ACCELERATION = {"roll": 113.1, "pitch": 113.1, "yaw": 13.3, "altitude": 20.0}
DAMPING = {"roll": 1.0, "pitch": 1.0, "yaw": 1 / 1.2, "altitude": 1.0}
# Noise of a sample of the gyro (rad/s), IMU_GYRO_CUTOFF and IMU_DGYRO_CUTOFF (Hz), largest rate that the integral follows (rad/s).
GYRO_NOISE = {"roll": 0.14, "pitch": 0.07, "yaw": 0.03}
GYRO_HZ, D_HZ = 40.0, 30.0
INTEGRAL_RATE = math.radians(400)
# The attitude controller's output is used in the next tick. Altitude: estimator and tick together (s).
LATE_TICKS = 1
ALTITUDE_LATE_S = 0.006
# Step of the set-point (rad, m).
STEP = {"roll": math.radians(10), "pitch": math.radians(10), "yaw": math.radians(20), "altitude": 0.5}


def butterworth(cut_off_hz):
    """Coefficients of PX4's low-pass of second order: of the last three inputs, and of the last two outputs."""
    w = math.tan(math.pi * cut_off_hz * TICK_S)
    c = 1 + 2 * math.cos(math.pi / 4) * w + w * w
    return (w * w / c, 2 * w * w / c, w * w / c), (2 * (w * w - 1) / c, (1 - 2 * math.cos(math.pi / 4) * w + w * w) / c)


def smoothing(cut_off_hz):
    """Weight of a new sample in PX4's low-pass of first order; 1 without a cut-off."""
    return TICK_S / (TICK_S + 1 / (2 * math.pi * cut_off_hz)) if cut_off_hz > 0 else 1.0


def loop(axis, law, omega):
    """Open loop, cut at the process input; `law` is outer P, and P, I, D of the rate, and the cut-off of the output (Hz)."""
    outer, inner, integral, derivative, cut_off = law
    later = numpy.exp(-1j * omega * TICK_S)
    if axis == "altitude":
        s = 1j * omega
        process = ACCELERATION[axis] * numpy.exp(-ALTITUDE_LATE_S * s) / (s * (s + DAMPING[axis]) * (MOTOR_S * s + 1))
        return process * (inner + integral / s) * (outer + s)
    motor = TICK_S / MOTOR_S * later / (1 - (1 - TICK_S / MOTOR_S) * later)
    rate = motor * ACCELERATION[axis] * TICK_S / (1 - (1 - DAMPING[axis] * TICK_S) * later)
    inputs, outputs = butterworth(GYRO_HZ)
    filtered = (inputs[0] + inputs[1] * later + inputs[2] * later**2) / (1 + outputs[0] * later + outputs[1] * later**2)
    angle = TICK_S / 2 * (1 + later) / (1 - later) * later**LATE_TICKS
    new, new_d = smoothing(cut_off), smoothing(D_HZ)
    change = filtered * (1 - later) / TICK_S * new_d / (1 - (1 - new_d) * later)
    command = (inner + integral * TICK_S * later / (1 - later)) * (filtered + outer * angle) + derivative * change
    return rate * command * new / (1 - (1 - new) * later)


def margins(axis, law):
    """Phase margin (deg) and maximum sensitivity."""
    omega = numpy.geomspace(0.1, 0.999 * math.pi / TICK_S, 20000)
    of_loop = loop(axis, law, omega)
    crossings = of_loop[numpy.flatnonzero(numpy.diff(numpy.sign(abs(of_loop) - 1)))]
    phases = numpy.degrees(numpy.angle(crossings))
    return min(180 - abs(phases)), abs(1 / (1 + of_loop)).max()


def fly(axis, law, seconds, step=0.0, load=0.0, noise=0.0):
    """Output and input at every tick after a step of the set-point, with this load at the input and this noise of the gyro."""
    outer, inner, integral, derivative, cut_off = law
    (b0, b1, b2), (a1, a2) = butterworth(GYRO_HZ)
    new, new_d, random = smoothing(cut_off), smoothing(D_HZ), numpy.random.default_rng(1)
    motor = rate = angle = height = command = sum_ = change = 0.0
    gyro_1 = gyro_2 = filtered = filtered_2 = 0.0
    late, outputs, inputs = [0.0] * (LATE_TICKS + 1), [], []
    for _ in range(round(seconds / TICK_S)):
        motor += TICK_S / MOTOR_S * (command + load - motor)
        height += TICK_S * rate
        rate += TICK_S * (ACCELERATION[axis] * motor - DAMPING[axis] * rate)
        gyro = rate + noise * random.standard_normal()
        filtered, filtered_1 = b0 * gyro + b1 * gyro_1 + b2 * gyro_2 - a1 * filtered - a2 * filtered_2, filtered
        angle += TICK_S / 2 * (gyro + gyro_1)
        gyro_1, gyro_2, filtered_2 = gyro, gyro_1, filtered_1
        change += new_d * ((filtered - filtered_1) / TICK_S - change)
        late = [*late[1:], angle]
        value, speed = (height, rate) if axis == "altitude" else (late[0], filtered)
        error = outer * (step - value) - speed
        wanted = inner * error + sum_ - derivative * change
        sum_ += integral * error * TICK_S * max(0.0, 1 - (error / INTEGRAL_RATE) ** 2)
        command += new * (min(max(wanted, -1.0), 1.0) - command)
        outputs.append(height if axis == "altitude" else angle)
        inputs.append(command)
    return numpy.array(outputs), numpy.array(inputs)


def ise(axis, law, seconds=1.0):
    """Integral of the squared error of the axis's step, over that of the step (s)."""
    output, _ = fly(axis, law, seconds, step=STEP[axis])
    return TICK_S * numpy.sum((1 - output / STEP[axis]) ** 2)


@functools.cache
def noise(axis, law):
    """Standard deviation of the change of the input from tick to tick."""
    _, command = fly(axis, law, 12.0, noise=GYRO_NOISE[axis])
    return numpy.diff(command[500:]).std()


def largest_deviation(axis, law, load=0.1, seconds=4.0):
    """Largest deviation of the output after a step of the load at the input."""
    return abs(fly(axis, law, seconds, load=load)[0]).max()


def front(axis="roll", integral_s=0.45):
    """Prints the least ISE by margin and noise. The integral is P's over a time of 1/integral_s, onecycle's for roll."""
    print("| noise of the torque | P | " + " | ".join(f"ISE at {margin} degrees" for margin in MARGINS) + " |")
    print("| --- " * (2 + len(MARGINS)) + "|")
    for inner in numpy.arange(0.10, 0.191, 0.015):
        cells = []
        for margin in MARGINS:
            low, high = 1.0, 20.0
            # The margin falls as the outer gain rises.
            for _ in range(20):
                outer = (low + high) / 2
                law = (outer, inner, integral_s * inner, 0.0, 0.0)
                low, high = (outer, high) if margins(axis, law)[0] > margin else (low, outer)
            cells.append(f"{ise(axis, law):.3f}")
        print(f"| {noise(axis, law):.4f} | {inner:.3f} | " + " | ".join(cells) + " |")


MARGINS = (20, 25, 26, 28, 30, 35)

if __name__ == "__main__":
    front()
