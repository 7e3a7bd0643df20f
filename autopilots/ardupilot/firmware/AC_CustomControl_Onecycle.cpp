#include "AC_CustomControl_config.h"

#if AP_CUSTOMCONTROL_ONECYCLE_ENABLED

#include "AC_CustomControl_Onecycle.h"
#include "onecycle_pack.h"

#include <AP_AHRS/AP_AHRS.h>
#include <AP_Logger/AP_Logger.h>
#include <AP_Vehicle/AP_Vehicle.h>
#include <GCS_MAVLink/GCS.h>

extern const AP_HAL::HAL& hal;

// the main controller holds the axis for this time before the relay starts
static constexpr uint32_t SETTLE_MS = 1500;
// time constant of the means of command and angle during that time
static constexpr float MEAN_TIME_S = 0.3f;
// deflection of a stick at which the pilot takes over
static constexpr float STICK_MAX = 0.1f;
// noise of a sample of the integrated gyro, lower limit (rad)
static constexpr float NOISE_RAD = 0.0002f;
// phase of the integral: the loops around the axis have their own
static constexpr float INTEGRAL_PHASE_RAD = 0.035f;
// ticks of a test at a limit of the motors, above which the relay is too large
static constexpr uint16_t LIMITED_TICKS = 20;
// time constant with which the gyro's clock follows the loop's
static constexpr float CLOCK_TIME_S = 1.0f;
// least delay of the angle, beyond the jitter of the gyro's samples
static constexpr float LEAST_DELAY_TICKS = 2.0f;
// uncertainty of the angle's time, either way, and time constant of the mean rate for it
static constexpr float DITHER_TICKS = 0.25f;
static constexpr float RATE_TIME_S = 0.2f;
// slices of the identification in one turn of the thread
static constexpr uint16_t SLICES = 200;
// the simulator's threads run in real time: there the loop does the work, so that a flight does not depend on the computer's load
static constexpr uint16_t SLICES_IN_LOOP = CONFIG_HAL_BOARD == HAL_BOARD_SITL ? 25 : 0;

// table of user settable parameters
const AP_Param::GroupInfo AC_CustomControl_Onecycle::var_info[] = {
    // @Param: AMP_RP
    // @DisplayName: Relay amplitude of roll and pitch
    // @Description: Half the jump of the relay on the motors' roll and pitch input
    // @Range: 0.01 0.3
    // @User: Standard
    AP_GROUPINFO("AMP_RP", 1, AC_CustomControl_Onecycle, _amplitude_rp, 0.15f),

    // @Param: AMP_Y
    // @DisplayName: Relay amplitude of yaw
    // @Description: Half the jump of the relay on the motors' yaw input
    // @Range: 0.01 0.3
    // @User: Standard
    AP_GROUPINFO("AMP_Y", 2, AC_CustomControl_Onecycle, _amplitude_yaw, 0.2f),

    // @Param: ANG_MAX
    // @DisplayName: Largest angle of the test
    // @Description: The test ends if the angle is farther than this from that of the start
    // @Range: 3 30
    // @Units: deg
    // @User: Standard
    AP_GROUPINFO("ANG_MAX", 3, AC_CustomControl_Onecycle, _angle_max_deg, 15.0f),

    // @Param: RAT_MAX
    // @DisplayName: Largest rate of the test
    // @Description: The test ends if the axis turns faster than this
    // @Range: 20 400
    // @Units: deg/s
    // @User: Standard
    AP_GROUPINFO("RAT_MAX", 4, AC_CustomControl_Onecycle, _rate_max_degs, 200.0f),

    // @Param: TIME_MAX
    // @DisplayName: Longest test of one axis
    // @Description: The test ends after this time
    // @Range: 5 60
    // @Units: s
    // @User: Standard
    AP_GROUPINFO("TIME_MAX", 5, AC_CustomControl_Onecycle, _time_max_s, 20.0f),

    // @Param: CONSENT
    // @DisplayName: What happens with new gains
    // @Description: Ask: the new controller flies for a few oscillations in the test; its gains are in force when the switch goes high. Never: gains are only reported. Automatic: gains are in force at the end of the test. Gains in force are saved at disarm with the switch not low, and the old ones restored when the switch goes low before.
    // @Values: 0:Ask,1:Never,2:Automatic
    // @User: Standard
    AP_GROUPINFO("CONSENT", 6, AC_CustomControl_Onecycle, _consent, float(Consent::ASK)),

    // @Param: STYLE
    // @DisplayName: Margin of the gains
    // @Description: Phase margin for which the gains are designed
    // @Values: 0:35 degrees,1:20 degrees as in the paper
    // @User: Standard
    AP_GROUPINFO("STYLE", 7, AC_CustomControl_Onecycle, _is_paper, 0),

    AP_GROUPEND
};

