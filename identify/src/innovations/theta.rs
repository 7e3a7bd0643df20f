//! Unknowns of a fit that enter the model nonlinearly: lags, pole, second-order stage, dead time, noise.
//!
//! | unknown | coordinate | why |
//! |---------|------------|-----|
//! | actuator lag `T` (s) | `ln T` | positive |
//! | pole `a = 1/T_body` (1/s) | `a` | no damping, `a = 0`, is an ordinary point; negative for sure of an unstable process |
//! | `c1` (1/s), `c0` (1/s^2) of the second-order stage | as they are | `c0 = 0` is an integrator with a lag |
//! | dead time `tau` (s) | `tau` | no dead time is an ordinary point |
//! | noise `w1`, `w0`, `wy` (rad/s) | `ln w` | positive; minus infinity without this noise |
//!
//! The frequencies of the noises are those below which the disturbance outweighs the white noise of a sample:
//!
//! | noise | intensity over the variance of the white noise, with `n` states behind the actuator lags |
//! |-------|-----------|
//! | `w1`: random walk of the disturbance, which enters behind the actuator lags | `dt w1^(2 n + 2)` |
//! | `w0`: white disturbance at the same place | `dt w0^(2 n)` |
//! | `wy`: random walk of the measured output, as of an angle integrated from a gyro | `dt wy^2` |

use onecycle_design::{Linear, Stages, Structure};

use super::record::Blocks;

/// Most unknowns of a structure.
pub(super) const MOST: usize = 8;

/// Values of the unknowns in their coordinates. Unused entries are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Theta {
    pub(super) structure: Structure,
    /// Whether the pole is that of an unstable process, which grows by more than [`GROWTH`] powers of e over the record.
    pub(super) grows: bool,
    pub(super) values: [f64; MOST],
}

/// A noise beside the white noise of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoiseKind {
    /// `w1`: random walk of the disturbance behind the actuator lags, as wind.
    RandomWalk,
    /// `w0`: white disturbance behind the actuator lags, as gusts and the errors of an accelerometer.
    WhiteForce,
    /// `wy`: random walk of the measured output, as an angle integrated from a gyro.
    OutputWalk,
}

impl NoiseKind {
    /// Every kind.
    pub(super) const ALL: [Self; 3] = [Self::RandomWalk, Self::WhiteForce, Self::OutputWalk];
}

/// Where the unknowns of a structure are in [`Theta::values`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) stages: Stages,
}

impl Layout {
    pub(super) fn pole(self) -> Option<usize> {
        (self.stages.poles > 0).then_some(self.stages.lags)
    }

    /// Index of `c1`; `c0` follows.
    pub(super) fn pair(self) -> Option<usize> {
        (self.stages.pairs > 0).then_some(self.stages.lags + self.stages.poles)
    }

    pub(super) fn tau(self) -> usize {
        self.stages.lags + self.stages.poles + 2 * self.stages.pairs
    }

    pub(super) fn noise(self, kind: NoiseKind) -> usize {
        self.tau() + 1 + kind as usize
    }

    pub(super) fn len(self) -> usize {
        self.tau() + 4
    }
}

impl Theta {
    /// Without dead time and noise.
    pub(super) fn new(structure: Structure) -> Self {
        let theta = Self {
            structure,
            grows: false,
            values: [0.0; MOST],
        };
        theta.without_noises()
    }

    /// The process with its unstable pole on the other side of the imaginary axis: as strong at every frequency.
    pub(super) fn mirrored(mut self) -> Self {
        if let Some(pole) = self.layout().pole() {
            self.values[pole] = self.values[pole].abs();
        }
        self.grows = false;
        self
    }

    pub(super) fn layout(&self) -> Layout {
        Layout {
            stages: self.structure.stages(),
        }
    }

    /// Dead time (s).
    pub(super) fn tau_s(&self) -> f64 {
        self.values[self.layout().tau()]
    }

