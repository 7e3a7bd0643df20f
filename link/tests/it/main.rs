//! Tests of the reader through its public interface.

mod averaging;
mod dialects;
mod flight_logs;
mod fuzz_targets;
mod hostile;
mod plant;
mod refusals;
