//! What a campaign of recordings combines: processes, test signals, disturbances and loops, as files describe them.

use onecycle_design::{Linear, Parameter, Structure};
use onecycle_identify::Noise;
use onecycle_onboard::{Pd, Relay, RelaySettings};
use onecycle_plant::test_signal::prbs_order;
use onecycle_plant::{
    Bandwidths, Controller, Disturbances, Entry, ExcitedLoop, FilteredPd, Stimulus, TestSignal,
};
use rand::{Rng, RngExt};
use serde::Deserialize;

use super::{MOST_SAMPLES, RecordingError};
use crate::space::{FieldError, Space, first_out_of_range};

/// A value, or the range in which it is uniform.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, or two numbers: the lowest and the highest"
)]
pub enum Span {
    /// A value.
    Value(f64),
    /// Lowest and highest value.
    Range(f64, f64),
}

impl Span {
    pub(in crate::experiments) fn ends(self) -> (f64, f64) {
        match self {
            Self::Value(value) => (value, value),
            Self::Range(low, high) => (low, high),
        }
    }

    /// A random value; takes a number from `rng` for a range only.
    pub(in crate::experiments) fn draw(self, rng: &mut impl Rng) -> f64 {
        match self {
            Self::Value(value) => value,
            Self::Range(low, high) => low + (high - low) * rng.random_range(0.0..=1.0),
        }
    }
}

/// A structure and its parameters, in the units of [`Structure::unit`]. Of several lags `t_prop2_s` is the shortest and
/// `t_body_s` the longest.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the parameters of Parameter, by their keys")]
pub struct ProcessRange {
    /// Structure.
    #[serde(deserialize_with = "structure")]
    pub structure: Structure,
    pub k: Option<Span>,
    pub k_over_t_body: Option<Span>,
    pub t_prop_s: Option<Span>,
    pub t_prop2_s: Option<Span>,
    pub t_body_s: Option<Span>,
    pub natural_frequency_rad_per_s: Option<Span>,
    pub zeta: Option<Span>,
    pub tau_s: Option<Span>,
}

/// A test signal by its name in files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Signal {
    /// Relay in the place of the controller, or beside it.
    #[default]
    Relay,
    /// Step.
    Step,
    /// Doublet.
    Doublet,
    /// 3-2-1-1.
    #[serde(rename = "3-2-1-1")]
    ThreeTwoOneOne,
    /// Pseudo-random binary sequence.
    Prbs,
    /// Exponential chirp over the whole test.
    Chirp,
    /// Sum of sines.
    Multisine,
}

impl Signal {
    /// Name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Relay => "relay",
            Self::Step => "step",
            Self::Doublet => "doublet",
            Self::ThreeTwoOneOne => "3-2-1-1",
            Self::Prbs => "prbs",
            Self::Chirp => "chirp",
            Self::Multisine => "multisine",
        }
    }

    fn has_pulses(self) -> bool {
        matches!(self, Self::Doublet | Self::ThreeTwoOneOne | Self::Prbs)
    }

    fn has_band(self) -> bool {
        matches!(self, Self::Chirp | Self::Multisine)
    }
}

/// A test signal with its settings.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excitation {
    /// Which signal.
    pub signal: Signal,
    /// Amplitude (input unit, or output unit at the set-point).
    pub amplitude: f64,
    /// Lowest and highest frequency of a chirp or a multisine (Hz).
    pub band_hz: Option<[f64; 2]>,
    /// Length of a pulse of a doublet or a 3-2-1-1, or of a bit of a PRBS (s).
    pub pulse_s: Option<f64>,
    /// Parameter of the relay.
    #[serde(default = "distinguishing_beta")]
    pub beta: f64,
}

/// Sines of a multisine.
const SINES: u32 = 12;

pub(in crate::experiments) fn distinguishing_beta() -> f64 {
    Space::MULTIROTOR.beta
}

