//! Campaigns and datasets as functions, for programs in other languages: the same options, sentences and reports.
//!
//! Options are those of the command line, such as `["--cases", "100"]`. An error is one sentence.

use std::ops::Range;
use std::path::Path;

use onecycle_cli::args;
use onecycle_cli::failure::Failure;
use onecycle_cli::style::plain;
pub use onecycle_lab::experiments::honesty::Columns;
use onecycle_lab::learn::dataset::shards::{Entry, Manifest};
use onecycle_lab::workers::OneThread;
use serde_json::Value;

use crate::args::{Arguments, Command};
use crate::commands::campaign::{self, plan};
use crate::commands::dataset;
pub use crate::commands::dataset::classifier::Rows;
use crate::commands::dataset::classifier::{self, Sets};
use crate::commands::dataset::folder::Folder;

/// A campaign, whose cases depend on the file, the options and their number only: they can be computed anywhere and in any
/// order.
pub struct Campaign {
    plan: Box<dyn plan::Shared>,
    settings: Value,
    /// Whether the JSON report is asked for instead of the table.
    is_json: bool,
}

impl Campaign {
    /// Reads the file of a campaign. Options are those of `onecycle-lab campaign`, such as `["--cases", "100"]`.
    ///
    /// # Errors
    /// One sentence: the file or an option cannot be used.
    pub fn read(file: &str, options: &[String]) -> Result<Self, String> {
        let Command::Campaign(arguments) = parsed("campaign", &[file], options)? else {
            return Err("not the command campaign".to_owned());
        };
        let read = || {
            Ok(Self {
                plan: plan::of(&arguments)?,
                settings: campaign::settings(&arguments)?,
                is_json: arguments.json,
            })
        };
        read().map_err(|failure: Failure| failure.to_string())
    }

    /// All that decides the outcome of a case, as JSON. The number of cases is not among it: a campaign can be extended.
    #[must_use]
    pub fn settings(&self) -> String {
        let mut settings = self.settings.clone();
        settings["cases"] = Value::Null;
        settings["file"]["cases"] = Value::Null;
        settings.to_string()
    }

    /// Number of cases.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.plan.count()
    }

    /// The outcome of case `n` and its truth, each as JSON on one line.
    ///
    /// # Errors
    /// One sentence: there is no such case, or it cannot be simulated.
    pub fn case(&self, n: u64) -> Result<[String; 2], String> {
        self.check(n)?;
        self.plan.line(n).map_err(|failure| failure.to_string())
    }

    /// The recording of case `n`, which it is judged by, and its truth as JSON on one line. `None`: nothing oscillates, or the
    /// output runs away.
    ///
    /// # Errors
    /// As [`case`](Self::case).
    pub fn recording(&self, n: u64) -> Result<(Option<Columns>, String), String> {
        self.check(n)?;
        let recording = self.plan.recording(n);
        recording.map_err(|failure| failure.to_string())
    }

    fn check(&self, n: u64) -> Result<(), String> {
        match n < self.count() {
            true => Ok(()),
            false => Err(format!("there is no case {n}: there are {}", self.count())),
        }
    }

    /// What `onecycle-lab campaign` prints for the outcomes of all cases, in the order of their numbers: with the option
    /// `--json` the JSON report, else the table.
    ///
    /// # Errors
    /// One sentence: these are not the outcomes of this campaign.
    pub fn text(&self, cases: &mut dyn Iterator<Item = String>) -> Result<String, String> {
        let settings = self.is_json.then_some(&self.settings);
        let text = self.plan.text(settings, cases);
        text.map(|text| plain(&text))
            .map_err(|failure| failure.to_string())
    }
}

/// A folder of experiments to train on, whose files are made by others.
pub struct Dataset(Folder);

