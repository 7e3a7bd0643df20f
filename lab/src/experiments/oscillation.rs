//! The relay oscillation of a process without bias, noise and defect: the unit in which experiments
//! count time and output.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

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
