//! Arguments of `onecycle live`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};
use onecycle_live::Address;

/// Talk to a vehicle over MAVLink (PX4, ArduPilot): its state, its parameters.
///
/// CONNECTION is udp:PORT (listen), udp:HOST:PORT (send) or serial:DEVICE:BAUD, as ground stations write it.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle live state udp:14550\n",
    "  onecycle live write serial:/dev/ttyACM0:57600 roll.params\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 the vehicle is not heard or an input file cannot be read, 4 refused or ",
    "rolled back: the old values are in force, 5 output not written, or parameters left uncertain"
))]
pub(crate) struct Live {
    #[command(subcommand)]
    pub(crate) action: LiveAction,
}

#[derive(Debug, Subcommand)]
pub(crate) enum LiveAction {
    State(LiveState),
    Write(LiveWrite),
}

/// How the vehicle is reached.
#[derive(Clone, Debug, Args)]
pub(crate) struct ConnectionArguments {
    /// udp:PORT (listen), udp:HOST:PORT or serial:DEVICE:BAUD
    pub(crate) connection: Address,
    /// Sign all messages with the key of the passphrase in this file, and accept only signed ones
    #[arg(long, value_name = "PASSPHRASE_FILE", help_heading = "Connection")]
    pub(crate) key: Option<PathBuf>,
    /// Number of the vehicle (MAV_SYS_ID, SYSID_THISMAV), if several are heard [default: the first one heard]
    #[arg(long, value_name = "N", help_heading = "Connection",
          value_parser = clap::value_parser!(u8).range(1..))]
    pub(crate) system: Option<u8>,
    /// Time to wait for the vehicle, in seconds
    #[arg(long, value_name = "S", default_value = "10", help_heading = "Connection",
          allow_negative_numbers = true, value_parser = wait)]
    pub(crate) wait: Duration,
}

/// Longest wait for a vehicle (s).
const LONGEST_WAIT_S: f64 = 3600.0;

fn wait(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok();
    let seconds = seconds.filter(|s: &f64| (0.1..=LONGEST_WAIT_S).contains(s));
    let seconds = seconds.ok_or("a wait lies between 0.1 and 3600 s")?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Show the state of a vehicle: firmware, mode, battery, estimator, gains in force.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle live state udp:14550\n",
    "  onecycle live state serial:/dev/ttyUSB0:57600 --json\n",
    "  onecycle live state udp:14550 --key hangar.txt\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 the vehicle is not heard or does not answer, 5 output not written"
))]
pub(crate) struct LiveState {
    #[command(flatten)]
    pub(crate) connection: ConnectionArguments,
    /// Print the state as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Write the parameters of a file to a vehicle: all of them or none.
///
/// FILE is what identify --write makes (PX4 .params, ArduPilot .param). First every old value is read and kept in the
/// old-file. Each new value is read back. If one differs, or the link is lost, the old values are set and read back; the
/// message says what is in force.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle live write udp:14550 roll.params\n",
    "  onecycle live write serial:/dev/ttyACM0:57600 roll.param --old before.param\n\n",
    "Exit codes: 0 written and read back, 2 bad arguments, 3 the vehicle is not heard or FILE cannot be read, 4 refused ",
    "(armed, missing parameter, bad value) or rolled back: the old values are in force, 5 the old-file cannot be ",
    "written, or the old values could not all be restored"
))]
pub(crate) struct LiveWrite {
    #[command(flatten)]
    pub(crate) connection: ConnectionArguments,
    /// Parameters to write
    pub(crate) file: PathBuf,
    /// File for the old values [default: NAME.old.EXT beside FILE]
    #[arg(long, value_name = "FILE")]
    pub(crate) old: Option<PathBuf>,
    /// Replace an old-file that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Write although the motors are armed
    #[arg(long)]
    pub(crate) armed: bool,
    /// Time to wait for a lost link before the old values are given up, in seconds
    #[arg(long, value_name = "S", default_value = "60", allow_negative_numbers = true, value_parser = wait)]
    pub(crate) patience: Duration,
}
