//! The state of a vehicle, and the parameters that were written.

use std::fmt::Write;
use std::path::Path;

use onecycle_live::{State, Step};
use serde_json::{Value, json};

use super::number::short;
use super::wrap::wrapped;
use crate::style::{HEADING, REMARK, headed, painted};
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
