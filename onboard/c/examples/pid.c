/* The PID law by itself: a mass under gravity, held by an old controller, is taken over without a bump, carries an
 * unknown load, and climbs a step with limited force.
 *
 *     cc -std=c99 -O2 pid.c libonecycle.a -o pid && ./pid
 */
#include <math.h>
#include <stdio.h>

#include "../onecycle.h"

#define TICK_S 0.0025f

int main(void)
{
    static onecycle_pid pid;
    onecycle_pid_settings settings = onecycle_pid_settings_default(20.0f, 15.0f, 8.0f);
    settings.filter_s = 0.01f;
    settings.setpoint_weight = 0.7f;
    settings.output_lowest = 0.0f;
    settings.output_highest = 12.0f;
    if (onecycle_pid_init(&pid, &settings) != ONECYCLE_STATUS_OK)
        return 1;

    /* The old controller holds the mass at 1 m with 9 N. */
    double height = 1.0, climb = 0.0, largest_change = 0.0, highest = 0.0;
    onecycle_measurement measurement = {.value = 1.0f};
    float last = 9.0f;
    onecycle_pid_take_over(&pid, &measurement, 1.0f, last);
    unsigned limited = 0;
    for (unsigned tick = 0; tick < 6000; tick++) {
        /* The load of 0.8 N after 2.5 s, the step after 7.5 s; one sample is lost. */
        double load = tick < 1000 ? 9.0 : 9.8;
        float reference = tick < 3000 ? 1.0f : 2.0f;
        measurement.value = tick == 500 ? NAN : (float)height;
        float force = onecycle_pid_step(&pid, TICK_S, &measurement, reference);
        onecycle_pid_output said = onecycle_pid_status(&pid);
        if ((said == ONECYCLE_PID_OUTPUT_HELD) != (tick == 500) || force < 0.0f || force > 12.0f)
            return 2;
        limited += said == ONECYCLE_PID_OUTPUT_AT_HIGHEST;
        if (tick < 1000)
            largest_change = fmax(largest_change, fabs((double)force - (double)last));
        last = force;
        climb += (double)TICK_S * ((double)force - load);
        height += (double)TICK_S * climb;
        highest = fmax(highest, height);
    }
    double found = (double)onecycle_pid_integral(&pid);
    fprintf(stderr, "PID by itself: bump %.1e N, height %.4f m, highest %.3f m, force at rest %.3f N, %u ticks limited\n",
            largest_change, height, highest, (double)last, limited);
    /* The set-point weight keeps 0.3 kp of the step in the integral. */
    int is_right = largest_change < 1e-3 && fabs(height - 2.0) < 1e-3 && highest < 2.15 &&
                   fabs((double)last - 9.8) < 1e-2 && limited > 0 && fabs(found - (9.8 + 0.3 * 20.0)) < 2e-2;
    return is_right ? 0 : 3;
}
