//! Settings for C: a flat structure.

use onecycle_onboard::control::PdLaw;
use onecycle_onboard::guard::Limits;
use onecycle_onboard::relay::{RelayError, RelaySettings};
use onecycle_onboard::tuner::{
    CheckedSettings, Consent, TakeOffSettings, TunerError, TunerSettings,
};

/// Version of these settings. It changes with every change of their meaning.
pub const ONECYCLE_SETTINGS_VERSION: u32 = 1;

/// A controller that was found is put in force when onecycle_tuner_accept says so.
pub const ONECYCLE_CONSENT_ASK: u8 = 0;
/// It is only proposed.
pub const ONECYCLE_CONSENT_NEVER: u8 = 1;
/// It is put in force at once.
pub const ONECYCLE_CONSENT_AUTOMATIC: u8 = 2;

/// Settings of a tuner. Start from onecycle_settings_default.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct OnecycleSettings {
    /// Size of this structure (bytes) and version, set by onecycle_settings_default: a library with other settings refuses
    /// them.
    pub size: u32,
    /// ONECYCLE_SETTINGS_VERSION of the header.
    pub version: u32,
    /// Half the jump of the relay's output (input unit), above zero.
    pub amplitude: f32,
    /// Sine of the phase of the oscillation, between -1 and 1.
    pub beta: f32,
    /// Time during which the noise is measured with zero relay output (s); 0 starts at once.
    pub preroll_s: f32,
    /// Standard deviation of the measurement noise (output unit); with a pre-roll its lower limit. At zero the
    /// relay chatters on sensor noise.
    pub noise_sigma: f32,
    /// Share of the measured bias that the trim removes per cycle; 0 switches the trim off.
    pub trim_gain: f32,
    /// Asymmetry that the trim keeps: time high minus time low over the period, 0 to 1.
    pub asymmetry: f32,
    /// Time between ticks (s).
    pub sample_s: f32,
    /// Number of cycles that are fitted together, 1 to 4.
    pub cycles: u8,
    /// Maximum number of identification attempts.
    pub attempts: u8,
    /// Slices of the identification per tick, each of up to 2,700 operations in double precision. Use 1 where
    /// double precision is emulated, 0 if onecycle_tuner_work does them in another thread.
    pub slices: u16,
    /// Whether the test begins with a take-off from the ground.
    pub take_off: bool,
    /// Gain of the take-off integrator (input unit / (output unit s)).
    pub take_off_gain: f32,
    /// Rate of the output above which the take-off integrator holds (output unit / s).
    pub take_off_climb: f32,
    /// Largest distance of the output from the reference (output unit); INFINITY switches the limit off.
    pub limit_excursion: f32,
    /// Largest rate of the output (output unit / s); INFINITY switches the limit off.
    pub limit_rate: f32,
    /// Longest test (s); INFINITY switches the limit off.
    pub limit_duration_s: f32,
    /// Longest time without a switch of the relay (s); INFINITY switches the limit off.
    pub limit_no_switch_s: f32,
    /// Largest age of a sample and longest time between ticks (s); INFINITY switches the limit off.
    pub limit_stale_s: f32,
    /// Lower limit of the output (input unit).
    pub output_lowest: f32,
    /// Upper limit of the output (input unit).
    pub output_highest: f32,
    /// Proportional gain of the safe controller (input unit / output unit).
    pub safe_kp: f32,
    /// Derivative gain of the safe controller (input unit s / output unit).
    pub safe_kd: f32,
    /// Output of the safe controller at rest (input unit).
    pub safe_offset: f32,
    /// Time constant of the means under the safe controller (s). The mean of its output becomes the offset of
    /// the relay, the mean of the process's output the reference of the test; 0 switches this off.
    pub bias_filter_s: f32,
    /// Time constant of the filter for a rate that is computed from differences (s).
    pub rate_lag_s: f32,
    /// Delay of the measured rate behind the value (s), as by the low-pass of a gyro beside an estimated angle.
    pub rate_delay_s: f32,
    /// Phase of the integral beside the controller found (rad), 0 to 0.349; 0 switches the integral off. At 0.087, the
    /// default, the phase margin of a multirotor loses 0.3 degrees at most.
    pub integral_phase_rad: f32,
    /// Second amplitude of the relay as a part of the first, 0.3 to 0.8, usually 0.6: the test goes on with one cycle there
    /// and ends with the reason amplitude_dependent if the gain changes with the amplitude. 0, the default, switches it off.
    pub second_amplitude: f32,
    /// What happens with a controller that was found: ONECYCLE_CONSENT_ASK, the default, _NEVER or _AUTOMATIC.
    pub consent: u8,
}

