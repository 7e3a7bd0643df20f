//! Exact limit cycles against the Fourier series of the same oscillation, and against simulations of
//! the same loop, event by event.

use std::f64::consts::{PI, TAU};

use onecycle_lab::space::limit_cycle::LimitCycle;
use onecycle_lab::space::limit_cycle::sampled::{Motion, motion, symmetric_cycles};
use onecycle_lab::space::limit_cycle::{limit_cycles, symmetric, trimmed_spectral_radius};
use onecycle_onboard::Soiptd;
use onecycle_plant::VariableStepProcess;

const BETA: f64 = -0.73;

/// T_prop, T_body, tau (s) of the slowest and the fastest processes of the paper's space and of one
/// inside, all with a velocity gain of one.
const PROCESSES: [[f64; 3]; 5] = [
    [0.3, 2.0, 0.1],
    [0.3, 2.0, 0.0005],
    [0.015, 0.2, 0.1],
    [0.015, 0.2, 0.0005],
    [0.0321, 1.6886, 0.0237],
];

fn process([t_prop, t_body, tau]: [f64; 3]) -> Soiptd {
    Soiptd::new(1.0, t_prop, t_body, tau).unwrap()
}

/// Output at a phase of the oscillation by the Fourier series of the square wave, high from phase 0 to
/// pi. Terms fall with the fourth power of the order, so 4,000 of them leave an error of 1e-12.
fn fourier(process: &Soiptd, omega: f64, phase: f64) -> f64 {
    let term = |n: i32| {
        let n = f64::from(n);
        4.0 / (PI * n)
            * process.magnitude(n * omega)
            * (n * phase + process.phase_rad(n * omega)).sin()
    };
    (0..4000).rev().map(|k| term(2 * k + 1)).sum()
}

// The output at the fall is -beta times its minimum since the rise, which is the amplitude. The series
// shares nothing with the exact solution. With and without damping, without dead time, with equal lags,
// with a plain and a lagging relay.
#[test]
fn fourier_series_meets_the_switching_condition() {
    let double = |t_prop, tau| Soiptd::from_acceleration_gain(2.0, t_prop, 0.0, tau).unwrap();
    let cases = PROCESSES
        .map(|times| (process(times), BETA))
        .into_iter()
        .chain([
            (double(0.05, 0.03), BETA),
            (double(0.05, 0.0), -0.3),
            (process([0.2, 0.2, 0.05]), BETA),
            (process([0.3, 2.0, 0.1]), 0.0),
            (process([0.1, 0.5, 0.02]), 0.3),
        ]);
    for (process, beta) in cases {
        let cycle = symmetric(&process, beta).unwrap();
        let omega = TAU / cycle.period_s();
        let mut minimum = (0.0, f64::INFINITY);
        for k in 0..200 {
            let phase = PI * f64::from(k) / 200.0;
            let y = fourier(&process, omega, phase);
            if y < minimum.1 {
                minimum = (phase, y);
            }
        }
        // The error of a parabola through three points near the minimum is the cube of their distance.
        let mut width = PI / 200.0;
        for _ in 0..6 {
            let [left, centre, right] =
                [-width, 0.0, width].map(|d| fourier(&process, omega, minimum.0 + d));
            let shift = 0.5 * (left - right) / (left - 2.0 * centre + right);
            minimum.0 += shift.clamp(-1.0, 1.0) * width;
            width = (0.1 * width).max(1e-3);
        }
        let lowest = fourier(&process, omega, minimum.0);
        let at_fall = fourier(&process, omega, PI);
        let error = (at_fall + beta * lowest) / cycle.amplitude;
        assert!(error.abs() < 1e-10, "{process:?} {beta}: {error}");
        assert!(
            (cycle.amplitude / -lowest - 1.0).abs() < 1e-10,
            "{process:?} {beta}"
        );
        assert!(cycle.centre.abs() < 1e-12 * cycle.amplitude);
    }
}

/// A continuous relay in a loop with the process: steps of `dt`; switches and turning points within a
/// step are located by bisection.
struct Loop {
    plant: VariableStepProcess,
    b: [f64; 2],
    bias: f64,
    trim_gain: f64,
    trim: f64,
    dt: f64,
    sign: f64,
}

impl Loop {
    /// Starts away from rest, because the relay does not switch at rest.
    fn new(process: &Soiptd, beta: [f64; 2], cycle: &LimitCycle) -> Self {
        let mut plant = VariableStepProcess::new(process);
        plant.displace(-0.5 * cycle.amplitude, 0.0);
        Self {
            plant,
            b: beta.map(|beta| -beta),
            bias: 0.0,
            trim_gain: 0.0,
            trim: 0.0,
            dt: cycle.period_s() / 400.0,
            sign: 1.0,
        }
    }

