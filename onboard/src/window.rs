//! Window of a fit: outputs averaged into bins, and the edges of the input.
//!
//! ```text
//! bin k:   sum of y(t_i) - y(t_0)   and   sum of t_i - t_start   over the samples of `per_bin` instants
//! edges:   (time, input from then on)
//! ```
//!
//! Times are in seconds, `y` in output units, inputs in input units. The memory is fixed: when all bins are in
//! use, neighbours are added in pairs, and each bin then holds twice as many samples. A bin keeps the sum of the
//! sample times, so that the model is averaged over the same times as the measurement.

/// Change of the input: a time and the input from then on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Edge {
    /// Time of the change (s).
    pub time_s: f64,
    /// Input from then on (input unit).
    pub input: f64,
}

impl Edge {
    const NONE: Self = Self {
        time_s: 0.0,
        input: 0.0,
    };
}

/// Samples at `per_bin` consecutive instants of the even grid; some may be missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Number of samples in the bin.
    pub count: u32,
    /// Sum of the outputs, each minus the window's first output (output unit).
    pub output_sum: f64,
    /// Sum of the sample times, each since the start of the window (s).
    pub time_sum_s: f64,
}

impl Bin {
    const NONE: Self = Self {
        count: 0,
        output_sum: 0.0,
        time_sum_s: 0.0,
    };
}

/// Why a window could not be filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WindowError {
    /// There are more edges of the input than the window holds: its capacity.
    TooManyEdges(usize),
}

/// Rows of the least-squares problem that are reserved for prior knowledge.
pub(crate) const KNOWN_ROWS: usize = 5;

/// Maximum number of instants in a bin; samples beyond the bins' capacity are ignored.
pub(crate) const MOST_PER_BIN: u32 = 1 << 20;

/// Window of up to `BINS - 5` bins and `EDGES` edges. `BINS` must be at least 7.
#[derive(Clone, Debug)]
pub struct Window<const BINS: usize, const EDGES: usize> {
    sample_s: f64,
    start_s: f64,
    first_output: Option<f64>,
    group: u32,
    per_bin: u32,
    /// Instant of the even grid at which the next sample follows without a gap.
    next_instant: u64,
    used: usize,
    bins: [Bin; BINS],
    edges: [Edge; EDGES],
    edge_count: usize,
    noise: NoiseMeter,
}

impl<const BINS: usize, const EDGES: usize> Window<BINS, EDGES> {
    /// Number of bins available for samples.
    const ROOM: usize = BINS - KNOWN_ROWS;

    /// An empty window for samples every `sample_s`, the first at `start_s`.
    #[must_use]
    pub fn new(start_s: f64, sample_s: f64) -> Self {
        Self::of_groups(start_s, sample_s, 1)
    }

    /// An empty window for outputs that are means of `group` consecutive samples.
    #[must_use]
    pub fn of_groups(start_s: f64, sample_s: f64, group: u32) -> Self {
        let mut window = Self::NONE;
        window.set(start_s, sample_s, group);
        window
    }

    /// Memory of a window, all zeros. It accepts no samples until [`Window::begin`].
    pub const NONE: Self = Self {
        sample_s: 0.0,
        start_s: 0.0,
        first_output: None,
        group: 0,
        per_bin: 0,
        next_instant: 0,
        used: 0,
        bins: [Bin::NONE; BINS],
        edges: [Edge::NONE; EDGES],
        edge_count: 0,
        noise: NoiseMeter::NONE,
    };

    /// Empties the window in place; otherwise like [`Window::new`].
    pub fn begin(&mut self, start_s: f64, sample_s: f64) {
        self.bins.fill(Bin::NONE);
        self.set(start_s, sample_s, 1);
    }

    /// Sets everything but the bins, which must be empty.
    fn set(&mut self, start_s: f64, sample_s: f64, group: u32) {
        self.start_s = start_s;
        self.sample_s = sample_s;
        self.first_output = None;
        (self.group, self.per_bin) = (group, group);
        self.next_instant = 0;
        self.used = 0;
        self.edge_count = 0;
        self.noise = NoiseMeter::NONE;
    }

    /// Sets the input from `time_s` on; times must not decrease. The first value is assumed to have been there
    /// since ever, so add the past of the window too: one period or more.
    ///
    /// # Errors
    /// [`WindowError::TooManyEdges`] if there is no space for another edge.
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

