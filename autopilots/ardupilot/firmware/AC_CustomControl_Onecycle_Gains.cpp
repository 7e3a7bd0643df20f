#include "AC_CustomControl_config.h"

#if AP_CUSTOMCONTROL_ONECYCLE_ENABLED

#include "AC_CustomControl_Onecycle.h"

#include <AP_Logger/AP_Logger.h>
#include <GCS_MAVLink/GCS.h>

// gains outside of these bounds are not used
static constexpr float ANGLE_P_MIN = 1.0f;
static constexpr float ANGLE_P_MAX = 60.0f;
static constexpr float RATE_P_MIN = 0.005f;
static constexpr float RATE_P_MAX = 2.5f;

// the tuner's PD and integral in the cascade of the main controller:
//   u = P (A (r - y) - y') + I integral(A (r - y) - y'),  kp = A P + I,  ki = A I,  kd = P
bool AC_CustomControl_Onecycle::propose()
{
    onecycle_result result {};
    if (!onecycle_tuner_result(&_tuner, &result)) {
        return false;
    }
    Axis &axis = _axes[_axis];
    axis.old_gains = get_gains(_axis);
    Gains &gains = axis.new_gains;
    gains = axis.old_gains;
    gains.rate_p = result.kd;
    gains.rate_d = 0.0f;
    const float root = sqrtf(MAX(0.0f, sq(result.kp) - 4.0 * result.ki * result.kd));
    gains.angle_p = (result.kp + root) / (2.0 * result.kd);
    gains.rate_i = result.ki / gains.angle_p;
    gains.filter_target_hz = 0.0f;
    const bool is_within = gains.angle_p >= ANGLE_P_MIN && gains.angle_p <= ANGLE_P_MAX && gains.rate_p >= RATE_P_MIN && gains.rate_p <= RATE_P_MAX;
    AP::logger().Write("OCG", "TimeUS,Ax,K,Tp,Tau,Kp,Ki,Kd,PM,AngP,Proven", "QBfffffffff",
                       AP_HAL::micros64(), _axis, result.k_over_t_body, result.t_prop_s, result.tau_s,
                       result.kp, result.ki, result.kd, degrees(result.phase_margin_rad), gains.angle_p, float(result.is_proven));
    GCS_SEND_TEXT(MAV_SEVERITY_NOTICE, "onecycle: %s angle P %.1f rate P %.3f I %.3f", axis_name(), gains.angle_p, gains.rate_p, gains.rate_i);
    axis.has_proposal = is_within && _consent != Consent::NEVER;
    return is_within;
}

void AC_CustomControl_Onecycle::put_in_force()
{
    uint8_t count = 0;
    for (uint8_t axis = 0; axis < NUM_AXES; axis++) {
        if (_axes[axis].has_proposal) {
            set_gains(axis, _axes[axis].new_gains);
            count++;
        }
    }
    if (count == 0) {
        GCS_SEND_TEXT(MAV_SEVERITY_WARNING, "onecycle: no gains to put in force");
        return;
    }
    _stage = Stage::IN_FORCE;
    GCS_SEND_TEXT(MAV_SEVERITY_NOTICE, "onecycle: new gains (%u axes), saved at disarm", unsigned(count));
}

void AC_CustomControl_Onecycle::restore()
{
    if (_stage != Stage::IN_FORCE) {
        return;
    }
    for (uint8_t axis = 0; axis < NUM_AXES; axis++) {
        if (_axes[axis].has_proposal) {
            set_gains(axis, _axes[axis].old_gains);
        }
    }
    GCS_SEND_TEXT(MAV_SEVERITY_NOTICE, "onecycle: old gains restored");
}

void AC_CustomControl_Onecycle::save()
{
    for (uint8_t axis = 0; axis < NUM_AXES; axis++) {
        if (!_axes[axis].has_proposal) {
            continue;
        }
        AC_PID &pid = rate_pid(axis);
        angle_p(axis).kP().save();
        pid.kP().save();
        pid.kI().save();
        pid.kD().save();
        pid.filt_T_hz().save();
        _axes[axis].has_proposal = false;
    }
    GCS_SEND_TEXT(MAV_SEVERITY_NOTICE, "onecycle: gains saved");
}

AC_CustomControl_Onecycle::Gains AC_CustomControl_Onecycle::get_gains(uint8_t axis)
{
    AC_PID &pid = rate_pid(axis);
    return {angle_p(axis).kP(), pid.kP(), pid.kI(), pid.kD(), pid.filt_T_hz()};
}

void AC_CustomControl_Onecycle::set_gains(uint8_t axis, const Gains &gains)
{
    AC_PID &pid = rate_pid(axis);
    angle_p(axis).kP().set(gains.angle_p);
    pid.kP().set(gains.rate_p);
    pid.kI().set(gains.rate_i);
    pid.kD().set(gains.rate_d);
    pid.filt_T_hz().set(gains.filter_target_hz);
}

#endif  // AP_CUSTOMCONTROL_ONECYCLE_ENABLED
