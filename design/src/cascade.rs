//! Cost and phase margin of an autopilot's cascade: a proportional angle loop around a PID rate loop.
//!
//! ```text
//! u = rate_p ((w_ref - w) + rate_i int (w_ref - w) - rate_d dw/dt),   w = dy/dt,  w_ref = angle_p (r - y)
//! ```
//!
//! With `rate_i = rate_d = 0` the cascade is the PD `kp = angle_p rate_p`, `kd = rate_p`. For the process
//! `G = A e^(-tau s) / C(s)`, `C = s (T_prop s + 1)(s + 1/T_body)`, `A = K/T_body`, the error of a unit step is
//!
//! ```text
//! E(s) = (C + B (rate_d s^2 + s + rate_i)) / N(s),         B = A rate_p e^(-tau s)
//! N(s) = s C + B (rate_d s^3 + s^2 + (rate_i + angle_p) s + angle_p rate_i)
//! J    = 1/pi int_0^inf |E(jw)|^2 dw
//! ```
//!
//! **Stability.** The dead time does not act on the highest power of `N`, so Mikhailov's criterion (1938) applies: the
//! loop is stable if and only if `arg N(jw)` grows by `pi/2` for each of the four powers from `w = 0` to infinity. If
//! `rate_i` is zero a root at zero cancels, and three powers are left.
//!
//! **Quadrature.** The argument, the integral `J` and the gain crossovers of the open loop `N/(s C) - 1` come from one
//! sweep over frequencies at equal steps `h` of `ln w`. At a resonance of damping ratio `zeta` the trapezoidal rule has
//! the relative error `exp(-2 pi zeta/h)`: below 1e-8 for `zeta` above 0.003. Outside the sweep the integrand is replaced
//! by its limits, `E(0)` below and `1/s` above.

use std::f64::consts::{FRAC_PI_2, PI};

use num_complex::Complex64;
use onecycle_onboard::Soiptd;

/// Gains of the cascade. For the control law see the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cascade {
    /// Proportional gain of the angle loop (1/s).
    pub angle_p: f64,
    /// Gain of the rate loop (input unit s / output unit). It multiplies the integral and derivative terms too.
    pub rate_p: f64,
    /// Inverse integral time (1/s).
    pub rate_i: f64,
    /// Derivative time (s), on the measured rate.
    pub rate_d: f64,
}

/// Cost and phase margin of a stable cascade.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CascadeCost {
    /// Integral of the squared error of a unit step of the reference (output unit^2 s).
    pub ise: f64,
    /// Phase margin of the loop opened at the process input (rad): the least over all gain crossovers.
    pub phase_margin_rad: f64,
}

/// Step `h` of the natural logarithm of the frequency: quadrature error below 1e-8 for damping ratios above 0.003.
const STEP: f64 = 1e-3;

/// The sweep extends by this factor below the lowest and above the highest frequency at which two terms of `N` are
/// equal. The limits outside the sweep are then exact to about `1/BEYOND^2` = 1e-8.
const BEYOND: f64 = 1e4;

/// Maximum number of steps: a sweep over a factor of `e^100`, about 1e43 in frequency. Processes and gains that need
/// more have no result.
const MOST_STEPS: f64 = 1e5;

impl Cascade {
    /// Cost and phase margin of the cascade on `process`. `None` if the loop is unstable, if it has no gain, or if its
    /// frequencies span more than the sweep can cover.
    #[must_use]
    pub fn cost(&self, process: &Soiptd) -> Option<CascadeCost> {
        let sweep = Sweep::of(self, process)?;
        let steps = ((sweep.last / sweep.first).ln() / STEP).ceil();
        if !(steps > 0.0 && steps < MOST_STEPS) {
            return None;
        }
        let (mut sum, mut turned_rad, mut margin_rad) = (0.0, 0.0, PI);
        let mut before: Option<Point> = None;
        for k in 0..=steps as usize {
            let point = sweep.at(sweep.first * (STEP * k as f64).exp());
            let is_end = k == 0 || k == steps as usize;
            sum += point.error_sq * point.omega * if is_end { 0.5 } else { 1.0 };
            if let Some(before) = before.replace(point) {
                turned_rad += (point.denominator / before.denominator).arg();
                margin_rad = f64::min(margin_rad, before.margin_to(&point));
            }
        }
        let powers = if self.rate_i == 0.0 { 3.0 } else { 4.0 };
        if (turned_rad - powers * FRAC_PI_2).abs() > FRAC_PI_2 {
            return None;
        }
        let last = sweep.first * (STEP * steps).exp();
        let ends = sweep.at(sweep.first).error_sq * sweep.first + 1.0 / last;
        let ise = (sum * STEP + ends) / PI;
        ise.is_finite().then_some(CascadeCost {
            ise,
            phase_margin_rad: margin_rad,
        })
    }
}

