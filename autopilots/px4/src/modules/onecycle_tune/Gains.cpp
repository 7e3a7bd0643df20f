#include "Gains.hpp"

#include <mathlib/mathlib.h>
#include <px4_platform_common/defines.h>
#include <stdlib.h>
#include <string.h>

namespace
{
// In the order of Cascade, and the filter of yaw's torque. Altitude has no overall gain.
const char *const NAMES[4][6] {
	{"MC_ROLL_P", "MC_ROLLRATE_K", "MC_ROLLRATE_P", "MC_ROLLRATE_I", "MC_ROLLRATE_D", nullptr},
	{"MC_PITCH_P", "MC_PITCHRATE_K", "MC_PITCHRATE_P", "MC_PITCHRATE_I", "MC_PITCHRATE_D", nullptr},
	{"MC_YAW_P", "MC_YAWRATE_K", "MC_YAWRATE_P", "MC_YAWRATE_I", "MC_YAWRATE_D", "MC_YAW_TQ_CUTOFF"},
	{"MPC_Z_P", nullptr, "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC", nullptr},
};

// Largest gains that the parameters' definitions allow.
struct Most {
	float outer_p;
	float inner_k;
	float inner_p;
	float inner_i;
};

// The integral gains of the rates have no limit.
const Most MOST_OF[4] {{12.f, 5.f, 0.5f, INFINITY}, {12.f, 5.f, 0.5f, INFINITY}, {5.f, 5.f, 0.5f, INFINITY}, {1.5f, 1.f, 15.f, 3.f}};

param_t find(const char *name)
{
#if defined(__PX4_POSIX)
	// For faults.py: in simulation this one is missing.
	const char *missing = getenv("ONECYCLE_MISSING");

	if (missing && strcmp(name, missing) == 0) {
		return PARAM_INVALID;
	}

#endif
	return param_find(name);
}
}

bool Gains::remember(int axis)
{
	_axis = axis;
	_is_written = false;

	for (int k = 0; k < COUNT; k++) {
		_params[k] = NAMES[axis][k] ? find(NAMES[axis][k]) : PARAM_INVALID;

		if (NAMES[axis][k] && (_params[k] == PARAM_INVALID || param_get(_params[k], &_old[k]) != PX4_OK)) {
			return false;
		}
	}

	return true;
}

bool Gains::convert(const onecycle_result &found, float per_input, Cascade &cascade) const
{
	const float kp = found.kp * (double)per_input;
	const float ki = found.ki * (double)per_input;
	const float kd = found.kd * (double)per_input;
	// kp = R + ki kd / R with R = K P A and the integral's part K I = kp - R: the smaller root is the integral's.
	const float root = kp * kp - 4.f * ki * kd;

	if (!(kd > 0.f) || !(root >= 0.f)) {
		return false;
	}

	const Most &most = MOST_OF[_axis];
	const float integral = 0.5f * (kp - sqrtf(root));
	// With less gain than was found the law is slower and has more margin.
	cascade.outer_p = math::min((kp - integral) / kd, most.outer_p);
	cascade.inner_k = math::constrain(kd / most.inner_p, 1.f, most.inner_k);
	cascade.inner_p = math::min(kd / cascade.inner_k, most.inner_p);
	cascade.inner_i = math::min(integral / cascade.inner_k, most.inner_i);
	cascade.inner_d = 0.f;
	return true;
}

bool Gains::write(const Cascade &cascade)
{
	const float values[COUNT] {cascade.outer_p, cascade.inner_k, cascade.inner_p, cascade.inner_i, cascade.inner_d, 0.f};
	_is_written = true;

	if (set(values)) {
		return true;
	}

	restore();
	return false;
}

bool Gains::restore()
{
	_is_written = !set(_old);
	return !_is_written;
}

bool Gains::set(const float (&values)[COUNT])
{
	for (int k = 0; k < COUNT; k++) {
		float read_back = NAN;

		if (_params[k] == PARAM_INVALID) {
			continue;
		}

		if (param_set_no_notification(_params[k], &values[k]) != PX4_OK || param_get(_params[k], &read_back) != PX4_OK
		    || fabsf(read_back - values[k]) > FLT_EPSILON * fabsf(values[k])) {
			return false;
		}
	}

	param_notify_changes();
	return true;
}
