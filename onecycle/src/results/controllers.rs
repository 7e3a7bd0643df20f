//! Controllers of a process to choose from, with the figures of each.

use crate::{Assessment, Controller, Design, LeastMargins, Proposal, Specification};
use onecycle_design::{Missed, Spans, Vendor};

/// Controllers of a process, one for each style, and the gains in force.
pub struct Controllers {
    /// The requirements of the chosen one, with what the recording added.
    pub asked: Specification,
    /// One row for each style, the chosen one included.
    pub rows: Vec<Row>,
    /// The gains in force. `None`: not known.
    pub against: Option<Against>,
    /// The limits that the chosen controller does not keep.
    pub missed: Vec<Missed>,
    /// Time constant (s) of a filter of the reference with which the chosen controller keeps the overshoot, if it needs one.
    pub reference_filter_s: Option<f64>,
    /// Designs for the most probable process over limits of `Ms`, in ascending order. Empty unless a page is drawn.
    pub trade_off: Vec<(f64, Assessment, Controller)>,
    /// Where the process comes from.
    pub source: Source,
    /// The controller of a process control system in which the gains are typed, and its ranges.
    pub plant: Option<(Vendor, Spans)>,
    /// The model as the devices of this controller take it: a name, and what is typed. `None`: they take none.
    pub device_model: Option<(&'static str, String)>,
}

/// Where the model comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// It is known.
    Process,
    /// A recording, whose noise and sample period complete the requirements.
    Recording,
    /// The middle of the processes that agree with an oscillation.
    Oscillation,
}

/// A proposal and its figures.
#[derive(Clone)]
pub struct Row {
    /// The design of a style, or the reason why it failed.
    pub proposal: Proposal,
    /// `None` without a controller.
    pub figures: Option<Assessment>,
}

/// The gains in force, judged like the proposals.
pub struct Against {
    /// The controller.
    pub controller: Controller,
    /// Time (s) of the measurement filter, if one was added: the process needs one and the user gave none.
    pub filter_s: Option<f64>,
    /// `None` if the loop is unstable.
    pub figures: Option<Assessment>,
    /// Margins over the posterior. `None` without one.
    pub least: Option<LeastMargins>,
}

impl Controllers {
    /// Whether a row is that of the chosen style.
    #[must_use]
    pub fn is_chosen(&self, row: &Row) -> bool {
        row.proposal.specification.style == self.asked.style
    }

    /// The row of the chosen controller.
    #[must_use]
    pub fn chosen(&self) -> Option<&Row> {
        self.rows.iter().find(|row| self.is_chosen(row))
    }

    /// The chosen controller and its figures. `None` if there is no controller.
    #[must_use]
    pub fn design(&self) -> Option<(&Design, &Assessment)> {
        let row = self.chosen()?;
        row.proposal.outcome.as_ref().ok().zip(row.figures.as_ref())
    }

    /// Load IAE that others are compared with: that of the chosen controller, or of the first one with an integral.
    #[must_use]
    pub fn load_reference(&self) -> Option<f64> {
        let of = |row: &Row| row.figures?.load_iae.filter(|iae| iae.is_finite());
        (self.chosen().and_then(of)).or_else(|| self.rows.iter().find_map(of))
    }
}
