//! Simulated axis: a process on the grid of the ticks, with a bias, noise and a ground.

use onecycle_onboard::Soiptd;
use onecycle_onboard::control::Measurement;
use onecycle_onboard::transition::{State, Transition};
use onecycle_onboard::tuner::Tuner;

/// Noise with the same bits for the same seed: sums of twelve uniform numbers.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// Uniform between 0 and 1: a multiplicative congruential generator (L'Ecuyer 1999, modulus 2^64).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Unit variance.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// The simulated axis.
pub(crate) struct Axis {
    pub(crate) process: Soiptd,
    pub(crate) sample_s: f64,
    pub(crate) bias: f64,
    pub(crate) noise_sigma: f64,
    /// Deviation of a step that the error of the value takes per tick: a random walk.
    pub(crate) walk_sigma: f64,
    walk: f64,
    /// Deviation of a step that the error of the rate takes per tick; the value integrates the rate with its error.
    pub(crate) rate_walk_sigma: f64,
    rate_walk: f64,
    /// Whether the output cannot fall below zero.
    pub(crate) has_ground: bool,
    pub(crate) tick: usize,
    transition: Transition,
    state: State,
    line: Vec<f64>,
    noise: Noise,
}

impl Axis {
    /// At rest at zero; the dead time is rounded to whole ticks.
    pub(crate) fn new(process: Soiptd, sample_s: f64, seed: u64) -> Self {
        let ticks = (process.tau_s() / sample_s).round() as usize;
        Self {
            process,
            sample_s,
            bias: 0.0,
            noise_sigma: 0.0,
            walk_sigma: 0.0,
            walk: 0.0,
            rate_walk_sigma: 0.0,
            rate_walk: 0.0,
            has_ground: false,
            tick: 0,
            transition: Transition::over(&process, sample_s),
            state: State::default(),
            line: vec![0.0; ticks.max(1)],
            noise: Noise(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1),
        }
    }

    /// Continues as another process from the present state.
    pub(crate) fn becomes(&mut self, process: Soiptd) {
        let ratio = self.process.k_over_t_body() / process.k_over_t_body();
        self.state.y *= ratio;
        self.state.v *= ratio;
        self.transition = Transition::over(&process, self.sample_s);
        self.process = process;
    }

    pub(crate) fn time_s(&self) -> f64 {
        self.tick as f64 * self.sample_s
    }

    pub(crate) fn value(&self) -> f64 {
        self.process.k_over_t_body() * self.state.y
    }

    pub(crate) fn rate(&self) -> f64 {
        self.process.k_over_t_body() * self.state.v
    }

    pub(crate) fn measure(&mut self) -> Measurement {
        let mut noise = self.noise_sigma * self.noise.normal();
        if self.walk_sigma > 0.0 {
            self.walk += self.walk_sigma * self.noise.normal();
            noise += self.walk;
        }
        if self.rate_walk_sigma > 0.0 {
            let half_s = 0.5 * self.sample_s;
            self.walk += half_s * self.rate_walk;
            self.rate_walk += self.rate_walk_sigma * self.noise.normal();
            self.walk += half_s * self.rate_walk;
            noise += self.walk;
        }
        let rate = self.rate() + self.rate_walk;
        Measurement::of((self.value() + noise) as f32).with_rate(rate as f32)
    }

    pub(crate) fn push(&mut self, input: f32) {
        let length = self.line.len();
        let slot = &mut self.line[self.tick % length];
        let late = std::mem::replace(slot, f64::from(input));
        self.state = self.transition.apply(&self.state, late + self.bias);
        if self.has_ground && self.state.y <= 0.0 {
            self.state.y = 0.0;
            self.state.v = self.state.v.max(0.0);
        }
        self.tick += 1;
    }

    /// Runs ticks under a tuner until `until` returns true; returns the number of ticks.
    pub(crate) fn fly(
        &mut self,
        tuner: &mut Tuner<'_>,
        reference: f32,
        seconds: f64,
        mut until: impl FnMut(&Tuner<'_>, &Self) -> bool,
    ) -> usize {
        let ticks = (seconds / self.sample_s).round() as usize;
        for tick in 0..ticks {
            let output = tuner.step(self.time_s(), &self.measure(), reference);
            assert!(output.is_finite());
            self.push(output);
            if until(tuner, self) {
                return tick;
            }
        }
        ticks
    }
}
