//! `onecycle live`: a vehicle over MAVLink.

mod log;
mod relay;
mod state;
mod write;

use std::process::ExitCode;

use onecycle_live::{Key, LiveError, Vehicle};

use crate::args::{ConnectionArguments, Live, LiveAction};
use crate::failure::{Failure, exit};
use crate::output::Waiting;
use crate::reading::{MOST_OF_SETTINGS, text_at_most};
use crate::words::live as words;

pub(crate) fn run(arguments: &Live) -> Result<ExitCode, Failure> {
    match &arguments.action {
        LiveAction::State(state) => state::run(state),
        LiveAction::Log(log) => log::run(log),
        LiveAction::Write(write) => write::run(write),
        LiveAction::Relay(relay) => relay::run(relay),
    }
}

/// The vehicle at the other end.
fn connect(arguments: &ConnectionArguments) -> Result<Vehicle, Failure> {
    let key = (arguments.key.as_ref())
        .map(|path| {
            let text = text_at_most(path, MOST_OF_SETTINGS)?;
            match text.trim_end_matches(['\r', '\n']) {
                "" => Err(Failure::unreadable(path, words::NO_PASSPHRASE)),
                passphrase => Ok(Key::of_passphrase(passphrase)),
            }
        })
        .transpose()?;
    let name = arguments.connection.to_string();
    let _waiting = Waiting::on(format!("waiting for a vehicle on {name}"));
    let wire = arguments.connection.open();
    let wire = wire.map_err(|error| unheard(arguments, &words::unopened(&error)))?;
    Vehicle::connect(wire, key.as_ref(), arguments.system, arguments.wait)
        .map_err(|error| failed(arguments, &error))
}

/// Finished, with a negative result.
fn refused(reason: String) -> Failure {
    Failure::Vehicle {
        code: exit::NO_PROCESS,
        reason,
    }
}

/// The vehicle cannot be asked.
fn failed(arguments: &ConnectionArguments, error: &LiveError) -> Failure {
    unheard(arguments, &words::live(error))
}

fn unheard(arguments: &ConnectionArguments, reason: &str) -> Failure {
    Failure::Vehicle {
        code: exit::INPUT,
        reason: format!("{}: {reason}", arguments.connection),
    }
}