    /// Dead time and actuator lag (s); the lag is 0 without one.
    pub(super) fn delay_and_lag_s(&self) -> (f64, f64) {
        let lags = self.layout().stages.lags;
        let lag_s = if lags > 0 { self.values[0].exp() } else { 0.0 };
        (self.tau_s(), lag_s)
    }

    /// Frequency of a noise (rad/s), zero without it.
    pub(super) fn noise(&self, kind: NoiseKind) -> f64 {
        self.values[self.layout().noise(kind)].exp()
    }

    /// Sets the frequency of a noise (rad/s), zero for none.
    pub(super) fn set_noise(&mut self, kind: NoiseKind, rad_per_s: f64) {
        self.values[self.layout().noise(kind)] = rad_per_s.ln();
    }

    /// With a noise of this frequency (rad/s).
    pub(super) fn with_noise(mut self, kind: NoiseKind, rad_per_s: f64) -> Self {
        self.set_noise(kind, rad_per_s);
        self
    }

    /// With the noises of another fit.
    pub(super) fn with_noises_of(mut self, other: &Self) -> Self {
        for kind in NoiseKind::ALL {
            self.set_noise(kind, other.noise(kind));
        }
        self
    }

    /// Without any noise.
    pub(super) fn without_noises(mut self) -> Self {
        for kind in NoiseKind::ALL {
            self.set_noise(kind, 0.0);
        }
        self
    }

    /// Noises that the fit has.
    pub(super) fn noises(&self) -> impl Iterator<Item = NoiseKind> + use<> {
        let theta = *self;
        (NoiseKind::ALL.into_iter()).filter(move |kind| theta.noise(*kind) > 0.0)
    }

    /// Indices of the unknowns to fit: all but the noises that are off.
    pub(super) fn free(&self) -> Vec<usize> {
        let is_on = |index: &usize| self.values[*index] > f64::NEG_INFINITY;
        (0..self.layout().len()).filter(is_on).collect()
    }

    /// The process, with this gain in front of its stages.
    pub(super) fn process(&self, gain: f64) -> Linear {
        let layout = self.layout();
        let mut lags_s = [1.0; 2];
        for lag in 0..layout.stages.lags {
            lags_s[lag] = self.values[lag].exp();
        }
        let mut process = Linear::new(self.structure)
            .with_gain(gain)
            .with_lags_s(lags_s)
            .with_tau_s(self.tau_s());
        if let Some(pole) = layout.pole() {
            process = process.with_pole_per_s(self.values[pole]);
        }
        if let Some(pair) = layout.pair() {
            process = process.with_pair(self.values[pair], self.values[pair + 1]);
        }
        process
    }

    /// Time constants (s) of the second-order stage if it is two real lags, the longer first.
    pub(super) fn real_lags_s(&self) -> Option<(f64, f64)> {
        let pair = self.layout().pair()?;
        let (c1, c0) = (self.values[pair], self.values[pair + 1]);
        let root = (0.25 * c1 * c1 - c0).sqrt();
        let slow = c0 / (0.5 * c1 + root);
        (slow > 0.0).then(|| (1.0 / slow, 1.0 / (0.5 * c1 + root)))
    }

    /// Whether an unknown is a lag shorter than `sample_s`.
    pub(super) fn is_lag_below(&self, index: usize, sample_s: f64) -> bool {
        index < self.layout().stages.lags && self.values[index].exp() < sample_s
    }

    /// Shortest time constant of the process (s): the least of its lags and of the inverses of its poles. Infinite without
    /// any.
    pub(super) fn shortest_lag_s(&self) -> f64 {
        self.lags_s().fold(f64::INFINITY, f64::min)
    }

    /// Time (s) that the lags and the dead time last.
    pub(super) fn span_s(&self) -> f64 {
        self.lags_s().sum::<f64>() + self.tau_s().max(0.0)
    }

