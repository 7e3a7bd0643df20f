//! Bands of the step response and of the open loop over draws from the posterior.
//!
//! At each point a band holds 90 % of the curves of the draws. A single curve may leave it somewhere.

use num_complex::Complex64;

use crate::closed_loop::{loop_response, step_response};
use crate::controller::Controller;
use crate::model::Model;
use crate::soiptd_pd::step_response::StepResponse;

/// Quantiles of a 90 % interval.
const QUANTILES: (f64, f64) = (0.05, 0.95);

/// Ends of the 90 % interval of draws; `None` without draws.
#[must_use]
pub fn quantiles(mut values: Vec<f64>) -> Option<(f64, f64)> {
    if values.is_empty() {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    let at = |q: f64| values[((values.len() - 1) as f64 * q).round() as usize];
    Some((at(QUANTILES.0), at(QUANTILES.1)))
}

/// Ends of a band, a value for each abscissa that it was asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Lower end.
    pub low: Vec<f64>,
    /// Upper end.
    pub high: Vec<f64>,
}

impl Band {
    /// About curves of equal length; `None` where there is none.
    fn of(curves: &[Vec<f64>]) -> Option<Self> {
        let count = curves.first()?.len();
        let ends = (0..count).map(|at| quantiles(curves.iter().map(|curve| curve[at]).collect()));
        let ends: Option<Vec<(f64, f64)>> = ends.collect();
        let (low, high) = ends?.into_iter().unzip();
        Some(Self { low, high })
    }
}

/// Bands about the response to a unit step of the reference.
#[derive(Clone, Debug, PartialEq)]
pub struct StepBands {
    /// Of the output (output unit).
    pub output: Band,
    /// Of the controller's output (input unit).
    pub input: Band,
    /// Share of the models on which the loop settles; the others have no response.
    pub settling: f64,
}

/// Bands of the step responses of `models` under `controller` at the times `times_s`; `None` where no loop settles.
#[must_use]
pub fn step_bands(models: &[Model], controller: &Controller, times_s: &[f64]) -> Option<StepBands> {
    let responses: Vec<StepResponse> = (models.iter())
        .filter_map(|model| step_response(model, controller).ok())
        .collect();
    let curves = |value: fn((f64, f64)) -> f64| -> Vec<Vec<f64>> {
        let at = |response: &StepResponse| {
            let values = times_s.iter().map(|&time_s| value(response.at(time_s)));
            values.collect()
        };
        responses.iter().map(at).collect()
    };
    Some(StepBands {
        output: Band::of(&curves(|(output, _)| output))?,
        input: Band::of(&curves(|(_, input)| input))?,
        settling: responses.len() as f64 / models.len() as f64,
    })
}

/// Bands about the open loop.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopBands {
    /// Of the magnitude.
    pub magnitude: Band,
    /// Of the phase, unwrapped (rad).
    pub phase_rad: Band,
    /// The two edges of the band about the locus: what lies across it, at each frequency.
    pub locus: (Vec<Complex64>, Vec<Complex64>),
}

/// Bands of the open loops of `models` under `controller` about that of `centre`, at rising frequencies (rad/s); `None`
/// without models, with fewer than two frequencies, and where the loop of `centre` has no margins.
#[must_use]
pub fn loop_bands(
    centre: &Model,
    models: &[Model],
    controller: &Controller,
    omegas_rad_per_s: &[f64],
) -> Option<LoopBands> {
    let responses = |model: &Model| -> Option<Vec<(f64, f64)>> {
        let one = |&omega: &f64| {
            loop_response(model, controller, omega).map(|at| (at.magnitude, at.phase_rad))
        };
        omegas_rad_per_s.iter().map(one).collect()
    };
    let point = |(magnitude, phase_rad): (f64, f64)| Complex64::from_polar(magnitude, phase_rad);
    let locus: Vec<Complex64> = responses(centre)?.into_iter().map(point).collect();
    let across = normals(&locus)?;
    let loops: Vec<Vec<(f64, f64)>> = models.iter().filter_map(responses).collect();
    let curves = |value: &dyn Fn(usize, (f64, f64)) -> f64| -> Vec<Vec<f64>> {
        let of = |curve: &Vec<(f64, f64)>| {
            let values = curve.iter().enumerate().map(|(k, &at)| value(k, at));
            values.collect()
        };
        loops.iter().map(of).collect()
    };
    let beside = Band::of(&curves(&|k, at| {
        ((point(at) - locus[k]) * across[k].conj()).re
    }))?;
    let edge = |distances: &[f64]| {
        let points = locus.iter().zip(&across).zip(distances);
        points
            .map(|((at, across), far)| at + across * far)
            .collect()
    };
    Some(LoopBands {
        magnitude: Band::of(&curves(&|_, (magnitude, _)| magnitude))?,
        phase_rad: Band::of(&curves(&|_, (_, phase_rad)| phase_rad))?,
        locus: (edge(&beside.low), edge(&beside.high)),
    })
}

