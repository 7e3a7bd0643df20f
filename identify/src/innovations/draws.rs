//! Draws from the posterior of a fit.

use onecycle_design::{Linear, Structure};

use super::descent::Found;
use super::mixture::Component;
use super::theta::{NoiseKind, Theta};
use crate::cholesky::cholesky;
use crate::posterior::Posterior;

/// Relative standard deviation of the scale and of the clock of the instruments: no fit makes the intervals narrower.
const INSTRUMENT: f64 = 1e-3;

/// What the numbers of a record are counted from.
#[derive(Clone, Copy, Default)]
pub(super) struct Stamps {
    /// Sample period (s).
    pub(super) sample_s: f64,
    /// Delay from the stamp of an output to the time of its sample (s).
    pub(super) early_s: f64,
    /// Time (s) by which the input may have changed before the sample that shows it: a sample, if it is constant between
    /// changes and the recording may be slower than what makes it.
    pub(super) late_s: f64,
    /// Input at rest, which the response to the input leaves out; zero if the state at the start is not known.
    pub(super) rest: f64,
}

/// Least rate (1/s) of a lag.
const LEAST_RATE: f64 = 1e-12;

/// The process with its second-order stage as two lags, the nearest double lag in place of complex poles. The slowest of all
/// lags is the body's.
fn with_lags(process: &Linear) -> Linear {
    let [c1, c0] = process.pair();
    let root = (0.25 * c1 * c1 - c0).max(0.0).sqrt();
    let fast = if root > 0.0 {
        0.5 * c1 + root
    } else {
        c0.sqrt()
    };
    let fast = fast.max(LEAST_RATE);
    let mut rates: Vec<f64> = process.lags_s().iter().map(|lag_s| 1.0 / lag_s).collect();
    // The gain of the product of all 1/(s + rate).
    let gain = process.gain() * rates.iter().product::<f64>();
    rates.extend([fast, c0 / fast]);
    rates.sort_by(f64::total_cmp);
    let structure = match process.structure() {
        Structure::Resonant => Structure::Soptd,
        _ => Structure::Toptd,
    };
    let mut lags_s = [1.0; 2];
    for (lag_s, rate) in lags_s.iter_mut().zip(&rates[1..]) {
        *lag_s = 1.0 / rate;
    }
    Linear::new(structure)
        .with_gain(gain / rates[1..].iter().product::<f64>())
        .with_lags_s(lags_s)
        .with_pole_per_s(rates[0])
        .with_tau_s(process.tau_s())
}

/// Whether the second-order stage of a fit is two real lags, which are reported as such.
pub(super) fn has_real_lags(theta: &Theta) -> bool {
    theta
        .real_lags_s()
        .is_some_and(|(slow_s, _)| slow_s.is_finite())
}

/// The process that is reported: `as_lags` turns a second-order stage into two lags.
pub(super) fn reported(process: &Linear, as_lags: bool) -> Linear {
    let clamped = clamped(process);
    if as_lags {
        with_lags(&clamped)
    } else {
        clamped
    }
}

pub(super) fn process(theta: &Theta, gain: f64, early_s: f64) -> Linear {
    let process = theta.process(gain);
    process.with_tau_s(process.tau_s() + early_s)
}

/// The nearest process without negative damping and negative dead time.
pub(super) fn clamped(process: &Linear) -> Linear {
    let [c1, c0] = process.pair();
    process
        .with_tau_s(process.tau_s().max(0.0))
        .with_pole_per_s(process.pole_per_s().max(0.0))
        .with_pair(c1.max(0.0), c0.max(0.0))
}

/// Posterior over all components, and the factor by which its deviations were widened: that of coloured innovations, at
/// least `least_widening`. `None`: the innovations are white.
pub(super) fn posterior_of(
    best: &Found,
    components: &[Component],
    stamps: Stamps,
    least_widening: Option<f64>,
) -> (Posterior, f64) {
    let factors: Vec<Vec<f64>> = (components.iter())
        .map(|component| {
            let coloured = component.laplace.coloured.iter();
            coloured
                .map(|v| least_widening.map_or(1.0, |least| v.max(least)))
                .collect()
        })
        .collect();
    let widened = factors
        .iter()
        .flatten()
        .fold(1.0, |most: f64, v| most.max(*v));
    let roots: Vec<Root> = components.iter().map(Root::of).collect();
    let weights: Vec<f64> = (components.iter().zip(&roots))
        .map(|(component, root)| {
            if root.is_usable {
                component.weight
            } else {
                0.0
            }
        })
        .collect();
    let total: f64 = weights.iter().sum();
    let weights: Vec<f64> = weights.iter().map(|weight| weight / total).collect();
    let as_lags = has_real_lags(&best.theta);
    let draw = |index: usize, normal: &[f64]| {
        let (process, bias) =
            roots[index].draw(&components[index], &factors[index], normal, stamps);
        let has_pair = process.structure().stages().pairs > 0;
        match as_lags && has_pair {
            true => (with_lags(&process), bias),
            false => (process, bias),
        }
    };
    let bias = has_bias(&best.theta).then(|| disturbance(best) / best.at.gain - stamps.rest);
    let weights = if total > 0.0 { weights } else { vec![] };
    let process = reported(&process(&best.theta, best.at.gain, stamps.early_s), as_lags);
    (
        Posterior::of_mixture(&process, bias, &weights, draw),
        widened,
    )
}

