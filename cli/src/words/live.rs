//! Sentences about a vehicle on a connection: why it is not heard, and what is in force after a write.

use std::io;
use std::path::Path;

use onecycle_link::{FirmwareKind, ParameterFile};
use onecycle_live::{
    AltitudeAbort, AltitudeFlight, AltitudeRefusal, Cause, HandBack, InForce, LiveError, LogEntry,
    LogError, Refusal, ThrustSource,
};

use crate::args::LogId;
use crate::report::number::short;

pub(crate) const NO_PASSPHRASE: &str = "the file has no passphrase: write it into its first line";
pub(crate) const OLD_IS_NEW: &str =
    "the old-file would overwrite the parameters to write: name another file with --old";

/// Why a connection cannot be opened.
pub(crate) fn unopened(error: &io::Error) -> String {
    let advice = match error.kind() {
        io::ErrorKind::AddrInUse => {
            "another program listens there: close it, or let it forward to another port"
        }
        io::ErrorKind::PermissionDenied => {
            "you may not use the device: add yourself to its group (dialout)"
        }
        io::ErrorKind::NotFound => "check the name of the device or the host",
        _ => "check the connection",
    };
    format!("cannot be opened ({error}); {advice}")
}

/// What a connection lacks, and what to do.
pub(crate) fn live(error: &LiveError) -> String {
    let advice = match error {
        LiveError::Silent(_) => {
            "check port, cable, baud rate and firewall, or wait longer with --wait"
        }
        LiveError::NoAutopilot(_) => "check --system, and that the autopilot is on",
        LiveError::Unsigned => "set the key up in the vehicle first, or leave out --key",
        LiveError::WrongKey => "check the passphrase, and the clocks of vehicle and computer",
        LiveError::Unanswered { is_signed: false } => {
            "if it asks for signed messages, give its passphrase with --key; else check that the link carries both ways"
        }
        LiveError::Unanswered { is_signed: true } => {
            "it does not take our signature, or the link carries one way only: set the same key up in the vehicle again"
        }
        LiveError::Lost => "nothing was changed; try again when the link is back",
        _ => return error.to_string(),
    };
    format!("{error}; {advice}")
}

/// Why nothing is written.
pub(crate) fn refusal(refusal: &Refusal) -> String {
    let advice = match refusal {
        Refusal::Armed => "disarm it, or add --armed to change gains in flight",
        Refusal::Missing(_) => "the file is for another firmware, version or vehicle",
        _ => "correct the file",
    };
    format!("nothing was written: {refusal}; {advice}")
}

/// The file is for another firmware.
pub(crate) fn other_firmware(file: &ParameterFile, own: Option<FirmwareKind>) -> String {
    format!(
        "nothing was written: the file is for {}, but the vehicle has {}",
        firmware(Some(file.firmware)),
        firmware(own)
    )
}

/// Name of a firmware.
pub(crate) fn firmware(kind: Option<FirmwareKind>) -> &'static str {
    match kind {
        Some(FirmwareKind::Px4) => "PX4",
        Some(FirmwareKind::ArduPilot) => "ArduPilot",
        _ => "another firmware",
    }
}

pub(crate) fn old_exists(path: &Path) -> String {
    format!(
        "{} exists and has other values: name another file with --old, or add --force to replace it",
        path.display()
    )
}

/// A write that changed nothing.
pub(crate) fn rolled_back(cause: &Cause) -> String {
    format!(
        "{}; the old values are in force, all of them were read back",
        because(cause)
    )
}

/// A write that left parameters uncertain.
pub(crate) fn uncertain(cause: &Cause, left: &[InForce], old: &Path) -> String {
    let one = |of: &InForce| match of.now {
        Some(now) => format!("{} is {}, not {}", of.name, short(now), short(of.old)),
        None => format!("{} is {} or {}", of.name, short(of.old), short(of.new)),
    };
    let values: Vec<String> = left.iter().map(one).collect();
    format!(
        "{}, and the old values could not all be restored: {}. Do not fly: write {} when the link is back, which sets the \
         old values",
        because(cause),
        values.join(", "),
        old.display()
    )
}