/// A disturbance: relative to the measurement noise ([`Bandwidths`]), physical ([`Disturbances`]), or both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the fields of Bandwidths and Disturbances")]
pub struct DisturbanceLevel {
    pub w1_rad_per_s: f64,
    pub w0_rad_per_s: f64,
    pub wy_rad_per_s: f64,
    pub input_walk: f64,
    pub input_white: f64,
    pub output_walk: f64,
    pub gust_sigma: f64,
    pub gust_correlation_s: f64,
}

impl DisturbanceLevel {
    /// The disturbances with their names, without those that are zero.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, f64)> {
        [
            ("w1_rad_per_s", self.w1_rad_per_s),
            ("w0_rad_per_s", self.w0_rad_per_s),
            ("wy_rad_per_s", self.wy_rad_per_s),
            ("input_walk", self.input_walk),
            ("input_white", self.input_white),
            ("output_walk", self.output_walk),
            ("gust_sigma", self.gust_sigma),
            ("gust_correlation_s", self.gust_correlation_s),
        ]
        .into_iter()
        .filter(|(_, value)| *value != 0.0)
    }

    pub(in crate::experiments) fn check(&self) -> Result<(), FieldError> {
        for (name, value) in self.named() {
            first_out_of_range([(name, "0 to 1e9", value, within(0.0, 1e9, value))])?;
        }
        let time_s = self.gust_correlation_s;
        let is_right = self.gust_sigma == 0.0 || time_s > 0.0;
        first_out_of_range([("gust_correlation_s", "positive", time_s, is_right)])
    }

    /// The disturbances beside white noise of this standard deviation. `None` if one is given in physical units.
    pub(super) fn relative_noise(&self, sigma: f64) -> Option<Noise> {
        let relative = Self {
            w1_rad_per_s: self.w1_rad_per_s,
            w0_rad_per_s: self.w0_rad_per_s,
            wy_rad_per_s: self.wy_rad_per_s,
            ..Self::default()
        };
        let some = |value: f64| (value > 0.0).then_some(value);
        (*self == relative).then(|| {
            Noise::new(
                sigma,
                some(self.w1_rad_per_s),
                some(self.w0_rad_per_s),
                some(self.wy_rad_per_s),
            )
        })
    }

    pub(in crate::experiments) fn of(
        &self,
        process: &Linear,
        noise_sigma: f64,
        sample_s: f64,
    ) -> Disturbances {
        let mut bandwidths = Bandwidths::default();
        bandwidths.w1_rad_per_s = self.w1_rad_per_s;
        bandwidths.w0_rad_per_s = self.w0_rad_per_s;
        bandwidths.wy_rad_per_s = self.wy_rad_per_s;
        let relative = Disturbances::from_bandwidths(&bandwidths, process, noise_sigma, sample_s);
        // Independent noises: their variances add up.
        Disturbances::default()
            .with_input_walk(self.input_walk.hypot(relative.input_walk))
            .with_input_white(self.input_white.hypot(relative.input_white))
            .with_output_walk(self.output_walk.hypot(relative.output_walk))
            .with_gusts(self.gust_sigma, self.gust_correlation_s)
    }
}

/// Defects of a sensor beside its noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorDefects {
    /// Share of the samples that the sensor drops.
    pub drop_outs: f64,
    /// Share of the samples with an outlier.
    pub outliers: f64,
    /// Size of an outlier, over the noise-free amplitude.
    pub outlier_size: f64,
}

impl SensorDefects {
    pub(super) fn check(&self) -> Result<(), FieldError> {
        let Self {
            drop_outs,
            outliers,
            outlier_size,
        } = *self;
        first_out_of_range([
            (
                "drop_outs",
                "0 to 0.9",
                drop_outs,
                within(0.0, 0.9, drop_outs),
            ),
            ("outliers", "0 to 0.9", outliers, within(0.0, 0.9, outliers)),
            (
                "outlier_size",
                "0 to 1e6",
                outlier_size,
                within(0.0, 1e6, outlier_size),
            ),
        ])
    }
}

