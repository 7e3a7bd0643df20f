//! Baselines: exact where theory says so, and wrong where the paper says so.

mod arx;
mod asymmetric;
mod gmvc;
mod pem;
mod rules;

use onecycle_design::soiptd_pd::deterioration::deterioration;
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;
use onecycle_lab::judge::baselines::{BaselineAnswer, BaselineError};
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Controller, Experiment, Noise, Trace};

const SAMPLE_S: f64 = 1e-3;

/// The paper's phase margin (rad).
fn margin() -> f64 {
    20_f64.to_radians()
}

fn process(k: f64, t_prop_s: f64, t_body_s: f64, tau_s: f64) -> Soiptd {
    Soiptd::new(k, t_prop_s, t_body_s, tau_s).unwrap()
}

/// Processes in the corners and the middle of the paper's domain.
fn processes() -> [Soiptd; 4] {
    [
        process(1.0, 0.3, 2.0, 0.1),
        process(1.0, 0.15, 1.0, 0.05),
        process(1.0, 0.02, 0.3, 0.02),
        process(1.0, 0.0321, 1.6886, 0.0237),
    ]
}

/// An experiment at 1 kHz from rest, without noise.
fn run(process: Soiptd, bias: f64, duration_s: f64, controller: &mut impl Controller) -> Trace {
    let mut experiment = Experiment::new(process, SAMPLE_S, duration_s);
    experiment.input_bias = bias;
    experiment.run(controller, &mut Noise::from_seed(1))
}

/// The paper's relay, without noise protection, on a noise-free process, for `periods` of its periods.
fn relay_test(process: Soiptd, bias: f64, periods: f64) -> Trace {
    let (omega, _) = process.describing_function_oscillation(1.0, -0.73).unwrap();
    let mut relay = Relay::new(RelaySettings::bare(1.0, -0.73)).unwrap();
    run(
        process,
        bias,
        periods * std::f64::consts::TAU / omega,
        &mut relay,
    )
}

/// Cost above the optimum of a baseline's answer; `None` if unstable.
fn cost(found: Result<BaselineAnswer, BaselineError>, truth: &Soiptd) -> Option<f64> {
    let best = pd_at_phase_margin(truth, margin()).unwrap();
    deterioration(found.unwrap().pd, truth, &best).relative()
}
