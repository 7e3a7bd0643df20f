//! Datasets as one table in one file: Parquet.
//!
//! ```text
//! columns      those of the shards; of several numbers a row, each number its own column:
//!              number, family, inputs_00 .. inputs_33, values_0 .. values_3, .., samples_per_period
//! types        INT64 without sign, FLOAT, DOUBLE; no value is missing
//! row groups   one for every lot of records that is added; nothing compressed, no dictionaries
//! ```
//!
//! Meanings and units are those of the [shards](super::shards). Reference: Apache Parquet,
//! "parquet-format", version 2.

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type};
use parquet::data_type::{DataType, DoubleType, FloatType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type as Schema;

use super::shards::{ExampleRecord, columns};
use crate::PROGRAM;
use crate::learn::npz::{Column, Numbers};

/// Writes a table, some rows at a time; 4096 rows, as in a file of a dataset, are a good size.
pub struct Writer<W: Write + Send>(SerializedFileWriter<W>);

impl<W: Write + Send> Writer<W> {
    /// A table without rows.
    ///
    /// # Errors
    /// Errors of `out`.
    pub fn new(out: W) -> io::Result<Self> {
        let fields: Result<Vec<_>, ParquetError> = (columns(&[]).iter())
            .flat_map(|column| names(column).into_iter().map(move |name| (name, column)))
            .map(|(name, column)| {
                let (stored, meant) = types(&column.numbers);
                let field = Schema::primitive_type_builder(&name, stored)
                    .with_logical_type(meant)
                    .with_repetition(Repetition::REQUIRED);
                field.build().map(Arc::new)
            })
            .collect();
        let schema = Schema::group_type_builder("examples").with_fields(fields?);
        let properties = WriterProperties::builder()
            .set_created_by(PROGRAM.to_owned())
            // Hardly any number occurs twice, so a dictionary would make the file longer.
            .set_dictionary_enabled(false)
            .build();
        let writer =
            SerializedFileWriter::new(out, Arc::new(schema.build()?), Arc::new(properties))?;
        Ok(Self(writer))
    }

    /// Adds rows.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn add(&mut self, records: &[ExampleRecord]) -> io::Result<()> {
        let mut group = self.0.next_row_group()?;
        for column in columns(records) {
            match &column.numbers {
                Numbers::U64(numbers) => {
                    let numbers: Vec<i64> = numbers.iter().map(|x| x.cast_signed()).collect();
                    add_columns::<Int64Type, W>(&mut group, &column, &numbers)?;
                }
                Numbers::F32(numbers) => {
                    add_columns::<FloatType, W>(&mut group, &column, numbers)?;
                }
                Numbers::F64(numbers) => {
                    add_columns::<DoubleType, W>(&mut group, &column, numbers)?;
                }
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

/// Physical type of the numbers, and their logical type if that differs.
fn types(numbers: &Numbers) -> (Type, Option<LogicalType>) {
    match numbers {
        Numbers::U64(_) => (Type::INT64, Some(LogicalType::integer(64, false))),
        Numbers::F32(_) => (Type::FLOAT, None),
        Numbers::F64(_) => (Type::DOUBLE, None),
    }
}

/// Names of the columns for one array, numbered with as many digits as needed.
fn names(column: &Column) -> Vec<String> {
    let name = column.name;
    match column.width {
        None => vec![name.to_owned()],
        Some(width) if width <= 10 => (0..width).map(|k| format!("{name}_{k}")).collect(),
        Some(width) => (0..width).map(|k| format!("{name}_{k:02}")).collect(),
    }
}

fn add_columns<T: DataType, W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    column: &Column,
    numbers: &[T::T],
) -> Result<(), ParquetError> {
    let width = column.width.unwrap_or(1);
    for k in 0..width {
        let of_one: Vec<T::T> = numbers.iter().skip(k).step_by(width).cloned().collect();
        if let Some(mut writer) = group.next_column()? {
            writer.typed::<T>().write_batch(&of_one, None, None)?;
            writer.close()?;
        }
    }
    Ok(())
}
