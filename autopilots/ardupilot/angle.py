"""Gain of the angle loop around an identified rate loop, by its largest sensitivity.

    e -> A -> F(s) -> [ C(s) G(s) / (1 + C(s) G(s)) ] -> 1/s -> angle

G is the process that `onecycle identify --json` reports (K, T_body, tau; the delay holds the gyro's filter, which makes the
angle loop look slower than it is), C the rate controller, F the first-order filter of the rate's target. Symbols: A (1/s),
frequencies (rad/s).
"""

import math

LARGEST_SENSITIVITY = 1.4
FREQUENCIES = [math.exp(math.log(0.1) + i * math.log(1e4) / 1999) for i in range(2000)]


def rate_loop(process, gains, target_hz, derivative_hz):
    """Frequency response of the closed rate loop from its target, as a function of s."""
    k, t_body, tau = (process[name]["estimate"] for name in ("k", "t_body_s", "tau_s"))

    def low_pass(s, hz):
        return 1.0 / (1.0 + s / (2.0 * math.pi * hz)) if hz > 0.0 else 1.0

    def closed(s):
        delay = 2.718281828459045 ** (-tau * s)
        controller = gains["kp"] + gains["ki"] / s + gains["kd"] * s * low_pass(s, derivative_hz)
        loop = controller * k * delay / (t_body * s + 1.0)
        return low_pass(s, target_hz) * loop / (1.0 + loop)

    return closed


def sensitivity(closed, gain):
    """Largest |1 / (1 + A T(jw) / jw)|; infinite if the loop is unstable."""
    largest, turned, last = 0.0, False, None
    for omega in FREQUENCIES:
        loop = gain * closed(1j * omega) / (1j * omega)
        largest = max(largest, 1.0 / abs(1.0 + loop))
        crosses = last is not None and last.imag < 0.0 <= loop.imag
        turned |= crosses and loop.real < -1.0
        last = loop
    return math.inf if turned else largest


def gain(closed):
    """The largest angle gain (1/s) whose sensitivity is at most LARGEST_SENSITIVITY."""
    low, high = 0.1, 100.0
    for _ in range(40):
        middle = math.sqrt(low * high)
        if sensitivity(closed, middle) <= LARGEST_SENSITIVITY:
            low = middle
        else:
            high = middle
    return low
