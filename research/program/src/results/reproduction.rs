//! Result of `onecycle-lab reproduce`: tables and figures of the paper with this program's numbers.

use onecycle_cli::pages::plot::{Figure, Series};
use serde::{Deserialize, Serialize};

/// Numbers computed for one part of the paper.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Numbers {
    /// Rows of each table.
    pub(crate) tables: Vec<Vec<Row>>,
    /// Series of each figure.
    pub(crate) figures: Vec<Vec<Series>>,
}

/// A row of computed numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Name of the row; the paper's row has the same name.
    pub(crate) name: String,
    /// One cell for each column.
    pub(crate) cells: Vec<String>,
}

impl Row {
    pub(crate) fn new(name: impl Into<String>, cells: impl IntoIterator<Item = String>) -> Self {
        Self {
            name: name.into(),
            cells: cells.into_iter().collect(),
        }
    }
}

/// The cell of a number; a dash without one.
pub(crate) fn or_dash(value: Option<f64>, text: fn(f64) -> String) -> String {
    value.map_or("-".to_owned(), text)
}

/// One part of the paper, ready to be shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ReproducedPart {
    pub(crate) name: &'static str,
    pub(crate) title: String,
    /// Section or table of the paper.
    pub(crate) source: String,
    pub(crate) tables: Vec<ComparedTable>,
    pub(crate) figures: Vec<Figure>,
    pub(crate) remarks: Vec<String>,
}

/// A table with the paper's numbers beside the computed ones.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ComparedTable {
    pub(crate) caption: String,
    pub(crate) columns: Vec<String>,
    /// Name of each row and its cells.
    pub(crate) rows: Vec<(String, Vec<ComparedCell>)>,
}

/// One computed value, and the paper's value if it has one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ComparedCell {
    pub(crate) ours: String,
    pub(crate) paper: Option<String>,
}
