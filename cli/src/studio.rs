//! What a page asks of the library, in JSON: one file, its signals, its process, and gains moved by hand.
//!
//! | message | answer |
//! | --- | --- |
//! | `{"do":"open"}` | `{log}`: the report of `onecycle log --json`, null for a table |
//! | `{"do":"signals","settings"}` | `{samples, span_s, full_scale, names, units, parts, notes}`: the signals of a loop or a table; `full_scale` of devices holds the input |
//! | `{"do":"view","from_s","to_s","points"}` | `{time_s, input, output, set_point}` of that time, thinned |
//! | `{"do":"identify","settings"}` | the report of `onecycle identify --json` |
//! | `{"do":"survey","settings"}` | that of `onecycle identify LOG --json`: every loop of a flight; with `parameters`: files for all to change, or null |
//! | `{"do":"json"}`, `{"do":"page"}` | `{text}`: the report as the program writes it |
//! | `{"do":"trade_off"}` | designs from calm to sharp: limit of `Ms`, gains, figures |
//! | `{"do":"judge","gains","bands"}` | figures, least margins, curves of the gains, `asks`, `named` (what to type in), `lines` (to paste); with bands if they are asked for |
//! | `{"do":"vendors"}` | `{vendors}`: name, ranges and full input of each controller with gains of its own |
//! | `{"do":"parameters","gains","whole","below_limits"}` | `{apply, restore, ending, says, broken}`: files for the firmware |
//! | `{"do":"simulate","options"}` | `{text}`: a recording as CSV; with `--expect` the intervals to expect |
//!
//! Parameters go half of the way from the gains in force to the given ones unless `whole` is true. `asks` is a sentence that
//! names the limits of the style that gains break. Such parameters are answered with `{asks}` unless `below_limits` is true or
//! they are on the way to gains that keep the limits.
//!
//! Settings are a map, such as `{"style": "calm", "ms": 1.5}`, of those of `onecycle::Request`; options are those of the command line. An
//! answer with `error` has one sentence. Infinite numbers are null. Times are in
//! seconds, signals in the units of the file.

use std::rc::Rc;

use onecycle::request::HALF_STEP;
use onecycle::source::is_flight_log;
use onecycle::words::{Named, named};
use onecycle::{Controller, LogFile, Model, Pid, Report, Request, Source, with_progress};
use onecycle_design::Vendor;
use onecycle_link::{FlightLog, ParameterFiles};
use serde_json::{Value, json};

use crate::args::{self, Arguments, Command};
use crate::commands::simulate;
use crate::failure::Failure;
use crate::output::Waiting;
#[cfg(target_family = "wasm")]
pub use crate::output::page::{Listener, listen};
use crate::report::identify as report;
use crate::report::json::to_text;
use crate::report::{hand, log as log_report};
use crate::style::plain;
use crate::words;

/// Processes of the posterior over which gains are judged at every move: a few milliseconds.
const FEW_DRAWS: usize = 20;
/// Those from which bands are drawn once the gains rest.
const DRAWS: usize = 60;

/// The work on one file.
#[derive(Default)]
pub struct Studio {
    source: Option<Box<dyn Source>>,
    log: Option<FlightLog>,
    signals: Option<Signals>,
    found: Option<Report>,
    draws: Vec<Model>,
}

/// The signals of a loop or a table.
struct Signals {
    time_s: Vec<f64>,
    input: Vec<f64>,
    output: Vec<f64>,
    set_point: Option<Vec<f64>>,
    about: Value,
}

impl Studio {
    /// Answers a message.
    pub fn ask(&mut self, message: &str) -> String {
        let answer = match serde_json::from_str::<Value>(message) {
            Err(error) => Err(format!("the message is not JSON: {error}")),
            Ok(message) => self.answer(&message),
        };
        let answer = answer.unwrap_or_else(|error| json!({ "error": words::sentence(&error) }));
        named(&answer.to_string(), field).into_owned()
    }