    /// Adds the output at `time_s`, or its mean over the group of samples that begins there. Times before the
    /// start are ignored.
    pub fn push_output(&mut self, time_s: f64, output: f64) {
        let first_output = *self.first_output.get_or_insert(output);
        let since_s = time_s - self.start_s;
        let instant = libm::round(since_s / self.sample_s);
        let room = Self::ROOM as f64 * f64::from(MOST_PER_BIN);
        if !(instant >= 0.0 && instant < room) {
            return;
        }
        let instant = instant as u64;
        while instant / u64::from(self.per_bin) >= Self::ROOM as u64 {
            self.merge();
        }
        let index = (instant / u64::from(self.per_bin)) as usize;
        if instant != self.next_instant {
            self.noise.restart();
        }
        self.next_instant = instant + u64::from(self.group);
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

    /// Number of instants of the even grid per bin.
    #[must_use]
    pub fn per_bin(&self) -> u32 {
        self.per_bin
    }

    /// The bins in order. A bin without samples lies in a gap.
    #[must_use]
    pub fn bins(&self) -> &[Bin] {
        &self.bins[..self.used]
    }

    /// The edges of the input, in order.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges[..self.edge_count]
    }

    /// Output that is subtracted from all outputs in the bins (output unit).
    #[must_use]
    pub fn first_output(&self) -> f64 {
        self.first_output.unwrap_or(0.0)
    }

    /// Standard deviation of the white noise of one sample, from third differences (output unit).
    #[must_use]
    pub fn noise_sigma(&self) -> f64 {
        // The variance of a mean is that of a sample divided by the size of the group.
        self.noise.sigma() * libm::sqrt(f64::from(self.group))
    }

    /// Duration of a bin (s).
    #[must_use]
    pub fn bin_s(&self) -> f64 {
        f64::from(self.per_bin) * self.sample_s
    }
}

/// Noise meter: third differences of white noise have twenty times its variance. Those of the output of three
/// integrations under a relay are negligible.
#[derive(Clone, Copy, Debug, Default)]
struct NoiseMeter {
    last: [f64; 3],
    /// Number of samples since the last gap, up to three.
    seen: u32,
    differences: u32,
    sum_of_squares: f64,
}

impl NoiseMeter {
    const NONE: Self = Self {
        last: [0.0; 3],
        seen: 0,
        differences: 0,
        sum_of_squares: 0.0,
    };

    fn push(&mut self, output: f64) {
        let [a, b, c] = self.last;
        if self.seen == 3 {
            let third_difference = output - 3.0 * (a - b) - c;
            self.sum_of_squares += third_difference * third_difference;
            self.differences += 1;
        } else {
            self.seen += 1;
        }
        self.last = [output, a, b];
    }

    /// Starts anew after a gap: no difference spans it.
    fn restart(&mut self) {
        self.seen = 0;
    }

