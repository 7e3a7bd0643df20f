#include "Gains.hpp"

#include <mathlib/mathlib.h>
#include <px4_platform_common/defines.h>

namespace
{
// In the order of Cascade.
const char *const NAMES[3][4] {
	{"MC_ROLL_P", "MC_ROLLRATE_P", "MC_ROLLRATE_I", "MC_ROLLRATE_D"},
	{"MC_PITCH_P", "MC_PITCHRATE_P", "MC_PITCHRATE_I", "MC_PITCHRATE_D"},
	{"MC_YAW_P", "MC_YAWRATE_P", "MC_YAWRATE_I", "MC_YAWRATE_D"},
};
const char *const RATE_K[3] {"MC_ROLLRATE_K", "MC_PITCHRATE_K", "MC_YAWRATE_K"};

// Largest gains that the parameters' definitions allow.
constexpr float MOST_ATTITUDE_P = 12.f;
constexpr float MOST_YAW_P = 5.f;
constexpr float MOST_RATE_P = 0.6f;
}

bool Gains::remember(int axis)
{
	_is_yaw = axis == 2;
	_is_written = false;
	const param_t rate_k = param_find(RATE_K[axis]);

	if (rate_k == PARAM_INVALID || param_get(rate_k, &_rate_k) != PX4_OK || _rate_k <= 0.f) {
		return false;
	}

	for (int k = 0; k < COUNT; k++) {
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
	cascade.rate_p = kd / _rate_k;
	cascade.rate_i = integral / _rate_k;
	cascade.rate_d = 0.f;

	const float most_attitude_p = _is_yaw ? MOST_YAW_P : MOST_ATTITUDE_P;

	if (cascade.attitude_p > most_attitude_p) {
		// The law with the largest angle gain that PX4 allows, and the rate's gain found: slower, with more margin.
		cascade.attitude_p = most_attitude_p;
	}

	if (cascade.rate_p > MOST_RATE_P) {
		what = "the rate's gain is above its parameter's maximum: lower MC_*RATE_K's torque scale first";
		return false;
	}

	what = nullptr;
	return true;
}

bool Gains::write(const Cascade &cascade)
{
	const float values[COUNT] {cascade.attitude_p, cascade.rate_p, cascade.rate_i, cascade.rate_d};
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

		if (param_set_no_notification(_params[k], &values[k]) != PX4_OK || param_get(_params[k], &read_back) != PX4_OK
		    || fabsf(read_back - values[k]) > FLT_EPSILON * fabsf(values[k])) {
			return false;
		}
	}

	param_notify_changes();
	return true;
}
