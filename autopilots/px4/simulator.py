"""Adds wind and faults to PX4's own simulator (SIH) in a checkout of PX4. Applying it again changes nothing.

    python simulator.py PX4_DIR

All are off by default. Says so and changes nothing if a place in the sources is not found: then this PX4 is too different from the
one this was written for.
"""

import pathlib
import sys

FOLDER = "src/modules/simulation/simulator_sih/"

# Name, default, type, unit, and meaning of the parameters.
PARAMETERS = [
    ("SIH_WIND", "0.0f", "Float", "m/s", "Speed of the steady wind, which blows towards the east"),
    ("SIH_GUST", "0.0f", "Float", "m/s", "Standard deviation of the gusts in each direction; correlation time 2 s"),
    ("SIH_MOT_BAD", "0", "Int", "", "Number of the motor that fails, 0 for none"),
    ("SIH_MOT_PART", "1.0f", "Float", "norm", "Part of its thrust and torque that the failing motor keeps"),
    ("SIH_GYRO_HELD", "0", "Int", "", "1: the gyro stays at its last value, its noise goes on"),
]

# (file, text that is there once, text in its place)
CHANGES = [
    ("sih.hpp", "_parameter_update_sub{ORB_ID(parameter_update), 1_s};", "_parameter_update_sub{ORB_ID(parameter_update), 20_ms};"),
    ("sih.hpp", "	float _u[NUM_ACTUATORS_MAX] {}; // thruster signals\n",
     "	float _u[NUM_ACTUATORS_MAX] {}; // thruster signals\n\n"
     "	static constexpr float GUST_S = 2.f;  // correlation time of the gusts\n"
     "	static constexpr float WIND_ARM = 0.02f;  // wind acts this far above the centre of mass [m]\n"
     "	matrix::Vector3f _gust{};  // velocity of the gusts, NED [m/s]\n"
     "	matrix::Vector3f _gyro_last{};  // what the gyro repeats when it is held [rad/s]\n"),
    ("sih.hpp", "		(ParamInt<px4::params::SIH_VEHICLE_TYPE>) _sih_vtype\n",
     "".join(f"		(Param{kind}<px4::params::{name}>) _{name.lower()},\n" for name, _, kind, _, _ in PARAMETERS)
     + "		(ParamInt<px4::params::SIH_VEHICLE_TYPE>) _sih_vtype\n"),
    ("sih.cpp", "				float u_sp = actuators_out.output[i];\n",
     "				float u_sp = actuators_out.output[i] * (i + 1 == _sih_mot_bad.get() ? _sih_mot_part.get() : 1.f);\n"),
    ("sih.cpp", "				 _Q_MAX * (+_u[0] + _u[1] - _u[2] - _u[3]));\n"
     "		_Fa_E = -_KDV * _v_E;   // first order drag to slow down the aircraft\n"
     "		_Ma_B = -_KDW * _w_B;   // first order angular damper\n",
     "				 _Q_MAX * (+_u[0] + _u[1] - _u[2] - _u[3]));\n\n"
     "		if (_sih_gust.get() > 0.f) {\n"
     "			const float kept = expf(-dt / GUST_S);\n"
     "			_gust = _gust * kept + noiseGauss3f(1.f, 1.f, 1.f) * (_sih_gust.get() * sqrtf(1.f - kept * kept));\n\n"
     "		} else {\n"
     "			_gust.setZero();\n"
     "		}\n\n"
     "		const Vector3f air_E = _R_N2E * (Vector3f(0.f, _sih_wind.get(), 0.f) + _gust);\n"
     "		_Fa_E = -_KDV * (_v_E - air_E);   // first order drag in moving air\n"
     "		_Ma_B = Vector3f(0.f, 0.f, -WIND_ARM).cross(_q_E.rotateVectorInverse(_KDV * air_E)) - _KDW * _w_B;\n"),
    ("sih.cpp", "	Vector3f gyro = _w_B + earth_spin_rate_B + gyro_noise;\n",
     "	_gyro_last = _sih_gyro_held.get() ? _gyro_last : _w_B + earth_spin_rate_B;\n"
     "	Vector3f gyro = _gyro_last + gyro_noise;\n"),
]


def parameters():
    """Their definitions, as PX4 reads them from C files."""
    text = ""
    for name, default, kind, unit, meaning in PARAMETERS:
        unit = f" * @unit {unit}\n" if unit else ""
        text += f"\n/**\n * {meaning}\n *\n{unit} * @group Simulation In Hardware\n */\nPARAM_DEFINE_{kind.upper().replace('INT', 'INT32')}({name}, {default});\n"
    return text


def apply(root):
    """Changes the simulator; returns a problem or None."""
    texts = {}
    for name in ("sih.hpp", "sih.cpp", "sih_params.c"):
        path = root / FOLDER / name
        if not path.exists():
            return f"{path} is missing: is {root} a checkout of PX4?"
        texts[path] = path.read_text()
    for name, old, new in CHANGES:
        path = root / FOLDER / name
        if new in texts[path]:
            continue
        if texts[path].count(old) != 1:
            return f"{name}: not the place expected for the change of: {old.strip()}"
        texts[path] = texts[path].replace(old, new)
    path = root / FOLDER / "sih_params.c"
    if parameters() not in texts[path]:
        texts[path] += parameters()
    for path, text in texts.items():
        if path.read_text() != text:
            path.write_text(text)
    return None


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python simulator.py PX4_DIR")
    if problem := apply(pathlib.Path(sys.argv[1])):
        sys.exit(f"simulator: {problem}")
