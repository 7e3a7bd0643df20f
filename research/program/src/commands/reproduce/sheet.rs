//! The sheet of a part of the paper, a TOML file in the program: settings, captions, the paper's numbers and remarks.
//!
//! ```text
//! settings of the sheet                           ->  Numbers, kept in the journal
//! captions, paper's numbers, remarks  +  Numbers  ->  ReproducedPart, which the report shows
//! ```
//!
//! A sheet has only the paper's numbers, `Numbers` has only computed ones.

use std::collections::BTreeMap;

use onecycle_cli::failure::Failure;
use onecycle_cli::pages::plot::{Axis, Figure, Panel};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::args::Name;
use crate::results::reproduction::{ComparedCell, ComparedTable, Numbers, ReproducedPart, Row};

/// A file of `research/program/reproduction`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sheet {
    title: String,
    source: String,
    /// Settings of both sizes.
    #[serde(default)]
    settings: toml::Table,
    /// Additional settings of the full run.
    full: toml::Table,
    /// Additional settings of the quick run.
    quick: toml::Table,
    #[serde(default)]
    tables: Vec<TableSheet>,
    #[serde(default)]
    figures: Vec<FigureSheet>,
    remarks: Vec<String>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FigureSheet {
    caption: String,
    x: Axis,
    y: Axis,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableSheet {
    caption: String,
    /// The first column has the names of the rows.
    columns: Vec<String>,
    /// The paper's cells by the name of the row.
    #[serde(default)]
    paper: BTreeMap<String, Vec<String>>,
}

impl Sheet {
    /// The sheet of a part.
    pub(super) fn of(name: Name) -> Result<Self, Failure> {
        let text = match name {
            Name::Phase => include_str!("../../../reproduction/phase.toml"),
            Name::Grid => include_str!("../../../reproduction/grid.toml"),
            Name::GridVariants => include_str!("../../../reproduction/grid_variants.toml"),
            Name::Figures => include_str!("../../../reproduction/figures.toml"),
            Name::Table2And3 => include_str!("../../../reproduction/table_2_and_3.toml"),
            Name::Ablation => include_str!("../../../reproduction/ablation.toml"),
            Name::OurNetwork => include_str!("../../../reproduction/our_network.toml"),
            Name::Table4 => include_str!("../../../reproduction/table_4.toml"),
            Name::TuningRules => include_str!("../../../reproduction/tuning_rules.toml"),
            Name::RuleVariants => include_str!("../../../reproduction/rule_variants.toml"),
            Name::Table5 => include_str!("../../../reproduction/table_5.toml"),
            Name::Table6 => include_str!("../../../reproduction/table_6.toml"),
            Name::Table7 => include_str!("../../../reproduction/table_7.toml"),
            Name::Modes => include_str!("../../../reproduction/modes.toml"),
            Name::Claims => include_str!("../../../reproduction/claims.toml"),
        };
        toml::from_str(text).map_err(Failure::usage)
    }

    /// The settings of a run.
    pub(super) fn settings(&self, quick: bool) -> toml::Table {
        let mut settings = self.settings.clone();
        settings.extend(if quick { &self.quick } else { &self.full }.clone());
        settings
    }

    /// Joins the sheet with the computed numbers.
    pub(super) fn part(self, name: Name, found: Numbers) -> ReproducedPart {
        let tables = self.tables.into_iter().zip(found.tables);
        let figures = self.figures.into_iter().zip(found.figures);
        ReproducedPart {
            name: name.as_str(),
            title: self.title,
            source: self.source,
            tables: tables.map(|(sheet, rows)| compared(sheet, rows)).collect(),
            figures: figures
                .map(|(FigureSheet { caption, x, y }, series)| {
                    Figure::single(&caption, x, Panel::new(y, series))
                })
                .collect(),
            remarks: self.remarks,
        }
    }
}

/// A table with the paper's cells beside the computed ones.
fn compared(sheet: TableSheet, rows: Vec<Row>) -> ComparedTable {
    let row = |row: Row| {
        let paper = sheet.paper.get(&row.name);
        let cells = row.cells.into_iter().enumerate();
        let cells = cells.map(|(column, ours)| ComparedCell {
            ours,
            paper: paper
                .and_then(|cells| cells.get(column))
                .filter(|text| !text.is_empty())
                .cloned(),
        });
        (row.name, cells.collect())
    };
    ComparedTable {
        rows: rows.into_iter().map(row).collect(),
        caption: sheet.caption,
        columns: sheet.columns,
    }
}

/// Settings as the type of a part.
pub(super) fn typed<T: DeserializeOwned>(settings: &toml::Table) -> Result<T, Failure> {
    settings.clone().try_into().map_err(Failure::usage)
}

#[cfg(test)]
mod tests {
    use super::*;

    // Every sheet can be read, has a table or a figure, and a remark on the differences; no row has more cells of the
    // paper than there are columns.
    #[test]
    fn sheets_are_well_formed() {
        for name in Name::ALL {
            let sheet = Sheet::of(name).unwrap();
            assert!(!sheet.remarks.is_empty(), "{name:?}");
            assert!(sheet.tables.len() + sheet.figures.len() > 0, "{name:?}");
            for table in &sheet.tables {
                for (row, cells) in &table.paper {
                    assert!(cells.len() < table.columns.len(), "{name:?}, {row}");
                }
            }
        }
    }
}
