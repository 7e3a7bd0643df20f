//! Examples: trials with the inputs of the network, the class that fits best, and the costs of all
//! others.

use std::ops::Range;

use onecycle_onboard::{Pd, Soiptd};

use super::ClassifierError;
use super::classes::{Class, Classes, Gain, Measured, TrueProcess, label};
use super::experiment::{Trial, Trials};
use super::input::{Fit, INPUTS, Prepared};
use crate::learn::train::{Batch, Dataset};
use crate::space::Space;
use crate::workers::Workers;
use onecycle_design::soiptd_pd::deterioration::Deterioration;

/// Processes of the examples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processes {
    /// Random processes of the space.
    Random,
    /// Random processes, but every n-th example is of a class, one after the other.
    RandomAndClasses {
        /// The interval `n`.
        every: u64,
    },
    /// The classes themselves, one after the other.
    Classes,
}

/// What is read from a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// How the gain of a class is found.
    pub gain: Gain,
    /// How the signals are fitted into the network's inputs.
    pub fit: Fit,
    /// The true class.
    pub label: Label,
}

/// The class that an example is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Label {
    /// The one that costs least.
    #[default]
    Cheapest,
    /// The one that was simulated: the paper's way. That of a random process is the one that costs least.
    Simulated,
}

/// An example. See the [module](self).
#[derive(Clone, Debug, PartialEq)]
struct Example {
    prepared: Prepared,
    truth: TrueProcess,
    /// What a regression learns: [`coordinates`] of the times.
    coordinates: [f32; TIMES],
    /// Measured in each way of [`Gain::ALL`].
    measured: [Measured; 4],
    label: usize,
    costs: Vec<f32>,
}

/// Examples in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Examples {
    examples: Vec<Example>,
    labels: Vec<usize>,
    inputs: usize,
    gain: Gain,
    space: Space,
    unsteady: u64,
}

/// Number of times of a process.
pub(super) const TIMES: usize = 3;

fn times_s(process: &Soiptd) -> [f64; TIMES] {
    let t_body_s = process.inv_t_body_per_s().recip();
    [process.t_prop_s(), t_body_s, process.tau_s()]
}

/// The logarithms of `T_prop`, `T_body` and `tau` (s), from -1 to 1 over the space; zero for a time that the space does not
/// spread over two positive values.
#[must_use]
pub fn coordinates(space: &Space, times_s: [f64; TIMES]) -> [f32; TIMES] {
    let mut at = [0.0; TIMES];
    for ((to, time_s), (low, high)) in at.iter_mut().zip(times_s).zip(space.ranges_s()) {
        let spread = (high / low).ln();
        if spread.is_finite() && spread > 0.0 {
            *to = (2.0 * (time_s / low).ln() / spread - 1.0) as f32;
        }
    }
    at
}

/// The times (s) at these [`coordinates`].
#[must_use]
pub fn times_at(space: &Space, at: &[f32]) -> [f64; TIMES] {
    let mut times_s = [0.0; TIMES];
    for ((time_s, at), (low, high)) in times_s.iter_mut().zip(at).zip(space.ranges_s()) {
        let spread = (high / low).ln();
        let is_spread = spread.is_finite() && spread > 0.0;
        *time_s = if is_spread {
            low * (0.5 * (f64::from(*at) + 1.0) * spread).exp()
        } else {
            low
        };
    }
    times_s
}

impl Processes {
    fn class(self, n: u64, classes: usize) -> Option<usize> {
        let turn = match self {
            Self::Random => return None,
            Self::RandomAndClasses { every } if n.is_multiple_of(every) => n / every,
            Self::RandomAndClasses { .. } => return None,
            Self::Classes => n,
        };
        Some((turn % classes as u64) as usize)
    }
}

impl Examples {
    /// The examples of the trials of these numbers. Those of a trial depend on its number alone.
    ///
    /// # Errors
    /// Where a process has no controller.
    pub fn make(
        (trials, numbers): (&Trials, Range<u64>),
        processes: Processes,
        (classes, reading): (&Classes, Reading),
        workers: &dyn Workers,
    ) -> Result<Self, ClassifierError> {
        let Reading { gain, fit, .. } = reading;
        let count = numbers.end - numbers.start;
        let made = workers.map(count as usize, |k| {
            let n = numbers.start + k as u64;
            let class = processes.class(n, classes.len());
            let trial = trials.trial(n, class.map(|class| classes.times_s(class)))?;
            trial
                .and_then(|trial| {
                    let measured = measured(&trial, trials.space.beta)?;
                    Some((trial, measured))
                })
                .map(|(trial, measured)| {
                    let truth = classes.truth(trial.process)?;
                    let costs = classes.costs(&truth, &measured[gain as usize]);
                    let simulated = class.filter(|_| reading.label == Label::Simulated);
                    let mut prepared = Prepared::of(&trial.cycle, fit);
                    if let Some((most, mut rng)) = trial.noise_afterwards {
                        prepared.disturb(most, &mut rng);
                    }
                    Ok(Example {
                        label: simulated.unwrap_or_else(|| label(&costs)),
                        coordinates: coordinates(&trials.space, times_s(&trial.process)),
                        prepared,
                        costs,
                        truth,
                        measured,
                    })
                })
                .transpose()
        });
        let made: Vec<Option<Example>> =
            made.into_iter().collect::<Result<_, ClassifierError>>()?;
        let examples: Vec<Example> = made.into_iter().flatten().collect();
        Ok(Self {
            unsteady: count - examples.len() as u64,
            labels: examples.iter().map(|one| one.label).collect(),
            examples,
            inputs: INPUTS,
            gain,
            space: trials.space,
        })
    }