    fn answer(&mut self, message: &Value) -> Result<Value, String> {
        match message["do"].as_str().unwrap_or_default() {
            "open" => self.open(),
            "signals" => {
                (self.found, self.draws) = (None, vec![]);
                let signals = self
                    .read(&request(message)?)
                    .map_err(|error| error.to_string())?;
                let about = signals.about.clone();
                self.signals = Some(signals);
                Ok(about)
            }
            "view" => self.view(message),
            "identify" => {
                (self.found, self.draws) = (None, vec![]);
                let (request, source) = (request(message)?, self.source()?);
                let found = followed("identifying", || request.identify(source));
                let found = found.map_err(|error| error.to_string())?;
                let mut report = value(&found)?;
                if let Ok(identified) = &found.identification.outcome {
                    self.draws = identified.posterior.models(DRAWS);
                    report["formula"] = json!(identified.model.structure().transfer_function());
                }
                self.found = Some(found);
                Ok(report)
            }
            "survey" => {
                let (mut request, source) = (request(message)?, self.source()?);
                // The page saves what the program would write.
                request.write.file = Some("tune".into());
                let surveyed = followed("identifying loops", || request.survey(source));
                let surveyed = surveyed.map_err(|error| error.to_string())?;
                let mut report = value(&surveyed)?;
                report["parameters"] = parameters(surveyed.files.as_ref().map(|files| &files.text));
                Ok(report)
            }
            "json" => Ok(json!({ "text": to_text(self.found()?) })),
            "page" => {
                let found = self.found.as_mut().ok_or(NOTHING)?;
                Ok(json!({ "text": report::page(found) }))
            }
            "trade_off" => {
                let found = self.found.as_mut().ok_or(NOTHING)?;
                found.make_trade_off();
                let choice = found.choice.as_ref().ok_or(NOTHING)?;
                Ok(hand::trade_off(&choice.trade_off))
            }
            "judge" => self.judge(message),
            "vendors" => Ok(vendors()),
            "parameters" => self.parameters(message),
            "simulate" => simulated(&options(message)),
            other => Err(format!("there is no message {other:?}")),
        }
    }

    /// Takes a file in place of the one before.
    pub fn take(&mut self, source: Box<dyn Source>) {
        *self = Self {
            source: Some(source),
            ..Self::default()
        };
    }

    fn open(&mut self) -> Result<Value, String> {
        let source = self.source()?;
        if !is_flight_log(source) {
            return Ok(json!({ "log": null }));
        }
        let scanned = LogFile::scan(source).map_err(|error| error.to_string())?;
        let moved = scanned.movements();
        let report = log_report::json(&source.name(), &scanned.log, &moved, None);
        self.log = Some(scanned.log);
        Ok(json!({ "log": serde_json::from_str::<Value>(&report).unwrap_or_default() }))
    }

    /// The whole signals, of which a part is to be chosen.
    fn read(&self, request: &Request) -> Result<Signals, Failure> {
        let source = self.source().map_err(Failure::usage)?;
        let Some(log) = &self.log else {
            let recording = request.read(source)?;
            let columns = recording.columns();
            let named = [&columns.input, &columns.output];
            let notes: Vec<String> = (recording.notes().iter())
                .map(words::recording::note)
                .collect();
            return Ok(Signals::new(
                recording.time_s().to_vec(),
                [recording.input().to_vec(), recording.output().to_vec()],
                recording.set_point().map(<[f64]>::to_vec),
                json!({
                    "names": named.map(|column| &column.name),
                    "units": named.map(|column| &column.unit),
                    "parts": [],
                    "notes": notes,
                }),
            ));
        };
        let file = LogFile::new(source, log.clone());
        let number = file.flight(request.flight);
        let signals = file.signals(number, request.loop_of_log())?;
        let flight = log.flights.get(number.saturating_sub(1));
        let parts = flight.map_or(vec![], |flight| flight.stretches(&signals));
        let parts: Vec<[f64; 2]> = parts.iter().map(|part| [part.from_s, part.to_s]).collect();
        let about = json!({
            "names": signals.names, "units": signals.units, "parts": parts, "notes": [],
        });
        Ok(Signals::new(
            signals.time_s,
            [signals.input, signals.output],
            signals.set_point,
            about,
        ))
    }

    fn source(&self) -> Result<&dyn Source, String> {
        (self.source.as_deref()).ok_or_else(|| "no file is open".to_owned())
    }

    fn view(&self, message: &Value) -> Result<Value, String> {
        let signals = self.signals.as_ref().ok_or("no signals are open")?;
        let points = message["points"].as_u64().unwrap_or(1000).clamp(16, 8000) as usize;
        let from_s = message["from_s"].as_f64().unwrap_or(f64::NEG_INFINITY);
        let to_s = message["to_s"].as_f64().unwrap_or(f64::INFINITY);
        Ok(signals.view(from_s, to_s, points))
    }

    fn found(&self) -> Result<&Report, String> {
        self.found.as_ref().ok_or_else(|| NOTHING.to_owned())
    }