    /// Lags and inverses of the poles (s), without integrators.
    pub(super) fn lags_s(&self) -> impl Iterator<Item = f64> {
        let layout = self.layout();
        let lags = (0..layout.stages.lags).map(|lag| self.values[lag].exp());
        let pole = layout.pole().map(|pole| 1.0 / self.values[pole].abs());
        let pair = (layout.pair()).map(|pair| 1.0 / self.values[pair + 1].abs().sqrt());
        lags.chain(pole).chain(pair)
    }
}

/// Shortest lag and shortest time constant of a body of which a record has a fit, as parts of a sample: one over these.
pub(super) const LAGS_IN_A_SAMPLE: f64 = 20.0;
pub(super) const BODIES_IN_A_SAMPLE: f64 = 2.0;

/// Powers of e by which a process that is not taken for unstable may grow over the record: no damping is then no bound.
pub(super) const GROWTH: f64 = 3.0;

/// Box that holds the unknowns, and steps for differences.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: [f64; MOST],
    pub(super) high: [f64; MOST],
    /// Steps of forward differences.
    pub(super) step: [f64; MOST],
}

impl Bounds {
    /// Bounds for a record and a process like `theta`: lags from a twentieth of a sample to its length, a pole that may be a
    /// little unstable (so that no damping is not on the boundary) or is more than that, a dead time that may be a little
    /// negative, noise frequencies from 0.03 over its length to ten over the sample period.
    pub(super) fn new(theta: &Theta, blocks: &Blocks<'_>, longest_tau_s: f64) -> Self {
        let (dt, length) = (blocks.record.dt_s, blocks.length_s());
        let block = blocks.block_s();
        let layout = theta.layout();
        let mut bounds = Self {
            low: [f64::NEG_INFINITY; MOST],
            high: [f64::INFINITY; MOST],
            step: [1e-5; MOST],
        };
        let mut set = |index: usize, low: f64, high: f64, step: f64| {
            bounds.low[index] = low;
            bounds.high[index] = high;
            bounds.step[index] = step;
        };
        for lag in 0..layout.stages.lags {
            set(lag, (dt / LAGS_IN_A_SAMPLE).ln(), length.ln(), 1e-5);
        }
        if let Some(pole) = layout.pole() {
            let (least, fastest) = (-GROWTH / length, BODIES_IN_A_SAMPLE / dt);
            let (low, high) = match theta.grows {
                true => (-fastest, least),
                false => (least, fastest),
            };
            set(pole, low, high, 1e-4 / length);
        }
        if let Some(pair) = layout.pair() {
            set(pair, -GROWTH / length, 4.0 / dt, 1e-4 / length);
            let (low, high) = (-9.0 / (length * length), 4.0 / (dt * dt));
            set(pair + 1, low, high, 1e-4 / (length * length));
        }
        set(layout.tau(), -2.0 * dt, longest_tau_s, 1e-4 * block);
        for kind in NoiseKind::ALL {
            let (low, high) = ((0.03 / length).ln(), (10.0 / dt).ln());
            set(layout.noise(kind), low, high, 1e-5);
        }
        bounds
    }

    /// The nearest values inside the box. A noise that is off stays off.
    pub(super) fn clamp(&self, theta: &Theta) -> Theta {
        let mut inside = *theta;
        for index in theta.free() {
            inside.values[index] = theta.values[index].clamp(self.low[index], self.high[index]);
        }
        inside
    }

    /// Whether the second-order stage is as fast as the search allows.
    pub(super) fn has_fastest_pair(&self, theta: &Theta) -> bool {
        let is_highest = |index: usize| theta.values[index] >= self.high[index] - 1e-9;
        let pair = theta.layout().pair();
        pair.is_some_and(|pair| is_highest(pair) || is_highest(pair + 1))
    }

    /// Whether an unknown is on the boundary.
    pub(super) fn is_at_edge(&self, theta: &Theta, index: usize) -> bool {
        let value = theta.values[index];
        value <= self.low[index] + 1e-9 || value >= self.high[index] - 1e-9
    }
}
