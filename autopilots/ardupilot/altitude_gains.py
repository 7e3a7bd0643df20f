"""Gains of ArduCopter's altitude cascade from an identified process, each loop by its largest sensitivity (see angle.py).

    height error -> A -> climb rate error -> F_v -> V -> acceleration error -> F_a -> P + I/s -> hover + u -> G

G is what `onecycle identify --json` finds in the recording of the altitude's relay test, from the throttle u (0 to 1) to the height
(K, T_body, T_prop, tau). PSC_ACCZ_P and _I (per mille of throttle per cm/s^2) follow ArduPilot's rule P = hover throttle and
I = 2 P, where the hover throttle is gravity over K/T_body; A is PSC_POSZ_P (1/s), V is PSC_VELZ_P (1/s). No gain leaves the range of
ArduPilot's parameter reference: with motors as quick as the simulator's, V would be larger.
"""

import math

import angle

GRAVITY = 9.81
PER_MILLE_PER_CM = 0.1  # throttle per m/s^2 of a gain of one
RANGES = {"PSC_ACCZ_P": (0.2, 1.5), "PSC_ACCZ_I": (0.0, 3.0), "PSC_VELZ_P": (1.0, 8.0), "PSC_POSZ_P": (1.0, 3.0)}


def low_pass(s, hz):
    """First-order low-pass; none at 0 Hz."""
    return 1.0 / (1.0 + s / (2.0 * math.pi * hz)) if hz > 0.0 else 1.0


def within(name, value):
    """The value, or the end of the parameter's range."""
    low, high = RANGES[name]
    return min(max(value, low), high)


def cascade(process, climb_hz, acceleration_hz):
    """The four parameters; the filters are PSC_VELZ_FLTE and PSC_ACCZ_FLTE (Hz)."""
    def of(name, default=0.0):
        found = process.get(name)
        return found["estimate"] if found else default

    gain, tau = process["k_over_t_body"]["estimate"], of("tau_s")
    lag, body = of("t_prop_s"), of("t_body_s", math.inf) or math.inf
    proportional = within("PSC_ACCZ_P", GRAVITY / gain)
    integral = within("PSC_ACCZ_I", 2.0 * proportional)

    def acceleration(s):
        process = gain * s / (s + 1.0 / body) * 2.718281828459045 ** (-tau * s) / (lag * s + 1.0)
        controller = PER_MILLE_PER_CM * (proportional + integral / s)
        loop = controller * low_pass(s, acceleration_hz) * process
        return loop / (1.0 + loop)

    def filtered(s):
        return acceleration(s) * low_pass(s, climb_hz)

    climb_gain = within("PSC_VELZ_P", angle.gain(filtered))

    def climb(s):
        loop = climb_gain * filtered(s) / s
        return loop / (1.0 + loop)

    position_gain = within("PSC_POSZ_P", angle.gain(climb))
    return {"PSC_ACCZ_P": proportional, "PSC_ACCZ_I": integral, "PSC_VELZ_P": climb_gain, "PSC_POSZ_P": position_gain}
