//! What a flight log holds, as text and as JSON.

use std::fmt::Write;

use onecycle_link::{Flight, FlightLog, LoggedLoop, LoggedSignal, ReadBack, Setting, Span};
use serde::Serialize;

use super::json::to_text;
use super::log_gains;
use super::number::short;
use super::wrap::wrapped;
use crate::style::{HEADING, REMARK, headed, painted};
use crate::words::log as words;
use onecycle::json::log_gains::ReadBackReport;

/// Version of the JSON; raised with every change that a reader could notice, added keys excepted.
const SCHEMA: &str = "onecycle.log/1";

/// The report for people.
///
/// `moved`: movement of the rate loops of each flight; `checks`: read-back of the gains of each flight.
pub(crate) fn text(
    file: &str,
    log: &FlightLog,
    moved: &[Option<f64>],
    checks: Option<&[Vec<ReadBack>]>,
) -> String {
    let mut text = format!("{}\n", painted(HEADING, file));
    let _ = writeln!(text, "  {}", words::format(log.format));
    if let Some(lost) = words::loss(&log.loss) {
        wrapped(&mut text, "  ", &painted(REMARK, &format!("Lost: {lost}.")));
    }
    for (at, flight) in log.flights.iter().enumerate() {
        describe(&mut text, at + 1, flight, moved[at]);
        if let Some(checks) = checks.and_then(|checks| checks.get(at)) {
            text.push_str(&headed(
                "\nRead-back of the gains in force from the logged signals\n",
            ));
            checks
                .iter()
                .for_each(|read| text.push_str(&log_gains::table(read)));
        }
    }
    text
}

fn describe(text: &mut String, number: usize, flight: &Flight, moved: Option<f64>) {
    text.push_str(&headed(&format!("\nFlight {number}\n")));
    let Span { from_s, to_s, .. } = flight.span;
    let about = &flight.firmware;
    let mut facts = vec![
        ("firmware", words::of_firmware(about)),
        ("board", about.board.clone()),
        (
            "time",
            format!("{from_s:.2} to {to_s:.2} s ({:.1} s)", to_s - from_s),
        ),
    ];
    for (name, spans) in [("armed", &flight.armed), ("in the air", &flight.airborne)] {
        let spans = spans
            .iter()
            .flatten()
            .map(|span| format!("{:.2} to {:.2} s", span.from_s, span.to_s));
        facts.push((name, spans.collect::<Vec<_>>().join(", ")));
    }
    facts.push(("parameters", flight.tables.parameters.len().to_string()));
    facts.push(("filters", settings(&flight.filters)));
    let marks: Vec<String> = flight.marks.iter().map(words::mark).collect();
    facts.push(("excitation", marks.join("; ")));
    for (name, fact) in facts.iter().filter(|(_, fact)| !fact.is_empty()) {
        wrapped(text, &format!("  {name:12}"), fact);
    }
    let logged: Vec<&LoggedLoop> = flight.loops.iter().filter(|l| l.is_complete()).collect();
    if !logged.is_empty() {
        text.push_str(&headed(
            "\nLoops           input    output   set-point  gains in force\n",
        ));
    }
    for logged in logged {
        let rates = [&logged.input, &logged.output, &logged.set_point];
        let [input, output, set_point] = rates.map(|signal| rate(signal.as_ref()));
        let gains = logged
            .gains
            .iter()
            .map(|gain| format!("{} {}", gain.name, short(gain.value)));
        let lead = format!(
            "  {:14}{input:9}{output:9}{set_point:11}",
            logged.control_loop.to_string()
        );
        wrapped(text, &lead, &gains.collect::<Vec<_>>().join(", "));
    }
    let advice = words::advice(flight, moved);
    if !advice.is_empty() {
        text.push_str(&headed("\nAdvice\n"));
        advice
            .iter()
            .for_each(|sentence| wrapped(text, "  ", sentence));
    }
}

fn rate(signal: Option<&LoggedSignal>) -> String {
    signal.map_or("-".to_owned(), |signal| format!("{:.0} Hz", signal.rate_hz))
}

/// Settings that are not zero.
fn settings(settings: &[Setting]) -> String {
    let active = settings.iter().filter(|setting| setting.value != 0.0);
    let all = active.map(|setting| format!("{} {}", setting.name, short(setting.value)));
    all.collect::<Vec<_>>().join(", ")
}

#[derive(Serialize)]
struct LogReport<'a> {
    schema: &'static str,
    file: &'a str,
    format: &'static str,
    loss: LossReport,
    flights: Vec<FlightReport<'a>>,
}

#[derive(Serialize)]
struct LossReport {
    bytes_skipped: u64,
    rows_dropped: u64,
    dropouts: u64,
    dropout_s: f64,
    is_truncated: bool,
}

