//! Gains of a flight log: read back, laid over the log, written.

use std::path::PathBuf;

use onecycle_link::{Agreement, ReadBack, Term};
use serde::Serialize;

use crate::results::log_gains::{LogGains, NamedFiles, Written};
use crate::words::log_gains as words;

/// Read-back in JSON.
#[derive(Serialize)]
pub struct ReadBackReport {
    axis: &'static str,
    agreement: &'static str,
    since_s: Option<f64>,
    rows: usize,
    explained: Option<f64>,
    terms: Vec<TermReport>,
}

#[derive(Serialize)]
struct TermReport {
    term: &'static str,
    name: String,
    stated: [f64; 2],
    recovered: Option<f64>,
    std_error: Option<f64>,
    ratio: Option<f64>,
    agreement: &'static str,
}

impl From<&ReadBack> for ReadBackReport {
    fn from(read: &ReadBack) -> Self {
        let term = |term: &onecycle_link::ReadTerm| TermReport {
            term: match term.term {
                Term::Proportional => "proportional",
                Term::Integral => "integral",
                Term::Derivative => "derivative",
                _ => "feed_forward",
            },
            name: term.name.clone(),
            stated: term.stated,
            recovered: term.recovered.map(|(value, _)| value),
            std_error: term.recovered.map(|(_, std)| std),
            ratio: term.ratio(),
            agreement: key(term.agreement),
        };
        Self {
            axis: read.axis.name(),
            agreement: key(read.agreement()),
            since_s: read.since_s,
            rows: read.rows,
            explained: read.explained,
            terms: read.terms.iter().map(term).collect(),
        }
    }
}

fn key(agreement: Agreement) -> &'static str {
    match agreement {
        Agreement::Agrees => "agrees",
        Agreement::Differs => "differs",
        _ => "unknown",
    }
}

/// The object `log` of `identify --json`.
#[derive(Serialize)]
pub struct LogGainsReport {
    #[serde(rename = "loop")]
    control_loop: String,
    read_back: Option<ReadBackReport>,
    overlay_explained: Option<f64>,
    written: Option<WrittenReport>,
    not_written: Option<String>,
}

#[derive(Serialize)]
struct WrittenReport {
    file: String,
    restore: String,
    step: f64,
    changes: Vec<ChangeReport>,
    phase_margin_deg: f64,
    gain_margin: Option<f64>,
    ms: f64,
    overshoot: Option<f64>,
    stable_share: Option<f64>,
    broken: Option<String>,
}

#[derive(Serialize)]
struct ChangeReport {
    name: String,
    old: f64,
    new: f64,
}

impl From<&LogGains> for LogGainsReport {
    fn from(log: &LogGains) -> Self {
        let written = log.written.as_ref();
        Self {
            control_loop: log.control_loop.to_string(),
            read_back: log.read_back.as_ref().map(Into::into),
            overlay_explained: log.overlay.as_ref().map(|overlay| overlay.explained),
            written: written.and_then(|of| of.as_ref().ok()).map(Into::into),
            not_written: written.and_then(|of| of.as_ref().err()).cloned(),
        }
    }
}

impl From<&Written> for WrittenReport {
    fn from(written: &Written) -> Self {
        let margins = &written.figures.margins;
        let name = |of: fn(&NamedFiles) -> &PathBuf| {
            let path = written.files.as_ref().map(of);
            path.map_or(String::new(), |path| path.display().to_string())
        };
        let change = |change: &onecycle_link::Change| ChangeReport {
            name: change.name.clone(),
            old: change.old,
            new: change.new,
        };
        Self {
            file: name(|files| &files.path),
            restore: name(|files| &files.restore),
            step: written.share,
            changes: written.changes.iter().map(change).collect(),
            phase_margin_deg: margins.phase_margin_rad.to_degrees(),
            gain_margin: margins.gain_margin,
            ms: written.figures.ms,
            overshoot: written.overshoot,
            stable_share: written.least.map(|least| least.stable),
            broken: words::broken(written),
        }
    }
}