/// Frequency sweep of a loop.
struct Sweep {
    cascade: Cascade,
    /// `A rate_p` (1/s).
    gain: f64,
    /// `1/T_body` (1/s).
    damping: f64,
    /// `T_prop` (s).
    lag_s: f64,
    tau_s: f64,
    /// First frequency (rad/s).
    first: f64,
    /// Last frequency (rad/s).
    last: f64,
}

/// The loop at one frequency.
#[derive(Clone, Copy)]
struct Point {
    /// Frequency (rad/s).
    omega: f64,
    /// `|E(jw)|^2`.
    error_sq: f64,
    /// `N(jw)`.
    denominator: Complex64,
    /// Open loop `N/(s C) - 1`.
    open: Complex64,
}

impl Sweep {
    /// `None` if a gain is not finite or the loop has no gain.
    fn of(cascade: &Cascade, process: &Soiptd) -> Option<Self> {
        let gain = process.k_over_t_body() * cascade.rate_p;
        let (damping, lag_s) = (process.inv_t_body_per_s(), process.t_prop_s());
        // Magnitudes of the coefficients of N, from the fourth power down. The dead time turns phases only.
        let sizes = [
            lag_s,
            1.0 + lag_s * damping + (gain * cascade.rate_d).abs(),
            damping + gain.abs(),
            (gain * (cascade.rate_i + cascade.angle_p)).abs(),
            (gain * cascade.rate_i * cascade.angle_p).abs(),
        ];
        let last_of = if sizes[4] > 0.0 { 4 } else { 3 };
        let balance = |high: usize, low: usize| {
            let ratio = sizes[low] / sizes[high];
            ratio.powf(1.0 / (low - high) as f64)
        };
        let largest = (1..=last_of).map(|low| balance(0, low)).fold(0.0, f64::max);
        let smallest = (0..last_of)
            .map(|high| balance(high, last_of))
            .fold(f64::INFINITY, f64::min);
        let is_right = sizes.iter().all(|size| size.is_finite()) && smallest > 0.0;
        is_right.then_some(Self {
            cascade: *cascade,
            gain,
            damping,
            lag_s,
            tau_s: process.tau_s(),
            first: smallest / BEYOND,
            last: largest * BEYOND,
        })
    }

    fn at(&self, omega: f64) -> Point {
        let Cascade {
            angle_p,
            rate_i,
            rate_d,
            ..
        } = self.cascade;
        let s = Complex64::new(0.0, omega);
        let process = s * (s * self.lag_s + 1.0) * (s + self.damping);
        let force = Complex64::from_polar(self.gain, -omega * self.tau_s);
        let rate = force * (s * s * rate_d + s + rate_i);
        let angle = force * angle_p * (s + rate_i);
        let denominator = s * process + s * rate + angle;
        Point {
            omega,
            error_sq: ((process + rate) / denominator).norm_sqr(),
            denominator,
            open: (s * rate + angle) / (s * process),
        }
    }
}

impl Point {
    /// Angle of the open loop from -1 (rad) where its magnitude crosses 1 between this point and the next one, linear
    /// in the logarithm of the magnitude. `pi` if the magnitude does not cross 1.
    fn margin_to(&self, next: &Self) -> f64 {
        let (here, there) = (self.open.norm().ln(), next.open.norm().ln());
        if (here > 0.0) == (there > 0.0) {
            return PI;
        }
        let turn_rad = (next.open / self.open).arg();
        let at_one = (-self.open) * Complex64::cis(turn_rad * here / (here - there));
        at_one.arg().abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::soiptd_pd::cost::ise;
    use crate::soiptd_pd::margins::margins;
    use crate::soiptd_pd::optimum::pd_at_phase_margin;

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance * b.abs()
    }

