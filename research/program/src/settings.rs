//! Settings files in TOML.

use std::path::Path;

use onecycle_cli::failure::Failure;
use onecycle_lab::space::Space;
use serde::de::DeserializeOwned;

use crate::reading::{MOST_OF_SETTINGS, text_at_most};

/// Reads a file and checks the types of its fields; the caller checks their values.
pub(crate) fn read<T: DeserializeOwned>(path: &Path) -> Result<T, Failure> {
    let text = text_at_most(path, MOST_OF_SETTINGS)?;
    toml::from_str(&text).map_err(|error| Failure::unreadable(path, located(&text, &error)))
}

/// The space of a file; without a file, that of the paper's multirotors.
pub(crate) fn space(path: Option<&Path>) -> Result<Space, Failure> {
    let Some(path) = path else {
        return Ok(Space::MULTIROTOR);
    };
    let space: Space = read(path)?;
    space
        .validate()
        .map_err(|error| Failure::unreadable(path, error))?;
    Ok(space)
}

/// The parser's message in one line, with line number and key; its own report has several lines.
fn located(text: &str, error: &toml::de::Error) -> String {
    let begin = error.span().map_or(0, |span| span.start).min(text.len());
    let before = &text[..begin];
    let number = before.matches('\n').count() + 1;
    let line = before.rsplit('\n').next().unwrap_or_default();
    // In backticks stand settings, which are shown as options.
    let complaint = error.message().replace('\n', ", ").replace('`', "\"");
    // If a value is wrong, its key is before it in the line.
    match line.split_once('=') {
        Some((key, _)) => format!("line {number}, {}: {complaint}", key.trim()),
        None => format!("line {number}: {complaint}"),
    }
}
