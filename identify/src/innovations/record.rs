//! Record: the samples that a likelihood is made of, in blocks.
//!
//! A block is `M` consecutive samples of an even grid. Its datum is the **sum of the samples present**: the sum is an
//! anti-alias filter, and the model of the sum is exact, so decimation costs information but causes no bias. A sample
//! that was lost, is stale or is an outlier is absent: it is not summed. Samples with uneven time stamps form blocks of one.

use std::collections::HashMap;

/// What the input does between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Hold {
    /// It keeps the value of the last sample: the recording has the rate of the loop that makes the input.
    Held,
    /// It runs straight to the next sample: the recording is thinned from a faster loop.
    Interpolated,
}

impl Hold {
    /// Name in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Interpolated => "interpolated",
        }
    }
}

/// Samples of a record.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    /// Time of each sample from the first (s), if they are uneven. Empty on an even grid.
    pub(crate) uneven_s: Vec<f64>,
    /// Sample period (s); the median increment of uneven samples.
    pub(crate) dt_s: f64,
    /// Input at each sample (input unit).
    pub(crate) input: Vec<f64>,
    /// Output at each sample (output unit). Any finite value where the sample is absent.
    pub(crate) output: Vec<f64>,
    /// Whether the output of a sample is used.
    pub(crate) present: Vec<bool>,
    /// Input between the samples.
    pub(crate) hold: Hold,
    /// How the process was at rest when the record began. `None`: the state at the start is not known.
    pub(crate) rest: Option<Rest>,
    /// Nonlinear terms of the model.
    pub(crate) forces: Forces,
    /// Least deviation of the white noise of a sample that is believed (output unit): below it the digits of a file and the errors
    /// of any model decide. Zero: no limit.
    pub(crate) floor: f64,
}

/// Nonlinear forces that act on the process behind the actuator lags, together with the input and the disturbance. The
/// model is linear in their coefficients. `Default`: no force.
#[derive(Clone, Debug, Default)]
pub(crate) struct Forces {
    /// Square of the rate of the output, with its sign, at each sample (output unit^2/s^2): drag. Empty for none.
    pub(crate) drag: Vec<f64>,
    /// Sign of the rate of the output at each sample, smoothed near zero: dry friction. Empty for none.
    pub(crate) friction: Vec<f64>,
    /// Input about which the force has a part that is quadratic in the lagged input: thrust over rotor speed. The gain is that at this
    /// input.
    pub(crate) thrust: Option<f64>,
}

impl Forces {
    /// Forces that the rate of the output causes, sample by sample, in the order of their coefficients.
    pub(crate) fn of_rate(&self) -> impl Iterator<Item = &[f64]> {
        let forces = [&self.drag, &self.friction].into_iter();
        forces.filter(|force| !force.is_empty()).map(Vec::as_slice)
    }

    /// Number of coefficients, those of the rate first.
    pub(crate) fn len(&self) -> usize {
        self.of_rate().count() + usize::from(self.thrust.is_some())
    }
}

/// Rest before a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rest {
    /// Input before the record.
    pub(crate) input: f64,
    /// Whether the output of an integrator may have moved at a constant rate.
    pub(crate) may_drift: bool,
}

impl Record {
    /// Record of all samples on an even grid.
    #[cfg(test)]
    pub(crate) fn even(dt_s: f64, input: Vec<f64>, output: Vec<f64>) -> Self {
        Self {
            uneven_s: vec![],
            dt_s,
            present: vec![true; output.len()],
            input,
            output,
            hold: Hold::Held,
            rest: None,
            forces: Forces::default(),
            floor: 0.0,
        }
    }

    /// Outputs of the samples that are present.
    pub(crate) fn present_outputs(&self) -> impl Iterator<Item = f64> {
        let samples = self.output.iter().zip(&self.present);
        samples.filter(|(_, present)| **present).map(|(y, _)| *y)
    }

    /// Standard deviation of the outputs present; 1 if they are constant.
    pub(crate) fn output_deviation(&self) -> f64 {
        let count = self.present_outputs().count().max(1) as f64;
        let mean = self.present_outputs().sum::<f64>() / count;
        let squares = self.present_outputs().map(|y| (y - mean) * (y - mean));
        let variance = squares.sum::<f64>() / count;
        if variance > 0.0 { variance.sqrt() } else { 1.0 }
    }

