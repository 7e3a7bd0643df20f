//! Gains of a flight log as text: read back, laid over the log, written.

use std::fmt::Write;

use onecycle_link::{Agreement, ReadBack};

use super::number::{short, significant};
use super::wrap::wrapped;
use crate::results::log_gains::LogGains;
use crate::style::{REFUSAL, REMARK, headed, painted};
use crate::words::log_gains as words;

/// The sections of `identify`.
pub(crate) fn text(log: &LogGains) -> String {
    let mut text = String::new();
    if let Some(read) = &log.read_back {
        text.push_str(&headed(
            "\nRead-back of the gains in force from the logged signals\n",
        ));
        text.push_str(&table(read));
    }
    if let Some(overlay) = &log.overlay {
        text.push_str(&headed("\nOverlay\n"));
        wrapped(&mut text, "  ", &words::overlay(overlay.explained));
    }
    match &log.written {
        None => {}
        Some(Err(reason)) => {
            text.push_str(&headed("\nParameters\n"));
            wrapped(
                &mut text,
                "  ",
                &painted(REFUSAL, &format!("Nothing was written: {reason}")),
            );
        }
        Some(Ok(written)) => {
            text.push_str(&headed("\nParameters\n"));
            for change in &written.changes {
                let (old, new) = (short(change.old), short(change.new));
                let _ = writeln!(text, "  {:18}{old:>9} -> {new}", change.name);
            }
            for sentence in words::written(written) {
                wrapped(&mut text, "  ", &sentence);
            }
        }
    }
    text
}

/// One row for each term, and a sentence.
pub(crate) fn table(read: &ReadBack) -> String {
    let mut text = format!(
        "  {:22}{:>12}{:>12}{:>12}{:>8}\n",
        read.axis.name(),
        "stated",
        "read back",
        "std error",
        "ratio"
    );
    for term in &read.terms {
        let [low, high] = term.stated;
        let stated = if low == high {
            significant(low)
        } else {
            format!("{}..{}", short(low), short(high))
        };
        let of = term
            .recovered
            .map(|(value, std)| [significant(value), short(std)]);
        let [value, std] = of.unwrap_or_else(|| ["-".to_owned(), "-".to_owned()]);
        let ratio = term
            .ratio()
            .map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
        let line = format!(
            "  {:22}{stated:>12}{value:>12}{std:>12}{ratio:>8}  {}\n",
            term.name,
            words::agreement(term.agreement)
        );
        text.push_str(&match term.agreement {
            Agreement::Differs => painted(REFUSAL, &line),
            _ => line,
        });
    }
    let sentence = words::read_back(read);
    let style = match read.agreement() {
        Agreement::Differs => REFUSAL,
        Agreement::Unknown => REMARK,
        _ => crate::style::PLAIN,
    };
    wrapped(&mut text, "  ", &painted(style, &sentence));
    text
}
