//! Cost of a shape on one process, at the largest gain that the limits allow.
//!
//! With an integral term the cost is the IAE of a unit step of the load, without one that of a unit step of the
//! reference. A shape whose least gain exceeds its largest one costs more, in proportion to the logarithm of the excess.

use crate::analysis::noise;
use crate::analysis::process::Process;
use crate::analysis::response::{Ending, Integrals, STEP_RAD, integrals};
use crate::analysis::{Law, OpenLoop};

use super::bands::{Allowed, Grid, allowed};
use super::limits::Limits;
use super::shape::{Family, is_in_range};

pub(crate) use crate::analysis::realisation::Excitation;

/// Value of a shape that has no cost.
pub(crate) const NO_COST: f64 = 1e3;

/// Weight of an infeasible gain: exact for slopes of the cost below it.
pub(crate) const PENALTY: f64 = 10.0;

/// Tolerance of the logarithm of a gain that noise or the peak of the input limits.
const GAIN_TOLERANCE: f64 = 1e-9;

/// Most evaluations of noise or peak for one gain.
const MOST_EVALUATIONS: usize = 12;

/// Limit of the noise at the actuator, in the units of the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseLimit {
    /// Largest amplification of the measurement noise.
    pub amplification: f64,
    /// Sample period of the noise.
    pub period: f64,
}

/// What a controller is designed for, in the units of the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Problem {
    pub process: Process,
    pub family: Family,
    pub limits: Limits,
    pub noise: Option<NoiseLimit>,
    /// Largest output of the controller after a unit step of the reference with `b = 0`, or `b = 1` without integral.
    pub input_peak: Option<f64>,
}

/// Gain of a shape.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Gain {
    pub k: f64,
    /// Frequency that limits it.
    pub omega: f64,
    /// Least gain.
    pub low: f64,
}

/// A problem with the grids of its process.
pub(crate) struct Objective {
    pub problem: Problem,
    grid: Grid,
    /// Rate of the output, for the rate loop of a cascade.
    rate: Option<(Process, Grid)>,
}

impl Problem {
    /// What excites the loop.
    pub(crate) fn excitation(&self) -> Excitation {
        if self.family.form.has_integral() {
            Excitation::Load
        } else {
            Excitation::Reference
        }
    }

    pub(crate) fn integrals(&self, law: &Law, omega: f64, refinement: f64) -> Option<Integrals> {
        let ending = if refinement > 1.0 { Ending::FINE } else { Ending::COARSE };
        let step = (STEP_RAD / (omega * refinement), ending);
        integrals(&self.process, law, self.excitation(), omega, step)
    }

    /// Lower bound of the logarithm of the cost of a shape with gain `k`: the IAE is at least `1/ki`.
    pub(crate) fn least_cost(&self, z: &[f64], k: f64) -> f64 {
        let ki = self.family.law(&self.process, z).ki * k;
        if ki > 0.0 { -ki.ln() } else { -NO_COST }
    }

    /// Frequency above which the magnitude of a loop with this law falls.
    pub(crate) fn corner(&self, law: &Law) -> f64 {
        let filter = if law.tf > 0.0 { 2.0 / law.tf } else { 0.0 };
        let derivative = match law.derivative_filter {
            Some(low_pass) if law.uses_derivative_filter() => 2.0 / low_pass.time_s(),
            _ => 0.0,
        };
        2.0 * self.process.highest_corner().max(filter).max(derivative)
    }
}

/// Loop of a unit gain: the process itself.
fn plant(process: &Process) -> OpenLoop {
    OpenLoop::new(process, &Law::pid(process, [1.0, 0.0, 0.0], 0.0))
}

impl Objective {
    /// Objective on grids with steps of this fraction of the frequency.
    pub(crate) fn new(problem: Problem, fraction: f64) -> Self {
        let grid = |process: &Process| Grid::new(process, plant(process), fraction);
        Self {
            problem,
            grid: grid(&problem.process),
            rate: problem.process.rate().map(|rate| (rate, grid(&rate))),
        }
    }

