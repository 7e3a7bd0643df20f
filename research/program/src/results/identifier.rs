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

/// Median deterioration above which a pack is of little use: thirty times that of the built-in one (0.35 %).
const MOST_DETERIORATION: f64 = 0.1;
/// Share of cycles without an answer, and of unstable loops, above which a pack is of little use.
const MOST_UNKNOWN: f64 = 0.5;
const MOST_UNSTABLE: f64 = 0.01;

impl IdentifierRun {
    /// Whether the controllers of the pack are worth anything, on all families together.
    pub(crate) fn is_useful(&self) -> bool {
        self.scores
            .iter()
            .filter(|scored| scored.family.is_none())
            .all(|scored| {
                let scores = &scored.scores;
                let most = |share: f64| share * scores.cycles as f64;
                scores.median <= MOST_DETERIORATION
                    && scores.unknown as f64 <= most(MOST_UNKNOWN)
                    && scores.unstable as f64 <= most(MOST_UNSTABLE)
            })
    }
}

/// Scores of all cycles, or of those of one family.
#[derive(Serialize)]
pub(crate) struct FamilyScores {
    /// Number of the family, from 1; `None` for all families.
    pub(crate) family: Option<usize>,
    #[serde(flatten)]
    pub(crate) scores: Scores,
}
