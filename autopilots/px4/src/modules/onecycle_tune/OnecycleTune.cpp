#include "OnecycleTune.hpp"

#include <lib/geo/geo.h>
#include <px4_platform_common/log.h>
#include <px4_platform_common/tasks.h>

#include "onecycle_pack.h"

using namespace time_literals;

namespace
{
// The mean of what holds the axis is taken this long before the relay begins.
constexpr hrt_abstime BESIDE = 1500_ms;
constexpr float BIAS_FILTER_S = 0.3f;
// How long a proposal waits for the operator, and how long PX4 is watched with the new gains.
constexpr hrt_abstime MOST_ASKED = 60_s;
constexpr hrt_abstime WATCHED = 3_s;
// With the new gains the output may be at its limit for this part of the time.
constexpr float MOST_LIMITED = 0.2f;
constexpr float LEAST_THRUST = 0.05f;
// Altitude: limits of the test (m), (m/s).
constexpr float MOST_CLIMB = 1.f;
constexpr float MOST_CLIMB_RATE = 2.f;
// The integral's part of the phase at the crossover. PX4 has another one around every loop that is tuned here.
constexpr float INTEGRAL_PHASE = 0.035f;
constexpr int WORK_STACK = 14000;
constexpr hrt_abstime POLL = 100_ms;
constexpr hrt_abstime STALLED = 500_ms;
// A second-order Butterworth filter delays by sqrt(2) / (2 pi f).
constexpr float FILTER_DELAY = 0.225f;
enum Apply { REPORT, ASK, AT_ONCE };
enum Style { BALANCED, PAPER, CALM };

struct Pack {
	const uint8_t *bytes;
	size_t size;
};

// In the order of Style; the paper's is built in.
const Pack PACKS[] {{BALANCED_PACK, sizeof(BALANCED_PACK)}, {nullptr, 0}, {CALM_PACK, sizeof(CALM_PACK)}};
}

OnecycleTune::OnecycleTune() : ModuleParams(nullptr), WorkItem(MODULE_NAME, px4::wq_configurations::rate_ctrl)
{
}

OnecycleTune::~OnecycleTune()
{
	_work_runs.store(false);

	while (_work_task >= 0) {
		px4_usleep(10000);
	}
}

bool OnecycleTune::init()
{
	_torque_pub.advertise();
	_thrust_pub.advertise();

	if (!_torque_sub.registerCallback()) {
		return false;
	}

	_work_runs.store(true);
	_work_task = px4_task_spawn_cmd("onecycle_work", SCHED_DEFAULT, SCHED_PRIORITY_DEFAULT - 10, WORK_STACK, workTrampoline, nullptr);
	return _work_task >= 0;
}

// ---------------------------------------------------------------------------------------------- in the control loop

void OnecycleTune::Run()
{
	if (should_exit()) {
		_torque_sub.unregisterCallback();
		exit_and_cleanup();
		return;
	}

	vehicle_torque_setpoint_s torque;

	if (!_torque_sub.update(&torque)) {
		return;
	}

	vehicle_thrust_setpoint_s thrust{};
	_thrust_sub.copy(&thrust);
	_axis.update();

	const hrt_abstime now = torque.timestamp_sample;

	if (_last > 0 && now > _last) {
		const int tick_ns = 1000 * (int)math::min(now - _last, (hrt_abstime)100_ms);
		const int mean_ns = _tick_ns.load();
		_tick_ns.store(mean_ns > 0 ? mean_ns + (tick_ns - mean_ns) / 100 : tick_ns);
	}

	_last = now;
	_ticks.fetch_add(1);

	const State state = _state.load();
	float input = _index == Axis::ALTITUDE ? -thrust.xyz[2] : torque.xyz[_index];

	if (state == State::Begin && _since == 0) {
		_axis.begin(_index, _param_oc_stick.get());
	}

	if (state == State::Begin || state == State::Test || state == State::Asked || state == State::Write || state == State::Found) {
		test(_axis.measure(now), now, input);

	} else if (state == State::Watch) {
		watch(now, input);
	}

	if (_index == Axis::ALTITUDE) {
		thrust.xyz[2] = -input;

	} else {
		torque.xyz[_index] = input;
	}

	// The allocator wakes on the torque, so the thrust goes first.
	thrust.timestamp = hrt_absolute_time();
	_thrust_pub.publish(thrust);
	torque.timestamp = hrt_absolute_time();
	_torque_pub.publish(torque);
}

