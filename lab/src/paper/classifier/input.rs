//! What the network sees: one cycle as the paper prepares it (its figure 5), or nearly so.
//!
//! Sampled at 1 ms, output and input of one steady cycle stand one after the other, each of 2260 numbers,
//! centred and scaled to an amplitude of one:
//!
//! ```text
//! padded     (pv_0 - mean) / a, .., 0, .., 0,   (u_0 - centre) / h, .., 0, .., 0      2 x 2260
//! stretched  (pv_0 - mean) / a,  ..........,    (u_0 - centre) / h, .., 0, .., 0
//! ```
//!
//! Padded is the paper's. Stretched, the output fills all 2260 numbers whatever the period, which the
//! padding of the input goes on to tell: the same shape looks the same at every time scale, and is
//! learnt from far fewer examples.
//!
//! A cycle begins where the relay rises. `a` is the amplitude of the sine that has the output's variance:
//! half the span, which 3 % of noise raises by a tenth, is no steady measure. The input becomes its
//! levels, -1 and 1. The paper has 2260 samples for its slowest member; the slowest here have 2310, and up
//! to three times as many under a bias that is not trimmed: what is padded and beyond is cut off, after
//! all has been centred and scaled.

use crate::experiments::SampledCycle;

/// Samples of either signal: the paper's.
pub const SAMPLES: usize = 2260;

/// Numbers that the network sees.
pub const INPUTS: usize = 2 * SAMPLES;

/// How the output comes to [`SAMPLES`] numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// With zeros behind it: the paper's.
    #[default]
    Padded,
    /// Interpolated between its samples.
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
    /// Of a cycle.
    #[must_use]
    pub fn of(cycle: &SampledCycle, fit: Fit) -> Self {
        let mut input = scaled(&cycle.input, span(&cycle.input));
        let mut output = scaled(&cycle.output, level_and_amplitude(&cycle.output));
        input.truncate(SAMPLES);
        if fit == Fit::Padded {
            output.truncate(SAMPLES);
        }
        Self { output, input, fit }
    }

    /// Writes all [`INPUTS`] numbers.
    pub fn fill(&self, row: &mut [f32]) {
        row.fill(0.0);
        let (output, input) = row.split_at_mut(SAMPLES);
        input[..self.input.len()].copy_from_slice(&self.input);
        match self.fit {
            Fit::Padded => output[..self.output.len()].copy_from_slice(&self.output),
            Fit::Stretched => stretch(&self.output, output),
        }
    }
}

/// About a centre, over an amplitude; zeros of a signal that stands still.
fn scaled(signal: &[f32], (centre, amplitude): (f64, f64)) -> Vec<f32> {
    let scale = if amplitude > 0.0 {
        amplitude.recip()
    } else {
        0.0
    };
    let scaled = |&value: &f32| ((f64::from(value) - centre) * scale) as f32;
    signal.iter().map(scaled).collect()
}

/// A whole cycle of a periodic signal in as many samples as there is room for, linear between its own.
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

/// Mean, and amplitude of the sine that has the same variance.
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
