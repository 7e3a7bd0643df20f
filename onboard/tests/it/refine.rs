//! The fit on noise-free experiments: it must return the process that produced them.

use crate::common::{FitWindow, Simulation, every, last_cycles, run};
use onecycle_onboard::refine::{
    DomainEdge, PriorKnowledge, RefineError, Refined, Shape, ShapePrior, refine, refine_with,
};
use onecycle_onboard::{Relay, RelaySettings, Soiptd};

fn relay() -> Relay {
    let beta = RelaySettings::DISTINGUISHING_BETA;
    Relay::new(RelaySettings::new(1.0, beta)).unwrap()
}

/// Expected period (s), by the describing function.
fn scale_s(process: &Soiptd) -> f64 {
    let (omega, _) = process.describing_function_oscillation(1.0, -0.73).unwrap();
    std::f64::consts::TAU / omega
}

/// Sixteen periods of about 400 samples; the last `cycles` are fitted.
fn refined(process: &Soiptd, bias: f64, cycles: usize) -> Refined {
    let sample_s = scale_s(process) / 400.0;
    let run = run(process, &mut relay(), bias, every(sample_s, 16 * 400));
    let (window, period_s) = last_cycles(&run, sample_s, cycles, |_| true);
    refine(&window, period_s).unwrap()
}

/// Errors of the quantities that the response depends on, relative or in periods of the oscillation: gain over
/// lag, sum of the poles, their ratio, delay.
fn errors(found: &Soiptd, process: &Soiptd) -> [f64; 4] {
    let relative = |a: f64, b: f64| (a / b - 1.0).abs();
    let ((sum, ratio), (found_sum, found_ratio)) = (process.pole_sum(), found.pole_sum());
    [
        relative(
            found.k_over_t_body() / found.t_prop_s(),
            process.k_over_t_body() / process.t_prop_s(),
        ),
        relative(found_sum, sum),
        (found_ratio - ratio).abs(),
        (found.tau_s() - process.tau_s()).abs() / scale_s(process),
    ]
}

#[track_caller]
fn assert_recovered(found: &Refined, process: &Soiptd, bias: f64, tolerance: f64) {
    let errors = errors(&found.process, process);
    let bias_error = (found.input_bias - bias).abs();
    assert!(
        errors.iter().all(|error| *error < tolerance) && bias_error < tolerance,
        "{errors:?}, bias off by {bias_error}: {:?} for {process:?}",
        found.process
    );
    assert_eq!(found.edge, None);
}

fn new(t_prop_s: f64, t_body_s: f64, tau_s: f64) -> Soiptd {
    Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).unwrap()
}

fn undamped(t_prop_s: f64, tau_s: f64) -> Soiptd {
    Soiptd::from_acceleration_gain(2.0, t_prop_s, 0.0, tau_s).unwrap()
}

/// The corners of the multirotor domain, and processes beyond it.
fn processes() -> [Soiptd; 13] {
    [
        new(0.0321, 1.6886, 0.0237),
        new(0.3, 2.0, 0.1),
        new(0.3, 2.0, 0.0005),
        new(0.015, 0.2, 0.1),
        new(0.015, 0.2, 0.0005),
        // No delay.
        new(0.1, 0.3, 0.0),
        // Double integrators with a lag.
        undamped(0.05, 0.03),
        undamped(0.05, 0.0),
        // Equal lags.
        new(0.2, 0.2, 0.05),
        new(0.2, 0.2, 0.0),
        // An actuator slower than the body: the same response as with the lags exchanged.
        new(0.3, 0.2, 0.05),
        // A lag of 1/200 of the period.
        new(0.002, 1.0, 0.1),
        Soiptd::from_acceleration_gain(-7.0, 0.05, 1.0, 0.03).unwrap(),
    ]
}

// A perfect recording determines everything. The remaining error is the rounding of the outputs, 1e-16, divided
// by the sensitivity of one cycle to its least certain direction (initial state against damping of a slow
// process), about 1e-9; and the prior of the initial acceleration, a millionth of the output.
#[test]
fn perfect_recordings_are_recovered() {
    for process in processes() {
        for bias in [0.0, 0.2, -0.3] {
            assert_recovered(&refined(&process, bias, 1), &process, bias, 1e-6);
            assert_recovered(&refined(&process, bias, 2), &process, bias, 1e-7);
            assert_recovered(&refined(&process, bias, 4), &process, bias, 1e-7);
        }
    }
}