void OnecycleTune::test(const onecycle_measurement &measurement, hrt_abstime now, float &input)
{
	const State state = _state.load();
	const bool is_over = onecycle_tuner_phase(&_tuner) == ONECYCLE_PHASE_ABORTED;
	const Why why = _abort_wanted.load() ? Why::Operator : _axis.mustStop();

	if (why != Why::None && !is_over) {
		_why.store(why);
		_is_outside.store(true);
		onecycle_tuner_abort(&_tuner);
	}

	if (state == State::Asked && _accept_wanted.load()) {
		_accept_wanted.store(false);

		if (onecycle_tuner_accept(&_tuner)) {
			_state.store(State::Test);
		}
	}

	onecycle_tuner_beside(&_tuner, input);
	input = onecycle_tuner_step(&_tuner, now * 1e-6, &measurement, 0.f);

	const onecycle_phase phase = onecycle_tuner_phase(&_tuner);
	_recorder.push({now * 1e-6, input, measurement.value, measurement.rate, (int)phase});

	if (state == State::Begin) {
		if (_since == 0) {
			_since = now;

		} else if (now - _since >= BESIDE) {
			_axis.beginRelay();
			onecycle_tuner_start(&_tuner);
			_since = now;
			_state.store(State::Test);
		}

	} else if (state == State::Test && onecycle_tuner_result(&_tuner, &_result)) {
		if (phase == ONECYCLE_PHASE_PROPOSED) {
			_state.store(State::Found);

		} else if (phase == ONECYCLE_PHASE_CONTROL && _result.is_proven) {
			_state.store(State::Write);
		}
	}

	if (phase == ONECYCLE_PHASE_ABORTED && (state == State::Begin || state == State::Test || state == State::Asked)) {
		if (_why.load() == Why::None) {
			_why.store(Why::Tuner);
		}

		_state.store(State::Found);
	}
}

void OnecycleTune::watch(hrt_abstime now, float input)
{
	if (_since == 0) {
		_since = now;
		_limited = 0;
	}

	const bool is_high = fabsf(input) > 0.95f;

	if (is_high || (_index == Axis::ALTITUDE && input < LEAST_THRUST)) {
		_limited += (hrt_abstime)(1e6f * tickS());
	}

	Why why = _axis.mustStop();

	if (_limited > MOST_LIMITED * WATCHED) {
		why = Why::Limit;
	}

	if (why != Why::None || now - _since > WATCHED) {
		_why.store(why);
		_state.store(State::Watched);
	}
}

// ---------------------------------------------------------------------------------------------- in the task

int OnecycleTune::workTrampoline(int argc, char *argv[])
{
	// The object is stored before its task is spawned, and waits for the end of the task.
	if (OnecycleTune *self = get_instance()) {
		self->work();
	}

	return 0;
}

void OnecycleTune::work()
{
	while (_work_runs.load()) {
		while (onecycle_tuner_work(&_tuner, 50) && _work_runs.load()) {
			_recorder.flush();
		}

		_recorder.flush();

		if (hrt_elapsed_time(&_polled_at) > POLL) {
			_polled_at = hrt_absolute_time();
			poll();
		}

		attend();
		px4_usleep(4000);
	}

	_work_task = -1;
}

// Parameters are buttons for ground stations.
void OnecycleTune::poll()
{
	updateParams();

	if (_param_oc_start.get()) {
		_param_oc_start.set(false);
		_param_oc_start.commit();
		_start_wanted.store(true);
	}

	if (_param_oc_accept.get()) {
		_param_oc_accept.set(false);
		_param_oc_accept.commit();
		_accept_wanted.store(true);
	}

	if (_state.load() == State::Idle && !_axis.isArmed()) {
		restoreAll();
	}
}

bool OnecycleTune::isStalled()
{
	const int ticks = _ticks.load();

	if (ticks != _ticks_seen || _state.load() == State::Idle) {
		_ticks_seen = ticks;
		_ticked_at = hrt_absolute_time();
	}

	return hrt_elapsed_time(&_ticked_at) > STALLED;
}

void OnecycleTune::attend()
{
	if (isStalled()) {
		// Nothing else would notice it, because the tuner runs in that loop.
		if (_gains[_index].is_written()) {
			_gains[_index].restore();
		}

		_is_outside.store(true);
		ended(Why::Stalled);
		return;
	}

	switch (_state.load()) {
	case State::Idle:
		if (_accept_wanted.load()) {
			_accept_wanted.store(false);
			_is_kept = true;
			_notes.kept();
		}

		if (_start_wanted.load()) {
			_start_wanted.store(false);
			begin();
		}

		break;

	case State::Found:
		found();
		break;

	case State::Asked:
		if (hrt_elapsed_time(&_asked_at) > MOST_ASKED) {
			_why.store(Why::Unanswered);
			found();
		}

		break;

	case State::Write:
		writeGains();
		break;

	case State::Watched:
		conclude();
		break;

	default:
		break;
	}
}

