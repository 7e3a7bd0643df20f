//! The recordings of a benchmark as one Parquet file.
//!
//! ```text
//! columns      experiment INT64, time_s, output, input DOUBLE; no value is missing
//! row groups   one an experiment, in order; nothing compressed
//! ```
//!
//! Reference: Apache Parquet, "parquet-format", version 2.

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{Repetition, Type};
use parquet::data_type::{DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type as Schema;

use super::Recorded;
use crate::dataset::shards::PROGRAM;

/// Columns and how they are stored.
const COLUMNS: [(&str, Type); 4] = [
    ("experiment", Type::INT64),
    ("time_s", Type::DOUBLE),
    ("output", Type::DOUBLE),
    ("input", Type::DOUBLE),
];

/// Writes recordings, one at a time.
pub struct Writer<W: Write + Send>(SerializedFileWriter<W>);

impl<W: Write + Send> Writer<W> {
    /// A file without recordings.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W) -> io::Result<Self> {
        let fields: Result<Vec<_>, ParquetError> = (COLUMNS.iter())
            .map(|&(name, stored)| {
                let field = Schema::primitive_type_builder(name, stored);
                field
                    .with_repetition(Repetition::REQUIRED)
                    .build()
                    .map(Arc::new)
            })
            .collect();
        let schema = Schema::group_type_builder("recordings").with_fields(fields?);
        let properties = WriterProperties::builder().set_created_by(PROGRAM.to_owned());
        Ok(Self(SerializedFileWriter::new(
            out,
            Arc::new(schema.build()?),
            Arc::new(properties.build()),
        )?))
    }

    /// Adds the recording of an experiment.
    ///
    /// # Errors
    /// Those of what it writes to.
    pub fn add(&mut self, experiment: u64, recorded: &Recorded) -> io::Result<()> {
        let mut group = self.0.next_row_group()?;
        if let Some(mut column) = group.next_column()? {
            let numbers = vec![experiment.cast_signed(); recorded.time_s.len()];
            column
                .typed::<Int64Type>()
                .write_batch(&numbers, None, None)?;
            column.close()?;
        }
        for values in [&recorded.time_s, &recorded.output, &recorded.input] {
            if let Some(mut column) = group.next_column()? {
                column
                    .typed::<DoubleType>()
                    .write_batch(values, None, None)?;
                column.close()?;
            }
        }
        group.close()?;
        Ok(())
    }

    /// Writes what tells a reader where all is.
    ///
    /// # Errors
    /// Those of what it writes to.
    pub fn finish(self) -> io::Result<()> {
        self.0.close()?;
        Ok(())
    }
}
