//! Errors of the instruments that make a recording, which its samples cannot show.

use onecycle_onboard::{Soiptd, SoiptdError};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Standard deviation of the errors of scale and clock: what the intervals of an identification allow for.
const SCALE_AND_CLOCK: f64 = 1e-3;

/// Errors of the instruments of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruments {
    /// Time by which the stamps of the output are later than its samples, beyond the dead time of the process (s).
    pub late_s: f64,
    /// Relative error of the scale of the output.
    pub scale: f64,
    /// Relative error of the clock.
    pub clock: f64,
}

impl Instruments {
    /// Instruments without errors.
    pub const PERFECT: Self = Self {
        late_s: 0.0,
        scale: 0.0,
        clock: 0.0,
    };

    /// Errors as intervals allow for them: stamps anywhere within a sample period, scale and clock wrong by 0.1 %.
    pub(super) fn drawn(sample_s: f64, rng: &mut impl Rng) -> Self {
        let late_s = sample_s * rng.random_range(-0.5..0.5);
        let mut error = || -> f64 { rng.sample::<f64, _>(StandardNormal) * SCALE_AND_CLOCK };
        Self {
            late_s,
            scale: error(),
            clock: error(),
        }
    }

    /// The true process if a recording with these instruments shows `shown`.
    ///
    /// # Errors
    /// [`SoiptdError`] if the errors take the process out of range; never for those of real instruments.
    pub fn behind(&self, shown: &Soiptd) -> Result<Soiptd, SoiptdError> {
        let clock = 1.0 + self.clock;
        let (pole_sum_per_s, ratio) = shown.pole_sum();
        let tau_s = (shown.tau_s() * clock - self.late_s).max(0.0);
        let unit = Soiptd::from_pole_sum(1.0, pole_sum_per_s / clock, ratio, tau_s)?;
        let jerk_gain = shown.jerk_gain() / (clock * clock);
        unit.with_gain_scaled((1.0 - self.scale) * jerk_gain * unit.t_prop_s())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Stamps 1 ms late, a scale that shows 0.2 % too much and a clock that is 0.1 % fast.
    #[test]
    fn errors_by_hand() {
        let shown = Soiptd::new(2.0, 0.05, 0.8, 0.02).unwrap();
        let instruments = Instruments {
            late_s: 1e-3,
            scale: 2e-3,
            clock: 1e-3,
        };
        let truth = instruments.behind(&shown).unwrap();
        let found = [
            truth.k().unwrap(),
            truth.t_prop_s(),
            truth.t_body_s().unwrap(),
            truth.tau_s(),
        ];
        let expected = [1.996, 0.050_05, 0.8008, 0.019_02];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        let same = Instruments::PERFECT.behind(&shown).unwrap();
        assert!((same.k().unwrap() - 2.0).abs() < 1e-12);
    }
}
