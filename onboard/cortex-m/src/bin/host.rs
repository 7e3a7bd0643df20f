//! The flight on the host: its lines to standard output, the numbers found in words to standard error.

use std::io::Write;
use std::process::ExitCode;

use onecycle_flight::{Analyst, fly, numbers, settings};
use onecycle_onboard::identification::{Analysis, Bench, Desk};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::tuner::TunerCore;

fn main() -> ExitCode {
    let (Ok(checked), Ok(pack)) = (settings().checked(), Pack::embedded()) else {
        return ExitCode::FAILURE;
    };
    let mut tuner = TunerCore::of(&checked);
    let (mut desk, mut bench) = (Desk::NEW, Bench::NEW);
    let mut analyst = Analyst {
        analysis: Analysis::new(pack),
        desk: &mut desk,
        bench: &mut bench,
    };
    let mut lines = Vec::new();
    // Instructions are not counted on the host.
    let is_tuned = fly(
        &mut tuner,
        &mut analyst,
        || 0,
        |line| {
            let ended = line.ended();
            lines.extend_from_slice(&ended[..ended.len() - 1]);
        },
    );
    if let Some(found) = tuner.identified() {
        for (name, value) in numbers(found) {
            let _ = writeln!(std::io::stderr(), "{name} {value}");
        }
    }
    if std::io::stdout().write_all(&lines).is_ok() && is_tuned {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
