/**
 * @file OnecycleTune.hpp
 * Identifies roll, pitch and yaw by a relay test in flight, and tunes their gains.
 *
 * The module sits between mc_rate_control (started as `vtol`, so that it publishes virtual set-points) and the control allocator. It
 * passes both set-points on, and while a test runs it replaces the torque of one axis by that of onecycle's tuner. The relay and the
 * controller run on the queue of the rate controller; the identification, the parameters and the messages in a task of their own.
 */

#pragma once

#include <lib/mathlib/mathlib.h>
#include <px4_platform_common/atomic.h>
#include <px4_platform_common/defines.h>
#include <px4_platform_common/module.h>
#include <px4_platform_common/module_params.h>
#include <px4_platform_common/posix.h>
#include <px4_platform_common/px4_work_queue/WorkItem.hpp>
#include <uORB/Publication.hpp>
#include <uORB/Subscription.hpp>
#include <uORB/SubscriptionCallback.hpp>
#include <uORB/topics/hover_thrust_estimate.h>
#include <uORB/topics/vehicle_thrust_setpoint.h>
#include <uORB/topics/vehicle_torque_setpoint.h>

#include "Axis.hpp"
#include "Gains.hpp"
#include "Notes.hpp"
#include "Recorder.hpp"

class OnecycleTune : public ModuleBase<OnecycleTune>, public ModuleParams, public px4::WorkItem
{
public:
	OnecycleTune();
	~OnecycleTune() override;

	static int task_spawn(int argc, char *argv[]);
	static int custom_command(int argc, char *argv[]);
	static int print_usage(const char *reason = nullptr);
	int print_status() override;
	bool init();

private:
	/** Of the test of an axis. The control loop leaves Begin, Test and Watch, the task the others. */
	enum class State : int {
		Idle,    // no test
		Begin,   // the axis is set up: the tuner runs beside PX4
		Test,    // relay, identification, and the check of the gains found
		Found,   // gains were found, or the test ended: the task says so
		Asked,   // proposed, waits for the operator
		Write,   // the gains are proven: the task writes them
		Watch,   // PX4 flies with them
		Watched, // they were good, or not: the task says so
	};

	void Run() override;
	void test(const onecycle_measurement &measurement, hrt_abstime now, float &input);
	void watch(hrt_abstime now, float input);

	static int workTrampoline(int argc, char *argv[]);
	void work();
	void poll();
	void attend();
	/** Whether the control loop stands still, as without a gyro. */
	bool isStalled();
	void begin();
	void beginAxis();
	bool initTuner(int axis);
	float tickS() const { return 1e-9f * _tick_ns.load(); }
	void leave();
	void nextAxis();
	void found();
	/** The test of this axis ended: the old gains are in force. */
	void ended(Why why);
	/** PX4's input of the inner loop for a unit of the tuner's output. */
	float perInput();
	void writeGains();
	void conclude();
	void finish();
	void restoreAll();

	px4::atomic<State> _state{State::Idle};
	px4::atomic<Why> _why{Why::None};          // why the test ended early
	px4::atomic_bool _is_outside{false};       // ended by something that would end any test
	px4::atomic_bool _start_wanted{false};
	px4::atomic_bool _accept_wanted{false};
	px4::atomic_bool _abort_wanted{false};
	px4::atomic_bool _work_runs{false};
	px4::atomic<int> _tick_ns{0};              // mean time between two set-points
	px4::atomic<int> _ticks{0};

	uORB::SubscriptionCallbackWorkItem _torque_sub{this, ORB_ID(vehicle_torque_setpoint_virtual_mc)};
	uORB::Subscription _thrust_sub{ORB_ID(vehicle_thrust_setpoint_virtual_mc)};
	uORB::Subscription _hover_sub{ORB_ID(hover_thrust_estimate)};
	uORB::Publication<vehicle_torque_setpoint_s> _torque_pub{ORB_ID(vehicle_torque_setpoint)};
	uORB::Publication<vehicle_thrust_setpoint_s> _thrust_pub{ORB_ID(vehicle_thrust_setpoint)};

	onecycle_tuner _tuner{};
	onecycle_result _result{};
	Axis _axis;
	int _index{0};
	hrt_abstime _last{0};
	hrt_abstime _since{0};
	hrt_abstime _limited{0};

	// Of the task.
	Gains _gains[Axis::COUNT];
	Cascade _cascade{};
	Recorder _recorder;
	Notes _notes;
	int _left{0};                              // axes left to tune, a bit each
	bool _is_kept{false};
	hrt_abstime _asked_at{0};
	hrt_abstime _polled_at{0};
	hrt_abstime _ticked_at{0};
	int _ticks_seen{0};
	px4_task_t _work_task{-1};

	DEFINE_PARAMETERS(
		(ParamBool<px4::params::OC_START>) _param_oc_start,
		(ParamBool<px4::params::OC_ACCEPT>) _param_oc_accept,
		(ParamInt<px4::params::OC_AXES>) _param_oc_axes,
		(ParamInt<px4::params::OC_APPLY>) _param_oc_apply,
		(ParamFloat<px4::params::OC_AMP>) _param_oc_amp,
		(ParamFloat<px4::params::OC_AMP_YAW>) _param_oc_amp_yaw,
		(ParamFloat<px4::params::OC_AMP_Z>) _param_oc_amp_z,
		(ParamInt<px4::params::OC_STYLE>) _param_oc_style,
		(ParamInt<px4::params::OC_CYCLES>) _param_oc_cycles,
		(ParamFloat<px4::params::OC_NOISE>) _param_oc_noise,
		(ParamFloat<px4::params::OC_NOISE_Z>) _param_oc_noise_z,
		(ParamFloat<px4::params::OC_STICK>) _param_oc_stick,
		(ParamBool<px4::params::OC_RECORD>) _param_oc_record,
		(ParamFloat<px4::params::MC_ROLLRATE_MAX>) _param_mc_rollrate_max,
		(ParamFloat<px4::params::MC_PITCHRATE_MAX>) _param_mc_pitchrate_max,
		(ParamFloat<px4::params::MC_YAWRATE_MAX>) _param_mc_yawrate_max,
		(ParamFloat<px4::params::MPC_MAN_TILT_MAX>) _param_mpc_man_tilt_max,
		(ParamFloat<px4::params::MPC_THR_HOVER>) _param_mpc_thr_hover,
		(ParamFloat<px4::params::IMU_GYRO_CUTOFF>) _param_imu_gyro_cutoff
	)
};
