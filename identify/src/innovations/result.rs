//! From a fit to the values of a result.

use onecycle_design::{Linear, Model, Parameter, Structure};

use super::descent::Found;
use super::fitted::Fitted;
use super::forces;
use super::mixture::Component;
use super::prediction::{Filtering, predict};
use super::record::Blocks;
use super::search::Candidate;
use super::theta::{Bounds, NoiseKind, Theta};
use crate::cholesky::cholesky;
use crate::outcome::{
    Alternative, FitPoint, InnovationRow, InnovationTests, Innovations, Noise, Prediction,
};
use crate::posterior::Posterior;

/// Relative standard deviation of the scale and of the clock of the instruments: no fit makes the intervals narrower.
const INSTRUMENT: f64 = 1e-3;

/// Damping ratio below which a resonance hardly depends on the input.
const LEAST_ZETA: f64 = 0.005;

/// The parameter that is the gain in front of the stages.
pub(crate) fn gain_of(structure: Structure) -> Parameter {
    if structure.parameters().contains(&Parameter::KOverTBody) {
        Parameter::KOverTBody
    } else {
        Parameter::K
    }
}

/// Parameter whose fit lies on a bound of the search that no process has reason to reach.
pub(super) fn at_bound(theta: &Theta, bounds: &Bounds) -> Option<Parameter> {
    let layout = theta.layout();
    let above = |index: usize| theta.values[index] >= bounds.high[index] - 1e-9;
    if above(layout.tau()) {
        return Some(Parameter::Tau);
    }
    // A resonance without damping oscillates by itself, whatever the input does: it explains any oscillation.
    if let Some(pair) = layout.pair() {
        let [c1, c0] = [theta.values[pair], theta.values[pair + 1]];
        if c1 < 2.0 * LEAST_ZETA * c0.max(0.0).sqrt() {
            return Some(Parameter::Zeta);
        }
    }
    let lag = (0..layout.stages.lags).find(|lag| above(*lag));
    lag.map(|lag| [Parameter::TProp, Parameter::TProp2][lag])
}

/// The most probable model. The recorded output stands `early_s` after its time stamps.
pub(super) fn model(found: &Found, early_s: f64) -> Model {
    Model::from(clamped(&process(&found.theta, found.at.gain, early_s)))
}

fn process(theta: &Theta, gain: f64, early_s: f64) -> Linear {
    let process = theta.process(gain);
    process.with_tau_s(process.tau_s() + early_s)
}

/// The nearest process without negative damping and negative dead time.
fn clamped(process: &Linear) -> Linear {
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
    early_s: f64,
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
    let draw = |index: usize, normal: &[f64]| {
        roots[index].draw(&components[index], &factors[index], normal, early_s)
    };
    let bias = has_bias(&best.theta).then(|| disturbance(best) / best.at.gain);
    let weights = if total > 0.0 { weights } else { vec![] };
    let process = clamped(&process(&best.theta, best.at.gain, early_s));
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
        early_s: f64,
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
        (process(&theta, gain, early_s), bias / gain)
    }
}

fn noise_of(candidate: &Candidate) -> Noise {
    let theta = &candidate.found.theta;
    let of = |kind: NoiseKind| Some(theta.noise(kind)).filter(|w| *w > 0.0);
    Noise {
        sigma: candidate.found.at.variance.sqrt(),
        w1_rad_per_s: of(NoiseKind::RandomWalk),
        w0_rad_per_s: of(NoiseKind::WhiteForce),
        wy_rad_per_s: of(NoiseKind::OutputWalk),
    }
}

/// The innovations with their tests, and the fit to the measured output. `None` if the filter does not converge.
pub(super) fn innovations(
    fitted: &Fitted,
    blocks: &Blocks<'_>,
    start_s: f64,
    (whiteness, prediction, widened): (InnovationTests, Option<Prediction>, f64),
) -> Option<(Innovations, Vec<FitPoint>)> {
    let found = &fitted.best.found;
    let predicted = predict(blocks, &found.theta, &found.at, Filtering::default())?;
    let mut values = found.at.innovations().into_iter();
    let mut rows = Vec::with_capacity(blocks.len());
    let mut points = Vec::with_capacity(blocks.len());
    for block in 0..blocks.len() {
        let range = blocks.range(block);
        let middle =
            0.5 * (blocks.record.time_s(range.start) + blocks.record.time_s(range.end - 1));
        let time_s = start_s + middle;
        let count = blocks.present(block);
        let measured = (count > 0).then(|| blocks.sums[block] * blocks.scale / count as f64);
        rows.push(InnovationRow {
            time_s,
            measured,
            simulated: predicted.simulated[block],
            innovation: if count > 0 { values.next() } else { None },
            predicted: predicted.predicted[block],
            disturbance: predicted.disturbance[block],
        });
        points.extend(measured.map(|measured| FitPoint {
            time_s,
            measured,
            fitted: predicted.simulated[block],
        }));
    }
    let alternatives = (fitted.choice.candidates.iter())
        .map(|candidate| Alternative {
            model: model(&candidate.found, 0.0),
            noise: noise_of(candidate),
            bic: candidate.bic,
        })
        .collect();
    let innovations = Innovations {
        noise: noise_of(&fitted.best),
        nonlinear: forces::nonlinear(found, &fitted.record.forces),
        log_likelihood: found.at.log_likelihood,
        bic: fitted.best.bic,
        alternatives,
        whiteness,
        prediction,
        widened,
        rows,
    };
    Some((innovations, points))
}