    /// The controller with gains chosen by hand: filters and sampling are those of the proposal.
    fn chosen(&self, message: &Value) -> Result<Pid, String> {
        let choice = self.found()?.choice.as_ref().ok_or(NOTHING)?;
        let gain = |name: &str| {
            let given = message["gains"][name].as_f64();
            given.ok_or_else(|| format!("{name} must be a number"))
        };
        let proposed = choice.design().map(|(design, _)| design.controller.pid());
        let mut pid = proposed.unwrap_or(Pid::new(0.0, 0.0, 0.0));
        (pid.kp, pid.ki, pid.kd) = (gain("kp")?, gain("ki")?, gain("kd")?);
        Ok(pid
            .with_filter_s(gain("filter_s")?)
            .with_execution(choice.asked.execution))
    }

    fn judge(&self, message: &Value) -> Result<Value, String> {
        let found = self.found()?;
        let (Ok(identified), Some(choice)) = (&found.identification.outcome, &found.choice) else {
            return Err(NOTHING.to_owned());
        };
        let (model, _) = identified.for_design(0);
        let controller = Controller::from(self.chosen(message)?);
        let with_bands = message["bands"].as_bool().unwrap_or(false);
        let count = if with_bands { DRAWS } else { FEW_DRAWS };
        let draws = &self.draws[..self.draws.len().min(count)];
        let end_s = message["end_s"].as_f64();
        let mut judged = hand::judged(&hand::ByHand {
            model: &model,
            controller: &controller,
            asked: &choice.asked,
            draws,
            with_bands,
            end_s,
        });
        judged["named"] = json!(found.typed(&controller));
        judged["lines"] = json!(choice.plant.and_then(|(vendor, spans)| {
            vendor.lines(&vendor.typed(&controller.pid(), &spans).ok()?)
        }));
        Ok(judged)
    }

    fn parameters(&self, message: &Value) -> Result<Value, String> {
        let found = self.found()?;
        let chosen = self.chosen(message)?;
        let (Ok(identified), Some(choice)) = (&found.identification.outcome, &found.choice) else {
            return Err(NOTHING.to_owned());
        };
        let name = &found.name;
        let no_log = || format!("{name} is not a flight log: type the gains in");
        let of_log = found.of_log.as_ref().ok_or_else(no_log)?;
        let is = |name: &str| message[name].as_bool().unwrap_or(false);
        let share = if is("whole") { 1.0 } else { HALF_STEP };
        let to_write = of_log.to_write(chosen, share, identified, choice)?;
        let question = to_write.question().filter(|_| !is("below_limits"));
        if let Some(question) = question {
            return Ok(json!({ "asks": words::sentence(question) }));
        }
        let mut answer = parameters(Some(&of_log.files(&to_write)?));
        answer["says"] = json!(words::log_gains::margins(&to_write));
        answer["broken"] = json!(words::log_gains::broken(&to_write));
        Ok(answer)
    }
}

/// The controllers with gains of their own, and the ranges that these depend on.
fn vendors() -> Value {
    let one = |vendor: Vendor| {
        json!({
            "name": vendor.name(),
            "has_range_of_measurement": vendor.has_range_of_measurement(),
            "counts_output": vendor.counts_output(),
            "full_input": vendor.full_input(),
        })
    };
    json!({ "vendors": Vendor::ALL.map(one) })
}

/// Does work whose share the page hears.
fn followed<T>(work: &'static str, of: impl FnOnce() -> T) -> T {
    /// Steps of the bar of progress.
    const STEPS: f64 = 1000.0;
    let waiting = Waiting::on(work);
    let told = move |share: f64| waiting.is_at(work, (STEPS * share) as usize, STEPS as usize);
    with_progress(Rc::new(told), of)
}

const NOTHING: &str = "nothing is identified yet";

/// Null without files.
fn parameters(files: Option<&ParameterFiles>) -> Value {
    files.map_or(
        Value::Null,
        |files| json!({ "apply": files.apply, "restore": files.restore, "ending": files.ending }),
    )
}

impl Signals {
    fn new(
        time_s: Vec<f64>,
        [input, output]: [Vec<f64>; 2],
        set_point: Option<Vec<f64>>,
        mut about: Value,
    ) -> Self {
        about["samples"] = json!(time_s.len());
        about["span_s"] = json!([time_s.first(), time_s.last()]);
        about["full_scale"] = json!(onecycle::full_scale(&input));
        about["has_set_point"] = json!(set_point.is_some());
        Self {
            time_s,
            input,
            output,
            set_point,
            about,
        }
    }

