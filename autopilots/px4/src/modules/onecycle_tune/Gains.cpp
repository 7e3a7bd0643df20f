#include "Gains.hpp"

#include <mathlib/mathlib.h>
#include <px4_platform_common/defines.h>

namespace
{
// In the order of Cascade, and the filter of yaw.
const char *const NAMES[3][6] {
	{"MC_ROLL_P", "MC_ROLLRATE_K", "MC_ROLLRATE_P", "MC_ROLLRATE_I", "MC_ROLLRATE_D", nullptr},
	{"MC_PITCH_P", "MC_PITCHRATE_K", "MC_PITCHRATE_P", "MC_PITCHRATE_I", "MC_PITCHRATE_D", nullptr},
	{"MC_YAW_P", "MC_YAWRATE_K", "MC_YAWRATE_P", "MC_YAWRATE_I", "MC_YAWRATE_D", "MC_YAW_TQ_CUTOFF"},
};

// Largest gains that the parameters' definitions allow.
constexpr float MOST_ATTITUDE_P = 12.f;
constexpr float MOST_YAW_P = 5.f;
constexpr float MOST_RATE_P = 0.5f;
constexpr float MOST_RATE_K = 5.f;
}

bool Gains::remember(int axis)
{
	_is_yaw = axis == 2;
	_is_written = false;

	for (_count = 0; _count < MOST && NAMES[axis][_count]; _count++) {
		const int k = _count;
		_params[k] = param_find(NAMES[axis][k]);

		if (_params[k] == PARAM_INVALID || param_get(_params[k], &_old[k]) != PX4_OK) {
			return false;
		}
	}

	return true;
}

bool Gains::convert(const onecycle_result &found, Cascade &cascade, const char *&what) const
{
	const float kp = found.kp;
	const float ki = found.ki;
	const float kd = found.kd;
	// kp = R + ki kd / R' with R = K P A and the integral's part K I = kp - R: the smaller root is the integral's.
	const float root = kp * kp - 4.f * ki * kd;

	if (!(kd > 0.f) || !(root >= 0.f)) {
		what = "its integral does not fit into PX4's cascade";
		return false;
	}

	const float integral = 0.5f * (kp - sqrtf(root));
	cascade.attitude_p = (kp - integral) / kd;
	cascade.rate_k = math::max(kd / MOST_RATE_P, 1.f);
	cascade.rate_p = kd / cascade.rate_k;
	cascade.rate_i = integral / cascade.rate_k;
	cascade.rate_d = 0.f;

	const float most_attitude_p = _is_yaw ? MOST_YAW_P : MOST_ATTITUDE_P;

	if (cascade.attitude_p > most_attitude_p) {
		// The law with the largest angle gain that PX4 allows, and the rate's gain found: slower, with more margin.
		cascade.attitude_p = most_attitude_p;
	}

	if (cascade.rate_k > MOST_RATE_K) {
		what = "the rate's gain is above the maximum of MC_*RATE_P and _K: the axis has too little torque";
		return false;
	}

	what = nullptr;
	return true;
}

bool Gains::write(const Cascade &cascade)
{
	const float values[MOST] {cascade.attitude_p, cascade.rate_k, cascade.rate_p, cascade.rate_i, cascade.rate_d, 0.f};
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

bool Gains::set(const float (&values)[MOST])
{
	for (int k = 0; k < _count; k++) {
		float read_back = NAN;

		if (param_set_no_notification(_params[k], &values[k]) != PX4_OK || param_get(_params[k], &read_back) != PX4_OK
		    || fabsf(read_back - values[k]) > FLT_EPSILON * fabsf(values[k])) {
			return false;
		}
	}

	param_notify_changes();
	return true;
}