void OnecycleTune::begin()
{
	// What was set just before the start counts.
	updateParams();
	_left = _param_oc_axes.get();
	Why why = _axis.notReady(_left & (1 << Axis::ALTITUDE));

	if (why == Why::None && !(tickS() > 0.f)) {
		why = Why::NotVtol;
	}

	if (why != Why::None) {
		_notes.noTest(why);
		return;
	}

	_is_kept = _param_oc_apply.get() == ASK;
	nextAxis();
}

// Takes the tuner out of the control loop, where a run of it may still be under way.
void OnecycleTune::leave()
{
	_state.store(State::Idle);
	px4_usleep(10000);
}

void OnecycleTune::nextAxis()
{
	leave();
	_abort_wanted.store(false);
	_accept_wanted.store(false);

	for (int axis = 0; axis < Axis::COUNT; axis++) {
		if (_left & (1 << axis)) {
			_left &= ~(1 << axis);
			_index = axis;
			beginAxis();
			return;
		}
	}

	finish();
}

void OnecycleTune::beginAxis()
{
	_why.store(Why::None);
	_is_outside.store(false);

	if (!_gains[_index].remember(_index)) {
		ended(Why::Lacks);
		return;
	}

	if (!initTuner(_index)) {
		ended(Why::Settings);
		return;
	}

	if (_param_oc_record.get()) {
		char path[64];
		snprintf(path, sizeof(path), PX4_STORAGEDIR "/onecycle_%s.csv", Axis::name(_index));

		if (!_recorder.open(path)) {
			_notes.cannotRecord(path);
		}
	}

	_notes.begins(_index);
	_since = 0;
	_state.store(State::Begin);
}

bool OnecycleTune::initTuner(int axis)
{
	const bool is_altitude = axis == Axis::ALTITUDE;
	const float amplitudes[Axis::COUNT] {_param_oc_amp.get(), _param_oc_amp.get(), _param_oc_amp_yaw.get(), _param_oc_amp_z.get()};
	const float rates_max[Axis::COUNT] {
		math::radians(_param_mc_rollrate_max.get()), math::radians(_param_mc_pitchrate_max.get()),
		math::radians(_param_mc_yawrate_max.get()), MOST_CLIMB_RATE
	};

	onecycle_settings settings = onecycle_settings_default(amplitudes[axis], tickS());
	settings.cycles = _param_oc_cycles.get();
	settings.slices = 0;
	settings.noise_sigma = is_altitude ? _param_oc_noise_z.get() : _param_oc_noise.get();
	settings.bias_filter_s = BIAS_FILTER_S;
	settings.integral_phase_rad = INTEGRAL_PHASE;
	settings.rate_delay_s = is_altitude ? 0.f : FILTER_DELAY / math::max(_param_imu_gyro_cutoff.get(), 5.f);
	settings.output_lowest = is_altitude ? LEAST_THRUST : -1.f;
	settings.output_highest = 1.f;
	// Beyond these PX4 itself would no longer hold the vehicle as it is told.
	settings.limit_excursion = is_altitude ? MOST_CLIMB : 0.8f * math::radians(_param_mpc_man_tilt_max.get());
	settings.limit_rate = rates_max[axis];
	settings.limit_duration_s = 30.f;
	settings.limit_no_switch_s = 2.f;
	settings.limit_stale_s = 0.05f;
	settings.consent = _param_oc_apply.get() == AT_ONCE ? ONECYCLE_CONSENT_AUTOMATIC : ONECYCLE_CONSENT_ASK;
	const Pack &pack = PACKS[math::constrain((int)_param_oc_style.get(), (int)BALANCED, (int)CALM)];
	const onecycle_status status = onecycle_tuner_init_with_pack(&_tuner, &settings, pack.bytes, pack.size);

	if (status != ONECYCLE_STATUS_OK) {
		PX4_ERR("settings refused, status %d of onecycle.h", (int)status);
	}

	return status == ONECYCLE_STATUS_OK;
}

void OnecycleTune::ended(Why why)
{
	_notes.ended(_index, why, onecycle_tuner_reason(&_tuner), onecycle_tuner_reason_text(&_tuner));

	// What ended this test from outside would end the next one too.
	if (_is_outside.load()) {
		_left = 0;
	}

	nextAxis();
}

