//! What a recording tells: the process, the controllers to choose from, the answer.

use onecycle_design::Controller;
use onecycle_identify::Identification;
use onecycle_link::Recording;

use crate::answer;
use crate::log_gains::LogLoop;
use crate::request::HALF_STEP;
use crate::results::answer::{Answer, Gain};
use crate::results::controllers::Controllers;
use crate::results::log_gains::{LogGains, NamedFiles};
use crate::words::units::Units;

/// What a recording tells.
#[non_exhaustive]
pub struct Report {
    /// Name of the recording.
    pub name: String,
    /// The recording, of a flight log the part that was used.
    pub recording: Recording,
    /// The process with what the estimate rests on, or the reason why no process was identified.
    pub identification: Identification,
    /// Controllers for the process, and the gains in force. `None` without a process.
    pub choice: Option<Controllers>,
    /// The loop of a flight log. `None`: the recording is not of a flight log.
    pub of_log: Option<LogLoop>,
    /// What a flight log tells about the gains of the loop.
    pub gains: Option<LogGains>,
    /// What to do.
    pub answer: Answer,
}

impl Report {
    /// Makes the designs over limits of `Ms`, once.
    pub fn make_trade_off(&mut self) {
        self.choice = (self.choice.take()).map(|choice| match &self.identification.outcome {
            Ok(identified) if choice.trade_off.is_empty() => {
                choice.with_trade_off(&identified.for_design(0).0)
            }
            _ => choice,
        });
    }

    /// The name, and the loop of a flight log.
    #[must_use]
    pub fn title(&self) -> String {
        let of_log = self.of_log.as_ref().map(LogLoop::title);
        format!("{}{}", self.name, of_log.unwrap_or_default())
    }

    /// What to type in for a controller: now, half of the way, and all of it.
    #[must_use]
    pub fn typed(&self, controller: &Controller) -> Vec<Gain> {
        let subject = answer::Subject {
            file: &self.name,
            units: &Units::of(&self.recording),
            choice: self.choice.as_ref(),
            of_log: self.of_log.as_ref(),
            gains: None,
            share: HALF_STEP,
        };
        answer::typed(controller, &subject)
    }

    /// The files with parameters that were asked for. `None`: nothing is to be written.
    #[must_use]
    pub fn files(&self) -> Option<&NamedFiles> {
        let written = self.gains.as_ref()?.written.as_ref()?;
        written.as_ref().ok()?.files.as_ref()
    }

    /// Whether a process was identified, and there are parameters to write if that was asked for.
    #[must_use]
    pub fn is_positive(&self) -> bool {
        let is_refused = |gains: &LogGains| matches!(gains.written, Some(Err(_)));
        self.identification.outcome.is_ok() && !self.gains.as_ref().is_some_and(is_refused)
    }
}
