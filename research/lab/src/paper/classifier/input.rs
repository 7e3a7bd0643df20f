//! Inputs of the network: one cycle, prepared nearly as in the paper (its figure 5).
//!
//! Output and input of one steady cycle, sampled at 1 ms, follow each other with 2260 numbers each,
//! centred and scaled to an amplitude of one:
//!
//! ```text
//! padded     (pv_0 - mean) / a, .., 0, .., 0,   (u_0 - centre) / h, .., 0, .., 0      2 x 2260
//! in front   0, .., 0, (pv_0 - middle) / b, ..,   0, .., 0, (u_0 - centre) / h, ..
//! stretched  (pv_0 - mean) / a,  ..........,    (u_0 - centre) / h, .., 0, .., 0
//! ```
//!
//! Padding is the paper's way; the authors' published code has the zeros in front, and takes the middle of the extremes and
//! half their difference, `b`. Stretched, the output fills all 2260 numbers whatever the period, which
//! remains visible in the padding of the input. The same shape then looks the same at every time scale
//! and is learnt from far fewer examples.
//!
//! A cycle begins at a rise of the relay. `a` is the amplitude of the sine with the output's variance;
//! half the span would be raised by a tenth by 3 % of noise. The input becomes its levels, -1 and 1.
//! The paper has 2260 samples for its slowest member; the slowest here have 2310, and up to three times
//! as many under a bias that is not trimmed. Padded signals are cut off there, after centring and
//! scaling.

use rand::{Rng, RngExt};

use crate::experiments::SampledCycle;

/// Samples of either signal: the paper's.
pub const SAMPLES: usize = 2260;

/// Numbers that the network sees.
pub const INPUTS: usize = 2 * SAMPLES;

/// How the output is fitted into [`SAMPLES`] numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// Padded with zeros: the paper's way.
    #[default]
    Padded,
    /// Zeros in front; the output less the middle of its extremes, over half their difference: the authors' published code.
    PaddedInFront,
    /// Stretched by interpolation.
    Stretched,
}

/// Both signals of a cycle, centred and scaled, at most [`SAMPLES`] of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    output: Vec<f32>,
    input: Vec<f32>,
    fit: Fit,
}

impl Prepared {
    /// Prepares a cycle.
    #[must_use]
    pub fn of(cycle: &SampledCycle, fit: Fit) -> Self {
        let mut input = scaled(&cycle.input, span(&cycle.input));
        let of_output = match fit {
            Fit::PaddedInFront => span(&cycle.output),
            Fit::Padded | Fit::Stretched => level_and_amplitude(&cycle.output),
        };
        let mut output = scaled(&cycle.output, of_output);
        match fit {
            Fit::Padded => output.truncate(SAMPLES),
            Fit::PaddedInFront => {
                for signal in [&mut input, &mut output] {
                    signal.drain(..signal.len().saturating_sub(SAMPLES));
                }
            }
            Fit::Stretched => {}
        }
        input.truncate(SAMPLES);
        Self { output, input, fit }
    }

    /// Adds noise to the output as the authors' published code does, after the normalisation: uniform from `-2 most` to zero.
    pub fn disturb(&mut self, most: f64, rng: &mut impl Rng) {
        for value in &mut self.output {
            *value -= (2.0 * most * rng.random_range(0.0..=1.0)) as f32;
        }
    }

    /// Writes all [`INPUTS`] numbers, or every n-th of them into a row that is n times shorter, `n` a divisor of [`SAMPLES`].
    pub fn fill(&self, row: &mut [f32]) {
        if row.len() < INPUTS {
            let mut all = vec![0.0; INPUTS];
            self.fill(&mut all);
            let every = INPUTS / row.len().max(1);
            for (one, kept) in row.iter_mut().zip(all.iter().step_by(every)) {
                *one = *kept;
            }
            return;
        }
        row.fill(0.0);
        let (output, input) = row.split_at_mut(SAMPLES);
        let in_front = match self.fit {
            Fit::PaddedInFront => SAMPLES - self.input.len(),
            Fit::Padded | Fit::Stretched => 0,
        };
        input[in_front..][..self.input.len()].copy_from_slice(&self.input);
        match self.fit {
            Fit::Stretched => stretch(&self.output, output),
            Fit::Padded | Fit::PaddedInFront => {
                output[in_front..][..self.output.len()].copy_from_slice(&self.output);
            }
        }
    }
}

/// The signal less a centre, over an amplitude; zeros for a constant signal.
fn scaled(signal: &[f32], (centre, amplitude): (f64, f64)) -> Vec<f32> {
    let scale = if amplitude > 0.0 {
        amplitude.recip()
    } else {
        0.0
    };
    let scaled = |&value: &f32| ((f64::from(value) - centre) * scale) as f32;
    signal.iter().map(scaled).collect()
}

/// Stretches a whole cycle of a periodic signal to the length of `to`, linear between samples.
fn stretch(signal: &[f32], to: &mut [f32]) {
    if signal.is_empty() {
        return;
    }
    let step = signal.len() as f64 / to.len() as f64;
    for (k, value) in to.iter_mut().enumerate() {
        let at = k as f64 * step;
        let (before, part) = (at.floor() as usize, at.fract() as f32);
        let [one, next] = [before, before + 1].map(|sample| signal[sample % signal.len()]);
        *value = one + part * (next - one);
    }
}

/// Mean, and amplitude of the sine with the same variance.
fn level_and_amplitude(signal: &[f32]) -> (f64, f64) {
    let samples = signal.len().max(1) as f64;
    let mean = signal.iter().copied().map(f64::from).sum::<f64>() / samples;
    let square = |value: &f32| (f64::from(*value) - mean).powi(2);
    let variance = signal.iter().map(square).sum::<f64>() / samples;
    (mean, (2.0 * variance).sqrt())
}

/// Mean of highest and lowest value, and half their difference.
fn span(signal: &[f32]) -> (f64, f64) {
    let (low, high) = (signal.iter())
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &value| {
            (low.min(value), high.max(value))
        });
    let (low, high) = (f64::from(low), f64::from(high));
    (0.5 * (high + low), 0.5 * (high - low))
}
