//! Whether the estimator's covariance is what it says: errors of noisy experiments, in its own units.

use onecycle_onboard::cycle::CycleDetector;
use onecycle_onboard::refine::{Refined, coordinate, refine};
use onecycle_onboard::window::Window;
use onecycle_onboard::{Process, Relay, RelaySettings};
use onecycle_plant::{Experiment, Sensor, Trace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

type FitWindow = Window<257, 64>;

fn noisy_relay(process: &Process, sigma: f64, bias: f64, rng: &mut Pcg64) -> (Trace, f64) {
    let (omega, amplitude) = process.describing_function_oscillation(1.0, -0.73).unwrap();
    let period_s = std::f64::consts::TAU / omega;
    let noise_sigma = sigma * amplitude;
    let settings = RelaySettings {
        preroll_s: 0.2,
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
    };
    let experiment = Experiment {
        sensor: Sensor { noise_sigma, quantum: 0.0 },
        input_bias: bias,
        ..Experiment::new(*process, 1e-3, 0.2 + 16.0 * period_s)
    };
    (experiment.run(&mut Relay::new(settings).unwrap(), rng), noise_sigma)
}

/// The last cycles of a trace and two periods of input before them.
fn window(trace: &Trace, cycles: usize) -> (FitWindow, f64) {
    let mut detector = CycleDetector::new();
    let mut found = Vec::new();
    let mut trim = 0.0;
    for row in 1..trace.len() {
        // The relay moves by 2 at every switch, the trim by less.
        let jump = trace.input[row] - trace.input[row - 1];
        if jump.abs() > 0.05 {
            trim = trace.input[row] - jump.signum();
        }
        found.extend(detector.push(trace.time_s[row], trace.input[row] > trim, trace.output[row]));
    }
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

/// Errors in the coordinates of the covariance.
fn errors(found: &Refined, process: &Process, bias: f64) -> [f64; 5] {
    let ((sum, ratio), (found_sum, found_ratio)) = (process.pole_sum(), found.process.pole_sum());
    let mut errors = [0.0; 5];
    errors[coordinate::LN_POLE_SUM] = (found_sum / sum).ln();
    errors[coordinate::POLE_RATIO] = found_ratio - ratio;
    errors[coordinate::TAU_S] = found.process.tau_s() - process.tau_s();
    // The gain of the estimator's model is the one over s^2 (s T + 1): b.
    errors[coordinate::LN_GAIN] = (found.process.k_over_t_body() / process.k_over_t_body()).ln();
    errors[coordinate::INPUT_BIAS] = found.input_bias - bias;
    errors
}

/// `e^T C^-1 e` by Cholesky's factor.
fn mahalanobis_squared(covariance: &[[f64; 5]; 5], errors: &[f64; 5]) -> f64 {
    let mut factor = [[0.0; 5]; 5];
    let mut white = [0.0; 5];
    for i in 0..5 {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = covariance[i][j] - known;
            factor[i][j] = if i == j { rest.sqrt() } else { rest / factor[j][j] };
        }
        let known: f64 = (0..i).map(|k| factor[i][k] * white[k]).sum();
        white[i] = (errors[i] - known) / factor[i][i];
    }
    white.iter().map(|part| part * part).sum()
}

#[test]
fn explore() {
    for (sigma, cycles) in [(0.003, 2), (0.01, 2), (0.01, 4), (0.01, 1), (0.03, 2)] {
        let mut rng = Pcg64::seed_from_u64(11);
        let (mut d2, mut infl, mut ratio_s, mut edges) = (Vec::new(), Vec::new(), Vec::new(), 0);
        let (mut marg, mut worst) = ([0.0; 5], 0.0_f64);
        for _ in 0..300 {
            let process = Process::new(
                1.0,
                rng.random_range(0.015..0.3),
                rng.random_range(0.2..2.0),
                rng.random_range(0.0005..0.1),
            )
            .unwrap();
            let bias = rng.random_range(-0.5..0.5);
            let (trace, noise) = noisy_relay(&process, sigma, bias, &mut rng);
            let (window, period_s) = window(&trace, cycles);
            let found = refine(&window, period_s).unwrap();
            let e = errors(&found, &process, bias);
            let Some(c) = found.covariance else { edges += 1; continue };
            let v = mahalanobis_squared(&c, &e) / 5.0;
            if found.edge.is_some() || found.process.pole_sum().1 > 0.2499 { edges += 1; }
            d2.push(v);
            worst = worst.max(v);
            for k in 0..5 { marg[k] += e[k] * e[k] / c[k][k]; }
            infl.push(1.0);
            ratio_s.push(found.residual_sigma / noise);
        }
        let n = d2.len() as f64;
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let mut s = d2.clone();
        s.sort_by(f64::total_cmp);
        println!("{sigma} {cycles}: n {n} mean {:.3} median {:.3} worst {worst:.1} p95 {:.2} p98 {:.2} infl {:.3} resid/noise {:.3} edges {edges} marg {:?}", mean(&d2), s[s.len()/2], s[s.len()*95/100], s[s.len()*98/100], mean(&infl), mean(&ratio_s), marg.map(|m| (m / n * 100.0).round() / 100.0));
    }
}
