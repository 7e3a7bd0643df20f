//! Datasets on disk: a manifest, and files of up to 4096 examples that NumPy reads.
//!
//! ```text
//! manifest.json       format, program, recipe, number of examples, rows and hash of every file
//! shard-00000.npz     examples 0 .. 4095, without those that have no steady oscillation
//! shard-00001.npz     examples 4096 .. 8191, ..
//! ```
//!
//! | column               | numbers          | meaning                                            |
//! |----------------------|------------------|----------------------------------------------------|
//! | `number`             | u64              | number of the example in its recipe                |
//! | `family`             | u64              | number of the family in the recipe, from zero      |
//! | `inputs`             | f32, 34 a row    | [`Signature::values`]                              |
//! | `values`             | f64, 4 a row     | [`Example::values`]                                |
//! | `gradient`           | f64, 4 a row     | [`Example::cost_gradient`], at the family's margin |
//! | `period_s`           | f64              | period of the cycle (s)                            |
//! | `amplitude`          | f64              | amplitude of the signature, with the sign of the gain |
//! | `centre`             | f64              | centre of the signature                            |
//! | `process`            | f64, 4 a row     | `K`, `T_prop`, `T_body`, `tau` (s)                 |
//! | `bias`               | f64              | bias over the relay's amplitude                    |
//! | `sigma`              | f64              | noise over the noise-free amplitude                |
//! | `samples_per_period` | f64              | samples in a period of the noise-free oscillation  |
//!
//! A recipe and a number of examples give the same bytes on any number of threads. A file that is
//! missing or damaged is made again; a folder of another recipe or program is refused.

use std::ops::Range;

use onecycle_onboard::Soiptd;
use onecycle_onboard::signature::{LENGTH, Signature};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{Example, VALUES};
use crate::PROGRAM;
use crate::experiments::{ExperimentError, Recipe, RecipeError};
use crate::learn::npz::{self, Column, Numbers};
use crate::workers::Workers;

/// Changes with every change that a reader could notice.
pub const FORMAT: &str = "onecycle.dataset/1";

/// Experiments per file: 1.2 MB and some seconds of work, which is what an interruption loses.
pub const EXAMPLES_PER_SHARD: u64 = 4096;

/// Most examples of a dataset: about 3 GB.
pub const MOST_EXAMPLES: u64 = 10_000_000;

/// One example with its targets, as files store it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExampleRecord {
    /// Number of the example in its recipe.
    pub number: u64,
    /// The example.
    pub example: Example,
    /// [`Example::values`].
    pub values: [f64; VALUES],
    /// [`Example::cost_gradient`] at the margin of its family.
    pub gradient: [f64; VALUES],
}

/// What is wrong with a dataset.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DatasetError {
    /// The manifest is not JSON, or has other fields.
    #[error("the file is not the manifest of a dataset: {0}")]
    Json(String),
    /// The manifest has another format.
    #[error("the format of the manifest must be \"{FORMAT}\", but is {0}")]
    Format(String),
    /// The recipe is out of range.
    #[error("the recipe of the manifest is out of range: {0}")]
    Recipe(#[from] RecipeError),
    /// The list of files does not match the number of examples.
    #[error(
        "the manifest must list {expected} files for its {examples} examples, but lists {found}"
    )]
    List {
        /// Number of examples.
        examples: u64,
        /// Number of files for these examples.
        expected: usize,
        /// Number of files in the list.
        found: usize,
    },
    /// The folder belongs to another recipe.
    #[error(
        "the folder holds a dataset of another recipe: name another folder, or remove this one"
    )]
    OtherRecipe,
    /// The folder belongs to another version of the program, whose last bits may differ.
    #[error(
        "the folder holds a dataset made by {0}, but this program is {PROGRAM}: name another folder, or remove this one"
    )]
    OtherProgram(String),
    /// The folder has more examples than requested.
    #[error(
        "the folder already holds {found} examples of this recipe, more than {asked}: name another folder"
    )]
    Fewer {
        /// Number of examples in the folder.
        found: u64,
        /// Number of examples requested.
        asked: u64,
    },
    /// A file has not been made yet.
    #[error(
        "{0} is missing: run the command that makes the dataset again; it continues where it stopped"
    )]
    Unfinished(String),
    /// A file has other bytes than the manifest says.
    #[error("{0} differs from the file in the manifest: make the dataset again")]
    Damaged(String),
}

/// A finished file of a dataset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Number of examples in the file.
    pub rows: usize,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
}

impl Entry {
    /// The entry of a file with these bytes and this number of examples.
    #[must_use]
    pub fn of(rows: usize, bytes: &[u8]) -> Self {
        Self {
            rows,
            sha256: sha256(bytes),
        }
    }

