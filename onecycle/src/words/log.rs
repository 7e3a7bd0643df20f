//! Sentences about flight logs: why one gives no signals, and how to log better.

use onecycle_link::{
    Axis, ControlLoop, Firmware, FirmwareKind, Flight, LogError, LogFormat, Loss, Mark, MarkKind,
};

use crate::words::number::short;

/// Least rate of input and output of a rate loop, in hertz: a small multirotor answers within 20 to 50 ms.
const LEAST_RATE_HZ: f64 = 100.0;

/// Least standard deviation of the set-point of a rate loop that excites it, in rad/s.
const LEAST_MOVEMENT: f64 = 0.1;

const OF_A_PLANE: &str = "The rate loops of a plane are logged as PIDR, PIDP and PIDY, which this program does not read. Write \
    one of them to a CSV file: the sum of P, I, D and FF is the input, Act the output, Tar the set-point.";

/// What is wrong with a log, and what to do.
pub fn refusal(error: &LogError) -> String {
    let advice = match error {
        LogError::UnknownFormat => {
            "expected a PX4 ULog, an ArduPilot DataFlash log, a blackbox log or an MCAP file"
        }
        LogError::NotBuilt(_) => "build onecycle-link with its feature mcap",
        LogError::Empty => "download it from the vehicle again",
        LogError::NoSuchFlight { .. } => "choose another one with `flight`",
        LogError::NotLogged { .. } => "choose another loop; `log FILE` lists them",
        LogError::Recording(_) => "choose another loop or another flight; `log FILE` lists them",
        _ => return error.to_string(),
    };
    format!("{error}; {advice}")
}

/// Name of a format.
pub fn format(format: LogFormat) -> &'static str {
    match format {
        LogFormat::ULog => "PX4 ULog",
        LogFormat::DataFlash => "ArduPilot DataFlash",
        LogFormat::DataFlashText => "ArduPilot DataFlash (text)",
        LogFormat::Blackbox => "blackbox",
        LogFormat::Mcap => "MCAP",
        _ => "flight log",
    }
}

/// Name of a firmware.
pub fn firmware(kind: FirmwareKind) -> &'static str {
    match kind {
        FirmwareKind::Px4 => "PX4",
        FirmwareKind::ArduPilot => "ArduPilot",
        FirmwareKind::Betaflight => "Betaflight",
        FirmwareKind::Inav => "INAV",
        _ => "unknown firmware",
    }
}

/// A stretch of deliberate excitation.
pub fn mark(mark: &Mark) -> String {
    let what = match mark.kind {
        MarkKind::Px4Autotune => "PX4 autotune",
        MarkKind::ArduPilotSystemId => "SYSTEMID",
        MarkKind::ArduPilotAutotune => "AutoTune",
        MarkKind::BetaflightChirp => "chirp",
        _ => "excitation",
    };
    let axis = mark
        .axis
        .map_or(String::new(), |axis| format!(" on {}", axis.name()));
    format!(
        "{what}{axis}, {:.2} to {:.2} s",
        mark.span.from_s, mark.span.to_s
    )
}

/// What was lost; `None`: nothing.
pub fn loss(loss: &Loss) -> Option<String> {
    let mut facts = Vec::new();
    if loss.bytes_skipped > 0 {
        facts.push(format!("{} bytes skipped", loss.bytes_skipped));
    }
    if loss.rows_dropped > 0 {
        facts.push(format!("{} damaged messages dropped", loss.rows_dropped));
    }
    if loss.dropouts > 0 {
        facts.push(format!(
            "{} drop-outs of the logger, {:.2} s in all",
            loss.dropouts, loss.dropout_s
        ));
    }
    if loss.is_truncated {
        facts.push("the log ends inside a message".to_owned());
    }
    (!facts.is_empty()).then(|| facts.join(", "))
}

/// What to change for a better log.
///
/// `moved`: standard deviation (rad/s) of the set-points of the rate loops in the liveliest part of the flight. `None`: they
/// cannot be read.
pub fn advice(flight: &Flight, moved: Option<f64>) -> Vec<String> {
    let rate = flight.logged_loop(ControlLoop::Rate(Axis::Roll));
    let rate_hz = rate.filter(|rate| rate.is_complete()).map(|rate| {
        let rates =
            [&rate.input, &rate.output].map(|signal| signal.as_ref().map_or(0.0, |s| s.rate_hz));
        rates[0].min(rates[1])
    });
    let is_plane = rate_hz.is_none() && flight.tables.topic("PIDR").is_some_and(|of| of.rows > 0);
    let logged = match rate_hz {
        None if is_plane => Some(OF_A_PLANE.to_owned()),
        None => Some("The signals of the rate loops are not logged.".to_owned()),
        Some(rate_hz) if rate_hz < LEAST_RATE_HZ => Some(format!(
            "The rate loops are logged at {rate_hz:.0} Hz; a small multirotor needs {LEAST_RATE_HZ:.0} Hz or more."
        )),
        Some(_) => None,
    };
    let faster = faster(flight).filter(|_| !is_plane);
    let logged = logged.map(|logged| match faster {
        Some(faster) => format!("{logged} {faster}"),
        None => logged,
    });
    let is_excited = !flight.marks.is_empty() || moved.is_some_and(|moved| moved > LEAST_MOVEMENT);
    let calm = (!is_excited).then(|| {
        let moved = moved.map_or(String::new(), |moved| {
            format!(
                "The flight is calm: the set-points of the rates move by {} rad/s at most (standard deviation). ",
                short(moved)
            )
        });
        let excite = excitation(&flight.firmware)
            .map_or(String::new(), |excite| format!("{excite}, or "));
        format!(
            "{moved}Fly {excite}at least 40 s of quick manoeuvres; a calm flight does not show the process."
        )
    });
    logged.into_iter().chain(calm).collect()
}

