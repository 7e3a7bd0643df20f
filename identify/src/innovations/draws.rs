//! Draws from the posterior of a fit.

use onecycle_design::{Linear, Structure};

use super::descent::Found;
use super::mixture::Component;
use super::theta::{BODIES_IN_A_SAMPLE, LAGS_IN_A_SAMPLE, NoiseKind, Theta};
use crate::posterior::{Drawn, Posterior, Shortest};
use onecycle_design::matrix::cholesky;

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

impl Stamps {
    fn shortest(&self) -> Shortest {
        Shortest {
            lag_s: self.sample_s / LAGS_IN_A_SAMPLE,
            body_s: self.sample_s / BODIES_IN_A_SAMPLE,
        }
    }
}

/// Least rate (1/s) of a lag.
const LEAST_RATE: f64 = 1e-12;

/// The process with its second-order stage as two lags, the nearest double lag in place of complex poles.
fn with_lags(process: &Linear) -> Linear {
    let [c1, c0] = process.pair();
    let root = (0.25 * c1 * c1 - c0).max(0.0).sqrt();
    let fast = if root > 0.0 {
        0.5 * c1 + root
    } else {
        c0.sqrt()
    };
    let fast = fast.max(LEAST_RATE);
    let structure = match process.structure() {
        Structure::Resonant => Structure::Soptd,
        _ => Structure::Toptd,
    };
    of_rates(process, structure, [fast, c0 / fast])
}

/// The process with its lags in order: that of the body is the longest.
fn in_order(process: &Linear) -> Linear {
    let stages = process.structure().stages();
    let lags_s = process.lags_s();
    let pole = process.pole_per_s();
    let is_ordered = lags_s.iter().all(|lag_s| lag_s * pole <= 1.0);
    if stages.poles == 0 || is_ordered && lags_s.is_sorted_by(|a, b| a >= b) {
        return *process;
    }
    of_rates(process, process.structure(), [pole])
}

/// The process in a structure of lags and a body, with these rates beside those of its lags. The slowest is the body's.
fn of_rates<const N: usize>(process: &Linear, structure: Structure, others: [f64; N]) -> Linear {
    let mut rates: Vec<f64> = process.lags_s().iter().map(|lag_s| 1.0 / lag_s).collect();
    // The gain of the product of all 1/(s + rate).
    let gain = process.gain() * rates.iter().product::<f64>();
    rates.extend(others);
    rates.sort_by(f64::total_cmp);
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

/// The process that is reported for a fit like `theta`: a second-order stage with real poles is two lags.
pub(super) fn reported(process: &Linear, theta: &Theta) -> Linear {
    let clamped = clamped(process, theta);
    if has_real_lags(theta) {
        with_lags(&clamped)
    } else {
        clamped
    }
}

/// The process of a fit, whose output was recorded `early_s` after its time stamps.
pub(super) fn process(theta: &Theta, gain: f64, early_s: f64) -> Linear {
    let process = in_order(&theta.process(gain));
    process.with_tau_s(process.tau_s() + early_s)
}

/// The nearest process without negative dead time and, unless `theta` is that of an unstable one, without negative damping.
pub(super) fn clamped(process: &Linear, theta: &Theta) -> Linear {
    let [c1, c0] = process.pair();
    let pole_per_s = match theta.grows {
        true => process.pole_per_s(),
        false => process.pole_per_s().max(0.0),
    };
    process
        .with_tau_s(process.tau_s().max(0.0))
        .with_pole_per_s(pole_per_s)
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
        let drawn = roots[index].draw(&components[index], &factors[index], normal, stamps);
        let has_pair = drawn.process.structure().stages().pairs > 0;
        if !(as_lags && has_pair) {
            return drawn;
        }
        let [c1, c0] = drawn.process.pair();
        Drawn {
            process: with_lags(&drawn.process),
            has_complex_poles: 0.25 * c1 * c1 < c0,
            ..drawn
        }
    };
    let bias = has_bias(&best.theta).then(|| disturbance(best) / best.at.gain - stamps.rest);
    let weights = if total > 0.0 { weights } else { vec![] };
    let process = process(&best.theta, best.at.gain, stamps.early_s);
    let process = reported(&process, &best.theta);
    (
        Posterior::of_mixture(&process, bias, &weights, draw).down_to(stamps.shortest()),
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
    ) -> Drawn {
        let Component { found, laplace, .. } = component;
        let most = factors.iter().fold(1.0, |most: f64, v| most.max(*v));
        let z = &normal[laplace.free.len()..];
        let mut gain = found.at.gain + most * self.linear[0][0] * z[0];
        let mut bias =
            disturbance(found) + most * (self.linear[1][0] * z[0] + self.linear[1][1] * z[1]);
        let mut changes: Vec<f64> = (self.process.iter().zip(factors))
            .map(|(row, factor)| factor * row.iter().zip(normal).map(|(l, z)| l * z).sum::<f64>())
            .collect();
        let covariance = |i: usize, j: usize| factors[i] * factors[j] * laplace.covariance[i][j];
        let near = &laplace.near;
        let (theta, has_complex_poles) =
            near.moved(&found.theta, &laplace.free, &mut changes, covariance);
        // A Gaussian has no end: a body of a thousandth of a sample, or a dead time of ten records.
        let mut theta = laplace.bounds.clamp(&theta);
        let symmetric = near.symmetric(&found.theta);
        for (slope, change) in laplace.slopes.iter().zip(&changes) {
            gain += slope[0] * change / symmetric;
            bias += slope[1] * change / symmetric;
        }
        let ratio = symmetric / near.symmetric(&theta);
        (gain, bias) = (gain * ratio, bias * ratio);
        gain *= 1.0 + INSTRUMENT * z[2];
        for lag in 0..theta.layout().stages.lags {
            theta.values[lag] += INSTRUMENT * z[3];
        }
        // With equal chances the recording has the rate of what makes the input, or another: then the changes come before their
        // samples by any part of a sample, on average over them.
        let tau = theta.layout().tau();
        theta.values[tau] += stamps.late_s * (2.0 * even(z[1], 1e3) - 1.0).max(0.0);
        let ratio = below_a_sample(&mut theta, component, stamps, normal[0]);
        (gain, bias) = (gain * ratio, bias * ratio);
        Drawn {
            process: process(&theta, gain, stamps.early_s),
            input_bias: bias / gain - stamps.rest,
            has_complex_poles,
        }
    }
}

