//! Calibration of the misfit score: what is usual for the family's cycles with a given network.

use libm::{log, sqrt};

use super::OUTPUTS;
use crate::pack::{Pack, VALUES};

/// Numbers of a calibration in a pack.
const NUMBERS: usize = 8;

/// Calibration that belongs to a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Factors with which the values were multiplied in training.
    pub scale: [f64; VALUES],
    /// Factors for the standard deviations of the network, so that they contain the truth as often as they
    /// claim.
    pub temperature: [f64; VALUES],
    /// Lowest and highest values of the family.
    pub range: [[f64; VALUES]; 2],
    /// Standard deviation of a harmonic for cycles of the family without noise, over the amplitude.
    pub floor: f64,
    /// Jump between the end of a cycle and its start without noise, over the amplitude.
    pub jump: f64,
    /// Increase of that jump with the noise: times the noise of a sample over the amplitude.
    pub jump_of_noise: f64,
    /// Usual width of the posterior: `w_0`, `w_1`, `w_2`.
    pub width: [f64; 3],
    /// Standard deviation of the width about the usual one.
    pub width_sigma: f64,
    /// Largest sum that belongs to the family.
    pub limit: f64,
    /// Largest noise of a sample over the amplitude for which the network was trained.
    pub most_noise: f64,
}

impl Calibration {
    /// All zeros: memory before the first use.
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

    /// Calibration without a network: no width is too large, no noise too strong, and the limit is the value
    /// that chi-squared with 30 degrees of freedom exceeds in 2 % of cases.
    ///
    /// Jumps: on 600 cycles of multirotors with trim the true processes leave 0.3 % of the amplitude with noise
    /// up to 0.5 %, and 0.5 % with noise of 2 to 3 %. The values are twice that, because relays without trim
    /// leave more. The floor is what cycles with trim leave without noise.
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

    /// The calibration of a pack; `None` if its length is different.
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

    /// Numbers of a pack besides scaling and limit, in the order of the pack.
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

    /// Width of the posterior that these outputs describe.
    #[must_use]
    pub fn width_of(outputs: &[f32; OUTPUTS]) -> f64 {
        let sum: f32 = outputs[VALUES..2 * VALUES].iter().sum();
        -f64::from(sum) / VALUES as f64
    }

    /// Regressors of the usual width, from noise over amplitude and samples in a period.
    #[must_use]
    pub fn width_terms(noise: f64, samples: f64) -> [f64; 3] {
        [1.0, log(noise / sqrt(samples) + QUIET), log(samples)]
    }

    /// Excess of the width over the usual one, in standard deviations.
    pub(super) fn excess(&self, outputs: &[f32; OUTPUTS], noise: f64, samples: f64) -> f64 {
        let terms = Self::width_terms(noise, samples);
        let usual: f64 = terms.iter().zip(self.width).map(|(term, w)| w * term).sum();
        (Self::width_of(outputs) - usual).max(0.0) / self.width_sigma
    }
}

/// Noise of a cycle's mean over the amplitude below which the error of the network dominates.
const QUIET: f64 = 1e-4;
