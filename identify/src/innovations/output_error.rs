//! Disturbance or process: what a fit with disturbances leaves to them although the input explains it.
//!
//! A slow disturbance behind the lags explains a slow response to the input as well as the process does, and the likelihood,
//! which weighs the errors of one step, hardly minds. Then the gain is wrong and its interval narrow. Without feedback a true
//! disturbance has nothing to do with the input, so a fit without disturbances (output error) can take no more out of the
//! error of the simulation than chance allows. That much is known: the disturbances of the fit are simulated, and each is
//! fitted by the same parameters.
//!
//! ```text
//! R(theta) = |y - g(theta) kappa - X0 x0|^2      of the simulation, the initial state at its best
//! share    = 1 - R(fit without disturbances) / R(fit with them)
//! chance   = 1 - |z - P [g, dg/dtheta, X0] z|^2 / |z - P [X0] z|^2     of a simulated disturbance z, P: projection
//! ```
//!
//! Reference: the test of two estimators of which one is efficient and both are consistent if the model is right, J. A.
//! Hausman, Econometrica 46 (1978).

use std::cell::LazyCell;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::descent::{Found, Patience};
use super::filter;
use super::likelihood::regressors;
use super::orthogonal::Orthogonal;
use super::record::Blocks;
use super::search::{self, Candidate};
use super::system::{System, by_size};
use super::theta::{Bounds, Theta};
use super::validate;
use crate::thresholds::LEFT_UNDER_FEEDBACK;

/// Simulated disturbances: the test errs once in this number of records plus one.
const SIMULATED: usize = 99;
const SEED: u64 = 1;
const PATIENCE: Patience = Patience {
    steps: 40,
    decrease: 1e-6,
};

/// The fit without disturbances, if it explains more than a disturbance that is independent of the input leaves to chance, and
/// whether the innovations of that with disturbances refute it. `None` under feedback too, where the input follows the disturbance,
/// unless they do.
pub(super) fn instead(
    blocks: &Blocks<'_>,
    best: &Candidate,
    (is_known_feedback, longest_tau_s): (bool, f64),
) -> Option<(Candidate, bool)> {
    let with = &best.found;
    with.theta.noises().next()?;
    if blocks.record.forces.len() > 0 {
        return None;
    }
    // Innovations that past inputs explain are a fault of the fit under feedback too, however small they are.
    let is_refuted = LazyCell::new(|| {
        validate::is_left_to_the_input(&validate::tests_above(0.0, blocks, &with.at))
    });
    let is_fed_back = is_known_feedback || validate::is_fed_back(blocks);
    if is_fed_back && !*is_refuted {
        return None;
    }
    let quiet = with.theta.without_noises();
    let found = search::warm(blocks, &quiet, longest_tau_s, PATIENCE)?;
    let y = present(blocks);
    let simulation = Regressors::of(blocks, &found.theta)?;
    let left = simulation.all.left(&y);
    if is_fed_back && left / simulation.start.left(&y) > LEFT_UNDER_FEEDBACK {
        return None;
    }
    let is_more = explains_more(blocks, with, (&y, left), longest_tau_s)?;
    is_more.then(|| (Candidate::new(found), *is_refuted))
}

/// Compares two shares of the simulation's error: the one that the fit without disturbances removes, and those that it would
/// remove if the error were one of the simulated disturbances. Whether the first is larger than all of these. `left`: sum of
/// squares that the fit without disturbances leaves of the outputs `y`.
fn explains_more(
    blocks: &Blocks<'_>,
    with: &Found,
    (y, left): (&[f64], f64),
    longest_tau_s: f64,
) -> Option<bool> {
    let quiet = with.theta.without_noises();
    let before = Regressors::of(blocks, &quiet)?;
    let kept = before
        .start
        .left(&before.less_response(y, with.at.gain / blocks.scale));
    let share = 1.0 - left / kept;
    let bounds = Bounds::new(&quiet, blocks, longest_tau_s);
    let all = before.with_slopes(blocks, &quiet, with.at.gain / blocks.scale, &bounds)?;
    let deviation = with.at.variance.sqrt() / blocks.scale;
    let reaches = |disturbance: &[f64]| {
        let by_start = before.start.left(disturbance);
        by_start - all.left(disturbance) >= share * by_start
    };
    by_size!(
        with.theta,
        any_disturbance(blocks, &with.theta, deviation, &reaches)
    )
    .map(|is_reached: bool| !is_reached)
}

/// Whether any of the simulated disturbances `reaches` something. Each is random with the noise of `theta`, from an initial state
/// of zero, as sums over the blocks that have samples; `deviation`: that of the white noise of a sample. `None` if the filter does
/// not converge.
fn any_disturbance<const N: usize>(
    blocks: &Blocks<'_>,
    theta: &Theta,
    deviation: f64,
    reaches: &dyn Fn(&[f64]) -> bool,
) -> Option<bool> {
    let system = System::<N>::new(theta, blocks.record.dt_s);
    let lifted = system.lifted(blocks);
    let (runs, _) = filter::runs(system.start(blocks, &lifted)?, &lifted, blocks);
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let mut white = || {
        let normal: f64 = StandardNormal.sample(&mut random);
        deviation * normal
    };
    Some((0..SIMULATED).any(|_| reaches(&filter::coloured(&runs, &mut white))))
}

/// Sums of the outputs of the blocks that have samples.
fn present(blocks: &Blocks<'_>) -> Vec<f64> {
    let rows = (0..blocks.len()).filter(|block| blocks.present(*block) > 0);
    rows.map(|block| blocks.sums[block]).collect()
}

/// Columns of a simulation: the response to the input, then those of the initial state.
struct Regressors {
    /// The response first.
    columns: Vec<Vec<f64>>,
    start: Orthogonal,
    all: Orthogonal,
}

impl Regressors {
    fn of(blocks: &Blocks<'_>, theta: &Theta) -> Option<Self> {
        let columns = regressors(blocks, theta)?;
        Some(Self {
            start: Orthogonal::independent(&columns[1..]),
            all: Orthogonal::independent(&columns),
            columns,
        })
    }

    /// The same with the derivatives of the response to the unknowns of `theta`, times the gain.
    fn with_slopes(
        &self,
        blocks: &Blocks<'_>,
        theta: &Theta,
        gain: f64,
        bounds: &Bounds,
    ) -> Option<Orthogonal> {
        let mut columns = self.columns.clone();
        for index in theta.free() {
            // Forward differences, with ten times the step of the search: the response is not projected.
            let step = 10.0 * bounds.step[index];
            let mut moved = *theta;
            moved.values[index] += step;
            let other = regressors(blocks, &moved)?;
            let slope = other[0].iter().zip(&self.columns[0]);
            columns.push(slope.map(|(a, b)| gain * (a - b) / step).collect());
        }
        Some(Orthogonal::independent(&columns))
    }

    fn less_response(&self, y: &[f64], gain: f64) -> Vec<f64> {
        let pairs = y.iter().zip(&self.columns[0]);
        pairs.map(|(y, g)| y - gain * g).collect()
    }
}
