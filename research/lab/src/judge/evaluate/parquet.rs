//! The recordings of a benchmark as one Parquet file.
//!
//! ```text
//! columns      experiment INT64, time_s, output, input DOUBLE; no value is missing
//! row groups   one an experiment, in order; nothing compressed
//! ```
//!
//! Reference: Apache Parquet, "parquet-format", version 2.

use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{Repetition, Type};
use parquet::column::reader::get_typed_column_reader;
use parquet::data_type::{DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type as Schema;

use crate::PROGRAM;
use crate::experiments::Recorded;

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
    /// Errors of `out`.
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
    /// Errors of the output.
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

    /// Writes the footer.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn finish(self) -> io::Result<()> {
        self.0.close()?;
        Ok(())
    }
}

/// Reads recordings, one at a time and on one thread, because the file has one position.
pub struct Reader(SerializedFileReader<File>);

impl Reader {
    /// Opens a file that a [`Writer`] has written.
    ///
    /// # Errors
    /// Errors of the file; it is not Parquet, or has other columns.
    pub fn new(file: File) -> io::Result<Self> {
        let reader = SerializedFileReader::new(file)?;
        let schema = reader.metadata().file_metadata().schema_descr();
        let found = schema.columns().iter();
        let is_right = found
            .map(|column| (column.name(), column.physical_type()))
            .eq(COLUMNS);
        if !is_right {
            return Err(malformed(
                "its columns are not those of recordings".to_owned(),
            ));
        }
        Ok(Self(reader))
    }

    /// The recording of an experiment; experiments are numbered from one.
    ///
    /// # Errors
    /// Errors of the file; it has no such experiment, or another one in its place.
    pub fn recording(&self, experiment: u64) -> io::Result<Recorded> {
        let missing = || malformed(format!("the file has no experiment {experiment}"));
        let index = usize::try_from(experiment).unwrap_or(0);
        if !(1..=self.0.num_row_groups()).contains(&index) {
            return Err(missing());
        }
        let group = self.0.get_row_group(index - 1)?;
        let numbers = column::<Int64Type>(&*group, 0)?;
        if numbers
            .iter()
            .any(|number| number.cast_unsigned() != experiment)
        {
            return Err(missing());
        }
        Ok(Recorded {
            time_s: column::<DoubleType>(&*group, 1)?,
            output: column::<DoubleType>(&*group, 2)?,
            input: column::<DoubleType>(&*group, 3)?,
            hysteresis: 0.0,
        })
    }
}

/// All values of a column of a row group.
fn column<T: DataType>(group: &dyn RowGroupReader, number: usize) -> io::Result<Vec<T::T>> {
    let mut reader = get_typed_column_reader::<T>(group.get_column_reader(number)?);
    let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let mut values = Vec::new();
    reader.read_records(rows, None, None, &mut values)?;
    Ok(values)
}

fn malformed(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, reason)
}
