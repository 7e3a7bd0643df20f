//! The asymmetric relay test (J. Berner, T. Hagglund, K. J. Astrom, "Asymmetric relay autotuning -
//! Practical features for industrial use", Control Engineering Practice 54, 2016; J. Berner, "Automatic
//! controller tuning using relay-based model identification", thesis, Lund 2017).
//!
//! A relay with the levels `+d1` and `-d2` about the operating point and the hysteresis `h` oscillates
//! with `t_on` high and `t_off` low. With `gamma = max(d1, d2)/min(d1, d2)` and
//! `rho = max(t_on, t_off)/min(t_on, t_off)`:
//!
//! ```text
//! L/(L + T) = (gamma - rho) / ((gamma - 1)(0.35 rho + 0.65))                   approximately
//!
//! K e^(-L s)/(T s + 1):   K = integral of y / integral of u                    exactly
//!                         T = t_on / ln((h/K - d2 + e^(L/T) (d1 + d2)) / (d1 - h/K))
//!
//! Kv e^(-L s)/s:          Kv = (y_max - y_min) / (d1 t_on)                     exactly
//!                         L = (d1 t_on - 2 h/Kv) / (d1 + d2)                   exactly
//! ```
//!
//! The processes here integrate, so their half periods are in the ratio of the levels, the normalised
//! dead time is zero and the second model is the one that the method takes: the two lags end up in its
//! dead time. It is that of the frequency where the phase of the process is about -180 degrees.
//!
//! What that costs is the method's: on 50 random processes of the paper's domain 65 % on average and 170 %
//! at worst even without noise and bias, none unstable.
//!
//! The published test begins at an equilibrium. Here there may be an unknown constant input; since the
//! input of an integrator is zero on average, it is what the relay's output lacks to that, and the levels
//! are counted from there. The gain is taken from the peaks, not from the integral of the output, which
//! tells it by an asymmetry that such a bias may cancel.

use onecycle_onboard::Soiptd;

use super::{BaselineAnswer, BaselineError, steady_cycles};
use onecycle_identify::Signals;

/// The lags of the process that stands for an integrator with dead time, over the dead time: far below
/// all that a controller sees of it.
const NO_LAG: f64 = 1e-6;

/// A process of first order with dead time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrder {
    /// Static gain (output unit / input unit).
    pub gain: f64,
    /// Time constant (s).
    pub lag_s: f64,
    /// Dead time (s).
    pub delay_s: f64,
}

/// What the method reads off the oscillation.
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
    /// Integral of the output over a period, from the reference (output unit s).
    pub output_integral: f64,
    /// Peak-to-peak output (output unit).
    pub output_span: f64,
}

impl HalfPeriods {
    /// Means of the last steady cycles, `cycles` at most, of a relay that began at an equilibrium at the
    /// reference zero with the input zero.
    ///
    /// # Errors
    /// [`BaselineError::NoOscillation`], [`BaselineError::Uneven`].
    pub fn measure(
        signals: &Signals<'_>,
        hysteresis: f64,
        cycles: usize,
    ) -> Result<Self, BaselineError> {
        let (found, window) = steady_cycles(signals, cycles)?;
        let sum: f64 = signals.output[window].iter().sum();
        Ok(Self {
            on_s: found.duty * found.period_s,
            off_s: (1.0 - found.duty) * found.period_s,
            above: found.relay_amplitude + found.relay_centre,
            below: found.relay_amplitude - found.relay_centre,
            hysteresis,
            output_integral: sum * signals.sample_period_s / found.cycles_used as f64,
            output_span: 2.0 * found.amplitude,
        })
    }

    /// The same with the operating point where the input of an integrator is zero on average.
    #[must_use]
    pub fn balanced(self) -> Self {
        let mean = (self.above * self.on_s - self.below * self.off_s) / (self.on_s + self.off_s);
        Self {
            above: self.above - mean,
            below: self.below + mean,
            ..self
        }
    }

    /// `L/(L + T)`: zero of an integrator, one of a pure dead time; the published approximation.
    ///
    /// `None` where the relay is symmetric.
    #[must_use]
    pub fn normalised_dead_time(&self) -> Option<f64> {
        let ratio = |a: f64, b: f64| a.max(b) / a.min(b);
        let gamma = ratio(self.above, self.below);
        let rho = ratio(self.on_s, self.off_s);
        let tau = (gamma - rho) / ((gamma - 1.0) * (0.35 * rho + 0.65));
        tau.is_finite().then_some(tau)
    }

    /// The model of first order.
    ///
    /// # Errors
    /// [`BaselineError::NotThisProcess`] where the half periods are those of no such process.
    pub fn first_order(&self) -> Result<FirstOrder, BaselineError> {
        let no_such =
            BaselineError::NotThisProcess("its half periods are of no process of first order");
        let input_integral = self.above * self.on_s - self.below * self.off_s;
        let gain = self.output_integral / input_integral;
        let Some(tau) = self
            .normalised_dead_time()
            .filter(|tau| (0.0..1.0).contains(tau))
        else {
            return Err(no_such);
        };
        let ratio = tau / (1.0 - tau);
        let threshold = self.hysteresis / gain;
        let growth = (threshold - self.below + ratio.exp() * (self.above + self.below))
            / (self.above - threshold);
        let lag_s = self.on_s / growth.ln();
        if !(gain.is_finite() && lag_s.is_finite() && lag_s > 0.0) {
            return Err(no_such);
        }
        Ok(FirstOrder {
            gain,
            lag_s,
            delay_s: ratio * lag_s,
        })
    }

    /// The integrator with dead time, as a process with lags of a millionth of it.
    ///
    /// # Errors
    /// [`BaselineError::NotThisProcess`] where no dead time is left, or no gain.
    pub fn integrator(&self) -> Result<Soiptd, BaselineError> {
        let rise = self.above * self.on_s;
        let gain = self.output_span / rise;
        let delay_s = (rise - 2.0 * self.hysteresis / gain) / (self.above + self.below);
        if !(gain > 0.0 && delay_s > 0.0) {
            return Err(BaselineError::NotThisProcess("no dead time is left"));
        }
        let lag_s = NO_LAG * delay_s;
        Ok(Soiptd::new(gain, lag_s, lag_s, delay_s)?)
    }
}

/// The integrator with dead time behind the recording of an [`AsymmetricRelay`](crate::experiments::relays::AsymmetricRelay) with this hysteresis
/// (output unit), means of the last steady cycles, `cycles` at most, and its PD of least ISE at a phase
/// margin (rad).
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
