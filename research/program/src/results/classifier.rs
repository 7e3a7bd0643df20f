//! Result of training the paper's classifier: one network for each loss, scored on the same experiments.

use onecycle_lab::learn::train::{Epoch, Loss};
use onecycle_lab::paper::classifier::{ClassifierRecipe, Protocol, Score};
use serde::Serialize;

/// All networks of a recipe and their scores.
#[derive(Serialize)]
pub(crate) struct ClassifierRun<'a> {
    pub(crate) recipe: &'a ClassifierRecipe,
    pub(crate) classes: usize,
    pub(crate) weights: usize,
    /// Experiments learnt from.
    pub(crate) examples: usize,
    /// Experiments left out because their oscillation was not steady.
    pub(crate) unsteady: u64,
    pub(crate) sets: Vec<ScoredSet>,
    pub(crate) networks: Vec<TrainedNetwork>,
    /// Index of the best network.
    pub(crate) best: usize,
    pub(crate) seconds: f64,
}

/// Experiments that networks are scored on, and the score of the best class for each experiment.
#[derive(Serialize)]
pub(crate) struct ScoredSet {
    pub(crate) kind: SetKind,
    pub(crate) protocol: Protocol,
    pub(crate) examples: usize,
    pub(crate) unsteady: u64,
    /// With gains from harmonics, and with gains from amplitudes.
    pub(crate) best: [Score; 2],
}

/// Which processes a set of experiments has.
#[derive(Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum SetKind {
    /// The classes; the best epoch is chosen on them.
    Verification,
    /// Random processes.
    Test,
}

/// The network trained with one loss.
#[derive(Serialize)]
pub(crate) struct TrainedNetwork {
    pub(crate) loss: Loss,
    /// Why training ended.
    pub(crate) outcome: &'static str,
    pub(crate) history: Vec<Epoch>,
    /// Seconds of training in this run.
    pub(crate) seconds: f64,
    /// For every set, the score by each of [`onecycle_lab::paper::classifier::PickRule::ALL`].
    pub(crate) scores: Vec<[Score; 2]>,
    /// Every set, its most likely classes counted in other ways; empty for a regression.
    #[serde(skip)]
    pub(crate) counted: Vec<Counted>,
}

/// Scores of the most likely classes with gains found in each way of [`onecycle_lab::paper::classifier::Gain::ALL`].
pub(crate) struct Counted {
    /// The whole set.
    pub(crate) whole: [Score; 4],
    /// Each fifty of it, the size of the paper's testing set.
    pub(crate) fifties: Vec<[Score; 4]>,
}