impl Dataset {
    /// Opens or begins the folder. Options are those of `onecycle-lab dataset`, such as `["--examples", "40000", "--into",
    /// "multirotors"]`.
    ///
    /// # Errors
    /// One sentence: the recipe, the folder or an option cannot be used.
    pub fn open(recipe: Option<&str>, options: &[String]) -> Result<Self, String> {
        let files = recipe.as_slice();
        let Command::Dataset(arguments) = parsed("dataset", files, options)? else {
            return Err("not the command dataset".to_owned());
        };
        let open = || {
            let recipe = dataset::recipe(arguments.recipe.as_deref())?;
            let asked = (recipe, dataset::number(&arguments)?);
            dataset::opened(&arguments.into, asked, arguments.restart)
        };
        open().map(Self).map_err(|failure| failure.to_string())
    }

    /// The manifest, from which [`dataset_file`] makes the files.
    #[must_use]
    pub fn manifest(&self) -> String {
        self.0.manifest().text()
    }

    /// Numbers of the files that are not there yet.
    #[must_use]
    pub fn missing(&self) -> Vec<usize> {
        self.0.missing()
    }

    /// Keeps a file: its bytes and its number of examples.
    ///
    /// # Errors
    /// One sentence: it cannot be written, or there is no file of this number.
    pub fn keep(&mut self, file: usize, bytes: &[u8], rows: usize) -> Result<(), String> {
        let count = self.0.manifest().shards.len();
        if file >= count {
            return Err(format!("there is no file {file}: there are {count}"));
        }
        let kept = self.0.keep(file, bytes, Entry::of(rows, bytes));
        kept.map_err(|failure| failure.to_string())
    }
}

/// The sets of a recipe of the paper's classifier, whose parts are made by others.
pub struct ClassifierSets(Sets);

impl ClassifierSets {
    /// Whether a file is the recipe of a classifier.
    ///
    /// # Errors
    /// One sentence: the file cannot be read.
    pub fn is_recipe(file: &str) -> Result<bool, String> {
        classifier::is_recipe(Path::new(file)).map_err(|failure| failure.to_string())
    }

    /// Reads the recipe and makes its classes in this thread.
    ///
    /// # Errors
    /// One sentence: the recipe cannot be used.
    pub fn read(file: &str) -> Result<Self, String> {
        let sets = Sets::read(Path::new(file), &OneThread);
        sets.map(Self).map_err(|failure| failure.to_string())
    }

    /// Names of the sets, with their numbers of experiments.
    #[must_use]
    pub fn sizes(&self) -> Vec<(String, u64)> {
        self.0.sizes()
    }

    /// Makes the experiments of these numbers of a set in this thread. One that does not come to a steady oscillation gives no
    /// example.
    ///
    /// # Errors
    /// One sentence: there are no such experiments, or one cannot be made.
    pub fn part(&self, set: usize, numbers: Range<u64>) -> Result<Rows, String> {
        let sizes = self.sizes();
        let is_there =
            |(_, size): &(String, u64)| numbers.start <= numbers.end && numbers.end <= *size;
        if !sizes.get(set).is_some_and(is_there) {
            return Err(format!("there are no experiments {numbers:?} of set {set}"));
        }
        let made = self.0.part(set, numbers, &OneThread);
        made.map_err(|failure| failure.to_string())
    }

    /// Writes the files of `onecycle-lab dataset` from the examples of every set.
    ///
    /// # Errors
    /// One sentence: a file cannot be written.
    pub fn write(&self, into: &str, sets: Vec<Rows>) -> Result<(), String> {
        let written = self.0.write(Path::new(into), sets);
        written.map(|_| ()).map_err(|failure| failure.to_string())
    }
}

/// Makes a file of a dataset in this thread: its bytes and its number of examples.
///
/// # Errors
/// One sentence: this is no manifest, or it has no file of this number.
pub fn dataset_file(manifest: &str, file: usize) -> Result<(Vec<u8>, usize), String> {
    let manifest = Manifest::read(manifest).map_err(|error| error.to_string())?;
    let count = manifest.shards.len();
    if file >= count {
        return Err(format!("there is no file {file}: there are {count}"));
    }
    let made = manifest.make(file, &OneThread);
    let (bytes, entry) = made.map_err(|error| error.to_string())?;
    Ok((bytes, entry.rows))
}

fn parsed(command: &str, files: &[&str], options: &[String]) -> Result<Command, String> {
    args::parsed::<Arguments>(command, files, options).map(|parsed| parsed.command)
}