    /// Of each of `points / 2` equal numbers of rows the least and the largest value, in their order.
    fn view(&self, from_s: f64, to_s: f64, points: usize) -> Value {
        let first = self.time_s.partition_point(|&time_s| time_s < from_s);
        let end = self.time_s.partition_point(|&time_s| time_s <= to_s);
        let rows = first..end.max(first);
        let each = rows.len().div_ceil(points / 2).max(1);
        let thin = |values: &[f64]| -> Vec<[f64; 2]> {
            let times_s = self.time_s[rows.clone()].chunks(each);
            let chunks = values[rows.clone()].chunks(each);
            (times_s.zip(chunks))
                .flat_map(|(times_s, chunk)| extremes(times_s, chunk))
                .collect()
        };
        json!({
            "input": thin(&self.input),
            "output": thin(&self.output),
            "set_point": self.set_point.as_deref().map(thin),
        })
    }
}

/// Times and values of the least and the largest value that is a number, in the order of time.
fn extremes(times_s: &[f64], values: &[f64]) -> Vec<[f64; 2]> {
    let known = times_s.iter().zip(values).filter(|(_, y)| y.is_finite());
    let points: Vec<[f64; 2]> = known.map(|(&t_s, &y)| [t_s, y]).collect();
    let by_value = |a: &&[f64; 2], b: &&[f64; 2]| a[1].total_cmp(&b[1]);
    let (least, most) = (
        points.iter().min_by(by_value),
        points.iter().max_by(by_value),
    );
    let mut ends: Vec<[f64; 2]> = least.into_iter().chain(most).copied().collect();
    ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
    ends.dedup();
    ends
}

/// What a message asks for.
fn request(message: &Value) -> Result<Request, String> {
    let settings = &message["settings"];
    let given = match settings {
        Value::Null => return Ok(Request::default()),
        given => serde_json::from_value(given.clone()),
    };
    given.map_err(|error| error.to_string())
}

/// The options of a message.
fn options(message: &Value) -> Vec<String> {
    let given = message["options"].as_array().into_iter().flatten();
    given
        .filter_map(|option| option.as_str().map(str::to_owned))
        .collect()
}

fn simulated(options: &[String]) -> Result<Value, String> {
    let parsed = args::parsed::<Arguments>("simulate", &[], options)?;
    let Command::Simulate(arguments) = parsed.command else {
        return Err("not the command simulate".to_owned());
    };
    if arguments.expect {
        let expected = simulate::expected(&arguments);
        let text = expected.map_err(|failure| failure.to_string())?;
        return Ok(json!({ "text": plain(&text) }));
    }
    let csv = simulate::csv(&arguments).map_err(|failure| failure.to_string())?;
    Ok(json!({ "text": String::from_utf8_lossy(&csv) }))
}

fn value(report: &impl serde::Serialize) -> Result<Value, String> {
    serde_json::to_value(report).map_err(|error| error.to_string())
}

/// Labels of the settings that have a field on the page.
const FIELDS: [(&str, &str); 11] = [
    ("axis", "Loop"),
    ("details", "Process and remarks"),
    ("from", "From"),
    ("input_range", "Range of its output"),
    ("loop", "Loop"),
    ("output_range", "Range of its measurement"),
    ("structure", "Structure"),
    ("style", "Style"),
    ("to", "To"),
    ("vendor", "Gains for"),
    ("write", "Save half step"),
];

/// A setting as the page has it: one of its fields, or what one types among the further options.
fn field(of: Named<'_>) -> String {
    let (name, value) = match of {
        Named::Setting(name, value) => (name, value),
        Named::Identify(_) => return "“Identify”".to_owned(),
        Named::Log(_) => return "“Loop”".to_owned(),
        _ => return String::new(),
    };
    let Some((_, label)) = FIELDS.iter().find(|(field, _)| *field == name) else {
        return format!("“Further options”: {}", words::option(of));
    };
    value.map_or(format!("“{label}”"), |value| {
        format!("“{label}”: {value}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_every_label() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../web/page/page.html");
        let page = std::fs::read_to_string(page).unwrap();
        for label in FIELDS
            .map(|(_, label)| label)
            .iter()
            .chain(&["Further options"])
        {
            let starts = [">", " "].map(|before| format!("{before}{label}"));
            assert!(starts.iter().any(|start| page.contains(start)), "{label}");
        }
    }
}
