//! PD of least ISE at a phase margin.
//!
//! A gain crossover `w` (rad/s) and a phase margin `PM` (rad) determine the PD in closed form, so the search is over
//! the gain crossover alone:
//!
//! ```text
//! lead(w) = PM - pi - arg G(jw)        rises with w; from 0 to pi/2 both gains are positive
//! Kp = cos(lead) / |G(jw)|
//! Kd = sin(lead) / (w |G(jw)|)
//! ```
//!
//! The cost is scanned over the crossover; then the root of its derivative is solved for. The cost is flat at its
//! minimum, so minimising the cost itself would give the gains to eight digits at best.
//!
//! The paper's constraint is an equality. [`pd_at_phase_margin`] keeps it. [`pd`] also tries larger margins, which cost
//! less only if the dead time dominates the lags.
//!
//! The IAE and the ITAE have no closed form, and the ITAE is often least above the floor of the margin. [`pd_by`] searches
//! for their optimum over crossover and margin at once.
//!
//! Reference: the paper's equations 11 to 13 (Ayyad, Chehadeh, Awad, Zweiri 2020).

use std::f64::consts::FRAC_PI_2;

use onecycle_onboard::{Pd, Soiptd};

use crate::roots::{falling_root, root};
use crate::soiptd_pd::cost::ise_at_crossover;
use crate::soiptd_pd::criterion::Criterion;
use crate::soiptd_pd::margins::{Margins, margins};
use crate::soiptd_pd::open_loop::{OpenLoop, lead_for_margin};
use crate::synthesis::simplex::{Best, Extent, minimise};

/// Points of the scan per unit of the search coordinate. The minimum of the cost is about one unit wide.
const SCAN_POINTS_PER_UNIT: f64 = 3.0;

/// Points of the scan below the crossover of an optimum: a seventh of it needs no lead any more.
const SCANNED_BELOW: u32 = 30;

/// Fraction of the highest crossover that the scan leaves out at either end. The cost there is about 1e4 times the
/// minimum.
const LEFT_OUT: f64 = 1e-4;

/// Step of the central differences, in natural logarithms. Its sixth power, 4e-15, is the order of their relative
/// error.
const DIFFERENCE_STEP: f64 = 1.0 / 256.0;

/// Tolerance of the search coordinate and of the margin (rad): the rounding error of the differences.
const TOLERANCE: f64 = 1e-12;

/// Upper bound of the phase margin of an unconstrained optimum (rad), 57 deg. The largest such margin, 51 deg, is that
/// of a process that is nothing but dead time.
const LARGEST_FREE_MARGIN_RAD: f64 = 1.0;

/// Optimal PD of a process, with its cost and margins.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Optimum {
    /// Gains. They have the sign of the gain of the process.
    pub pd: Pd,
    /// Integral of the squared error of a unit step (output unit^2 s).
    pub ise: f64,
    /// Phase that the controller adds at the gain crossover (rad), 0 to `pi/2`.
    pub lead_rad: f64,
    /// Stability margins of the loop.
    pub margins: Margins,
}

/// Why no optimal PD was found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptimumError {
    /// The specified phase margin (rad) is not between 0 and `pi/2`. Every process has a PD for a margin between these;
    /// a double integrator has none for a margin of `pi/2` or more.
    #[error("the phase margin must lie between 0 and pi/2 rad, but is {0} rad")]
    PhaseMargin(f64),
    /// The gain or the time constants of the process are so large or small that the gains or the cost overflow.
    #[error("the process is too extreme for its optimal gains to be representable")]
    Overflow,
}

/// PD of least ISE among those with exactly this phase margin.
///
/// # Errors
/// - [`OptimumError::PhaseMargin`]: the phase margin is not between 0 and `pi/2`.
/// - [`OptimumError::Overflow`]: the parameters of the process are near the limits of `f64`.
pub fn pd_at_phase_margin(
    process: &Soiptd,
    phase_margin_rad: f64,
) -> Result<Optimum, OptimumError> {
    at_margin(process, phase_margin_rad)?.optimum(process)
}

/// PD of least ISE among those with at least this phase margin.
///
/// # Errors
/// The errors of [`pd_at_phase_margin`].
pub fn pd(process: &Soiptd, phase_margin_floor_rad: f64) -> Result<Optimum, OptimumError> {
    let at_floor = at_margin(process, phase_margin_floor_rad)?;
    if at_floor.slope_along_margin(process) >= 0.0
        || phase_margin_floor_rad >= LARGEST_FREE_MARGIN_RAD
    {
        return at_floor.optimum(process);
    }
    let slope = |phase_margin_rad| {
        at_margin(process, phase_margin_rad).map_or(0.0, |best| best.slope_along_margin(process))
    };
    let free = root(
        slope,
        phase_margin_floor_rad,
        LARGEST_FREE_MARGIN_RAD,
        TOLERANCE,
    );
    at_margin(process, free)?.optimum(process)
}

