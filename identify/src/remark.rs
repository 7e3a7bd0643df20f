//! Remarks on a result: what limits it or deserves attention.

use onecycle_design::{DesignError, Parameter, Structure};

use crate::nonlinear::Nonlinear;
use crate::posterior::Interval;
use crate::verdict::Verdict;

/// Something that limits a result or deserves attention, as facts. The program that shows it writes the sentence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remark {
    /// A longer stretch of the oscillation was refused and a shorter or other one was used. The value is the misfit of
    /// the refused stretch: the unexplained fraction of the oscillation.
    Disturbed(f64),
    /// The recording holds one complete cycle, so nothing in it confirms that the oscillation is steady.
    OneCycle {
        /// Whether the pack knows the cycle as one of a steady oscillation.
        is_known: bool,
    },
    /// A known low-pass was taken out of the output, and its delay is in the dead time.
    OutputFilter {
        /// Delay of a slow signal through the filter (s).
        delay_s: f64,
    },
    /// Noise came back through the controller, so the fit used the part of the input that the set-point caused.
    TwoStage {
        /// Share of this part in the variance of the input.
        share: f64,
    },
    /// No fit to the input explained the recording, so the process was found from what input and output have in common with
    /// the set-point, at many frequencies.
    BySetPoint {
        /// Segments of the recording, each overlapping the next by half.
        segments: usize,
        /// Lowest and highest frequency used (rad/s).
        band_rad_per_s: (f64, f64),
    },
    /// Few cycles: the steady run has fewer than 3, or the fit used fewer than 4 although more were requested.
    FewCycles {
        /// Number of cycles used.
        used: usize,
    },
    /// No process of the pack's family explains the last cycle. The value is the misfit score, whose limit is 1.
    Unknown(f64),
    /// The pack returned no estimate for the last cycle.
    Unread,
    /// The gain of the process is negative.
    NegativeGain,
    /// The recording does not show the damping: `T_body` and `K` have no upper bound. The value is the lower bound of
    /// `T_body` (s), if there is one.
    DampingNotSeen(Option<f64>),
    /// The process is unstable without its controller. The value is the time constant with which its output grows (s).
    Unstable(f64),
    /// Lags of the process cannot be told from equal ones.
    EqualLags {
        /// The lags, longest first.
        lags: Vec<Parameter>,
        /// Their geometric mean (s).
        mean_s: Interval,
    },
    /// The interval of a parameter is wide.
    Weak {
        /// The parameter.
        parameter: Parameter,
        /// Half width of the interval, as a fraction of the estimate.
        relative_half_width: f64,
    },
    /// The interval of the dead time is wide.
    WeakDelay {
        /// Lower end (s).
        low_s: f64,
        /// Upper end (s).
        high_s: f64,
    },
    /// The noise is large. The value is its standard deviation as a fraction of the amplitude of the oscillation.
    Noisy(f64),
    /// The input bias is large. The value is the bias that the centre of the relay does not compensate, as a fraction
    /// of the amplitude of the relay.
    Biased(f64),
    /// A cycle has few samples. The value is their number.
    Coarse(f64),
    /// The model leaves part of the oscillation unexplained in excess of the noise. The value is that fraction.
    Misfit(f64),
    /// The phase margin may be much smaller than specified. The value is the lower end of its interval (rad).
    MarginMayBeLess(f64),
    /// No controller can be designed for the model.
    NoController(DesignError),
    /// The model has nonlinear forces, at least one, and the controller is designed for its linear parts.
    Nonlinear(Nonlinear),
    /// Other structures explain the recording nearly as well.
    OtherStructures(Vec<Structure>),
    /// The innovations are not white. The value is their largest autocorrelation; the intervals are widened.
    Coloured(f64),
    /// No fit to the noise of the recording can be believed, so samples were believed to this share of the movement of the output, as for
    /// an error of the model.
    ModelError(f64),
    /// The past input explains a share of the innovations: the model lacks something.
    InputLeft(f64),
    /// The model predicts less than nine tenths of the variance of data that it was not fitted to.
    WeakPrediction {
        /// Share of the variance explained.
        explained: f64,
        /// Time ahead (s).
        horizon_s: f64,
    },
    /// A fit without disturbances explains what the fit with them leaves to a slow disturbance, and the input does not follow
    /// the output. The intervals hold both.
    DriftOrGain,
    /// The input never changes: it is assumed to have been zero before the first row, with the process at rest.
    AssumedRest,
    /// From another state at the start the step explains nothing: the process is assumed to have been at rest before it, which the few rows
    /// before it do not tell.
    RestBeforeStep,
    /// Outputs were left out: lost, stale or outliers. The value is their share.
    Absent(f64),
    /// Only the longest part without a gap was used. The value is its share of the recording.
    PartUsed(f64),
    /// The input between the samples is taken as straight lines and not as held, because that explains the recording
    /// better. The value is the difference of the log-likelihood.
    Interpolated(f64),
    /// The relay switches at a ratio of which no relay is known: either it has this `beta`, or its input was logged late.
    ClockUnknown {
        /// The ratio seen.
        seen: f64,
        /// `beta` of the relay that it is compared with.
        beta: f64,
        /// Time by which the input was logged late if the relay has that `beta` (s). `None` if no offset explains the switches.
        late_s: Option<f64>,
        /// Phase margin (rad) of the controller in that case. `None` if the loop is unstable.
        phase_margin_rad: Option<f64>,
        /// Phase margin (rad) that each second of an offset costs: the gain crossover. `None` without a controller.
        rad_per_s: Option<f64>,
    },
    /// Nothing in the recording shows whether input and output were logged by one clock.
    ClockUnchecked {
        /// Phase margin (rad) that each second of an offset costs: the gain crossover.
        rad_per_s: f64,
    },
    /// The gain crossover of the controller lies above the frequencies that the recording excites.
    Extrapolated {
        /// Crossover over the highest excited frequency.
        ratio: f64,
        /// Whether that is too far, so that no controller is given.
        is_withdrawn: bool,
    },
    /// No two amplitudes of the input were compared, so the result does not show how the gain depends on the amplitude.
    OneAmplitude,
    /// The samples were not taken at the times of their stamps: the output scatters more where it is steep. The value is the
    /// standard deviation of the time, as a share of the sample period, if the samples jitter independently.
    Jitter(f64),
    /// Two amplitudes of a relay show the same process, but its jumps overcome an actuator that sticks at small changes.
    JumpsOnly,
    /// The relay may switch between two samples, if it runs faster than the log. The value is the phase margin (rad) that a
    /// sample period costs.
    SwitchesBetweenSamples(f64),
    /// The other amplitude of a relay test at two amplitudes was refused. The value is the verdict.
    OtherAmplitudeRefused(Box<Verdict>),
    /// The gain margin of the controller is below 6 dB. The value is the margin, a factor.
    LittleGainMargin(f64),
    /// Noise moves the actuator much. The value is its standard deviation as a share of the amplitude of the input.
    NoiseAtActuator(f64),
    /// A step of the reference asks for more input than was tried.
    InputPeak {
        /// Largest step of the reference that does not (output unit); smaller than the movement in the recording.
        step: f64,
        /// Amplitude of the input that was tried (input unit).
        input: f64,
    },
    /// The recording disagrees with the prior of the pack, so the prior was not used. The value is the squared
    /// distance, in standard deviations of the residual, by which the prior would have moved the fit.
    PriorDropped(f64),
}

