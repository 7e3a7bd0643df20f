//! Acceptance of a fit, and the uncertainty of the controller's phase margin.
//!
//! To first order a quantity `m`, such as the phase margin of a fixed controller, moves with the coordinates `x`
//! of the fit ([`coordinate`]), whose covariance is `C`:
//!
//! ```text
//! sigma_m^2 = (dm/dx)^T C (dm/dx)
//! ```
//!
//! The derivatives are differences between the process found and a neighbour along each coordinate, so that the
//! work comes in equal slices.

use core::f64::consts::PI;

use libm::{atan2, exp, log, sin, sqrt};

use crate::control::Pd;
use crate::crossover;
use crate::process::Soiptd;
use crate::refine::{Refined, Walk, coordinate};
use crate::window::Window;

/// Largest part of the oscillation that a process of this family leaves unexplained.
pub const MOST_MISFIT: f64 = 0.05;

/// Largest relative error of the response that is accepted at a phase margin of 20 degrees.
const RESPONSE_ERROR_AT_20_DEGREES: f64 = 0.34;

/// Largest relative error of the response that is accepted at any margin. The intervals are linear in the error;
/// at 0.4 they are already too narrow by a quarter, because `-ln(1 - 0.4) = 0.51`.
const MOST_RESPONSE_ERROR: f64 = 0.4;

/// Largest relative error of the response that is accepted for a controller with this phase margin (rad, 0 to
/// pi).
///
/// At the gain crossover `|L| = 1`, and the distance of `L` from -1 is `2 sin(margin/2)`. A relative error of
/// the response below that distance cannot move `L` to -1, so the loop stays stable. At the paper's 20 degrees
/// the distance is 0.347. The limit is proportional to the distance and exactly 0.34 at 20 degrees (the sine of
/// 20 degrees, 0.342, rounded down). It is 0.4 at most, from 23.6 degrees on: a larger margin must not accept a
/// model that is wrong by half.
#[must_use]
pub fn largest_response_error(phase_margin_rad: f64) -> f64 {
    let relative = sin(0.5 * phase_margin_rad) / sin(PI / 18.0);
    (RESPONSE_ERROR_AT_20_DEGREES * relative).min(MOST_RESPONSE_ERROR)
}

/// Standard deviations to either side that contain 90 % of a Gaussian; 95 % lie above the lower end.
pub const HALF_90_PERCENT: f64 = 1.645;

/// Relative difference of the gains at two amplitudes that does not matter to a controller. It is also the standard deviation
/// of the gain of small signals about that at the relay's amplitude, which a test at one amplitude cannot show.
pub(crate) const ALIKE_GAINS: f64 = 0.03;

/// Ratio of two estimates of the same variance from some fifty differences that chance exceeds in 1 of 100.
const CHANCE: f64 = 2.1;

/// Misfit: residual beyond the noise over the oscillation, both as root mean squares of the bins, or of their differences where
/// those were fitted.
#[must_use]
#[inline(never)]
pub fn misfit<const BINS: usize, const EDGES: usize>(
    refined: &Refined,
    window: &Window<BINS, EDGES>,
) -> f64 {
    let means = || {
        let bins = window.bins().iter().filter(|bin| bin.count > 0);
        bins.map(|bin| bin.output_sum / f64::from(bin.count))
    };
    let count = means().count() as f64;
    if let Some(Walk { differences, sigma }) = refined.walk {
        let mut last = [f64::NAN; 2];
        let variance = means().filter_map(|mut value| {
            for last in &mut last[..usize::from(differences)] {
                value -= core::mem::replace(last, value);
            }
            value.is_finite().then_some(value * value)
        });
        let variance = variance.sum::<f64>() / (count - f64::from(differences));
        let noise = CHANCE * sigma * sigma;
        return sqrt((refined.residual_rms * refined.residual_rms - noise).max(0.0) / variance);
    }
    let mean = means().sum::<f64>() / count;
    let variance = means()
        .map(|value| (value - mean) * (value - mean))
        .sum::<f64>()
        / count;
    let noise = refined.noise_sigma * refined.noise_sigma / f64::from(window.per_bin());
    let excess = (refined.residual_rms * refined.residual_rms - noise).max(0.0);
    sqrt(excess / variance)
}

/// Standard deviations to first order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviations {
    /// Of `ln K/T_body`, that is, relative to `K/T_body`.
    pub ln_k_over_t_body: f64,
    /// Of `T_prop` (s).
    pub t_prop_s: f64,
    /// Of `1/T_body` (1/s).
    pub inv_t_body_per_s: f64,
    /// Of `tau` (s).
    pub tau_s: f64,
    /// Of the phase margin of the controller (rad).
    pub phase_margin_rad: f64,
}

