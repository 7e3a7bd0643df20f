#include "Axis.hpp"

#include <mathlib/mathlib.h>
#include <matrix/matrix/math.hpp>

using matrix::Eulerf;
using matrix::Quatf;
using namespace time_literals;

const char *Axis::name(int index)
{
	static const char *const names[] {"roll", "pitch", "yaw"};
	return names[index];
}

void Axis::update()
{
	if (_attitude_sub.update(&_attitude)) {
		const hrt_abstime period = _attitude.timestamp_sample - _latest.time;

		if (_latest.time > 0 && period > 0 && period < 100_ms) {
			_period_us += (_period_us > 0.f ? 0.01f : 1.f) * ((float)period - _period_us);
		}

		_before = _latest;
		_latest = {_attitude.timestamp_sample, matrix::wrap_pi(angle() - _from)};
	}

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
	_latest = {_attitude.timestamp_sample, 0.f};
	_before = _latest;
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

float Axis::value(hrt_abstime now) const
{
	const float since_us = (float)(int64_t)(now - _before.time) - _period_us;
	const float interval_us = (float)(_latest.time - _before.time);

	if (interval_us <= 0.f || since_us >= interval_us) {
		return _latest.angle;
	}

	const float part = math::max(since_us / interval_us, 0.f);
	return _before.angle + part * matrix::wrap_pi(_latest.angle - _before.angle);
}

onecycle_measurement Axis::measure(hrt_abstime now) const
{
	const hrt_abstime sampled = math::min(_attitude.timestamp_sample, _rates.timestamp_sample);
	onecycle_measurement measurement{};
	measurement.value = value(now);
	measurement.rate = _rates.xyz[_index];
	measurement.age_s = now > sampled ? (now - sampled) * 1e-6f : 0.f;
	measurement.has_rate = true;
	return measurement;
}