/// Status of an initialisation.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum OnecycleStatus {
    /// Settings accepted; the tuner is ready.
    Ok,
    /// A pointer is null.
    Null,
    /// The amplitude of the relay is not positive.
    RelayAmplitude,
    /// beta is not between -1 and 1.
    RelayBeta,
    /// The asymmetry is not between 0 and 1.
    RelayAsymmetry,
    /// Another setting of the relay is negative or not finite.
    RelaySetting,
    /// A time or a gain is not positive.
    Setting,
    /// The number of cycles is not 1 to 4.
    Cycles,
    /// The number of attempts is zero.
    NoWork,
    /// The output limits are not set, or the lower one is not below the upper one.
    OutputLimits,
    /// A gain or the offset of the safe controller is not finite.
    Safe,
    /// The pack cannot be read; if it is the embedded one, the build is broken.
    Pack,
    /// The phase of the integral is larger than 0.349 rad.
    IntegralPhase,
    /// A gain is not finite.
    Gain,
    /// Two gains have opposite signs.
    GainSigns,
    /// The time of the measurement filter is negative or not finite.
    Filter,
    /// The set-point weight is not between 0 and 1.
    SetpointWeight,
    /// The second amplitude of the relay is not 0 or 0.3 to 0.8.
    SecondAmplitude,
    /// A limit of the test is not set or not positive.
    Limit,
    /// Size or version of the settings are those of another header, or they were not begun with onecycle_settings_default.
    Version,
    /// The consent is not one of the constants.
    Consent,
}

impl From<TunerError> for OnecycleStatus {
    fn from(error: TunerError) -> Self {
        match error {
            TunerError::Relay(RelayError::Amplitude(_)) => Self::RelayAmplitude,
            TunerError::Relay(RelayError::Beta(_)) => Self::RelayBeta,
            TunerError::Relay(RelayError::Asymmetry(_)) => Self::RelayAsymmetry,
            TunerError::Relay(RelayError::Setting(..)) => Self::RelaySetting,
            TunerError::Setting(..) => Self::Setting,
            TunerError::Limit(..) => Self::Limit,
            TunerError::IntegralPhase(_) => Self::IntegralPhase,
            TunerError::SecondAmplitude(_) => Self::SecondAmplitude,
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
            size: size_of::<Self>() as u32,
            version: ONECYCLE_SETTINGS_VERSION,
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
            rate_delay_s: new.rate_delay_s,
            integral_phase_rad: new.integral_phase_rad,
            second_amplitude: new.second_amplitude,
            consent: ONECYCLE_CONSENT_ASK,
        }
    }

    pub(crate) fn checked(&self) -> Result<CheckedSettings, OnecycleStatus> {
        if (self.size, self.version) != (size_of::<Self>() as u32, ONECYCLE_SETTINGS_VERSION) {
            return Err(OnecycleStatus::Version);
        }
        let consent = match self.consent {
            ONECYCLE_CONSENT_ASK => Consent::Ask,
            ONECYCLE_CONSENT_NEVER => Consent::Never,
            ONECYCLE_CONSENT_AUTOMATIC => Consent::Automatic,
            _ => return Err(OnecycleStatus::Consent),
        };
        let settings = TunerSettings {
            consent,
            ..self.to_settings()
        };
        settings.checked().map_err(OnecycleStatus::from)
    }

    fn to_settings(self) -> TunerSettings {
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
            rate_delay_s: self.rate_delay_s,
            integral_phase_rad: self.integral_phase_rad,
            second_amplitude: self.second_amplitude,
            ..new
        }
    }
}
