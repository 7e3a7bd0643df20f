//! The JSON reports; docs/identify-json.md is their description. Infinite values are null.

use onecycle_design::soiptd_pd::margins::Margins;
use onecycle_design::soiptd_pd::optimum::Optimum;
use onecycle_design::soiptd_pd::step_metrics::StepMetrics;
use onecycle_identify::{Identification, Identified, Interval, ProcessEstimate};
use onecycle_link::{Column, Recording};
use onecycle_onboard::{Pd, Soiptd};
use serde::Serialize;

use crate::words;

/// Changes with every change that a reader of the report could notice.
const IDENTIFY_SCHEMA: &str = "onecycle.identify/1";
const TUNE_SCHEMA: &str = "onecycle.tune/1";

#[derive(Serialize)]
struct IdentifyReport<'a> {
    schema: &'static str,
    file: &'a str,
    columns: Columns<'a>,
    verdict: Verdict,
    oscillation: Option<Oscillation>,
    last_cycle: Option<LastCycle>,
    process: Option<ProcessReport>,
    joint_probability: Option<f64>,
    fit: Option<Fit>,
    controller: Option<Controller>,
    margins: Option<MarginsReport>,
    step: Option<Step>,
    remarks: Vec<String>,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct TuneReport {
    schema: &'static str,
    process: Parameters,
    controller: Controller,
    ise: f64,
    margins: MarginsReport,
    step: Option<Step>,
}

#[derive(Serialize)]
struct LastCycle {
    is_known: bool,
    score: f64,
}

#[derive(Serialize)]
struct Columns<'a> {
    time: ColumnReport<'a>,
    input: ColumnReport<'a>,
    output: ColumnReport<'a>,
}

#[derive(Serialize)]
struct ColumnReport<'a> {
    name: &'a str,
    unit: Option<&'a str>,
}

#[derive(Serialize)]
struct Verdict {
    kind: &'static str,
    message: String,
    advice: Option<&'static str>,
}

#[derive(Serialize)]
struct Oscillation {
    period_s: f64,
    amplitude: f64,
    cycles_used: usize,
    cycles_steady: usize,
    start_s: f64,
    end_s: f64,
    duty: f64,
    relay_amplitude: f64,
    relay_centre: f64,
    noise_sigma: f64,
    sample_s: f64,
}

#[derive(Serialize)]
struct Range {
    estimate: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
}

#[derive(Serialize)]
struct ProcessReport {
    k: Range,
    k_over_t_body: Range,
    t_prop_s: Range,
    t_body_s: Range,
    tau_s: Range,
    input_bias: Range,
}

#[derive(Serialize)]
struct Parameters {
    k: Option<f64>,
    k_over_t_body: f64,
    t_prop_s: f64,
    t_body_s: Option<f64>,
    tau_s: f64,
}

#[derive(Serialize)]
struct Fit {
    misfit: f64,
    response_error: f64,
    residual_sigma: f64,
    noise_sigma: f64,
}

#[derive(Serialize)]
struct Controller {
    kp: f64,
    kd: f64,
    angle_p: f64,
    rate_p: f64,
}

#[derive(Serialize)]
struct MarginsReport {
    phase_margin_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    phase_margin_deg_interval: Option<Range>,
    gain_margin: Option<f64>,
    delay_margin_s: f64,
    gain_crossover_rad_per_s: f64,
    phase_crossover_rad_per_s: Option<f64>,
}

#[derive(Serialize)]
struct Step {
    overshoot: f64,
    rise_time_s: f64,
    settling_time_s: f64,
    peak_time_s: Option<f64>,
    peak_input: f64,
}