/// PD of least derivative gain at the phase margin of an optimum, among those that cost at most the fraction `excess` more.
///
/// The noise of the measurement reaches the actuator through the derivative gain. At the optimum the cost is flat and that
/// gain is not: 2 % of the cost save 15 % of the gain (11 to 20 % over random multirotors).
///
/// # Errors
/// The errors of [`pd_at_phase_margin`].
pub fn quieter(process: &Soiptd, best: &Optimum, excess: f64) -> Result<Optimum, OptimumError> {
    if excess <= 0.0 {
        return Ok(*best);
    }
    // The derivative gain rises with the crossover.
    let point = |ln_crossover: f64| SearchPoint {
        crossover_rad_per_s: ln_crossover.exp(),
        phase_margin_rad: best.margins.phase_margin_rad,
    };
    let too_much = |ln_crossover| {
        let cost = point(ln_crossover).cost(process);
        cost.map_or(f64::INFINITY, |cost| cost / best.ise - 1.0 - excess)
    };
    let high = best.margins.gain_crossover_rad_per_s.ln();
    let low = (1..=SCANNED_BELOW)
        .map(|i| high - f64::from(i) / SCAN_POINTS_PER_UNIT)
        .find(|z| too_much(*z) > 0.0)
        .ok_or(OptimumError::Overflow)?;
    point(root(too_much, low, high, TOLERANCE)).optimum(process)
}

/// The search for the least IAE or ITAE: first steps of its coordinates, where it ends (the gains to some 1e-4, the cost
/// to 1e-7), and most evaluations.
const SEARCH: Extent = Extent {
    size: 0.3,
    tolerance: 1e-4,
    evaluations: 200,
};

/// First excess of the phase margin over its floor (rad), and the largest margin of the search (rad).
const FIRST_EXCESS_RAD: f64 = 0.36;
const LARGEST_MARGIN_RAD: f64 = 1.55;

/// PD of least cost by a criterion among those with at least this phase margin.
///
/// # Errors
/// The errors of [`pd_at_phase_margin`].
pub fn pd_by(
    criterion: Criterion,
    process: &Soiptd,
    phase_margin_floor_rad: f64,
) -> Result<Optimum, OptimumError> {
    if criterion == Criterion::Ise {
        return pd(process, phase_margin_floor_rad);
    }
    let at_floor = at_margin(process, phase_margin_floor_rad)?;
    // Coordinates: that of the gain crossover, and the root of the excess of the margin, which is zero at the floor.
    let point =
        |at: &[f64]| SearchPoint::at(process, at[0], phase_margin_floor_rad + at[1] * at[1]);
    let cost = |point: &SearchPoint| {
        let open_loop = point.open_loop(process);
        let is_allowed = open_loop.kp > 0.0 && open_loop.kd >= 0.0;
        is_allowed
            .then(|| criterion.cost(process, open_loop.pd(process)))
            .flatten()
    };
    let mut value = |at: &[f64]| {
        let point = point(at).filter(|point| point.phase_margin_rad < LARGEST_MARGIN_RAD);
        point
            .and_then(|point| cost(&point))
            .unwrap_or(f64::INFINITY)
    };
    let first_rad = FIRST_EXCESS_RAD.min(0.5 * (LARGEST_MARGIN_RAD - phase_margin_floor_rad));
    let start = vec![
        at_floor.coordinate(process).ok_or(OptimumError::Overflow)?,
        first_rad.sqrt(),
    ];
    let start = Best {
        value: value(&start),
        point: start,
    };
    let found = minimise(&mut value, &start, SEARCH);
    let best = point(&found.point).filter(|_| found.value.is_finite());
    best.ok_or(OptimumError::Overflow)?.optimum(process)
}

/// PD given by its gain crossover and phase margin, the coordinates of the search.
#[derive(Clone, Copy, Debug)]
struct SearchPoint {
    crossover_rad_per_s: f64,
    phase_margin_rad: f64,
}

