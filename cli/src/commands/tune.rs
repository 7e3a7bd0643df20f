//! `onecycle tune`: a process in, its controller out.

use std::process::ExitCode;

use onecycle::{Model, Specification, design, step_response};

use crate::args::Tune;
use crate::failure::{Failure, exit};
use crate::output::{print, write_text};
use crate::report::{json, page, text};

pub(crate) fn run(arguments: &Tune) -> Result<ExitCode, Failure> {
    let model = Model::from(arguments.process.process()?);
    let asked = Specification::default().with_phase_margin_rad(arguments.phase_margin);
    let best = design(&model, &asked).map_err(Failure::usage)?;
    let response = step_response(&model, &best.controller).ok();
    let step = response.as_ref().map(|response| &response.metrics);
    if let Some(path) = &arguments.report {
        write_text(path, &page::design(&model, &best, response.as_ref()))?;
    }
    print(&if arguments.json {
        json::design(&model, &best, step)
    } else {
        text::design(&model, &best, step)
    })?;
    Ok(ExitCode::from(exit::DONE))
}
