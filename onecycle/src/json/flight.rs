//! The control loops of a flight.

use serde::{Serialize, Serializer};

use super::controllers::{NotKept, not_kept};
use crate::results::answer::Answer;
use crate::results::flight::{FlightLoop, Judged, Part, Survey};
use crate::words::flight as words;

/// Version of the JSON; raised with every change that a reader could notice, added keys excepted.
const SCHEMA: &str = "onecycle.flight/1";

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    file: &'a str,
    flight: usize,
    loops: Vec<Loop<'a>>,
    written: Option<[String; 2]>,
}

#[derive(Serialize)]
struct Loop<'a> {
    name: String,
    answer: &'a Answer,
    not_written: Option<&'a str>,
    gain: Option<[f64; 3]>,
    gain_unit: Option<String>,
    delay_s: Option<f64>,
    parts_disagree: bool,
    in_force: Option<Gains>,
    proposed: Option<Gains>,
    limits_not_kept: Vec<NotKept>,
    parts: Vec<PartReport>,
}

#[derive(Serialize)]
struct Gains {
    kp: f64,
    ki: f64,
    kd: f64,
    phase_margin_deg: Option<f64>,
    gain_margin: Option<f64>,
    ms: Option<f64>,
}

#[derive(Serialize)]
struct PartReport {
    from_s: f64,
    to_s: f64,
    verdict: &'static str,
    structure: Option<&'static str>,
    gain: Option<[f64; 3]>,
    delay_s: Option<f64>,
}

fn gains(judged: &Judged) -> Gains {
    let figures = judged.figures.as_ref();
    Gains {
        kp: judged.pid.kp,
        ki: judged.pid.ki,
        kd: judged.pid.kd,
        phase_margin_deg: figures.map(|of| of.margins.phase_margin_rad.to_degrees()),
        gain_margin: figures.and_then(|of| of.margins.gain_margin),
        ms: figures.map(|of| of.ms),
    }
}

impl Serialize for Survey {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let report = Report {
            schema: SCHEMA,
            file: &self.file,
            flight: self.number,
            loops: self.loops.iter().map(loop_report).collect(),
            written: (self.files.as_ref())
                .map(|of| [&of.path, &of.restore].map(|path| path.display().to_string())),
        };
        report.serialize(serializer)
    }
}

fn loop_report(one: &FlightLoop) -> Loop<'_> {
    let told = one.told();
    let first = told.first();
    Loop {
        name: one.control_loop.to_string(),
        answer: &one.answer,
        not_written: (one.to_write.as_ref())
            .and_then(|written| written.as_ref().err())
            .map(String::as_str),
        gain: one.gain(),
        gain_unit: first.map(|_| words::gain_unit(one.units)),
        delay_s: first.map(|found| found.delay_s),
        parts_disagree: one.parts_disagree(),
        in_force: one.in_force().as_ref().map(gains),
        proposed: one.proposed().as_ref().map(gains),
        limits_not_kept: one.choice.as_ref().map(not_kept).unwrap_or_default(),
        parts: one.parts.iter().map(part).collect(),
    }
}

fn part(part: &Part) -> PartReport {
    let found = part.outcome.as_ref().ok();
    PartReport {
        from_s: part.span.from_s,
        to_s: part.span.to_s,
        verdict: match &part.outcome {
            Ok(_) => "identified",
            Err(refusal) => refusal.kind(),
        },
        structure: found.map(|found| found.structure.name()),
        gain: found.map(|found| found.gain),
        delay_s: found.map(|found| found.delay_s),
    }
}
