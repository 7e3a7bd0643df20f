//! Requirements on a controller: form, style, limits, and what stands between controller and process.

use std::f64::consts::FRAC_PI_2;

use crate::controller::{Execution, Form};

use super::outcome::DesignError;

/// Named sets of limits. Each limit can be set on its own in the [`Specification`].
///
/// | style | largest `Ms` and `Mt` | implied margins | noise, as a share of the input amplitude |
/// |-------|-----|-----------------|------|
/// | [`Style::Sharp`] | 2.0 | 29 deg, factor 2.0 | 0.5 |
/// | [`Style::Balanced`] | 1.6 | 36 deg, factor 2.67 | 0.25 |
/// | [`Style::Calm`] | 1.4 | 42 deg, factor 3.5 | 0.1 |
/// | [`Style::Paper`] | none | phase margin of 20 deg | none |
///
/// The range 1.2 to 2.0 of `Ms` is that of K. J. Astrom, T. Hagglund, "Advanced PID Control" (ISA, 2006), section 4.6.
/// The shares of noise are a convention.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Style {
    /// The paper's: a PD of least ISE at a phase margin. For an integrator with two lags and dead time only.
    Paper,
    /// Fast, with the least robustness in use.
    Sharp,
    /// Between sharp and calm.
    #[default]
    Balanced,
    /// Slow and robust.
    Calm,
}

impl Style {
    /// Every style.
    pub const ALL: [Self; 4] = [Self::Paper, Self::Sharp, Self::Balanced, Self::Calm];

    /// Name in JSON and on command lines.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Sharp => "sharp",
            Self::Balanced => "balanced",
            Self::Calm => "calm",
        }
    }

    /// Style of this [name](Self::name).
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|style| style.name() == name)
    }

    /// Largest `Ms` and `Mt`. Infinite for the paper's style.
    #[must_use]
    pub fn peak(self) -> f64 {
        match self {
            Self::Paper => f64::INFINITY,
            Self::Sharp => 2.0,
            Self::Balanced => 1.6,
            Self::Calm => 1.4,
        }
    }

    /// Largest standard deviation of the noise at the actuator, as a share of the input amplitude.
    #[must_use]
    pub fn noise_share(self) -> f64 {
        match self {
            Self::Paper => f64::INFINITY,
            Self::Sharp => 0.5,
            Self::Balanced => 0.25,
            Self::Calm => 0.1,
        }
    }
}

/// Largest overshoot after a step of the reference, as a share of the step.
const OVERSHOOT: f64 = 0.05;

/// Draws of a robust design. Five of them may miss the limits, so that with a probability of 94 % at least 95 % of the
/// posterior keeps them.
const ROBUST_DRAWS: usize = 200;

/// Measurement noise, and the input that it is compared with. A relay experiment shows all three.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MeasurementNoise {
    /// Standard deviation of the white noise (output unit).
    pub std: f64,
    /// Sample period of the noise (s).
    pub sample_period_s: f64,
    /// Amplitude of the input, for example of the relay (input unit).
    pub input_amplitude: f64,
}

impl MeasurementNoise {
    /// White noise of standard deviation `std` (output unit), sampled every `sample_period_s` seconds, for an actuator
    /// that is used with `input_amplitude` (input unit).
    #[must_use]
    pub fn new(std: f64, sample_period_s: f64, input_amplitude: f64) -> Self {
        Self {
            std,
            sample_period_s,
            input_amplitude,
        }
    }
}

