//! The commands as functions, for programs in other languages: the same options, sentences and reports.
//!
//! Options are those of the command line, such as `["--structure", "foptd"]`. An error is one sentence.

mod studio;

use std::sync::Arc;

use anstream::adapter::strip_str;
use clap::Parser;
use onecycle::{Identification, Recording};
use onecycle_lab::learn::dataset::shards::{Entry, Manifest};
use onecycle_lab::workers::OneThread;
use serde_json::Value;

use crate::args::{Arguments, Command, Identify};
use crate::commands::campaign::{self, plan};
use crate::commands::dataset::folder::Folder;
use crate::commands::{dataset, flight, identify, tune};
use crate::failure::Failure;
#[cfg(target_family = "wasm")]
pub use crate::output::page::{Listener, listen};
use crate::reading;
pub use crate::reading::Given;
use crate::report::flight as report;
use crate::words::remark::{details, reasons};
use crate::words::verdict::advice;

pub use studio::Studio;

/// Gives a file that the system does not have a name, under which the functions here read it; the file that was given
/// before is forgotten.
pub fn give(name: &str, file: Arc<dyn Given>) {
    reading::give(name, file);
}

/// What `onecycle identify` found.
pub struct Found(identify::Found);

impl Found {
    /// Identifies from a file as `onecycle identify FILE` does; the gains of a flight log are part of the result.
    ///
    /// # Errors
    /// One sentence: an option or the file cannot be used.
    pub fn in_file(file: &str, options: &[String]) -> Result<Self, String> {
        Self::of(file, None, options)
    }

    /// Identifies from a recording in memory; `name` stands in the reports.
    ///
    /// # Errors
    /// One sentence: an option cannot be used.
    pub fn in_recording(
        name: &str,
        recording: Recording,
        options: &[String],
    ) -> Result<Self, String> {
        Self::of(name, Some(recording), options)
    }

    fn of(name: &str, given: Option<Recording>, options: &[String]) -> Result<Self, String> {
        let arguments = arguments_of_identify(name, options)?;
        if given.is_none() && flight::is_asked(&arguments) {
            return Err(format!(
                "{name} is a flight log: choose one of its loops with --axis and --loop"
            ));
        }
        let found = identify::find(&arguments, given).map_err(|failure| failure.to_string())?;
        Ok(Self(found))
    }

    /// The recording.
    #[must_use]
    pub fn recording(&self) -> &Recording {
        &self.0.recording
    }

    /// What was identified.
    #[must_use]
    pub fn identification(&self) -> &Identification {
        &self.0.identification
    }

    /// The JSON report: docs/identify-json.md.
    #[must_use]
    pub fn json(&self) -> String {
        self.0.json(false)
    }

    /// The HTML page of `--report`.
    pub fn page(&mut self) -> String {
        self.0.page()
    }

    /// The report as text, with all details.
    #[must_use]
    pub fn text(&self) -> String {
        plain(&self.0.text(true))
    }

    /// One or two sentences for each remark that is a reason to suspect the result.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let reasons = reasons(&self.0.identification).into_iter();
        reasons.map(|(_, sentence)| sentence).collect()
    }

    /// One or two sentences for each other remark: how the result was found, what no such test shows, what the controller asks for.
    #[must_use]
    pub fn details(&self) -> Vec<String> {
        let details = details(&self.0.identification).into_iter();
        details.map(|(_, sentence)| sentence).collect()
    }

    /// Why no process was identified, and what to do. `None` if one was.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let verdict = self.0.identification.outcome.as_ref().err()?;
        Some(format!("{verdict}: {}", advice(verdict)))
    }
}

/// Every loop of a flight log, as `onecycle identify LOG` shows it: the table, and the JSON report `onecycle.flight/1` of
/// docs/identify-json.md.
///
/// # Errors
/// One sentence: an option or the file cannot be used.
pub fn flight(file: &str, options: &[String]) -> Result<(String, String), String> {
    let arguments = arguments_of_identify(file, options)?;
    if !flight::is_asked(&arguments) {
        return Err(format!(
            "{file} is no flight log, or an option chooses one of its loops"
        ));
    }
    let survey = || flight::survey(&arguments, &identify::checked(&arguments)?);
    let surveyed = survey().map_err(|failure| failure.to_string())?;
    let text = report::text(&surveyed, arguments.details);
    Ok((plain(&text), report::json(&surveyed)))
}

