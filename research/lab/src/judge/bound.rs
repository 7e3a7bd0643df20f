//! Cost of the controllers of an ideal estimator: one without bias whose errors have the covariance of the Cramer-Rao bound.
//!
//! The true coordinates of a process plus a draw from the bound's covariance are what such an estimator would find. The
//! controller of least cost for that process is judged on the true one. The covariance is the one that our estimator states
//! for its window and its prior, so both have seen the same data.

use onecycle_design::matrix::cholesky;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_onboard::Soiptd;
use onecycle_onboard::refine::{Refined, coordinate};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::evaluate::{Answer, Judge};

/// Number of draws for each window, and so the number of ideal campaigns.
pub const BOUND_DRAWS: usize = 8;

/// Number of coordinates of a fit without the bias.
pub const SHAPE_AND_GAIN: usize = 4;

/// Coordinates of a process without the input bias, in the order of [`coordinate`].
pub(super) fn coordinates(process: &Soiptd) -> [f64; SHAPE_AND_GAIN] {
    let (pole_sum_per_s, ratio) = process.pole_sum();
    let mut at = [0.0; SHAPE_AND_GAIN];
    at[coordinate::LN_POLE_SUM] = pole_sum_per_s.ln();
    at[coordinate::POLE_RATIO] = ratio;
    at[coordinate::TAU_S] = process.tau_s();
    at[coordinate::LN_JERK_GAIN] = process.jerk_gain().abs().ln();
    at
}

/// The process at these coordinates, or the nearest one: without complex poles, negative damping or negative dead time.
/// `None` if a parameter is out of its range.
fn process_at(at: &[f64; SHAPE_AND_GAIN]) -> Option<Soiptd> {
    let ratio = at[coordinate::POLE_RATIO].clamp(0.0, 0.25);
    let sum_per_s = at[coordinate::LN_POLE_SUM].exp();
    let tau_s = at[coordinate::TAU_S].max(0.0);
    let unit = Soiptd::from_pole_sum(1.0, sum_per_s, ratio, tau_s).ok()?;
    let gain = at[coordinate::LN_JERK_GAIN].exp() * unit.t_prop_s();
    unit.with_gain_scaled(gain).ok()
}

/// Costs of the controllers for [`BOUND_DRAWS`] draws about the process `truth`, whose gain is positive. `None` without a
/// covariance, or if the fit has an error of the model; in it, if a drawn process has no controller.
#[must_use]
pub fn costs_at_bound(
    refined: &Refined,
    truth: &Soiptd,
    judge: &Judge,
) -> Option<[Option<Deterioration>; BOUND_DRAWS]> {
    let covariance = refined
        .covariance
        .filter(|_| refined.response_error == 0.0)?;
    let root = cholesky(&covariance)?;
    let centre = coordinates(truth);
    // The same process has the same draws.
    let mut rng = Pcg64Mcg::seed_from_u64(truth.t_prop_s().to_bits() ^ truth.tau_s().to_bits());
    Some(std::array::from_fn(|_| {
        let normal: [f64; 5] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
        let at = std::array::from_fn(|i| {
            centre[i] + (0..=i).map(|j| root[i][j] * normal[j]).sum::<f64>()
        });
        let ideal = Answer::of_process(process_at(&at)?).ok()?;
        Some(judge.deterioration(ideal.feedback))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    // The coordinates lead back to the process; beyond the domain they lead to its edge: equal lags, no damping, no dead time.
    #[test]
    fn coordinates_and_back() {
        let process = Soiptd::new(0.7, 0.05, 0.8, 0.02).unwrap();
        let at = coordinates(&process);
        let back = process_at(&at).unwrap();
        for (a, b) in at.iter().zip(coordinates(&back)) {
            assert!((a - b).abs() < 1e-12, "{at:?}");
        }
        let mut beyond = at;
        beyond[coordinate::TAU_S] = -0.01;
        beyond[coordinate::POLE_RATIO] = 0.3;
        let edge = process_at(&beyond).unwrap();
        assert_eq!(edge.tau_s(), 0.0);
        assert!((edge.t_prop_s() * edge.inv_t_body_per_s() - 1.0).abs() < 1e-12);
        beyond[coordinate::POLE_RATIO] = -0.1;
        assert_eq!(process_at(&beyond).unwrap().inv_t_body_per_s(), 0.0);
    }
}
