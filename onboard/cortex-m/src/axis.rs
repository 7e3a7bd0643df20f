//! Simulated axis: the altitude of a quadrotor with a noisy sensor and a small error of the assumed hover
//! thrust.
//!
//! ```text
//! T_prop f' = u(t - tau) - b - f        v' = (K/T_body) f - v/T_body        y' = v
//! ```
//!
//! with the bias `b` (part of hover), position `y` (m) and climb `v` (m/s). Process, integration and noise are
//! those of `c/examples/axis.c`, operation for operation, so both find the same numbers.

use onecycle_onboard::control::Measurement;

/// Time between ticks (s).
pub const TICK_S: f64 = 0.001;

/// `K/T_body` (1/s^2), `T_prop` (s), `1/T_body` (1/s): the paper's altitude, thrust as a part of hover.
pub const K_OVER_T_BODY: f64 = 9.81;
/// See [`K_OVER_T_BODY`].
pub const T_PROP_S: f64 = 0.0321;
const INV_T_BODY_PER_S: f64 = 0.5922;
/// Dead time (ticks).
const DELAY_TICKS: usize = 24;
/// Error of the assumed hover thrust (part of hover).
const BIAS: f64 = 0.01;
/// Factor of the noise (m): a sum of four uniform numbers has 0.58 of it as standard deviation.
const NOISE: f64 = 0.0001;
/// Euler steps per tick, rate before position: accurate to a part in a thousand.
const PARTS: usize = 10;

/// State of the axis.
#[derive(Clone, Debug)]
pub struct Axis {
    value: f64,
    rate: f64,
    force: f64,
    delayed: [f64; DELAY_TICKS],
    oldest: usize,
    random: u64,
}

impl Default for Axis {
    fn default() -> Self {
        Self {
            value: 0.0,
            rate: 0.0,
            force: 0.0,
            delayed: [0.0; DELAY_TICKS],
            oldest: 0,
            random: 1,
        }
    }
}

impl Axis {
    /// True position (m).
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Measurement: position with noise, rate without.
    pub fn measure(&mut self) -> Measurement {
        let value = self.value + NOISE * self.noise();
        Measurement::of(value as f32).with_rate(self.rate as f32)
    }

    /// Advances by one tick with this input.
    pub fn push(&mut self, input: f64) {
        let slot = &mut self.delayed[self.oldest];
        let late = *slot - BIAS;
        *slot = input;
        self.oldest = (self.oldest + 1) % DELAY_TICKS;
        let step_s = TICK_S / PARTS as f64;
        for _ in 0..PARTS {
            self.force += step_s / T_PROP_S * (late - self.force);
            self.rate += step_s * (K_OVER_T_BODY * self.force - INV_T_BODY_PER_S * self.rate);
            self.value += step_s * self.rate;
        }
    }

    /// Knuth's generator for MMIX; its highest 24 bits make a number between -1/2 and 1/2.
    fn noise(&mut self) -> f64 {
        let mut sum = 0.0;
        for _ in 0..4 {
            self.random = self
                .random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum += (self.random >> 40) as f64 / 16_777_216.0 - 0.5;
        }
        sum
    }
}
