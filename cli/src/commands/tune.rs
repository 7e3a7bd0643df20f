//! `onecycle tune`: a process in, its controller out; or what an oscillation tells of it.

use std::process::ExitCode;

use onecycle::DesignReport;

use crate::args::Tune;
use crate::failure::{Failure, exit};
use crate::output::{print, write_text};
use crate::report::json::to_text;
use crate::report::tune as report;

/// The process of the arguments with its controllers.
fn tuned(arguments: &Tune) -> Result<DesignReport, Failure> {
    let request = arguments.noise.request(arguments.design.requirements());
    let known = (arguments.oscillation).known(request.in_force()?.as_ref())?;
    Ok(match known {
        Some(known) => request.design_for_all(known)?,
        None => request.design(arguments.process.model()?)?,
    })
}

pub(crate) fn run(arguments: &Tune) -> Result<ExitCode, Failure> {
    let of = tuned(arguments)?;
    let shown = match arguments.json {
        true => to_text(&of),
        false => report::text(&of),
    };
    if let Some(path) = &arguments.report {
        write_text(path, &report::page(of))?;
    }
    print(&shown)?;
    Ok(ExitCode::from(exit::DONE))
}
