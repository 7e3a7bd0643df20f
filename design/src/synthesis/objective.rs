//! Cost of a shape on one process, at the largest gain that the limits allow.
//!
//! With an integral term the cost is the IAE of a unit step of the load, without one that of a unit step of the
//! reference. A shape whose least gain exceeds its largest one costs more, in proportion to the logarithm of the excess, and
//! so does one with integral term that overshoots its limit where the set-point weight is fixed.

use crate::analysis::noise;
use crate::analysis::process::Process;
use crate::analysis::response::{Ending, Integrals, STEP_RAD, integrals};
use crate::analysis::{Law, OpenLoop};

use super::bands::{Allowed, Grid, NoGain, allowed, extremum};
use super::limits::Limits;
use super::shape::Family;

pub(crate) use crate::analysis::realisation::Excitation;

/// Value of a shape that has no cost.
pub(crate) const NO_COST: f64 = 1e3;

/// Weight of an infeasible gain: exact for slopes of the cost below it.
pub(crate) const PENALTY: f64 = 10.0;

/// Weight of an overshoot over its limit: the IAE falls by less than this factor per 1 % of overshoot.
const OVERSHOOT_PENALTY: f64 = 100.0;

/// Tolerance of the logarithm of a gain that noise or the peak of the input limits.
const GAIN_TOLERANCE: f64 = 1e-9;

/// A gain whose logarithm exceeds its limit by more than this has not converged.
const CLOSE: f64 = 1e-6;

/// Most evaluations of noise or peak for one gain.
const MOST_EVALUATIONS: usize = 40;

/// Frequencies over the limit of the crossover at which the loop is looked at. Its magnitude falls nearly everywhere.
const BEYOND: [f64; 7] = [1.0, 1.1, 1.25, 1.5, 2.0, 4.0, 10.0];

/// Most zeros of a law.
const ZEROS: f64 = 3.0;

/// From this share of the inverse of its time on the filter of second order falls by 1.9 decades per decade:
/// `-2 x^4/(4 + x^4)` at `x = 3`.
const FILTERED: f64 = 3.0;

/// Below this share of the inverse of its longest time, a loop is its integrators.
const ASYMPTOTIC: f64 = 0.01;

/// Limit of the noise at the actuator, in the units of the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseLimit {
    /// Largest amplification of the measurement noise.
    pub amplification: f64,
    /// Sample period of the noise.
    pub period: f64,
}

/// A set-point weight that is not the design's to choose, and the overshoot that the gains must keep with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FixedWeight {
    pub weight: f64,
    /// Largest overshoot after a step of the reference, as a share of the step.
    pub overshoot: f64,
}

/// What a controller is designed for, in the units of the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Problem {
    pub process: Process,
    pub family: Family,
    pub limits: Limits,
    pub noise: Option<NoiseLimit>,
    /// Largest output of the controller after a unit step of the reference with the fixed weight; else with `b = 0`, or
    /// `b = 1` without integral.
    pub input_peak: Option<f64>,
    /// Highest gain crossover.
    pub crossover: Option<f64>,
    /// `None`: the set-point weight is chosen after the gains, or 1 without integral term.
    pub fixed_weight: Option<FixedWeight>,
}