#[derive(Serialize)]
struct FlightReport<'a> {
    firmware: &'static str,
    version: &'a str,
    board: &'a str,
    span_s: [f64; 2],
    armed_s: Option<Vec<[f64; 2]>>,
    airborne_s: Option<Vec<[f64; 2]>>,
    loops: Vec<LoopReport<'a>>,
    filters: Vec<SettingReport<'a>>,
    mixer: Vec<SettingReport<'a>>,
    marks: Vec<MarkReport>,
    parameters: Vec<SettingReport<'a>>,
    topics: Vec<TopicReport<'a>>,
    advice: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    read_back: Option<Vec<ReadBackReport>>,
}

#[derive(Serialize)]
struct LoopReport<'a> {
    name: String,
    input: Option<SignalReport<'a>>,
    output: Option<SignalReport<'a>>,
    set_point: Option<SignalReport<'a>>,
    gains: Vec<GainReport<'a>>,
}

#[derive(Serialize)]
struct SignalReport<'a> {
    name: &'a str,
    rate_hz: f64,
}

#[derive(Serialize)]
struct GainReport<'a> {
    name: &'a str,
    value: f64,
    si: Option<f64>,
}

#[derive(Serialize)]
struct SettingReport<'a> {
    name: &'a str,
    value: f64,
}

#[derive(Serialize)]
struct MarkReport {
    what: String,
    axis: Option<&'static str>,
    span_s: [f64; 2],
}

#[derive(Serialize)]
struct TopicReport<'a> {
    name: &'a str,
    instance: u32,
    rows: u64,
    rate_hz: f64,
}

/// The report for programs.
///
/// `moved`: movement of the rate loops of each flight; `checks`: read-back of the gains of each flight.
pub(crate) fn json(
    file: &str,
    log: &FlightLog,
    moved: &[Option<f64>],
    checks: Option<&[Vec<ReadBack>]>,
) -> String {
    to_text(&LogReport {
        schema: SCHEMA,
        file,
        format: words::format(log.format),
        loss: LossReport {
            bytes_skipped: log.loss.bytes_skipped,
            rows_dropped: log.loss.rows_dropped,
            dropouts: log.loss.dropouts,
            dropout_s: log.loss.dropout_s,
            is_truncated: log.loss.is_truncated,
        },
        flights: (log.flights.iter().enumerate())
            .map(|(at, flight)| FlightReport {
                read_back: checks
                    .and_then(|checks| checks.get(at))
                    .map(|checks| checks.iter().map(Into::into).collect()),
                ..flight_report(flight, moved[at])
            })
            .collect(),
    })
}

fn flight_report(flight: &Flight, moved: Option<f64>) -> FlightReport<'_> {
    let pair = |span: &Span| [span.from_s, span.to_s];
    let pairs = |spans: &Option<Vec<Span>>| {
        spans
            .as_ref()
            .map(|spans| spans.iter().map(pair).collect::<Vec<_>>())
    };
    let parameters = flight.tables.parameters.iter();
    let topics = flight.tables.topics.iter().filter(|topic| topic.rows > 0);
    FlightReport {
        firmware: words::firmware(flight.firmware.kind),
        version: &flight.firmware.version,
        board: &flight.firmware.board,
        span_s: pair(&flight.span),
        armed_s: pairs(&flight.armed),
        airborne_s: pairs(&flight.airborne),
        loops: flight.loops.iter().map(loop_report).collect(),
        filters: setting_reports(&flight.filters),
        mixer: setting_reports(&flight.mixer),
        marks: (flight.marks.iter())
            .map(|mark| MarkReport {
                what: words::mark(mark),
                axis: mark.axis.map(|axis| axis.name()),
                span_s: pair(&mark.span),
            })
            .collect(),
        parameters: parameters
            .map(|(name, parameter)| SettingReport {
                name,
                value: parameter.value,
            })
            .collect(),
        topics: topics
            .map(|topic| TopicReport {
                name: &topic.name,
                instance: topic.instance,
                rows: topic.rows,
                rate_hz: topic.rate_hz(),
            })
            .collect(),
        advice: words::advice(flight, moved),
        read_back: None,
    }
}

fn loop_report(logged: &LoggedLoop) -> LoopReport<'_> {
    let signals = [&logged.input, &logged.output, &logged.set_point];
    let [input, output, set_point] = signals.map(|signal| {
        signal.as_ref().map(|signal| SignalReport {
            name: &signal.name,
            rate_hz: signal.rate_hz,
        })
    });
    let gains = logged.gains.iter();
    LoopReport {
        name: logged.control_loop.to_string(),
        input,
        output,
        set_point,
        gains: gains
            .map(|gain| GainReport {
                name: &gain.name,
                value: gain.value,
                si: gain.si,
            })
            .collect(),
    }
}

fn setting_reports(settings: &[Setting]) -> Vec<SettingReport<'_>> {
    let all = settings.iter().map(|setting| SettingReport {
        name: &setting.name,
        value: setting.value,
    });
    all.collect()
}
