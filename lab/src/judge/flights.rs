//! What the tuning of a flight was worth: held against the process that the vehicle was at that moment.

use onecycle_plant::Trace;
use onecycle_plant::multirotor::{Axis, FlightRecord, Tuned};

use crate::judge::evaluate::Judge;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_design::soiptd_pd::optimum::OptimumError;

/// What the controller of a tuned axis costs on the true process, and the phase margin it leaves there.
///
/// # Errors
/// Where the true process has no optimum.
pub fn judged(tuned: &Tuned) -> Result<Deterioration, OptimumError> {
    Ok(Judge::new(&tuned.truth)?.deterioration(tuned.identified.pd))
}

/// The signals of an axis in flight, as its tuner saw them.
#[must_use]
pub fn trace(records: &[FlightRecord], axis: Axis) -> Trace {
    let mut trace = Trace::with_capacity(records.len());
    for record in records {
        let index = axis.index();
        trace.push(
            record.time_s,
            record.commands[index],
            record.measured[index],
            axis.of(&record.reading).0,
        );
    }
    trace
}
