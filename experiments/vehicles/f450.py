"""JSBSim's DJI F450 with its own brushless motors, propeller tables and drag; LGPL-2.1, from PyPI."""

import jsbsim

from mission import TICK_S, Axis

AXES = [
    Axis("altitude", 0.02, 24, safe_kp=0.05, safe_kd=0.05, excursion=1.0, rate=3.0),
    Axis("roll", 0.01, 12, safe_kp=0.05, safe_kd=0.012, excursion=0.6, rate=6.0),
]

MOTORS = ["FR", "AL", "FL", "AR"]
# Effect of a unit of each command on each motor: roll to the right, pitch forward, yaw to the right.
MIX = {"roll": [-1, 1, 1, -1], "pitch": [1, -1, 1, -1], "yaw": [1, 1, -1, -1]}
FOOT_M = 0.3048


class F450:
    """The F450 at hover 50 m above ground. Every axis except the one that is tuned has its own controller."""

    # Amplitudes of the oscillations under the relays above, from clean runs (m, rad).
    oscillation = {"altitude": 0.02, "roll": 0.02}

    def __init__(self):
        self.fdm = fdm = jsbsim.FGFDMExec(None)
        fdm.set_debug_level(0)
        fdm.load_model("F450")
        fdm.set_dt(TICK_S / 2)
        fdm["ic/h-agl-ft"] = 50.0 / FOOT_M
        fdm.run_ic()
        for engine in range(4):
            fdm[f"propulsion/engine[{engine}]/set-running"] = 1
        self.hover = 0.4
        for _ in range(20000):
            altitude, climb = self._altitude()
            self.hover += 1e-5 * (0.0 - altitude) - 2e-5 * climb
            self._fly({})
        self.hover = self.command

    def _altitude(self):
        return FOOT_M * self.fdm["position/h-agl-ft"] - 50.0, -FOOT_M * self.fdm["velocities/v-down-fps"]

    def read(self, axis):
        if axis == "altitude":
            return self._altitude()
        angle, rate = {"roll": ("phi", "p"), "pitch": ("theta", "q"), "yaw": ("psi", "r")}[axis]
        return self.fdm[f"attitude/{angle}-rad"], self.fdm[f"velocities/{rate}-rad_sec"]

    def step(self, axis, command):
        self._fly({axis: command})

    def _fly(self, given):
        commands = {}
        for axis, (kp, kd) in {"altitude": (0.15, 0.15), "roll": (0.06, 0.015), "pitch": (0.06, 0.015)}.items():
            value, rate = self.read(axis)
            commands[axis] = given.get(axis, -kp * value - kd * rate)
        commands["yaw"] = -0.05 * self.read("yaw")[1]
        self.command = self.hover + commands["altitude"]
        for motor, name in enumerate(MOTORS):
            turn = sum(MIX[axis][motor] * commands[axis] for axis in MIX)
            self.fdm[f"fcs/cmd{name}_ext_nd"] = self.command + turn
        for _ in range(2):
            self.fdm.run()