/// The report of an identification, one line at the end.
pub(crate) fn identification(file: &str, recording: &Recording, found: &Identification) -> String {
    let identified = found.outcome.as_ref().ok();
    let columns = recording.columns();
    to_text(&IdentifyReport {
        schema: IDENTIFY_SCHEMA,
        file,
        columns: Columns {
            time: column(&columns.time),
            input: column(&columns.input),
            output: column(&columns.output),
        },
        verdict: verdict(found),
        oscillation: found.oscillation.map(|o| Oscillation {
            period_s: o.period_s,
            amplitude: o.amplitude,
            cycles_used: o.cycles_used,
            cycles_steady: o.cycles_steady,
            start_s: o.start_s,
            end_s: o.end_s,
            duty: o.duty,
            relay_amplitude: o.relay_amplitude,
            relay_centre: o.relay_centre,
            noise_sigma: o.noise_sigma,
            sample_s: o.sample_s,
        }),
        last_cycle: found.reading.map(|reading| LastCycle {
            is_known: reading.is_known(),
            score: reading.classification.score,
        }),
        process: identified.map(|i| process(&i.process)),
        joint_probability: identified.and_then(|i| i.joint_probability),
        fit: identified.map(fit),
        controller: identified.map(|i| controller(i.controller.pd)),
        margins: identified.map(|i| margins(&i.controller.margins, Some(&i.phase_margin_rad))),
        step: identified.and_then(|i| i.step.as_ref()).map(step),
        remarks: found.remarks.iter().map(ToString::to_string).collect(),
        notes: recording
            .notes()
            .iter()
            .map(words::recording::note)
            .collect(),
    })
}

/// The report of a design.
pub(crate) fn design(process: &Soiptd, optimum: &Optimum, metrics: Option<&StepMetrics>) -> String {
    to_text(&TuneReport {
        schema: TUNE_SCHEMA,
        process: Parameters {
            k: process.k(),
            k_over_t_body: process.k_over_t_body(),
            t_prop_s: process.t_prop_s(),
            t_body_s: process.t_body_s(),
            tau_s: process.tau_s(),
        },
        controller: controller(optimum.pd),
        ise: optimum.ise,
        margins: margins(&optimum.margins, None),
        step: metrics.map(step),
    })
}

pub(crate) fn to_text(report: &impl Serialize) -> String {
    // Plain structures of numbers and strings always serialise.
    let mut text = serde_json::to_string_pretty(report).unwrap_or_default();
    text.push('\n');
    text
}

fn column(column: &Column) -> ColumnReport<'_> {
    ColumnReport {
        name: &column.name,
        unit: column.unit.as_deref(),
    }
}

fn verdict(found: &Identification) -> Verdict {
    match &found.outcome {
        Ok(_) => Verdict {
            kind: "identified",
            message: "the process is identified".to_owned(),
            advice: None,
        },
        Err(verdict) => Verdict {
            kind: verdict.kind(),
            message: verdict.to_string(),
            advice: Some(verdict.advice()),
        },
    }
}

fn range(interval: &Interval) -> Range {
    Range {
        estimate: interval.estimate,
        low: interval.low,
        high: interval.high,
    }
}

fn process(estimate: &ProcessEstimate) -> ProcessReport {
    ProcessReport {
        k: range(&estimate.k),
        k_over_t_body: range(&estimate.k_over_t_body),
        t_prop_s: range(&estimate.t_prop_s),
        t_body_s: range(&estimate.t_body_s),
        tau_s: range(&estimate.tau_s),
        input_bias: range(&estimate.input_bias),
    }
}

fn fit(identified: &Identified) -> Fit {
    Fit {
        misfit: identified.misfit,
        response_error: identified.refined.response_error,
        residual_sigma: identified.refined.residual_sigma,
        noise_sigma: identified.refined.noise_sigma,
    }
}

fn controller(pd: Pd) -> Controller {
    Controller {
        kp: pd.kp,
        kd: pd.kd,
        angle_p: pd.angle_p(),
        rate_p: pd.rate_p(),
    }
}

fn margins(margins: &Margins, phase_margin_rad: Option<&Interval>) -> MarginsReport {
    MarginsReport {
        phase_margin_deg: margins.phase_margin_rad.to_degrees(),
        phase_margin_deg_interval: phase_margin_rad.map(|interval| Range {
            estimate: interval.estimate.map(f64::to_degrees),
            low: interval.low.map(f64::to_degrees),
            high: interval.high.map(f64::to_degrees),
        }),
        gain_margin: margins.gain_margin,
        delay_margin_s: margins.delay_margin_s,
        gain_crossover_rad_per_s: margins.gain_crossover_rad_per_s,
        phase_crossover_rad_per_s: margins.phase_crossover_rad_per_s,
    }
}

fn step(metrics: &StepMetrics) -> Step {
    Step {
        overshoot: metrics.overshoot,
        rise_time_s: metrics.rise_time_s,
        settling_time_s: metrics.settling_time_s,
        peak_time_s: metrics.peak_time_s,
        peak_input: metrics.peak_input,
    }
}