/// Point of least cost at a phase margin.
fn at_margin(process: &Soiptd, phase_margin_rad: f64) -> Result<SearchPoint, OptimumError> {
    if !(phase_margin_rad > 0.0 && phase_margin_rad < FRAC_PI_2) {
        return Err(OptimumError::PhaseMargin(phase_margin_rad));
    }
    let highest = highest_crossover(process, phase_margin_rad).ok_or(OptimumError::Overflow)?;
    let point = |z: f64| SearchPoint {
        crossover_rad_per_s: highest / (1.0 + z.exp()),
        phase_margin_rad,
    };
    let cost = |z| point(z).cost(process);
    let node = |i: usize| LEFT_OUT.ln() + i as f64 / SCAN_POINTS_PER_UNIT;

    let cells = (-2.0 * LEFT_OUT.ln() * SCAN_POINTS_PER_UNIT).ceil() as usize;
    let (best, _) = (0..=cells)
        .map_while(|i| cost(node(i)).map(|cost| (i, cost)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .ok_or(OptimumError::Overflow)?;
    let slope = |z: f64| derivative(cost, z).unwrap_or(f64::INFINITY);
    let (low, high) = (node(best.saturating_sub(1)), node(best + 1));
    Ok(point(root(slope, low, high, TOLERANCE)))
}

/// Gain crossover (rad/s) at which the phase margin needs a lead of `pi/2`, that is `Kp` = 0. No PD with positive gains
/// has a higher one at this margin.
fn highest_crossover(process: &Soiptd, phase_margin_rad: f64) -> Option<f64> {
    let start = 1.0 / (process.t_prop_s() + process.tau_s());
    falling_root(
        |omega| FRAC_PI_2 - lead_for_margin(process, omega, phase_margin_rad),
        start,
    )
}

impl SearchPoint {
    /// The point with the search coordinate `z = ln(highest/w - 1)`, which resolves optima near either end of the range
    /// of crossovers.
    fn at(process: &Soiptd, z: f64, phase_margin_rad: f64) -> Option<Self> {
        let highest = highest_crossover(process, phase_margin_rad)?;
        Some(Self {
            crossover_rad_per_s: highest / (1.0 + z.exp()),
            phase_margin_rad,
        })
    }

    /// Its search coordinate.
    fn coordinate(&self, process: &Soiptd) -> Option<f64> {
        let highest = highest_crossover(process, self.phase_margin_rad)?;
        Some((highest / self.crossover_rad_per_s - 1.0).ln())
    }

    fn open_loop(&self, process: &Soiptd) -> OpenLoop {
        let lead_rad = lead_for_margin(process, self.crossover_rad_per_s, self.phase_margin_rad);
        OpenLoop::crossing_at(process, self.crossover_rad_per_s, lead_rad)
    }

    /// ISE (output unit^2 s). `None` if `kp` is not positive or `kd` is negative. A negative `kd` is never optimal: the
    /// least lead of any optimum is 30 deg, for a process that is nothing but dead time.
    fn cost(&self, process: &Soiptd) -> Option<f64> {
        let open_loop = self.open_loop(process);
        if open_loop.kp <= 0.0 || open_loop.kd < 0.0 {
            return None;
        }
        ise_at_crossover(&open_loop, self.crossover_rad_per_s, self.phase_margin_rad)
    }

    /// Derivative of the least cost with respect to the logarithm of the phase margin. The cost is stationary in the
    /// crossover at the best crossover, so the crossover is held fixed.
    fn slope_along_margin(&self, process: &Soiptd) -> f64 {
        let cost = |ln_margin: f64| {
            Self {
                phase_margin_rad: ln_margin.exp(),
                ..*self
            }
            .cost(process)
        };
        derivative(cost, self.phase_margin_rad.ln()).unwrap_or(0.0)
    }

    fn optimum(&self, process: &Soiptd) -> Result<Optimum, OptimumError> {
        let open_loop = self.open_loop(process);
        let pd = open_loop.pd(process);
        let margins = margins(process, pd).ok_or(OptimumError::Overflow)?;
        let ise = self.cost(process).ok_or(OptimumError::Overflow)?;
        let lead_rad = open_loop.lead_rad(margins.gain_crossover_rad_per_s);
        Ok(Optimum {
            pd,
            ise,
            lead_rad,
            margins,
        })
    }
}

/// Derivative by the sixth-order central difference. `None` if `f` is undefined at one of its six points.
fn derivative(f: impl Fn(f64) -> Option<f64>, x: f64) -> Option<f64> {
    let difference = |n: f64| Some(f(x + n * DIFFERENCE_STEP)? - f(x - n * DIFFERENCE_STEP)?);
    let sum = 45.0 * difference(1.0)? - 9.0 * difference(2.0)? + difference(3.0)?;
    Some(sum / (60.0 * DIFFERENCE_STEP))
}
