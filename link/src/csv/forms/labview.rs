//! LabVIEW measurement files (`.lvm`): a header, and segments with a header of their own.
//!
//! Reference: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".

use super::fields::{Fields, Lines, field};

/// How a file begins.
pub(super) const MAGIC: &[u8] = b"LabVIEW Measurement";

/// A file as far as it was read.
#[derive(Debug, Default)]
pub(super) struct Measurement {
    stage: Stage,
    is_comma: bool,
    columns: XColumns,
    /// Of the segment.
    units: Vec<String>,
    is_time: bool,
    start: f64,
    step: f64,
    names: Vec<String>,
    row: f64,
}

#[derive(Debug, Default, Clone, Copy, PartialEq)]
enum Stage {
    #[default]
    Outside,
    Header,
    Segment,
    Names,
    Rows,
}

#[derive(Debug, Default, Clone, Copy, PartialEq)]
enum XColumns {
    #[default]
    One,
    Multi,
    No,
}

impl Lines for Measurement {
    fn fields(&mut self, line: &str) -> Fields {
        match self.stage {
            Stage::Outside => {
                if line.as_bytes().starts_with(MAGIC) {
                    self.stage = Stage::Header;
                }
                vec![]
            }
            Stage::Header | Stage::Segment => {
                self.entry(line);
                vec![]
            }
            Stage::Names => {
                self.names = self.cells(line).into_iter().map(str::to_owned).collect();
                (self.stage, self.row) = (Stage::Rows, 0.0);
                vec![]
            }
            Stage::Rows => self.values(line),
        }
    }
}

impl Measurement {
    /// Cells of a line; the empty first cell of a file without times is kept.
    fn cells<'a>(&self, line: &'a str) -> Vec<&'a str> {
        let cells = line.split(if self.is_comma { ',' } else { '\t' });
        cells.map(str::trim).collect()
    }

    fn entry(&mut self, line: &str) {
        let cells: Vec<String> = self.cells(line).into_iter().map(str::to_owned).collect();
        let value = cells.get(1).map_or("", String::as_str);
        let number = |text: &str| text.replace(',', ".").parse::<f64>().unwrap_or(0.0);
        match cells.first().map_or("", String::as_str) {
            // The value of the separator cannot be split by it.
            _ if line.starts_with("Separator") => self.is_comma = line.ends_with("Comma"),
            "X_Columns" => {
                self.columns = match value {
                    "No" => XColumns::No,
                    "Multi" => XColumns::Multi,
                    _ => XColumns::One,
                }
            }
            "Y_Unit_Label" => self.units = cells.get(1..).unwrap_or_default().to_vec(),
            "X_Dimension" => self.is_time = value == "Time",
            "X0" => self.start = number(value),
            "Delta_X" => self.step = number(value),
            end if end.starts_with("***End_of_Header") => {
                self.stage = match self.stage {
                    Stage::Header => Stage::Segment,
                    _ => Stage::Names,
                }
            }
            _ => {}
        }
    }

    fn values(&mut self, line: &str) -> Fields {
        // `trim` has taken the empty cell before the first value, and those at the end.
        let mut cells = self.cells(line);
        if cells.first().is_some_and(|cell| *cell == "Channels") {
            self.stage = Stage::Segment;
            return vec![];
        }
        let time_name = if self.is_time { "time [s]" } else { "X_Value" };
        let mut time = None;
        if self.columns == XColumns::No {
            if cells.first() == Some(&"") {
                cells.remove(0);
            }
            time = Some((
                time_name.to_owned(),
                (self.start + self.row * self.step).to_string(),
            ));
            cells.insert(0, "");
        }
        self.row += 1.0;
        let mut fields: Fields = Vec::new();
        let mut channel = 0;
        for (name, cell) in self.names.iter().zip(cells) {
            match name.as_str() {
                "Comment" => {}
                "X_Value" if self.columns == XColumns::No => {}
                "X_Value" => {
                    let found = field(time_name, cell);
                    // Channels with times of their own are read where these agree.
                    if time.is_some() && found != time {
                        return vec![];
                    }
                    time = found;
                }
                name => {
                    let unit = self.units.get(channel).filter(|unit| !unit.is_empty());
                    channel += 1;
                    let name =
                        unit.map_or_else(|| name.to_owned(), |unit| format!("{name} [{unit}]"));
                    fields.extend(field(name, cell));
                }
            }
        }
        match (time, fields.is_empty()) {
            (Some(time), false) => std::iter::once(time).chain(fields).collect(),
            _ => vec![],
        }
    }
}
