//! Baselines: published methods run on the same experiments, each tuned as well as possible.
//!
//! | module         | method                                        | what it needs                    |
//! |----------------|-----------------------------------------------|----------------------------------|
//! | [`pem`]        | prediction error, output error by SQP         | any recording that starts at rest or in a steady state |
//! | [`rules`]      | homogeneous tuning rules                      | a cycle at the rule's `beta`     |
//! | [`arx`]        | recursive least squares on ARX(2,2), as in PX4 | any recording with enough excitation |
//! | [`gmvc`]       | PX4's gains for that model                    | the same recording as [`arx`]    |
//! | [`asymmetric`] | asymmetric relay, integrator with dead time   | a recording of that relay        |
//!
//! All read a recording as [`Signals`], one sample per point at an even period, and return a
//! [`BaselineAnswer`]: a controller and the process behind it, or a [`BaselineError`]. From a process
//! the controller is always the PD of least exact ISE at the requested phase margin, so that only the
//! identification is compared. Only [`gmvc`] returns the gains of its own method.
//!
//! ```
//! use onecycle_lab::judge::baselines::{pem, rules};
//! use onecycle_lab::experiments::signals_of;
//! use onecycle_onboard::{Soiptd, Relay, RelaySettings};
//! use onecycle_plant::{Experiment, Noise};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let process = Soiptd::new(1.0, 0.02, 0.3, 0.01)?;
//! let mut relay = Relay::new(RelaySettings::bare(1.0, -0.73))?;
//! let mut noise = Noise::from_seed(1);
//! let trace = Experiment::new(process, 1e-3, 6.0).run(&mut relay, &mut noise);
//! let signals = signals_of(&trace, 1e-3);
//!
//! let margin = 20_f64.to_radians();
//! let by_pem = pem::identify(&signals, &pem::PemSettings::fair(), margin)?;
//! let by_rule = rules::identify(&signals, &rules::Rule::of_relay(-0.73, margin), 1)?;
//! assert!((by_pem.pd.kp / by_rule.pd.kp - 1.0).abs() < 0.2);
//! # Ok(())
//! # }
//! ```

pub mod arx;
pub mod asymmetric;
pub mod gmvc;
pub mod pem;
pub mod rules;

use onecycle_onboard::{Pd, Soiptd, SoiptdError};

use onecycle_design::soiptd_pd::optimum::{OptimumError, pd_at_phase_margin};
use onecycle_identify::{Oscillation, Signals, Verdict, find_oscillation};

/// Result of a baseline on a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaselineAnswer {
    /// The identified process; `None` for a rule that leads directly to a controller.
    pub process: Option<Soiptd>,
    /// The resulting controller.
    pub pd: Pd,
}

/// Why a baseline has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BaselineError {
    /// The method needs a steady oscillation and there is none.
    #[error("{0}")]
    NoOscillation(Verdict),
    /// The columns differ in length, points are averages, or the samples are not at an even period.
    #[error("the recording must hold single samples at an even period, without gaps")]
    Uneven,
    /// There are too few samples for the method.
    #[error("{samples} samples are too few for this method")]
    TooShort {
        /// Number of samples.
        samples: usize,
    },
    /// A setting is out of its range: its name and value.
    #[error("{0} is out of range: {1}")]
    Setting(&'static str, f64),
    /// The model found is not such a process: the reason.
    #[error("the model found is not an integrating process with lags: {0}")]
    NotThisProcess(&'static str),
    /// The parameters found are outside their physical range.
    #[error("{0}")]
    Process(#[from] SoiptdError),
    /// The process found has no optimal controller.
    #[error("{0}")]
    Optimum(#[from] OptimumError),
}

impl BaselineAnswer {
    /// The process with its PD of least ISE at a phase margin (rad).
    fn of_process(process: Soiptd, phase_margin_rad: f64) -> Result<Self, BaselineError> {
        Ok(Self {
            process: Some(process),
            pd: pd_at_phase_margin(&process, phase_margin_rad)?.pd,
        })
    }
}

/// Largest deviation of a time stamp from the even grid, in sample periods: what rounding in a file
/// causes, and far below what changes a fit.
const EVEN: f64 = 0.01;

/// Checks that the recording is what every baseline reads.
fn check_even(signals: &Signals<'_>) -> Result<(), BaselineError> {
    let samples = signals.time_s.len();
    let is_single = signals.samples_per_point == 1 && signals.breaks.is_empty();
    if !is_single || signals.input.len() != samples || signals.output.len() != samples {
        return Err(BaselineError::Uneven);
    }
    let sample_s = signals.sample_period_s;
    let strays = |(index, &time_s): (usize, &f64)| {
        let on_grid_s = signals.time_s[0] + index as f64 * sample_s;
        let stray_s = (time_s - on_grid_s).abs();
        stray_s.is_nan() || stray_s > EVEN * sample_s
    };
    if signals.time_s.iter().enumerate().any(strays) {
        return Err(BaselineError::Uneven);
    }
    Ok(())
}

/// The last steady cycles, `most` at most, and their samples.
fn steady_cycles(
    signals: &Signals<'_>,
    most: usize,
) -> Result<(Oscillation, std::ops::Range<usize>), BaselineError> {
    check_even(signals)?;
    let found = find_oscillation(signals, most).map_err(BaselineError::NoOscillation)?;
    let half_s = 0.5 * signals.sample_period_s;
    let index = |time_s: f64| signals.time_s.partition_point(|&t| t < time_s - half_s);
    let window = index(found.start_s)..index(found.end_s);
    Ok((found, window))
}
