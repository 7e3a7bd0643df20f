/**
 * @file Axis.hpp
 * What a test of one axis sees of the vehicle: the angle and the rate of the axis, and reasons to stop at once.
 */

#pragma once

#include <drivers/drv_hrt.h>
#include <uORB/Subscription.hpp>
#include <uORB/topics/failure_detector_status.h>
#include <uORB/topics/manual_control_setpoint.h>
#include <uORB/topics/vehicle_angular_velocity.h>
#include <uORB/topics/vehicle_attitude.h>
#include <uORB/topics/vehicle_land_detected.h>
#include <uORB/topics/vehicle_status.h>

#include "onecycle.h"

class Axis
{
public:
	static const char *name(int index);

	/** Takes the latest messages. */
	void update();

	/** Why no test can begin now, or null. */
	const char *notReady() const;

	/** Begins a test of this axis: angles count from here on. */
	void begin(int index, float most_stick);

	/** Why the test must end now, or null: something that the tuner's own guards do not see. */
	const char *mustStop() const;

	/** Angle since the beginning (rad), rate (rad/s), and the age of the older of the two. */
	onecycle_measurement measure(hrt_abstime now) const;

	bool isArmed() const { return _status.arming_state == vehicle_status_s::ARMING_STATE_ARMED; }

private:
	struct Sample {
		hrt_abstime time;
		float angle;
	};

	float angle() const;

	/**
	 * Angle of one attitude period ago. The estimator's attitude is sometimes a tick late: taken as it comes, it repeats
	 * itself and then jumps, which is noise several times that of the estimate. The delay is part of the dead time found.
	 */
	float value(hrt_abstime now) const;

	uORB::Subscription _attitude_sub{ORB_ID(vehicle_attitude)};
	uORB::Subscription _rates_sub{ORB_ID(vehicle_angular_velocity)};
	uORB::Subscription _status_sub{ORB_ID(vehicle_status)};
	uORB::Subscription _failure_sub{ORB_ID(failure_detector_status)};
	uORB::Subscription _land_sub{ORB_ID(vehicle_land_detected)};
	uORB::Subscription _sticks_sub{ORB_ID(manual_control_setpoint)};

	vehicle_attitude_s _attitude{};
	vehicle_angular_velocity_s _rates{};
	vehicle_status_s _status{};
	failure_detector_status_s _failure{};
	vehicle_land_detected_s _land{};
	manual_control_setpoint_s _sticks{};

	Sample _before{};
	Sample _latest{};
	float _period_us{0.f};
	int _index{0};
	float _from{0.f};
	float _most_stick{1.f};
	uint8_t _resets{0};
	uint8_t _nav_state{0};
};
