//! Limits of a loop, and the gains that they forbid at one frequency.
//!
//! With `l = L(jw)` at `k = 1`, `rho = |l|`, `cos = -Re l/rho`, `sin = Im l/rho`, the forbidden gains are
//!
//! ```text
//! |1 + k l| < 1/Ms:           k rho in cos -+ sqrt(1/Ms^2 - sin^2)                      if |sin| < 1/Ms and Re l < 0
//! |k l| > Mt |1 + k l|:       the same with Mt, both ends times Mt^2/(Mt^2 - 1)
//! phase margin phi:           k rho = 1                                                where |arg l + pi| < phi
//! delay margin d:             k rho = 1                                                where 0 < arg l + pi < min(w d, pi)
//! gain margin g:              k rho in 1/g .. g                                         where arg l = -pi
//! ```

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

/// Limits of a loop. Times in the unit of the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// Largest sensitivity, above 1.
    pub ms: f64,
    /// Largest complementary sensitivity, above 1.
    pub mt: f64,
    /// Least phase margin (rad). Zero: no limit.
    pub phase_margin_rad: f64,
    /// Least delay margin. Zero: no limit.
    pub delay_margin: f64,
    /// Least gain margin. One: no limit.
    pub gain_margin: f64,
}

/// Forbidden gains: `(low, high)`.
pub(crate) type Interval = (f64, f64);

impl Limits {
    /// `Ms` and `Mt` at most `m`.
    #[cfg(test)]
    pub(crate) fn of(m: f64) -> Self {
        Self {
            ms: m,
            mt: m,
            phase_margin_rad: 0.0,
            delay_margin: 0.0,
            gain_margin: 1.0,
        }
    }

    /// Gains that the limits forbid at a frequency, without the gain margin. The interval may contain gains that are not
    /// forbidden between those of two limits.
    #[inline]
    pub(crate) fn forbidden(&self, omega: f64, l: Complex64) -> Option<Interval> {
        let mut found = self.by_peaks(l);
        if self
            .phase_excess(omega, l)
            .is_some_and(|excess| excess < 0.0)
        {
            let one = 1.0 / l.norm();
            found = union(found, (one, one));
        }
        found
    }

    /// Phase (rad) by which a loop that has the magnitude 1 at this frequency keeps the margins of phase and delay. `None` without
    /// such a limit.
    #[inline]
    pub(crate) fn phase_excess(&self, omega: f64, l: Complex64) -> Option<f64> {
        (self.phase_margin_rad > 0.0 || self.delay_margin > 0.0).then(|| {
            let above_rad = (l.arg() + PI).rem_euclid(TAU);
            let by_phase = above_rad.min(TAU - above_rad) - self.phase_margin_rad;
            by_phase.min(above_rad - (omega * self.delay_margin).min(PI))
        })
    }

    #[inline]
    fn by_peaks(&self, l: Complex64) -> Option<Interval> {
        let size = l.norm_sqr();
        let sin_sq = l.im * l.im / size;
        let least = self.ms.min(self.mt);
        if l.re >= 0.0 || sin_sq * least * least >= 1.0 {
            return None;
        }
        let rho = size.sqrt();
        let cos = -l.re / rho;
        let of = |m: f64, factor: f64| {
            let root = (1.0 / (m * m) - sin_sq).sqrt();
            (root >= 0.0).then(|| {
                // The product of the ends is (1 - 1/m^2)/rho^2: exact also where the difference cancels.
                let high = cos + root;
                let low = (1.0 - 1.0 / (m * m)) / high;
                (factor * low / rho, factor * high / rho)
            })
        };
        let mt_sq = self.mt * self.mt;
        let found = of(self.ms, 1.0);
        match of(self.mt, mt_sq / (mt_sq - 1.0)) {
            Some(interval) => union(found, interval),
            None => found,
        }
    }

    /// Gains that the gain margin forbids where the phase is -pi.
    pub(crate) fn at_phase_crossing(&self, l: Complex64) -> Interval {
        let rho = l.norm();
        (1.0 / (self.gain_margin * rho), self.gain_margin / rho)
    }
}

/// The least interval that contains both.
pub(crate) fn union(first: Option<Interval>, second: Interval) -> Option<Interval> {
    Some(match first {
        Some(first) => (first.0.min(second.0), first.1.max(second.1)),
        None => second,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // At both ends of the interval of Ms alone |1 + k l| = 1/Ms, at both ends of that of Mt alone |k l| = Mt |1 + k l|;
    // to rounding.
    #[test]
    fn the_ends_touch_the_limits() {
        for (re, im) in [(-1.0, 0.1), (-3.0, -0.8), (-0.02, 0.0)] {
            let l = Complex64::new(re, im);
            let sensitivity = Limits {
                mt: 1e6,
                ..Limits::of(1.6)
            };
            let (low, high) = sensitivity.forbidden(1.0, l).unwrap();
            // Mt = 1e6 forbids |1 + k l| < 1e-6 |k l| only, inside the interval of Ms.
            for k in [low, high] {
                assert!(((1.0 + k * l).norm() * 1.6 - 1.0).abs() < 1e-14);
            }
            let complementary = Limits {
                ms: 1e6,
                ..Limits::of(1.6)
            };
            let (low, high) = complementary.forbidden(1.0, l).unwrap();
            for k in [low, high] {
                assert!(((k * l).norm() / (1.0 + k * l).norm() / 1.6 - 1.0).abs() < 1e-14);
            }
        }
        assert_eq!(
            Limits::of(1.6).forbidden(1.0, Complex64::new(1.0, 0.0)),
            None
        );
        assert_eq!(
            Limits::of(1.6).forbidden(1.0, Complex64::new(-1.0, 2.0)),
            None
        );
    }
}