/// The test that this firmware flies by itself. `None`: it has none, or the log does not tell.
fn excitation(firmware: &Firmware) -> Option<&'static str> {
    match (firmware.kind, firmware.release()) {
        (FirmwareKind::ArduPilot, Some(("ArduCopter", [major, _]))) if major >= 4 => {
            Some("SYSTEMID (SID_AXIS 10 to 12: roll, pitch and yaw at the mixer)")
        }
        (FirmwareKind::ArduPilot, _) => None,
        (FirmwareKind::Betaflight, _) => Some("the chirp mode (Betaflight 2025.12 and later)"),
        _ => Some("a chirp or doublets"),
    }
}

/// How the firmware logs faster. `None`: its parameters ask for that already.
fn faster(flight: &Flight) -> Option<String> {
    let parameter = |name: &str| {
        let value = flight.tables.parameters.get(name)?.last();
        (0.0..4e9).contains(&value).then_some(value as u64)
    };
    let with = |bits: u64, set: u64| (bits & set != set).then_some(bits | set);
    match flight.firmware.kind {
        FirmwareKind::Px4 => {
            let profile = with(parameter("SDLOG_PROFILE").unwrap_or(1), 16)?;
            Some(format!("Set SDLOG_PROFILE to {profile} (16: high rate)."))
        }
        FirmwareKind::ArduPilot => match parameter("LOG_BITMASK").map(|bits| with(bits, 1)) {
            Some(Some(bits)) => Some(format!(
                "Set LOG_BITMASK to {bits} (bit 0: attitude at the rate of the loop)."
            )),
            Some(None) => (parameter("LOG_FILE_RATEMAX").filter(|most| *most > 0)).map(|most| {
                format!("LOG_FILE_RATEMAX limits every message to {most} Hz: set it to 0.")
            }),
            None => Some("Set bit 0 of LOG_BITMASK (attitude at the rate of the loop).".to_owned()),
        },
        _ => Some(
            "Set blackbox_sample_rate to 1/2 or 1/1, and log gyro, set-point and motors."
                .to_owned(),
        ),
    }
}

/// Name and version; versions of some firmware begin with the name.
pub fn of_firmware(about: &Firmware) -> String {
    if about.version.starts_with(char::is_alphabetic) {
        about.version.clone()
    } else {
        format!("{} {}", firmware(about.kind), about.version)
    }
}

#[cfg(test)]
mod tests {
    use onecycle_link::FlightLog;

    use super::*;

    /// Advice on a log of text with this message, these parameters and rows of `RATE` at this rate (Hz).
    fn advised(message: &str, parameters: &[(&str, u32)], rate_hz: Option<u32>) -> String {
        let mut text = format!(
            "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
             FMT, 2, 19, RATE, Qffff, TimeUS,RDes,R,ROut,AOut\n\
             FMT, 3, 19, PIDR, Qffffff, TimeUS,Tar,Act,P,I,D,FF\n\
             FMT, 4, 30, PARM, QNf, TimeUS,Name,Value\n\
             FMT, 5, 75, MSG, QZ, TimeUS,Message\nMSG, 900, {message}\n"
        );
        for (name, value) in parameters {
            text += &format!("PARM, 1000, {name}, {value}\n");
        }
        for row in 1..100 {
            text += &match rate_hz {
                Some(rate_hz) => format!("RATE, {}, 0, 0, 0.1, 0.5\n", row * 1_000_000 / rate_hz),
                None => format!("PIDR, {}, 0, 0, 0, 0, 0, 0\n", row * 40_000),
            };
        }
        let log = FlightLog::scan(text.as_bytes()).unwrap();
        advice(&log.flights[0], None).join(" ")
    }

    // Bit 0 of 1029 is set; that of 176126 is not.
    #[test]
    fn a_parameter_that_is_set_is_not_advised() {
        let copter = "ArduCopter V4.5.7 (2a3dc4b7)";
        let slow = |bits| advised(copter, &[("LOG_BITMASK", bits)], Some(10));
        assert!(slow(176_126).contains("Set LOG_BITMASK to 176127"));
        assert!(!slow(1029).contains("LOG_BITMASK"), "{}", slow(1029));
        let limited = [("LOG_BITMASK", 1029), ("LOG_FILE_RATEMAX", 10)];
        assert!(advised(copter, &limited, Some(10)).contains("LOG_FILE_RATEMAX limits"));
        assert!(!advised(copter, &limited, Some(400)).contains("RATEMAX"));
    }

    // SYSTEMID is a mode of ArduCopter since release 4.0.
    #[test]
    fn systemid_is_advised_where_the_firmware_has_it() {
        let advised = |message| advised(message, &[], Some(400)).contains("SYSTEMID");
        assert!(advised("ArduCopter V4.0.3 (12345678)"));
        assert!(!advised("APM:Copter V3.4.6 (e707341b)"));
        assert!(!advised("ArduCopter V3.6.7 (e707341b)"));
        assert!(!advised("ArduPlane V4.2.3 (55685c43)"));
        assert!(!advised("no name"));
    }

    // A plane logs its rate loops in other messages.
    #[test]
    fn the_loops_of_a_plane_are_logged() {
        let text = advised(
            "ArduPlane V4.2.3 (55685c43)",
            &[("LOG_BITMASK", 1029)],
            None,
        );
        assert!(
            text.contains("PIDR") && !text.contains("not logged"),
            "{text}"
        );
        assert!(!text.contains("LOG_BITMASK"), "{text}");
    }
}
