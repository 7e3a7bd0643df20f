//! Flight logs: PX4 ULog, ArduPilot DataFlash, Betaflight and INAV blackbox.
//!
//! ```text
//! bytes -> tables     flights, topics, parameters; only the chosen columns     ulog.rs, dataflash.rs, blackbox.rs
//! ```

mod blackbox;
mod dataflash;
mod error;
mod loops;
mod scalar;
mod source;
mod tables;
mod ulog;

use std::io::Read;

pub use error::LogError;
pub use loops::{Axis, ControlLoop};
pub use tables::{FlightTables, LogFormat, LogParameter, LogTables, Loss, Topic, Wanted};

use self::source::Source;

/// Reads the tables of a flight log, in one pass. `bytes` need not be buffered.
///
/// Damage is skipped and counted in [`LogTables::loss`].
///
/// # Errors
/// The first bytes are those of no log that is known, or reading stopped.
pub fn read_tables(bytes: impl Read, wanted: &Wanted) -> Result<LogTables, LogError> {
    let mut source = Source::new(bytes);
    match LogFormat::detect(source.peek(LogFormat::HEAD_BYTES)?) {
        Some(LogFormat::ULog) => ulog::read(source, wanted),
        Some(LogFormat::DataFlash) => dataflash::read(source, wanted),
        Some(LogFormat::DataFlashText) => dataflash::read_text(source, wanted),
        Some(LogFormat::Blackbox) => blackbox::read(source, wanted),
        None => Err(LogError::UnknownFormat),
    }
}
