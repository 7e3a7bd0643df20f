#include "Axis.hpp"

#include <mathlib/mathlib.h>
#include <matrix/matrix/math.hpp>

using matrix::Eulerf;
using matrix::Quatf;

const char *Axis::name(int index)
{
	static const char *const names[] {"roll", "pitch", "yaw"};
	return names[index];
}

void Axis::update()
{
	_attitude_sub.update(&_attitude);
	_rates_sub.update(&_rates);
	_status_sub.update(&_status);
	_failure_sub.update(&_failure);
	_land_sub.update(&_land);
	_sticks_sub.update(&_sticks);
}

const char *Axis::notReady() const
{
	if (!isArmed() || _land.landed || _land.maybe_landed) {
		return "the vehicle is not flying: hover first";
	}

	if (_status.failsafe) {
		return "a failsafe is active";
	}

	if (_attitude.timestamp == 0 || _rates.timestamp == 0) {
		return "there is no attitude";
	}

	return nullptr;
}

void Axis::begin(int index, float most_stick)
{
	_index = index;
	_most_stick = most_stick;
	_resets = _attitude.quat_reset_counter;
	_nav_state = _status.nav_state;
	_from = angle();
}

const char *Axis::mustStop() const
{
	if (!isArmed()) {
		return "disarmed";
	}

	if (_status.failsafe || _status.nav_state != _nav_state) {
		return "the flight mode changed, or a failsafe began";
	}

	if (_failure.fd_motor || _failure.fd_imbalanced_prop) {
		return "the failure detector reports a motor";
	}

	if (_attitude.quat_reset_counter != _resets) {
		return "the estimator reset its attitude";
	}

	if (_sticks.valid) {
		const float moved = math::max(math::max(fabsf(_sticks.roll), fabsf(_sticks.pitch)), fabsf(_sticks.yaw));

		if (moved > _most_stick) {
			return "a stick was moved";
		}
	}

	return nullptr;
}

float Axis::angle() const
{
	return Eulerf{Quatf{_attitude.q}}(_index);
}

onecycle_measurement Axis::measure(hrt_abstime now) const
{
	const hrt_abstime sampled = math::min(_attitude.timestamp_sample, _rates.timestamp_sample);
	onecycle_measurement measurement{};
	measurement.value = matrix::wrap_pi(angle() - _from);
	measurement.rate = _rates.xyz[_index];
	measurement.age_s = now > sampled ? (now - sampled) * 1e-6f : 0.f;
	measurement.has_rate = true;
	return measurement;
}
