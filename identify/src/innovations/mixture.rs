//! Posterior of the process, averaged over the intensity of the noise.
//!
//! A short record tells the intensity of a slow disturbance badly, and intervals at the best intensity alone are too
//! narrow. So the other unknowns are fitted at a grid of intensities, and the posterior is the mixture of the Gaussian
//! approximations there, each with the weight of its likelihood times the volume of its Gaussian. The prior is flat in
//! the logarithm of the intensity. Noises that the best fit does not have are part of the mixture: one that is too weak to
//! show still widens the intervals.

use super::descent::{Found, Patience, descend};
use super::laplace::Laplace;
use super::record::Blocks;
use super::theta::{Bounds, NoiseKind};

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

/// Components about the best fit. Empty if the unknowns have no joint maximum.
pub(super) fn mixture(blocks: &Blocks<'_>, best: &Found, bounds: &Bounds) -> Vec<Component> {
    let process: Vec<usize> = (0..=best.theta.layout().tau()).collect();
    let of = |found: Found| {
        let laplace = Laplace::new(blocks, &found, &process, bounds)?;
        let volume = laplace.half_log_determinant();
        // An unknown at its bound has no volume. It counts as the others of the best fit do.
        Some((found.at.log_likelihood + volume, found, laplace))
    };
    let Some(centre) = of(best.clone()) else {
        return vec![];
    };
    let unknowns = centre.2.free.len();
    let mut points = vec![centre];
    for kind in best.theta.noises() {
        let index = best.theta.layout().noise(kind);
        if bounds.is_at_edge(&best.theta, index) {
            continue;
        }
        for direction in [-1.0, 1.0] {
            let lowest = (3.0 / blocks.length_s()).ln();
            let mut theta = best.theta;
            for _ in 0..POINTS {
                theta.values[index] += direction * SPACING;
                if theta.values[index] < lowest || theta.values[index] > bounds.high[index] {
                    break;
                }
                let others: Vec<usize> = others(&theta, kind);
                let fitted = descend(blocks, &theta, &others, bounds, WARM);
                let Some(point) = fitted.and_then(of) else {
                    break;
                };
                theta = point.1.theta;
                let (weight, is_whole) = (point.0, point.2.free.len() == unknowns);
                if is_whole {
                    points.push(point);
                }
                if weight < points[0].0 + NEGLIGIBLE {
                    break;
                }
            }
        }
    }
    for kind in NoiseKind::ALL {
        // Without an integrator the walk of the output replaces the disturbance: another model.
        let is_other =
            kind == NoiseKind::OutputWalk && best.theta.structure.stages().integrators == 0;
        if best.theta.noise(kind) > 0.0 || is_other {
            continue;
        }
        let mut theta = best.theta;
        let index = theta.layout().noise(kind);
        theta.set_noise(kind, 3.0 / blocks.length_s());
        for _ in 0..HIDDEN_POINTS {
            let fitted = descend(blocks, &theta, &others(&theta, kind), bounds, HIDDEN);
            let Some(point) = fitted.and_then(of) else {
                break;
            };
            let weight = point.0;
            theta = point.1.theta;
            theta.values[index] += HIDDEN_SPACING;
            if point.2.free.len() == unknowns {
                points.push(point);
            }
            if weight < points[0].0 + NEGLIGIBLE || theta.values[index] > bounds.high[index] {
                break;
            }
        }
    }
    let most = points
        .iter()
        .map(|point| point.0)
        .fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = points.iter().map(|point| (point.0 - most).exp()).sum();
    (points.into_iter())
        .map(|(weight, found, laplace)| Component {
            weight: (weight - most).exp() / total,
            found,
            laplace,
        })
        .collect()
}

/// Unknowns to fit while the intensity of `kind` is fixed.
fn others(theta: &super::theta::Theta, kind: NoiseKind) -> Vec<usize> {
    let fixed = theta.layout().noise(kind);
    theta
        .free()
        .into_iter()
        .filter(|index| *index != fixed)
        .collect()
}
