//! `onecycle simulate`: simulate a test and write its recording.

mod expect;
mod head;
mod plan;

use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;
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
    let mut end = Ok(());
    let mut simulate = |file: &mut dyn Write| {
        let (result, written) = simulated(arguments, &plan, file);
        end = result;
        written
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

/// The intervals to expect.
pub(crate) fn expected(arguments: &Simulate) -> Result<String, Failure> {
    expect::text(arguments, &Plan::new(arguments)?)
}

/// The recording as CSV.
pub(crate) fn csv(arguments: &Simulate) -> Result<Vec<u8>, Failure> {
    let plan = Plan::new(arguments)?;
    let mut bytes = Vec::new();
    let (end, written) = simulated(arguments, &plan, &mut bytes);
    end?;
    let failed = |reason| Failure::output(Path::new("the recording"), reason);
    written.map_err(failed).map(|()| bytes)
}

/// Simulates and writes. The output has failed where the simulation has, so that half a simulation replaces no file.
fn simulated(
    arguments: &Simulate,
    plan: &Plan,
    file: &mut dyn Write,
) -> (Result<(), Failure>, io::Result<()>) {
    let head = head::head(arguments, plan);
    let comments: Vec<&str> = head.lines().collect();
    match write(arguments, plan, &comments, file) {
        Ok(Ok(())) => (Ok(()), Ok(())),
        Ok(Err(failure)) => (Err(failure), Err(io::ErrorKind::Other.into())),
        Err(reason) => (Ok(()), Err(reason)),
    }
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
