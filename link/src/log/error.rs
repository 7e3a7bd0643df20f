//! Why a flight log gives no signals.

use std::io;

use thiserror::Error;

use super::loops::ControlLoop;
use super::tables::LogFormat;
use crate::recording::RecordingError;

/// Why a flight log gives no signals. `Display` states the fact; what to do about it is up to the caller.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LogError {
    /// The log could not be read to its end.
    #[error("reading stopped at byte {position}: {reason}")]
    Interrupted {
        /// Bytes read before.
        position: u64,
        /// Why.
        #[source]
        reason: io::Error,
    },
    /// The first bytes are those of no flight log that is known.
    #[error("this is not a ULog, DataFlash, blackbox or MCAP log")]
    UnknownFormat,
    /// The library was built without the feature that reads this format.
    #[error("this build does not read {0:?} files")]
    NotBuilt(LogFormat),
    /// The log has no row of data.
    #[error("the log holds no data")]
    Empty,
    /// The log has fewer flights.
    #[error("there is no flight {wanted}; the log holds {flights}")]
    NoSuchFlight {
        /// The flight asked for, from 1.
        wanted: usize,
        /// Flights in the log.
        flights: usize,
    },
    /// The firmware did not log the signals of this loop.
    #[error(
        "the log lacks the signals of the {control_loop} loop{}{}",
        if .missing.is_empty() { "" } else { ": " },
        .missing.join(", ")
    )]
    NotLogged {
        /// The loop asked for.
        control_loop: ControlLoop,
        /// What would be needed, as the firmware names it.
        missing: Vec<String>,
    },
    /// The joined samples make no recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}
