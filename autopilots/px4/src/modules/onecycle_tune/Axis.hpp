/**
 * @file Axis.hpp
 * What a test of one axis sees of the vehicle: angle and rate, or height and climb rate, and reasons to stop at once.
 */

#pragma once

#include <drivers/drv_hrt.h>
#include <uORB/Subscription.hpp>
#include <uORB/topics/failure_detector_status.h>
#include <uORB/topics/manual_control_setpoint.h>
#include <uORB/topics/vehicle_angular_velocity.h>
#include <uORB/topics/vehicle_attitude.h>
#include <uORB/topics/vehicle_land_detected.h>
#include <uORB/topics/vehicle_local_position.h>
#include <uORB/topics/vehicle_status.h>

#include "Notes.hpp"
#include "onecycle.h"

class Axis
{
public:
	static constexpr int COUNT = 4;
	static constexpr int YAW = 2;
	static constexpr int ALTITUDE = 3;

	static const char *name(int index);

	/** Takes the latest messages. */
	void update();

	/** Why no test can begin now. */
	Why notReady(bool wants_altitude) const;

	/** Begins a test of this axis: angle or height count from here on. */
	void begin(int index, float most_stick);

	/** Why the test must end now: something that the tuner's own guards do not see. */
	Why mustStop() const;

	/** Angle (rad) or height (m) since the beginning, its rate, and the age of the older of the two. */
	onecycle_measurement measure(hrt_abstime now);

	/** Keeps the delay of the value as it is from here on: the relay begins. */
	void beginRelay() { _is_delay_known = true; }

	bool isArmed() const { return _status.arming_state == vehicle_status_s::ARMING_STATE_ARMED; }

private:
	struct Sample {
		hrt_abstime time;
		float value;
	};

	float angle() const;
	int resets() const;
	void push(hrt_abstime time, float value);

	const Sample &newest() const { return _samples[_newest]; }

	/**
	 * Value of a constant time ago, the largest age of the estimate before the test. The estimate does not come with every
	 * tick: taken as it comes, it repeats itself and then jumps, which is noise several times that of the estimate. The delay
	 * is part of the dead time found.
	 */
	float value(hrt_abstime now, float rate) const;

	uORB::Subscription _attitude_sub{ORB_ID(vehicle_attitude)};
	uORB::Subscription _position_sub{ORB_ID(vehicle_local_position)};
	uORB::Subscription _rates_sub{ORB_ID(vehicle_angular_velocity)};
	uORB::Subscription _status_sub{ORB_ID(vehicle_status)};
	uORB::Subscription _failure_sub{ORB_ID(failure_detector_status)};
	uORB::Subscription _land_sub{ORB_ID(vehicle_land_detected)};
	uORB::Subscription _sticks_sub{ORB_ID(manual_control_setpoint)};

	vehicle_attitude_s _attitude{};
	vehicle_local_position_s _position{};
	vehicle_angular_velocity_s _rates{};
	vehicle_status_s _status{};
	failure_detector_status_s _failure{};
	vehicle_land_detected_s _land{};
	manual_control_setpoint_s _sticks{};

	static constexpr int SAMPLES = 12;
	Sample _samples[SAMPLES] {};
	int _newest{0};
	hrt_abstime _delay{0};
	bool _is_delay_known{false};
	int _index{0};
	float _from{0.f};
	float _climb{0.f};
	float _most_stick{1.f};
	float _throttle{0.f};
	int _resets{0};
	uint8_t _nav_state{0};
};