    /// Whether most inputs are those of the sample before.
    pub(crate) fn keeps_its_input(&self) -> bool {
        let pairs = self.input.windows(2);
        2 * pairs.filter(|pair| pair[0] == pair[1]).count() > self.len()
    }

    /// Number of samples, absent ones included.
    pub(crate) fn len(&self) -> usize {
        self.output.len()
    }

    /// Time of a sample from the first (s).
    pub(crate) fn time_s(&self, index: usize) -> f64 {
        (self.uneven_s.get(index).copied()).unwrap_or(index as f64 * self.dt_s)
    }

    /// Index of the first sample at or after a time (s).
    pub(crate) fn index_at(&self, time_s: f64) -> usize {
        if self.uneven_s.is_empty() {
            ((time_s / self.dt_s - 1e-9).ceil().max(0.0) as usize).min(self.len())
        } else {
            self.uneven_s.partition_point(|&at| at < time_s - 1e-12)
        }
    }

    /// Samples at the start whose outputs are not used: those of `skip_s`, unless the process was at rest.
    pub(crate) fn skipped(&self, skip_s: f64) -> usize {
        self.rest.map_or_else(|| self.index_at(skip_s), |_| 0)
    }

    /// The same record with its uneven times rounded to a `part` of the sample period, or of an increment that is longer, so that
    /// few lengths of step occur: the likelihood needs the matrices of each. Where two samples meet the output of the later one
    /// counts.
    pub(crate) fn rounded(mut self, part: f64) -> Self {
        let mut now_s = 0.0;
        for sample in 0..self.uneven_s.len() {
            let step_s: f64 = self.uneven_s[sample] - now_s;
            let octave = (step_s / self.dt_s).log2().floor().max(0.0);
            let unit_s = self.dt_s * part * octave.exp2();
            let rounded_s = (step_s / unit_s).round() * unit_s;
            if rounded_s == 0.0 && sample > 0 {
                self.present[sample - 1] = false;
            }
            now_s += rounded_s;
            self.uneven_s[sample] = now_s;
        }
        self
    }

    /// The same record of a process that was at rest under the first input.
    pub(crate) fn at_rest(&self, may_drift: bool) -> Self {
        let input = self.input[0];
        Self {
            rest: Some(Rest { input, may_drift }),
            ..self.clone()
        }
    }

    /// The same record without the samples outside `range`.
    pub(crate) fn part(&self, range: std::ops::Range<usize>) -> Self {
        let start_s = self.time_s(range.start);
        let times = self.uneven_s.get(range.clone()).unwrap_or(&[]);
        Self {
            uneven_s: times.iter().map(|time_s| time_s - start_s).collect(),
            dt_s: self.dt_s,
            input: self.input[range.clone()].to_vec(),
            output: self.output[range.clone()].to_vec(),
            present: self.present[range.clone()].to_vec(),
            hold: self.hold,
            rest: self.rest.filter(|_| range.start == 0),
            forces: Forces {
                drag: (self.forces.drag.get(range.clone()).unwrap_or(&[])).to_vec(),
                friction: self.forces.friction.get(range).unwrap_or(&[]).to_vec(),
                thrust: self.forces.thrust,
            },
            floor: self.floor,
        }
    }
}

/// Length of a block and the samples present in it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BlockKind {
    /// Sample period within the block (s); for uneven samples the time to the next sample.
    pub(crate) step_s: f64,
    /// Samples present. All others of the block are absent.
    pub(crate) mask: Vec<bool>,
}

/// A record in blocks.
#[derive(Clone, Debug)]
pub(crate) struct Blocks<'a> {
    pub(crate) record: &'a Record,
    /// Samples a block.
    pub(crate) samples: usize,
    /// First sample of the first block. The input before is used, the output is not: it may depend on input from before
    /// the record.
    pub(crate) first: usize,
    /// Different kinds of blocks.
    pub(crate) kinds: Vec<BlockKind>,
    /// Index in `kinds` of each block.
    pub(crate) kind_of: Vec<u32>,
    /// Sum of the outputs present in each block, over [`Self::scale`].
    pub(crate) sums: Vec<f64>,
    /// Standard deviation of the outputs (output unit).
    pub(crate) scale: f64,
}