// Away from equal lags the parameters of the paper are as certain.
#[test]
fn the_papers_parameters_come_back() {
    let process = new(0.0321, 1.6886, 0.0237);
    let found = refined(&process, 0.1, 2).process;
    for (found, expected) in [
        (found.k(), 1.0),
        (found.t_body_s(), 1.6886),
        (Some(found.t_prop_s()), 0.0321),
        (Some(found.tau_s()), 0.0237),
    ] {
        assert!(
            (found.unwrap() / expected - 1.0).abs() < 1e-8,
            "{found:?} for {expected}"
        );
    }
}

// Equal lags have the ratio 1/4; the error of each is the square root of the ratio's. If the lags are exchanged,
// the faster is taken as the actuator's, and the acceleration gain changes with it.
#[test]
fn lags_are_told_apart_by_their_speed() {
    let equal = refined(&new(0.2, 0.2, 0.05), 0.0, 2).process;
    assert!((equal.t_prop_s() / 0.2 - 1.0).abs() < 1e-3);
    let exchanged = refined(&new(0.3, 0.2, 0.05), 0.0, 2).process;
    assert!((exchanged.t_prop_s() / 0.2 - 1.0).abs() < 1e-6);
    assert!((exchanged.k().unwrap() - 1.0).abs() < 1e-6);
}

// Periods from a millisecond to three hours. If times and outputs are scaled by powers of two, every step of the
// fit is scaled exactly; scales of ten only round differently.
#[test]
fn time_has_no_scale() {
    let base = [0.1, 1.3, 0.07];
    let at = |scale: f64| {
        let [lag, body, tau] = base.map(|time_s| time_s * scale);
        let process = new(lag, body, tau);
        (process, refined(&process, 0.1, 2))
    };
    for scale in [1e-3, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4] {
        let (process, found) = at(scale);
        assert_recovered(&found, &process, 0.1, 1e-7);
    }
}

/// Deterministic numbers in 0..1 (Knuth's MMIX generator, upper bits).
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        let Self(state) = self;
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Worst error over the processes for uneven samples, with this spread of the increments and share of lost
/// samples. The sum of the poles is left out where the lag is too short to be observed.
fn worst_of_uneven_samples(spread: f64, lost: f64, cycles: usize) -> f64 {
    let mut worst = 0.0_f64;
    for process in processes() {
        let sample_s = scale_s(&process) / 400.0;
        let mut uniform = Uniform(1);
        let mut time_s = 0.0;
        let times_s: Vec<f64> = (0..16 * 400)
            .map(|_| {
                let now_s = time_s;
                // Uniform within +/- sqrt(3) standard deviations.
                time_s += sample_s * (1.0 + spread * 12_f64.sqrt() * (uniform.next() - 0.5));
                now_s
            })
            .collect();
        let run = run(&process, &mut relay(), 0.1, times_s);
        let (window, period_s) = last_cycles(&run, sample_s, cycles, |_| uniform.next() >= lost);
        let found = refine(&window, period_s).unwrap();
        let [gain, sum, ratio, tau] = errors(&found.process, &process);
        worst = worst
            .max(ratio)
            .max(tau)
            .max((found.input_bias - 0.1).abs());
        if process.t_prop_s() > 0.01 * scale_s(&process) {
            worst = worst.max(gain).max(sum);
        }
    }
    worst
}

// The model is evaluated at the mean time of the samples, with its slope. The remaining error is of second
// order, the variance of the times within a bin times half the acceleration: up to 2e-5 of the amplitude here,
// which changes a lag or a gain by a part in a thousand at most.
#[test]
fn jittered_and_lost_samples_do_little_harm() {
    for (spread, lost, most) in [(0.02, 0.0, 1e-3), (0.0, 0.1, 8e-4), (0.02, 0.1, 1.5e-3)] {
        for cycles in [1, 2, 4] {
            let worst = worst_of_uneven_samples(spread, lost, cycles);
            assert!(worst < most, "{spread} {lost} {cycles}: {worst}");
        }
    }
}

#[test]
fn a_window_without_a_relay_is_no_window() {
    let mut window = FitWindow::new(0.0, 1e-3);
    for k in 0..1000 {
        window.push_output(f64::from(k) * 1e-3, f64::from(k));
    }
    assert_eq!(refine(&window, 0.4), Err(RefineError::NoInput));
    window.push_input(-1.0, 1.0).unwrap();
    assert_eq!(refine(&window, 0.4), Err(RefineError::NoInput));
}

// Eight unknowns need sixteen bins; 15 samples give 15.
#[test]
fn a_short_window_says_how_short() {
    let mut window = FitWindow::new(0.0, 1e-3);
    window.push_input(-1.0, 1.0).unwrap();
    window.push_input(0.005, -1.0).unwrap();
    for k in 0..15 {
        assert_eq!(
            refine(&window, 0.02),
            Err(RefineError::TooFewBins(k as usize))
        );
        window.push_output(f64::from(k) * 1e-3, f64::from(k * k));
    }
    window.push_output(0.015, 225.0);
    assert!(!matches!(
        refine(&window, 0.02),
        Err(RefineError::TooFewBins(_))
    ));
}