/// Number of quantities that are differentiated: the fields of [`Deviations`].
const FOLLOWED: usize = 5;
/// Number of coordinates of the process: all but the input bias.
pub(crate) const COORDINATES: usize = 4;

/// Derivatives of the quantities, computed one coordinate at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spread {
    here: [f64; FOLLOWED],
    slopes: [[f64; FOLLOWED]; COORDINATES],
    crossover_rad_per_s: f64,
}

impl Spread {
    /// Derivatives about a process and its controller; `None` if their loop has no gain crossover.
    pub(crate) fn new(process: &Soiptd, pd: &Pd) -> Option<Self> {
        let crossover_rad_per_s = gain_crossover(process, pd)?;
        Some(Self {
            here: followed(process, pd, crossover_rad_per_s),
            slopes: [[0.0; FOLLOWED]; COORDINATES],
            crossover_rad_per_s,
        })
    }

    /// Phase margin at the process itself (rad).
    pub(crate) fn phase_margin_rad(&self) -> f64 {
        self.here[FOLLOWED - 1]
    }

    /// Computes the derivatives along one coordinate; `None` if there is no valid process on that side.
    pub(crate) fn follow(&mut self, index: usize, process: &Soiptd, pd: &Pd) -> Option<()> {
        // The error of the difference is of the order of the step squared, 1e-6, far below any deviation that
        // matters.
        const STEP: f64 = 1e-3;
        let (sum, ratio) = process.pole_sum();
        let mut moved = [log(sum), ratio, process.tau_s(), 0.0];
        let step = match index {
            coordinate::POLE_RATIO if ratio > 0.125 => -STEP,
            coordinate::TAU_S => STEP / self.crossover_rad_per_s,
            _ => STEP,
        };
        moved[index] += step;
        let [ln_sum, ratio, tau_s, ln_gain] = moved;
        let unit = Soiptd::from_pole_sum(1.0, exp(ln_sum), ratio, tau_s).ok()?;
        let gain = process.jerk_gain() * exp(ln_gain) * unit.t_prop_s();
        let beside = unit.with_gain_scaled(gain).ok()?;
        let crossover = gain_crossover(&beside, pd)?;
        let there = followed(&beside, pd, crossover);
        for (slope, (there, here)) in self.slopes[index]
            .iter_mut()
            .zip(there.iter().zip(&self.here))
        {
            *slope = (there - here) / step;
        }
        Some(())
    }

    /// The deviations, once all coordinates have been followed. The parameters are those at the amplitude of the test; the phase
    /// margin is that of small signals.
    pub(crate) fn deviations(&self, covariance: &[[f64; 5]; 5]) -> Deviations {
        let of = |field: usize| {
            let mut variance = 0.0;
            for (i, row) in self.slopes.iter().enumerate() {
                for (j, column) in self.slopes.iter().enumerate() {
                    variance += row[field] * covariance[i][j] * column[field];
                }
            }
            sqrt(variance.max(0.0))
        };
        let (margin_rad, amplitude_rad) = (
            of(4),
            self.slopes[coordinate::LN_JERK_GAIN][4] * ALIKE_GAINS,
        );
        Deviations {
            ln_k_over_t_body: of(0),
            t_prop_s: of(1),
            inv_t_body_per_s: of(2),
            tau_s: of(3),
            phase_margin_rad: sqrt(margin_rad * margin_rad + amplitude_rad * amplitude_rad),
        }
    }
}

fn followed(process: &Soiptd, pd: &Pd, crossover_rad_per_s: f64) -> [f64; FOLLOWED] {
    let lead_rad = atan2(pd.kd.abs() * crossover_rad_per_s, pd.kp.abs());
    [
        log(process.k_over_t_body().abs()),
        process.t_prop_s(),
        process.inv_t_body_per_s(),
        process.tau_s(),
        PI + process.phase_rad(crossover_rad_per_s) + lead_rad,
    ]
}

/// Gain crossover of the loop (rad/s); `None` if the magnitude never is one.
fn gain_crossover(process: &Soiptd, pd: &Pd) -> Option<f64> {
    let gain = process.k_over_t_body();
    let omega = crossover::gain_crossover(
        gain * pd.kp,
        gain * pd.kd,
        process.inv_t_body_per_s(),
        process.t_prop_s(),
        crossover::power_of_two_cube_root,
    );
    (omega > 0.0 && omega.is_finite()).then_some(omega)
}

