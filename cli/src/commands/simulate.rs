//! `onecycle simulate`: simulate a test and write its recording.

mod expect;
mod head;
mod plan;

use std::io::{self, Write};
use std::ops::ControlFlow;
use std::process::ExitCode;

use onecycle_link::CsvWriter;
use onecycle_plant::Noise;

use crate::args::Simulate;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, print_whole, write_file};
use plan::{LARGEST, Plan};

pub(crate) fn run(arguments: &Simulate) -> Result<ExitCode, Failure> {
    let waiting = Waiting::on("simulating");
    let plan = Plan::new(arguments)?;
    if arguments.expect {
        let text = expect::text(arguments, &plan)?;
        drop(waiting);
        print(&text)?;
        return Ok(ExitCode::from(exit::DONE));
    }
    let head = head::head(arguments, &plan);
    let comments: Vec<&str> = head.lines().collect();
    let mut end = Ok(());
    let mut simulate = |file: &mut dyn Write| {
        let written = write(arguments, &plan, &comments, file);
        match written {
            Ok(result) => {
                end = result;
                // What follows must not replace a file by half a simulation.
                if end.is_ok() {
                    Ok(())
                } else {
                    Err(io::ErrorKind::Other.into())
                }
            }
            Err(reason) => Err(reason),
        }
    };
    let path = arguments.out.as_ref();
    let written = match path.filter(|path| path.as_os_str() != "-") {
        Some(path) => write_file(path, |file| simulate(file)),
        None => print_whole(&mut simulate),
    };
    drop(waiting);
    end.and(written)?;
    Ok(ExitCode::from(exit::DONE))
}

/// Simulates and writes row by row. The inner error is one of the simulation: the output goes beyond all limits.
fn write(
    arguments: &Simulate,
    plan: &Plan,
    comments: &[&str],
    file: &mut dyn Write,
) -> io::Result<Result<(), Failure>> {
    let setpoint: &[&str] = if arguments.closed.is_some() {
        &["setpoint"]
    } else {
        &[]
    };
    let mut writer = CsvWriter::new(file, comments, setpoint)?;
    let mut failed = Ok(Ok(()));
    let mut controller = match plan.controller(arguments) {
        Ok(controller) => controller,
        Err(failure) => return Ok(Err(failure)),
    };
    let mut noise = Noise::from_seed(arguments.seed);
    plan.experiment.observe(&mut controller, &mut noise, |row| {
        let Some(output) = row.output else {
            return ControlFlow::Continue(());
        };
        if !(output.abs() <= LARGEST && row.input.abs() <= LARGEST) {
            failed = Ok(Err(plan::diverged(arguments, row.time_s)));
            return ControlFlow::Break(());
        }
        let more = &[row.setpoint][..setpoint.len()];
        match writer.row(row.time_s, output, row.input, more) {
            Ok(()) => ControlFlow::Continue(()),
            Err(reason) => {
                failed = Err(reason);
                ControlFlow::Break(())
            }
        }
    });
    if let Ok(Ok(())) = failed {
        writer.finish()?;
    }
    failed
}
