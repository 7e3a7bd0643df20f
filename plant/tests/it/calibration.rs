//! Calibration of the fit's covariance: errors of noisy experiments in units of it.

use onecycle_onboard::cycle::CycleDetector;
use onecycle_onboard::refine::{Refined, coordinate, refine};
use onecycle_onboard::window::Window;
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Experiment, NoiseSource, Sensor, Trace};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

type FitWindow = Window<260, 64>;

/// Noise from the generator that the processes are drawn from.
struct Continued<'a>(&'a mut Pcg64);

impl NoiseSource for Continued<'_> {
    fn standard_normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }
}

fn noisy_relay(process: &Soiptd, sigma: f64, bias: f64, rng: &mut Pcg64) -> (Trace, f64) {
    let (omega, amplitude) = process.describing_function_oscillation(1.0, -0.73).unwrap();
    let period_s = std::f64::consts::TAU / omega;
    let noise_sigma = sigma * amplitude;
    let settings = RelaySettings {
        preroll_s: 0.2,
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
    };
    let experiment = Experiment::new(*process, 1e-3, 0.2 + 30.0 * period_s)
        .with_sensor(Sensor::noisy(noise_sigma))
        .with_input_bias(bias);
    (
        experiment.run(&mut Relay::new(settings).unwrap(), &mut Continued(rng)),
        noise_sigma,
    )
}

/// The last cycles of a trace with two periods of input before them.
fn window(trace: &Trace, cycles: usize) -> (FitWindow, f64) {
    let mut detector = CycleDetector::new();
    let mut found = Vec::new();
    let mut trim = 0.0;
    for row in 1..trace.len() {
        // The relay moves by twice its amplitude, or by one from zero; the trim alone moves by less.
        let jump = trace.input[row] - trace.input[row - 1];
        if jump.abs() > 0.95 {
            trim = trace.input[row] - jump.signum();
        } else {
            trim += jump;
        }
        found.extend(detector.push(
            trace.time_s[row],
            trace.input[row] > trim,
            trace.output[row],
        ));
    }
    assert!(
        found.len() >= cycles,
        "{} cycles of {}",
        found.len(),
        trace.len()
    );
    let (first, last) = (found[found.len() - cycles], found[found.len() - 1]);
    let end_s = last.start_s + last.period_s;
    let period_s = (end_s - first.start_s) / cycles as f64;
    let mut window = FitWindow::new(first.start_s, 1e-3);
    for row in 0..trace.len() {
        let time_s = trace.time_s[row];
        if time_s < first.start_s - 2.0 * period_s || time_s > end_s - 0.5e-3 {
            continue;
        }
        window.push_input(time_s, trace.input[row]).unwrap();
        if time_s > first.start_s - 0.5e-3 {
            window.push_output(time_s, trace.output[row]);
        }
    }
    (window, period_s)
}

/// Errors in the coordinates of the covariance, and the covariance.
fn errors(found: &Refined, process: &Soiptd, bias: f64) -> ([f64; 5], [[f64; 5]; 5]) {
    use coordinate::{INPUT_BIAS, LN_JERK_GAIN, LN_POLE_SUM, POLE_RATIO, TAU_S};
    let ((sum, ratio), (found_sum, found_ratio)) = (process.pole_sum(), found.process.pole_sum());
    let gain = |process: &Soiptd| process.k_over_t_body() / process.t_prop_s();
    let mut errors = [0.0; 5];
    errors[LN_POLE_SUM] = (found_sum / sum).ln();
    errors[POLE_RATIO] = found_ratio - ratio;
    errors[TAU_S] = found.process.tau_s() - process.tau_s();
    errors[LN_JERK_GAIN] = (gain(&found.process) / gain(process)).ln();
    errors[INPUT_BIAS] = found.input_bias - bias;
    (errors, found.covariance.unwrap())
}