impl<'a> Blocks<'a> {
    /// Blocks of `samples` samples (one for uneven samples), from the first output present `skip_s` after the first
    /// sample on: the outputs before depend on an input before the record that is not known. If the process was at rest it
    /// is known, and no output is skipped.
    pub(crate) fn new(record: &'a Record, samples: usize, skip_s: f64) -> Self {
        Self::from(record, samples, record.skipped(skip_s))
    }

    /// Blocks from the first output present at or after the sample `start` on.
    pub(crate) fn from(record: &'a Record, samples: usize, start: usize) -> Self {
        let even = record.uneven_s.is_empty();
        let samples = if even { samples.max(1) } else { 1 };
        let first = (start..record.len()).find(|sample| record.present[*sample]);
        let first = first.unwrap_or(start);
        let count = record.len().saturating_sub(first) / samples;
        let scale = record.output_deviation();
        let mut blocks = Self {
            record,
            samples,
            first,
            kinds: vec![],
            kind_of: Vec::with_capacity(count),
            sums: Vec::with_capacity(count),
            scale,
        };
        let mut known: HashMap<(u64, Vec<bool>), u32> = HashMap::new();
        for block in 0..count {
            let range = first + block * samples..first + (block + 1) * samples;
            let step_s = blocks.step_s(range.start);
            let mask = &record.present[range.clone()];
            let outputs = record.output[range].iter().zip(mask);
            let sum: f64 = outputs
                .filter(|(_, present)| **present)
                .map(|(y, _)| y)
                .sum();
            let next = blocks.kinds.len() as u32;
            // To the nanosecond: clocks are no better, and jitter would make every block a kind of its own.
            let key = ((step_s * 1e9).round() as u64, mask.to_vec());
            let kind = *known.entry(key).or_insert(next);
            if kind == next {
                let mask = mask.to_vec();
                blocks.kinds.push(BlockKind { step_s, mask });
            }
            blocks.kind_of.push(kind);
            blocks.sums.push(sum / scale);
        }
        blocks
    }

    fn step_s(&self, sample: usize) -> f64 {
        match &self.record.uneven_s[..] {
            [] => self.record.dt_s,
            times => times.get(sample + 1).map_or(self.record.dt_s, |next| {
                ((next - times[sample]) * 1e9).round() * 1e-9
            }),
        }
    }

    /// Number of blocks.
    pub(crate) fn len(&self) -> usize {
        self.sums.len()
    }

    /// Length of a block (s).
    pub(crate) fn block_s(&self) -> f64 {
        self.samples as f64 * self.record.dt_s
    }

    /// Time from the first block to the end of the record (s).
    pub(crate) fn length_s(&self) -> f64 {
        self.record.time_s(self.record.len() - 1) - self.record.time_s(self.first)
    }

    /// Samples of a block.
    pub(crate) fn range(&self, block: usize) -> std::ops::Range<usize> {
        let start = self.first + block * self.samples;
        start..start + self.samples
    }

    /// Number of samples present in a block.
    pub(crate) fn present(&self, block: usize) -> usize {
        let mask = &self.kinds[self.kind_of[block] as usize].mask;
        mask.iter().filter(|present| **present).count()
    }

    /// Mean of the outputs present in a block (output unit). `None` if none is.
    pub(crate) fn mean_output(&self, block: usize) -> Option<f64> {
        let count = self.present(block);
        (count > 0).then(|| self.sums[block] * self.scale / count as f64)
    }

    /// Mean of the input over each block.
    pub(crate) fn mean_inputs(&self) -> Vec<f64> {
        let mean = |block: usize| {
            let range = self.range(block);
            let count = range.len() as f64;
            self.record.input[range].iter().sum::<f64>() / count
        };
        (0..self.len()).map(mean).collect()
    }

    /// Sums over the samples present in each block of a value of each sample.
    pub(crate) fn sums_of(&self, values: &[f64]) -> Vec<f64> {
        let sum = |block: usize| {
            let range = self.range(block);
            let values = values[range.clone()]
                .iter()
                .zip(&self.record.present[range]);
            values
                .filter(|(_, present)| **present)
                .map(|(v, _)| v)
                .sum()
        };
        (0..self.len()).map(sum).collect()
    }
}
