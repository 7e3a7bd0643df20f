//! The PD that minimises the ISE of a process at a phase margin (the paper's equations 11 to 13;
//! Ayyad, Chehadeh, Awad, Zweiri 2020).
//!
//! A gain crossover `w` and a phase margin fix the controller in closed form, so the search is over
//! the crossover alone:
//!
//! ```text
//! lead(w) = PM - pi - arg G(jw)        rises with w; from 0 to pi/2 both gains are positive
//! Kp = cos(lead) / |G(jw)|
//! Kd = sin(lead) / (w |G(jw)|)
//! ```
//!
//! The cost is scanned and its derivative then solved for zero: the cost itself is flat at its
//! minimum and would give the gains to eight digits at best.
//!
//! The paper's constraint is an equality. A margin above it is cheaper only where the dead time
//! dominates the lags; [`pd`] looks for it, [`pd_at_phase_margin`] does not.

use std::f64::consts::FRAC_PI_2;

use onecycle_onboard::{Pd, Soiptd};

use crate::roots::{falling_root, root};
use crate::soiptd_pd::cost::ise_at_crossover;
use crate::soiptd_pd::margins::{Margins, margins};
use crate::soiptd_pd::open_loop::{OpenLoop, lead_for_margin};

/// Points of the scan per unit of the search coordinate: the valley is about one unit wide.
const SCAN_POINTS_PER_UNIT: f64 = 3.0;

/// Part of the highest crossover that the scan leaves out at either end; the cost there is some
/// 1e4 times that of the valley.
const LEFT_OUT: f64 = 1e-4;

/// Step of the central differences, in natural logarithms: its sixth power is below rounding.
const DIFFERENCE_STEP: f64 = 1.0 / 256.0;

/// Of the search coordinate and of the margin (rad): what rounding leaves of the differences.
const TOLERANCE: f64 = 1e-12;

/// No margin above this is cheaper than it (rad), 57 deg: the free optimum has the largest margin,
/// 51 deg, where the dead time is everything.
const LARGEST_FREE_MARGIN_RAD: f64 = 1.0;

/// The best PD of a process, what it costs and what it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimum {
    /// Gains, of the sign of the process's gain.
    pub pd: Pd,
    /// Integral of the squared error of a unit step (output unit^2 s).
    pub ise: f64,
    /// Lead of the controller at the gain crossover (rad), 0 to `pi/2`.
    pub lead_rad: f64,
    /// Margins of the loop.
    pub margins: Margins,
}

/// Why a process has no optimal PD.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OptimumError {
    /// The phase margin asked for is outside the open interval from zero to `pi/2`. Inside it every
    /// process has a PD; from `pi/2` a double integrator has none.
    #[error("the phase margin must lie between 0 and pi/2 rad, but is {0} rad")]
    PhaseMargin(f64),
    /// The gain or the times are so extreme that gains or cost overflow.
    #[error("the process is too extreme for its optimal gains to be representable")]
    Overflow,
}

/// ISE-optimal PD among those with exactly this phase margin.
///
/// # Errors
/// [`OptimumError::PhaseMargin`] outside `(0, pi/2)`; [`OptimumError::Overflow`] for processes near
/// the limits of `f64`.
pub fn pd_at_phase_margin(
    process: &Soiptd,
    phase_margin_rad: f64,
) -> Result<Optimum, OptimumError> {
    at_margin(process, phase_margin_rad)?.optimum(process)
}

/// ISE-optimal PD among those with at least this phase margin.
///
/// # Errors
/// Those of [`pd_at_phase_margin`].
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

/// A gain crossover and a phase margin: the coordinates of a PD in which the search runs.
#[derive(Clone, Copy, Debug)]
struct Design {
    crossover_rad_per_s: f64,
    phase_margin_rad: f64,
}

/// The best crossover at a margin.
fn at_margin(process: &Soiptd, phase_margin_rad: f64) -> Result<Design, OptimumError> {
    if !(phase_margin_rad > 0.0 && phase_margin_rad < FRAC_PI_2) {
        return Err(OptimumError::PhaseMargin(phase_margin_rad));
    }
    let highest = highest_crossover(process, phase_margin_rad).ok_or(OptimumError::Overflow)?;
    // The search coordinate z = ln(highest/w - 1) resolves both ends, however near the optimum.
    let design = |z: f64| Design {
        crossover_rad_per_s: highest / (1.0 + z.exp()),
        phase_margin_rad,
    };
    let cost = |z| design(z).cost(process);
    let point = |i: usize| LEFT_OUT.ln() + i as f64 / SCAN_POINTS_PER_UNIT;

    let cells = (-2.0 * LEFT_OUT.ln() * SCAN_POINTS_PER_UNIT).ceil() as usize;
    let (best, _) = (0..=cells)
        .map_while(|i| cost(point(i)).map(|cost| (i, cost)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .ok_or(OptimumError::Overflow)?;
    let slope = |z: f64| derivative(cost, z).unwrap_or(f64::INFINITY);
    let (low, high) = (point(best.saturating_sub(1)), point(best + 1));
    Ok(design(root(slope, low, high, TOLERANCE)))
}

/// Gain crossover (rad/s) at which the margin takes a lead of `pi/2`, all of it derivative.
fn highest_crossover(process: &Soiptd, phase_margin_rad: f64) -> Option<f64> {
    let start = 1.0 / (process.t_prop_s() + process.tau_s());
    falling_root(
        |omega| FRAC_PI_2 - lead_for_margin(process, omega, phase_margin_rad),
        start,
    )
}

impl Design {
    fn open_loop(&self, process: &Soiptd) -> OpenLoop {
        let lead_rad = lead_for_margin(process, self.crossover_rad_per_s, self.phase_margin_rad);
        OpenLoop::crossing_at(process, self.crossover_rad_per_s, lead_rad)
    }

    /// `None` unless both gains are positive: a lag by a negative `kd` is never the optimum (the
    /// least lead of any optimum is 30 deg, again where the dead time is everything).
    fn cost(&self, process: &Soiptd) -> Option<f64> {
        let open_loop = self.open_loop(process);
        if open_loop.kp <= 0.0 || open_loop.kd < 0.0 {
            return None;
        }
        ise_at_crossover(&open_loop, self.crossover_rad_per_s, self.phase_margin_rad)
    }

    /// Derivative of the least cost with respect to the logarithm of the margin; at the best
    /// crossover the cost is stationary in it, so that its change does not count.
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

/// Central difference over seven points; `None` where the function is not defined on all of them.
fn derivative(f: impl Fn(f64) -> Option<f64>, x: f64) -> Option<f64> {
    let difference = |n: f64| Some(f(x + n * DIFFERENCE_STEP)? - f(x - n * DIFFERENCE_STEP)?);
    let sum = 45.0 * difference(1.0)? - 9.0 * difference(2.0)? + difference(3.0)?;
    Some(sum / (60.0 * DIFFERENCE_STEP))
}
