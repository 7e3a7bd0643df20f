//! Bytes from outside: recordings in, tables out.
//!
//! A recording of a relay test reaches this program as a file written by someone else's logger.
//! Every reader of this crate turns such a file into one [`Recording`] or refuses it with one
//! sentence that says what is wrong, where, and what to do. Whatever was forgiven on the way is
//! listed in [`Recording::notes`]. Nothing here panics on any input, nothing returns a number
//! that is not finite, and memory is bounded by [`MAX_POINTS`] however long the file is.
//!
//! ```
//! let file = "time (ms),pv [rad],u\n0,0.00,1\n10,0.02,1\n20,0.05,-1\n";
//! let recording = onecycle_link::read_from(file.as_bytes(), &Default::default())?;
//! assert_eq!(recording.time_s(), [0.0, 0.01, 0.02]);
//! assert_eq!(recording.input(), [1.0, 1.0, -1.0]);
//! assert_eq!(recording.columns().output.unit.as_deref(), Some("rad"));
//! # Ok::<(), onecycle_link::ReadError>(())
//! ```

mod csv;
mod recording;

pub use csv::{
    ColumnRef, CsvOptions, ReadError, SAMPLE_RATES_HZ, TimeUnit, read, read_from, write_csv,
};
pub use recording::{
    Column, Columns, GAP_PERIODS, Gap, MAX_POINTS, Note, Position, Recording, RecordingBuilder,
    RecordingError, Role,
};