AC_CustomControl_Onecycle::AC_CustomControl_Onecycle(AC_CustomControl& frontend, AP_AHRS_View*& ahrs, AC_AttitudeControl*& att_control, AP_MotorsMulticopter*& motors, float dt) :
    AC_CustomControl_Backend(frontend, ahrs, att_control, motors, dt),
    _dt(dt)
{
    AP_Param::setup_object_defaults(this, var_info);
}

bool AC_CustomControl_Onecycle::aux_switch(RC_Channel::AuxSwitchPos position, uint8_t axis_mask)
{
    switch (position) {
    case RC_Channel::AuxSwitchPos::LOW:
        if (_stage == Stage::SETTLE || _stage == Stage::TEST) {
            finish("stopped by the switch");
        }
        restore();
        for (Axis &axis : _axes) {
            axis.has_proposal = false;
        }
        _stage = Stage::IDLE;
        return false;
    case RC_Channel::AuxSwitchPos::MIDDLE:
        if (_stage == Stage::IDLE) {
            begin(axis_mask);
        }
        return true;
    case RC_Channel::AuxSwitchPos::HIGH:
        if (_stage == Stage::PROPOSED) {
            put_in_force();
        } else if (_stage != Stage::IN_FORCE) {
            GCS_SEND_TEXT(MAV_SEVERITY_WARNING, "onecycle: no gains to put in force");
        }
        return true;
    }
    return true;
}

void AC_CustomControl_Onecycle::reset()
{
    if (_stage == Stage::SETTLE || _stage == Stage::TEST) {
        finish("reset");
    }
}

Vector3f AC_CustomControl_Onecycle::update()
{
    Vector3f output {_motors->get_roll(), _motors->get_pitch(), _motors->get_yaw()};

    if (!_motors->armed()) {
        if (_stage == Stage::IN_FORCE) {
            save();
        } else if (_stage == Stage::PROPOSED) {
            GCS_SEND_TEXT(MAV_SEVERITY_WARNING, "onecycle: disarmed, not accepted: old gains in force");
        } else if (_stage != Stage::IDLE) {
            finish("disarmed");
        }
        _stage = Stage::IDLE;
        return output;
    }
    if (_stage != Stage::SETTLE && _stage != Stage::TEST) {
        return output;
    }
    const char *reason = reason_to_stop();
    if (reason != nullptr) {
        finish(reason);
        return output;
    }
    measure();
    output[_axis] = test(main_command(_axis));
    return output;
}

// check what can be wrong before the first axis, and start
void AC_CustomControl_Onecycle::begin(uint8_t axis_mask)
{
    if (!is_ready(axis_mask)) {
        return;
    }
    _mode = AP::vehicle()->get_mode();
    _axes_left = axis_mask;
    for (Axis &axis : _axes) {
        axis.has_proposal = false;
    }
    next_axis();
}

bool AC_CustomControl_Onecycle::is_ready(uint8_t axis_mask)
{
    const char *problem = nullptr;
    if (axis_mask == 0) {
        problem = "CC_AXIS_MASK is 0";
    } else if (!_motors->armed() || !AP::vehicle()->get_likely_flying() || _motors->get_spool_state() != AP_Motors::SpoolState::THROTTLE_UNLIMITED) {
        problem = "not flying";
    } else if (!is_zero(float(rate_pid(0).ff())) || !is_zero(float(rate_pid(1).ff())) || !is_zero(float(rate_pid(2).ff()))) {
        problem = "the rate loop has feed-forward (FF)";
    } else if (!is_positive(_amplitude_rp) || !is_positive(_amplitude_yaw)) {
        problem = "CC3_AMP_RP, CC3_AMP_Y must be positive";
    } else if (SLICES_IN_LOOP == 0 && !_has_thread && !start_thread()) {
        problem = "no memory for the thread";
    }
    if (problem != nullptr) {
        GCS_SEND_TEXT(MAV_SEVERITY_WARNING, "onecycle: %s; switch low and try again", problem);
        return false;
    }
    return true;
}