/// A PD controller and the place where the test signal enters.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosedLoop {
    /// Proportional gain (input unit / output unit).
    pub kp: f64,
    /// Derivative gain (input unit s / output unit).
    pub kd: f64,
    /// Time constant of the filter of the derivative (s).
    pub filter_s: f64,
    /// Where the test signal enters.
    pub entry: EntryName,
}

impl ClosedLoop {
    pub(super) fn check(&self) -> Result<(), FieldError> {
        let Self {
            kp, kd, filter_s, ..
        } = *self;
        first_out_of_range([
            ("kp", "-1e9 to 1e9", kp, within(-1e9, 1e9, kp)),
            ("kd", "-1e9 to 1e9", kd, within(-1e9, 1e9, kd)),
            ("filter_s", "0 to 1e9", filter_s, within(0.0, 1e9, filter_s)),
        ])
    }
}

pub(in crate::experiments) fn within(low: f64, high: f64, value: f64) -> bool {
    (low..=high).contains(&value)
}

/// Where a test signal enters a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EntryName {
    /// Added to the output of the controller.
    Input,
    /// Added to the reference.
    Setpoint,
}

/// A structure by its name.
fn structure<'de, D: serde::Deserializer<'de>>(file: D) -> Result<Structure, D::Error> {
    let name = String::deserialize(file)?;
    Structure::from_name(&name).ok_or_else(|| {
        let names = Structure::ALL.map(Structure::name).join(", ");
        serde::de::Error::custom(format!(
            "there is no structure `{name}`, expected one of {names}"
        ))
    })
}

pub(super) fn some_structure<'de, D: serde::Deserializer<'de>>(
    file: D,
) -> Result<Option<Structure>, D::Error> {
    structure(file).map(Some)
}

impl ProcessRange {
    fn span(&self, parameter: Parameter) -> Option<Span> {
        match parameter {
            Parameter::K => self.k,
            Parameter::KOverTBody => self.k_over_t_body,
            Parameter::TProp => self.t_prop_s,
            Parameter::TProp2 => self.t_prop2_s,
            Parameter::TBody => self.t_body_s,
            Parameter::NaturalFrequency => self.natural_frequency_rad_per_s,
            Parameter::Zeta => self.zeta,
            Parameter::Tau => self.tau_s,
            _ => None,
        }
    }

    fn process(&self, value: impl Fn(Span) -> f64) -> Result<Linear, RecordingError> {
        let structure = self.structure;
        Linear::from_parameters(structure, |parameter| self.span(parameter).map(&value))
            .map_err(|error| RecordingError::Parameter { structure, error })
    }

    /// A process with parameters drawn one after the other.
    pub(in crate::experiments) fn draw(
        &self,
        rng: &mut impl Rng,
    ) -> Result<Linear, RecordingError> {
        let own = self.structure.parameters().iter();
        let drawn: Vec<_> = own
            .filter_map(|&parameter| Some((parameter, self.span(parameter)?.draw(rng))))
            .collect();
        let structure = self.structure;
        let value = |parameter| Some(drawn.iter().find(|(of, _)| *of == parameter)?.1);
        Linear::from_parameters(structure, value)
            .map_err(|error| RecordingError::Parameter { structure, error })
    }

    pub(in crate::experiments) fn check(&self, sample_rate_hz: f64) -> Result<(), RecordingError> {
        use Parameter::{K, KOverTBody, NaturalFrequency, TBody, TProp, TProp2, Tau, Zeta};
        let structure = self.structure;
        let own = structure.parameters();
        for parameter in [
            K,
            KOverTBody,
            TProp,
            TProp2,
            TBody,
            NaturalFrequency,
            Zeta,
            Tau,
        ] {
            let is_second = parameter == KOverTBody && own.contains(&K) && self.k.is_some();
            let Some(span) = self.span(parameter) else {
                continue;
            };
            if !own.contains(&parameter) || is_second {
                return Err(RecordingError::Surplus {
                    structure,
                    parameter,
                });
            }
            let (low, high) = span.ends();
            let is_right = low <= high && high.is_finite();
            first_out_of_range([(
                parameter.key(),
                "finite, the lower value first",
                low,
                is_right,
            )])?;
        }
        self.process(|span| span.ends().0)?;
        let slowest = self.process(|span| span.ends().1)?;
        let samples = slowest.tau_s() * sample_rate_hz;
        let is_right = samples <= MOST_SAMPLES;
        first_out_of_range([("tau_s", "at most 5e7 samples", slowest.tau_s(), is_right)])?;
        Ok(())
    }
}