/// `e^T C^-1 e` by Cholesky factorisation.
fn mahalanobis_squared(covariance: &[[f64; 5]; 5], errors: &[f64; 5]) -> f64 {
    let mut factor = [[0.0; 5]; 5];
    let mut white = [0.0; 5];
    for i in 0..5 {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = covariance[i][j] - known;
            factor[i][j] = if i == j {
                rest.sqrt()
            } else {
                rest / factor[j][j]
            };
        }
        let known: f64 = (0..i).map(|k| factor[i][k] * white[k]).sum();
        white[i] = (errors[i] - known) / factor[i][i];
    }
    white.iter().map(|part| part * part).sum()
}

struct Calibration {
    /// Mean of `e^T C^-1 e / 5`.
    joint: f64,
    /// Mean of the squared error over the variance, for each coordinate.
    marginal: [f64; 5],
    /// Mean of the residual's size over that of the noise.
    residual: f64,
}

/// Over random processes of the multirotor domain whose body is at least half as slow again as the actuator:
/// closer to equal lags the pole ratio is often at its limit.
fn calibration(sigma: f64, cycles: usize, cases: usize) -> Calibration {
    let mut rng = Pcg64::seed_from_u64(11);
    let mut mean = Calibration {
        joint: 0.0,
        marginal: [0.0; 5],
        residual: 0.0,
    };
    let share = 1.0 / cases as f64;
    for _ in 0..cases {
        let t_prop_s: f64 = rng.random_range(0.015..0.3);
        let t_body_s = rng.random_range((1.5 * t_prop_s).max(0.2)..2.0);
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, rng.random_range(0.0005..0.1)).unwrap();
        let bias = rng.random_range(-0.5..0.5);
        let (trace, noise_sigma) = noisy_relay(&process, sigma, bias, &mut rng);
        let (window, period_s) = window(&trace, cycles);
        let found = refine(&window, period_s).unwrap();
        let (errors, covariance) = errors(&found, &process, bias);
        mean.joint += share * mahalanobis_squared(&covariance, &errors) / 5.0;
        for (k, marginal) in mean.marginal.iter_mut().enumerate() {
            *marginal += share * errors[k] * errors[k] / covariance[k][k];
        }
        mean.residual += share * found.residual_sigma / noise_sigma;
    }
    mean
}

// Where the linearisation holds, at noise up to 0.3 % of the amplitude, squared errors in units of their
// covariance have the mean 5; a fifth of it has a standard error of sqrt(2 / (5 n)) = 0.045 for n = 200. The
// worst cases, where the linearisation is less accurate, raise the mean.
#[test]
fn errors_are_as_large_as_stated_jointly() {
    for (sigma, cycles) in [(0.001, 2), (0.003, 2), (0.003, 4)] {
        let Calibration {
            joint,
            marginal,
            residual,
        } = calibration(sigma, cycles, 200);
        assert!((0.87..1.2).contains(&joint), "{sigma} {cycles}: {joint}");
        for marginal in marginal {
            // Standard error sqrt(2 / n) = 0.1; three of them.
            assert!(
                (0.7..1.3).contains(&marginal),
                "{sigma} {cycles}: {marginal}"
            );
        }
        // Each standard deviation comes from over a hundred bins; there are two hundred of them.
        assert!(
            (residual - 1.0).abs() < 0.01,
            "{sigma} {cycles}: {residual}"
        );
    }
}

// At one per cent the region of equal likelihood is curved, but each single coordinate is as certain as stated.
#[test]
fn errors_are_as_large_as_stated_one_by_one() {
    use coordinate::{INPUT_BIAS, LN_POLE_SUM, POLE_RATIO, TAU_S};
    for cycles in [1, 2, 4] {
        let Calibration {
            marginal, residual, ..
        } = calibration(0.01, cycles, 200);
        for index in [LN_POLE_SUM, POLE_RATIO, TAU_S, INPUT_BIAS] {
            // Standard error sqrt(2 / n) = 0.1; three of them.
            let marginal = marginal[index];
            assert!(
                (0.7..1.3).contains(&marginal),
                "{cycles} {index}: {marginal}"
            );
        }
        assert!((residual - 1.0).abs() < 0.01, "{cycles}: {residual}");
    }
}
