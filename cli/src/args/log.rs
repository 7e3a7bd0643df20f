//! Arguments of `log`, and which loop of a flight log a command takes.

use std::path::PathBuf;

use clap::Args;
use onecycle::request::values::{AXES, LOOPS, step};
use onecycle::request::{HALF_STEP, LoopKind, Write};
use onecycle_link::Axis;

use super::named;

/// List what a flight log holds: flights, signals of each control loop, gains in force, excitation.
///
/// PX4 ULog, ArduPilot DataFlash (binary or text), Betaflight and INAV blackbox, MCAP with messages of PX4
/// through ROS 2; the format is found by the content of the file.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle log examples/logs/px4_chirps.ulg\n",
    "  onecycle log examples/logs/betaflight_acro.bfl --json\n",
    "  onecycle log examples/logs/px4_chirps.ulg --check\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable file, 5 output not written"
))]
pub(crate) struct Log {
    /// Flight log; - reads the standard input
    pub(crate) file: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Recover the gains of the rate loops from the logged signals, and compare them with the parameters of the log
    #[arg(long)]
    pub(crate) check: bool,
}

/// Which part of a flight log is identified.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Flight logs")]
pub(crate) struct LogArguments {
    /// Axis [default: a card of all loops; roll with an option that needs one loop, such as --from or --report]
    #[arg(long, value_parser = named(&AXES))]
    pub(crate) axis: Option<Axis>,
    /// Control loop: rate (torque to angular rate), attitude (set-point of the rate to angle) or altitude (thrust to
    /// climb rate) [default: rate]
    #[arg(long = "loop", value_parser = named(&LOOPS))]
    pub(crate) control_loop: Option<LoopKind>,
    /// Flight, from 1; a blackbox file may hold several [default: the longest]
    #[arg(long, value_name = "N")]
    pub(crate) flight: Option<usize>,
}

/// Parameters to write.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Flight logs")]
pub(crate) struct WriteArguments {
    /// Write the changed parameters of the loop in the format of the firmware: PX4 .params, ArduPilot .param, Betaflight
    /// CLI. A second file, NAME.restore.EXT, sets the old values again
    #[arg(long, value_name = "NAME.EXT")]
    pub(crate) write: Option<PathBuf>,
    /// With --write: share of the way from the gains in force to the proposed ones, such as 25% or 0.25; 100% goes
    /// all the way
    #[arg(long, value_name = "SHARE", default_value_t = HALF_STEP, requires = "write", allow_negative_numbers = true,
          value_parser = step)]
    pub(crate) step: f64,
    /// With --write: replace files that exist
    #[arg(long, requires = "write")]
    pub(crate) force: bool,
    /// With --write: write gains that break a limit of the style too, such as its phase margin or Ms
    #[arg(long, requires = "write")]
    pub(crate) below_limits: bool,
}

impl WriteArguments {
    /// What is asked.
    pub(crate) fn write(&self) -> Write {
        let mut write = Write::default();
        write.file.clone_from(&self.write);
        write.step = self.step;
        write.below_limits = self.below_limits;
        write
    }
}
