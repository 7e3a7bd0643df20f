//! What an interrupted run has done: a file of JSON lines beside the one that it was to write.
//!
//! ```text
//! {"settings":{"format":"onecycle.grid.part/1","program":..,"settings":{..}}}
//! {"thetas_rad":[..]}         the rows
//! {"rays":[{..},..]}          one for every row, in order
//! {"costs":[..]}              one for every member, in order: a row of the matrix
//! ```
//!
//! Lines are only ever added. The last one may have been cut short; it is dropped.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

use onecycle_lab::space::grid::{GridSettings, Ray};
use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use crate::output::append_line;

/// Changes with the file, so that what another program left is not gone on with.
const FORMAT: &str = "onecycle.grid.part/1";

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Settings(Head),
    ThetasRad(Vec<f64>),
    Rays(Vec<Ray>),
    Costs(Vec<Option<f64>>),
}

#[derive(PartialEq, Serialize, Deserialize)]
struct Head {
    format: String,
    program: String,
    settings: GridSettings,
}

/// The file, open for more, and what it holds; the costs stay where they are.
pub(super) struct Part {
    path: PathBuf,
    file: File,
    thetas_rad: Option<Vec<f64>>,
    rows: Vec<Vec<Ray>>,
    costs: usize,
}

impl Part {
    /// Opens the file of these settings, or begins one.
    pub(super) fn open(
        path: PathBuf,
        settings: &GridSettings,
        restart: bool,
    ) -> Result<Self, Failure> {
        let head = Head {
            format: FORMAT.to_owned(),
            program: env!("CARGO_PKG_VERSION").to_owned(),
            settings: *settings,
        };
        let file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(|error| Failure::output(&path, error))?;
        let mut part = Self {
            path,
            file,
            thetas_rad: None,
            rows: Vec::new(),
            costs: 0,
        };
        let length = if restart { 0 } else { part.read(&head)? };
        part.file
            .set_len(length)
            .map_err(|error| Failure::output(&part.path, error))?;
        if length == 0 {
            part.add(&Line::Settings(head))?;
        }
        Ok(part)
    }

    /// Takes in all whole lines; returns their length.
    fn read(&mut self, head: &Head) -> Result<u64, Failure> {
        let failed = |error: io::Error| unreadable(&self.path, error.to_string());
        let mut lines = BufReader::new(self.file.try_clone().map_err(failed)?);
        let (mut length, mut number, mut is_cut) = (0, 0, false);
        let mut bytes = Vec::new();
        loop {
            bytes.clear();
            let read = lines
                .read_until(b'\n', &mut bytes)
                .map_err(|error| unreadable(&self.path, error.to_string()))?;
            if read == 0 {
                return Ok(length);
            }
            if is_cut {
                return Err(unreadable(
                    &self.path,
                    format!("line {number} is damaged: --restart begins anew"),
                ));
            }
            number += 1;
            match serde_json::from_slice(&bytes) {
                Ok(line) if bytes.ends_with(b"\n") => {
                    self.take(line, head, number)?;
                    length += read as u64;
                }
                _ => is_cut = true,
            }
        }
    }

    fn take(&mut self, line: Line, head: &Head, number: usize) -> Result<(), Failure> {
        let is_whole = |part: &Self| {
            let thetas_rad = part.thetas_rad.as_ref();
            thetas_rad.is_some_and(|thetas_rad| thetas_rad.len() == part.rows.len())
        };
        let fits = match line {
            Line::Settings(found) if number == 1 => {
                if found != *head {
                    return Err(unreadable(
                        &self.path,
                        format!(
                            "what is done belongs to other settings (deterioration {} %) or to \
                             another program: --restart discards it, another --out keeps it",
                            100.0 * found.settings.deterioration
                        ),
                    ));
                }
                true
            }
            Line::ThetasRad(thetas_rad) if number == 2 => {
                self.thetas_rad = Some(thetas_rad);
                true
            }
            Line::Rays(rays) if number > 2 && !is_whole(self) => {
                self.rows.push(rays);
                true
            }
            Line::Costs(costs) if is_whole(self) => {
                self.costs += 1;
                let members: usize = self.rows.iter().flatten().map(|ray| ray.rungs).sum();
                costs.len() == members && self.costs <= members
            }
            _ => false,
        };
        if fits {
            Ok(())
        } else {
            Err(unreadable(
                &self.path,
                format!("line {number} is not what comes next: --restart begins anew"),
            ))
        }
    }

    pub(super) fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// What was found done, if anything.
    pub(super) fn what_is_done(&self) -> Option<String> {
        let rows = self.thetas_rad.as_ref()?.len();
        Some(match (self.rows.len(), self.costs) {
            (done, 0) => format!("{done} of {rows} rows"),
            (_, costs) => format!("all rows and the costs of {costs} members"),
        })
    }

    pub(super) fn thetas_rad(&self) -> Option<&[f64]> {
        self.thetas_rad.as_deref()
    }

    pub(super) fn keep_thetas(&mut self, thetas_rad: Vec<f64>) -> Result<(), Failure> {
        self.add(&Line::ThetasRad(thetas_rad.clone()))?;
        self.thetas_rad = Some(thetas_rad);
        Ok(())
    }

    /// The rows that are done.
    pub(super) fn rows(&self) -> &[Vec<Ray>] {
        &self.rows
    }

    pub(super) fn keep_row(&mut self, rays: Vec<Ray>) -> Result<(), Failure> {
        self.add(&Line::Rays(rays.clone()))?;
        self.rows.push(rays);
        Ok(())
    }

    /// Number of rows of the matrix that are done.
    pub(super) fn costs(&self) -> usize {
        self.costs
    }

    pub(super) fn keep_costs(&mut self, costs: &[Option<f64>]) -> Result<(), Failure> {
        self.add(&Line::Costs(costs.to_vec()))?;
        self.costs += 1;
        Ok(())
    }

    /// The rows of the matrix, read as they are asked for.
    pub(super) fn read_costs(
        &self,
    ) -> io::Result<impl Iterator<Item = io::Result<Vec<Option<f64>>>> + use<>> {
        let lines = BufReader::new(File::open(&self.path)?).lines();
        Ok(lines.filter_map(|line| {
            let line = line.and_then(|line| Ok(serde_json::from_str(&line)?));
            match line {
                Ok(Line::Costs(costs)) => Some(Ok(costs)),
                Ok(_) => None,
                Err(error) => Some(Err(error)),
            }
        }))
    }

    fn add(&mut self, line: &Line) -> Result<(), Failure> {
        append_line(&mut self.file, &self.path, line)
    }

    /// Removes the file: all is written.
    pub(super) fn remove(self) -> Result<(), Failure> {
        std::fs::remove_file(&self.path).map_err(|error| Failure::output(&self.path, error))
    }
}

fn unreadable(path: &Path, reason: String) -> Failure {
    Failure::Settings {
        path: path.to_owned(),
        reason,
    }
}
