//! Settings as C sees them: flat, every unit in its name.

use onecycle_onboard::control::PdLaw;
use onecycle_onboard::guard::Limits;
use onecycle_onboard::relay::{RelayError, RelaySettings};
use onecycle_onboard::tuner::{TakeOffSettings, TunerError, TunerSettings};

/// How an axis is tuned; start from onecycle_settings_default.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct OnecycleSettings {
    /// Half the jump of the relay's output (input unit).
    pub amplitude: f32,
    /// Sine of the phase of the oscillation, between -1 and 1.
    pub beta: f32,
    /// Time for which the noise is measured with zero relay output (s); 0 starts at once.
    pub preroll_s: f32,
    /// Noise of the measurement, or its least value when there is a pre-roll (output unit).
    pub noise_sigma: f32,
    /// Share of the measured bias that the trim takes up each cycle; 0 switches it off.
    pub trim_gain: f32,
    /// What the trim leaves between the parts of a cycle with the relay high and low.
    pub asymmetry: f32,
    /// Time between ticks (s).
    pub sample_s: f32,
    /// Cycles that are used together, 1 to 4.
    pub cycles: u8,
    /// Looks at cycles that may be refused before the test ends.
    pub attempts: u8,
    /// Slices of the identification in a tick, each of up to 2,700 operations in double precision; 1 where
    /// those are emulated.
    pub slices: u16,
    /// Whether the test begins with a take-off from the ground.
    pub take_off: bool,
    /// Gain of the take-off's integrator (input unit / (output unit s)).
    pub take_off_gain: f32,
    /// Rate of the output above which that integrator waits (output unit / s).
    pub take_off_climb: f32,
    /// Largest distance of the output from the reference (output unit); INFINITY for none.
    pub limit_excursion: f32,
    /// Largest rate of the output (output unit / s); INFINITY for none.
    pub limit_rate: f32,
    /// Longest test (s); INFINITY for none.
    pub limit_duration_s: f32,
    /// Longest time without a switch of the relay (s); INFINITY for none.
    pub limit_no_switch_s: f32,
    /// Oldest sample and longest time between ticks (s); INFINITY for none.
    pub limit_stale_s: f32,
    /// Least output (input unit).
    pub output_lowest: f32,
    /// Largest output (input unit).
    pub output_highest: f32,
    /// Proportional gain of the safe controller (input unit / output unit).
    pub safe_kp: f32,
    /// Derivative gain of the safe controller (input unit s / output unit).
    pub safe_kd: f32,
    /// Output of the safe controller at rest (input unit).
    pub safe_offset: f32,
    /// Time constant of the means under the safe controller, of its output, which the relay is offset by, and
    /// of the process's, which it oscillates about (s); 0 for none.
    pub bias_filter_s: f32,
    /// Lag of a rate that is found from differences (s).
    pub rate_lag_s: f32,
}

/// Whether there is a tuner, or what is wrong with its settings.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum OnecycleStatus {
    /// There is.
    Ok,
    /// A pointer is null.
    Null,
    /// The relay's amplitude is not positive.
    RelayAmplitude,
    /// beta is not between -1 and 1.
    RelayBeta,
    /// The asymmetry is not between 0 and 1.
    RelayAsymmetry,
    /// Another number of the relay is negative or not finite.
    RelaySetting,
    /// A time, a gain or a limit that must be positive is not.
    Setting,
    /// The cycles are not 1 to 4.
    Cycles,
    /// There are no attempts, or no slices.
    NoWork,
    /// The least output is not below the largest.
    OutputLimits,
    /// The safe controller has a number that is not finite.
    Safe,
    /// The data that is built in cannot be read: the build is broken.
    Pack,
}

impl From<TunerError> for OnecycleStatus {
    fn from(error: TunerError) -> Self {
        match error {
            TunerError::Relay(RelayError::Amplitude(_)) => Self::RelayAmplitude,
            TunerError::Relay(RelayError::Beta(_)) => Self::RelayBeta,
            TunerError::Relay(RelayError::Asymmetry(_)) => Self::RelayAsymmetry,
            TunerError::Relay(RelayError::Setting(..)) => Self::RelaySetting,
            TunerError::Setting(..) => Self::Setting,
            TunerError::Cycles(_) => Self::Cycles,
            TunerError::NoWork => Self::NoWork,
            TunerError::OutputLimits(..) => Self::OutputLimits,
            TunerError::Safe => Self::Safe,
            TunerError::Pack => Self::Pack,
        }
    }
}

impl OnecycleSettings {
    pub(crate) fn new(amplitude: f32, sample_s: f32) -> Self {
        let new = TunerSettings::new(amplitude, sample_s);
        Self {
            amplitude,
            beta: new.relay.beta,
            preroll_s: new.relay.preroll_s,
            noise_sigma: new.relay.noise_sigma,
            trim_gain: new.relay.trim_gain,
            asymmetry: new.relay.asymmetry,
            sample_s,
            cycles: new.cycles,
            attempts: new.attempts,
            slices: new.slices,
            take_off: false,
            take_off_gain: 0.0,
            take_off_climb: 0.0,
            limit_excursion: new.limits.excursion,
            limit_rate: new.limits.rate,
            limit_duration_s: new.limits.duration_s,
            limit_no_switch_s: new.limits.no_switch_s,
            limit_stale_s: new.limits.stale_s,
            output_lowest: new.output_lowest,
            output_highest: new.output_highest,
            safe_kp: new.safe.kp,
            safe_kd: new.safe.kd,
            safe_offset: new.safe.offset,
            bias_filter_s: new.bias_filter_s,
            rate_lag_s: new.rate_lag_s,
        }
    }

    pub(crate) fn to_settings(self) -> TunerSettings {
        let new = TunerSettings::new(self.amplitude, self.sample_s);
        TunerSettings {
            relay: RelaySettings {
                beta: self.beta,
                preroll_s: self.preroll_s,
                noise_sigma: self.noise_sigma,
                trim_gain: self.trim_gain,
                asymmetry: self.asymmetry,
                ..new.relay
            },
            cycles: self.cycles,
            attempts: self.attempts,
            slices: self.slices,
            take_off: self.take_off.then_some(TakeOffSettings {
                gain: self.take_off_gain,
                climb: self.take_off_climb,
            }),
            limits: Limits {
                excursion: self.limit_excursion,
                rate: self.limit_rate,
                duration_s: self.limit_duration_s,
                no_switch_s: self.limit_no_switch_s,
                stale_s: self.limit_stale_s,
            },
            output_lowest: self.output_lowest,
            output_highest: self.output_highest,
            safe: PdLaw {
                kp: self.safe_kp,
                kd: self.safe_kd,
                offset: self.safe_offset,
            },
            bias_filter_s: self.bias_filter_s,
            rate_lag_s: self.rate_lag_s,
            ..new
        }
    }
}