    /// Whether these are the bytes of the file.
    #[must_use]
    pub fn is_of(&self, bytes: &[u8]) -> bool {
        self.sha256 == sha256(bytes)
    }
}

fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Contents of a dataset and its finished files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    format: String,
    program: String,
    /// Recipe of the experiments.
    pub recipe: Recipe,
    /// Number of experiments, with and without a steady oscillation.
    pub examples: u64,
    /// Files in order; `None` for files still to be made.
    pub shards: Vec<Option<Entry>>,
}

impl Manifest {
    /// The manifest of an empty dataset.
    #[must_use]
    pub fn new(recipe: Recipe, examples: u64) -> Self {
        Self {
            format: FORMAT.to_owned(),
            program: PROGRAM.to_owned(),
            recipe,
            examples,
            shards: vec![None; count(examples)],
        }
    }

    /// Reads the text of a manifest.
    ///
    /// # Errors
    /// [`DatasetError`]: what is wrong with the text.
    pub fn read(text: &str) -> Result<Self, DatasetError> {
        #[derive(Deserialize)]
        struct Head {
            format: serde_json::Value,
        }
        let json = |error: serde_json::Error| DatasetError::Json(error.to_string());
        let head: Head = serde_json::from_str(text).map_err(json)?;
        if head.format != FORMAT {
            return Err(DatasetError::Format(head.format.to_string()));
        }
        let manifest: Self = serde_json::from_str(text).map_err(json)?;
        manifest.recipe.validate()?;
        let (expected, found) = (count(manifest.examples), manifest.shards.len());
        if expected != found {
            let examples = manifest.examples;
            return Err(DatasetError::List {
                examples,
                expected,
                found,
            });
        }
        Ok(manifest)
    }

    /// The text of the manifest.
    #[must_use]
    pub fn text(&self) -> String {
        // Serialisation cannot fail: keys are strings.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// Extends the dataset to this number of examples; finished files stay.
    ///
    /// # Errors
    /// [`DatasetError`]: the recipe or the program is another, or fewer examples are requested.
    pub fn go_on(mut self, recipe: &Recipe, examples: u64) -> Result<Self, DatasetError> {
        if self.recipe != *recipe {
            return Err(DatasetError::OtherRecipe);
        }
        if self.program != PROGRAM {
            return Err(DatasetError::OtherProgram(self.program));
        }
        if self.examples > examples {
            let (found, asked) = (self.examples, examples);
            return Err(DatasetError::Fewer { found, asked });
        }
        // The last file gets longer, so it is made again.
        let full = (self.examples / EXAMPLES_PER_SHARD) as usize;
        if self.examples < examples {
            self.shards.truncate(full);
        }
        self.shards.resize(count(examples), None);
        self.examples = examples;
        Ok(self)
    }

    /// Numbers of the experiments of a file.
    #[must_use]
    pub fn numbers(&self, shard: usize) -> Range<u64> {
        let first = shard as u64 * EXAMPLES_PER_SHARD;
        first..(first + EXAMPLES_PER_SHARD).min(self.examples)
    }

    /// Number of examples with a steady oscillation.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.shards.iter().flatten().map(|entry| entry.rows).sum()
    }

    /// Makes a file: its bytes and its entry in the manifest.
    ///
    /// # Errors
    /// [`ExperimentError`]; never for a valid recipe.
    pub fn make(
        &self,
        shard: usize,
        workers: &dyn Workers,
    ) -> Result<(Vec<u8>, Entry), ExperimentError> {
        let numbers = self.numbers(shard);
        let count = (numbers.end - numbers.start) as usize;
        let made = workers.map(count, |k| self.recipe.record(numbers.start + k as u64));
        let made: Vec<Option<ExampleRecord>> = made.into_iter().collect::<Result<_, _>>()?;
        let records: Vec<ExampleRecord> = made.into_iter().flatten().collect();
        let bytes = npz::write(&columns(&records));
        let entry = Entry::of(records.len(), &bytes);
        Ok((bytes, entry))
    }

    /// The examples of a file with these bytes.
    ///
    /// # Errors
    /// [`DatasetError::Unfinished`] or [`DatasetError::Damaged`].
    pub fn records(&self, shard: usize, bytes: &[u8]) -> Result<Vec<ExampleRecord>, DatasetError> {
        let entry = self.shards.get(shard).and_then(Option::as_ref);
        let entry = entry.ok_or_else(|| DatasetError::Unfinished(file_name(shard)))?;
        let damaged = || DatasetError::Damaged(file_name(shard));
        if !entry.is_of(bytes) {
            return Err(damaged());
        }
        let columns = npz::read(bytes, &columns(&[]), entry.rows).ok_or_else(damaged)?;
        records(&columns, entry.rows).ok_or_else(damaged)
    }
}