fn because(cause: &Cause) -> String {
    match cause {
        Cause::Mismatch {
            name,
            wanted,
            found,
        } => format!(
            "the vehicle took {} instead of {} for {name}",
            short(*found),
            short(*wanted)
        ),
        cause => cause.to_string(),
    }
}

pub(crate) const ONLY_PX4: &str = "--write is for PX4: ArduCopter controls the acceleration inside its altitude loop, and the \
    gains of a PID have no place there. Leave out --write, and take the process from the report";
pub(crate) const NO_CASCADE: &str = "PX4's cascade needs a controller with proportional and derivative gain, which the proposed one does not have; choose another --style, after --.";

pub(crate) fn no_log(id: LogId, logs: &[LogEntry]) -> String {
    match (id, logs.len()) {
        (_, 0) => "the vehicle has no log".to_owned(),
        (LogId::Number(id), count) => {
            format!("the vehicle has no log {id}; it lists {count}: leave out -o to see them")
        }
        (LogId::Latest, _) => "the vehicle has no log with a number".to_owned(),
    }
}

/// A download that the link ended.
pub(crate) fn interrupted(error: &LiveError, part: &Path) -> String {
    format!("{error}; the same command goes on from {}", part.display())
}

pub(crate) fn short_log(error: &LogError, part: &Path) -> String {
    format!("{error}; what came is in {}", part.display())
}

pub(crate) fn file_exists(path: &Path) -> String {
    format!(
        "{} exists: name another file, or add --force to replace it",
        path.display()
    )
}

/// A test that did not begin.
pub(crate) fn not_begun(refusal: &AltitudeRefusal) -> String {
    let advice = match refusal {
        AltitudeRefusal::NotFlying => "take off and hover first",
        AltitudeRefusal::Mode { .. } => "change the mode, and let it hover",
        AltitudeRefusal::Rate(_) => "use a faster link, or let other programs ask for less",
        AltitudeRefusal::Moving(_) => "wait until it hovers, in calm air",
        AltitudeRefusal::Thrust(_) => {
            "take a smaller --amplitude; the firmware must send ATTITUDE_TARGET"
        }
        AltitudeRefusal::NoMode(_) => "check the messages of the vehicle and the mode switch",
        _ => "nothing was changed",
    };
    format!("no test: {refusal}; {advice}")
}

/// A test that ended early.
pub(crate) fn aborted(abort: &AltitudeAbort, flight: &AltitudeFlight, out: &Path) -> String {
    let advice = match abort {
        AltitudeAbort::Height(_) | AltitudeAbort::Climb(_) => {
            "take a smaller --amplitude, or a larger --band or --climb"
        }
        AltitudeAbort::Drift(_) => "fly in calm air, or allow a larger --drift",
        AltitudeAbort::Duration(_) => "take fewer --cycles, or a longer --duration",
        AltitudeAbort::NoOscillation(_) => "take a larger --amplitude",
        AltitudeAbort::Stale(_) => "use a better link",
        _ => "begin again when the vehicle hovers",
    };
    let count = flight.samples.len();
    format!(
        "the test ended early: {abort}; {advice}. {} has the {count} samples until then",
        out.display()
    )
}

/// What the vehicle does after the test.
pub(crate) fn hand_back(flight: &AltitudeFlight) -> &'static str {
    match flight.hand_back {
        HandBack::Holds => "the vehicle holds its position",
        HandBack::NotOurs => "the pilot has the vehicle; nothing more was sent",
        _ => "WARNING: the vehicle was told to hold its position and did not confirm it: take over",
    }
}

/// Where the recorded thrust comes from.
pub(crate) fn source(source: ThrustSource) -> &'static str {
    match source {
        ThrustSource::Reported => "as the vehicle reports it (ATTITUDE_TARGET)",
        ThrustSource::Commanded => "as it was sent: the dead time contains the delay of the link",
    }
}
