//! Open loop `L(jw) = (Kp + j w Kd) G(jw)` at a frequency, for Bode and Nyquist plots.
//!
//! The phase of `L` where its magnitude is 1 is the constraint of the paper's equations 12 and 13 (Ayyad, Chehadeh,
//! Awad, Zweiri 2020). The crossovers are those of [`margins`](crate::soiptd_pd::margins::margins()).

use std::f64::consts::PI;

use onecycle_onboard::{Pd, Soiptd};

use crate::soiptd_pd::open_loop::OpenLoop;

/// Open loop at one frequency: controller times process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopResponse {
    /// Magnitude `|L(jw)|` (1). It falls monotonically with the frequency.
    pub magnitude: f64,
    /// Unwrapped phase of `L(jw)` (rad). It starts at `-pi/2` (`-pi` without damping); a long dead time takes it down
    /// by several turns.
    pub phase_rad: f64,
}

/// Open loop of `process` under `pd` at a frequency (rad/s).
///
/// `None` if the frequency is not positive and finite, or if the proportional gain is zero or has the wrong sign (then
/// [`margins`](crate::soiptd_pd::margins::margins()) returns `None` too).
#[must_use]
pub fn loop_response(process: &Soiptd, pd: Pd, omega_rad_per_s: f64) -> Option<LoopResponse> {
    let open_loop = OpenLoop::new(process, pd)?;
    let is_frequency = omega_rad_per_s > 0.0 && omega_rad_per_s.is_finite();
    is_frequency.then(|| LoopResponse {
        magnitude: open_loop.magnitude(omega_rad_per_s),
        phase_rad: open_loop.phase_above_minus_pi(omega_rad_per_s) - PI,
    })
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::soiptd_pd::margins::margins;

    /// The paper's hexacopter at its optimum; the slowest multirotor; a double integrator; a dead time that turns the
    /// phase by many turns; a process of negative gain under negative gains.
    fn loops() -> Vec<(Soiptd, Pd)> {
        let pd = |kp, kd| Pd { kp, kd };
        let double = Soiptd::from_acceleration_gain(3.0, 0.05, 0.0, 0.02).unwrap();
        let hexacopter = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
        vec![
            (hexacopter, pd(192.918, 29.523)),
            (Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap(), pd(8.5096, 6.9966)),
            (double, pd(4.0, 2.0)),
            (Soiptd::new(2.0, 0.1, 1.0, 5.0).unwrap(), pd(0.1, 0.02)),
            (hexacopter.with_gain_scaled(-2.0).unwrap(), pd(-50.0, -9.0)),
        ]
    }

    // Equals the complex product exp(-j w tau) (Kp + j w Kd) A / (j w (j w T_prop + 1)(j w + 1/T_body)) to a relative
    // 1e-12. The largest phase is about 60 rad, where a few ulp are 3e-14.
    #[test]
    fn it_is_the_product_of_complex_numbers() {
        for (process, pd) in loops() {
            for omega in [0.01, 0.3, 1.0, 4.0, 12.0] {
                let s = Complex64::new(0.0, omega);
                let expected =
                    (-s * process.tau_s()).exp() * (s * pd.kd + pd.kp) * process.k_over_t_body()
                        / (s * (s * process.t_prop_s() + 1.0) * (s + process.inv_t_body_per_s()));
                let found = loop_response(&process, pd, omega).unwrap();
                let complex = Complex64::from_polar(found.magnitude, found.phase_rad);
                let off = (complex - expected).norm() / expected.norm();
                assert!(off < 1e-12, "{process:?} {omega} {off:e}");
            }
        }
    }

    // The unwrapped phase starts at -pi/2 (-pi without damping) and changes by less than pi/4 between frequencies 0.1 %
    // apart. With a dead time of 5 s it falls below -6 pi at 12 rad/s.
    #[test]
    fn the_phase_has_no_jumps() {
        for (process, pd) in loops() {
            let phase = |omega| loop_response(&process, pd, omega).unwrap().phase_rad;
            let start = if process.inv_t_body_per_s() > 0.0 {
                -0.5 * PI
            } else {
                -PI
            };
            assert!((phase(1e-9) - start).abs() < 1e-7, "{}", phase(1e-9));
            let mut last = phase(1e-3);
            for k in 1..9400 {
                let next = phase(1e-3 * (1e-3 * f64::from(k)).exp());
                assert!((next - last).abs() < 0.25 * PI, "{process:?} {k}");
                last = next;
            }
            if process.tau_s() == 5.0 {
                assert!(last < -6.0 * PI, "{last}");
            }
        }
    }

    // Definition of the margins: |L| = 1 and phase -pi + PM at the gain crossover; phase -pi and |L| = 1/GM at the
    // phase crossover. To 1e-12, since the roots are exact to one or two ulp.
    #[test]
    fn it_has_the_margins() {
        let mut phase_crossovers = 0;
        for (process, pd) in loops() {
            let m = margins(&process, pd).unwrap();
            let at = loop_response(&process, pd, m.gain_crossover_rad_per_s).unwrap();
            assert!((at.magnitude - 1.0).abs() < 1e-12, "{at:?}");
            assert!((at.phase_rad + PI - m.phase_margin_rad).abs() < 1e-12);
            if let Some(omega) = m.phase_crossover_rad_per_s {
                let at = loop_response(&process, pd, omega).unwrap();
                assert!((at.phase_rad + PI).abs() < 1e-12, "{at:?}");
                assert!((at.magnitude * m.gain_margin.unwrap() - 1.0).abs() < 1e-12);
                phase_crossovers += 1;
            }
        }
        // All five loops have dead time, so the phase of each falls below -pi at some frequency.
        assert_eq!(phase_crossovers, 5);
    }

    #[test]
    fn wrong_gains_and_frequencies_have_none() {
        let process = Soiptd::new(1.0, 0.1, 1.0, 0.05).unwrap();
        for (kp, kd) in [
            (0.0, 1.0),
            (-1.0, 1.0),
            (f64::NAN, 1.0),
            (1.0, f64::INFINITY),
        ] {
            assert_eq!(
                loop_response(&process, Pd { kp, kd }, 1.0),
                None,
                "{kp} {kd}"
            );
        }
        let mirrored = process.with_gain_scaled(-1.0).unwrap();
        let pd = Pd { kp: 2.0, kd: 1.0 };
        assert_eq!(loop_response(&mirrored, pd, 1.0), None);
        for omega in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(loop_response(&process, pd, omega), None, "{omega}");
        }
    }
}
