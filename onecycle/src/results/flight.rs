//! The control loops of a flight, each identified from several parts of it.

use onecycle_design::{Assessment, Controller, Pid, Structure};
use onecycle_identify::{Identification, Verdict};
use onecycle_link::{ControlLoop, Recording, Span};

use super::answer::Answer;
use super::controllers::Controllers;
use super::log_gains::{LogGains, NamedFiles, Written};

/// A loop with its parts.
pub struct FlightLoop {
    /// Which loop it is.
    pub control_loop: ControlLoop,
    /// Units of input and output.
    pub units: [&'static str; 2],
    /// Parts of the flight worth using.
    pub parts: Vec<Part>,
    /// Controllers for the process of the best part.
    pub choice: Option<Controllers>,
    /// What to do about the gains.
    pub answer: Answer,
    /// The parameters to write, or the reason why they must not be written. `None` without `--write`, and for a loop that is kept.
    pub to_write: Option<Result<Written, String>>,
    /// What a page shows of it. `None`: no part can be used.
    pub shown: Option<Shown>,
}

/// The part that tells most, or the first one if none tells anything, with all that was identified from it.
pub struct Shown {
    /// Its signals.
    pub recording: Recording,
    /// The process, or why there is none.
    pub identification: Identification,
    /// What the log tells about the gains. `None` unless pages are made.
    pub gains: Option<LogGains>,
}

/// The loops of a flight.
pub struct Survey {
    /// Name of the log.
    pub file: String,
    /// Number of the flight in the file, from 1.
    pub number: usize,
    /// Empty if the file has no such flight.
    pub firmware: String,
    /// What the file has lost, where it is cut off or damaged.
    pub lost: Option<String>,
    /// Usual ending of a file with its parameters. `None`: it has no known format.
    pub ending: Option<&'static str>,
    /// The loops that are logged.
    pub loops: Vec<FlightLoop>,
    /// The files with the parameters of all loops and with the old values. `None`: not asked for, or there is nothing to write.
    pub files: Option<NamedFiles>,
}

/// A controller and its figures; without them the loop is unstable.
pub struct Judged {
    /// The controller.
    pub pid: Pid,
    /// Figures of the loop.
    pub figures: Option<Assessment>,
}

impl Judged {
    /// `None`: the controller is no PID.
    fn of(controller: &Controller, figures: Option<Assessment>) -> Option<Self> {
        match controller {
            Controller::Pid(pid) => Some(Self { pid: *pid, figures }),
            _ => None,
        }
    }
}

/// A part of the flight.
pub struct Part {
    /// Its time.
    pub span: Span,
    /// What it tells, or why it tells nothing.
    pub outcome: Result<Found, Refusal>,
}

/// Why a part tells nothing.
pub enum Refusal {
    /// The verdict on the identification.
    Verdict(Verdict),
    /// The gain is none that this loop of a vehicle can have, so what was found is not the process.
    Implausible {
        /// Low end, estimate and high end.
        gain: [f64; 3],
        /// Least and largest gain.
        expected: (f64, f64),
    },
}

impl Refusal {
    /// Name in JSON.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Verdict(verdict) => verdict.kind(),
            Self::Implausible { .. } => "implausible",
        }
    }
}

/// What a part tells.
#[derive(Clone, Copy)]
pub struct Found {
    /// Structure of the process.
    pub structure: Structure,
    /// Rate of change of the output per unit of input, of any structure, with its 90 % interval: low, estimate, high.
    pub gain: [f64; 3],
    /// Dead time and actuator lags together (s).
    pub delay_s: f64,
}

impl Found {
    fn relative_width(&self) -> f64 {
        (self.gain[2] - self.gain[0]) / self.gain[1].abs()
    }
}

impl FlightLoop {
    /// Gains in force on the process of the best part. `None`: not known.
    #[must_use]
    pub fn in_force(&self) -> Option<Judged> {
        let against = self.choice.as_ref()?.against.as_ref()?;
        Judged::of(&against.controller, against.figures)
    }

    /// Proposed controller for that process.
    #[must_use]
    pub fn proposed(&self) -> Option<Judged> {
        let (design, figures) = self.choice.as_ref()?.design()?;
        Judged::of(&design.controller, Some(*figures))
    }

    /// Index of the part with the narrowest interval of the gain.
    #[must_use]
    pub fn best(&self) -> Option<usize> {
        let widths = self.parts.iter().enumerate().filter_map(|(at, part)| {
            let found = part.outcome.as_ref().ok()?;
            Some((at, found.relative_width()))
        });
        widths.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(at, _)| at)
    }

    /// Why the first part is refused, where no part tells anything. `None`: one does, or no part can be used.
    #[must_use]
    pub fn refusal(&self) -> Option<&Verdict> {
        let shown = self.shown.as_ref().filter(|_| self.best().is_none())?;
        shown.identification.outcome.as_ref().err()
    }

    /// What the parts tell, the best one first.
    #[must_use]
    pub fn told(&self) -> Vec<Found> {
        let found = |at: usize| self.parts[at].outcome.as_ref().ok().copied();
        let Some((best, first)) = self.best().and_then(|at| Some((at, found(at)?))) else {
            return vec![];
        };
        let others = (0..self.parts.len()).filter(|at| *at != best);
        std::iter::once(first)
            .chain(others.filter_map(found))
            .collect()
    }

    /// Gain of the best part, with an interval that holds those of all parts: its ends grow by what the parts differ.
    #[must_use]
    pub fn gain(&self) -> Option<[f64; 3]> {
        let told = self.told();
        let first = told.first()?;
        let hold = |[low, estimate, high]: [f64; 3], other: &Found| {
            [low.min(other.gain[0]), estimate, high.max(other.gain[2])]
        };
        Some(told.iter().fold(first.gain, hold))
    }

    /// Whether the intervals of two parts have no value in common.
    #[must_use]
    pub fn parts_disagree(&self) -> bool {
        let told = self.told();
        let low = told
            .iter()
            .map(|found| found.gain[0])
            .fold(f64::NEG_INFINITY, f64::max);
        let high = told
            .iter()
            .map(|found| found.gain[2])
            .fold(f64::INFINITY, f64::min);
        low > high
    }
}