    fn sigma(&self) -> f64 {
        let differences = f64::from(self.differences.max(1));
        libm::sqrt(self.sum_of_squares / (20.0 * differences))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outputs 0, 1, 4, 9, ... at samples of 1/1024 s from 2 s on: all sums are exact in binary.
    fn squares<const BINS: usize>(samples: usize) -> Window<BINS, 4> {
        let mut window = Window::new(2.0, 1.0 / 1024.0);
        for k in 0..samples {
            window.push_output(2.0 + k as f64 / 1024.0, (k * k) as f64);
        }
        window
    }

    // The sums of every bin, after any number of merges: an odd and an even number of bins, and numbers of
    // samples that leave the last bin full, started or with a single sample.
    #[test]
    fn merging_keeps_every_sum() {
        fn check<const BINS: usize>(samples: usize) {
            let window = squares::<BINS>(samples);
            let per_bin = window.per_bin() as usize;
            // The least power of two that leaves the reserved rows free.
            let needed = samples.div_ceil(BINS - KNOWN_ROWS).next_power_of_two();
            assert_eq!(per_bin, needed);
            assert_eq!(window.bins().len(), samples.div_ceil(per_bin));
            for (index, bin) in window.bins().iter().enumerate() {
                let members = index * per_bin..samples.min((index + 1) * per_bin);
                assert_eq!(bin.count as usize, members.len());
                assert_eq!(
                    bin.output_sum,
                    members.clone().map(|k| (k * k) as f64).sum()
                );
                assert_eq!(bin.time_sum_s, members.map(|k| k as f64 / 1024.0).sum());
            }
        }
        for samples in [1, 7, 8, 9, 100, 127, 128, 129, 1000] {
            check::<12>(samples);
            check::<13>(samples);
            check::<7>(samples);
        }
    }

    // Means over groups of four samples give the same bins as the samples.
    #[test]
    fn groups_are_their_samples() {
        let samples = 256;
        let mut grouped = Window::<23, 4>::of_groups(2.0, 1.0 / 1024.0, 4);
        for first in (0..samples).step_by(4) {
            let mean = (first..first + 4).map(|k| (k * k) as f64).sum::<f64>() / 4.0;
            grouped.push_output(2.0 + first as f64 / 1024.0, mean);
        }
        let single = squares::<23>(samples);
        assert_eq!(grouped.per_bin(), 16);
        assert_eq!(grouped.per_bin(), single.per_bin());
        assert_eq!(grouped.bins().len(), single.bins().len());
        for (grouped_bin, bin) in grouped.bins().iter().zip(single.bins()) {
            let output_sum = |window: &Window<23, 4>, bin: &Bin| {
                bin.output_sum + f64::from(bin.count) * window.first_output()
            };
            assert_eq!(grouped_bin.count, bin.count);
            assert_eq!(output_sum(&grouped, grouped_bin), output_sum(&single, bin));
            assert_eq!(grouped_bin.time_sum_s, bin.time_sum_s);
        }
    }

    #[test]
    fn a_gap_leaves_its_bins_empty() {
        let mut window = Window::<20, 4>::new(0.0, 1.0);
        for k in (0..10).chain(40..60) {
            window.push_output(f64::from(k), 1.0);
        }
        // 60 instants in 15 bins of 4: bins 0 and 1 full, bin 2 half full, bins 3 to 9 empty.
        let counts = [4, 4, 2, 0, 0, 0, 0, 0, 0, 0, 4, 4, 4, 4, 4];
        assert_eq!(window.per_bin(), 4);
        assert!(window.bins().iter().map(|bin| bin.count).eq(counts));
    }

    #[test]
    fn outputs_before_the_start_are_ignored() {
        let mut window = Window::<19, 4>::new(10.0, 0.1);
        window.push_output(9.9, 7.0);
        assert!(window.bins().is_empty());
        window.push_output(10.0, 8.0);
        assert_eq!(window.bins().len(), 1);
    }

    #[test]
    fn only_changes_of_the_input_take_room() {
        let mut window = Window::<19, 3>::new(0.0, 0.1);
        for (time_s, input) in [(0.0, 1.0), (0.1, 1.0), (0.2, -1.0), (0.3, -1.0), (0.4, 1.0)] {
            assert_eq!(window.push_input(time_s, input), Ok(()));
        }
        assert_eq!(window.push_input(0.5, 1.0), Ok(()));
        assert_eq!(
            window.push_input(0.6, -1.0),
            Err(WindowError::TooManyEdges(3))
        );
        let times_s = [0.0, 0.2, 0.4];
        assert!(window.edges().iter().map(|edge| edge.time_s).eq(times_s));
    }

    /// Uniform in -1..1, variance 1/3 (Knuth's MMIX generator, upper bits).
    fn uniform(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    // Third differences of white noise have the autocovariances 20, -15, 6, -1. The mean of n squares has a
    // relative variance of (2 (400 + 2 (225 + 36 + 1)) / 400 + kurtosis) / n, where the excess kurtosis of
    // uniform noise is -1.2 and that of a mean of five -0.24. Sigma has half that relative error: 1.05 /
    // sqrt(n), three of which are 1 % here.
    #[test]
    fn white_noise_is_measured() {
        let expected = libm::sqrt(1.0 / 3.0);
        for group in [1, 5] {
            let mut window = Window::<67, 4>::of_groups(0.0, 1e-3, group);
            let mut state = 1;
            for k in 0..100_000_u32 {
                let mean = (0..group).map(|_| uniform(&mut state)).sum::<f64>() / f64::from(group);
                window.push_output(f64::from(k * group) * 1e-3, mean);
            }
            let sigma = window.noise_sigma();
            assert!(
                (sigma / expected - 1.0).abs() < 0.01,
                "{sigma} against {expected}"
            );
        }
    }

    // Third differences of A sin(w t) are A (w dt)^3: 3.9e-6 A at 400 samples a period, divided by sqrt(20) and
    // as root mean square by sqrt(2): 6.13e-7 A.
    #[test]
    fn a_smooth_oscillation_has_next_to_no_noise() {
        let mut window = Window::<67, 4>::new(0.0, 1e-3);
        for k in 0..4000 {
            let angle = core::f64::consts::TAU * f64::from(k) / 400.0;
            window.push_output(f64::from(k) * 1e-3, libm::sin(angle));
        }
        assert!(
            (window.noise_sigma() - 6.13e-7).abs() < 1e-9,
            "{}",
            window.noise_sigma()
        );
    }

    // 1e15 instants in 15 bins would need 2^46 per bin, more than the counter holds.
    #[test]
    fn a_time_far_ahead_is_survived() {
        let mut window = Window::<19, 4>::new(0.0, 1e-3);
        window.push_output(0.0, 1.0);
        window.push_output(1e12, 1.0);
        assert!(window.per_bin() > 0);
    }

    // A smooth oscillation with every tenth sample missing shows no noise.
    #[test]
    fn lost_samples_are_no_noise() {
        let mut window = Window::<67, 4>::new(0.0, 1e-3);
        for k in (0..4000).filter(|k| k % 10 != 0) {
            let angle = core::f64::consts::TAU * f64::from(k) / 400.0;
            window.push_output(f64::from(k) * 1e-3, libm::sin(angle));
        }
        assert!(window.noise_sigma() < 1e-5, "{}", window.noise_sigma());
    }
}
