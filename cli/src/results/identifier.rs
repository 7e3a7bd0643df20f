//! Result of training an identifier: the scores and the size of its pack.

use onecycle_lab::learn::identifier::Scores;
use onecycle_lab::learn::pack::Quantisation;
use onecycle_onboard::pack::Sizes;
use serde::Serialize;

/// A trained, calibrated and scored identifier.
#[derive(Serialize)]
pub(crate) struct IdentifierRun {
    pub(crate) examples: usize,
    pub(crate) weights: usize,
    /// Why training ended.
    pub(crate) outcome: &'static str,
    pub(crate) epochs: u64,
    pub(crate) best_epoch: u64,
    pub(crate) scores: Vec<FamilyScores>,
    #[serde(skip)]
    pub(crate) quantisation: Quantisation,
    #[serde(skip)]
    pub(crate) sizes: Sizes,
    /// Seconds of simulation and of training.
    #[serde(skip)]
    pub(crate) seconds: [f64; 2],
}

/// Scores of all cycles, or of those of one family.
#[derive(Serialize)]
pub(crate) struct FamilyScores {
    /// Number of the family, from 1; `None` for all families.
    pub(crate) family: Option<usize>,
    #[serde(flatten)]
    pub(crate) scores: Scores,
}