// the next axis of the mask, or the end
void AC_CustomControl_Onecycle::next_axis()
{
    for (uint8_t axis = 0; axis < NUM_AXES; axis++) {
        if (_axes_left & (1U << axis)) {
            _axes_left &= ~(1U << axis);
            _axis = axis;
            begin_axis();
            return;
        }
    }
    _stage = Stage::PROPOSED;
    if (_consent == Consent::AUTOMATIC) {
        put_in_force();
    } else if (_consent == Consent::ASK) {
        GCS_SEND_TEXT(MAV_SEVERITY_NOTICE, "onecycle: switch high: new gains, low: drop them");
    }
}

void AC_CustomControl_Onecycle::begin_axis()
{
    _settled_from_ms = AP_HAL::millis();
    _limited = 0;
    memset(_samples, 0, sizeof(_samples));
    _started_us = AP_HAL::micros64();
    _angle_rad = 0;
    _rate_rads = 0;
    _rate_square = 0;
    _attitude_rad = {_ahrs->roll, _ahrs->pitch, _ahrs->yaw};
    _resets = estimator_resets();
    if (!initialise_tuner()) {
        _stage = Stage::IDLE;
        return;
    }
    _stage = Stage::SETTLE;
    GCS_SEND_TEXT(MAV_SEVERITY_INFO, "onecycle: test of %s", axis_name());
}

bool AC_CustomControl_Onecycle::initialise_tuner()
{
    onecycle_settings settings = onecycle_settings_default(amplitude(), _dt);
    settings.noise_sigma = NOISE_RAD;
    settings.slices = SLICES_IN_LOOP;
    settings.bias_filter_s = MEAN_TIME_S;
    settings.integral_phase_rad = INTEGRAL_PHASE_RAD;
    settings.limit_excursion = radians(_angle_max_deg);
    settings.limit_rate = radians(_rate_max_degs);
    settings.limit_duration_s = _time_max_s;
    settings.limit_no_switch_s = _axis == 2 ? 3.0f : 1.5f;
    settings.limit_stale_s = MAX(0.05f, 8.0f * _dt);
    settings.output_lowest = -1.0f;
    settings.output_highest = 1.0f;
    settings.consent = _consent == Consent::NEVER ? ONECYCLE_CONSENT_NEVER : ONECYCLE_CONSENT_AUTOMATIC;

    WITH_SEMAPHORE(_sem);
    const onecycle_status status = _is_paper ? onecycle_tuner_init(&_tuner, &settings)
                                   : onecycle_tuner_init_with_pack(&_tuner, &settings, MARGIN_35_PACK, sizeof(MARGIN_35_PACK));
    if (status != ONECYCLE_STATUS_OK) {
        GCS_SEND_TEXT(MAV_SEVERITY_WARNING, "onecycle: a CC3_ parameter is out of range (status %d)", int(status));
        return false;
    }
    return true;
}

// Angle and rate as the rate loop sees them. Integrated from the filtered gyro, the angle would have an error that is neither white
// nor a random walk. So the gyro is integrated before its filter, and the angle delayed by as much as the filter delays the rate.
// The samples in a tick are not always as many: the angle is interpolated at their time.
void AC_CustomControl_Onecycle::measure()
{
    const float now_s = (AP_HAL::micros64() - _started_us) * 1.0e-6f;
    Sample next = _samples[_newest];
    Vector3f turn_rad;
    float interval_s;
    if (AP::ins().get_delta_angle(turn_rad, interval_s)) {
        next.angle_rad += turn_rad[_axis] + AP::ahrs().get_gyro_drift()[_axis] * interval_s;
        next.time_s += interval_s;
    }
    // the clock of the gyro may run a little slow
    next.time_s += _dt / CLOCK_TIME_S * (now_s - next.time_s);
    _newest = (_newest + 1) % NUM_SAMPLES;
    _samples[_newest] = next;

    // a Butterworth filter of second order delays slow signals by sqrt(2) over its corner
    const float corner_hz = AP::ins().get_gyro_filter_hz();
    const float delay_s = is_positive(corner_hz) ? M_SQRT2 / (M_2PI * corner_hz) : 0.0f;
    const float delayed_rad = angle_at(now_s - constrain_float(delay_s, LEAST_DELAY_TICKS * _dt, (NUM_SAMPLES - 4) * _dt));

    // the rate loop's own filter of the error is part of the process: yaw is tuned with it
    AC_PID &pid = rate_pid(_axis);
    const float share = is_positive(pid.filt_E_hz()) ? pid.get_filt_E_alpha(_dt) : 1.0f;
    _angle_rad += share * (delayed_rad - _angle_rad);
    _rate_rads += share * (_ahrs->get_gyro_latest()[_axis] - _rate_rads);

    // The relay switches at ticks, so that no two cycles are alike, by more than the noise of the gyro. The pack takes a cycle as
    // periodic within its noise: the value is as uncertain as its time.
    _rate_square += _dt / RATE_TIME_S * (sq(_rate_rads) - _rate_square);
    _value_rad = _angle_rad + DITHER_TICKS * _dt * sqrtf(_rate_square) * rand_float();
}

