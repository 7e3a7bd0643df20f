//! From a fit to the values of a result.

use onecycle_design::{Model, Parameter, Structure};

use super::choose::HOPELESS;
use super::descent::Found;
use super::draws::{clamped, process, reported};
use super::fitted::Fitted;
use super::forces;
use super::prediction::{Filtering, predict};
use super::record::Blocks;
use super::search::Candidate;
use super::theta::{Bounds, NoiseKind, Theta};
use crate::outcome::{
    Alternative, Evidence, Fit, FitPoint, InnovationRow, InnovationTests, Innovations, Noise,
    Prediction,
};

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
    if bounds.has_fastest_pair(theta) {
        return Some(Parameter::NaturalFrequency);
    }
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
    let process = process(&found.theta, found.at.gain, early_s);
    Model::from(reported(&process, &found.theta))
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

/// The fit as a result. `None` if the filter does not converge.
pub(super) fn fit(
    fitted: &Fitted,
    blocks: &Blocks<'_>,
    start_s: f64,
    checked: (InnovationTests, Option<Prediction>, f64),
) -> Option<Fit> {
    let explained = checked.1.map_or(1.0, |prediction| prediction.explained);
    let innovations = innovations(fitted, blocks, start_s, checked)?;
    let points = innovations.rows.iter().map(|row| FitPoint {
        time_s: row.time_s,
        measured: row.measured,
        fitted: row.simulated,
    });
    Some(Fit {
        misfit: (1.0 - explained).max(0.0).sqrt(),
        points: points.collect(),
        evidence: Evidence::Innovations(innovations),
    })
}

/// The innovations with their tests, row by row. `None` if the filter does not converge.
fn innovations(
    fitted: &Fitted,
    blocks: &Blocks<'_>,
    start_s: f64,
    (whiteness, prediction, widened): (InnovationTests, Option<Prediction>, f64),
) -> Option<Innovations> {
    let found = &fitted.best.found;
    let predicted = predict(blocks, &found.theta, &found.at, Filtering::default())?;
    let mut values = found.at.innovations().into_iter();
    let mut rows = Vec::with_capacity(blocks.len());
    for block in 0..blocks.len() {
        // Without a sample there is no mean to compare.
        let Some(measured) = blocks.mean_output(block) else {
            continue;
        };
        let range = blocks.range(block);
        let middle =
            0.5 * (blocks.record.time_s(range.start) + blocks.record.time_s(range.end - 1));
        let time_s = start_s + middle;
        rows.push(InnovationRow {
            time_s,
            measured,
            simulated: predicted.simulated[block],
            innovation: values.next()?,
            predicted: predicted.predicted[block],
            disturbance: predicted.disturbance[block],
        });
    }
    let alternatives = (fitted.choice.within(HOPELESS))
        .map(|candidate| Alternative {
            model: Model::from(clamped(
                &process(&candidate.found.theta, candidate.found.at.gain, 0.0),
                &candidate.found.theta,
            )),
            noise: noise_of(candidate),
            bic: candidate.bic,
        })
        .collect();
    Some(Innovations {
        noise: noise_of(&fitted.best),
        nonlinear: forces::nonlinear(found, &fitted.record.forces),
        log_likelihood: found.at.log_likelihood,
        bic: fitted.best.bic,
        alternatives,
        whiteness,
        prediction,
        widened,
        rows,
    })
}