// Gains were found, or the test ended without them.
void OnecycleTune::found()
{
	const Why why = _why.load();

	if (why != Why::None) {
		ended(why);
		return;
	}

	_notes.found(_index, _result);

	if (!_gains[_index].convert(_result, perInput(), _cascade)) {
		ended(Why::Form);
		return;
	}

	_notes.proposes(_index, _cascade);

	if (_param_oc_apply.get() == REPORT) {
		nextAxis();
		return;
	}

	_notes.waits(_index);
	_asked_at = hrt_absolute_time();
	_state.store(State::Asked);
}

float OnecycleTune::perInput()
{
	if (_index != Axis::ALTITUDE) {
		return 1.f;
	}

	hover_thrust_estimate_s estimate{};
	const bool is_known = _hover_sub.copy(&estimate) && estimate.valid;
	return CONSTANTS_ONE_G / math::max(is_known ? estimate.hover_thrust : _param_mpc_thr_hover.get(), 0.1f);
}

void OnecycleTune::writeGains()
{
	if (!_gains[_index].convert(_result, perInput(), _cascade)) {
		ended(Why::Form);
		return;
	}

	if (!_gains[_index].write(_cascade)) {
		ended(Why::Write);
		return;
	}

	_since = 0;
	_state.store(State::Watch);
}

// PX4 flew with the new gains.
void OnecycleTune::conclude()
{
	const Why why = _why.load();

	if (why != Why::None) {
		_gains[_index].restore();
		_is_outside.store(true);
		ended(why);
		return;
	}

	_notes.tuned(_index, _cascade);
	nextAxis();
}

void OnecycleTune::finish()
{
	_recorder.close();
	_state.store(State::Idle);
	_notes.finished();
}

// Gains that were flown at once and not accepted do not outlive the flight.
void OnecycleTune::restoreAll()
{
	for (int axis = 0; axis < Axis::COUNT; axis++) {
		if (_gains[axis].is_written() && !_is_kept) {
			_notes.restored(axis, _gains[axis].restore());
		}
	}
}

// ---------------------------------------------------------------------------------------------- in the shell

int OnecycleTune::task_spawn(int argc, char *argv[])
{
	OnecycleTune *instance = new OnecycleTune();

	if (instance) {
		_object.store(instance);
		_task_id = task_id_is_work_queue;

		if (instance->init()) {
			return PX4_OK;
		}
	}

	delete instance;
	_object.store(nullptr);
	_task_id = -1;
	return PX4_ERROR;
}

int OnecycleTune::custom_command(int argc, char *argv[])
{
	OnecycleTune *self = get_instance();

	if (!self || argc < 1) {
		return print_usage("not running");
	}

	if (!strcmp(argv[0], "run")) {
		self->_start_wanted.store(true);
		return PX4_OK;
	}

	if (!strcmp(argv[0], "accept")) {
		self->_accept_wanted.store(true);
		return PX4_OK;
	}

	if (!strcmp(argv[0], "abort")) {
		self->_abort_wanted.store(true);
		return PX4_OK;
	}

	return print_usage("unknown command");
}

int OnecycleTune::print_status()
{
	static const char *const states[] {"idle", "begin", "test", "found", "asked", "write", "watch", "watched"};
	const State state = _state.load();
	PX4_INFO("%s, axis %s, tick %.2f ms", states[(int)state], Axis::name(_index), (double)(1e3f * tickS()));
	return 0;
}

int OnecycleTune::print_usage(const char *reason)
{
	if (reason) {
		PX4_WARN("%s", reason);
	}

	PRINT_MODULE_DESCRIPTION(
		R"DESCR_STR(
### Description
Identifies roll, pitch, yaw and altitude by relay tests in a hover and tunes their gains. It sits between mc_rate_control and the allocator:
	mc_rate_control stop
	onecycle_tune start
	mc_rate_control start vtol
)DESCR_STR");
	PRINT_MODULE_USAGE_NAME("onecycle_tune", "controller");
	PRINT_MODULE_USAGE_COMMAND("start");
	PRINT_MODULE_USAGE_COMMAND_DESCR("run", "Begin a test, as OC_START does");
	PRINT_MODULE_USAGE_COMMAND_DESCR("accept", "Accept the gains, as OC_ACCEPT does");
	PRINT_MODULE_USAGE_COMMAND_DESCR("abort", "End the test; the old gains stay in force");
	PRINT_MODULE_USAGE_DEFAULT_COMMANDS();
	return 0;
}

extern "C" __EXPORT int onecycle_tune_main(int argc, char *argv[])
{
	return OnecycleTune::main(argc, argv);
}
