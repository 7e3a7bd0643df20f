//! Files of a limited size.

pub(crate) use onecycle_cli::reading::{MOST_OF_SETTINGS, bytes_at_most, text_at_most};

/// Largest file of a table, such as the answers of a benchmark or a grid with its matrix, in bytes.
pub(crate) const MOST_OF_A_TABLE: u64 = 1 << 28;
