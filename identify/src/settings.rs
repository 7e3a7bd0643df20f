//! Settings of an identification.

use onecycle_design::{Specification, Structure};

use crate::innovations::Hold;
use crate::signals::is_constant;

/// Maximum number of cycles that a fit can use: the window of the estimator has room for the switches of 50 cycles.
pub const MOST_CYCLES: usize = 50;

/// Number of cycles that a fit takes if it is asked for without one.
pub const USUAL_CYCLES: usize = 8;

/// Settings of an identification. `Default`: the whole recording, a PID in the style `Style::Balanced`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Number of cycles to fit, counted from the end of a steady relay oscillation: 1 to [`MOST_CYCLES`], by the estimator of the
    /// board, which knows one structure. `None`: the whole recording.
    pub cycles: Option<usize>,
    /// Requirements on the controller. The recording completes them: without `noise`, its own; if `execution` has no sample
    /// period and the input is held, its own, with an output that leaves in the tick of its sample.
    pub specification: Specification,
    /// Method of estimation from cycles. Another than [`Method::Map`] takes cycles, 8 if their number is not given.
    pub method: Method,
    /// Structure to fit. `None`: the simplest one that explains the recording.
    pub structure: Option<Structure>,
    /// Whether the process is known to be unstable without its controller: [`Structure::Foptd`] or [`Structure::Soptd`] with a negative
    /// `T_body` is fitted. Otherwise a recording that shows such a process is refused.
    pub is_unstable: bool,
    /// First and last time to use (s). `None`: from the start, to the end.
    pub span_s: (Option<f64>, Option<f64>),
    /// Input between two samples. `None`: the likelihood decides.
    pub hold: Option<Hold>,
    /// `beta` of the relay that made the recording. A recording whose switches contradict it is refused.
    pub beta: Option<f64>,
    /// Time (s) by which the input was logged after it acted, negative if before; the recording is corrected by it. With a
    /// value, zero too, the clocks are not judged by the relay's law.
    pub input_late_s: Option<f64>,
    /// Input before the first row, under which the process was at rest: for a step in the first row. `None`: the likelihood
    /// decides whether the process was at rest under the input of the first row, or under zero if the input never changes.
    pub input_before: Option<f64>,
    /// Whether the input is known to follow the output, as in flight. Otherwise the recording is asked.
    pub is_fed_back: bool,
    /// Whether the recording is known to begin in the middle of a movement, as a part of a flight. Otherwise the likelihood decides
    /// whether the process was at rest.
    pub is_under_way: bool,
    /// Cutoff (Hz) of a second-order Butterworth low-pass through which the output was recorded, as that of a gyro. The
    /// likelihood takes it out of the output and adds its delay to the dead time.
    pub output_filter_hz: Option<f64>,
}

impl Options {
    /// Whether the last cycles of a steady relay oscillation are fitted, and not the whole recording.
    #[must_use]
    pub fn is_of_cycles(&self) -> bool {
        self.of_cycles().is_some()
    }

    /// Number of cycles to fit. `None`: the whole recording.
    pub(crate) fn of_cycles(&self) -> Option<usize> {
        let is_of_cycles = self.cycles.is_some() || self.method != Method::Map;
        is_of_cycles.then_some(self.cycles.unwrap_or(USUAL_CYCLES).clamp(1, MOST_CYCLES))
    }

    /// Fits the last `cycles` steady cycles. Values outside 1 to [`MOST_CYCLES`] are set to the nearest limit.
    #[must_use]
    pub fn cycles(self, cycles: usize) -> Self {
        Self {
            cycles: Some(cycles.clamp(1, MOST_CYCLES)),
            ..self
        }
    }

    /// Designs the controller to these requirements.
    #[must_use]
    pub fn specification(self, specification: Specification) -> Self {
        Self {
            specification,
            ..self
        }
    }

    /// Requires this phase margin (rad) at least, between 0 and `pi/2`. A value outside this range leads to the verdict
    /// [`NoController`](crate::Verdict::NoController).
    #[must_use]
    pub fn phase_margin_rad(self, phase_margin_rad: f64) -> Self {
        Self {
            specification: self.specification.with_phase_margin_rad(phase_margin_rad),
            ..self
        }
    }

    /// Estimates the process by `method`.
    #[must_use]
    pub fn method(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// Fits this structure, or the simplest one that explains the recording if `None`.
    #[must_use]
    pub fn structure(self, structure: Option<Structure>) -> Self {
        Self { structure, ..self }
    }

    /// Fits a process that is unstable without its controller.
    #[must_use]
    pub fn unstable(self, is_unstable: bool) -> Self {
        Self {
            is_unstable,
            ..self
        }
    }

    /// Uses the recording from the first to the second time (s) only.
    #[must_use]
    pub fn span_s(self, from_s: Option<f64>, to_s: Option<f64>) -> Self {
        Self {
            span_s: (from_s, to_s),
            ..self
        }
    }

    /// Expects switches of a relay with this `beta`, or of a relay that is not known if `None`.
    #[must_use]
    pub fn beta(self, beta: Option<f64>) -> Self {
        Self { beta, ..self }
    }

    /// Corrects the recording for an input that was logged this much late (s), or judges the clocks by the relay's law if
    /// `None`.
    #[must_use]
    pub fn input_late_s(self, input_late_s: Option<f64>) -> Self {
        Self {
            input_late_s,
            ..self
        }
    }

    /// Takes the input as one that follows the output, whatever the recording shows of it.
    #[must_use]
    pub fn under_feedback(self) -> Self {
        Self {
            is_fed_back: true,
            ..self
        }
    }

    /// Takes the recording as one that begins in the middle of a movement, if so.
    #[must_use]
    pub fn under_way(self, is_under_way: bool) -> Self {
        Self {
            is_under_way,
            ..self
        }
    }

    /// Takes the process as at rest under this input before the first row, or lets the likelihood decide if `None`.
    #[must_use]
    pub fn input_before(self, input_before: Option<f64>) -> Self {
        Self {
            input_before,
            ..self
        }
    }

    /// Whether rest under zero before the first row is taken for granted: nobody has stated another input, and this one never changes.
    pub(crate) fn assumes_rest(&self, input: &[f64]) -> bool {
        self.input_before.is_none() && is_constant(input)
    }

    /// Takes a low-pass of this cutoff (Hz) out of the output, or none if `None`.
    #[must_use]
    pub fn output_filter_hz(self, output_filter_hz: Option<f64>) -> Self {
        Self {
            output_filter_hz,
            ..self
        }
    }

    /// Takes the input between two samples as `hold` says, or lets the likelihood decide if `None`.
    #[must_use]
    pub fn hold(self, hold: Option<Hold>) -> Self {
        Self { hold, ..self }
    }
}

/// Method of estimation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Method {
    /// The estimate of the network of the pack, from the last cycle alone.
    Classify,
    /// Least squares without a pack.
    Refine,
    /// Maximum a posteriori: least squares that starts at the estimate of the network, with the prior of the pack.
    /// Without a pack, or if no process of the pack's family explains the last cycle, it is the same as
    /// [`Method::Refine`].
    #[default]
    Map,
}