/// Whether the disturbance at the start is estimated: not if the walk of the output takes its place.
fn has_bias(theta: &Theta) -> bool {
    theta.structure.stages().integrators > 0 || theta.noise(NoiseKind::OutputWalk) == 0.0
}

fn disturbance(found: &Found) -> f64 {
    found.at.state.last().copied().unwrap_or(0.0)
}

/// Roots of the covariances of a component.
struct Root {
    /// Lower triangular, over the free unknowns.
    process: Vec<Vec<f64>>,
    /// Over gain and disturbance, for fixed unknowns of the process.
    linear: [[f64; 2]; 2],
    is_usable: bool,
}

impl Root {
    fn of(component: &Component) -> Self {
        const SIZE: usize = 6;
        let laplace = &component.laplace;
        let free = laplace.free.len().min(SIZE);
        let mut padded = [[0.0; SIZE]; SIZE];
        for i in 0..free {
            for j in 0..free {
                padded[i][j] = laplace.covariance[i][j];
            }
        }
        let at = &component.found.at;
        let (d, gd) = at.disturbance_factors;
        let linear = [[at.gain_factor, gd], [gd, d]].map(|row| row.map(|v| v * at.variance));
        let linear = cholesky(&linear);
        let process = cholesky(&padded);
        Self {
            is_usable: process.is_some() && linear.is_some(),
            process: process
                .unwrap_or(padded)
                .iter()
                .map(|row| row[..free].to_vec())
                .collect(),
            linear: linear.unwrap_or([[0.0; 2]; 2]),
        }
    }

    /// Process and input bias at standard normal numbers.
    fn draw(
        &self,
        component: &Component,
        factors: &[f64],
        normal: &[f64],
        stamps: Stamps,
    ) -> (Linear, f64) {
        let Component { found, laplace, .. } = component;
        let mut theta = found.theta;
        let most = factors.iter().fold(1.0, |most: f64, v| most.max(*v));
        let z = &normal[laplace.free.len()..];
        let mut gain = found.at.gain + most * self.linear[0][0] * z[0];
        let mut bias =
            disturbance(found) + most * (self.linear[1][0] * z[0] + self.linear[1][1] * z[1]);
        for (slot, &index) in laplace.free.iter().enumerate() {
            let sum: f64 = (0..=slot).map(|j| self.process[slot][j] * normal[j]).sum();
            let change = factors[slot] * sum;
            theta.values[index] += change;
            gain += laplace.slopes[slot][0] * change;
            bias += laplace.slopes[slot][1] * change;
        }
        gain *= 1.0 + INSTRUMENT * z[2];
        for lag in 0..theta.layout().stages.lags {
            theta.values[lag] += INSTRUMENT * z[3];
        }
        // With equal chances the recording has the rate of what makes the input, or another: then the changes come before their
        // samples by any part of a sample, on average over them.
        let tau = theta.layout().tau();
        theta.values[tau] += stamps.late_s * (2.0 * uniform(z[1]) - 1.0).max(0.0);
        below_a_sample(&mut theta, component, stamps, uniform(normal[0]));
        (
            process(&theta, gain, stamps.early_s),
            bias / gain - stamps.rest,
        )
    }
}

/// A number from an even distribution from 0 to 1: the digits of a normal number from the fourth decimal on.
fn uniform(normal: f64) -> f64 {
    (1e3 * normal).rem_euclid(1.0)
}

/// Puts what the fit has at a bound anywhere below a sample: a dead time that is not positive, and a lag at the least that the
/// search allows. The samples show neither, and a value with an interval of no width would say that they do. `share`: where, a
/// number from an even distribution from 0 to 1.
fn below_a_sample(theta: &mut Theta, component: &Component, stamps: Stamps, share: f64) {
    let Stamps {
        sample_s, early_s, ..
    } = stamps;
    let share = share.max(1e-3);
    let best = &component.found.theta;
    let tau = theta.layout().tau();
    if best.tau_s() + early_s <= 0.0 && theta.tau_s() + early_s <= 0.0 {
        theta.values[tau] = share * sample_s - early_s;
    }
    for lag in 0..theta.layout().stages.lags {
        let is_held = !component.laplace.free.contains(&lag);
        if is_held && best.is_lag_below(lag, sample_s) {
            // The samples show the sum of lag and dead time.
            theta.values[tau] += best.values[lag].exp() - share * sample_s;
            theta.values[lag] = (share * sample_s).ln();
        }
    }
}
