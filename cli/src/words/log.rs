//! Sentences about flight logs: why one gives no signals, and how to log better.

use onecycle_link::{
    Axis, ControlLoop, FirmwareKind, Flight, LogError, LogFormat, Loss, Mark, MarkKind,
};

/// Least rate of input and output of a rate loop, in hertz: a small multirotor answers within 20 to 50 ms.
const LEAST_RATE_HZ: f64 = 100.0;

/// What is wrong with a log, and what to do.
pub(crate) fn refusal(error: &LogError) -> String {
    let advice = match error {
        LogError::UnknownFormat => {
            "expected a PX4 ULog, an ArduPilot DataFlash log, a blackbox log or an MCAP file"
        }
        LogError::NotBuilt(_) => "build onecycle-link with its feature mcap",
        LogError::Empty => "download it from the vehicle again",
        LogError::NoSuchFlight { .. } => "choose another one with --flight",
        LogError::NotLogged { .. } => "choose another loop; `onecycle log FILE` lists them",
        LogError::Recording(_) => {
            "choose another loop or another flight; `onecycle log FILE` lists them"
        }
        _ => return error.to_string(),
    };
    format!("{error}; {advice}")
}

/// Name of a format.
pub(crate) fn format(format: LogFormat) -> &'static str {
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
pub(crate) fn firmware(kind: FirmwareKind) -> &'static str {
    match kind {
        FirmwareKind::Px4 => "PX4",
        FirmwareKind::ArduPilot => "ArduPilot",
        FirmwareKind::Betaflight => "Betaflight",
        FirmwareKind::Inav => "INAV",
        _ => "unknown firmware",
    }
}

/// A stretch of deliberate excitation.
pub(crate) fn mark(mark: &Mark) -> String {
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
pub(crate) fn loss(loss: &Loss) -> Option<String> {
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
pub(crate) fn advice(flight: &Flight) -> Vec<String> {
    let mut sentences = Vec::new();
    let rate = flight.logged_loop(ControlLoop::Rate(Axis::Roll));
    let rate_hz = rate.filter(|rate| rate.is_complete()).map(|rate| {
        let rates =
            [&rate.input, &rate.output].map(|signal| signal.as_ref().map_or(0.0, |s| s.rate_hz));
        rates[0].min(rates[1])
    });
    let how = faster(flight);
    match rate_hz {
        None => sentences.push(format!("The signals of the rate loops are not logged. {how}")),
        Some(rate_hz) if rate_hz < LEAST_RATE_HZ => sentences.push(format!(
            "The rate loops are logged at {rate_hz:.0} Hz; a small multirotor needs {LEAST_RATE_HZ:.0} Hz or more. {how}"
        )),
        Some(_) => {}
    }
    if flight.marks.is_empty() {
        let excite = match flight.firmware.kind {
            FirmwareKind::ArduPilot => {
                "Fly SYSTEMID (SID_AXIS 10 to 12: roll, pitch and yaw at the mixer)"
            }
            FirmwareKind::Betaflight => "Fly the chirp mode (Betaflight 2025.12 and later)",
            _ => "Fly a chirp or doublets",
        };
        sentences.push(format!(
            "The log has no mark of deliberate excitation. {excite}, or at least 40 s of quick manoeuvres; a calm \
             flight does not show the process."
        ));
    }
    sentences
}

/// How the firmware logs faster.
fn faster(flight: &Flight) -> String {
    match flight.firmware.kind {
        FirmwareKind::Px4 => "Set SDLOG_PROFILE to 17 (default set and high rate).".to_owned(),
        FirmwareKind::ArduPilot => match flight.tables.parameter("LOG_BITMASK") {
            Some(mask) if (0.0..4e9).contains(&mask) => format!(
                "Set LOG_BITMASK to {} (bit 0: attitude at the rate of the loop).",
                mask as u64 | 1
            ),
            _ => "Set bit 0 of LOG_BITMASK (attitude at the rate of the loop).".to_owned(),
        },
        _ => {
            "Set blackbox_sample_rate to 1/2 or 1/1, and log gyro, set-point and motors.".to_owned()
        }
    }
}
