//! `onecycle live state`: what a vehicle tells about itself.

use std::process::ExitCode;

use super::{connect, failed};
use crate::args::LiveState;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print};
use crate::report::live as report;

pub(crate) fn run(arguments: &LiveState) -> Result<ExitCode, Failure> {
    let connection = &arguments.connection;
    let mut vehicle = connect(connection)?;
    let waiting = Waiting::on("asking for the state");
    let state = vehicle.state();
    drop(waiting);
    let state = state.map_err(|error| failed(connection, &error))?;
    let name = connection.connection.to_string();
    print(&match arguments.json {
        true => report::json(&state),
        false => report::text(&name, &state),
    })?;
    Ok(ExitCode::from(exit::DONE))
}