float AC_CustomControl_Onecycle::angle_at(float time_s) const
{
    Sample after = _samples[_newest];
    for (uint8_t back = 1; back < NUM_SAMPLES; back++) {
        const Sample &before = _samples[(_newest + NUM_SAMPLES - back) % NUM_SAMPLES];
        if (before.time_s <= time_s && before.time_s < after.time_s) {
            return before.angle_rad + (time_s - before.time_s) / (after.time_s - before.time_s) * (after.angle_rad - before.angle_rad);
        }
        after = before;
    }
    return after.angle_rad;
}

// one tick of the test; returns the motor input of the axis
float AC_CustomControl_Onecycle::test(float command)
{
    if (_stage == Stage::SETTLE && AP_HAL::millis() - _settled_from_ms >= SETTLE_MS) {
        _stage = Stage::TEST;
        onecycle_tuner_start(&_tuner);
    }
    const onecycle_measurement measurement {_value_rad, _rate_rads, 0.0f, true};
    onecycle_tuner_beside(&_tuner, command);
    const float output = onecycle_tuner_step(&_tuner, AP_HAL::micros64() * 1.0e-6, &measurement, _value_rad);
    const bool was_in_charge = _in_charge != 0;
    _in_charge = onecycle_tuner_is_in_charge(&_tuner) ? 1U << _axis : 0;
    const onecycle_phase phase = onecycle_tuner_phase(&_tuner);
    _has_work = phase == ONECYCLE_PHASE_IDENTIFY;
    if (was_in_charge && _in_charge == 0) {
        hand_back();
    }
    log_tick(command, output);
    if (_stage == Stage::TEST && is_finished(phase)) {
        next_axis();
    }
    return output;
}

// whether the axis has gains; ends the test if there will be none
bool AC_CustomControl_Onecycle::is_finished(enum onecycle_phase phase)
{
    onecycle_result result {};
    switch (phase) {
    case ONECYCLE_PHASE_ABORTED:
        switch (onecycle_tuner_reason(&_tuner)) {
        case ONECYCLE_REASON_NO_OSCILLATION:
        case ONECYCLE_REASON_DURATION:
            finish(_axis == 2 ? "no steady oscillation: raise CC3_AMP_Y" : "no steady oscillation: raise CC3_AMP_RP");
            break;
        default:
            finish(onecycle_tuner_reason_text(&_tuner));
        }
        return false;
    case ONECYCLE_PHASE_PROPOSED:
        break;
    case ONECYCLE_PHASE_CONTROL:
        if (!onecycle_tuner_result(&_tuner, &result) || !result.is_proven) {
            return false;
        }
        break;
    default:
        return false;
    }
    const bool proposed = propose();
    if (_in_charge != 0) {
        _in_charge = 0;
        hand_back();
    }
    if (!proposed) {
        finish("gains out of range");
    }
    return proposed;
}

const char *AC_CustomControl_Onecycle::reason_to_stop()
{
    for (uint8_t axis = 0; axis < NUM_AXES; axis++) {
        if (fabsf(stick(axis).norm_input_dz()) > STICK_MAX) {
            return "stick moved";
        }
    }
    if (AP::vehicle()->get_mode() != _mode) {
        return "flight mode changed";
    }
    if (estimator_resets() != _resets) {
        return "the estimator was reset";
    }
    const Vector3f attitude_rad {_ahrs->roll, _ahrs->pitch, _ahrs->yaw};
    if (fabsf(wrap_PI(attitude_rad[_axis] - _attitude_rad[_axis])) > 1.5f * radians(_angle_max_deg)) {
        return "attitude too far from the start";
    }
    const bool limited = _axis == 0 ? _motors->limit.roll : _axis == 1 ? _motors->limit.pitch : _motors->limit.yaw;
    if (_in_charge != 0 && limited && ++_limited > LIMITED_TICKS) {
        return _axis == 2 ? "motors at their limit: lower CC3_AMP_Y" : "motors at their limit: lower CC3_AMP_RP";
    }
    return nullptr;
}