/// Number of files for this number of examples.
fn count(examples: u64) -> usize {
    examples.div_ceil(EXAMPLES_PER_SHARD) as usize
}

/// Name of the manifest in the folder of a dataset.
pub const MANIFEST_NAME: &str = "manifest.json";

/// Name of a file in the folder of a dataset.
#[must_use]
pub fn file_name(shard: usize) -> String {
    format!("shard-{shard:05}.npz")
}

impl Recipe {
    /// Example number `n` with its targets; `None` as for [`Self::example`].
    ///
    /// # Errors
    /// [`ExperimentError`]: a field of the recipe is out of its range.
    pub fn record(&self, n: u64) -> Result<Option<ExampleRecord>, ExperimentError> {
        let made = self.example(n)?;
        Ok(made.and_then(|example| {
            let margin_rad = self.families[example.family].space.phase_margin_rad();
            Some(ExampleRecord {
                number: n,
                example,
                values: example.values(),
                gradient: example.cost_gradient(margin_rad)?,
            })
        }))
    }
}

/// The columns of these records; without records, the names, widths and types of the columns.
pub(super) fn columns(records: &[ExampleRecord]) -> Vec<Column> {
    let whole = |name, of: fn(&ExampleRecord) -> u64| Column {
        name,
        width: None,
        numbers: Numbers::U64(records.iter().map(of).collect()),
    };
    let real = |name, of: fn(&ExampleRecord) -> f64| Column {
        name,
        width: None,
        numbers: Numbers::F64(records.iter().map(of).collect()),
    };
    let four = |name, of: fn(&ExampleRecord) -> [f64; 4]| Column {
        name,
        width: Some(4),
        numbers: Numbers::F64(records.iter().flat_map(of).collect()),
    };
    let inputs = records
        .iter()
        .flat_map(|record| record.example.signature.values);
    vec![
        whole("number", |record| record.number),
        whole("family", |record| record.example.family as u64),
        Column {
            name: "inputs",
            width: Some(LENGTH),
            numbers: Numbers::F32(inputs.collect()),
        },
        four("values", |record| record.values),
        four("gradient", |record| record.gradient),
        real("period_s", |record| record.example.period_s),
        real("amplitude", |record| {
            record.example.signature.sign * record.example.signature.amplitude
        }),
        real("centre", |record| record.example.signature.centre),
        four("process", |record| parameters(&record.example.process)),
        real("bias", |record| record.example.bias),
        real("sigma", |record| record.example.sigma),
        real("samples_per_period", |record| {
            record.example.samples_per_period
        }),
    ]
}

fn parameters(process: &Soiptd) -> [f64; 4] {
    let unbounded = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
    [
        unbounded(process.k()),
        process.t_prop_s(),
        unbounded(process.t_body_s()),
        process.tau_s(),
    ]
}

/// The records of these columns; `None` if a process is out of range.
fn records(columns: &[Column], rows: usize) -> Option<Vec<ExampleRecord>> {
    let wholes = |name: &str| match &named(columns, name)?.numbers {
        Numbers::U64(numbers) => Some(numbers),
        _ => None,
    };
    let reals = |name: &str| match &named(columns, name)?.numbers {
        Numbers::F64(numbers) => Some(numbers),
        _ => None,
    };
    let four = |name: &str, row: usize| reals(name)?.get(4 * row..4 * row + 4)?.try_into().ok();
    let real = |name: &str, row: usize| reals(name)?.get(row).copied();
    let Numbers::F32(inputs) = &named(columns, "inputs")?.numbers else {
        return None;
    };
    (0..rows)
        .map(|row| {
            let [k, t_prop_s, t_body_s, tau_s] = four("process", row)?;
            let amplitude = real("amplitude", row)?;
            let signature = Signature {
                values: inputs
                    .get(LENGTH * row..LENGTH * (row + 1))?
                    .try_into()
                    .ok()?,
                amplitude: amplitude.abs(),
                centre: real("centre", row)?,
                sign: amplitude.signum(),
            };
            let example = Example {
                signature,
                period_s: real("period_s", row)?,
                process: Soiptd::new(k, t_prop_s, t_body_s, tau_s).ok()?,
                family: *wholes("family")?.get(row)? as usize,
                bias: real("bias", row)?,
                sigma: real("sigma", row)?,
                samples_per_period: real("samples_per_period", row)?,
            };
            Some(ExampleRecord {
                number: *wholes("number")?.get(row)?,
                example,
                values: four("values", row)?,
                gradient: four("gradient", row)?,
            })
        })
        .collect()
}

fn named<'a>(columns: &'a [Column], name: &str) -> Option<&'a Column> {
    columns.iter().find(|column| column.name == name)
}
