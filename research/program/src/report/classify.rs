//! Classes of recordings, as text and JSON.

use std::fmt::Write;

use onecycle_cli::report::json::to_text;
use onecycle_cli::report::number::{seconds, significant};
use onecycle_lab::judge::evaluate::Feedback;
use onecycle_lab::paper::network::Pick;
use onecycle_onboard::{Pd, Soiptd};
use serde_json::{Value, json};

use crate::results::classify::Classified;

/// Version of the JSON; raised with every change that a reader could notice.
const SCHEMA: &str = "onecycle.classes/1";

/// Process and controller of a class.
fn answer(pick: &Pick) -> Option<(&Soiptd, &Pd)> {
    match (&pick.answer.process, &pick.answer.feedback) {
        (Some(process), Feedback::Pd(pd)) => Some((process, pd)),
        _ => None,
    }
}

/// A block of lines for each recording.
pub(crate) fn text(classes: usize, all: &[Classified]) -> String {
    let mut text = String::new();
    for one in all {
        _ = writeln!(text, "{}", one.name);
        let pick = match &one.pick {
            Ok(pick) => pick,
            Err(reason) => {
                _ = writeln!(text, "  no class: {reason}");
                continue;
            }
        };
        let Some((process, pd)) = answer(pick) else {
            continue;
        };
        _ = writeln!(
            text,
            "  class        {} of {classes}\n  \
             process      K/T_body {}, T_prop {}, T_body {}, tau {}\n  \
             controller   Kp {}, Kd {}\n  \
             period       {}; that of the class under its relay {}",
            pick.class + 1,
            significant(process.k_over_t_body()),
            seconds(process.t_prop_s()),
            seconds(process.inv_t_body_per_s().recip()),
            seconds(process.tau_s()),
            significant(pd.kp),
            significant(pd.kd),
            seconds(pick.period_s),
            seconds(pick.class_period_s),
        );
    }
    text
}

/// All of them as JSON.
pub(crate) fn json(classes: usize, all: &[Classified]) -> String {
    let of = |one: &Classified| -> Value {
        let pick = match &one.pick {
            Ok(pick) => pick,
            Err(reason) => return json!({ "file": one.name, "reason": reason.to_string() }),
        };
        let found = answer(pick).map(|(process, pd)| {
            json!({
                "process": {
                    "k_over_t_body": process.k_over_t_body(),
                    "t_prop_s": process.t_prop_s(),
                    "t_body_s": process.inv_t_body_per_s().recip(),
                    "tau_s": process.tau_s(),
                },
                "controller": { "kp": pd.kp, "kd": pd.kd },
            })
        });
        let mut value = found.unwrap_or_else(|| json!({}));
        value["file"] = one.name.as_str().into();
        value["class"] = (pick.class + 1).into();
        value["period_s"] = pick.period_s.into();
        value["class_period_s"] = pick.class_period_s.into();
        value
    };
    let recordings: Vec<Value> = all.iter().map(of).collect();
    to_text(&json!({ "schema": SCHEMA, "classes": classes, "recordings": recordings }))
}
