//! What an experiment leaves: one row a sample.

/// Columns of equal length. Row `i`: the output was read at `time_s[i]`, then the input was held
/// from `time_s[i]` to `time_s[i + 1]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Time of the sample (s), increasing.
    pub time_s: Vec<f64>,
    /// Input as commanded, without the bias (input unit).
    pub input: Vec<f64>,
    /// Output as measured (output unit).
    pub output: Vec<f64>,
    /// Output as it was (output unit).
    pub true_output: Vec<f64>,
}

impl Trace {
    /// An empty trace with room for `samples` rows.
    #[must_use]
    pub fn with_capacity(samples: usize) -> Self {
        Self {
            time_s: Vec::with_capacity(samples),
            input: Vec::with_capacity(samples),
            output: Vec::with_capacity(samples),
            true_output: Vec::with_capacity(samples),
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Appends a sample.
    #[inline]
    pub fn push(&mut self, time_s: f64, input: f64, output: f64, true_output: f64) {
        self.time_s.push(time_s);
        self.input.push(input);
        self.output.push(output);
        self.true_output.push(true_output);
    }

    /// Removes all samples and keeps the room.
    pub fn clear(&mut self) {
        self.time_s.clear();
        self.input.clear();
        self.output.clear();
        self.true_output.clear();
    }
}
