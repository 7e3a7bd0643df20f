#include "Axis.hpp"

#include <mathlib/mathlib.h>
#include <matrix/matrix/math.hpp>

using matrix::Eulerf;
using matrix::Quatf;
using namespace time_literals;

namespace
{
constexpr hrt_abstime MOST_DELAY = 30_ms;
}

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
		const float interval_s = 1e-6f * (float)(_position.timestamp_sample - newest().time);
		const float climb = -_position.vz;
		push(_position.timestamp_sample, newest().value + 0.5f * (climb + _climb) * math::constrain(interval_s, 0.f, 0.1f));
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
	if (time > newest().time) {
		_newest = (_newest + 1) % SAMPLES;
		_samples[_newest] = {time, value};
	}
}

Why Axis::notReady(bool wants_altitude) const
{
	if (!isArmed() || _land.landed || _land.maybe_landed) {
		return Why::Ground;
	}

	if (_status.failsafe) {
		return Why::Failsafe;
	}

	if (_attitude.timestamp == 0 || _rates.timestamp == 0) {
		return Why::NoAttitude;
	}

	if (wants_altitude && !(_position.z_valid && _position.v_z_valid)) {
		return Why::NoHeight;
	}

	return Why::None;
}

void Axis::begin(int index, float most_stick)
{
	_index = index;
	_most_stick = most_stick;
	_resets = resets();
	_nav_state = _status.nav_state;
	_throttle = _sticks.throttle;
	_climb = -_position.vz;
	_delay = 0;
	_is_delay_known = false;

	if (index != ALTITUDE) {
		_from = angle();
	}

	const hrt_abstime now = index == ALTITUDE ? _position.timestamp_sample : _attitude.timestamp_sample;

	for (Sample &sample : _samples) {
		sample = {now, 0.f};
	}
}

int Axis::resets() const
{
	return _index == ALTITUDE ? _position.vz_reset_counter : _attitude.quat_reset_counter;
}

Why Axis::mustStop() const
{
	if (!isArmed()) {
		return Why::Disarmed;
	}

	if (_status.failsafe || _status.nav_state != _nav_state) {
		return Why::Mode;
	}

	if (_failure.fd_motor || _failure.fd_imbalanced_prop) {
		return Why::Motor;
	}

	if (resets() != _resets) {
		return Why::Reset;
	}

	if (_sticks.valid) {
		const float turned = math::max(math::max(fabsf(_sticks.roll), fabsf(_sticks.pitch)), fabsf(_sticks.yaw));

		if (math::max(turned, fabsf(_sticks.throttle - _throttle)) > _most_stick) {
			return Why::Stick;
		}
	}

	return Why::None;
}

float Axis::angle() const
{
	return Eulerf{Quatf{_attitude.q}}(_index);
}

float Axis::value(hrt_abstime now, float rate) const
{
	const hrt_abstime then = now - _delay;
	const Sample *after = &newest();

	if (then >= after->time) {
		// Later than ever before the test.
		return after->value + rate * 1e-6f * (float)(then - after->time);
	}

	for (int back = 1; back < SAMPLES; back++) {
		const Sample &before = _samples[(_newest + SAMPLES - back) % SAMPLES];

		if (before.time <= then && before.time < after->time) {
			const float part = (float)(then - before.time) / (float)(after->time - before.time);
			const float step = after->value - before.value;
			return before.value + part * (_index == ALTITUDE ? step : matrix::wrap_pi(step));
		}

		after = &before;
	}

	return after->value;
}

onecycle_measurement Axis::measure(hrt_abstime now)
{
	const bool is_altitude = _index == ALTITUDE;
	const hrt_abstime sampled = is_altitude ? newest().time : math::min(newest().time, _rates.timestamp_sample);

	if (!_is_delay_known && now > newest().time) {
		_delay = math::constrain(now - newest().time, _delay, MOST_DELAY);
	}

	onecycle_measurement measurement{};
	measurement.rate = is_altitude ? _climb : _rates.xyz[_index];
	measurement.value = value(now, measurement.rate);
	measurement.age_s = now > sampled ? (now - sampled) * 1e-6f : 0.f;
	measurement.has_rate = true;
	return measurement;
}
