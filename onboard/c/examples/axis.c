/* Tunes one simulated axis: the altitude of a quadrotor under a poor controller, with a noisy sensor and a small
 * error of the assumed hover thrust.
 *
 *     cc -std=c99 -O2 -ffp-contract=off axis.c libonecycle.a -o axis && ./axis
 *
 * With an argument it also writes the bits of the output of every tick to standard output, one line each.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "../onecycle.h"

#define TICK_S 0.001
#define DELAY_TICKS 24

/* K/T_body (1/s^2), T_prop (s), 1/T_body (1/s): the paper's altitude, thrust as a part of hover. */
static const double gain = 9.81, lag_s = 0.0321, damping_per_s = 0.5922;

struct axis {
    double value, rate, force;
    double delayed[DELAY_TICKS];
    unsigned tick;
};

/* Semi-implicit Euler in tenths of a tick: good to a part in a thousand here. */
static void push(struct axis *axis, double input)
{
    double *slot = &axis->delayed[axis->tick++ % DELAY_TICKS];
    double late = *slot - 0.01;
    *slot = input;
    for (int part = 0; part < 10; part++) {
        double step_s = TICK_S / 10.0;
        axis->force += step_s / lag_s * (late - axis->force);
        axis->rate += step_s * (gain * axis->force - damping_per_s * axis->rate);
        axis->value += step_s * axis->rate;
    }
}

/* Knuth's generator, MMIX; the sum of four uniform numbers is normal enough here. */
static double noise(void)
{
    static uint64_t state = 1;
    double sum = 0.0;
    for (int i = 0; i < 4; i++) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        sum += (double)(state >> 40) / 16777216.0 - 0.5;
    }
    return sum;
}

int main(int count, char **arguments)
{
    static onecycle_tuner tuner;
    (void)arguments;

    onecycle_settings settings = onecycle_settings_default(0.05f, (float)TICK_S);
    settings.noise_sigma = 0.0001f;
    settings.limit_excursion = 0.5f;
    settings.limit_rate = 2.0f;
    settings.limit_duration_s = 20.0f;
    settings.limit_no_switch_s = 3.0f;
    settings.limit_stale_s = 0.01f;
    settings.output_lowest = -0.5f;
    settings.output_highest = 0.5f;
    settings.safe_kp = 0.3f;
    settings.safe_kd = 0.3f;
    settings.slices = 1;
    settings.bias_filter_s = 1.0f;
    settings.consent = ONECYCLE_CONSENT_AUTOMATIC; /* nobody is there to accept */
    onecycle_status status = onecycle_tuner_init(&tuner, &settings);
    if (status != ONECYCLE_STATUS_OK) {
        fprintf(stderr, "settings rejected: status %d\n", (int)status);
        return 1;
    }

    struct axis axis = {0};
    for (unsigned tick = 0; tick < 20000; tick++) {
        double time_s = tick * TICK_S;
        onecycle_measurement measurement = {
            .value = (float)(axis.value + 0.0001 * noise()), .rate = (float)axis.rate, .has_rate = true};
        float reference = time_s < 18.0 ? 0.0f : 0.1f;
        if (tick == 5000)
            onecycle_tuner_start(&tuner);
        float output = onecycle_tuner_step(&tuner, time_s, &measurement, reference);
        if (count > 1) {
            uint32_t bits;
            memcpy(&bits, &output, sizeof bits);
            printf("%lu\n", (unsigned long)bits);
        }
        push(&axis, output);
    }

    onecycle_result result;
    if (!onecycle_tuner_result(&tuner, &result) || !result.is_proven) {
        fprintf(stderr, "no controller found: phase %d, %s\n", (int)onecycle_tuner_phase(&tuner),
                onecycle_tuner_reason_text(&tuner));
        return 1;
    }
    fprintf(stderr, "K/T_body %.3f (true %.3f), T_prop %.1f ms (%.1f), dead time %.1f ms (%.1f)\n",
            result.k_over_t_body, gain, 1e3 * result.t_prop_s, 1e3 * lag_s, 1e3 * result.tau_s,
            1e3 * DELAY_TICKS * TICK_S);
    fprintf(stderr, "Kp %.2f, Kd %.3f, phase margin %.1f +/- %.1f degrees; 2 s after a step of 0.1: %.4f\n",
            result.kp, result.kd, 57.29578 * result.phase_margin_rad,
            57.29578 * result.phase_margin_deviation_rad, axis.value);
    return fabs(result.k_over_t_body / gain - 1.0) < 0.05 && fabs(axis.value - 0.1) < 0.01 ? 0 : 1;
}
