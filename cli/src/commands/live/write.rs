//! `onecycle live write`: parameters with read-back and roll-back.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use onecycle_link::{ParameterFile, ParameterLine, parameter_text, read_parameters};
use onecycle_live::{Assignment, Outcome, Plan, Refusal, Vehicle};

use super::{connect, failed, refused};
use crate::args::LiveWrite;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, with_ending, write_text};
use crate::reading::{MOST_OF_SETTINGS, text_at_most};
use crate::report::live as report;
use crate::words::live as words;

pub(crate) fn run(arguments: &LiveWrite) -> Result<ExitCode, Failure> {
    let path = &arguments.file;
    let text = text_at_most(path, MOST_OF_SETTINGS)?;
    let file = read_parameters(&text).map_err(|error| Failure::unreadable(path, error))?;
    let old = (arguments.old.clone()).unwrap_or_else(|| old_path(path));
    if old
        .canonicalize()
        .is_ok_and(|there| path.canonicalize().ok() == Some(there))
    {
        return Err(Failure::usage(words::OLD_IS_NEW));
    }
    let mut vehicle = connect(&arguments.connection)?;
    if vehicle.firmware() != Some(file.firmware) {
        return Err(refused(words::other_firmware(&file, vehicle.firmware())));
    }
    let plan = plan(&mut vehicle, &file, arguments)?;
    keep_old(&old, &vehicle, &file, &plan, arguments.force)?;
    let waiting = Waiting::on("writing");
    let outcome = plan.run(&mut vehicle, arguments.patience, |step| {
        waiting.goes_on(format!("{} is written", step.name));
    });
    drop(waiting);
    match outcome {
        Outcome::Written => {
            print(&report::written(plan.steps(), &old))?;
            Ok(ExitCode::from(exit::DONE))
        }
        Outcome::RolledBack(cause) => Err(refused(words::rolled_back(&cause))),
        Outcome::Uncertain(cause, left) => Err(Failure::Vehicle {
            code: exit::OUTPUT,
            reason: words::uncertain(&cause, &left, &old),
        }),
        other => Err(refused(format!("{other:?}"))),
    }
}

/// `NAME.old.EXT` beside `NAME.EXT`.
fn old_path(path: &Path) -> PathBuf {
    match path.extension() {
        Some(ending) => {
            let ending = format!("old.{}", ending.to_string_lossy());
            with_ending(&path.with_extension(""), &ending)
        }
        None => with_ending(path, "old"),
    }
}

fn plan(
    vehicle: &mut Vehicle,
    file: &ParameterFile,
    arguments: &LiveWrite,
) -> Result<Plan, Failure> {
    let assignment = |line: &ParameterLine| Assignment {
        name: line.name.clone(),
        value: line.value,
    };
    let wanted: Vec<Assignment> = file.lines.iter().map(assignment).collect();
    let _waiting = Waiting::on("reading the old values");
    match Plan::new(vehicle, &wanted, arguments.armed) {
        Ok(plan) => Ok(plan),
        Err(Refusal::Live(error)) => Err(failed(&arguments.connection, &error)),
        Err(refusal) => Err(refused(words::refusal(&refusal))),
    }
}

/// Writes the file that sets the old values again. One with the same values may be there.
fn keep_old(
    path: &Path,
    vehicle: &Vehicle,
    file: &ParameterFile,
    plan: &Plan,
    is_forced: bool,
) -> Result<(), Failure> {
    let line = |step: &onecycle_live::Step| ParameterLine {
        name: step.name.clone(),
        value: step.old,
        is_integer: step.is_integer,
    };
    let lines: Vec<ParameterLine> = plan.steps().iter().map(line).collect();
    let text = parameter_text(file.firmware, vehicle.system(), &lines);
    let is_there = path.exists();
    if is_there && text_at_most(path, MOST_OF_SETTINGS).is_ok_and(|own| own == text) {
        return Ok(());
    }
    if is_there && !is_forced {
        return Err(Failure::usage(words::old_exists(path)));
    }
    write_text(path, &text)
}