    /// Gains that the sensitivity and the margins allow a shape, of the loop and of the rate loop of a cascade. `None` if
    /// there is no upper limit.
    pub(crate) fn allowed(&mut self, z: &[f64]) -> Option<(Allowed, Option<Allowed>)> {
        let problem = self.problem;
        let Problem { process, family, limits, .. } = &problem;
        let law = family.law(process, z);
        let whole = self.on(&law)?;
        let Some((rate, rate_grid)) = &mut self.rate else {
            return Some((whole, None));
        };
        let Some(law) = family.rate_law(rate, z) else {
            return Some((whole, None));
        };
        let open_loop = OpenLoop::new(rate, &law);
        let (numerator, denominator) = law.transfer();
        let path = |omega: f64| numerator.at(omega) / denominator.at(omega);
        let corner = problem.corner(&law);
        let inner = allowed(rate_grid, &open_loop, path, limits, corner);
        Some((whole, inner))
    }

    fn on(&mut self, law: &Law) -> Option<Allowed> {
        let open_loop = OpenLoop::new(&self.problem.process, law);
        if !open_loop.is_proper() {
            return None;
        }
        let (numerator, denominator) = law.transfer();
        let path = |omega: f64| numerator.at(omega) / denominator.at(omega);
        let corner = self.problem.corner(law);
        allowed(&mut self.grid, &open_loop, path, &self.problem.limits, corner)
    }

    /// Largest gain within all limits.
    pub(crate) fn gain(&mut self, z: &[f64]) -> Option<Gain> {
        let (whole, inner) = self.allowed(z)?;
        let mut gain = Gain {
            k: whole.high,
            omega: whole.omega,
            low: whole.low,
        };
        if let Some(inner) = inner {
            gain.low = gain.low.max(inner.low);
            if inner.high < gain.k {
                (gain.k, gain.omega) = (inner.high, inner.omega);
            }
        }
        let problem = self.problem;
        let law = problem.family.law(&problem.process, z);
        if let Some(limit) = problem.noise {
            let excess = |ln: f64| {
                let law = law.scaled(ln.exp());
                let found = noise::amplification(&problem.process, &law, limit.period);
                Some((found / limit.amplification).ln())
            };
            gain.k = limited(gain.k, excess)?;
        }
        if let Some(limit) = problem.input_peak {
            let b = if problem.family.form.has_integral() { 0.0 } else { 1.0 };
            let omega = gain.omega;
            let excess = |ln: f64| {
                let law = Law { b: b * law.b, ..law.scaled(ln.exp()) };
                let step = (STEP_RAD / omega, Ending::COARSE);
                let found =
                    integrals(&problem.process, &law, Excitation::Reference, omega, step)?;
                Some((found.peak_input / limit).ln())
            };
            gain.k = limited(gain.k, excess)?;
        }
        Some(gain)
    }

    /// Logarithm of the cost of a shape, with the penalty of an infeasible gain.
    pub(crate) fn cost(&mut self, z: &[f64]) -> f64 {
        if !is_in_range(z) {
            return NO_COST;
        }
        let Some(gain) = self.gain(z) else {
            return NO_COST;
        };
        let law = self.problem.family.law(&self.problem.process, z).scaled(gain.k);
        match self.problem.integrals(&law, gain.omega, 1.0) {
            Some(found) if found.iae > 0.0 => found.iae.ln() + penalty(gain.low, gain.k),
            _ => NO_COST,
        }
    }
}

/// Penalty of a gain below the least one.
pub(crate) fn penalty(low: f64, k: f64) -> f64 {
    if low > k { PENALTY * (low / k).ln() } else { 0.0 }
}

/// The gain `k`, or a smaller one at which `excess(ln k)` is zero: secant in logarithms, as noise and peaks grow about in
/// proportion to the gain.
fn limited(k: f64, excess: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let (mut x, mut f) = (k.ln(), excess(k.ln())?);
    if f <= 0.0 {
        return Some(k);
    }
    let mut slope = 1.0;
    for _ in 0..MOST_EVALUATIONS {
        let next = x - f / slope;
        let value = excess(next)?;
        slope = ((value - f) / (next - x)).clamp(0.05, 20.0);
        (x, f) = (next, value);
        if f.abs() < GAIN_TOLERANCE {
            break;
        }
    }
    // On the safe side of the limit.
    Some((x - f.max(0.0)).exp().min(k))
}