// end the test: the main controller with its old gains holds the axis from the next tick on
void AC_CustomControl_Onecycle::finish(const char *reason)
{
    if (_stage == Stage::SETTLE || _stage == Stage::TEST) {
        onecycle_tuner_abort(&_tuner);
        GCS_SEND_TEXT(MAV_SEVERITY_WARNING, "onecycle: %s: %s", axis_name(), reason);
        GCS_SEND_TEXT(MAV_SEVERITY_WARNING, "onecycle: old gains in force");
    }
    _has_work = false;
    if (_in_charge != 0) {
        _in_charge = 0;
        hand_back();
    }
    _axes_left = 0;
    bool has_any = false;
    for (const Axis &axis : _axes) {
        has_any |= axis.has_proposal;
    }
    _stage = has_any ? Stage::PROPOSED : Stage::IDLE;
}

// the main controller goes on from the mean command before the test
void AC_CustomControl_Onecycle::hand_back()
{
    rate_pid(_axis).set_integrator(onecycle_tuner_usual(&_tuner));
    rate_pid(_axis).reset_filter();
}

float AC_CustomControl_Onecycle::main_command(uint8_t axis) const
{
    return axis == 0 ? _motors->get_roll() : axis == 1 ? _motors->get_pitch() : _motors->get_yaw();
}

// changes with each reset of the attitude: another lane, or a jump of the heading
uint32_t AC_CustomControl_Onecycle::estimator_resets() const
{
    float jump_rad;
    return AP::ahrs().getLastYawResetAngle(jump_rad) + uint32_t(AP::ahrs().get_primary_core_index());
}

AC_PID &AC_CustomControl_Onecycle::rate_pid(uint8_t axis)
{
    return axis == 0 ? _att_control->get_rate_roll_pid() : axis == 1 ? _att_control->get_rate_pitch_pid() : _att_control->get_rate_yaw_pid();
}

AC_P &AC_CustomControl_Onecycle::angle_p(uint8_t axis)
{
    return axis == 0 ? _att_control->get_angle_roll_p() : axis == 1 ? _att_control->get_angle_pitch_p() : _att_control->get_angle_yaw_p();
}

RC_Channel &AC_CustomControl_Onecycle::stick(uint8_t axis) const
{
    return axis == 0 ? rc().get_roll_channel() : axis == 1 ? rc().get_pitch_channel() : rc().get_yaw_channel();
}

const char *AC_CustomControl_Onecycle::axis_name() const
{
    return _axis == 0 ? "roll" : _axis == 1 ? "pitch" : "yaw";
}

float AC_CustomControl_Onecycle::amplitude() const
{
    return _axis == 2 ? _amplitude_yaw : _amplitude_rp;
}

bool AC_CustomControl_Onecycle::start_thread()
{
    _has_thread = hal.scheduler->thread_create(FUNCTOR_BIND_MEMBER(&AC_CustomControl_Onecycle::work, void), "onecycle", 12288, AP_HAL::Scheduler::PRIORITY_IO, -1);
    return _has_thread;
}

// the identification, in turns of some slices; asleep while there is nothing to do
void AC_CustomControl_Onecycle::work()
{
    while (true) {
        hal.scheduler->delay_microseconds(_has_work ? 500 : 5000);
        if (_has_work) {
            WITH_SEMAPHORE(_sem);
            onecycle_tuner_work(&_tuner, SLICES);
        }
    }
}

void AC_CustomControl_Onecycle::log_tick(float command, float output) const
{
    // @LoggerMessage: OCT
    // @Description: relay test of one axis
    // @Field: TimeUS: Time since system startup
    // @Field: Ax: axis, 0 roll, 1 pitch, 2 yaw
    // @Field: Ph: phase of the tuner
    // @Field: Cmd: motor input of the main controller
    // @Field: U: motor input in force
    // @Field: Y: angle of the tuner, delayed
    // @Field: R: rate of the tuner
    // @Field: E: estimated angle less that of the start
    const Vector3f attitude_rad {_ahrs->roll, _ahrs->pitch, _ahrs->yaw};
    AP::logger().WriteStreaming("OCT", "TimeUS,Ax,Ph,Cmd,U,Y,R,E", "QBBfffff",
                                AP_HAL::micros64(), _axis, uint8_t(onecycle_tuner_phase(&_tuner)),
                                command, output, _value_rad, _rate_rads, wrap_PI(attitude_rad[_axis] - _attitude_rad[_axis]));
}

#endif  // AP_CUSTOMCONTROL_ONECYCLE_ENABLED
