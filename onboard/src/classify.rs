//! Classification of a cycle: from the outputs of the network to the process, its uncertainty, and "unknown".
//!
//! The outputs are a Gaussian over four values of the process: the mean, the logarithms of the diagonal of `L`,
//! then the elements below it row by row, where `precision = L L^T`. Each value is multiplied by its
//! [`scale`](Calibration::scale):
//!
//! ```text
//! ln((p1 + p2) T),   p1 p2 / (p1 + p2)^2,   tau / T,   ln(a / (K/(T_body T_prop) T^3))
//! ```
//!
//! | symbol     | name        | meaning                                                         |
//! |------------|-------------|-----------------------------------------------------------------|
//! | `T`        | `period_s`  | period of the cycle (s)                                         |
//! | `a`        | `amplitude` | of the signature; the gain is that for a relay of amplitude one |
//! | `p1`, `p2` |             | poles `1/T_prop`, `1/T_body` (1/s)                              |
//! | `l_i`      |             | logarithms of the diagonal of `L`                               |
//! | `sigma`    | `noise_sigma` | noise of a sample (output unit)                               |
//! | `N`        | `samples`   | samples in the period                                           |
//! | `w_i`, `w_sigma`, `limit`, `most_noise` | [`Calibration`] | calibration of the score       |
//!
//! A network puts out some process whatever its input is. Two questions decide whether to use it. Does the
//! process explain the cycle? `fit_score` compares the harmonics of the cycle with the response of the process
//! to the same wave, within the posterior and the noise. Is the posterior as narrow as usual? For a cycle unlike
//! those of its training the network gives a wider posterior than for cycles of the family with the same noise
//! and the same number of samples:
//!
//! ```text
//! width = -mean l_i,   usual = w_0 + w_1 ln(sigma / (a sqrt(N)) + 1e-4) + w_2 ln N
//! score = max((statistic + 2 (max(width - usual, 0) / w_sigma)^2) / limit,   sigma / (a most_noise))
//! ```
//!
//! A cycle with a score above one does not belong to the family, or is noisier than any cycle that the network
//! was trained for, such as an oscillation damped by friction.
//!
//! # Slices
//!
//! A [`Classifier`] works in slices, each short enough for a control tick; [`classify`] and [`classify_by`] loop
//! over them. Operations of the longest slices, in double precision unless marked f32:
//!
//! | slice                                          | operations | slices |
//! |------------------------------------------------|------------|--------|
//! | layer of the network, of `n` by `m` (f32)      | `3 n m`    | layers |
//! | posterior                                      | 400        | 1      |
//! | its longest axis                               | 1,400      | 1      |
//! | the candidates                                 | 1,300      | 1      |
//! | eight harmonics of the cycle                   | 1,500      | 2      |
//! | three harmonics of a process                   | 1,800      | 2 x 5  |
//! | equations                                      | 1,900      | 2      |
//! | two to five rows of their least squares        | 1,300      | 2 x 2  |

mod calibration;
mod classifier;

use core::fmt;

use libm::{exp, sqrt};

pub use self::calibration::Calibration;
pub use self::classifier::Classifier;
use crate::fit_score::MOST_POLE_RATIO;
pub use crate::pack::OUTPUTS;
use crate::pack::{Pack, VALUES};
use crate::process::{Soiptd, SoiptdError};
use crate::refine::{Shape, shape_of};
use crate::signature::Signature;

/// Number of candidates of a classification.
pub const CANDIDATES: usize = 5;

/// Classification of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classification {
    /// Values of the process with their covariance.
    pub posterior: CyclePosterior,
    /// Processes along the longest axis of the posterior, most probable first.
    pub candidates: [CandidateProcess; CANDIDATES],
    /// Misfit score of the mean of the posterior (limit 1).
    pub score: f64,
    /// Whether the cycle belongs to the family.
    pub familiarity: Familiarity,
}

impl Classification {
    /// The candidates as shapes for an oscillation with period `period_s` (s), as starts of a fit.
    #[must_use]
    pub fn starts(&self, period_s: f64) -> [Shape; CANDIDATES] {
        self.candidates
            .map(|candidate| shape_of(&candidate.process, period_s))
    }
}

/// Whether a cycle belongs to the pack's family of processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Familiarity {
    /// A process of the family explains the cycle.
    Known,
    /// No process of the family explains the cycle; do not make a controller from it.
    Unknown,
}

