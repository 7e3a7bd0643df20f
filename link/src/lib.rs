#![doc = include_str!("../README.md")]

mod altitude_gains;
mod csv;
mod gains;
mod log;
mod parameter_files;
mod recording;
mod time_unit;
mod typed_gains;

pub use altitude_gains::AltitudeCascade;
pub use csv::{
    ColumnRef, CsvOptions, CsvWriter, ReadError, SAMPLE_RATES_HZ, read, read_from, write_csv,
};
pub use gains::{Change, GainsError, LoopGains, changes};
pub use log::{
    Agreement, Axis, ControlLoop, Firmware, FirmwareKind, Flight, FlightLog, FlightTables, Gain,
    LogError, LogFormat, LogParameter, LogTables, LoggedLoop, LoggedSignal, Loss, LowPassSetting,
    Mark, MarkKind, RateLaw, ReadBack, ReadTerm, Setting, Signals, Span, Term, Topic, Wanted,
    gain_names, read_tables,
};
pub use parameter_files::{
    ParameterFile, ParameterFileError, ParameterFiles, ParameterLine, files, parameter_text,
    read_parameters,
};
pub use recording::{
    Cell, ChosenBy, Column, ColumnLabel, Columns, GAP_PERIODS, Gap, MAX_POINTS, Note, Position,
    Recording, RecordingBuilder, RecordingError, Role,
};
pub use time_unit::TimeUnit;
pub use typed_gains::{TypedGains, typed_gains};
