/* The onecycle tuner for firmware: one relay test in flight, from the oscillation to the controller.
 *
 * Generated from src/lib.rs by cbindgen; do not edit. The caller owns all memory, there is no heap, no
 * global and no operating system behind any of this. One tuner serves one axis; two may run side by side.
 * Functions accept null pointers and memory that was never initialised: they say so and do nothing. */

#ifndef ONECYCLE_H
#define ONECYCLE_H

#include <stdbool.h>
#include <stdint.h>

// Memory of a tuner, in words of eight bytes: what it takes on 64-bit machines, the largest.
#define ONECYCLE_TUNER_WORDS 2560

// Whether there is a tuner, or what is wrong with its settings.
typedef enum onecycle_status {
  // There is.
  ONECYCLE_STATUS_OK,
  // A pointer is null.
  ONECYCLE_STATUS_NULL,
  // The relay's amplitude is not positive.
  ONECYCLE_STATUS_RELAY_AMPLITUDE,
  // beta is not between -1 and 1.
  ONECYCLE_STATUS_RELAY_BETA,
  // The asymmetry is not between 0 and 1.
  ONECYCLE_STATUS_RELAY_ASYMMETRY,
  // Another number of the relay is negative or not finite.
  ONECYCLE_STATUS_RELAY_SETTING,
  // A time, a gain or a limit that must be positive is not.
  ONECYCLE_STATUS_SETTING,
  // The cycles are not 1 to 4.
  ONECYCLE_STATUS_CYCLES,
  // There are no attempts, or no slices.
  ONECYCLE_STATUS_NO_WORK,
  // The least output is not below the largest.
  ONECYCLE_STATUS_OUTPUT_LIMITS,
  // The safe controller has a number that is not finite.
  ONECYCLE_STATUS_SAFE,
  // The data that is built in cannot be read: the build is broken.
  ONECYCLE_STATUS_PACK,
} onecycle_status;

// What a tuner is doing.
typedef enum onecycle_phase {
  // There is no tuner in this memory.
  ONECYCLE_PHASE_NONE,
  // Nothing yet: the safe controller.
  ONECYCLE_PHASE_IDLE,
  // Lifting the vehicle from the ground.
  ONECYCLE_PHASE_TAKE_OFF,
  // Exciting the oscillation.
  ONECYCLE_PHASE_RELAY,
  // Finding process and controller from it while it goes on.
  ONECYCLE_PHASE_IDENTIFY,
  // Flying the controller that was found.
  ONECYCLE_PHASE_CONTROL,
  // The test has ended in the safe controller.
  ONECYCLE_PHASE_ABORTED,
} onecycle_phase;

// Why a test was aborted.
typedef enum onecycle_reason {
  // It was not.
  ONECYCLE_REASON_NONE,
  // The operator said so.
  ONECYCLE_REASON_OPERATOR,
  // A time, a reference or a measurement that is no finite number.
  ONECYCLE_REASON_NOT_FINITE,
  // A sample too old, ticks too far apart, or time that does not go on.
  ONECYCLE_REASON_STALE,
  // The output was too far from the reference.
  ONECYCLE_REASON_EXCURSION,
  // The output moved too fast.
  ONECYCLE_REASON_RATE,
  // The test took too long.
  ONECYCLE_REASON_DURATION,
  // The relay did not switch for too long.
  ONECYCLE_REASON_NO_OSCILLATION,
  // No cycle that was looked at led to a controller.
  ONECYCLE_REASON_REFUSED,
  // The response under the new gains was not the predicted one.
  ONECYCLE_REASON_MISMATCH,
} onecycle_reason;

// How an axis is tuned; start from onecycle_settings_default.
typedef struct onecycle_settings {
  // Half the jump of the relay's output (input unit).
  float amplitude;
  // Sine of the phase of the oscillation, between -1 and 1.
  float beta;
  // Time for which the noise is measured with zero relay output (s); 0 starts at once.
  float preroll_s;
  // Noise of the measurement, or its least value when there is a pre-roll (output unit).
  float noise_sigma;
  // Share of the measured bias that the trim takes up each cycle; 0 switches it off.
  float trim_gain;
  // What the trim leaves between the parts of a cycle with the relay high and low.
  float asymmetry;
  // Time between ticks (s).
  float sample_s;
  // Cycles that are used together, 1 to 4.
  uint8_t cycles;
  // Looks at cycles that may be refused before the test ends.
  uint8_t attempts;
  // Slices of the identification in a tick, each of up to 2,700 operations in double precision; 1 where
  // those are emulated.
  uint16_t slices;
  // Whether the test begins with a take-off from the ground.
  bool take_off;
  // Gain of the take-off's integrator (input unit / (output unit s)).
  float take_off_gain;
  // Rate of the output above which that integrator waits (output unit / s).
  float take_off_climb;
  // Largest distance of the output from the reference (output unit); INFINITY for none.
  float limit_excursion;
  // Largest rate of the output (output unit / s); INFINITY for none.
  float limit_rate;
  // Longest test (s); INFINITY for none.
  float limit_duration_s;
  // Longest time without a switch of the relay (s); INFINITY for none.
  float limit_no_switch_s;
  // Oldest sample and longest time between ticks (s); INFINITY for none.
  float limit_stale_s;
  // Least output (input unit).
  float output_lowest;
  // Largest output (input unit).
  float output_highest;
  // Proportional gain of the safe controller (input unit / output unit).
  float safe_kp;
  // Derivative gain of the safe controller (input unit s / output unit).
  float safe_kd;
  // Output of the safe controller at rest (input unit).
  float safe_offset;
  // Time constant of the means under the safe controller, of its output, which the relay is offset by, and
  // of the process's, which it oscillates about (s); 0 for none.
  float bias_filter_s;
  // Lag of a rate that is found from differences (s).
  float rate_lag_s;
} onecycle_settings;

