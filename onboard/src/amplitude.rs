//! Whether two cycles of the relay at different amplitudes show the same gain.
//!
//! A static nonlinearity of the actuator (dead zone, saturation, backlash) turns the two levels of a relay into two other
//! levels, so at one amplitude it acts as another gain and a bias, and no fit can tell. At another amplitude that gain is
//! another one.

use libm::{log, sqrt};

use crate::judgement::{ALIKE_GAINS, HALF_90_PERCENT};

/// Difference of the logarithms of the gains that does not matter to a controller, whatever the noise.
pub const ALIKE: f64 = ALIKE_GAINS;

/// Whether a ratio of two gains is 1 within [`ALIKE`] and the 90 % interval of both, given as relative standard deviations.
#[must_use]
pub fn is_alike(ratio: f64, deviations: [f64; 2]) -> bool {
    let [a, b] = deviations;
    // A ratio of zero or less, or NaN, is not alike.
    ratio > 0.0 && log(ratio).abs() < ALIKE + HALF_90_PERCENT * sqrt(a * a + b * b)
}

#[cfg(test)]
mod tests {
    use super::*;

    // 0.03 and 1.645 times 0.05 (of 0.03 and 0.04): the limit is exp(0.11225).
    #[test]
    fn the_limit_grows_with_the_noise() {
        assert!(is_alike(1.029, [0.0, 0.0]) && !is_alike(1.031, [0.0, 0.0]));
        assert!(is_alike(1.0 / 1.118, [0.03, 0.04]) && !is_alike(1.0 / 1.119, [0.03, 0.04]));
        for ratio in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(!is_alike(ratio, [0.0, 0.0]));
        }
    }
}
