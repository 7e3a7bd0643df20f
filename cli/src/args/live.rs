//! Arguments of `onecycle live`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, FromArgMatches, Subcommand, ValueEnum};
use onecycle::request::values::AXES;
use onecycle_link::Axis;
use onecycle_live::Address;

use super::{Identify, WriteArguments, named, share_within};
use crate::failure::Failure;

/// Talk to a vehicle over MAVLink (PX4, ArduPilot): state, flight logs, parameters, a relay test of the altitude.
///
/// CONNECTION is udp:PORT (listen), udp:HOST:PORT (send) or serial:DEVICE:BAUD, as ground stations write it.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle live state udp:14550\n",
    "  onecycle live log udp:14550 -o flight.ulg --identify roll --write roll.params\n",
    "  onecycle live write serial:/dev/ttyACM0:57600 roll.params\n",
    "  onecycle live relay udp:14550 --axis altitude -o altitude.csv\n\n",
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
    Log(LiveLog),
    Write(LiveWrite),
    Relay(LiveRelay),
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

/// List the flight logs of a vehicle, or download one.
///
/// Blocks that are lost are asked for again. An interrupted download leaves FILE.part, and the same command goes on from
/// there. With --identify the log is identified at once.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle live log udp:14550\n",
    "  onecycle live log udp:14550 -o flight.ulg\n",
    "  onecycle live log udp:14550 --id 12 -o flight.bin --identify pitch --report pitch.html --write pitch.param\n",
    "  onecycle live log udp:14550 -o flight.ulg --identify roll -- --style calm --from 20\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 the vehicle is not heard or the link was lost (FILE.part stays), 4 no such ",
    "log, or no process identified, 5 output not written"
))]
pub(crate) struct LiveLog {
    #[command(flatten)]
    pub(crate) connection: ConnectionArguments,
    /// Number of the log in the list, or latest
    #[arg(long, value_name = "N|latest", default_value = "latest", value_parser = log_id)]
    pub(crate) id: LogId,
    /// Download to this file [default: list the logs]
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Identify the rate loop of this axis from the log
    #[arg(long, value_name = "AXIS", requires = "out", value_parser = named(&AXES))]
    pub(crate) identify: Option<Axis>,
    /// With --identify: write a report with figures to this file
    #[arg(long, value_name = "OUT.html", requires = "identify")]
    pub(crate) report: Option<PathBuf>,
    /// With --identify: write the changed parameters to this file, as identify does
    #[arg(long, value_name = "NAME.EXT", requires = "identify")]
    pub(crate) write: Option<PathBuf>,
    /// Further options of identify, after --
    #[arg(last = true, value_name = "OPTIONS", requires = "identify")]
    pub(crate) options: Vec<OsString>,
}

/// The arguments of `identify` for a file that a command makes, with further options.
pub(crate) fn identify_of(file: &Path, options: &[OsString]) -> Result<Identify, Failure> {
    let command = Identify::augment_args(clap::Command::new("identify").no_binary_name(true));
    let end = [OsString::from("--"), file.into()];
    let parsed = command.try_get_matches_from(options.iter().cloned().chain(end));
    let parsed = parsed.and_then(|matches| Identify::from_arg_matches(&matches));
    parsed.map_err(|error| {
        let text = error.to_string();
        let first = text.lines().next().unwrap_or_default();
        let reason = first.trim_start_matches("error: ");
        Failure::usage(format!("options of identify: {reason}"))
    })
}

/// Which log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LogId {
    Latest,
    Number(u16),
}

fn log_id(text: &str) -> Result<LogId, String> {
    match text {
        "latest" => Ok(LogId::Latest),
        number => (number.parse().map(LogId::Number))
            .map_err(|_| "a log is its number in the list, or latest".to_owned()),
    }
}

/// Fly a relay test of the altitude from this computer, record it and identify the process.
///
/// The vehicle hovers: PX4 in Hold, ArduCopter in Guided. This program then sets its thrust in Offboard or Guided, with the
/// attitude and the heading held. The test ends after its cycles, at a limit, when a stick or the mode is moved, when
/// messages are lost, and on Ctrl-C; then the vehicle holds its position. No gain is changed: --write makes a file for
/// `onecycle live write`.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle live relay udp:14550 --axis altitude -o altitude.csv\n",
    "  onecycle live relay udp:14550 --axis altitude -o altitude.csv --amplitude 5% --write altitude.params\n",
    "  onecycle live relay udp:14550 --axis altitude -o altitude.csv -- --style calm --report altitude.html\n",
    "  onecycle live relay udp:14550 --axis altitude -o altitude.csv -- --structure double_integrator_lag\n\n",
    "Ten cycles show little of the drag of a multirotor that rises and sinks. Where identify refuses such a test because a ",
    "parameter lies at its bound, the last example leaves the drag out.\n\n",
    "Exit codes: 0 identified, 2 bad arguments, 3 the vehicle is not heard, 4 the test did not begin or ended early, or no ",
    "process was identified, 5 output not written"
))]
pub(crate) struct LiveRelay {
    #[command(flatten)]
    pub(crate) connection: ConnectionArguments,
    /// Loop to test
    #[arg(long, value_enum)]
    pub(crate) axis: RelayAxis,
    /// Recording to write (CSV)
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Half the jump of the thrust, as a share of the full thrust, 1 to 30 %, such as 10% or 0.1
    #[arg(long, value_name = "SHARE", default_value = "10%", allow_hyphen_values = true, value_parser = amplitude)]
    pub(crate) amplitude: f64,
    /// Cycles to record, 2 to 100
    #[arg(long, value_name = "N", default_value_t = 10, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u32).range(2..=100))]
    pub(crate) cycles: u32,
    /// Largest distance from the height at the start, in metres
    #[arg(long, value_name = "M", default_value_t = 1.0, allow_negative_numbers = true, value_parser = limit)]
    pub(crate) band: f64,
    /// Largest climb or sink rate, in m/s
    #[arg(long, value_name = "M/S", default_value_t = 2.0, allow_negative_numbers = true, value_parser = limit)]
    pub(crate) climb: f64,
    /// Largest horizontal distance from the start, in metres: the position is not held during the test
    #[arg(long, value_name = "M", default_value_t = 10.0, allow_negative_numbers = true, value_parser = limit)]
    pub(crate) drift: f64,
    /// Longest test, in seconds
    #[arg(long, value_name = "S", default_value_t = 60.0, allow_negative_numbers = true, value_parser = limit)]
    pub(crate) duration: f64,
    #[command(flatten)]
    pub(crate) write: WriteArguments,
    /// Further options of identify, after --
    #[arg(last = true, value_name = "OPTIONS")]
    pub(crate) options: Vec<OsString>,
}

/// Loops that a relay test over a link can identify.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RelayAxis {
    Altitude,
}

fn amplitude(text: &str) -> Result<f64, String> {
    let otherwise = "an amplitude lies between 1 and 30 % of the full thrust";
    share_within(text, 0.01..=0.3, otherwise)
}

fn limit(text: &str) -> Result<f64, String> {
    let limit = text
        .parse()
        .ok()
        .filter(|limit: &f64| *limit > 0.0 && limit.is_finite());
    limit.ok_or_else(|| "a limit is a positive number".to_owned())
}