/// Which loop and which end of the forbidden gains an extremum belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Constraint {
    pub is_rate_loop: bool,
    /// Upper limit of the gain; a lower one otherwise.
    pub is_upper: bool,
    /// Limit of `Ms`; of `Mt` otherwise.
    pub is_sensitivity: bool,
    pub omega: f64,
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
    /// Whether an infeasible shape has no cost instead of a penalty.
    pub is_strict: bool,
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
        let ending = if refinement > 1.0 {
            Ending::FINE
        } else {
            Ending::COARSE
        };
        let step = (STEP_RAD / (omega * refinement), ending);
        integrals(&self.process, law, self.excitation(), omega, step)
    }

    /// Logarithm by which a cost grows with an overshoot over its limit. Zero without a fixed set-point weight.
    pub(crate) fn overshoot_penalty(&self, law: &Law, omega: f64) -> f64 {
        self.fixed_weight.map_or(0.0, |fixed| {
            let peak = self.peak_output(law, omega, fixed.weight);
            peak.map_or(NO_COST, |peak| {
                OVERSHOOT_PENALTY * (peak - 1.0 - fixed.overshoot).max(0.0)
            })
        })
    }

    /// Largest output after a unit step of the reference with the set-point weight `b`. `None` if no simulation ends.
    fn peak_output(&self, law: &Law, omega: f64, b: f64) -> Option<f64> {
        let law = Law { b, ..*law };
        let step = (STEP_RAD / omega, Ending::COARSE);
        let found = integrals(&self.process, &law, Excitation::Reference, omega, step)?;
        Some(found.peak_output)
    }

    /// The gain `k` of a shape, or a smaller one that keeps the limits of crossover, noise and input, and without an integral
    /// term that of the overshoot. `None` if no simulation ends.
    pub(crate) fn limited(&self, z: &[f64], k: f64, omega: f64) -> Option<f64> {
        let process = &self.process;
        let law = self.family.law(process, z);
        let mut k = k;
        if let Some(limit) = self.crossover {
            let largest = self.largest_beyond(&law, limit);
            if k * largest > 1.0 {
                k = 1.0 / largest;
            }
        }
        if let Some(limit) = self.noise {
            let excess = |ln: f64| {
                let found = noise::amplification(process, &law.scaled(ln.exp()), limit.period);
                Some((found / limit.amplification).ln())
            };
            k = limited(k, excess)?;
        }
        if let Some(fixed) = (self.fixed_weight).filter(|_| !self.family.form.has_integral()) {
            let excess = |ln: f64| {
                let peak = self.peak_output(&law.scaled(ln.exp()), omega, fixed.weight)?;
                Some((peak / (1.0 + fixed.overshoot)).ln())
            };
            k = limited(k, excess)?;
        }
        if let Some(limit) = self.input_peak {
            let b = match self.fixed_weight {
                Some(fixed) => fixed.weight,
                None if self.family.form.has_integral() => 0.0,
                None => 1.0,
            };
            let step = (STEP_RAD / omega, Ending::COARSE);
            let excess = |ln: f64| {
                let law = Law {
                    b: b * law.b,
                    ..law.scaled(ln.exp())
                };
                let found = integrals(process, &law, Excitation::Reference, omega, step)?;
                Some((found.peak_input / limit).ln())
            };
            k = limited(k, excess)?;
        }
        Some(k)
    }

    /// Largest magnitude of the loop of this law from a frequency on.
    fn largest_beyond(&self, law: &Law, omega: f64) -> f64 {
        let open_loop = OpenLoop::new(&self.process, law);
        let resonance = self.process.resonance().map(|(peak, _)| peak);
        let above = BEYOND.map(|factor| factor * omega);
        (above.into_iter())
            .chain(resonance.filter(|peak| *peak > omega))
            .map(|omega| open_loop.at(omega).norm())
            .fold(0.0, f64::max)
    }

    /// Lower bound of the logarithm of the cost of a shape with gain `k`: the IAE is at least `1/ki`.
    pub(crate) fn least_cost(&self, z: &[f64], k: f64) -> f64 {
        let ki = self.family.law(&self.process, z).ki * k;
        if ki > 0.0 { -ki.ln() } else { -NO_COST }
    }

    /// Frequencies between which a loop with this law is scanned. Below the first one the loop is its integrators; above the
    /// second one its magnitude never rises: process and filter fall at least as fast there as the controller can rise, and
    /// a resonance is passed. Nor does its phase: the zeros of the controller are passed.
    pub(crate) fn ends(&self, law: &Law) -> [f64; 2] {
        let rise = if law.k2 != 0.0 {
            2
        } else {
            usize::from(law.kd != 0.0 || law.kf != 0.0)
        };
        let times = self.process.times();
        let corner_of = |index: usize| times.get(index).map_or(0.0, |time| 1.0 / time);
        let corner = match rise.checked_sub(1) {
            Some(index) => {
                // The filter takes back one rise, and two together with the first corner.
                let first = if index > 0 { corner_of(0) } else { 0.0 };
                corner_of(index).min(first.max(FILTERED / law.tf))
            }
            None => 0.0,
        };
        let resonance = self.process.resonance().map_or(0.0, |(peak, _)| peak);
        // The longest time of the process, or of the controller: of the integral, or between derivative and proportional term.
        let slope = law.kd + law.kf;
        let longest = [
            law.kp / law.ki,
            slope / law.kp,
            (law.k2 / law.kp).sqrt(),
            law.tf,
            1.0,
        ];
        let longest = (longest.into_iter().chain(times))
            .filter(|time| time.is_finite())
            .fold(1.0, f64::max);
        let zeros = last_rise(law, self.process.tau);
        [
            ASYMPTOTIC / longest,
            (2.0 * corner.max(resonance)).max(zeros),
        ]
    }
}

