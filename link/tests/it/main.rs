//! Tests of the reader through its public interface.

mod averaging;
mod awkward;
mod dialects;
mod flight_logs;
mod hostile;
mod instruments;
#[cfg(feature = "matlab")]
mod matlab;
#[cfg(feature = "mcap")]
mod mcap;
mod plant;
mod refusals;
mod step;
mod tools;