/// Unit vectors across a curve at its points.
fn normals(curve: &[Complex64]) -> Option<Vec<Complex64>> {
    if curve.len() < 2 {
        return None;
    }
    let last = curve.len() - 1;
    let normal = |k: usize| {
        let along = curve[(k + 1).min(last)] - curve[k.saturating_sub(1)];
        Complex64::i() * along / along.norm()
    };
    Some((0..=last).map(normal).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    use onecycle_onboard::{Pd, Soiptd};

    const OMEGAS: [f64; 5] = [5.0, 8.0, 12.0, 20.0, 35.0];

    fn optimum() -> (Soiptd, Controller) {
        let process = Soiptd::new(1.0, 0.05, 1.0, 0.02).unwrap();
        let pd: Pd = crate::soiptd_pd::pd(&process, 0.35).unwrap().pd;
        (process, pd.into())
    }

    fn models(processes: &[Soiptd]) -> Vec<Model> {
        processes.iter().map(|&process| process.into()).collect()
    }

    // Gains alone differ, 0.80 to 1.20 in 41 steps of 1 %: 5 % of 40 is the third of them, 0.82, and 95 % the one of
    // 1.18. The phase has no band, and the locus's edges are those loci, to the order of the curve's turning.
    #[test]
    fn a_band_of_gains_is_a_band_of_magnitudes() {
        let (process, controller) = optimum();
        let processes: Vec<Soiptd> = (0..=40)
            .map(|k| process.with_gain_scaled(0.8 + 0.01 * f64::from(k)).unwrap())
            .collect();
        let bands = loop_bands(&process.into(), &models(&processes), &controller, &OMEGAS).unwrap();
        for (k, &omega) in OMEGAS.iter().enumerate() {
            let at = loop_response(&process.into(), &controller, omega).unwrap();
            assert!((bands.magnitude.low[k] / at.magnitude - 0.82).abs() < 1e-12);
            assert!((bands.magnitude.high[k] / at.magnitude - 1.18).abs() < 1e-12);
            assert!((bands.phase_rad.low[k] - at.phase_rad).abs() < 1e-12);
            assert!(bands.phase_rad.high[k] - bands.phase_rad.low[k] < 1e-12);
        }
        let (low, high) = &bands.locus;
        let width = (high[2] - low[2]).norm();
        let locus = loop_response(&process.into(), &controller, OMEGAS[2]).unwrap();
        // The radius is not quite across the locus: its part across it is what is seen.
        assert!(width > 0.1 * 0.36 * locus.magnitude && width <= 0.36 * locus.magnitude);
    }

    // The step of each process alone is its own band, and the steps of all gains lie about it.
    #[test]
    fn steps_have_bands() {
        let (process, controller) = optimum();
        let times_s = [0.0, 0.01, 0.05, 0.1, 0.4, 3.0];
        let alone = step_bands(&models(&[process]), &controller, &times_s).unwrap();
        assert_eq!(alone.output.low, alone.output.high);
        assert_eq!(alone.settling, 1.0);
        let unstable = process.with_gain_scaled(9.0).unwrap();
        let weak = process.with_gain_scaled(0.9).unwrap();
        let strong = process.with_gain_scaled(1.1).unwrap();
        let both = step_bands(
            &models(&[weak, strong, unstable, unstable]),
            &controller,
            &times_s,
        )
        .unwrap();
        assert_eq!(both.settling, 0.5);
        // Before the dead time of 20 ms is over nothing has moved; at the end all have settled.
        assert_eq!((both.output.low[1], both.output.high[1]), (0.0, 0.0));
        for k in [2, 3] {
            assert!(both.output.low[k] < alone.output.low[k]);
            assert!(both.output.high[k] > alone.output.high[k]);
        }
        assert!((both.output.low[5] - 1.0).abs() < 1e-4);
        assert_eq!(
            step_bands(&models(&[unstable]), &controller, &times_s),
            None
        );
    }
}
