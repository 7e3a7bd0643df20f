"""One axis of one vehicle, from a poor controller to a tuned one, and the step that must follow.

A vehicle is any object with `step(axis, input)` for a tick, `read(axis)` for value and rate, and the sizes of
its oscillations in `oscillation`: see f450.py.
"""

import collections
import dataclasses
import itertools
import math
import multiprocessing
import random

from tuner import Tuner

TICK_S = 0.001
# Tolerance between prediction and flight: relative, and for the overshoot also a hundredth of the step and the noise, which
# the prediction comes from.
TOLERANCE, LEAST = 0.2, 0.01
# The response has settled when it stays within this part of the step.
BAND = 0.05


@dataclasses.dataclass
class Axis:
    """Axis to tune and its settings, in units of the input, units of the output and seconds."""

    name: str
    amplitude: float
    delay_ticks: int
    safe_kp: float
    safe_kd: float
    excursion: float
    rate: float


@dataclasses.dataclass
class Disturbance:
    """Noise as a fraction of the amplitude of the oscillation, input bias as a fraction of that of the relay."""

    noise: float = 0.0
    bias: float = 0.0


def metrics(values, step):
    """Overshoot (part of the step) and settling time (s) of a response to a step at its beginning, from
    zero; the noise-free output, a tick apart."""
    overshoot = max(values) / step - 1.0
    outside = [index for index, value in enumerate(values) if abs(value - step) > BAND * abs(step)]
    return overshoot, TICK_S * (outside[-1] + 1 if outside else 0)


def predicted(found, step, seconds):
    """Response of the identified process under its controller, by the trapezoidal rule in tenths of a tick, with
    the dead time as a delay line."""
    parts = 10
    h = TICK_S / parts
    line = collections.deque([0.0] * (1 + round(found.tau_s / h)))
    y = v = f = integral = 0.0
    values = []
    for _ in range(round(seconds / TICK_S)):
        values.append(y)
        integral += found.ki * TICK_S * (step - y)
        command = found.kp * (found.setpoint_weight * step - y) + integral - found.kd * v
        for _ in range(parts):
            line.append(command)
            u = line.popleft()
            f_next = f + h * (u - f) / found.t_prop_s / (1 + 0.5 * h / found.t_prop_s)
            d = found.inv_t_body_per_s
            force = found.k_over_t_body * 0.5 * (f + f_next)
            v_next = (v * (1 - 0.5 * h * d) + h * force) / (1 + 0.5 * h * d)
            y, v, f = y + 0.5 * h * (v + v_next), v_next, f_next
    return values


def fly(interface, vehicle, axis, disturbance):
    """Returns the result of the tuner, the duration of the test (s), and the metrics of the predicted and of the flown
    step."""
    noise = random.Random(1)
    size = vehicle.oscillation[axis.name]
    sigma = disturbance.noise * size
    tuner = Tuner(
        interface,
        axis.amplitude,
        TICK_S,
        # A sensor without noise still has a finite resolution.
        noise_sigma=max(sigma, 1e-3 * size),
        limit_excursion=axis.excursion,
        limit_rate=axis.rate,
        limit_duration_s=30.0,
        limit_no_switch_s=5.0,
        limit_stale_s=0.01,
        output_lowest=-8.0 * axis.amplitude,
        output_highest=8.0 * axis.amplitude,
        safe_kp=axis.safe_kp,
        safe_kd=axis.safe_kd,
        bias_filter_s=0.5,
        consent=interface.constants["ONECYCLE_CONSENT_AUTOMATIC"],
    )
    late = collections.deque([0.0] * axis.delay_ticks)
    bias = disturbance.bias * axis.amplitude
    tick, true_values = 0, []

    def run(seconds, reference, until=lambda: False):
        nonlocal tick
        for _ in range(round(seconds / TICK_S)):
            value, rate = vehicle.read(axis.name)
            true_values.append(value)
            measured = value + noise.gauss(0.0, sigma)
            late.append(tuner.step(tick * TICK_S, measured, rate, reference))
            vehicle.step(axis.name, late.popleft() + bias)
            tick += 1
            if until():
                return

    run(5.0, 0.0)
    tuner.start()
    run(30.0, 0.0, lambda: tuner.phase == "phase_aborted" or (tuner.result and tuner.result.is_proven))
    if not (tuner.result and tuner.result.is_proven):
        raise RuntimeError(f"{axis.name}: {tuner.phase}, {tuner.reason}")
    found, tuned_s = tuner.result, tick * TICK_S - 5.0
    rest_s = 12.0 * found.kd / found.kp
    run(2.0 * rest_s, 0.0)
    # The command jumps by three times the amplitude of the relay, so nothing saturates.
    step = 3.0 * axis.amplitude / found.kp
    at_rest = sum(true_values[-500:]) / 500
    flown_from = len(true_values)
    run(rest_s, step)
    flown = [value - at_rest for value in true_values[flown_from:]]
    return found, tuned_s, metrics(predicted(found, step, rest_s), step), metrics(flown, step)


def line_of(title, axis, label, noise, flight):
    """One line about a flight with `noise` (fraction of the amplitude), and whether its step was as predicted."""
    found, tuned_s, (overshoot, settling), (flown_overshoot, flown_settling) = flight
    is_right = math.isclose(
        flown_overshoot, overshoot, rel_tol=TOLERANCE, abs_tol=LEAST + noise
    ) and math.isclose(flown_settling, settling, rel_tol=TOLERANCE)
    line = (
        f"{title:22} {axis.name:8} {label:22} tuned in {tuned_s:4.1f} s  "
        f"K/T_body {found.k_over_t_body:8.3f}  T_prop {1e3 * found.t_prop_s:5.1f} ms  "
        f"tau {1e3 * found.tau_s:5.1f} ms  Kp {found.kp:7.3f}  Kd {found.kd:7.4f}  "
        f"overshoot {100 * overshoot:5.1f} % -> {100 * flown_overshoot:5.1f} %  "
        f"settling {settling:5.3f} s -> {flown_settling:5.3f} s"
        f"{'' if is_right else '   NOT AS PREDICTED'}"
    )
    return line, is_right


def report(title, vehicle, axes, interface):
    """Flies every axis without disturbances and with noise and bias; prints a line for each flight. Each flight is
    a process of its own, forked from this one, so that all begin with the same vehicle. Returns whether every step
    was as predicted."""
    disturbances = {"clean": Disturbance(), "1 % noise, bias 0.3 h": Disturbance(noise=0.01, bias=0.3)}
    context = multiprocessing.get_context("fork")
    receivers = []
    for axis, (label, disturbance) in itertools.product(axes, disturbances.items()):
        receiver, sender = context.Pipe(duplex=False)
        receivers.append(receiver)

        def flight():
            flown = fly(interface, vehicle, axis, disturbance)
            sender.send(line_of(title, axis, label, disturbance.noise, flown))

        context.Process(target=flight).start()
        sender.close()
    is_right = True
    for receiver in receivers:
        # A process that fails prints its error and sends no line, which raises EOFError here.
        line, is_as_predicted = receiver.recv()
        print(line, flush=True)
        is_right = is_right and is_as_predicted
    return is_right