// Without noise the data determine a shape to a millionth against a prior with a standard deviation of one.
// Against a prior of 1e-12 about another shape they have no influence, and the covariance shows it.
#[test]
fn a_prior_counts_for_what_it_is_worth() {
    let process = new(0.05, 1.0, 0.03);
    let sample_s = scale_s(&process) / 400.0;
    let run = run(&process, &mut relay(), 0.0, every(sample_s, 16 * 400));
    let (window, period_s) = last_cycles(&run, sample_s, 1, |_| true);
    let (sum_per_s, ratio) = process.pole_sum();
    let off: Shape = [
        (sum_per_s * period_s).ln() + 0.1,
        ratio + 0.02,
        process.tau_s() / period_s + 0.01,
    ];
    let with = |size: f64| {
        let root =
            core::array::from_fn(|i| core::array::from_fn(|j| if i == j { size } else { 0.0 }));
        let prior_knowledge = PriorKnowledge {
            may_walk: false,
            starts: &[off],
            prior: ShapePrior::new(off, &root),
        };
        refine_with(&window, period_s, &prior_knowledge).unwrap()
    };
    assert_recovered(&with(1.0), &process, 0.0, 1e-6);
    let held = with(1e-12);
    let (found_sum, found_ratio) = held.process.pole_sum();
    let found = [
        (found_sum * period_s).ln(),
        found_ratio,
        held.process.tau_s() / period_s,
    ];
    for (found, off) in found.iter().zip(off) {
        assert!((found - off).abs() < 1e-6, "{found} {off}");
    }
    let sigma = held.covariance.unwrap()[1][1].sqrt();
    assert!(sigma < 1e-6, "{sigma}");
}

/// Two periods of a wave of one second, high for a third, through the process in open loop: a relay need not
/// make the process oscillate at that period. (With a wave high for a half, a delay of half a period would be a
/// change of sign.)
fn open_loop(process: &Soiptd) -> Refined {
    let sample_s = 1.0 / 256.0;
    let mut simulation = Simulation::new(process);
    let mut window = FitWindow::new(4.0, sample_s);
    for k in 0..256 * 6 {
        let time_s = f64::from(k) * sample_s;
        let input = if k % 256 < 85 { 1.0 } else { -1.0 };
        window.push_input(time_s, input).unwrap();
        if k >= 256 * 4 {
            window.push_output(time_s, simulation.output());
        }
        simulation.hold(input, time_s + sample_s);
    }
    refine(&window, 1.0).unwrap()
}

// The domain in periods: sum of the poles from 1 to e^6.9 = 992, delays up to a half. For a process outside it
// the best fit lies on the limit and reports it.
#[test]
fn the_limits_of_the_domain_are_named() {
    // Poles 5/6 and 1/30: their sum is 0.867.
    assert_eq!(
        open_loop(&new(1.2, 30.0, 0.02)).edge,
        Some(DomainEdge::SlowLags)
    );
    // A pole of 1e5.
    assert_eq!(
        open_loop(&new(1e-5, 5.0, 0.3)).edge,
        Some(DomainEdge::FastLag)
    );
    // No limit for a process inside.
    let inside = new(0.1, 1.0, 0.1);
    let found = open_loop(&inside);
    assert_eq!(found.edge, None);
    assert!((found.process.tau_s() - 0.1).abs() < 1e-6, "{found:?}");
}

// Here the search ends a ten-thousandth before the limit: the fit is as good, and the limit must be reported.
#[test]
fn a_lag_too_fast_to_be_seen_is_always_named() {
    for (t_prop_s, tau_s) in [(2e-4, 0.2), (2e-6, 0.2), (1e-8, 0.2)] {
        let found = open_loop(&new(t_prop_s, 1.0, tau_s));
        assert_eq!(found.edge, Some(DomainEdge::FastLag), "{:?}", found.process);
    }
}

// Meaningless input gives an outcome, not a panic.
#[test]
fn a_period_that_is_none_is_no_fit() {
    let process = new(0.05, 1.0, 0.03);
    let sample_s = scale_s(&process) / 400.0;
    let run = run(&process, &mut relay(), 0.0, every(sample_s, 4000));
    let (window, _) = last_cycles(&run, sample_s, 2, |_| true);
    for period_s in [f64::NAN, 0.0, f64::INFINITY, -1.0] {
        if let Ok(found) = refine(&window, period_s) {
            assert!(found.process.tau_s().is_finite() && found.residual_sigma.is_finite());
        }
    }
}
