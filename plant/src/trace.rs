//! Rows of an experiment, one per sample, and a trace of them in memory.

/// One sample of an experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Row {
    /// Time of the sample (s).
    pub time_s: f64,
    /// Set-point that the controller follows (output unit).
    pub setpoint: f64,
    /// Commanded input from this sample to the next, without the bias (input unit).
    pub input: f64,
    /// Measured output (output unit). `None` if the sensor dropped the sample.
    pub output: Option<f64>,
    /// True output (output unit).
    pub true_output: f64,
}

/// Columns of equal length. In row `i` the output is measured at `time_s[i]`, and the input is held from
/// `time_s[i]` to the next sample, which is `time_s[i + 1]` unless the sensor dropped it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Time of the sample (s), increasing.
    pub time_s: Vec<f64>,
    /// Commanded input, without the bias (input unit).
    pub input: Vec<f64>,
    /// Measured output (output unit).
    pub output: Vec<f64>,
    /// True output (output unit).
    pub true_output: Vec<f64>,
}

impl Trace {
    /// An empty trace with memory for `samples` rows.
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

    /// Half the peak-to-peak true output (output unit) of the last `samples` samples, or of all if there are
    /// fewer; zero for an empty trace.
    #[must_use]
    pub fn amplitude_of_last(&self, samples: usize) -> f64 {
        let tail = &self.true_output[self.len().saturating_sub(samples)..];
        let Some(&first) = tail.first() else {
            return 0.0;
        };
        let (low, high) = tail
            .iter()
            .fold((first, first), |(low, high), &y| (low.min(y), high.max(y)));
        0.5 * (high - low)
    }

    /// Removes all samples and keeps the memory.
    pub fn clear(&mut self) {
        self.time_s.clear();
        self.input.clear();
        self.output.clear();
        self.true_output.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Of 9, -1, 3, 2 the last three span -1 to 3, and all span -1 to 9.
    #[test]
    fn amplitude_is_half_the_span_of_the_tail() {
        let mut trace = Trace::default();
        assert_eq!(trace.amplitude_of_last(3), 0.0);
        for (k, y) in [9.0, -1.0, 3.0, 2.0].into_iter().enumerate() {
            trace.push(k as f64, 0.0, 0.0, y);
        }
        assert_eq!(trace.amplitude_of_last(3), 2.0);
        assert_eq!(trace.amplitude_of_last(100), 5.0);
    }
}