/// Reads a recording as `onecycle identify FILE` does: of a flight log the part that tells most, without a choice of the
/// part.
///
/// # Errors
/// One sentence: an option or the file cannot be used.
pub fn read(file: &str, options: &[String]) -> Result<Recording, String> {
    let arguments = arguments_of_identify(file, options)?;
    let read = || identify::read(&arguments, &identify::checked(&arguments)?);
    let (recording, _) = read().map_err(|failure| failure.to_string())?;
    Ok(recording)
}

/// The JSON report of `onecycle tune`.
///
/// # Errors
/// One sentence: the process or an option cannot be used, or there is no controller.
pub fn design(options: &[String]) -> Result<String, String> {
    match parsed("tune", &[], options)? {
        Command::Tune(arguments) => tune::json(&arguments).map_err(|failure| failure.to_string()),
        _ => Err("not the command tune".to_owned()),
    }
}

/// A campaign, whose cases depend on the file, the options and their number only: they can be computed anywhere and in any
/// order.
pub struct Campaign {
    plan: Box<dyn plan::Shared>,
    /// Those of the JSON report. `None`: the table is asked for.
    settings: Option<Value>,
}

impl Campaign {
    /// Reads the file of a campaign. Options are those of `onecycle campaign`, such as `["--cases", "100"]`.
    ///
    /// # Errors
    /// One sentence: the file or an option cannot be used.
    pub fn read(file: &str, options: &[String]) -> Result<Self, String> {
        let Command::Campaign(arguments) = parsed("campaign", &[file], options)? else {
            return Err("not the command campaign".to_owned());
        };
        let read = || {
            let plan = plan::of(&arguments)?;
            let settings = arguments.json.then(|| campaign::settings(&arguments));
            Ok((plan, settings.transpose()?))
        };
        let (plan, settings) = read().map_err(|failure: Failure| failure.to_string())?;
        Ok(Self { plan, settings })
    }

    /// Number of cases.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.plan.count()
    }

    /// The outcome of case `n`, as JSON on one line.
    ///
    /// # Errors
    /// One sentence: there is no such case, or it cannot be simulated.
    pub fn case(&self, n: u64) -> Result<String, String> {
        if n >= self.count() {
            return Err(format!("there is no case {n}: there are {}", self.count()));
        }
        self.plan.line(n).map_err(|failure| failure.to_string())
    }

    /// What `onecycle campaign` prints for the outcomes of all cases, in the order of their numbers: with the option
    /// `--json` the JSON report, else the table.
    ///
    /// # Errors
    /// One sentence: these are not the outcomes of this campaign.
    pub fn text(&self, cases: &[String]) -> Result<String, String> {
        if cases.len() as u64 != self.count() {
            return Err(format!(
                "{} outcomes of {} cases",
                cases.len(),
                self.count()
            ));
        }
        let text = self.plan.text(self.settings.as_ref(), cases);
        text.map(|text| plain(&text))
            .map_err(|failure| failure.to_string())
    }
}

/// A folder of experiments to train on, whose files are made by others.
pub struct Dataset(Folder);

impl Dataset {
    /// Opens or begins the folder. Options are those of `onecycle dataset`, such as `["--examples", "40000", "--into",
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
            let asked = (recipe, arguments.examples);
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

/// Without the styles of a terminal.
fn plain(text: &str) -> String {
    strip_str(text).to_string()
}

fn arguments_of_identify(file: &str, options: &[String]) -> Result<Identify, String> {
    match parsed("identify", &[file], options)? {
        Command::Identify(arguments) => Ok(arguments),
        _ => Err("not the command identify".to_owned()),
    }
}

/// Parses a command line. The parser's error is its first paragraph, without usage and hints.
fn parsed(command: &str, files: &[&str], options: &[String]) -> Result<Command, String> {
    let options = options.iter().map(String::as_str);
    let words = ["onecycle", command].into_iter().chain(options);
    let words = words.chain(["--"]).chain(files.iter().copied());
    let parsed = Arguments::try_parse_from(words).map_err(|error| {
        let text = error.to_string();
        let first = text.split("\n\n").next().unwrap_or(&text);
        first.trim_start_matches("error: ").trim().to_owned()
    })?;
    Ok(parsed.command)
}