impl fmt::Display for Familiarity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Known => "known: a process of this kind explains it",
            Self::Unknown => "unknown: no process of this kind explains it",
        })
    }
}

/// A process and its share of the posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CandidateProcess {
    /// The process; its gain is that for a relay of amplitude one.
    pub process: Soiptd,
    /// Share of the posterior, 0 to 1.
    pub probability: f64,
}

/// Posterior of the process given one cycle: a Gaussian over the values of the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CyclePosterior {
    /// Mean.
    pub mean: [f64; VALUES],
    /// Upper triangular root of the covariance, `covariance = root root^T`.
    pub root: [[f64; VALUES]; VALUES],
}

/// Why outputs give no classification.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ClassifyError {
    /// An output is not finite: index and value.
    Output(usize, f32),
    /// The noise is negative or not finite: its value.
    Noise(f64),
    /// The values are not those of a process.
    Process(SoiptdError),
    /// The calibration of the pack has another length than that of this score.
    Pack,
}

impl fmt::Display for ClassifyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Output(index, value) => write!(
                f,
                "output {index} of the network must be finite, but is {value}: check its inputs"
            ),
            Self::Noise(value) => write!(
                f,
                "the noise must be zero or positive and finite, but is {value}"
            ),
            Self::Process(error) => {
                write!(f, "the outputs of the network are not a process: {error}")
            }
            Self::Pack => write!(
                f,
                "the pack has no calibration of the score: train it again"
            ),
        }
    }
}

impl core::error::Error for ClassifyError {}

impl From<SoiptdError> for ClassifyError {
    fn from(error: SoiptdError) -> Self {
        Self::Process(error)
    }
}

impl CyclePosterior {
    /// Posterior from the outputs of a network trained with values times `scale`.
    #[must_use]
    pub fn from_outputs(outputs: &[f32; OUTPUTS], scale: &[f64; VALUES]) -> Self {
        let lower = |i: usize, j: usize| {
            if i == j {
                exp(f64::from(outputs[VALUES + i]))
            } else {
                f64::from(outputs[2 * VALUES + i * (i - 1) / 2 + j])
            }
        };
        // Columns of the inverse of L are rows of the root: covariance = L^-T L^-1.
        let mut root = [[0.0; VALUES]; VALUES];
        for column in 0..VALUES {
            for i in column..VALUES {
                let unit = if i == column { 1.0 } else { 0.0 };
                let known: f64 = (column..i).map(|k| lower(i, k) * root[column][k]).sum();
                root[column][i] = (unit - known) / lower(i, i);
            }
        }
        for (row, scale) in root.iter_mut().zip(scale) {
            row.iter_mut().for_each(|value| *value /= scale);
        }
        Self {
            mean: core::array::from_fn(|k| f64::from(outputs[k]) / scale[k]),
            root,
        }
    }

    /// Longest axis, from the mean to one standard deviation, with each value multiplied by `scale` for the
    /// length.
    #[must_use]
    pub fn longest_axis(&self, scale: &[f64; VALUES]) -> [f64; VALUES] {
        let covariance: [[f64; VALUES]; VALUES] = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let sum: f64 = (0..VALUES).map(|k| self.root[i][k] * self.root[j][k]).sum();
                scale[i] * scale[j] * sum
            })
        });
        let mut axis = [0.5; VALUES];
        let mut length = 0.0;
        for _ in 0..AXIS_STEPS {
            let image: [f64; VALUES] =
                core::array::from_fn(|i| (0..VALUES).map(|j| covariance[i][j] * axis[j]).sum());
            length = sqrt(image.iter().map(|value| value * value).sum());
            if length == 0.0 || !length.is_finite() {
                return [0.0; VALUES];
            }
            axis = image.map(|value| value / length);
        }
        core::array::from_fn(|k| sqrt(length) * axis[k] / scale[k])
    }
}

/// Steps of the power method: if the second axis is 0.9 of the longest, its share falls to 0.9^48 = 0.6 %.
const AXIS_STEPS: usize = 24;

