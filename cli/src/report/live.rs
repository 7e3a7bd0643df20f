//! The state of a vehicle, and the parameters that were written.

use std::fmt::Write;
use std::path::Path;

use onecycle_live::{AltitudeFlight, LogEntry, State, Step};
use serde_json::{Value, json};

use super::number::short;
use super::wrap::wrapped;
use crate::results::live::AltitudeGains;
use crate::style::{HEADING, REFUSAL, REMARK, headed, painted};
use crate::words::live as words;

/// The state as text.
pub(crate) fn text(name: &str, state: &State) -> String {
    let mut text = format!("{}\n", painted(HEADING, name));
    let mut fact = |subject: &str, value: String| {
        let _ = writeln!(text, "  {subject:<11} {value}");
    };
    let version = state.version.as_deref().unwrap_or("of unknown version");
    let signed = if state.is_signed {
        ", messages are signed"
    } else {
        ""
    };
    fact(
        "firmware",
        format!("{} {version}{signed}", words::firmware(state.firmware)),
    );
    fact(
        "vehicle",
        format!("{}, number {}", state.kind, state.system),
    );
    let armed = if state.is_armed { "armed" } else { "disarmed" };
    let air = match state.is_in_air {
        Some(true) => ", in the air",
        Some(false) => ", on the ground",
        None => "",
    };
    fact(
        "state",
        format!("{armed}{air}, mode {}, {}", state.mode, state.status),
    );
    fact("battery", battery(state));
    fact("position", position(state));
    fact(
        "estimator",
        list(state.not_estimated.as_deref(), "no", "complete"),
    );
    fact(
        "sensors",
        list(state.unhealthy.as_deref(), "fault of", "no fault"),
    );
    if state.gains.is_empty() {
        wrapped(
            &mut text,
            "  ",
            &painted(REMARK, "The parameters of this firmware are not known."),
        );
    } else {
        text += &headed("\nGains in force\n");
    }
    for of in &state.gains {
        let loop_name = of.control_loop.to_string();
        let values = of.parameters.iter();
        let values: Vec<String> = values
            .map(|(name, value)| format!("{name} {}", short(*value)))
            .collect();
        wrapped(
            &mut text,
            "  ",
            &format!("{loop_name}: {}", values.join(", ")),
        );
    }
    if let Some(last) = state.texts.last() {
        text += &headed("\nLast message\n");
        wrapped(&mut text, "  ", last);
    }
    text
}

fn battery(state: &State) -> String {
    let Some(battery) = state.battery else {
        return "not measured".to_owned();
    };
    let voltage = battery.voltage_v.map(|v| format!("{v:.1} V"));
    let charge = battery
        .charge
        .map(|share| format!("{:.0} %", 100.0 * share));
    voltage
        .into_iter()
        .chain(charge)
        .collect::<Vec<_>>()
        .join(", ")
}

fn position(state: &State) -> String {
    match state.position_m {
        Some([north, east, up]) => format!("{north:.1} m north, {east:.1} m east, {up:.1} m up"),
        None => "not estimated".to_owned(),
    }
}

fn list(parts: Option<&[&str]>, word: &str, none: &str) -> String {
    match parts {
        None => "not told".to_owned(),
        Some([]) => none.to_owned(),
        Some(parts) => painted(REMARK, &format!("{word} {}", parts.join(", "))),
    }
}

/// The state as JSON.
pub(crate) fn json(state: &State) -> String {
    let gains: Vec<Value> = (state.gains.iter())
        .map(|of| {
            let parameters = of
                .parameters
                .iter()
                .map(|(name, value)| (name.clone(), json!(value)));
            json!({
                "loop": of.control_loop.to_string(),
                "parameters": Value::Object(parameters.collect()),
            })
        })
        .collect();
    let value = json!({
        "firmware": words::firmware(state.firmware),
        "version": state.version,
        "vehicle": state.kind,
        "system": state.system,
        "signed": state.is_signed,
        "armed": state.is_armed,
        "in_air": state.is_in_air,
        "mode": state.mode,
        "status": state.status,
        "battery_v": state.battery.and_then(|battery| battery.voltage_v),
        "battery_charge": state.battery.and_then(|battery| battery.charge),
        "position_m": state.position_m,
        "not_estimated": state.not_estimated,
        "unhealthy": state.unhealthy,
        "gains": gains,
        "messages": state.texts,
    });
    format!("{value:#}\n")
}

/// Parameters that were written.
pub(crate) fn written(steps: &[Step], old: &Path) -> String {
    let mut text = headed("Parameters\n");
    for step in steps {
        let _ = writeln!(
            text,
            "  {:18}{:>9} -> {}",
            step.name,
            short(step.old),
            short(step.new)
        );
    }
    let all = format!(
        "All values were read back. {} sets the old values again.",
        old.display()
    );
    wrapped(&mut text, "  ", &all);
    text
}

