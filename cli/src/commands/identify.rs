//! `onecycle identify`: a recording in, the process and its controller out; of a flight log all loops.

use std::path::Path;
use std::process::ExitCode;

use onecycle::results::log_gains::NamedFiles;
use onecycle::{Report, Request, Survey, log_gains, source};

use crate::args::Identify;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, write_text};
use crate::reading::Input;
use crate::report::json::to_text;
use crate::report::{flight, identify as report, page};

pub(crate) fn run(arguments: &Identify) -> Result<ExitCode, Failure> {
    let request = checked(arguments)?;
    let source = Input::new(&arguments.file)?;
    if is_of_all_loops(arguments, &request, &source) {
        let surveyed = survey(arguments, &request, &source)?;
        return show_survey(arguments, &surveyed);
    }
    let mut found = found(&request, &source)?;
    show(arguments, &mut found)?;
    Ok(ExitCode::from(match found.is_positive() {
        true => exit::DONE,
        false => exit::NO_PROCESS,
    }))
}

/// What is asked, after a look for arguments that contradict each other and for files that would be overwritten.
pub(crate) fn checked(arguments: &Identify) -> Result<Request, Failure> {
    if let Some(path) = &arguments.report {
        check_page(path, &arguments.file)?;
    }
    check_parameters(arguments)?;
    let request = arguments.request()?;
    request.specification()?;
    Ok(request)
}

/// Whether every loop of a flight log is meant.
pub(crate) fn is_of_all_loops(arguments: &Identify, request: &Request, source: &Input<'_>) -> bool {
    let is_one = arguments.rows || source.is_piped();
    !is_one && request.is_of_all_loops() && source::is_flight_log(source)
}

/// What was identified; parameters are written if that was asked for.
pub(crate) fn found(request: &Request, source: &Input<'_>) -> Result<Report, Failure> {
    let _waiting = Waiting::on("identifying");
    let found = request.identify(source)?;
    found.files().map_or(Ok(()), write)?;
    Ok(found)
}

/// Prints the report, and writes the page.
pub(crate) fn show(arguments: &Identify, found: &mut Report) -> Result<(), Failure> {
    if let Some(path) = &arguments.report {
        let _waiting = Waiting::on("drawing");
        write_text(path, &report::page(found))?;
    }
    print(&match (arguments.json, arguments.rows) {
        (true, true) => to_text(&found.with_rows()),
        (true, false) => to_text(found),
        (false, _) => report::text(found, arguments.details),
    })
}

/// Identifies every loop of a flight log.
fn survey(arguments: &Identify, request: &Request, source: &Input<'_>) -> Result<Survey, Failure> {
    let waiting = Waiting::on("identifying");
    let progress = |done, all| waiting.is_at("identifying loops", done, all);
    Ok(request.survey_for(source, arguments.report.is_some(), &progress)?)
}

fn show_survey(arguments: &Identify, surveyed: &Survey) -> Result<ExitCode, Failure> {
    surveyed.files.as_ref().map_or(Ok(()), write)?;
    if let Some(path) = &arguments.report {
        let _waiting = Waiting::on("drawing");
        write_text(path, &page::flight(surveyed))?;
    }
    print(&match arguments.json {
        true => to_text(surveyed),
        false => flight::text(surveyed, arguments.details),
    })?;
    let is_any = surveyed.loops.iter().any(|one| one.best().is_some());
    let is_unwritten = arguments.write.write.is_some() && surveyed.files.is_none();
    Ok(ExitCode::from(match is_any && !is_unwritten {
        true => exit::DONE,
        false => exit::NO_PROCESS,
    }))
}

/// Writes both files or none.
fn write(files: &NamedFiles) -> Result<(), Failure> {
    write_text(&files.restore, &files.text.restore)?;
    if let Err(failure) = write_text(&files.path, &files.text.apply) {
        // A restore file alone would puzzle its reader.
        let _ = std::fs::remove_file(&files.restore);
        return Err(failure);
    }
    Ok(())
}

/// Refuses the standard output and the recording itself as names of the page.
fn check_page(path: &Path, recording: &Path) -> Result<(), Failure> {
    if path == Path::new("-") {
        return Err(Failure::usage(
            "--report needs the name of a file; it cannot be -",
        ));
    }
    let there = |path: &Path| path.canonicalize().ok();
    if there(path).is_some_and(|page| Some(page) == there(recording)) {
        return Err(Failure::usage(format!(
            "--report {} would overwrite the recording: name another file for the page",
            path.display()
        )));
    }
    Ok(())
}

/// Refuses what would be overwritten, before any work is done.
fn check_parameters(arguments: &Identify) -> Result<(), Failure> {
    let Some(path) = &arguments.write.write else {
        return Ok(());
    };
    if path == Path::new("-") || path.file_name().is_none() {
        return Err(Failure::usage(
            "--write needs the name of a file, because a second file to restore the old values is written beside it",
        ));
    }
    // The ending of the firmware is not known yet: a name without one gets each of them.
    let restore = ["params", "param", "txt"].map(|ending| log_gains::restore_path(path, ending));
    let there = |path: &Path| path.canonicalize().ok();
    let all = || std::iter::once(path).chain(&restore);
    let recording = there(&arguments.file);
    if all().any(|path| there(path).is_some() && there(path) == recording) {
        return Err(Failure::usage(format!(
            "--write {} would overwrite the flight log: name another file",
            path.display()
        )));
    }
    if let Some(existing) = all()
        .find(|path| path.exists())
        .filter(|_| !arguments.write.force)
    {
        return Err(Failure::usage(format!(
            "{} exists: name another file with --write, or add --force to replace it",
            existing.display()
        )));
    }
    Ok(())
}