/// A number from an even distribution from 0 to 1: the digits of a normal number behind the place of `digits`.
fn even(normal: f64, digits: f64) -> f64 {
    (digits * normal).rem_euclid(1.0)
}

/// Puts what the fit has at a bound anywhere below a sample: a dead time that is not positive, and a time constant at the least
/// that the search allows. The samples show neither, and a value with an interval of no width would say that they do. They show the
/// sum, so a time constant takes from the dead time what it gains. Returns the factor for the gain in front of the stages.
/// `chance`: a normal number, whose third to ninth digits are even.
fn below_a_sample(theta: &mut Theta, component: &Component, stamps: Stamps, chance: f64) -> f64 {
    let Stamps {
        sample_s, early_s, ..
    } = stamps;
    let anywhere_s = |digits: f64| even(chance, digits).max(1e-3) * sample_s;
    let time_s = anywhere_s(1e3);
    let best = &component.found.theta;
    let layout = theta.layout();
    let is_held = |index: usize| !component.laplace.free.contains(&index);
    let (mut longer_s, mut ratio) = (0.0, 1.0);
    for lag in 0..layout.stages.lags {
        if is_held(lag) && best.is_lag_below(lag, sample_s) {
            longer_s += time_s - theta.values[lag].exp();
            theta.values[lag] = time_s.ln();
        }
    }
    if let Some(pole) = layout.pole()
        && is_held(pole)
        && best.values[pole] * sample_s > 1.0
    {
        longer_s += time_s - 1.0 / theta.values[pole];
        ratio = 1.0 / (time_s * theta.values[pole]);
        theta.values[pole] = 1.0 / time_s;
        // Nothing slower shows where between two samples the response begins.
        if layout.stages.integrators == 0 {
            longer_s += anywhere_s(1e6) - 0.5 * sample_s;
        }
    }
    let tau = layout.tau();
    if best.tau_s() + early_s <= 0.0 && theta.tau_s() + early_s <= 0.0 {
        theta.values[tau] = time_s - early_s;
    } else if longer_s != 0.0 && theta.tau_s() + early_s > 0.0 {
        theta.values[tau] = (theta.values[tau] - longer_s).max(-early_s);
    }
    ratio
}
