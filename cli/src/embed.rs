//! The commands as functions, for programs in other languages: the same options, sentences and reports.
//!
//! Options are those of the command line, such as `["--structure", "foptd"]`. An error is one sentence.

use std::path::Path;

use clap::Parser;
use onecycle::{Identification, Recording};

use crate::args::{Arguments, Command, Identify};
use crate::commands::{campaign, identify, tune};
use crate::failure::Failure;
use crate::words::remark::sentences;
use crate::words::verdict::advice;

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

    /// The report as text.
    #[must_use]
    pub fn text(&self) -> String {
        self.0.text()
    }

    /// One sentence for each remark.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        sentences(&self.0.identification)
    }

    /// Why no process was identified, and what to do. `None` if one was.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let verdict = self.0.identification.outcome.as_ref().err()?;
        Some(format!("{verdict}: {}", advice(verdict)))
    }
}

/// Reads a recording as `onecycle identify FILE` does.
///
/// # Errors
/// One sentence: an option or the file cannot be used.
pub fn read(file: &str, options: &[String]) -> Result<Recording, String> {
    let read = identify::read(&arguments_of_identify(file, options)?);
    read.map(|(recording, _)| recording)
        .map_err(|failure| failure.to_string())
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

/// The cases of a campaign: each depends on the file and its number only.
pub struct Campaign(campaign::Cases);

impl Campaign {
    /// Reads the file of a campaign.
    ///
    /// # Errors
    /// One sentence: the file cannot be used.
    pub fn read(file: &Path) -> Result<Self, String> {
        let cases = campaign::Cases::read(file);
        cases.map(Self).map_err(|failure| failure.to_string())
    }

    /// Number of cases.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.0.count()
    }

    /// The outcome of case `n`, as JSON on one line: an element of `cases` in `onecycle campaign --json`.
    ///
    /// # Errors
    /// One sentence: the case cannot be simulated.
    pub fn case(&self, n: u64) -> Result<String, String> {
        let shown = self.0.case(n).map(|case| case.to_string());
        shown.map_err(|failure: Failure| failure.to_string())
    }
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
