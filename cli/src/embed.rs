//! The commands as functions, for programs in other languages: the same options, sentences and reports.
//!
//! Options are those of the command line, such as `["--structure", "foptd"]`. An error is one sentence.

mod studio;

use std::sync::Arc;

use onecycle::{Identification, Recording, Report};

use crate::args::{self, Arguments, Command, Identify};
use crate::commands::{identify, tune};
use crate::failure::Failure;
#[cfg(target_family = "wasm")]
pub use crate::output::page::{Listener, listen};
pub use crate::reading::Given;
use crate::reading::{self, Input};
use crate::report::flight as report;
use crate::report::json::to_text;
use crate::style::plain;
use crate::words::remark::{details, reasons};
use crate::words::verdict::advice;
use crate::words::with_options;

pub use studio::Studio;

/// Gives a file that the system does not have a name, under which the functions here read it; the file that was given
/// before is forgotten.
pub fn give(name: &str, file: Arc<dyn Given>) {
    reading::give(name, file);
}

/// What `onecycle identify` found.
pub struct Found(Report);

impl Found {
    /// Identifies from a file as `onecycle identify FILE` does; the gains of a flight log are part of the result.
    ///
    /// # Errors
    /// One sentence: an option or the file cannot be used.
    pub fn in_file(file: &str, options: &[String]) -> Result<Self, String> {
        let arguments = arguments_of_identify(file, options)?;
        let found = || {
            let request = identify::checked(&arguments)?;
            let source = Input::new(&arguments.file)?;
            match identify::is_of_all_loops(&arguments, &request, &source) {
                true => Err(Failure::usage(format!(
                    "{file} is a flight log: choose one of its loops with --axis and --loop"
                ))),
                false => identify::found(&request, &source),
            }
        };
        found().map(Self).map_err(|failure| told(&failure))
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
        let arguments = arguments_of_identify(name, options)?;
        let found = || {
            let request = identify::checked(&arguments)?;
            Ok(request.identify_recording(name, recording)?)
        };
        found().map(Self).map_err(|failure: Failure| told(&failure))
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
        identify::as_json(&self.0, false)
    }

    /// The HTML page of `--report`.
    pub fn page(&mut self) -> String {
        identify::as_page(&mut self.0)
    }

    /// The report as text, with all details.
    #[must_use]
    pub fn text(&self) -> String {
        plain(&identify::as_text(&self.0, true))
    }

    /// One or two sentences for each remark that is a reason to suspect the result.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let reasons = reasons(&self.0.identification).into_iter();
        reasons
            .map(|(_, sentence)| with_options(&sentence).into_owned())
            .collect()
    }

    /// One or two sentences for each other remark: how the result was found, what no such test shows, what the controller asks for.
    #[must_use]
    pub fn details(&self) -> Vec<String> {
        let details = details(&self.0.identification).into_iter();
        details
            .map(|(_, sentence)| with_options(&sentence).into_owned())
            .collect()
    }

    /// Why no process was identified, and what to do. `None` if one was.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let verdict = self.0.identification.outcome.as_ref().err()?;
        Some(format!("{verdict}: {}", with_options(&advice(verdict))))
    }
}

/// Every loop of a flight log, as `onecycle identify LOG` shows it: the table, and the JSON report `onecycle.flight/1` of
/// docs/identify-json.md.
///
/// # Errors
/// One sentence: an option or the file cannot be used.
pub fn flight(file: &str, options: &[String]) -> Result<(String, String), String> {
    let arguments = arguments_of_identify(file, options)?;
    let surveyed = || {
        let request = identify::checked(&arguments)?;
        let source = Input::new(&arguments.file)?;
        match identify::is_of_all_loops(&arguments, &request, &source) {
            true => Ok(request.survey(&source)?),
            false => Err(Failure::usage(format!(
                "{file} is no flight log, or an option chooses one of its loops"
            ))),
        }
    };
    let surveyed = surveyed().map_err(|failure| told(&failure))?;
    let text = with_options(&report::text(&surveyed, arguments.details)).into_owned();
    Ok((plain(&text), to_text(&surveyed)))
}

/// Reads a recording as `onecycle identify FILE` does: of a flight log the part that tells most, without a choice of the
/// part.
///
/// # Errors
/// One sentence: an option or the file cannot be used.
pub fn read(file: &str, options: &[String]) -> Result<Recording, String> {
    let arguments = arguments_of_identify(file, options)?;
    let read = || Ok(identify::checked(&arguments)?.read(&Input::new(&arguments.file)?)?);
    read().map_err(|failure: Failure| told(&failure))
}

/// The JSON report of `onecycle tune`.
///
/// # Errors
/// One sentence: the process or an option cannot be used, or there is no controller.
pub fn design(options: &[String]) -> Result<String, String> {
    match parsed("tune", &[], options)? {
        Command::Tune(arguments) => match tune::tuned(&arguments) {
            Ok(found) => Ok(to_text(&found)),
            Err(failure) => Err(told(&failure)),
        },
        _ => Err("not the command tune".to_owned()),
    }
}

/// The sentence of a failure.
fn told(failure: &Failure) -> String {
    with_options(&failure.to_string()).into_owned()
}

fn arguments_of_identify(file: &str, options: &[String]) -> Result<Identify, String> {
    match parsed("identify", &[file], options)? {
        Command::Identify(arguments) => Ok(arguments),
        _ => Err("not the command identify".to_owned()),
    }
}

fn parsed(command: &str, files: &[&str], options: &[String]) -> Result<Command, String> {
    args::parsed::<Arguments>(command, files, options).map(|parsed| parsed.command)
}
