//! Calibration of a trained network: temperatures of its posterior, limit of its score, and the domain
//! of its family.

use onecycle_onboard::classify::{Calibration, CyclePosterior};
use onecycle_onboard::pack::{Domain, OutputScaling, Pack, Prior};
use onecycle_onboard::signature::LENGTH;

use super::{IdentifierError, IdentifierRecipe, output_scales};
use crate::judge::calibrate::calibrate;
use crate::learn::dataset::VALUES;
use crate::learn::dataset::learning::LN_SAMPLES;
use crate::learn::dataset::shards::ExampleRecord;
use crate::learn::pack::{LeadTableContents, PackContents};
use onecycle_design::matrix::cholesky;

/// Part of the family's cycles that are called unknown: the allowed 2 % minus twice the standard error
/// of this number of experiments.
pub const MOST_UNKNOWN: f64 = 0.017;

/// Number of experiments for the limit of the score: it determines 2 % to 0.16 %.
const LIMIT_EXPERIMENTS: u64 = 8000;

/// Calibration of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrated(Calibration);

/// Calibrates the network of a pack with records that it has not learnt from.
///
/// # Errors
/// [`IdentifierError`]: an experiment cannot be made.
pub fn calibrated(
    recipe: &IdentifierRecipe,
    pack: &Pack<'_>,
    chosen: &[ExampleRecord],
) -> Result<Calibrated, IdentifierError> {
    let scale = output_scales().map(f64::from);
    let mut squares = [0.0; VALUES];
    for record in chosen {
        let outputs = pack.outputs(&record.example.signature.values);
        let posterior = CyclePosterior::from_outputs(&outputs, &scale);
        for (k, square) in squares.iter_mut().enumerate() {
            let variance: f64 = posterior.root[k].iter().map(|root| root * root).sum();
            let error = record.values[k] - posterior.mean[k];
            // A few very large errors are the score's task; they must not widen all other posteriors.
            *square += (error * error / variance).min(MOST_SQUARE);
        }
    }
    let start = Calibration {
        scale,
        temperature: squares.map(|square| (square / chosen.len().max(1) as f64).sqrt()),
        ..Calibration::UNTRAINED
    };
    let first = recipe.experiments();
    let calibration = calibrate(
        &recipe.experiments,
        first..first + LIMIT_EXPERIMENTS,
        &|signature| pack.outputs(&signature.values),
        &start,
        MOST_UNKNOWN,
    )?;
    Ok(Calibrated(calibration))
}

/// Largest squared error that counts: five standard deviations, which one in 1.7 million Gaussian
/// errors exceeds.
const MOST_SQUARE: f64 = 25.0;

impl Calibrated {
    /// The calibration before any calibration.
    #[must_use]
    pub fn not_yet() -> Self {
        Self(Calibration::UNTRAINED)
    }

    /// The contents of a pack without network, table and self-test.
    pub(super) fn contents(
        &self,
        recipe: &IdentifierRecipe,
        learnt: &[ExampleRecord],
    ) -> Result<PackContents, IdentifierError> {
        let mut input_offsets = [0.0; LENGTH];
        let mut input_scales = [1.0; LENGTH];
        (input_offsets[LENGTH - 1], input_scales[LENGTH - 1]) = (LN_SAMPLES.0, 1.0 / LN_SAMPLES.1);
        let [lowest, highest] = extremes(learnt.iter().map(|record| record.values));
        let seen = learnt.iter().map(|record| {
            let [.., duty, ln_samples] = record.example.signature.values;
            [duty, ln_samples]
        });
        let [low, high] = extremes(seen);
        let space = &recipe.experiments.families[0].space;
        let Self(calibration) = self;
        Ok(PackContents {
            layers: vec![],
            input_offsets,
            input_scales,
            output_scaling: OutputScaling {
                scales: output_scales(),
                temperatures: calibration.temperature.map(|value| value as f32),
                lowest: lowest.map(|value| value as f32),
                highest: highest.map(|value| value as f32),
            },
            domain: Domain {
                duty: [low[0], high[0]],
                ln_samples: [low[1], high[1]],
                beta: [space.beta as f32; 2],
                phase_margin_rad: space.phase_margin_rad() as f32,
            },
            unknown_threshold: finite(calibration.limit),
            calibration: calibration.numbers().map(finite).to_vec(),
            prior: prior(learnt).ok_or(IdentifierError::OneShape)?,
            lead_table: LeadTableContents::default(),
            self_tests: vec![],
            card: serde_json::Value::Null,
        })
    }
}

/// Limits a value to the range of `f32`: before calibration, or with a network that has hardly learnt,
/// it may be infinite, which a file cannot hold.
fn finite(value: f64) -> f32 {
    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

/// Lowest and highest value of each number.
fn extremes<T: PartialOrd + Copy + From<f32>, const N: usize>(
    rows: impl Iterator<Item = [T; N]>,
) -> [[T; N]; 2] {
    let mut extremes = [[T::from(f32::INFINITY); N], [T::from(f32::NEG_INFINITY); N]];
    for row in rows {
        for (k, value) in row.into_iter().enumerate() {
            if value < extremes[0][k] {
                extremes[0][k] = value;
            }
            if value > extremes[1][k] {
                extremes[1][k] = value;
            }
        }
    }
    extremes
}

/// Mean and root of the covariance of the shapes; `None` if they have no spread.
fn prior(records: &[ExampleRecord]) -> Option<Prior> {
    const SHAPE: usize = 3;
    let count = records.len() as f64;
    let mut mean = [0.0; SHAPE];
    for record in records {
        for (mean, value) in mean.iter_mut().zip(record.values) {
            *mean += value / count;
        }
    }
    let mut covariance = [[0.0; SHAPE]; SHAPE];
    for record in records {
        for i in 0..SHAPE {
            for j in 0..SHAPE {
                covariance[i][j] +=
                    (record.values[i] - mean[i]) * (record.values[j] - mean[j]) / count;
            }
        }
    }
    let root = cholesky(&covariance)?;
    let is_right = (0..SHAPE).all(|i| root[i][i] > 0.0 && root[i][i].is_finite());
    is_right.then(|| Prior {
        mean: mean.map(|value| value as f32),
        root: root.map(|row| row.map(|value| value as f32)),
    })
}
