//! `onecycle tune`: a process in, its controller out.

use std::process::ExitCode;

use onecycle_design::soiptd_pd::optimum::pd;
use onecycle_design::soiptd_pd::step_response::step_response;

use crate::args::Tune;
use crate::failure::{Failure, exit};
use crate::output::{print, write_text};
use crate::report::{json, page, text};

pub(crate) fn run(arguments: &Tune) -> Result<ExitCode, Failure> {
    let process = arguments.process.process()?;
    let optimum = pd(&process, arguments.phase_margin).map_err(Failure::usage)?;
    let response = step_response(&process, optimum.pd).ok();
    let step = response.as_ref().map(|response| &response.metrics);
    if let Some(path) = &arguments.report {
        write_text(path, &page::design(&process, &optimum, response.as_ref()))?;
    }
    print(&if arguments.json {
        json::design(&process, &optimum, step)
    } else {
        text::design(&process, &optimum, step)
    })?;
    Ok(ExitCode::from(exit::DONE))
}
