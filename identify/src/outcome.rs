//! What a recording tells.

use onecycle_design::{Optimum, StepMetrics};
use onecycle_onboard::refine::Refined;

use crate::posterior::{Interval, ProcessEstimate};
use crate::relay::reading::Reading;
use crate::remark::Remark;
use crate::verdict::Verdict;

/// The oscillation that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillationFound {
    /// Mean period of the cycles used (s).
    pub period_s: f64,
    /// Half the peak-to-peak output, mean of the cycles used (output unit).
    pub amplitude: f64,
    /// Cycles used for the fit.
    pub cycles_used: usize,
    /// Cycles of the steady run they were taken from.
    pub cycles_steady: usize,
    /// Beginning of the cycles used (s).
    pub start_s: f64,
    /// End of the cycles used (s).
    pub end_s: f64,
    /// Mean part of the period with the relay high.
    pub duty: f64,
    /// Half the distance of the relay's levels (input unit).
    pub relay_amplitude: f64,
    /// Middle of the relay's levels (input unit).
    pub relay_centre: f64,
    /// Standard deviation of the noise on a sample (output unit).
    pub noise_sigma: f64,
    /// Sample period (s).
    pub sample_s: f64,
}

/// One point of the fit: a bin of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitPoint {
    /// Mean time of its samples (s).
    pub time_s: f64,
    /// Mean of its samples (output unit).
    pub measured: f64,
    /// The model's mean over the same instants (output unit).
    pub fitted: f64,
}

/// The process and the controller made for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// The fit behind the estimate.
    pub refined: Refined,
    /// Parameters with their intervals.
    pub process: ProcessEstimate,
    /// Probability that gain, lags and delay are all within their intervals at once; `None` where
    /// there are no intervals.
    pub joint_probability: Option<f64>,
    /// Controller of least expected cost at the phase margin asked for; cost and margins are those
    /// on the process found.
    pub controller: Optimum,
    /// Its phase margin (rad) with the interval that the process's intervals leave it.
    pub phase_margin_rad: Interval,
    /// Predicted response to a unit step of the reference; `None` where it is too slow to simulate.
    pub step: Option<StepMetrics>,
    /// Root mean square of what the model leaves unexplained, over that of the oscillation.
    pub misfit: f64,
    /// The fit over the cycles used.
    pub fit: Vec<FitPoint>,
}

/// All that a recording tells.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// The oscillation, where there is one.
    pub oscillation: Option<OscillationFound>,
    /// What the pack reads off its last cycle; `None` without a pack or where it has no answer.
    pub reading: Option<Reading>,
    /// The process, or why there is none.
    pub outcome: Result<Identified, Verdict>,
    /// What a user should know beside the numbers.
    pub remarks: Vec<Remark>,
}