/// Requirements on a controller. `Default`: a PID in the style [`Style::Balanced`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Specification {
    /// Form of the controller.
    pub form: Form,
    /// Criterion. [`Style::Paper`] uses the phase margin and no other limit.
    pub style: Style,
    /// Minimum phase margin (rad), below `pi/2`. Zero: no limit beside the others.
    pub phase_margin_rad: f64,
    /// Maximum sensitivity `Ms`, above 1.
    pub ms: f64,
    /// Maximum complementary sensitivity `Mt`, above 1.
    pub mt: f64,
    /// Minimum gain margin. One: no limit beside the others.
    pub gain_margin: f64,
    /// Minimum delay margin (s). Zero: no limit beside the others.
    pub delay_margin_s: f64,
    /// Measurement noise. `None`: noise does not limit the gains, and the measurement filter follows from the dead time.
    pub noise: Option<MeasurementNoise>,
    /// Maximum standard deviation of the noise at the actuator, as a share of the input amplitude.
    pub noise_share: f64,
    /// Maximum output of the controller after a unit step of the reference (input unit).
    pub input_peak: Option<f64>,
    /// Highest gain crossover (rad/s): `|L| < 1` above it. `None`: no limit. The paper's style has none.
    pub crossover_rad_per_s: Option<f64>,
    /// Time of the measurement filter (s). `None`: chosen with the gains.
    pub filter_s: Option<f64>,
    /// Set-point weight. `None`: of a PI or PID the largest one of at most 1 that keeps the overshoot, chosen after the gains.
    /// A weight that the firmware fixes limits the gains instead, as far as the form can keep the overshoot. A cascade has no
    /// weight.
    pub setpoint_weight: Option<f64>,
    /// Largest overshoot after a step of the reference, as a share of the step.
    pub overshoot: f64,
    /// Known filters and sampling.
    pub execution: Execution,
    /// Share of the draws on which the limits must hold.
    pub coverage: f64,
    /// Whether the search continues until the gains are exact to about 1e-5 instead of 1e-2. The cost is then exact to
    /// 1e-9 instead of 1e-3, and the search takes some 50 times longer. Without effect on a design over draws.
    pub refined: bool,
}

impl Default for Specification {
    fn default() -> Self {
        Self::new(Form::Pid, Style::Balanced)
    }
}

impl Specification {
    /// Form and style, with the limits of the style. [`Style::Paper`] has 20 degrees of phase margin.
    #[must_use]
    pub fn new(form: Form, style: Style) -> Self {
        let phase_margin_deg = if style == Style::Paper { 20_f64 } else { 0.0 };
        Self {
            form,
            style,
            phase_margin_rad: phase_margin_deg.to_radians(),
            ms: style.peak(),
            mt: style.peak(),
            gain_margin: 1.0,
            delay_margin_s: 0.0,
            noise: None,
            noise_share: style.noise_share(),
            input_peak: None,
            crossover_rad_per_s: None,
            filter_s: None,
            setpoint_weight: None,
            overshoot: OVERSHOOT,
            execution: Execution::default(),
            coverage: 0.95,
            refined: false,
        }
    }

    /// The paper's: a PD with 20 degrees of phase margin.
    #[must_use]
    pub fn paper() -> Self {
        Self::new(Form::Pd, Style::Paper)
    }

    /// The same task in another style: the style's limits of `Ms`, `Mt` and noise, beside all others of `self`. To and from
    /// [`Style::Paper`], form and phase margin are those of [`Specification::paper`] and of the default.
    #[must_use]
    pub fn in_style(self, style: Style) -> Self {
        if style == self.style {
            return self;
        }
        let other = match (self.style, style) {
            (_, Style::Paper) => Self::paper(),
            (Style::Paper, _) => Self::new(Self::default().form, style),
            _ => Self::new(self.form, style).with_phase_margin_rad(self.phase_margin_rad),
        };
        Self {
            form: other.form,
            style,
            phase_margin_rad: other.phase_margin_rad,
            ms: other.ms,
            mt: other.mt,
            noise_share: other.noise_share,
            ..self
        }
    }

    /// Phase margin (rad) that the limits imply: the specified one, or `2 asin(1/(2 Ms))` if that is larger.
    #[must_use]
    pub fn implied_phase_margin_rad(&self) -> f64 {
        self.phase_margin_rad.max(2.0 * (0.5 / self.ms).asin())
    }

    /// Number of draws from a posterior that [`design_over()`](super::design_over()) needs: [`DRAWS`](super::DRAWS) in the
    /// paper's style, 200 in the others.
    #[must_use]
    pub fn draws(&self) -> usize {
        if self.style == Style::Paper {
            super::DRAWS
        } else {
            ROBUST_DRAWS
        }
    }

    /// Sets the minimum phase margin (rad). [`design()`](super::design()) refuses a value that is not between 0 and
    /// `pi/2`.
    #[must_use]
    pub fn with_phase_margin_rad(self, phase_margin_rad: f64) -> Self {
        Self {
            phase_margin_rad,
            ..self
        }
    }

    /// Sets the maximum sensitivity and the maximum complementary sensitivity to the same value.
    #[must_use]
    pub fn with_peak(self, peak: f64) -> Self {
        Self {
            ms: peak,
            mt: peak,
            ..self
        }
    }