/// Classifies the outputs of a network for a cycle of `period_s` (s). `noise_sigma` is the standard deviation of
/// the noise of a sample (output unit), for example [`Window::noise_sigma`](crate::window::Window::noise_sigma).
///
/// # Errors
/// The output, the noise or the parameter that is out of range.
pub fn classify(
    outputs: &[f32; OUTPUTS],
    signature: &Signature,
    period_s: f64,
    noise_sigma: f64,
    calibration: &Calibration,
) -> Result<Classification, ClassifyError> {
    let mut classifier = Classifier::new();
    classifier.begin_at(outputs, signature, period_s, noise_sigma, calibration)?;
    loop {
        if let Some(outcome) = classifier.read() {
            return outcome;
        }
    }
}

/// Classifies a signature with the network and the calibration of a pack.
///
/// # Errors
/// Those of [`classify`], and [`ClassifyError::Pack`] if the pack has no calibration.
pub fn classify_by(
    pack: &Pack<'_>,
    signature: &Signature,
    period_s: f64,
    noise_sigma: f64,
) -> Result<Classification, ClassifyError> {
    let mut classifier = Classifier::new();
    classifier.begin(pack, signature, period_s, noise_sigma)?;
    loop {
        if let Some(outcome) = classifier.advance(pack) {
            return outcome;
        }
    }
}

