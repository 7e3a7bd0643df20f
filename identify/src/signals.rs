//! Columns of a recording.

/// Recording as columns of equal length. The caller ensures at least two points, increasing time and finite values.
#[derive(Clone, Copy, Debug)]
pub struct Signals<'a> {
    /// Time at the beginning of each point (s).
    pub time_s: &'a [f64],
    /// Input held from each point to the next (input unit).
    pub input: &'a [f64],
    /// Output: mean of the samples of each point (output unit).
    pub output: &'a [f64],
    /// Number of samples averaged into a point; 1 for a recording that was not averaged.
    pub samples_per_point: u32,
    /// Sample period (s).
    pub sample_period_s: f64,
    /// Index of the first point after each gap, ascending.
    pub breaks: &'a [usize],
}

/// Least and largest value.
pub(crate) fn range(values: &[f64]) -> (f64, f64) {
    (values.iter()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (value.min(low), value.max(high))
    })
}

/// Smallest change between neighbouring samples: an estimate of the quantum of the sensor. Infinite if nothing changes.
pub(crate) fn smallest_step(output: &[f64]) -> f64 {
    output
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .filter(|&step| step > 0.0)
        .fold(f64::INFINITY, f64::min)
}

/// Standard deviation of the rounding error of an output: uniform over its smallest step.
pub(crate) fn rounding_deviation(output: &[f64]) -> f64 {
    smallest_step(output) / 12_f64.sqrt()
}

/// Whether all values are equal.
pub(crate) fn is_constant(values: &[f64]) -> bool {
    values.iter().all(|value| *value == values[0])
}

/// Whether the input is held at a first level, and ten times as long or longer at a second one.
pub(crate) fn begins_with_a_step(input: &[f64]) -> bool {
    let mut levels = input.chunk_by(|a, b| a == b).map(<[f64]>::len);
    let (first, second) = (levels.next(), levels.next());
    first
        .zip(second)
        .is_some_and(|(first, second)| second >= 10 * first)
}

impl<'a> Signals<'a> {
    /// Samples at an even period (s), none missing.
    #[must_use]
    pub fn even(
        time_s: &'a [f64],
        input: &'a [f64],
        output: &'a [f64],
        sample_period_s: f64,
    ) -> Self {
        Self {
            time_s,
            input,
            output,
            samples_per_point: 1,
            sample_period_s,
            breaks: &[],
        }
    }

    /// The rows of a span of time (s), open where an end is `None`. `breaks` holds those of the part.
    pub(crate) fn within<'b>(
        &'b self,
        (from_s, to_s): (Option<f64>, Option<f64>),
        breaks: &'b mut Vec<usize>,
    ) -> Signals<'b> {
        let first = from_s.map_or(0, |from_s| self.time_s.partition_point(|t| *t < from_s));
        let end = to_s.map_or(self.time_s.len(), |to_s| {
            self.time_s.partition_point(|t| *t <= to_s)
        });
        self.part(first.min(end)..end, breaks)
    }

    /// The input moved to `late_s` (s) before its time stamps: of each point the mean over its time. Before its first and
    /// after its last value the input is held.
    pub(crate) fn input_earlier(&self, late_s: f64) -> Vec<f64> {
        let count = self.input.len();
        let mut integral = vec![0.0];
        for index in 1..count {
            let step_s = self.time_s[index] - self.time_s[index - 1];
            integral.push(integral[index - 1] + self.input[index - 1] * step_s);
        }
        let until = |time_s: f64| {
            let index = self.time_s.partition_point(|t| *t <= time_s).max(1) - 1;
            integral[index] + self.input[index] * (time_s - self.time_s[index])
        };
        let start_s = |index: usize| match self.time_s.get(index) {
            Some(time_s) => time_s + late_s,
            None => self.time_s[count - 1] + self.sample_period_s + late_s,
        };
        let mean = |index: usize| {
            let (from_s, to_s) = (start_s(index), start_s(index + 1));
            let at = self.time_s.partition_point(|t| *t <= from_s).max(1);
            // Exactly the value where nothing changes in between.
            if self.time_s.get(at).is_none_or(|next_s| *next_s >= to_s) {
                return self.input[at - 1];
            }
            (until(to_s) - until(from_s)) / (to_s - from_s)
        };
        (0..count).map(mean).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // A step at 3 s that acted 1 s, or 1.5 s, before: the point at 1 s then holds half of it.
    #[test]
    fn the_input_is_moved_by_whole_and_half_samples() {
        let time_s = [0.0, 1.0, 2.0, 3.0, 4.0];
        let input = [0.0, 0.0, 0.0, 2.0, 2.0];
        let signals = Signals {
            time_s: &time_s,
            input: &input,
            output: &input,
            samples_per_point: 1,
            sample_period_s: 1.0,
            breaks: &[],
        };
        assert_eq!(signals.input_earlier(1.0), [0.0, 0.0, 2.0, 2.0, 2.0]);
        assert_eq!(signals.input_earlier(1.5), [0.0, 1.0, 2.0, 2.0, 2.0]);
        assert_eq!(signals.input_earlier(-1.0), [0.0, 0.0, 0.0, 0.0, 2.0]);
        assert_eq!(signals.input_earlier(100.0), [2.0; 5]);
    }
}
