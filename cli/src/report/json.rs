//! Reports as JSON text; docs/identify-json.md is their description. Infinite values are null.

use serde::Serialize;

use crate::words::with_options;

pub fn to_text(report: &impl Serialize) -> String {
    // Plain structures of numbers and strings always serialise.
    let mut text = serde_json::to_string_pretty(report).unwrap_or_default();
    text.push('\n');
    with_options(&text).into_owned()
}
