//! What collector and analysis hand to each other.

use super::{BINS, EDGES, FINE_BINS, Refusal, TuningResult};
use crate::cycle::Cycle;
use crate::window::Window;

/// Windows of collected cycles with an order for the [`Analysis`](super::Analysis), or with its outcome. Only one of the
/// two parts uses it at a time: the analysis while [`Desk::is_ordered`], otherwise the collector.
pub struct Desk {
    pub(super) coarse: Window<BINS, EDGES>,
    pub(super) fine: Window<FINE_BINS, 0>,
    pub(super) note: Note,
    /// Orders so far.
    pub(super) orders: u32,
}

/// What lies on the desk beside the windows. Its first tag is zero, and with it an empty desk is all zeros: no copy of it
/// in read-only memory.
#[repr(u8)]
#[derive(Clone, Copy, Debug)]
pub(super) enum Note {
    Empty,
    Order(Order),
    Outcome(Result<TuningResult, Refusal>),
}

/// Order for an analysis of the windows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    pub(super) number: u32,
    /// The first order's last cycle.
    pub(super) cycle: Cycle,
    /// Delay of the rate behind the value (s).
    pub(super) rate_delay_s: f64,
    /// Whether a cycle at another amplitude is to confirm the result.
    pub(super) is_confirming: bool,
}

impl Desk {
    /// An empty desk, all zeros.
    pub const NEW: Self = Self {
        coarse: Window::NONE,
        fine: Window::NONE,
        note: Note::Empty,
        orders: 0,
    };

    /// Whether an order waits for its outcome.
    #[must_use]
    pub fn is_ordered(&self) -> bool {
        matches!(self.note, Note::Order(_))
    }

    /// Takes the outcome, if there is one.
    pub fn take_outcome(&mut self) -> Option<Result<TuningResult, Refusal>> {
        let Note::Outcome(outcome) = self.note else {
            return None;
        };
        self.note = Note::Empty;
        Some(outcome)
    }

    /// Drops an order or an outcome that nobody wants any more.
    pub(crate) fn clear(&mut self) {
        self.note = Note::Empty;
    }
}