    /// Settles without bias, then raises the bias in small steps up to `bias`; from rest the bare relay
    /// may stop switching.
    fn under(process: &Soiptd, beta: [f64; 2], bias: f64, cycle: &LimitCycle) -> Self {
        let mut simulation = Self::new(process, beta, cycle);
        simulation.cycles(5);
        for step in 1..=40 {
            simulation.bias = bias * f64::from(step) / 40.0;
            simulation.cycles(2);
        }
        simulation
    }

    fn after(&self, duration_s: f64) -> VariableStepProcess {
        let mut plant = self.plant.clone();
        plant.advance(self.sign + self.trim + self.bias, duration_s);
        plant
    }

    /// Time within the step at which `holds` becomes true; it is true at the end of the step.
    fn moment(&self, holds: impl Fn(&VariableStepProcess) -> bool) -> f64 {
        let (mut low, mut high) = (0.0, self.dt);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if holds(&self.after(middle)) {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    }

    /// Time until the next switch (s); infinite if there is none within a hundred periods.
    fn half(&mut self) -> f64 {
        let sign = self.sign;
        let mut extreme = sign * self.plant.output();
        let mut elapsed_s = 0.0;
        while elapsed_s < 4e4 * self.dt {
            let next = self.after(self.dt);
            if sign * self.plant.rate() < 0.0 && sign * next.rate() >= 0.0 {
                let turn_s = self.moment(|plant| sign * plant.rate() >= 0.0);
                extreme = extreme.min(sign * self.after(turn_s).output());
            }
            extreme = extreme.min(sign * next.output());
            let level = self.b[usize::from(sign < 0.0)] * extreme;
            let due = |plant: &VariableStepProcess| sign * plant.output() >= level;
            let switches = extreme < 0.0 && due(&next);
            let duration_s = if switches { self.moment(due) } else { self.dt };
            self.plant.advance(sign + self.trim + self.bias, duration_s);
            elapsed_s += duration_s;
            if switches {
                self.sign = -sign;
                return elapsed_s;
            }
        }
        f64::INFINITY
    }

    /// Times high and low (s) of `count` cycles.
    fn cycles(&mut self, count: usize) -> Vec<(f64, f64)> {
        let mut cycles = Vec::new();
        for _ in 0..count {
            let (high_s, low_s) = (self.half(), self.half());
            self.trim += self.trim_gain * (high_s - low_s) / (high_s + low_s);
            cycles.push((high_s, low_s));
            if !(high_s + low_s).is_finite() {
                break;
            }
        }
        cycles
    }
}

fn assert_settles(simulation: &mut Loop, cycle: &LimitCycle) {
    let (high_s, low_s) = simulation.cycles(60)[59];
    assert!(
        (cycle.high_s / high_s - 1.0).abs() < 1e-6,
        "{cycle:?} {high_s}"
    );
    assert!(
        (cycle.low_s / low_s - 1.0).abs() < 1e-6,
        "{cycle:?} {low_s}"
    );
}

#[test]
fn period_is_that_of_the_simulation() {
    for times in PROCESSES {
        let process = process(times);
        for beta in [BETA, 0.0, 0.4] {
            let cycle = symmetric(&process, beta).unwrap();
            assert_settles(&mut Loop::new(&process, [beta; 2], &cycle), &cycle);
        }
    }
}

// Up to a bias of 0.3 of the relay's amplitude the bare relay has one cycle, which equals the simulated
// one. At 0.3 its period is shorter than without bias, although the low output lasts longer.
#[test]
fn biased_period_is_that_of_the_simulation() {
    for times in PROCESSES {
        let process = process(times);
        for bias in [-0.2, 0.1, 0.3] {
            let cycles = limit_cycles(&process, [BETA; 2], bias);
            let [cycle] = cycles[..] else {
                unreachable!("{times:?} {bias}: {cycles:?}")
            };
            assert!(
                (cycle.high_s * (1.0 + bias) / (cycle.low_s * (1.0 - bias)) - 1.0).abs() < 1e-12
            );
            assert_settles(&mut Loop::under(&process, [BETA; 2], bias, &cycle), &cycle);
        }
    }
}

// At a bias of half the relay's amplitude the bare relay has no cycle of two switches. With the lead of
// one side halved it has one, and the simulation of that relay converges to it.
#[test]
fn halved_lead_brings_the_cycle_back() {
    for times in PROCESSES {
        let process = process(times);
        assert_eq!(limit_cycles(&process, [BETA; 2], 0.5), []);
        for (beta, bias) in [([BETA, 0.5 * BETA], 0.5), ([0.25 * BETA, BETA], -0.6)] {
            let cycles = limit_cycles(&process, beta, bias);
            assert_eq!(cycles.len(), 1, "{times:?}");
            assert!(cycles[0].is_stable());
            let mut simulation = Loop::under(&process, beta, bias, &cycles[0]);
            assert_settles(&mut simulation, &cycles[0]);
        }
    }
}

/// Ratio of the period's deviations in successive cycles: the mean over `count` cycles from cycle
/// `from`.
fn decay(cycles: &[(f64, f64)], cycle: &LimitCycle, from: usize, count: usize) -> f64 {
    let deviation = |k: usize| (cycles[k].0 - cycle.high_s).hypot(cycles[k].1 - cycle.low_s);
    (deviation(from + count) / deviation(from)).powf(1.0 / count as f64)
}

// Just before the bare relay loses its cycle, deviations decay slowly, as the simulation shows. The
// exact spectral radii at a bias of 0.32 are 0.843, 0.291, 0.422 and 0.824.
#[test]
fn spectral_radius_is_that_of_the_simulation() {
    for (times, radius) in [
        ([0.3, 2.0, 0.1], 0.843),
        ([0.3, 2.0, 0.0005], 0.291),
        ([0.015, 0.2, 0.0005], 0.422),
        ([0.0321, 1.6886, 0.0237], 0.824),
    ] {
        let process = process(times);
        let cycle = limit_cycles(&process, [BETA; 2], 0.32)[0];
        assert!((cycle.spectral_radius - radius).abs() < 6e-4, "{cycle:?}");
        let mut simulation = Loop::under(&process, [BETA; 2], 0.32, &cycle);
        simulation.cycles(40);
        simulation.plant.displace(1e-3 * cycle.amplitude, 0.0);
        let simulated = decay(&simulation.cycles(15), &cycle, 4, 8);
        assert!(
            (simulated / radius - 1.0).abs() < 0.02,
            "{times:?} {simulated} {radius}"
        );
    }
}

// With slightly more bias deviations grow: by a factor of 1.196 per cycle at 0.34.
#[test]
fn unstable_cycle_is_left() {
    let process = process([0.3, 2.0, 0.1]);
    let cycle = limit_cycles(&process, [BETA; 2], 0.34)[0];
    assert!((cycle.spectral_radius - 1.196).abs() < 6e-4, "{cycle:?}");
    let mut simulation = Loop::under(&process, [BETA; 2], 0.30, &cycle);
    simulation.bias = 0.34;
    let cycles = simulation.cycles(40);
    let (high_s, _) = cycles[cycles.len() - 1];
    assert!((high_s / cycle.high_s - 1.0).abs() > 0.01);
}

// The trim cancels any bias, so the cycle is the one without bias. After a step of the bias the
// simulation converges to it at the exact rate. With a trim gain of zero the bias stays: a rate of one.
#[test]
fn trimmed_cycle_is_that_of_the_simulation() {
    for times in PROCESSES {
        let process = process(times);
        let cycle = symmetric(&process, BETA).unwrap();
        for trim_gain in [0.5, 0.8, 1.7] {
            let mut simulation = Loop::new(&process, [BETA; 2], &cycle);
            simulation.cycles(20);
            let bias = 0.01;
            (simulation.bias, simulation.trim_gain) = (bias, trim_gain);
            let cycles = simulation.cycles(60);
            assert!(
                (cycles[59].0 / cycle.high_s - 1.0).abs() < 1e-6,
                "{times:?}"
            );
            assert!((simulation.trim + bias).abs() < 1e-6);
            let radius = trimmed_spectral_radius(&process, BETA, trim_gain).unwrap();
            assert!(radius < 1.0);
            // Complex and nearly equal multipliers make the rate vary; at a gain of 1.7 one multiplier
            // dominates.
            let tolerance = match trim_gain {
                1.7 => 0.05,
                0.5 => 0.2,
                _ => continue,
            };
            let simulated = decay(&cycles, &cycle, 4, 12);
            assert!(
                (simulated / radius - 1.0).abs() < tolerance,
                "{times:?} {simulated} {radius}"
            );
        }
        assert!((trimmed_spectral_radius(&process, BETA, 0.0).unwrap() - 1.0).abs() < 1e-12);
    }
}

// The same loop in milliseconds and in hours: at equal acceleration gain, a time scale of 1000
// multiplies the period by 1000 and the amplitude by 1000^2, and changes nothing else.
#[test]
fn time_scales_everything() {
    for bias in [0.0, 0.3] {
        for [t_prop, t_body, tau] in PROCESSES {
            let scaled = |alpha: f64| {
                let process = Soiptd::from_acceleration_gain(
                    1.0,
                    alpha * t_prop,
                    1.0 / (alpha * t_body),
                    alpha * tau,
                );
                limit_cycles(&process.unwrap(), [BETA; 2], bias)[0]
            };
            let (quick, slow) = (scaled(1.0), scaled(1000.0));
            assert!((slow.period_s() / quick.period_s() / 1e3 - 1.0).abs() < 1e-12);
            assert!((slow.amplitude / quick.amplitude / 1e6 - 1.0).abs() < 1e-12);
            assert!((slow.spectral_radius / quick.spectral_radius - 1.0).abs() < 1e-9);
        }
    }
}

// Steady period (s), amplitude and half a unit of the amplitude's last digit, from a prototype in
// another language: h = 1, K = 1, beta = -0.73, samples of 1 ms.
#[test]
fn sampled_cycles_hold_the_prototype_s() {
    for (times, period_s, (amplitude, digit)) in [
        ([0.3, 2.0, 0.1], 2.308, (0.0644, 5e-5)),
        ([0.3, 2.0, 0.0005], 1.496, (0.0221, 5e-5)),
        ([0.015, 0.2, 0.1], 0.576, (0.04731, 5e-6)),
        ([0.015, 0.2, 0.0005], 0.092, (0.00094, 5e-6)),
        ([0.0321, 1.6886, 0.0237], 0.420, (0.00297, 5e-6)),
    ] {
        let cycles = symmetric_cycles(&process(times), BETA, 1e-3);
        let found = cycles
            .iter()
            .find(|cycle| (2e-3 * f64::from(cycle.half_period) - period_s).abs() < 1e-9);
        let found = found.unwrap_or_else(|| unreachable!("{times:?} {cycles:?}"));
        assert!((found.amplitude - amplitude).abs() < digit, "{found:?}");
    }
}

// Without bias a sampled relay that settles ends in one of the exact cycles. At ten times the sample
// rate only one cycle is left, which is that of the continuous relay to one sample.
#[test]
fn sampled_relay_ends_in_one_of_its_cycles() {
    for times in PROCESSES {
        let process = process(times);
        let exact = symmetric(&process, BETA).unwrap();
        for sample_s in [1e-3, 1e-4] {
            let halves: Vec<u32> = symmetric_cycles(&process, BETA, sample_s)
                .iter()
                .map(|cycle| cycle.half_period)
                .collect();
            for half in &halves {
                let late = f64::from(*half) * sample_s - exact.high_s;
                assert!(
                    (0.0..6.0 * sample_s).contains(&late),
                    "{times:?} {halves:?}"
                );
            }
            match motion(&process, [BETA; 2], 0.0, sample_s).unwrap() {
                Motion::Pattern(cycles) => {
                    for (high, low) in cycles {
                        assert!(halves.contains(&high) && halves.contains(&low), "{times:?}");
                    }
                }
                other => assert_eq!(sample_s, 1e-4, "{times:?} {other:?}"),
            }
        }
    }
}

// A bias of 0.25 means 3 parts high to 5 parts low: (0.3, 2, 0.1) repeats 831 and 1385 samples, a ratio
// of 3 to 5. At a bias of half the relay's amplitude the bare relay stops switching.
#[test]
fn biased_sampled_relay() {
    let process = process([0.3, 2.0, 0.1]);
    assert_eq!(
        motion(&process, [BETA; 2], 0.25, 1e-3),
        Some(Motion::Pattern(vec![(831, 1385)]))
    );
    assert_eq!(
        motion(&process, [BETA; 2], 0.5, 1e-3),
        Some(Motion::Stopped)
    );
    match motion(&process, [BETA; 2], 0.1, 1e-3) {
        Some(Motion::Pattern(cycles)) => {
            let (high, low) = cycles
                .iter()
                .fold((0, 0), |sum, cycle| (sum.0 + cycle.0, sum.1 + cycle.1));
            assert_eq!(11 * high, 9 * low, "{cycles:?}");
        }
        other => unreachable!("{other:?}"),
    }
}

#[test]
fn relays_without_oscillation() {
    // Without lead and damping nothing reverses a double integrator.
    let double = Soiptd::from_acceleration_gain(1.0, 0.05, 0.0, 0.02).unwrap();
    assert_eq!(symmetric(&double, 0.2), None);
    assert_eq!(limit_cycles(&double, [0.2; 2], 0.0), []);
    assert_eq!(limit_cycles(&double, [BETA; 2], 1.0), []);
    assert_eq!(trimmed_spectral_radius(&double, 0.2, 0.8), None);
    assert_eq!(motion(&double, [0.2; 2], 0.0, 1e-3), None);
}