/// The logs of a vehicle.
pub(crate) fn logs(logs: &[LogEntry]) -> String {
    if logs.is_empty() {
        return "The vehicle has no log.\n".to_owned();
    }
    let mut text = headed("Logs\n");
    for log in logs {
        let at = log
            .utc_s
            .map_or("unknown time".to_owned(), |utc_s| date(utc_s.into()));
        let _ = writeln!(text, "  {:>5}{:>12} bytes  {at}", log.id, log.size);
    }
    text
}

/// Date and time of seconds since 1970, in UTC. Source: days to a date by the 400 years of the calendar.
fn date(utc_s: i64) -> String {
    let (days, second) = (utc_s.div_euclid(86_400), utc_s.rem_euclid(86_400));
    // Days since 1 March of the year 0.
    let days = days + 719_468;
    let (era, day_of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = 400 * era + year_of_era + i64::from(month <= 2);
    let (hour, minute) = (second / 3600, second / 60 % 60);
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

/// What was flown.
pub(crate) fn flight(flight: &AltitudeFlight) -> String {
    let seconds = flight.samples.last().map_or(0.0, |last| last.time_s);
    let (count, period_ms) = (flight.samples.len(), 1e3 * flight.sample_period_s());
    let mut text = headed("Relay test of the altitude\n");
    let _ = writeln!(
        text,
        "  {count} samples in {seconds:.1} s, one every {period_ms:.0} ms: shorter lags are not resolved"
    );
    let _ = writeln!(text, "  hover thrust {:.3}", flight.hover_thrust);
    let _ = writeln!(text, "  thrust {}", words::source(flight.source));
    let _ = writeln!(text, "  {}", words::hand_back(flight));
    if flight.is_restored == Some(false) {
        let warning =
            "WARNING: GUID_OPTIONS could not be restored: set its bit 3 (value 8) back by hand";
        let _ = writeln!(text, "  {}", painted(REFUSAL, warning));
    }
    text
}

/// Comments at the head of the recording.
pub(crate) fn comments(flight: &AltitudeFlight) -> Vec<String> {
    let test = &flight.test;
    vec![
        format!(
            "relay test of the altitude over MAVLink: onecycle {}, {}",
            env!("CARGO_PKG_VERSION"),
            words::firmware(Some(flight.firmware))
        ),
        format!(
            "relay: amplitude {}, beta {:.2}, trim on",
            test.amplitude, flight.beta
        ),
        format!(
            "output: height in m, integral of the climb rate; input: part of the full thrust less that of the hover, {:.4}",
            flight.hover_thrust
        ),
        format!("thrust {}", words::source(flight.source)),
    ]
}

/// Parameters of the altitude that were written to a file, or why not.
pub(crate) fn altitude_gains(path: &Path, proposed: &Result<AltitudeGains, String>) -> String {
    let mut text = headed("\nParameters\n");
    let gains = match proposed {
        Ok(gains) => gains,
        Err(reason) => {
            let refusal = format!("Nothing was written: {reason}");
            wrapped(&mut text, "  ", &painted(REFUSAL, &refusal));
            return text;
        }
    };
    for change in &gains.changes {
        let (old, new) = (short(change.old), short(change.new));
        let _ = writeln!(text, "  {:18}{old:>9} -> {new}", change.name);
    }
    let margins = &gains.figures.margins;
    let least = gains.least.map_or(String::new(), |least| {
        format!(
            "; over the posterior at least {:.1} deg (90 %)",
            least.phase_margin_rad.to_degrees()
        )
    });
    let figures = format!(
        "With these values, and one message interval more of delay, the loop has a phase margin of {:.1} deg, Ms {:.2}{least}. This is {:.0} % of the way to the \
         proposed gains. Write them with: onecycle live write CONNECTION {}",
        margins.phase_margin_rad.to_degrees(),
        gains.figures.ms,
        100.0 * gains.share,
        path.display()
    );
    wrapped(&mut text, "  ", &figures);
    text
}

#[cfg(test)]
mod tests {
    use super::date;

    // By the calendar: the epoch, a leap day, the turn of the century, and a time of day.
    #[test]
    fn dates() {
        assert_eq!(date(0), "1970-01-01 00:00 UTC");
        assert_eq!(date(951_782_400), "2000-02-29 00:00 UTC");
        assert_eq!(date(1_709_210_100), "2024-02-29 12:35 UTC");
        assert_eq!(date(1_735_689_599), "2024-12-31 23:59 UTC");
    }
}
