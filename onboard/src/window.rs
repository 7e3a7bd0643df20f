//! The window that is fitted: outputs averaged into bins, and the edges of the input.
//!
//! Fixed size whatever its length: when the bins are full, neighbours are added in pairs and each
//! bin holds twice the samples. A bin keeps the sum of its samples and of their deviations from
//! the even grid, so the model's mean over the very same instants can be compared with it.

/// A time and the value of the input from then on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Edge {
    /// When the input changes (s).
    pub time_s: f64,
    /// What it changes to (input unit).
    pub input: f64,
}

/// The samples at `per_bin` consecutive instants of the even grid, as far as they are there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Samples in the bin.
    pub count: u32,
    /// Sum of the outputs, less the window's first (output unit).
    pub output_sum: f64,
    /// Sum of the samples' times since the window's start (s).
    pub time_sum_s: f64,
}

/// Why a window could not be filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WindowError {
    /// More edges of the input than the window holds.
    TooManyEdges(usize),
}

/// Up to `BINS - 1` bins and `EDGES` edges; `BINS` of at least 2.
#[derive(Clone, Debug)]
pub struct Window<const BINS: usize, const EDGES: usize> {
    sample_s: f64,
    start_s: f64,
    first_output: Option<f64>,
    group: u32,
    per_bin: u32,
    used: usize,
    bins: [Bin; BINS],
    edges: [Edge; EDGES],
    edge_count: usize,
    noise: NoiseMeter,
}

impl<const BINS: usize, const EDGES: usize> Window<BINS, EDGES> {
    /// An empty window of samples every `sample_s`, the first at `start_s`.
    #[must_use]
    pub fn new(start_s: f64, sample_s: f64) -> Self {
        Self::of_groups(start_s, sample_s, 1)
    }

    /// An empty window for outputs that are means of `group` consecutive samples.
    #[must_use]
    pub fn of_groups(start_s: f64, sample_s: f64, group: u32) -> Self {
        Self {
            sample_s,
            start_s,
            first_output: None,
            group,
            per_bin: group,
            used: 0,
            bins: [Bin::default(); BINS],
            edges: [Edge {
                time_s: 0.0,
                input: 0.0,
            }; EDGES],
            edge_count: 0,
            noise: NoiseMeter::default(),
        }
    }

    /// The input from `time_s` on; times must not decrease. The first value is taken to have been
    /// there for ever: give the window's past too, a period of it if there is one.
    ///
    /// # Errors
    /// [`WindowError::TooManyEdges`] when there is no room.
    pub fn push_input(&mut self, time_s: f64, input: f64) -> Result<(), WindowError> {
        if self.edges().last().is_some_and(|edge| edge.input == input) {
            return Ok(());
        }
        if self.edge_count == EDGES {
            return Err(WindowError::TooManyEdges(EDGES));
        }
        self.edges[self.edge_count] = Edge { time_s, input };
        self.edge_count += 1;
        Ok(())
    }

    /// The output at `time_s`, or its mean over the group of samples that begins there; times
    /// before the start are ignored.
    pub fn push_output(&mut self, time_s: f64, output: f64) {
        let first_output = *self.first_output.get_or_insert(output);
        let since_s = time_s - self.start_s;
        let instant = libm::round(since_s / self.sample_s);
        if instant < 0.0 {
            return;
        }
        let mut index = instant as usize / self.per_bin as usize;
        // The last row of the estimator is for what is known beforehand.
        while index >= BINS - 1 {
            self.merge();
            index = instant as usize / self.per_bin as usize;
        }
        let samples = f64::from(self.group);
        let bin = &mut self.bins[index];
        bin.count += self.group;
        bin.output_sum += samples * (output - first_output);
        bin.time_sum_s += samples * (since_s + 0.5 * (samples - 1.0) * self.sample_s);
        self.used = self.used.max(index + 1);
        self.noise.push(output - first_output);
    }

    fn merge(&mut self) {
        for index in 0..BINS.div_ceil(2) {
            let left = self.bins[2 * index];
            let right = self.bins.get(2 * index + 1).copied().unwrap_or_default();
            self.bins[index] = Bin {
                count: left.count + right.count,
                output_sum: left.output_sum + right.output_sum,
                time_sum_s: left.time_sum_s + right.time_sum_s,
            };
        }
        self.bins[BINS.div_ceil(2)..].fill(Bin::default());
        self.used = self.used.div_ceil(2);
        self.per_bin *= 2;
    }

    /// Sample period of the even grid (s).
    #[must_use]
    pub fn sample_s(&self) -> f64 {
        self.sample_s
    }

    /// Time of the first instant (s).
    #[must_use]
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// Instants of the even grid in a bin.
    #[must_use]
    pub fn per_bin(&self) -> u32 {
        self.per_bin
    }

    /// The bins, in order; a bin without samples is in a gap.
    #[must_use]
    pub fn bins(&self) -> &[Bin] {
        &self.bins[..self.used]
    }

    /// The edges of the input, in order.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges[..self.edge_count]
    }

    /// Output that the bins' sums are counted from (output unit).
    #[must_use]
    pub fn first_output(&self) -> f64 {
        self.first_output.unwrap_or(0.0)
    }

    /// Standard deviation of white noise on a sample, from third differences (output unit).
    #[must_use]
    pub fn noise_sigma(&self) -> f64 {
        // The mean of a group has its variance divided by the group's size.
        self.noise.sigma() * libm::sqrt(f64::from(self.group))
    }

    /// Duration of a bin (s).
    #[must_use]
    pub fn bin_s(&self) -> f64 {
        f64::from(self.per_bin) * self.sample_s
    }
}

/// White noise has third differences of twenty times its variance; the output of a process with
/// three integrations under a relay has next to none.
#[derive(Clone, Copy, Debug, Default)]
struct NoiseMeter {
    last: [f64; 3],
    seen: u32,
    sum_of_squares: f64,
}

impl NoiseMeter {
    fn push(&mut self, output: f64) {
        let [a, b, c] = self.last;
        if self.seen >= 3 {
            let third_difference = output - 3.0 * (a - b) - c;
            self.sum_of_squares += third_difference * third_difference;
        }
        self.last = [output, a, b];
        self.seen += 1;
    }

    fn sigma(&self) -> f64 {
        let differences = f64::from(self.seen.saturating_sub(3).max(1));
        libm::sqrt(self.sum_of_squares / (20.0 * differences))
    }
}