/// Process with these values. A pole ratio or a dead time out of range is replaced by the nearest valid one. The
/// faster pole becomes that of the actuator.
///
/// # Errors
/// If the period, the amplitude or a value is not finite.
pub fn process_of(
    values: &[f64; VALUES],
    signature: &Signature,
    period_s: f64,
) -> Result<Soiptd, SoiptdError> {
    let [ln_pole_sum, pole_ratio, delay, ln_amplitude] = *values;
    let unit = Soiptd::from_pole_sum(
        signature.sign,
        exp(ln_pole_sum) / period_s,
        pole_ratio.clamp(0.0, MOST_POLE_RATIO),
        delay.max(0.0) * period_s,
    )?;
    // The gain is relative to the actuator's lag, which is known only with the poles.
    let jerk_gain = signature.amplitude / (exp(ln_amplitude) * period_s * period_s * period_s);
    unit.with_gain_scaled(jerk_gain * unit.t_prop_s())
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::classifier::NODES;
    use super::*;
    use crate::signature::{LENGTH, PARTS};

    const OUTPUT: [f32; OUTPUTS] = [
        2.2, 0.9, 0.4, -5.8, 2.5, 3.0, 4.0, 3.5, 0.5, -1.0, 2.0, 0.25, 1.5, -3.0,
    ];

    fn signature() -> Signature {
        let mut values = [0.0; LENGTH];
        for (part, value) in values[..PARTS].iter_mut().enumerate() {
            *value = libm::cosf(part as f32 / 5.0);
        }
        values[PARTS] = 0.5;
        values[PARTS + 1] = 6.0;
        Signature {
            values,
            amplitude: 0.01,
            centre: 0.0,
            sign: -1.0,
        }
    }

    // root^T (S L L^T S) root = 1 with S the scale, to rounding.
    #[test]
    fn the_root_is_that_of_the_covariance() {
        let scale = [1.0, 8.0, 8.0, 1.0];
        let posterior = CyclePosterior::from_outputs(&OUTPUT, &scale);
        let below = [
            [0.0; 4],
            [0.5, 0.0, 0.0, 0.0],
            [-1.0, 2.0, 0.0, 0.0],
            [0.25, 1.5, -3.0, 0.0],
        ];
        let factor = |i: usize, j: usize| {
            let diagonal = if i == j {
                exp(f64::from(OUTPUT[4 + i]))
            } else {
                0.0
            };
            scale[i] * (diagonal + below[i][j])
        };
        for a in 0..VALUES {
            for b in 0..VALUES {
                // (L^T S root)_ab is a root of the unit matrix, here the unit matrix itself.
                let product: f64 = (0..VALUES)
                    .map(|i| factor(i, a) * posterior.root[i][b])
                    .sum();
                let unit = if a == b { 1.0 } else { 0.0 };
                assert!((product - unit).abs() < 1e-13, "{a} {b} {product}");
            }
        }
        let mean = posterior.mean.map(|value| value as f32);
        assert_eq!(mean, [2.2, 0.1125, 0.05, -5.8]);
    }

    // Standard deviations 1/2, 1/4, 1/8 and 1 without correlation: the axis of the last value, of length one.
    #[test]
    fn the_longest_axis_of_a_diagonal() {
        let l = |size: f32| libm::logf(size);
        let mut outputs = [0.0; OUTPUTS];
        outputs[4..8].copy_from_slice(&[l(2.0), l(4.0), l(8.0), l(1.0)]);
        let posterior = CyclePosterior::from_outputs(&outputs, &[1.0; VALUES]);
        let axis = posterior.longest_axis(&[1.0; VALUES]);
        for (axis, expected) in axis.iter().zip([0.0, 0.0, 0.0, 1.0]) {
            assert!((axis - expected).abs() < 1e-7, "{axis:?}");
        }
    }

    // The moments of the quadrature rule are those of a standard normal: 1, 0, 1, 0, 3.
    #[test]
    fn candidates_stand_for_the_posterior() {
        for (power, moment) in [(0, 1.0), (1, 0.0), (2, 1.0), (3, 0.0), (4, 3.0)] {
            let sum: f64 = NODES
                .iter()
                .map(|(node, weight)| weight * libm::pow(*node, f64::from(power)))
                .sum();
            assert!((sum - moment).abs() < 1e-14, "{power} {sum}");
        }
        let found = classify(&OUTPUT, &signature(), 0.4, 0.0, &Calibration::UNTRAINED).unwrap();
        for pair in found.candidates.windows(2) {
            assert!(pair[0].probability >= pair[1].probability);
            assert_ne!(pair[0].process, pair[1].process);
        }
        // The gain has the sign of the signature.
        assert!(found.candidates[0].process.k_over_t_body() < 0.0);
    }

    // A cosine is not the response of this process: the score is the statistic over the limit, and crosses one
    // where the limit does.
    #[test]
    fn the_limit_is_a_score_of_one() {
        let at = |limit| {
            let calibration = Calibration {
                limit,
                ..Calibration::UNTRAINED
            };
            classify(&OUTPUT, &signature(), 0.4, 0.0, &calibration).unwrap()
        };
        let statistic = at(1.0).score;
        assert!(statistic > 100.0 && statistic.is_finite(), "{statistic}");
        assert_eq!(at(1.0).familiarity, Familiarity::Unknown);
        assert_eq!(at(0.999 * statistic).familiarity, Familiarity::Unknown);
        assert_eq!(at(1.001 * statistic).familiarity, Familiarity::Known);
    }

    // Outputs whose diagonal is 3 on average are e^-3 wide. A width 0.3 above usual with a deviation of 0.1 is
    // three standard deviations: twice nine more in the sum.
    #[test]
    fn doubt_counts() {
        assert_eq!(Calibration::width_of(&OUTPUT), -3.25);
        let at = |usual: f64| {
            let calibration = Calibration {
                width: [usual, 0.0, 0.0],
                width_sigma: 0.1,
                limit: 1.0,
                ..Calibration::UNTRAINED
            };
            classify(&OUTPUT, &signature(), 0.4, 0.0, &calibration)
                .unwrap()
                .score
        };
        assert!((at(-3.55) - at(-3.25) - 18.0).abs() < 1e-6);
        assert_eq!(at(-3.25), at(0.0));
    }

    // Noise of a hundredth of the amplitude would explain any cycle, but this network accepts a 250th at most:
    // score 2.5.
    #[test]
    fn noise_beyond_what_is_known_counts() {
        let calibration = Calibration {
            limit: 1e9,
            most_noise: 0.004,
            ..Calibration::UNTRAINED
        };
        let noise_sigma = 0.01 * signature().amplitude;
        let found = classify(&OUTPUT, &signature(), 0.4, noise_sigma, &calibration).unwrap();
        assert!((found.score - 2.5).abs() < 1e-12, "{}", found.score);
        assert_eq!(found.familiarity, Familiarity::Unknown);
    }

    #[test]
    fn errors_name_the_offender() {
        let of = |outputs: [f32; OUTPUTS], noise| {
            classify(&outputs, &signature(), 0.4, noise, &Calibration::UNTRAINED).unwrap_err()
        };
        let mut broken = OUTPUT;
        broken[9] = f32::INFINITY;
        assert_eq!(of(broken, 0.0), ClassifyError::Output(9, f32::INFINITY));
        assert!(
            of(broken, 0.0)
                .to_string()
                .starts_with("output 9 of the network")
        );
        assert_eq!(of(OUTPUT, -1.0), ClassifyError::Noise(-1.0));
        broken = OUTPUT;
        broken[0] = 1e4;
        assert!(matches!(of(broken, 0.0), ClassifyError::Process(_)));
    }
}
