//! An angle that an estimator integrates from a noisy gyro: its error is a random walk.

use std::f64::consts::FRAC_PI_2;

use onecycle_onboard::control::{Pd, PdLaw};
use onecycle_onboard::guard::Limits;
use onecycle_onboard::identification::TuningResult;
use onecycle_onboard::tuner::{Consent, Tuner, TunerSettings};
use onecycle_onboard::{RelaySettings, Soiptd};

use super::axis::Axis;

/// Attitude loop of an autopilot.
const SAMPLE_S: f64 = 0.004;
/// A gyro's noise of 0.14 rad/s, integrated over a tick (rad).
const STEP_RAD: f64 = 0.14 * SAMPLE_S;
const SEEDS: u64 = 20;

/// Roll of PX4's simulated quadrotor: 113 rad/s^2 for a full torque set-point, lags of 50 ms and 1 s.
fn roll() -> Soiptd {
    Soiptd::from_acceleration_gain(113.0, 0.05, 1.0, 0.008).unwrap()
}

/// What a tuner with a relay of this amplitude finds.
fn found(amplitude: f32, seed: u64) -> Option<TuningResult> {
    let new = TunerSettings::new(amplitude, SAMPLE_S as f32);
    let settings = TunerSettings {
        relay: RelaySettings {
            noise_sigma: 0.002,
            ..new.relay
        },
        limits: Limits::NONE,
        output_lowest: -1.0,
        output_highest: 1.0,
        safe: PdLaw {
            kp: 1.0,
            kd: 0.2,
            offset: 0.0,
        },
        consent: Consent::Never,
        ..new
    };
    let mut tuner = Tuner::new(&settings).unwrap();
    let mut axis = Axis::new(roll(), SAMPLE_S, seed);
    axis.walk_sigma = STEP_RAD;
    axis.fly(&mut tuner, 0.0, 1.0, |_, _| false);
    tuner.start();
    axis.fly(&mut tuner, 0.0, 20.0, |tuner, _| {
        tuner.identified().is_some() || tuner.reason().is_some()
    });
    tuner.identified().copied()
}

/// Phase margin of a PD with the true process, from its definition: the phase of `L` at the only frequency where `|L| = 1`.
fn margin_rad(pd: &Pd) -> f64 {
    let process = roll();
    let log_gain = |w: f64| {
        let lags = w.hypot(process.inv_t_body_per_s()) * (w * process.t_prop_s()).hypot(1.0);
        (pd.kp.hypot(pd.kd * w) * process.k_over_t_body() / (w * lags)).ln()
    };
    let (mut low, mut high) = (1e-2, 1e4);
    for _ in 0..100 {
        let middle = f64::sqrt(low * high);
        if log_gain(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let w = low;
    let lags = (w / process.inv_t_body_per_s()).atan() + (w * process.t_prop_s()).atan();
    (pd.kd * w / pd.kp).atan() + FRAC_PI_2 - lags - w * process.tau_s()
}

// Fits to the values themselves are refused here 55 times of 60, because the pack and the fit suppose white noise.
#[test]
fn differences_are_fitted_where_the_noise_is_a_random_walk() {
    for (amplitude, most) in [(0.1, 0.15), (0.2, 0.1), (0.4, 0.06)] {
        let all: Vec<_> = (0..SEEDS).filter_map(|s| found(amplitude, s)).collect();
        assert!(all.len() >= 16, "{amplitude}: {} of {SEEDS}", all.len());
        let error =
            |found: &TuningResult| (found.process.k_over_t_body() / roll().k_over_t_body()).ln();
        let mut errors: Vec<_> = all.iter().map(|found| error(found).abs()).collect();
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        assert!(median < most, "{amplitude}: {median}");
        // The deviations say how large the errors are.
        let squares = all
            .iter()
            .map(|found| (error(found) / found.deviations.ln_k_over_t_body).powi(2));
        let in_deviations = (squares.sum::<f64>() / all.len() as f64).sqrt();
        assert!(
            (0.6..1.5).contains(&in_deviations),
            "{amplitude}: {in_deviations}"
        );
        for found in &all {
            let margin = margin_rad(&found.pd);
            assert!(margin > 0.0, "{amplitude}: unstable, {found:?}");
        }
    }
}
