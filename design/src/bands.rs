//! 90 % bands of the step response and of the open loop over draws from a posterior.
//!
//! The bands are pointwise: at each time or frequency the band holds 90 % of the curves. A single curve may leave the
//! band at some points.

use num_complex::Complex64;

use crate::closed_loop::{load_response, loop_response, step_response};
use crate::controller::Controller;
use crate::model::Model;

/// Probabilities at the ends of a central 90 % interval.
const QUANTILES: (f64, f64) = (0.05, 0.95);

/// Ends (low, high) of the central 90 % interval of `values`. `None` if there are no values.
#[must_use]
pub fn quantiles(mut values: Vec<f64>) -> Option<(f64, f64)> {
    if values.is_empty() {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    let at = |q: f64| values[((values.len() - 1) as f64 * q).round() as usize];
    Some((at(QUANTILES.0), at(QUANTILES.1)))
}

/// Band about a curve. Both vectors have one value for each requested time or frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Lower ends.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
}

impl Band {
    /// Band of curves of equal length. `None` if there are no curves.
    fn of(curves: &[Vec<f64>]) -> Option<Self> {
        let count = curves.first()?.len();
        let ends = (0..count).map(|at| quantiles(curves.iter().map(|curve| curve[at]).collect()));
        let ends: Option<Vec<(f64, f64)>> = ends.collect();
        let (low, high) = ends?.into_iter().unzip();
        Some(Self { low, high })
    }
}

/// Bands of the response to a unit step.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct StepBands {
    /// Band of the process output (output unit).
    pub output: Band,
    /// Band of the controller output (input unit).
    pub input: Band,
    /// Share of the models on which the loop settles, 0 to 1. The bands leave out the other models.
    pub settling: f64,
}

/// Bands of the step responses of `models` under `controller` at the times `times_s` (s). `None` if the loop settles on
/// none of the models.
#[must_use]
pub fn step_bands(models: &[Model], controller: &Controller, times_s: &[f64]) -> Option<StepBands> {
    let of = |model: &Model| {
        let response = step_response(model, controller).ok()?;
        Some(times_s.iter().map(|&time_s| response.at(time_s)).collect())
    };
    bands_of(models, of)
}

/// Bands of the responses of `models` under `controller` to a unit step of the load, as [`step_bands`].
#[must_use]
pub fn load_bands(models: &[Model], controller: &Controller, times_s: &[f64]) -> Option<StepBands> {
    let of = |model: &Model| {
        let response = load_response(model, controller).ok()?;
        Some(times_s.iter().map(|&time_s| response.at(time_s)).collect())
    };
    bands_of(models, of)
}

/// Bands of the curves of output and input of the models that have one.
fn bands_of(models: &[Model], of: impl Fn(&Model) -> Option<Vec<(f64, f64)>>) -> Option<StepBands> {
    let found: Vec<Vec<(f64, f64)>> = models.iter().filter_map(of).collect();
    let curves = |value: fn(&(f64, f64)) -> f64| -> Vec<Vec<f64>> {
        let one = |curve: &Vec<(f64, f64)>| curve.iter().map(value).collect();
        found.iter().map(one).collect()
    };
    Some(StepBands {
        output: Band::of(&curves(|(output, _)| *output))?,
        input: Band::of(&curves(|(_, input)| *input))?,
        settling: found.len() as f64 / models.len() as f64,
    })
}

/// Bands of the open loop.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoopBands {
    /// Band of the magnitude (1).
    pub magnitude: Band,
    /// Band of the unwrapped phase (rad).
    pub phase_rad: Band,
    /// Two edges of the band about the Nyquist locus, one point a frequency, measured perpendicularly to the locus.
    pub locus: (Vec<Complex64>, Vec<Complex64>),
}

/// Bands of the open loops of `models` under `controller`, about the open loop of `centre`, at ascending frequencies
/// (rad/s).
///
/// `None` if there are no models or fewer than two frequencies, or if the loop of `centre` has no
/// [margins](crate::margins).
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

/// Unit vectors perpendicular to a curve at its points. `None` if there are fewer than two points.
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

    // 41 processes whose gains are 0.80 to 1.20 in steps of 0.01, equal otherwise. The 5 % quantile has the index
    // 0.05 * 40 = 2, the gain 0.82; the 95 % quantile has the index 38, the gain 1.18. The phase does not depend on the
    // gain, so its band has no width.
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
        // A gain moves the locus along its radius by 0.36 of the magnitude. The band is the part of this that is
        // perpendicular to the locus.
        assert!(width > 0.1 * 0.36 * locus.magnitude && width <= 0.36 * locus.magnitude);
    }

    // A load of 1 on a P loop of gain Kp around an integrating process leaves 1/Kp, and the controller's output comes to -1:
    // with Kp = 0.5 that is 2 for every process.
    #[test]
    fn loads_have_bands() {
        let (process, _) = optimum();
        let weak = process.with_gain_scaled(0.9).unwrap();
        let controller = Controller::from(crate::controller::Pid::new(0.5, 0.0, 0.0));
        let bands = load_bands(&models(&[weak, process]), &controller, &[0.0, 0.5, 60.0]).unwrap();
        assert_eq!((bands.output.low[0], bands.settling), (0.0, 1.0));
        assert!(bands.output.low[1] < bands.output.high[1]);
        assert!(
            (bands.output.low[2] - 2.0).abs() < 1e-3 && (bands.input.high[2] + 1.0).abs() < 1e-3
        );
    }

    // The band of one process has no width. Gains of 0.9 and 1.1 lie on either side of it. The loop is unstable at nine
    // times the gain, so half of the four models settle.
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
        // Zero during the dead time of 20 ms; at 3 s all responses have settled at 1.
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
