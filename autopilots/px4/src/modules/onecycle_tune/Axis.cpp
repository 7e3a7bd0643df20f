#include "Axis.hpp"

#include <mathlib/mathlib.h>
#include <matrix/matrix/math.hpp>

using matrix::Eulerf;
using matrix::Quatf;
using namespace time_literals;

const char *Axis::name(int index)
{
	static const char *const names[COUNT] {"roll", "pitch", "yaw", "altitude"};
	return names[index];
}

void Axis::update()
{
	if (_attitude_sub.update(&_attitude) && _index != ALTITUDE) {
		push(_attitude.timestamp_sample, matrix::wrap_pi(angle() - _from));
	}

	if (_position_sub.update(&_position) && _index == ALTITUDE) {
		// The estimated height wanders by many times the oscillation, the velocity does not.
		const float interval_s = 1e-6f * (float)(_position.timestamp_sample - _latest.time);
		const float climb = -_position.vz;
		push(_position.timestamp_sample, _latest.value + 0.5f * (climb + _climb) * math::constrain(interval_s, 0.f, 0.1f));
		_climb = climb;
	}

	_rates_sub.update(&_rates);
	_status_sub.update(&_status);
	_failure_sub.update(&_failure);
	_land_sub.update(&_land);
	_sticks_sub.update(&_sticks);
}

void Axis::push(hrt_abstime time, float value)
{
	const hrt_abstime period = time - _latest.time;

	if (_latest.time > 0 && period > 0 && period < 100_ms) {
		_period_us += (_period_us > 0.f ? 0.01f : 1.f) * ((float)period - _period_us);
	}

	_before = _latest;
	_latest = {time, value};
}

const char *Axis::notReady(bool wants_altitude) const
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

	if (wants_altitude && !(_position.z_valid && _position.v_z_valid)) {
		return "there is no height";
	}

	return nullptr;
}

void Axis::begin(int index, float most_stick)
{
	_index = index;
	_most_stick = most_stick;
	_resets = resets();
	_nav_state = _status.nav_state;
	_throttle = _sticks.throttle;
	_period_us = 0.f;
	_climb = -_position.vz;

	if (index == ALTITUDE) {
		_latest = {_position.timestamp_sample, 0.f};

	} else {
		_from = angle();
		_latest = {_attitude.timestamp_sample, 0.f};
	}

	_before = _latest;
}

int Axis::resets() const
{
	return _index == ALTITUDE ? _position.vz_reset_counter : _attitude.quat_reset_counter;
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

	if (resets() != _resets) {
		return "the estimator was reset";
	}

	if (_sticks.valid) {
		const float turned = math::max(math::max(fabsf(_sticks.roll), fabsf(_sticks.pitch)), fabsf(_sticks.yaw));

		if (math::max(turned, fabsf(_sticks.throttle - _throttle)) > _most_stick) {
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
		return _latest.value;
	}

	const float part = math::max(since_us / interval_us, 0.f);
	const float step = _latest.value - _before.value;
	return _before.value + part * (_index == ALTITUDE ? step : matrix::wrap_pi(step));
}

onecycle_measurement Axis::measure(hrt_abstime now) const
{
	const bool is_altitude = _index == ALTITUDE;
	const hrt_abstime sampled = is_altitude ? _latest.time : math::min(_attitude.timestamp_sample, _rates.timestamp_sample);
	onecycle_measurement measurement{};
	measurement.value = value(now);
	measurement.rate = is_altitude ? _climb : _rates.xyz[_index];
	measurement.age_s = now > sampled ? (now - sampled) * 1e-6f : 0.f;
	measurement.has_rate = true;
	return measurement;
}
