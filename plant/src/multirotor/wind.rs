//! Wind with a steady part and gusts, and nudges.
//!
//! Each component of the gusts is a first-order Gauss-Markov process. Its spectrum is the one that the Dryden
//! model (MIL-F-8785C) has for the component along the flight, used here for all three. The exact discrete form
//! over a step `h`, with `rho = exp(-h / T)`, is
//!
//! ```text
//! g <- rho g + sigma sqrt(1 - rho^2) n,   n standard normal
//! ```
//!
//! so that variance `sigma^2` and autocorrelation `exp(-t / T)` do not depend on the step. `g` and `sigma` are
//! in m/s, `T` and `h` in s.

use super::error::{VehicleError, at_least_zero, finite, positive};
use super::frames::Vec3;
use crate::NoiseSource;

/// Wind, the same everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Wind {
    /// Steady part (m/s, world): velocity of the air.
    pub steady_m_per_s: Vec3,
    /// Standard deviation of the gusts (m/s, world).
    pub gust_sigma_m_per_s: Vec3,
    /// Correlation time of the gusts (s): their length scale over the airspeed.
    pub gust_correlation_s: f64,
}

impl Wind {
    /// No wind.
    pub const CALM: Self = Self::steady(Vec3::ZERO);

    /// A steady wind (m/s, world) without gusts.
    #[must_use]
    pub const fn steady(steady_m_per_s: Vec3) -> Self {
        Self {
            steady_m_per_s,
            gust_sigma_m_per_s: Vec3::ZERO,
            gust_correlation_s: 1.0,
        }
    }

    /// The same wind with gusts of this standard deviation (m/s, world) and correlation time (s).
    #[must_use]
    pub fn with_gusts(self, gust_sigma_m_per_s: Vec3, gust_correlation_s: f64) -> Self {
        Self {
            gust_sigma_m_per_s,
            gust_correlation_s,
            ..self
        }
    }

    pub(super) fn check(&self) -> Result<(), VehicleError> {
        finite("steady wind", self.steady_m_per_s)?;
        for sigma in [
            self.gust_sigma_m_per_s.x,
            self.gust_sigma_m_per_s.y,
            self.gust_sigma_m_per_s.z,
        ] {
            at_least_zero("sigma of the gusts", sigma)?;
        }
        positive("correlation time of the gusts", self.gust_correlation_s)
    }
}

/// Present gusts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gusts {
    velocity_m_per_s: Vec3,
}

impl Gusts {
    /// Present gust (m/s, world).
    #[must_use]
    #[inline]
    pub fn velocity_m_per_s(&self) -> Vec3 {
        self.velocity_m_per_s
    }

    /// Advances by `dt_s`; takes no numbers from `noise` if the wind has no gusts.
    pub fn step(&mut self, wind: &Wind, dt_s: f64, noise: &mut impl NoiseSource) {
        if wind.gust_sigma_m_per_s == Vec3::ZERO {
            self.velocity_m_per_s = Vec3::ZERO;
            return;
        }
        let kept = (-dt_s / wind.gust_correlation_s).exp();
        let fresh = (1.0 - kept * kept).sqrt();
        let mut normal = || noise.standard_normal();
        let drawn = Vec3::new(normal(), normal(), normal());
        self.velocity_m_per_s =
            self.velocity_m_per_s * kept + wind.gust_sigma_m_per_s.scaled_by(drawn) * fresh;
    }
}

/// A force and a torque for a limited time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nudge {
    /// Force at the centre of mass (N, world).
    pub force_n: Vec3,
    /// Torque (N m, body).
    pub torque_nm: Vec3,
    /// Duration (s).
    pub duration_s: f64,
}

impl Nudge {
    pub(super) fn check(&self) -> Result<(), VehicleError> {
        finite("force of the nudge", self.force_n)?;
        finite("torque of the nudge", self.torque_nm)?;
        at_least_zero("duration of the nudge", self.duration_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Noise;

    // sigma = 1.5 m/s, T = 0.2 s, N = 400,000 steps of 10 ms, rho = exp(-1/20). Variance: relative
    // standard error sqrt(2/N (1 + rho^2)/(1 - rho^2)) = sqrt(2/N * 20.02) = 1.0 %. Autocorrelation at
    // one correlation time: exp(-1) = 0.368, standard error below sqrt(2 T / (N h)) = 1.0 %. The mean has
    // sigma sqrt(2 T / (N h)) = 0.015 m/s. Three of each.
    #[test]
    fn gusts_have_their_variance_and_correlation() {
        const STEPS: usize = 400_000;
        const LAG: usize = 20;
        let wind = Wind {
            gust_sigma_m_per_s: Vec3::new(1.5, 0.0, 3.0),
            gust_correlation_s: 0.2,
            ..Wind::CALM
        };
        let (mut gusts, mut noise) = (Gusts::default(), Noise::from_seed(11));
        let series: Vec<Vec3> = (0..STEPS)
            .map(|_| {
                gusts.step(&wind, 0.01, &mut noise);
                gusts.velocity_m_per_s()
            })
            .collect();
        let mean = series.iter().map(|g| g.x).sum::<f64>() / STEPS as f64;
        let power = |part: fn(&Vec3) -> f64| {
            series.iter().map(|g| part(g) * part(g)).sum::<f64>() / STEPS as f64
        };
        let lagged = series.windows(LAG + 1).map(|w| w[0].x * w[LAG].x);
        let correlation = lagged.sum::<f64>() / (STEPS - LAG) as f64 / power(|g| g.x);
        assert!(mean.abs() < 0.045, "{mean}");
        assert!((power(|g| g.x) / 2.25 - 1.0).abs() < 0.03);
        assert!((power(|g| g.z) / 9.0 - 1.0).abs() < 0.03);
        assert_eq!(power(|g| g.y), 0.0);
        assert!(
            (correlation - (-1.0_f64).exp()).abs() < 0.03,
            "{correlation}"
        );
    }

    // Without sigma the gusts are zero and the noise is not used.
    #[test]
    fn no_gusts_draw_nothing() {
        let (mut gusts, mut noise) = (Gusts::default(), Noise::from_seed(1));
        gusts.step(&Wind::steady(Vec3::new(5.0, 0.0, 0.0)), 0.01, &mut noise);
        assert_eq!(gusts, Gusts::default());
        assert_eq!(noise, Noise::from_seed(1));
    }
}
