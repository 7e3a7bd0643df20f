#pragma once

/// @file    AC_CustomControl_Onecycle.h
/// @brief   relay test, identification and gains for one axis after the other

#include "AC_CustomControl_config.h"

#if AP_CUSTOMCONTROL_ONECYCLE_ENABLED

#include <AP_HAL/Semaphores.h>
#include <RC_Channel/RC_Channel.h>

#include "AC_CustomControl_Backend.h"
#include "onecycle.h"

class AC_CustomControl_Onecycle : public AC_CustomControl_Backend
{
public:
    AC_CustomControl_Onecycle(AC_CustomControl& frontend, AP_AHRS_View*& ahrs, AC_AttitudeControl*& att_control, AP_MotorsMulticopter*& motors, float dt);

    // run the test; the output counts only for the axes in charge
    Vector3f update() override;

    // end a test and hand the axis back
    void reset() override;

    // bits of the axes whose motor input this controller sets at this moment
    uint8_t axes_in_charge() const override { return _in_charge; }

    // switch low: end the test, old gains; middle: test; high: new gains, saved at disarm.
    // Returns whether update() has to run
    bool aux_switch(RC_Channel::AuxSwitchPos position, uint8_t axis_mask) override;

    static const struct AP_Param::GroupInfo var_info[];

private:
    static constexpr uint8_t NUM_AXES = 3;
    static constexpr uint8_t NUM_SAMPLES = 32;

    enum class Stage : uint8_t {
        IDLE = 0,       // nothing runs
        SETTLE = 1,     // the main controller flies, its command is measured
        TEST = 2,       // the tuner works
        PROPOSED = 3,   // gains are known, the old ones are in force
        IN_FORCE = 4,   // new gains are in force and not yet saved
    };

    enum class Consent : uint8_t {
        ASK = 0,        // new gains are in force when the switch goes high
        NEVER = 1,      // gains are only reported; the new controller does not fly
        AUTOMATIC = 2,  // new gains are in force at the end of the test
    };

    // gains of one axis in the parameters of the main controller
    struct Gains {
        float angle_p;
        float rate_p;
        float rate_i;
        float rate_d;
        float filter_target_hz;
    };

    struct Sample {
        float time_s;
        float angle_rad;
    };

    struct Axis {
        Gains old_gains;
        Gains new_gains;
        bool has_proposal;
    };

    // stages
    void begin(uint8_t axis_mask);
    bool is_ready(uint8_t axis_mask);
    void begin_axis();
    void next_axis();
    bool initialise_tuner();
    void settle(uint32_t now_ms);
    float test(float command);
    bool is_finished(enum onecycle_phase phase);
    void finish(const char *reason);

    // reasons to end a test, or nullptr
    const char *reason_to_stop();

    // gains
    bool propose();
    void put_in_force();
    void restore();
    void save();
    Gains get_gains(uint8_t axis);
    void set_gains(uint8_t axis, const Gains &gains);

    // access to one axis
    void measure();
    float angle_at(float time_s) const;
    float main_command(uint8_t axis) const;
    uint32_t estimator_resets() const;
    void hand_back();
    AC_PID &rate_pid(uint8_t axis);
    AC_P &angle_p(uint8_t axis);
    RC_Channel &stick(uint8_t axis) const;
    const char *axis_name() const;
    float amplitude() const;

    // identification, in a thread of its own
    bool start_thread();
    void work();

    void log_tick(float command, float output) const;

    // parameters
    AP_Float _amplitude_rp;
    AP_Float _amplitude_yaw;
    AP_Float _angle_max_deg;
    AP_Float _rate_max_degs;
    AP_Float _time_max_s;
    AP_Enum<Consent> _consent;
    AP_Int8 _is_paper;

    float _dt;
    Stage _stage;
    uint8_t _axis;              // axis under test: 0 roll, 1 pitch, 2 yaw
    uint8_t _axes_left;         // bits of the axes to be tested after it
    uint8_t _in_charge;         // bits of the axes with the tuner's output
    uint8_t _mode;              // flight mode at the start
    uint32_t _settled_from_ms;
    uint16_t _limited;          // ticks of the relay with saturated motors
    Sample _samples[NUM_SAMPLES];  // the last integrals of the gyro
    uint8_t _newest;            // index of the last
    uint64_t _started_us;       // their time is zero here
    float _angle_rad;           // angle and rate as the rate loop sees them
    float _rate_rads;
    float _rate_square;         // its mean square
    float _value_rad;           // the angle, as uncertain as its time
    uint32_t _resets;           // of the estimator, at the start
    Vector3f _attitude_rad;     // attitude at the start
    Axis _axes[NUM_AXES];

    onecycle_tuner _tuner;
    HAL_Semaphore _sem;         // the tuner is not initialised while the thread works on it
    bool _has_thread;
    bool _has_work;
};

#endif  // AP_CUSTOMCONTROL_ONECYCLE_ENABLED