    /// The same examples with every n-th input alone, `n` a divisor of [`SAMPLES`](super::SAMPLES).
    #[must_use]
    pub fn thinned(self, every: usize) -> Self {
        Self {
            inputs: INPUTS / every.max(1),
            ..self
        }
    }

    /// Number of inputs of the network.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// The class of each example, as the [`Label`] says.
    #[must_use]
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// Number of trials whose oscillation did not become steady; they give no example.
    #[must_use]
    pub fn unsteady(&self) -> u64 {
        self.unsteady
    }

    /// Cost of every class for example `i`; panics if there is none.
    #[must_use]
    pub fn costs(&self, i: usize) -> &[f32] {
        &self.examples[i].costs
    }

    /// Cost of the controller of a process with these [`coordinates`] on example `i`, with its gain from the harmonics;
    /// panics if there is none.
    #[must_use]
    pub fn judge_regressed(&self, i: usize, classes: &Classes, at: &[f32]) -> Deterioration {
        let Example {
            truth, measured, ..
        } = &self.examples[i];
        let Measured::Harmonics(harmonics) = &measured[Gain::Harmonics as usize] else {
            return Deterioration::Unstable;
        };
        let [t_prop_s, t_body_s, tau_s] = times_at(&self.space, at);
        let found = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).ok();
        let found = found.and_then(|process| classes.truth(process).ok());
        found.map_or(Deterioration::Unstable, |found| {
            let gain = harmonics.gain(&found.process, harmonics.first.omega_rad_per_s);
            let Pd { kp, kd } = found.best.pd;
            truth.judge(Pd {
                kp: kp / gain,
                kd: kd / gain,
            })
        })
    }

    /// The inputs of every example, one after the other.
    pub fn rows(&self) -> impl Iterator<Item = Vec<f32>> {
        self.examples.iter().map(|one| {
            let mut row = vec![0.0; self.inputs];
            one.prepared.fill(&mut row);
            row
        })
    }

    /// How the gain of a class is found.
    #[must_use]
    pub fn gain(&self) -> Gain {
        self.gain
    }

    /// Cost, on example `i`, of the controller of a class whose gain is found by `gain`; panics if `i` is out of range.
    #[must_use]
    pub fn judge(&self, i: usize, class: &Class, gain: Gain) -> Deterioration {
        let Example {
            truth, measured, ..
        } = &self.examples[i];
        truth.judge(class.controller(&measured[gain as usize]))
    }

    /// The best class of each example and its cost, with gains found in this way.
    #[must_use]
    pub fn best(&self, classes: &Classes, gain: Gain) -> Vec<(usize, Deterioration)> {
        let best = |example: &Example| {
            let measured = &example.measured[gain as usize];
            let class = label(&classes.costs(&example.truth, measured));
            let controller = classes.class(class).controller(measured);
            (class, example.truth.judge(controller))
        };
        self.examples.iter().map(best).collect()
    }
}

fn measured(trial: &Trial, beta: f64) -> Option<[Measured; 4]> {
    let [harmonics, amplitude, describing, _] =
        Gain::ALL.map(|gain| Measured::of(gain, &trial.cycle, beta));
    let matched = Measured::matched(&trial.process, beta);
    Some([harmonics?, amplitude?, describing?, matched?])
}

impl Dataset for Examples {
    fn len(&self) -> usize {
        self.examples.len()
    }

    fn fill(&self, samples: &[usize], batch: &mut Batch) {
        let classes = self.examples.first().map_or(0, |one| one.costs.len());
        batch.inputs.reshape(samples.len(), self.inputs);
        batch.costs.reshape(samples.len(), classes);
        batch.classes.clear();
        for (row, &sample) in samples.iter().enumerate() {
            let example = &self.examples[sample];
            example.prepared.fill(batch.inputs.row_mut(row));
            batch.costs.row_mut(row).copy_from_slice(&example.costs);
            batch.classes.push(self.labels[sample]);
        }
        batch.values.reshape(samples.len(), TIMES);
        for (row, &sample) in samples.iter().enumerate() {
            let values = batch.values.row_mut(row);
            values.copy_from_slice(&self.examples[sample].coordinates);
        }
        batch.weights.clear();
    }
}