#[cfg(test)]
mod tests {
    use super::*;

    // A/(s^2 (T s + 1)) with kp = 0: |kd A / w / sqrt(1 + w^2 T^2)| = 1. With kd A = sqrt(2)/T the crossover is
    // w = 1/T. The phase of the process there is -180 - 45 degrees, the lead 90, so the margin is 45 degrees;
    // with a dead time of pi/8 T it is 22.5 degrees less.
    #[test]
    fn a_margin_by_hand() {
        let lag_s = 0.2;
        let pd = Pd {
            kp: 0.0,
            kd: sqrt(2.0) / lag_s / 3.0,
        };
        for (tau_s, expected) in [(0.0, 45.0_f64), (PI / 8.0 * lag_s, 22.5)] {
            let process = Soiptd::from_acceleration_gain(3.0, lag_s, 0.0, tau_s).unwrap();
            let margin = Spread::new(&process, &pd).unwrap().phase_margin_rad();
            assert!((margin.to_degrees() - expected).abs() < 1e-6, "{margin}");
        }
    }

    // 0.34 sin(5 deg) / sin(10 deg) = 0.17 / cos(5 deg) = 0.1706. At 20 degrees the limit is 0.34 exactly. At 30
    // degrees 0.34 sin(15 deg) / sin(10 deg) = 0.507 would accept a model that is wrong by half.
    #[test]
    fn the_limit_of_the_error_follows_the_margin() {
        let at = |degrees: f64| largest_response_error(degrees.to_radians());
        assert_eq!(at(20.0), 0.34);
        assert!((at(10.0) - 0.17 / libm::cos(PI / 36.0)).abs() < 1e-15);
        assert!(at(10.0) < 0.3 && 0.3 < at(20.0));
        assert_eq!([at(30.0), at(45.0), at(60.0)], [0.4; 3]);
        assert_eq!(at(0.0), 0.0);
    }

    // A dead time known to a millisecond moves the margin by the crossover times a millisecond. A gain moves it
    // by -1/3 rad per unit of ln A: for the double integrator above, ln|L| has the slope -1 - 1/2 in ln w at w =
    // 1/T, so d ln w / d ln A = 2/3, and the phase falls by d atan(w T) / d ln w = 1/2.
    #[test]
    fn deviations_by_hand() {
        let lag_s = 0.2;
        let pd = Pd {
            kp: 0.0,
            kd: sqrt(2.0) / lag_s / 3.0,
        };
        let process = Soiptd::from_acceleration_gain(3.0, lag_s, 0.0, 0.01).unwrap();
        let mut spread = Spread::new(&process, &pd).unwrap();
        for index in 0..COORDINATES {
            spread.follow(index, &process, &pd).unwrap();
        }
        let mut covariance = [[0.0; 5]; 5];
        covariance[coordinate::TAU_S][coordinate::TAU_S] = 1e-6;
        let of_gain = ALIKE_GAINS * (1.0 / 3.0 + 2.0 / 3.0 * 0.01 / lag_s);
        let found = spread.deviations(&covariance);
        assert!((found.tau_s - 1e-3).abs() < 1e-12, "{found:?}");
        let expected = sqrt((1e-3 / lag_s) * (1e-3 / lag_s) + of_gain * of_gain);
        assert!(
            (found.phase_margin_rad - expected).abs() < 1e-5,
            "{found:?} {expected}"
        );
        assert_eq!(found.t_prop_s, 0.0);

        let mut covariance = [[0.0; 5]; 5];
        covariance[coordinate::LN_JERK_GAIN][coordinate::LN_JERK_GAIN] = 1e-4;
        let found = spread.deviations(&covariance);
        assert!((found.ln_k_over_t_body - 0.01).abs() < 1e-12);
        let gain = sqrt(1e-4 + ALIKE_GAINS * ALIKE_GAINS);
        let expected = gain * (1.0 / 3.0 + 2.0 / 3.0 * 0.01 / lag_s);
        assert!(
            (found.phase_margin_rad - expected).abs() < 1e-5,
            "{found:?} {expected}"
        );

        // T_prop = 1/sum here, so d T_prop = -T_prop d ln sum.
        let mut covariance = [[0.0; 5]; 5];
        covariance[coordinate::LN_POLE_SUM][coordinate::LN_POLE_SUM] = 1e-4;
        let found = spread.deviations(&covariance);
        assert!((found.t_prop_s - 0.01 * lag_s).abs() < 2e-6, "{found:?}");
    }
}
