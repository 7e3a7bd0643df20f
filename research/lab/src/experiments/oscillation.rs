//! The relay oscillation of a process without bias, noise and defect: the unit in which experiments
//! count time and output.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use onecycle_design::Linear;
use onecycle_onboard::Soiptd;

use crate::space::limit_cycle::symmetric;

/// Period and amplitude of a relay oscillation; the relay's amplitude is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation {
    /// Period (s).
    pub period_s: f64,
    /// Half the peak-to-peak output (output unit).
    pub amplitude: f64,
}

/// Frequency at which the search for a phase starts (rad/s); it ends at the inverse.
const SLOWEST_RAD_PER_S: f64 = 1e-6;
/// Ratio of two frequencies of the search: between them the phase is a straight line to 1e-4.
const FREQUENCY_STEP: f64 = 1.01;

impl Oscillation {
    /// The exact limit cycle under a relay with this `beta`; `None` if there is none.
    #[must_use]
    pub fn exact(process: &Soiptd, beta: f64) -> Option<Self> {
        symmetric(process, beta).map(|cycle| Self {
            period_s: cycle.period_s(),
            amplitude: cycle.amplitude,
        })
    }

    /// The oscillation that the describing function predicts; `None` if it predicts none.
    #[must_use]
    pub fn approximate(process: &Soiptd, beta: f64) -> Option<Self> {
        let (omega, amplitude) = process.describing_function_oscillation(1.0, beta)?;
        Some(Self {
            period_s: TAU / omega,
            amplitude,
        })
    }

    /// As [`Self::approximate`], for any process: the lowest frequency at which the unwrapped phase is that of the relay.
    #[must_use]
    pub fn of_linear(process: &Linear, beta: f64) -> Option<Self> {
        let target_rad = beta.asin() - PI;
        let mut omega = SLOWEST_RAD_PER_S;
        let mut phase_rad = -FRAC_PI_2 * process.structure().stages().integrators as f64;
        while omega < 1.0 / SLOWEST_RAD_PER_S {
            let next = omega * FREQUENCY_STEP;
            let turn = process.frequency_response(next).arg() - phase_rad;
            let step_rad = turn - TAU * (turn / TAU).round();
            if phase_rad + step_rad <= target_rad {
                let part = (target_rad - phase_rad) / step_rad;
                let omega = omega * FREQUENCY_STEP.powf(part);
                return Some(Self {
                    period_s: TAU / omega,
                    amplitude: 4.0 / PI * process.frequency_response(omega).norm(),
                });
            }
            (omega, phase_rad) = (next, phase_rad + step_rad);
        }
        None
    }

    /// As [`Self::approximate`], for a relay that is fed the rate instead of the output; the amplitude
    /// is that of the rate (output unit / s).
    #[must_use]
    pub fn of_rate(process: &Soiptd, beta: f64) -> Option<Self> {
        let omega = process.frequency_at_phase(beta.asin() - PI - FRAC_PI_2)?;
        Some(Self {
            period_s: TAU / omega,
            amplitude: 4.0 / PI * omega * process.magnitude(omega),
        })
    }
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Linear, Parameter, Structure};

    use super::*;

    // The closed form of an integrator with two lags; e^(-s/2)/s has a phase of -pi at pi rad/s, where its magnitude is 1/pi.
    #[test]
    fn any_process_oscillates_as_its_describing_function_says() {
        let process = Soiptd::new(2.0, 0.05, 1.0, 0.02).unwrap();
        let (found, exact) = (
            Oscillation::of_linear(&Linear::from(process), -0.73).unwrap(),
            Oscillation::approximate(&process, -0.73).unwrap(),
        );
        assert!((found.period_s / exact.period_s - 1.0).abs() < 1e-4);
        assert!((found.amplitude / exact.amplitude - 1.0).abs() < 1e-3);
        let half = |parameter| {
            Some(if parameter == Parameter::Tau {
                0.5
            } else {
                1.0
            })
        };
        let process = Linear::from_parameters(Structure::Iptd, half).unwrap();
        let found = Oscillation::of_linear(&process, 0.0).unwrap();
        assert!((found.period_s - 2.0).abs() < 1e-4, "{found:?}");
        assert!((found.amplitude - 4.0 / PI / PI).abs() < 1e-4, "{found:?}");
        let process = process.with_tau_s(0.0);
        assert_eq!(Oscillation::of_linear(&process, -0.73), None);
    }
}