impl Excitation {
    pub(in crate::experiments) fn check(
        &self,
        duration_s: f64,
        sample_rate_hz: f64,
    ) -> Result<(), RecordingError> {
        let signal = self.signal;
        let settings = [
            ("band_hz", signal.has_band(), self.band_hz.is_some()),
            ("pulse_s", signal.has_pulses(), self.pulse_s.is_some()),
        ];
        let missing = settings.iter().find(|(_, needs, given)| *needs && !given);
        if let Some(&(field, ..)) = missing {
            return Err(RecordingError::Setting { signal, field });
        }
        let high_hz = self.band_hz.map_or(0.0, |band| band[1]);
        let pulse_s = self.pulse_s.unwrap_or(f64::INFINITY);
        first_out_of_range([
            (
                "amplitude",
                "positive and at most 1e9",
                self.amplitude,
                self.amplitude <= 1e9,
            ),
            (
                "band_hz",
                "at most half the sample rate",
                high_hz,
                high_hz <= 0.5 * sample_rate_hz,
            ),
            (
                "pulse_s",
                "one sample or more",
                pulse_s,
                pulse_s * sample_rate_hz >= 1.0,
            ),
        ])?;
        self.controller(None, duration_s, 0.0).map(|_| ())
    }

    /// What makes the input: the signal alone, or in the loop.
    pub(in crate::experiments) fn controller(
        &self,
        closed_loop: Option<&ClosedLoop>,
        duration_s: f64,
        noise_sigma: f64,
    ) -> Result<Box<dyn Controller>, RecordingError> {
        let excitation: Box<dyn Controller> = match self.test_signal(duration_s)? {
            Some(signal) => Box::new(Stimulus::new(signal, 0.0)),
            None => Box::new(Relay::new(RelaySettings {
                preroll_s: 0.0,
                noise_sigma: noise_sigma as f32,
                ..RelaySettings::new(self.amplitude as f32, self.beta as f32)
            })?),
        };
        let Some(&ClosedLoop {
            kp,
            kd,
            filter_s,
            entry,
        }) = closed_loop
        else {
            return Ok(excitation);
        };
        let entry = match entry {
            EntryName::Input => Entry::Input,
            EntryName::Setpoint => Entry::Setpoint,
        };
        let controller = FilteredPd::new(Pd { kp, kd }, filter_s);
        Ok(Box::new(ExcitedLoop::new(excitation, controller, entry)))
    }

    /// The test signal. `None` for a relay.
    fn test_signal(&self, length_s: f64) -> Result<Option<TestSignal>, RecordingError> {
        // `check` refuses what is missing; the signals refuse NaN.
        let pulse_s = self.pulse_s.unwrap_or(f64::NAN);
        let [low_hz, high_hz] = self.band_hz.unwrap_or([f64::NAN; 2]);
        let amplitude = self.amplitude;
        let signal = match self.signal {
            Signal::Relay => return Ok(None),
            Signal::Step => TestSignal::step(amplitude),
            Signal::Doublet => TestSignal::doublet(amplitude, pulse_s),
            Signal::ThreeTwoOneOne => TestSignal::three_two_one_one(amplitude, pulse_s),
            Signal::Prbs => TestSignal::prbs(amplitude, pulse_s, prbs_order(length_s / pulse_s)),
            Signal::Chirp => TestSignal::chirp(amplitude, low_hz, high_hz, length_s),
            Signal::Multisine => TestSignal::multisine(amplitude, low_hz, high_hz, SINES),
        };
        let signal = signal.map_err(|error| RecordingError::Signal {
            signal: self.signal,
            error,
        })?;
        Ok(Some(signal))
    }
}
