"""rotorpy's quadrotors: PX4's simulated quad-x and the AscTec Hummingbird; MIT, from PyPI."""

import numpy as np
from rotorpy.vehicles.hummingbird_params import quad_params as hummingbird
from rotorpy.vehicles.multirotor import Multirotor
from rotorpy.vehicles.px4_sihsim_quadx_params import quad_params as quad_x
from scipy.spatial.transform import Rotation

from mission import TICK_S, Axis

GRAVITY = 9.81
# Poles of the controllers that hold the other axes: damped, and slow beside motor and dead time (1/s).
HOLD = {"altitude": 1.0, "roll": 4.0, "pitch": 4.0, "yaw": 1.0}


class Quadrotor:
    """Hovering, its inputs a thrust beyond hover (N) and moments (Nm)."""

    def __init__(self, parameters, oscillation):
        self.oscillation = oscillation
        speed = np.sqrt(parameters["mass"] * GRAVITY / 4 / parameters["k_eta"])
        self.state = {
            "x": np.zeros(3),
            "v": np.zeros(3),
            "q": np.array([0.0, 0.0, 0.0, 1.0]),
            "w": np.zeros(3),
            "wind": np.zeros(3),
            "rotor_speeds": np.full(4, speed),
        }
        self.body = Multirotor(parameters, self.state, control_abstraction="cmd_ctbm")
        self.weight = parameters["mass"] * GRAVITY
        self.inertia = {
            "altitude": parameters["mass"],
            "roll": parameters["Ixx"],
            "pitch": parameters["Iyy"],
            "yaw": parameters["Izz"],
        }

    def read(self, axis):
        if axis == "altitude":
            return self.state["x"][2], self.state["v"][2]
        index = ["roll", "pitch", "yaw"].index(axis)
        angles = Rotation.from_quat(self.state["q"]).as_euler("xyz")
        return angles[index], self.state["w"][index]

    def step(self, tuned, command):
        commands = {}
        for axis, pole in HOLD.items():
            value, rate = self.read(axis)
            commands[axis] = -self.inertia[axis] * (pole**2 * value + 2 * pole * rate)
        commands[tuned] = command
        control = {
            "cmd_thrust": self.weight + commands["altitude"],
            "cmd_moment": np.array([commands["roll"], commands["pitch"], commands["yaw"]]),
        }
        self.state = self.body.step(self.state, control, TICK_S)


def axes(parameters, thrust, moment):
    """The relay's amplitudes (N, Nm), and safe controllers of the poles above."""

    def axis(name, inertia, amplitude, delay_ticks, excursion, rate):
        pole = HOLD[name]
        kp, kd = inertia * pole**2, 2 * inertia * pole
        return Axis(name, amplitude, delay_ticks, kp, kd, excursion, rate)

    return [
        axis("altitude", parameters["mass"], thrust, 30, 2.0, 4.0),
        axis("roll", parameters["Ixx"], moment, 15, 0.8, 8.0),
    ]


VEHICLES = [
    (
        "rotorpy PX4 quad-x",
        lambda: Quadrotor(quad_x, {"altitude": 0.009, "roll": 0.01}),
        axes(quad_x, 1.0, 0.05),
    ),
    (
        "rotorpy Hummingbird",
        lambda: Quadrotor(hummingbird, {"altitude": 0.005, "roll": 0.01}),
        axes(hummingbird, 0.5, 0.02),
    ),
]
