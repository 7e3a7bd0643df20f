//! Stability margins of an integrator with two lags and dead time under a PD.
//!
//! The open loop `L = (Kp + Kd s) G` has one gain crossover, where its magnitude falls through 1, and at most one phase
//! crossover, where its unwrapped phase falls through `-pi`. The loop is stable if and only if its phase margin is
//! positive. Two consequences for this structure:
//!
//! - A stable loop stays stable at every lower gain. So there is no lower gain margin, not even for double integrators.
//! - An unstable loop without a phase crossover is unstable at every gain.
//!
//! Reference: the phase margin is the constraint of the paper's equations 12 and 13 (Ayyad, Chehadeh, Awad, Zweiri
//! 2020).

use onecycle_onboard::{Pd, Soiptd};

use crate::soiptd_pd::open_loop::OpenLoop;

/// Stability margins of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Margins {
    /// Phase that the loop can lose at the gain crossover before it becomes unstable (rad), below `pi`. Zero or
    /// negative for an unstable loop; unwrapped, so it can be several turns below zero.
    pub phase_margin_rad: f64,
    /// Gain crossover: frequency at which `|L| = 1` (rad/s).
    pub gain_crossover_rad_per_s: f64,
    /// Factor by which the gain can grow before the loop becomes unstable: `1/|L|` at the phase crossover. Below 1 for
    /// an unstable loop. `None` if there is no phase crossover: then the gain does not decide stability.
    pub gain_margin: Option<f64>,
    /// Phase crossover: frequency at which the unwrapped phase of `L` is `-pi` (rad/s). `None` if there is none.
    pub phase_crossover_rad_per_s: Option<f64>,
    /// Additional dead time that the loop tolerates before it becomes unstable (s). For an unstable loop it is
    /// negative: the dead time that must be removed.
    pub delay_margin_s: f64,
}

impl Margins {
    /// Whether the closed loop is asymptotically stable.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.phase_margin_rad > 0.0
    }
}

/// Stability margins of `process` under `pd`. An unstable loop has margins too.
///
/// `None` if the proportional gain is zero or has the wrong sign (its product with the gain of the process is not
/// positive). Such a loop is unstable, and its magnitude may never cross 1.
#[must_use]
pub fn margins(process: &Soiptd, pd: Pd) -> Option<Margins> {
    let open_loop = OpenLoop::new(process, pd)?;
    let gain_crossover_rad_per_s = open_loop.gain_crossover();
    let phase_margin_rad = open_loop.phase_above_minus_pi(gain_crossover_rad_per_s);
    let phase_crossover_rad_per_s = open_loop.phase_crossover();
    let delay_margin_s = phase_margin_rad / gain_crossover_rad_per_s;
    delay_margin_s.is_finite().then_some(Margins {
        phase_margin_rad,
        gain_crossover_rad_per_s,
        gain_margin: phase_crossover_rad_per_s.map(|omega| 1.0 / open_loop.magnitude(omega)),
        phase_crossover_rad_per_s,
        delay_margin_s,
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance * b.abs()
    }

    // Kp = 1, Kd = 0, K = 2, T_prop = T_body = 1 s: 4/w^2 = (1 + w^2)^2 gives a gain crossover of 1 rad/s and a phase
    // margin of pi/2 - 2 atan 1 = 0. The phase crossover is 1 rad/s too, with |L| = 2/(1 (1+1)) = 1.
    #[test]
    fn limit_of_stability_by_hand() {
        let process = Soiptd::new(2.0, 1.0, 1.0, 0.0).unwrap();
        let m = margins(&process, Pd { kp: 1.0, kd: 0.0 }).unwrap();
        assert!(close(m.gain_crossover_rad_per_s, 1.0, 1e-15));
        assert!(m.phase_margin_rad.abs() < 1e-15 && m.delay_margin_s.abs() < 1e-15);
        assert!(close(m.phase_crossover_rad_per_s.unwrap(), 1.0, 1e-15));
        assert!(close(m.gain_margin.unwrap(), 1.0, 1e-15));
    }

    // Double integrator, A = 1, Kp = 1, Kd = 2, T_prop = 1/2, no dead time. The phase above -pi is atan(2 w) -
    // atan(w/2) > 0 at every w: no phase crossover, stable at every gain. With T_prop = 4 the phase above -pi is
    // negative at every w: unstable at every gain.
    #[test]
    fn double_integrators_without_delay_have_no_gain_limit() {
        for (t_prop, stable) in [(0.5, true), (4.0, false)] {
            let process = Soiptd::from_acceleration_gain(1.0, t_prop, 0.0, 0.0).unwrap();
            let m = margins(&process, Pd { kp: 1.0, kd: 2.0 }).unwrap();
            assert_eq!((m.gain_margin, m.phase_crossover_rad_per_s), (None, None));
            assert_eq!(m.is_stable(), stable);
        }
    }

    // With lags of 1e-12 s the process is K e^(-tau s)/s. At K Kp = 1/s the gain crossover is 1 rad/s, the phase margin
    // pi/2 - tau, the phase crossover pi/(2 tau) rad/s, the gain margin pi/(2 tau).
    #[test]
    fn integrator_with_delay_by_hand() {
        let process = Soiptd::new(1.0, 1e-12, 1e-12, 0.25).unwrap();
        let m = margins(&process, Pd { kp: 1.0, kd: 0.0 }).unwrap();
        assert!(close(m.gain_crossover_rad_per_s, 1.0, 1e-11));
        assert!(close(m.phase_margin_rad, FRAC_PI_2 - 0.25, 1e-11));
        assert!(close(
            m.phase_crossover_rad_per_s.unwrap(),
            FRAC_PI_2 / 0.25,
            1e-10
        ));
        assert!(close(m.gain_margin.unwrap(), FRAC_PI_2 / 0.25, 1e-10));
        assert!(close(m.delay_margin_s, FRAC_PI_2 - 0.25, 1e-11));
    }

    #[test]
    fn wrong_or_meaningless_gains_have_no_margins() {
        let process = Soiptd::new(1.0, 0.1, 1.0, 0.05).unwrap();
        for (kp, kd) in [
            (0.0, 1.0),
            (-1.0, 1.0),
            (f64::NAN, 1.0),
            (1.0, f64::INFINITY),
        ] {
            assert_eq!(margins(&process, Pd { kp, kd }), None, "{kp} {kd}");
        }
        let mirrored = process.with_gain_scaled(-1.0).unwrap();
        let pd = Pd { kp: 2.0, kd: 1.0 };
        let negative = Pd { kp: -2.0, kd: -1.0 };
        assert_eq!(margins(&mirrored, negative), margins(&process, pd));
        assert_eq!(margins(&mirrored, pd), None);
    }
}
