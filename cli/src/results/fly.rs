//! Result of `onecycle fly`: simulated flights and how good their controllers are.

use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_identify::cycles::Cycles;
use onecycle_plant::multirotor::{Flown, Mission, Tuned};

/// One flight and its evaluation.
pub(crate) struct Flight {
    pub(crate) flown: Flown,
    /// Every tuned axis with the cost of its controller on the true process.
    pub(crate) judged: Vec<(Tuned, Deterioration)>,
    /// Cycles of [`Mission::Cycles`], if each of them identifies a process.
    pub(crate) cycles: Option<Cycles>,
}

/// All flights of one mission. Only the first keeps its samples.
pub(crate) struct MissionFlights {
    pub(crate) mission: Mission,
    pub(crate) flights: Vec<Flight>,
}