// Memory for one tuner: static, or wherever the caller has room. Its contents are no business of the
// caller's.
typedef struct onecycle_tuner {
  // The tuner.
  uint64_t memory[ONECYCLE_TUNER_WORDS];
} onecycle_tuner;

// What the sensor says at a tick.
typedef struct onecycle_measurement {
  // The output (output unit).
  float value;
  // Its rate, where has_rate (output unit / s).
  float rate;
  // How old both are (s).
  float age_s;
  // Whether the rate is measured; otherwise it is found from differences.
  bool has_rate;
} onecycle_measurement;

// What the test has told.
typedef struct onecycle_result {
  // Acceleration gain K/T_body (output unit / (input unit s^2)).
  double k_over_t_body;
  // Lag of the actuator (s).
  double t_prop_s;
  // Damping rate of the body, 1/T_body (1/s); zero for a double integrator.
  double inv_t_body_per_s;
  // Dead time (s).
  double tau_s;
  // Standard deviation of ln(K/T_body): relative.
  double k_over_t_body_deviation;
  // Standard deviation of T_prop (s).
  double t_prop_deviation_s;
  // Standard deviation of 1/T_body (1/s).
  double inv_t_body_deviation_per_s;
  // Standard deviation of the dead time (s).
  double tau_deviation_s;
  // Proportional gain of the controller (input unit / output unit).
  double kp;
  // Derivative gain, on the measurement (input unit s / output unit).
  double kd;
  // Input that holds the process at rest, the controller's offset (input unit).
  double offset;
  // Phase margin (rad).
  double phase_margin_rad;
  // Standard deviation of the phase margin (rad).
  double phase_margin_deviation_rad;
  // Period of the oscillation (s).
  double period_s;
  // Amplitude of the oscillation (output unit).
  double amplitude;
  // Noise on a sample (output unit).
  double noise_sigma;
  // How badly the family of processes explains the last cycle; one is the limit.
  double score;
  // Whether the controller is in force and its response was as predicted.
  bool is_proven;
} onecycle_result;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Settings to start from: a noise-protected relay of this amplitude (input unit) at the distinguishing
// phase with trim, ticks every sample_s (s), two cycles; no take-off, no limits, nothing safe but zero.
struct onecycle_settings onecycle_settings_default(float amplitude,
                                                   float sample_s);

// Makes the memory a tuner with these settings; anything but ONECYCLE_STATUS_OK names what is wrong
// with them, and there is no tuner.
//
// # Safety
// Both pointers are null or point to what they say.
enum onecycle_status onecycle_tuner_init(struct onecycle_tuner *tuner,
                                         const struct onecycle_settings *settings);

// One tick: time (s), measurement, where the output should be (output unit). Returns the input to hold
// until the next tick (input unit), finite and within the limits; zero where there is no tuner.
//
// # Safety
// Both pointers are null or point to what they say.
float onecycle_tuner_step(struct onecycle_tuner *tuner,
                          double time_s,
                          const struct onecycle_measurement *measurement,
                          float reference);

// Begins the test at the next tick; only when idle.
//
// # Safety
// The pointer is null or points to a tuner's memory.
void onecycle_tuner_start(struct onecycle_tuner *tuner);

// The operator ends the test, or the controller that came of it; the next tick's output is safe.
//
// # Safety
// The pointer is null or points to a tuner's memory.
void onecycle_tuner_abort(struct onecycle_tuner *tuner);

// Ready for another test, all that was learned forgotten; only when aborted or in control.
//
// # Safety
// The pointer is null or points to a tuner's memory.
void onecycle_tuner_reset(struct onecycle_tuner *tuner);

// What the tuner is doing.
//
// # Safety
// The pointer is null or points to a tuner's memory.
enum onecycle_phase onecycle_tuner_phase(const struct onecycle_tuner *tuner);

// Why the test was aborted.
//
// # Safety
// The pointer is null or points to a tuner's memory.
enum onecycle_reason onecycle_tuner_reason(const struct onecycle_tuner *tuner);

// What the test has told, into result; false, and nothing written, where it has not told anything yet.
//
// # Safety
// Both pointers are null or point to what they say.
bool onecycle_tuner_result(const struct onecycle_tuner *tuner,
                           struct onecycle_result *result);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ONECYCLE_H */