    // With rate_i = rate_d = 0 the cascade is a PD. Its cost and margin equal the closed form at phase margins from 0.5
    // to 60 degrees, and there is no cost at 1.01 times the gain margin.
    #[test]
    fn without_integral_it_is_the_pd() {
        for (gain, lag_s, damping, tau_s, margin_deg) in [
            (0.5, 0.3, 0.5, 0.1, 20.0_f64),
            (0.5, 0.3, 0.5, 0.1, 0.5),
            (-7.0, 0.3, 0.5, 0.1, 60.0),
            (1.0, 0.015, 5.0, 0.0005, 20.0),
            (1.0, 0.01, 100.0, 1.0, 45.0),
            (1.0, 0.3, 0.0, 0.05, 5.0),
        ] {
            let process = Soiptd::from_acceleration_gain(gain, lag_s, damping, tau_s).unwrap();
            let pd = pd_at_phase_margin(&process, margin_deg.to_radians())
                .unwrap()
                .pd;
            let cascade = Cascade {
                angle_p: pd.angle_p(),
                rate_p: pd.rate_p(),
                rate_i: 0.0,
                rate_d: 0.0,
            };
            let found = cascade.cost(&process).unwrap();
            assert!(
                close(found.ise, ise(&process, pd).unwrap(), 1e-6),
                "{found:?}"
            );
            let margin_rad = margins(&process, pd).unwrap().phase_margin_rad;
            assert!(close(found.phase_margin_rad, margin_rad, 1e-4), "{found:?}");
            let limit = margins(&process, pd).unwrap().gain_margin.unwrap();
            let hot = |factor: f64| Cascade {
                rate_p: factor * limit * cascade.rate_p,
                ..cascade
            };
            assert!(hot(0.99).cost(&process).is_some() && hot(1.01).cost(&process).is_none());
        }
    }

    // A double integrator, rate_p 2, rate_i 1/2, angle_p 1: E = (s^2 + 2 s + 1)/(s^3 + 2 s^2 + 3 s + 1), and
    // for (c2, c1, c0)/(d3, d2, d1, d0) the integral is
    // (c2^2 d0 d1 + (c1^2 - 2 c0 c2) d0 d3 + c0^2 d2 d3)/(2 d0 d3 (d1 d2 - d0 d3)) = (3 + 2 + 2)/10.
    // With rate_d 1/2, c2 = 2 and d3 = 2, so J = (12 + 0 + 4)/16 = 1. The lag of 1e-7 s changes the seventh digit.
    #[test]
    fn integral_and_derivative_by_hand() {
        let process = Soiptd::from_acceleration_gain(1.0, 1e-7, 0.0, 0.0).unwrap();
        let of = |rate_i: f64, rate_d: f64| Cascade {
            angle_p: 1.0,
            rate_p: 2.0,
            rate_i,
            rate_d,
        };
        for (rate_d, expected) in [(0.0, 0.7), (0.5, 1.0)] {
            let found = of(0.5, rate_d).cost(&process).unwrap();
            assert!(close(found.ise, expected, 1e-5), "{found:?}");
        }
        // With angle_p 1 the polynomial s^3 + 2 s^2 + 2 (rate_i + 1) s + 2 rate_i is stable for every rate_i > 0. With
        // angle_p 3 it is stable if 4 (rate_i + 3) > 6 rate_i, that is for rate_i below 6.
        let steep = |rate_i: f64| Cascade {
            angle_p: 3.0,
            ..of(rate_i, 0.0)
        };
        assert!(steep(5.9).cost(&process).is_some() && steep(6.1).cost(&process).is_none());
        assert!(of(50.0, 0.0).cost(&process).is_some() && of(-0.1, 0.0).cost(&process).is_none());
    }

    #[test]
    fn loops_without_gain_cost_nothing_finite() {
        let process = Soiptd::new(1.0, 0.1, 1.0, 0.05).unwrap();
        for (angle_p, rate_p) in [
            (0.0, 1.0),
            (1.0, 0.0),
            (1.0, -1.0),
            (-1.0, 1.0),
            (f64::NAN, 1.0),
        ] {
            let cascade = Cascade {
                angle_p,
                rate_p,
                rate_i: 0.0,
                rate_d: 0.0,
            };
            assert_eq!(cascade.cost(&process), None, "{cascade:?}");
        }
    }
}
