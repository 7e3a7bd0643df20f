//! Posterior of the process, averaged over the intensity of the noise.
//!
//! A short record tells the intensity of a slow disturbance badly, and intervals at the best intensity alone are too
//! narrow. So the other unknowns are fitted at a grid of intensities, and the posterior is the mixture of the Gaussian
//! approximations there, each with the weight of its likelihood times the volume of its Gaussian. The prior is flat in
//! the logarithm of the intensity. Noises that the best fit does not have are part of the mixture: one that is too weak to
//! show still widens the intervals.

use super::descent::{Found, Patience, descend};
use super::laplace::Laplace;
use super::near_lags::NearLags;
use super::record::Blocks;
use super::theta::{Bounds, NoiseKind, Theta};

/// Distance of the grid's points in `ln w`.
const SPACING: f64 = 0.45;
/// Most points on each side of the best intensity.
const POINTS: usize = 6;
/// Logarithm of the weight relative to the best below which the grid ends.
const NEGLIGIBLE: f64 = -6.0;
/// Grid of a noise that the best fit does not have: too weak to show, but perhaps there.
const HIDDEN_SPACING: f64 = 0.8;
const HIDDEN_POINTS: usize = 8;
const HIDDEN: Patience = Patience {
    steps: 3,
    decrease: 1e-4,
};
const WARM: Patience = Patience {
    steps: 6,
    decrease: 1e-5,
};

/// Gaussian component of the posterior.
#[derive(Clone, Debug)]
pub(super) struct Component {
    /// Share of the probability, 0 to 1.
    pub(super) weight: f64,
    pub(super) found: Found,
    pub(super) laplace: Laplace,
}

/// Fit with the logarithm of its weight, before the weights are normalised.
struct Point {
    log_weight: f64,
    found: Found,
    laplace: Laplace,
}

impl Point {
    fn of(blocks: &Blocks<'_>, found: Found, near: &NearLags, bounds: &Bounds) -> Option<Self> {
        let process = process(&found.theta);
        let laplace = Laplace::new(blocks, &found, (&process, near), bounds)?;
        Some(Self {
            log_weight: found.at.log_likelihood + laplace.half_log_determinant(),
            found,
            laplace,
        })
    }
}

/// Unknowns of the process.
fn process(theta: &Theta) -> Vec<usize> {
    (0..=theta.layout().tau()).collect()
}

/// The lags of a fit that are nearly equal, and its pole. All components have the coordinates of the best one: volumes in others do not
/// compare.
fn near_lags(blocks: &Blocks<'_>, found: &Found) -> NearLags {
    NearLags::of(&found.theta, &process(&found.theta), blocks.length_s())
}

/// The one component of a fit. `None` if the unknowns have no joint maximum.
pub(super) fn of_one(blocks: &Blocks<'_>, found: &Found, bounds: &Bounds) -> Option<Component> {
    let point = Point::of(blocks, found.clone(), &near_lags(blocks, found), bounds)?;
    Some(Component {
        weight: 1.0,
        found: point.found,
        laplace: point.laplace,
    })
}

/// Components about the best fit. Empty if the unknowns have no joint maximum.
pub(super) fn mixture(blocks: &Blocks<'_>, best: &Found, bounds: &Bounds) -> Vec<Component> {
    let near = near_lags(blocks, best);
    let Some(centre) = Point::of(blocks, best.clone(), &near, bounds) else {
        return vec![];
    };
    let has_integrator = best.theta.structure.stages().integrators > 0;
    let mut points = vec![centre];
    for kind in NoiseKind::ALL {
        let index = best.theta.layout().noise(kind);
        if best.theta.noise(kind) > 0.0 {
            if !bounds.is_at_edge(&best.theta, index) {
                for step in [-SPACING, SPACING] {
                    let mut start = best.theta;
                    start.values[index] += step;
                    let grid = (step, POINTS, WARM);
                    walk(blocks, (start, kind), grid, (&near, bounds), &mut points);
                }
            }
        } else if has_integrator || kind != NoiseKind::OutputWalk {
            // Without an integrator the walk of the output would replace the disturbance: another model.
            let mut start = best.theta;
            start.set_noise(kind, 3.0 / blocks.length_s());
            let grid = (HIDDEN_SPACING, HIDDEN_POINTS, HIDDEN);
            walk(blocks, (start, kind), grid, (&near, bounds), &mut points);
        }
    }
    let weights = points.iter().map(|point| point.log_weight);
    let most = weights.clone().fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = weights.map(|weight| (weight - most).exp()).sum();
    (points.into_iter())
        .map(|point| Component {
            weight: (point.log_weight - most).exp() / total,
            found: point.found,
            laplace: point.laplace,
        })
        .collect()
}

/// Adds fits along the intensity of one noise, from `start` in steps of `ln w`, until their weight is negligible. The
/// first of `points` is the best fit. An unknown at its bound has no volume, so that such a fit has no weight.
fn walk(
    blocks: &Blocks<'_>,
    (start, kind): (Theta, NoiseKind),
    (step, most, patience): (f64, usize, Patience),
    (near, bounds): (&NearLags, &Bounds),
    points: &mut Vec<Point>,
) {
    let index = start.layout().noise(kind);
    let lowest = (3.0 / blocks.length_s()).ln();
    let range = lowest - 1e-9..=bounds.high[index];
    let mut theta = start;
    for _ in 0..most {
        if !range.contains(&theta.values[index]) {
            break;
        }
        let fitted = descend(blocks, &theta, &others(&theta, kind), bounds, patience);
        let Some(point) = fitted.and_then(|found| Point::of(blocks, found, near, bounds)) else {
            break;
        };
        theta = point.found.theta;
        theta.values[index] += step;
        let is_negligible = point.log_weight < points[0].log_weight + NEGLIGIBLE;
        if point.laplace.free.len() == points[0].laplace.free.len() {
            points.push(point);
        }
        if is_negligible {
            break;
        }
    }
}

/// Unknowns to fit while the intensity of `kind` is fixed.
fn others(theta: &Theta, kind: NoiseKind) -> Vec<usize> {
    let fixed = theta.layout().noise(kind);
    theta
        .free()
        .into_iter()
        .filter(|index| *index != fixed)
        .collect()
}