    /// Sets the measurement noise.
    #[must_use]
    pub fn with_noise(self, noise: MeasurementNoise) -> Self {
        Self {
            noise: Some(noise),
            ..self
        }
    }

    /// Sets known filters and sampling.
    #[must_use]
    pub fn with_execution(self, execution: Execution) -> Self {
        Self { execution, ..self }
    }

    /// Sets the set-point weight that the controller has.
    #[must_use]
    pub fn with_setpoint_weight(self, weight: f64) -> Self {
        Self {
            setpoint_weight: Some(weight),
            ..self
        }
    }

    /// Sets the time of the measurement filter (s).
    #[must_use]
    pub fn with_filter_s(self, filter_s: f64) -> Self {
        Self {
            filter_s: Some(filter_s),
            ..self
        }
    }

    /// Sets whether the search continues to six digits.
    #[must_use]
    pub fn with_refined(self, refined: bool) -> Self {
        Self { refined, ..self }
    }

    /// Checks the values, as [`design()`](super::design()) does.
    ///
    /// # Errors
    /// - [`DesignError::PhaseMargin`] outside the open interval from 0 to `pi/2`; for other styles than the paper's zero
    ///   is allowed.
    /// - [`DesignError::Setting`] for another value out of range.
    pub fn check(&self) -> Result<(), DesignError> {
        let margin_rad = self.phase_margin_rad;
        let is_paper = self.style == Style::Paper;
        let is_none = !is_paper && margin_rad == 0.0;
        if !(is_none || margin_rad > 0.0 && margin_rad < FRAC_PI_2) {
            return Err(DesignError::PhaseMargin(margin_rad));
        }
        if is_paper {
            return Ok(());
        }
        if !self.execution.is_valid() {
            return Err(DesignError::Setting {
                name: "execution.sample_period_s",
                value: self.execution.sample_period_s,
                requirement: "zero or a positive time, as are the times of its delay and filters",
            });
        }
        let failed = self
            .values()
            .into_iter()
            .find(|(_, value, range)| !range.holds(*value));
        failed.map_or(Ok(()), |(name, value, range)| {
            Err(DesignError::Setting {
                name,
                value,
                requirement: range.name(),
            })
        })
    }

    /// Each value with its name and range. An optional value that is not set is left out.
    fn values(&self) -> Vec<(&'static str, f64, Range)> {
        let mut values = vec![
            ("ms", self.ms, Range::Peak),
            ("mt", self.mt, Range::Peak),
            ("gain_margin", self.gain_margin, Range::OneOrMore),
            ("delay_margin_s", self.delay_margin_s, Range::ZeroOrMore),
            ("noise_share", self.noise_share, Range::Positive),
            ("overshoot", self.overshoot, Range::ZeroOrMore),
            ("coverage", self.coverage, Range::Share),
        ];
        if let Some(noise) = self.noise {
            values.extend([
                ("noise.std", noise.std, Range::Positive),
                (
                    "noise.sample_period_s",
                    noise.sample_period_s,
                    Range::Positive,
                ),
                (
                    "noise.input_amplitude",
                    noise.input_amplitude,
                    Range::Positive,
                ),
            ]);
        }
        values.extend(
            self.input_peak
                .map(|peak| ("input_peak", peak, Range::Positive)),
        );
        values.extend(
            self.crossover_rad_per_s
                .map(|omega| ("crossover_rad_per_s", omega, Range::Positive)),
        );
        values.extend(
            self.setpoint_weight
                .map(|weight| ("setpoint_weight", weight, Range::ZeroOrMore)),
        );
        values.extend(
            self.filter_s
                .map(|time_s| ("filter_s", time_s, Range::ZeroOrMore)),
        );
        values
    }
}

/// Range of a value of a specification.
#[derive(Clone, Copy)]
enum Range {
    Peak,
    OneOrMore,
    ZeroOrMore,
    Positive,
    Share,
}

impl Range {
    fn holds(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Peak => value >= 1.01,
                Self::OneOrMore => value >= 1.0,
                Self::ZeroOrMore => value >= 0.0,
                Self::Positive => value > 0.0,
                Self::Share => value > 0.0 && value <= 1.0,
            }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Peak => "1.01 or more",
            Self::OneOrMore => "1 or more",
            Self::ZeroOrMore => "zero or positive",
            Self::Positive => "positive",
            Self::Share => "above zero and at most 1",
        }
    }
}
