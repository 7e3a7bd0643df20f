//! The finished rows of a grid and of its matrix of costs, kept in the journal.
//!
//! ```text
//! {"thetas_rad":[..]}         angles of all rows
//! {"rays":[{..},..]}          one line for each row, in order
//! {"costs":[..]}              one line for each member, in order: a row of the matrix
//! ```

use std::io;
use std::path::Path;

use onecycle_cli::failure::Failure;
use onecycle_lab::space::grid::{GridSettings, Ray};
use serde::{Deserialize, Serialize};

use crate::journal::Journal;

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    ThetasRad(Vec<f64>),
    Rays(Vec<Ray>),
    Costs(Vec<Option<f64>>),
}

/// The journal and its contents. The costs are not kept in memory: there may be many.
pub(super) struct KeptGrid {
    journal: Journal,
    found: Found,
}

#[derive(Default)]
struct Found {
    thetas_rad: Option<Vec<f64>>,
    rows: Vec<Vec<Ray>>,
    /// Number of lines of costs.
    costs: usize,
}

impl Found {
    fn has_all_rows(&self) -> bool {
        let thetas_rad = self.thetas_rad.as_ref();
        thetas_rad.is_some_and(|thetas_rad| thetas_rad.len() == self.rows.len())
    }

    /// Adds a line; refuses one that is out of order.
    fn take(&mut self, line: Line) -> Result<(), String> {
        let fits = match line {
            Line::ThetasRad(thetas_rad) if self.thetas_rad.is_none() => {
                self.thetas_rad = Some(thetas_rad);
                true
            }
            Line::Rays(rays) if self.thetas_rad.is_some() && !self.has_all_rows() => {
                self.rows.push(rays);
                true
            }
            Line::Costs(costs) if self.has_all_rows() => {
                self.costs += 1;
                let members: usize = self.rows.iter().flatten().map(|ray| ray.rungs).sum();
                costs.len() == members && self.costs <= members
            }
            _ => false,
        };
        if fits {
            Ok(())
        } else {
            Err("is out of order".to_owned())
        }
    }
}

impl KeptGrid {
    /// Opens the journal of these settings beside the output, or begins one.
    pub(super) fn open(
        out: &Path,
        settings: &GridSettings,
        restart: bool,
    ) -> Result<Self, Failure> {
        let mut found = Found::default();
        let folder = Journal::folder_of(out);
        let take = |line| found.take(line);
        let journal = Journal::open(&folder, "grid", settings, restart, take)?;
        if let Some(thetas_rad) = &found.thetas_rad {
            let rows = thetas_rad.len();
            journal.tell_resumed(&match (found.rows.len(), found.costs) {
                (done, 0) => format!("{done} of {rows} rows"),
                (_, costs) => format!("all rows and the costs of {costs} members"),
            });
        }
        Ok(Self { journal, found })
    }

    pub(super) fn thetas_rad(&self) -> Option<&[f64]> {
        self.found.thetas_rad.as_deref()
    }

    pub(super) fn keep_thetas(&mut self, thetas_rad: Vec<f64>) -> Result<(), Failure> {
        self.journal.add(&Line::ThetasRad(thetas_rad.clone()))?;
        self.found.thetas_rad = Some(thetas_rad);
        Ok(())
    }

    /// The finished rows.
    pub(super) fn rows(&self) -> &[Vec<Ray>] {
        &self.found.rows
    }

    pub(super) fn keep_row(&mut self, rays: Vec<Ray>) -> Result<(), Failure> {
        self.journal.add(&Line::Rays(rays.clone()))?;
        self.found.rows.push(rays);
        Ok(())
    }

    /// Number of finished rows of the matrix.
    pub(super) fn costs(&self) -> usize {
        self.found.costs
    }

    pub(super) fn keep_costs(&mut self, costs: Vec<Option<f64>>) -> Result<(), Failure> {
        self.journal.add(&Line::Costs(costs))?;
        self.found.costs += 1;
        Ok(())
    }

    /// The rows of the matrix, read one at a time.
    pub(super) fn read_costs(
        &self,
    ) -> io::Result<impl Iterator<Item = io::Result<Vec<Option<f64>>>> + use<>> {
        let costs = |line: io::Result<Line>| match line {
            Ok(Line::Costs(costs)) => Some(Ok(costs)),
            Ok(_) => None,
            Err(error) => Some(Err(error)),
        };
        Ok(self.journal.lines()?.filter_map(costs))
    }

    /// Removes the journal; the output is written.
    pub(super) fn remove(self) -> Result<(), Failure> {
        self.journal.remove()
    }
}
