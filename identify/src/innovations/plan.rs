//! Intervals to expect from a test, before anyone runs it.
//!
//! The Fisher information of a record at the true process: the residual of the likelihood at the true process is the
//! noise alone, so its Jacobian, taken on a record without noise, and the variance of the noise give the covariance that
//! an efficient estimator reaches (the Cramer-Rao bound).

use onecycle_design::Model;
use onecycle_design::state_space::StateSpace;

use super::descent::Found;
use super::draws;
use super::likelihood::{Memory, evaluate};
use super::mixture;
use super::record::{Blocks, Forces, Hold, Record};
use super::response;
use super::theta::{Bounds, NoiseKind, Theta};
use super::{LONGEST_TAU, ROWS};
use crate::outcome::Noise;
use crate::posterior::Estimate;

/// Parameters of `model` with the 90 % intervals that a record of `input`, sampled every `sample_s`, leads to on average
/// under `noise`. `None` if the record does not tell the parameters, or has too few samples.
///
/// The input is that of the process, with the controller's part if a loop is closed. The intervals are those of the
/// noise alone: an error of the model is not in them.
#[must_use]
pub fn expected(
    model: &Model,
    noise: &Noise,
    input: &[f64],
    sample_s: f64,
    hold: Hold,
) -> Option<Estimate> {
    if input.len() < super::FEWEST || noise.sigma <= 0.0 {
        return None;
    }
    let theta = theta_of(model, noise);
    let gain = model.linear().gain();
    let mut record = Record {
        forces: Forces::default(),
        floor: 0.0,
        uneven_s: vec![],
        dt_s: sample_s,
        input: input.to_vec(),
        output: vec![0.0; input.len()],
        present: vec![true; input.len()],
        hold,
        rest: None,
    };
    let state_space = StateSpace::<6>::new(&theta.process(1.0));
    let whole = Blocks::new(&record, 1, 0.0);
    let response = response::sums(&state_space, &whole, theta.tau_s());
    record.output = response.iter().map(|g| gain * g).collect();
    let longest = LONGEST_TAU * sample_s * input.len() as f64;
    let skip_s = (1.5 * theta.tau_s() + 2.0 * sample_s).min(longest);
    let fast_s = theta.shortest_lag_s() + theta.tau_s();
    let samples = (input.len() / ROWS)
        .min((fast_s / sample_s) as usize)
        .max(1);
    let blocks = Blocks::new(&record, samples, skip_s);
    let bounds = Bounds::new(&theta, &blocks, longest.max(2.0 * theta.tau_s()));
    let mut at = evaluate(&blocks, &theta, &mut Memory::default())?;
    at.variance = noise.sigma * noise.sigma;
    let found = Found { theta, at };
    let component = mixture::of_one(&blocks, &found, &bounds)?;
    let best = component.found.clone();
    let stamps = draws::Stamps {
        sample_s,
        ..draws::Stamps::default()
    };
    let (posterior, _) = draws::posterior_of(&best, &[component], stamps, None);
    Some(posterior.estimate())
}

/// Coordinates of a known process under known noises.
fn theta_of(model: &Model, noise: &Noise) -> Theta {
    let process = model.linear();
    let mut theta = Theta::new(process.structure());
    let layout = theta.layout();
    for (lag, lag_s) in process.lags_s().iter().enumerate() {
        theta.values[lag] = lag_s.ln();
    }
    if let Some(pole) = layout.pole() {
        theta.values[pole] = process.pole_per_s();
    }
    if let Some(pair) = layout.pair() {
        theta.values[pair..pair + 2].copy_from_slice(&process.pair());
    }
    theta.values[layout.tau()] = process.tau_s();
    let frequencies = [noise.w1_rad_per_s, noise.w0_rad_per_s, noise.wy_rad_per_s];
    for (kind, frequency) in NoiseKind::ALL.into_iter().zip(frequencies) {
        theta.set_noise(kind, frequency.unwrap_or(0.0));
    }
    theta
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Linear, Parameter, Structure};

    use super::*;

    // Twice the noise doubles the intervals; four times as many samples in the same time halve them.
    #[test]
    fn intervals_scale_with_noise_and_samples() {
        let model = Model::from(
            Linear::new(Structure::Foptd)
                .with_gain(2.0)
                .with_pole_per_s(0.5)
                .with_tau_s(0.3),
        );
        let width = |sigma: f64, sample_s: f64| {
            let count = (60.0 / sample_s) as usize;
            let input: Vec<f64> = (0..count)
                .map(|k| {
                    if ((k as f64 * sample_s / 4.0) as usize).is_multiple_of(2) {
                        1.0
                    } else {
                        -1.0
                    }
                })
                .collect();
            let noise = Noise {
                sigma,
                w1_rad_per_s: None,
                w0_rad_per_s: None,
                wy_rad_per_s: None,
            };
            let found = expected(&model, &noise, &input, sample_s, Hold::Held).unwrap();
            let tau = found.get(Parameter::Tau).unwrap();
            assert!(tau.holds(0.3) && found.get(Parameter::TBody).unwrap().holds(2.0));
            tau.high.unwrap() - tau.low.unwrap()
        };
        let base = width(0.1, 0.02);
        assert!((width(0.2, 0.02) / base - 2.0).abs() < 0.02);
        assert!((width(0.1, 0.005) / base - 0.5).abs() < 0.03);
    }

    #[test]
    fn a_constant_input_tells_nothing() {
        let model = Model::from(Linear::new(Structure::Foptd).with_pole_per_s(0.5));
        let noise = Noise {
            sigma: 0.1,
            w1_rad_per_s: None,
            w0_rad_per_s: None,
            wy_rad_per_s: None,
        };
        assert!(expected(&model, &noise, &[1.0; 500], 0.02, Hold::Held).is_none());
        assert!(expected(&model, &noise, &[1.0; 10], 0.02, Hold::Held).is_none());
    }
}
