//! Where a network's cycles of the family end: what the score is measured in.

use libm::{log, sqrt};

use super::OUTPUTS;
use crate::pack::{Pack, VALUES};

/// Numbers that a pack keeps.
const NUMBERS: usize = 8;

/// What belongs to a network, and where its cycles of the family end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// What the values were multiplied by to train the network.
    pub scale: [f64; VALUES],
    /// What the network's standard deviations are multiplied by to hold the truth as often as they say.
    pub temperature: [f64; VALUES],
    /// Lowest and highest values of the family.
    pub range: [[f64; VALUES]; 2],
    /// Standard deviation of a harmonic of the family's cycles without noise, over the amplitude.
    pub floor: f64,
    /// Jump between the end of a cycle and its start, over the amplitude: without noise.
    pub jump: f64,
    /// What noise adds to it, times the noise of a sample over the amplitude.
    pub jump_of_noise: f64,
    /// Width of the posterior of a cycle of the family: `w_0`, `w_1`, `w_2`.
    pub width: [f64; 3],
    /// Standard deviation of the width about that.
    pub width_sigma: f64,
    /// Largest sum that is of the family.
    pub limit: f64,
    /// Largest noise of a sample, over the amplitude, that the network knows.
    pub most_noise: f64,
}

impl Calibration {
    /// Room for one, all zeros.
    pub(super) const ROOM: Self = Self {
        scale: [0.0; VALUES],
        temperature: [0.0; VALUES],
        range: [[0.0; VALUES]; 2],
        floor: 0.0,
        jump: 0.0,
        jump_of_noise: 0.0,
        width: [0.0; 3],
        width_sigma: 0.0,
        limit: 0.0,
        most_noise: 0.0,
    };

    /// Of no network yet: no width is too wide and no noise too much, and any statistic is of the family that chi-squared
    /// of 30 degrees of freedom exceeds in 2 % of cases.
    ///
    /// Jumps: twice the 0.3 % of the amplitude with noise of 0.5 % and less, 0.5 % with 2..3 %, that the true
    /// processes leave of 600 trimmed cycles of multirotors, for those of untrimmed relays leave more; the
    /// floor is what the trimmed ones leave without noise.
    pub const UNTRAINED: Self = Self {
        scale: [1.0, 8.0, 8.0, 1.0],
        temperature: [1.0; VALUES],
        range: [[f64::NEG_INFINITY; VALUES], [f64::INFINITY; VALUES]],
        floor: 3e-4,
        jump: 8e-3,
        jump_of_noise: 0.26,
        width: [0.0; 3],
        width_sigma: f64::INFINITY,
        limit: 47.96,
        most_noise: f64::INFINITY,
    };

    /// That of a pack; `None` where it has other numbers than these.
    #[must_use]
    pub fn of_pack(pack: &Pack<'_>) -> Option<Self> {
        let numbers = pack.calibration();
        if numbers.len() != NUMBERS {
            return None;
        }
        let [
            floor,
            jump,
            jump_of_noise,
            w0,
            w1,
            w2,
            width_sigma,
            most_noise,
        ] = numbers.first::<NUMBERS>()?.map(f64::from);
        let scaling = pack.output_scaling();
        Some(Self {
            scale: scaling.scales.map(f64::from),
            temperature: scaling.temperatures.map(f64::from),
            range: [scaling.lowest, scaling.highest].map(|values| values.map(f64::from)),
            floor,
            jump,
            jump_of_noise,
            width: [w0, w1, w2],
            width_sigma,
            limit: f64::from(pack.unknown_threshold()),
            most_noise,
        })
    }

    /// What a pack keeps beside scaling and limit, in the order that it does.
    #[must_use]
    pub fn numbers(&self) -> [f64; NUMBERS] {
        let [w0, w1, w2] = self.width;
        [
            self.floor,
            self.jump,
            self.jump_of_noise,
            w0,
            w1,
            w2,
            self.width_sigma,
            self.most_noise,
        ]
    }

    /// The width of a posterior that these outputs tell.
    #[must_use]
    pub fn width_of(outputs: &[f32; OUTPUTS]) -> f64 {
        let sum: f32 = outputs[VALUES..2 * VALUES].iter().sum();
        -f64::from(sum) / VALUES as f64
    }

    /// What the usual width is a combination of: noise over amplitude, samples in a period.
    #[must_use]
    pub fn width_terms(noise: f64, samples: f64) -> [f64; 3] {
        [1.0, log(noise / sqrt(samples) + QUIET), log(samples)]
    }

    /// How much wider than usual, in standard deviations.
    pub(super) fn excess(&self, outputs: &[f32; OUTPUTS], noise: f64, samples: f64) -> f64 {
        let terms = Self::width_terms(noise, samples);
        let usual: f64 = terms.iter().zip(self.width).map(|(term, w)| w * term).sum();
        (Self::width_of(outputs) - usual).max(0.0) / self.width_sigma
    }
}

/// Noise of a cycle's mean, over the amplitude, below which a network's own error is the larger.
const QUIET: f64 = 1e-4;
