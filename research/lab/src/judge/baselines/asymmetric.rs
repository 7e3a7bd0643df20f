//! The asymmetric relay test (J. Berner, T. Hagglund, K. J. Astrom, "Asymmetric relay autotuning -
//! Practical features for industrial use", Control Engineering Practice 54, 2016; J. Berner, "Automatic
//! controller tuning using relay-based model identification", thesis, Lund 2017).
//!
//! A relay with the levels `+d1` and `-d2` about the operating point and the hysteresis `h` oscillates
//! with `t_on` high and `t_off` low. For an integrator with dead time
//!
//! ```text
//! Kv e^(-L s)/s:          Kv = (y_max - y_min) / (d1 t_on)                     exactly
//!                         L = (d1 t_on - 2 h/Kv) / (d1 + d2)                   exactly
//! ```
//!
//! The published method chooses between this model and one of first order by the normalised dead time
//! `L/(L + T)`. The processes here integrate, so their half periods are in the ratio of the levels, the
//! normalised dead time is zero and this model is the one that the method takes; its dead time takes up the
//! two lags. It matches the process at the frequency where its phase is about -180 degrees.
//!
//! Measured on 50 random processes of the paper's domain: cost 65 % on average and 170 % at worst, even
//! without noise and bias; none is unstable.
//!
//! The published test begins at an equilibrium. Here there may be an unknown constant input. The input of an
//! integrator is zero on average, so the constant input is minus the mean output of the relay, and the
//! levels are counted from there. The gain is taken from the peaks, not from the integral of the output: the
//! integral determines the gain by an asymmetry that a bias may cancel.

use onecycle_onboard::Soiptd;

use super::{BaselineAnswer, BaselineError, steady_cycles};
use onecycle_identify::Signals;

/// Lags of the process that represents an integrator with dead time, over the dead time: too short to
/// matter to a controller.
const NO_LAG: f64 = 1e-6;

/// Half periods and levels of the oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfPeriods {
    /// Time with the relay high (s).
    pub on_s: f64,
    /// Time with it low (s).
    pub off_s: f64,
    /// High level above the operating point, `d1` (input unit).
    pub above: f64,
    /// Low level below it, `d2` (input unit).
    pub below: f64,
    /// Hysteresis (output unit).
    pub hysteresis: f64,
    /// Peak-to-peak output (output unit).
    pub output_span: f64,
}

impl HalfPeriods {
    /// Measures the means of the last steady cycles, `cycles` at most, of a relay that began at an
    /// equilibrium with reference and input zero.
    ///
    /// # Errors
    /// [`BaselineError::NoOscillation`], [`BaselineError::Uneven`].
    pub fn measure(
        signals: &Signals<'_>,
        hysteresis: f64,
        cycles: usize,
    ) -> Result<Self, BaselineError> {
        let (found, _) = steady_cycles(signals, cycles)?;
        Ok(Self {
            on_s: found.duty * found.period_s,
            off_s: (1.0 - found.duty) * found.period_s,
            above: found.relay_amplitude + found.relay_centre,
            below: found.relay_amplitude - found.relay_centre,
            hysteresis,
            output_span: 2.0 * found.amplitude,
        })
    }

    /// The same half periods with the levels counted from the mean input: the operating point of an
    /// integrator.
    #[must_use]
    pub fn balanced(self) -> Self {
        let mean = (self.above * self.on_s - self.below * self.off_s) / (self.on_s + self.off_s);
        Self {
            above: self.above - mean,
            below: self.below + mean,
            ..self
        }
    }

    /// The integrator with dead time, as a process with lags of a millionth of the dead time.
    ///
    /// # Errors
    /// [`BaselineError::NotThisProcess`] if the dead time or the gain is not positive.
    pub fn integrator(&self) -> Result<Soiptd, BaselineError> {
        let rise = self.above * self.on_s;
        let gain = self.output_span / rise;
        let delay_s = (rise - 2.0 * self.hysteresis / gain) / (self.above + self.below);
        if !(gain > 0.0 && delay_s > 0.0) {
            return Err(BaselineError::NotThisProcess(
                "its dead time is not positive",
            ));
        }
        let lag_s = NO_LAG * delay_s;
        Ok(Soiptd::new(gain, lag_s, lag_s, delay_s)?)
    }
}

/// Identifies an integrator with dead time from the recording of an
/// [`AsymmetricRelay`](crate::experiments::relays::AsymmetricRelay) with this hysteresis (output unit),
/// from the means of the last steady cycles, `cycles` at most, and designs its PD of least ISE at a
/// phase margin (rad).
///
/// # Errors
/// Those of [`HalfPeriods::measure`] and [`HalfPeriods::integrator`].
pub fn identify(
    signals: &Signals<'_>,
    hysteresis: f64,
    cycles: usize,
    phase_margin_rad: f64,
) -> Result<BaselineAnswer, BaselineError> {
    let half_periods = HalfPeriods::measure(signals, hysteresis, cycles)?;
    let process = half_periods.balanced().integrator()?;
    BaselineAnswer::of_process(process, phase_margin_rad)
}