/// Frequency above which the phase of a loop with this law and the dead time `tau` only falls.
///
/// Far above the frequency `w0` of a zero its phase rises by less than `w0/w^2` per unit of frequency, that of the dead time
/// falls by `tau`. A real zero that is faster than the dead time never makes the phase rise, complex ones do.
fn last_rise(law: &Law, tau: f64) -> f64 {
    let slope = law.kd + law.kf;
    let coefficients = [law.ki, law.kp, slope, law.k2];
    let real = coefficients
        .windows(2)
        .map(|pair| (pair[0] / pair[1], false));
    let complex = coefficients.windows(3).map(|three| {
        let is_complex = three[1] * three[1] < 4.0 * three[0] * three[2];
        ((three[0] / three[2]).sqrt(), is_complex)
    });
    (real.chain(complex))
        .filter(|(zero, is_complex)| {
            zero.is_finite() && *zero > 0.0 && (*is_complex || zero * tau < ZEROS)
        })
        .map(|(zero, _)| (ZEROS * zero / tau).sqrt().clamp(2.0 * zero, 10.0 * zero))
        .fold(0.0, f64::max)
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
            is_strict: false,
            grid: grid(&problem.process),
            rate: problem.process.rate().map(|rate| (rate, grid(&rate))),
        }
    }

    /// Gains that the sensitivity and the margins allow a shape, of the loop and of the rate loop of a cascade.
    pub(crate) fn allowed(&mut self, z: &[f64]) -> Result<(Allowed, Option<Allowed>), NoGain> {
        let problem = self.problem;
        let Problem {
            process,
            family,
            limits,
            ..
        } = &problem;
        let law = family.law(process, z);
        let whole = self.on(&law)?;
        let Some((rate, rate_grid)) = &mut self.rate else {
            return Ok((whole, None));
        };
        let Some(law) = family.rate_law(rate, z) else {
            return Ok((whole, None));
        };
        let open_loop = OpenLoop::new(rate, &law);
        let (numerator, denominator) = law.transfer();
        let path = |omega: f64| numerator.at(omega) / denominator.at(omega);
        let ends = Problem {
            process: *rate,
            ..problem
        }
        .ends(&law);
        match allowed(rate_grid, &open_loop, path, limits, ends) {
            Ok(inner) => Ok((whole, Some(inner))),
            Err(NoGain::Unbounded) => Ok((whole, None)),
            Err(unstable) => Err(unstable),
        }
    }

    /// Extrema of the forbidden gains within a share `near` of the gain `k`, as constraints.
    pub(crate) fn constraints(&mut self, z: &[f64], k: f64, near: f64) -> Vec<Constraint> {
        let Ok((whole, inner)) = self.allowed(z) else {
            return Vec::new();
        };
        let mut found = Vec::new();
        for (allowed, is_rate_loop) in [(Some(whole), false), (inner, true)] {
            let Some(allowed) = allowed else {
                continue;
            };
            let ends = [(allowed.upper, true), (allowed.lower, false)];
            for (extrema, is_upper) in ends {
                let is_near = |gain: f64| (gain / k).ln().abs() < near;
                for (omega, _) in extrema.into_iter().filter(|(_, gain)| is_near(*gain)) {
                    for is_sensitivity in [true, false] {
                        let constraint = Constraint {
                            is_rate_loop,
                            is_upper,
                            is_sensitivity,
                            omega,
                        };
                        let mut x = vec![k.ln()];
                        x.extend(z);
                        if self.distance(&constraint, &x).abs() < near {
                            found.push(constraint);
                        }
                    }
                }
            }
        }
        found
    }

    /// Logarithm by which the gain `exp(x[0])` of the shape `x[1..]` keeps a constraint.
    pub(crate) fn distance(&self, constraint: &Constraint, x: &[f64]) -> f64 {
        let problem = &self.problem;
        let law = if constraint.is_rate_loop {
            let rate = problem.process.rate();
            rate.and_then(|rate| Some((rate, problem.family.rate_law(&rate, &x[1..])?)))
        } else {
            Some((
                problem.process,
                problem.family.law(&problem.process, &x[1..]),
            ))
        };
        let Some((process, law)) = law else {
            return f64::INFINITY;
        };
        let none = 1e9;
        let limits = if constraint.is_sensitivity {
            Limits {
                mt: none,
                ..problem.limits
            }
        } else {
            Limits {
                ms: none,
                ..problem.limits
            }
        };
        let open_loop = OpenLoop::new(&process, &law);
        let gain = extremum(&open_loop, &limits, constraint.omega, constraint.is_upper);
        if constraint.is_upper {
            gain.ln() - x[0]
        } else {
            x[0] - gain.ln()
        }
    }

    fn on(&mut self, law: &Law) -> Result<Allowed, NoGain> {
        let open_loop = OpenLoop::new(&self.problem.process, law);
        if !open_loop.is_proper() {
            return Err(NoGain::Unstable);
        }
        let (numerator, denominator) = law.transfer();
        let path = |omega: f64| numerator.at(omega) / denominator.at(omega);
        let ends = self.problem.ends(law);
        allowed(&mut self.grid, &open_loop, path, &self.problem.limits, ends)
    }

    /// Largest gain within all limits.
    pub(crate) fn gain(&mut self, z: &[f64]) -> Result<Gain, NoGain> {
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
        let limited = self.problem.limited(z, gain.k, gain.omega);
        let k = limited.ok_or(NoGain::Unstable)?;
        // With less gain the loop is slower: between in proportion (one integrator) and not at all.
        gain.omega *= (k / gain.k).sqrt();
        gain.k = k;
        Ok(gain)
    }

    /// Logarithm of the cost of a shape, with the penalty of an infeasible gain.
    pub(crate) fn cost(&mut self, z: &[f64]) -> f64 {
        if !self.problem.family.is_in_range(&self.problem.process, z) {
            return NO_COST;
        }
        let Ok(gain) = self.gain(z) else {
            return NO_COST;
        };
        if self.is_strict && gain.low > gain.k {
            return NO_COST;
        }
        let law = self
            .problem
            .family
            .law(&self.problem.process, z)
            .scaled(gain.k);
        match self.problem.integrals(&law, gain.omega, 1.0) {
            Some(found) if found.iae > 0.0 => {
                let overshoot = self.problem.overshoot_penalty(&law, gain.omega);
                found.iae.ln() + penalty(gain.low, gain.k) + overshoot
            }
            _ => NO_COST,
        }
    }
}

/// Penalty of a gain below the least one.
pub(crate) fn penalty(low: f64, k: f64) -> f64 {
    if low > k {
        PENALTY * (low / k).ln()
    } else {
        0.0
    }
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
    (f < CLOSE).then(|| (x - f.max(0.0)).exp().min(k))
}
