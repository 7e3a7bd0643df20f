//! Evaluation of tuning in flight, against the true process of the vehicle at that moment.

use onecycle_design::soiptd_pd::deterioration::{Deterioration, Reference};
use onecycle_design::soiptd_pd::optimum::OptimumError;

use super::{Axis, FlightRecord, Tuned};
use crate::Trace;

/// Cost of a tuned axis's controller on the true process, and its phase margin there.
///
/// # Errors
/// [`OptimumError`]: the true process has no optimum.
pub fn judged(tuned: &Tuned) -> Result<Deterioration, OptimumError> {
    Ok(Reference::new(&tuned.truth)?.deterioration(tuned.identified.pd))
}

/// Signals of an axis in flight, as its tuner saw them.
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
