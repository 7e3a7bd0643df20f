//! Arrays of numbers of a MAT-file, by columns, under the names of their variables and fields.

use super::elements::{COMPRESSED, Element, Elements, MATRIX, text_of};
use crate::csv::error::ReadError;

/// Classes of arrays.
const STRUCTURE: u32 = 2;
const NUMBERS: std::ops::RangeInclusive<u32> = 6..=15;

/// Maximum depth of structures in each other.
const DEEPEST: usize = 6;

/// Maximum number of numbers over all columns.
const MOST_NUMBERS: usize = 1 << 24;

/// Maximum number of columns.
const MOST_COLUMNS: usize = 4096;

/// A matrix with more columns than this holds no signals.
const WIDEST: usize = 64;

/// Fewest rows of a signal.
const FEWEST_ROWS: usize = 4;

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ArrayColumn {
    /// Names of the structures around it, joined by points; empty for a variable.
    pub(super) path: String,
    pub(super) name: String,
    pub(super) values: Vec<f64>,
}

#[derive(Debug, Default)]
pub(super) struct Arrays {
    pub(super) columns: Vec<ArrayColumn>,
    numbers: usize,
    variables: Vec<String>,
}

impl Arrays {
    /// Names of the variables, for an error.
    pub(super) fn names(&self) -> Vec<String> {
        self.variables.iter().take(12).cloned().collect()
    }

    /// Reads all variables.
    ///
    /// # Errors
    /// There are too many numbers.
    pub(super) fn read(&mut self, variables: Elements<'_>) -> Result<(), ReadError> {
        for element in variables {
            match element.kind {
                MATRIX => self.matrix(&element, "", None, 0)?,
                COMPRESSED => {
                    let Some(bytes) = element.inflated() else {
                        continue;
                    };
                    for inner in element.with_inflated(&bytes) {
                        if inner.kind == MATRIX {
                            self.matrix(&inner, "", None, 0)?;
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Reads an array: flags with the class, dimensions, name, content. `name`: that of its field.
    fn matrix(
        &mut self,
        array: &Element<'_>,
        path: &str,
        name: Option<String>,
        depth: usize,
    ) -> Result<(), ReadError> {
        let mut parts = array.inside();
        let (Some(flags), Some(dimensions), Some(own)) = (parts.next(), parts.next(), parts.next())
        else {
            return Ok(());
        };
        let class = flags.words().first().map_or(0, |flags| flags & 0xff);
        let dimensions: Vec<usize> = dimensions.words().iter().map(|&n| n as usize).collect();
        let name = name.unwrap_or_else(|| own.text());
        if depth == 0 && self.variables.len() < MOST_COLUMNS {
            self.variables.push(name.clone());
        }
        if class == STRUCTURE && depth < DEEPEST {
            self.structure(parts, path, &name, depth)
        } else if NUMBERS.contains(&class) {
            match (dimensions.as_slice(), parts.next()) {
                (&[rows, columns], Some(real)) => self.numbers(&real, [rows, columns], path, &name),
                _ => Ok(()),
            }
        } else {
            Ok(())
        }
    }

    /// Reads a structure, or an array of them: length and text of the names of its fields, then the fields of each.
    fn structure(
        &mut self,
        mut parts: Elements<'_>,
        path: &str,
        name: &str,
        depth: usize,
    ) -> Result<(), ReadError> {
        let (Some(length), Some(names)) = (parts.next(), parts.next()) else {
            return Ok(());
        };
        let length = length.words().first().map_or(0, |&length| length as usize);
        if length == 0 {
            return Ok(());
        }
        let names: Vec<String> = names.data.chunks(length).map(text_of).collect();
        let fields = parts.filter(|part| part.kind == MATRIX).enumerate();
        for (at, field) in fields {
            let (index, field_at) = (at / names.len().max(1), at % names.len().max(1));
            let Some(own) = names.get(field_at) else {
                break;
            };
            let numbered = match index {
                0 => name.to_owned(),
                _ => format!("{name}_{}", index + 1),
            };
            let inner = match path {
                "" => numbered,
                _ => format!("{path}.{numbered}"),
            };
            if inner.len() > 256 || self.columns.len() >= MOST_COLUMNS {
                break;
            }
            self.matrix(&field, &inner, Some(own.clone()), depth + 1)?;
        }
        Ok(())
    }

    /// Adds the columns of a matrix; of one that is wider than high, its rows.
    fn numbers(
        &mut self,
        real: &Element<'_>,
        [rows, columns]: [usize; 2],
        path: &str,
        name: &str,
    ) -> Result<(), ReadError> {
        let is_wide = columns > rows;
        let (length, count) = (rows.max(columns), rows.min(columns));
        let Some((values, size)) = real.numbers() else {
            return Ok(());
        };
        let is_whole = rows.checked_mul(columns) == Some(size);
        if !is_whole || length < FEWEST_ROWS || !(1..=WIDEST).contains(&count) {
            return Ok(());
        }
        if self.numbers + size > MOST_NUMBERS || self.columns.len() + count > MOST_COLUMNS {
            return Err(ReadError::MatTooLarge);
        }
        let values: Vec<f64> = values.collect();
        self.numbers += size;
        for at in 0..count {
            // By columns in the file.
            let value = |row: usize| match is_wide {
                true => values[row * rows + at],
                false => values[at * rows + row],
            };
            self.columns.push(ArrayColumn {
                path: path.to_owned(),
                name: match count {
                    1 => name.to_owned(),
                    _ => format!("{name}_{}", at + 1),
                },
                values: (0..length).map(value).collect(),
            });
        }
        Ok(())
    }
}