/// What a remark is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum About {
    /// Something in this recording is unusual or too little: the result may be wrong.
    Recording,
    /// How the result was found, and what of it is known less well: its intervals say by how much.
    Result,
    /// A test of this kind does not show it, in any recording.
    Test,
    /// The proposed controller asks for it.
    Controller,
}

impl About {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 4] = [Self::Recording, Self::Result, Self::Test, Self::Controller];

    /// Name for programs: an entry of `detail_about` in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Recording => "recording",
            Self::Result => "result",
            Self::Test => "test",
            Self::Controller => "controller",
        }
    }
}

impl Remark {
    /// What the remark is about. Only one about the recording is a reason to suspect the result: those about the test stand on
    /// every recording of its kind.
    #[must_use]
    pub fn about(&self) -> About {
        match self {
            Self::OneAmplitude
            | Self::JumpsOnly
            | Self::ClockUnchecked { .. }
            | Self::SwitchesBetweenSamples(_)
            | Self::Unread => About::Test,
            Self::OutputFilter { .. }
            | Self::TwoStage { .. }
            | Self::DampingNotSeen(_)
            | Self::EqualLags { .. }
            | Self::Weak { .. }
            | Self::WeakDelay { .. }
            | Self::OtherStructures(_)
            | Self::Absent(_)
            | Self::Interpolated(_) => About::Result,
            Self::LittleGainMargin(_) | Self::NoiseAtActuator(_) | Self::InputPeak { .. } => {
                About::Controller
            }
            _ => About::Recording,
        }
    }

    /// Name for programs: an entry of `remark_kinds` or `detail_kinds` in JSON.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Disturbed(_) => "disturbed",
            Self::OneCycle { .. } => "one_cycle",
            Self::OutputFilter { .. } => "output_filter",
            Self::TwoStage { .. } => "two_stage",
            Self::BySetPoint { .. } => "by_set_point",
            Self::FewCycles { .. } => "few_cycles",
            Self::Unknown(_) => "unknown",
            Self::Unread => "unread",
            Self::NegativeGain => "negative_gain",
            Self::DampingNotSeen(_) => "damping_not_seen",
            Self::Unstable(_) => "unstable",
            Self::EqualLags { .. } => "equal_lags",
            Self::Weak { .. } => "weak_parameter",
            Self::WeakDelay { .. } => "weak_delay",
            Self::Noisy(_) => "noisy",
            Self::Biased(_) => "biased",
            Self::Coarse(_) => "coarse",
            Self::Misfit(_) => "misfit",
            Self::MarginMayBeLess(_) => "margin_may_be_less",
            Self::NoController(_) => "no_controller",
            Self::Nonlinear(_) => "nonlinear",
            Self::OtherStructures(_) => "other_structures",
            Self::Coloured(_) => "coloured",
            Self::ModelError(_) => "model_error",
            Self::InputLeft(_) => "input_left",
            Self::WeakPrediction { .. } => "weak_prediction",
            Self::DriftOrGain => "drift_or_gain",
            Self::AssumedRest => "assumed_rest",
            Self::RestBeforeStep => "rest_before_step",
            Self::Absent(_) => "absent",
            Self::PartUsed(_) => "part_used",
            Self::Interpolated(_) => "interpolated",
            Self::ClockUnknown { .. } => "clock_unknown",
            Self::ClockUnchecked { .. } => "clock_unchecked",
            Self::Extrapolated { .. } => "extrapolated",
            Self::OneAmplitude => "one_amplitude",
            Self::Jitter(_) => "jitter",
            Self::JumpsOnly => "jumps_only",
            Self::SwitchesBetweenSamples(_) => "switches_between_samples",
            Self::OtherAmplitudeRefused(_) => "other_amplitude_refused",
            Self::LittleGainMargin(_) => "little_gain_margin",
            Self::NoiseAtActuator(_) => "noise_at_actuator",
            Self::InputPeak { .. } => "input_peak",
            Self::PriorDropped(_) => "prior_dropped",
        }
    }
}
