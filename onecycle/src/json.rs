//! Reports for serde; docs/identify-json.md is their description. Infinite values are null.

pub mod controllers;
mod family;
mod flight;
pub mod log_gains;
mod record;

use std::borrow::Cow;

use onecycle_design::{Assessment, Design, Margins, Model, Robustness, StepMetrics, Style};
use onecycle_identify::{
    Estimate, Excitation, Identification, Interval, Oscillation, Prediction, Remark, StepIntervals,
    Switching,
};
use onecycle_link::Column;
use serde::{Serialize, Serializer};

use self::controllers::{AgainstReport, Assumed, NotKept, Proposed};
use self::log_gains::LogGainsReport;
use self::record::Record;
use crate::design::DesignReport;
use crate::report::Report;
use crate::results::answer::Answer;
use crate::results::controllers::Controllers;
use crate::words::recording::note;
use crate::words::remark::{details, reasons};
use crate::words::verdict::advice;

/// Changes with every change that a reader of the report could notice, added keys excepted.
const IDENTIFY_SCHEMA: &str = "onecycle.identify/2";
const TUNE_SCHEMA: &str = "onecycle.tune/2";

#[derive(Serialize)]
struct IdentifyReport<'a> {
    schema: &'static str,
    file: &'a str,
    answer: &'a Answer,
    columns: Columns<'a>,
    verdict: Verdict,
    excitation: Option<&'static str>,
    oscillation: Option<&'a Oscillation>,
    record: Option<Record>,
    last_cycle: Option<LastCycle>,
    switching: Option<&'a Switching>,
    amplitudes: Option<Amplitudes>,
    structure: Option<&'static str>,
    process: Option<Process>,
    below: Option<Vec<&'static str>>,
    joint_probability: Option<f64>,
    fit: Option<Fit>,
    refused: Option<RefusedFit>,
    noise: Option<record::Noise>,
    alternatives: Option<Vec<record::Alternative>>,
    innovations: Option<record::Tests>,
    prediction: Option<&'a Prediction>,
    rows: Option<record::Rows>,
    controller: Option<Controller>,
    margins: Option<MarginsReport>,
    step: Option<Step>,
    robustness: Option<&'a Robustness>,
    excited_rad_per_s: Option<f64>,
    resonance_factor: Option<f64>,
    assumed: Option<Assumed>,
    limits_not_kept: Option<Vec<NotKept>>,
    controllers: Option<Vec<Proposed<'a>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<AgainstReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    log: Option<LogGainsReport>,
    #[serde(flatten)]
    told: Told,
    notes: Vec<String>,
}

/// What there is to say on a result.
#[derive(Serialize)]
struct Told {
    remarks: Vec<String>,
    remark_kinds: Vec<&'static str>,
    details: Vec<String>,
    detail_kinds: Vec<&'static str>,
    detail_about: Vec<&'static str>,
}

impl From<&Identification> for Told {
    fn from(found: &Identification) -> Self {
        let (reasons, details) = (reasons(found), details(found));
        let kinds = |told: &[(&Remark, String)]| told.iter().map(|(one, _)| one.kind()).collect();
        Self {
            remark_kinds: kinds(&reasons),
            remarks: reasons.into_iter().map(|(_, sentence)| sentence).collect(),
            detail_kinds: kinds(&details),
            detail_about: details.iter().map(|(one, _)| one.about().name()).collect(),
            details: details.into_iter().map(|(_, sentence)| sentence).collect(),
        }
    }
}

/// Comparison of the two amplitudes of a relay test.
#[derive(Serialize)]
struct Amplitudes {
    relay_amplitudes: [f64; 2],
    gain_ratio: f64,
    phase_deg: f64,
    is_alike: bool,
}

#[derive(Serialize)]
struct TuneReport<'a> {
    schema: &'static str,
    answer: Answer,
    structure: &'static str,
    process: Parameters<Option<f64>>,
    controller: Controller,
    ise: f64,
    margins: MarginsReport,
    step: Option<Step>,
    assumed: Assumed,
    limits_not_kept: Vec<NotKept>,
    controllers: Vec<Proposed<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<AgainstReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    family: Option<family::FamilyReport>,
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
    advice: Option<Cow<'static, str>>,
}

/// The structure beside its parameters.
#[derive(Serialize)]
struct Process {
    structure: &'static str,
    #[serde(flatten)]
    parameters: Parameters<Known>,
}

/// What is known of a parameter, and its symbol in this structure.
#[derive(Serialize)]
struct Known {
    symbol: &'static str,
    #[serde(flatten)]
    interval: Interval,
}

/// Values by the keys of their parameters, in the order of the structure.
struct Parameters<T>(Vec<(&'static str, T)>);

impl<T: Serialize> Serialize for Parameters<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(key, value)| (key, value)))
    }
}

impl Parameters<Option<f64>> {
    /// Of a model without intervals.
    fn of_model(model: &Model) -> Self {
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        let parameters = model.structure().parameters().iter();
        Self(
            parameters
                .map(|&parameter| (parameter.key(), finite(model.parameter(parameter))))
                .collect(),
        )
    }
}

/// A fit that was made and refused.
#[derive(Serialize)]
struct RefusedFit {
    structure: &'static str,
    process: Parameters<Option<f64>>,
    fit: Fit,
}

#[derive(Serialize)]
struct Fit {
    misfit: f64,
    response_error: Option<f64>,
    residual_sigma: Option<f64>,
    noise_sigma: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    response: Option<Response>,
}

/// Frequency response by the set-point of a closed loop.
#[derive(Serialize)]
struct Response {
    segments: usize,
    chi_squared: f64,
    degrees_of_freedom: f64,
    widened: f64,
    frequency_rad_per_s: Vec<f64>,
    measured: Vec<[f64; 2]>,
    relative_deviation: Vec<f64>,
    fitted: Vec<[f64; 2]>,
}

#[derive(Serialize)]
pub struct Controller {
    form: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    style: Option<&'static str>,
    kp: f64,
    ki: f64,
    kd: f64,
    filter_s: f64,
    setpoint_weight: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    angle_p: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rate_p: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rate_i_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rate_d_s: Option<f64>,
}

#[derive(Serialize)]
struct MarginsReport {
    ms: Option<f64>,
    mt: Option<f64>,
    phase_margin_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    phase_margin_deg_interval: Option<Interval>,
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
    #[serde(flatten)]
    intervals: Option<StepRanges>,
}

/// 90 % intervals of a step.
#[derive(Serialize)]
struct StepRanges {
    overshoot_interval: Interval,
    rise_time_s_interval: Interval,
    settling_time_s_interval: Interval,
    peak_input_interval: Interval,
}

impl From<StepIntervals> for StepRanges {
    fn from(found: StepIntervals) -> Self {
        Self {
            overshoot_interval: found.overshoot,
            rise_time_s_interval: found.rise_time_s,
            settling_time_s_interval: found.settling_time_s,
            peak_input_interval: found.peak_input,
        }
    }
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        identification(self, false).serialize(serializer)
    }
}

impl Serialize for DesignReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        design(self).serialize(serializer)
    }
}

impl Report {
    /// The report with the fit of the likelihood row by row.
    pub fn with_rows(&self) -> impl Serialize + '_ {
        identification(self, true)
    }
}

fn identification(report: &Report, with_rows: bool) -> IdentifyReport<'_> {
    let (recording, found) = (&report.recording, &report.identification);
    let (choice, gains) = (report.choice.as_ref(), report.gains.as_ref());
    let identified = found.outcome.as_ref().ok();
    let design = identified.and_then(|i| i.design.as_ref());
    let innovations = identified.and_then(|i| i.fit.innovations());
    let columns = recording.columns();
    IdentifyReport {
        schema: IDENTIFY_SCHEMA,
        file: &report.name,
        answer: &report.answer,
        columns: Columns {
            time: column(&columns.time),
            input: column(&columns.input),
            output: column(&columns.output),
        },
        verdict: verdict(found),
        excitation: found.excitation.as_ref().map(Excitation::name),
        oscillation: found.oscillation(),
        record: match &found.excitation {
            Some(Excitation::Recorded(recorded)) => Some(recorded.into()),
            _ => None,
        },
        last_cycle: found.last_cycle().map(|reading| LastCycle {
            is_known: reading.is_known(),
            score: reading.classification.score,
        }),
        switching: found.switching.as_ref(),
        amplitudes: found.amplitudes.map(|test| Amplitudes {
            relay_amplitudes: test.amplitudes,
            gain_ratio: test.gain_ratio,
            phase_deg: test.phase_rad.to_degrees(),
            is_alike: test.is_alike,
        }),
        structure: identified.map(|i| i.model.structure().name()),
        process: identified.map(|identified| process(&identified.estimate)),
        below: identified.map(|i| below(&i.estimate)),
        joint_probability: identified.and_then(|i| i.joint_probability),
        fit: identified.map(|i| fit(&i.fit)),
        refused: found.refused.as_ref().map(refused),
        noise: innovations.map(|i| (&i.noise).into()),
        alternatives: innovations.map(|i| i.alternatives.iter().map(Into::into).collect()),
        innovations: innovations.map(Into::into),
        prediction: innovations.and_then(|i| i.prediction.as_ref()),
        rows: innovations.filter(|_| with_rows).map(Into::into),
        controller: design
            .zip(choice)
            .map(|(design, choice)| of_style(design, choice.asked.style)),
        margins: (design.zip(identified)).map(|(design, i)| {
            let interval = i.phase_margin_rad.as_ref();
            margins(&design.margins, interval, choice.and_then(figures))
        }),
        step: identified.and_then(|i| Some(step(i.step.as_ref()?, i.step_intervals()))),
        robustness: design.and_then(|design| design.robustness.as_ref()),
        excited_rad_per_s: (found.excitation).and_then(|found| found.highest_rad_per_s()),
        resonance_factor: identified.and_then(|i| i.resonance),
        assumed: choice.map(|choice| (&choice.asked).into()),
        limits_not_kept: choice.map(controllers::not_kept),
        controllers: choice.map(controllers::proposed),
        against: choice.and_then(controllers::against),
        log: gains.map(Into::into),
        told: found.into(),
        notes: recording.notes().iter().map(note).collect(),
    }
}

fn design(of: &DesignReport) -> TuneReport<'_> {
    let (model, choice, design) = (&of.model, &of.choice, &of.best);
    let metrics = figures(choice).and_then(|figures| figures.step.as_ref());
    TuneReport {
        schema: TUNE_SCHEMA,
        answer: of.answer(),
        structure: model.structure().name(),
        process: Parameters::of_model(model),
        controller: of_style(design, choice.asked.style),
        ise: design.ise,
        margins: margins(&design.margins, None, figures(choice)),
        step: metrics.map(|metrics| step(metrics, None)),
        assumed: (&choice.asked).into(),
        limits_not_kept: controllers::not_kept(choice),
        controllers: controllers::proposed(choice),
        against: controllers::against(choice),
        family: (of.oscillation.as_ref()).map(|of| family::family(model, of)),
    }
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
            advice: Some(advice(verdict)),
        },
    }
}

/// The structure, and each parameter with its interval, as in a report.
pub fn parameters(estimate: &Estimate) -> impl Serialize + use<> {
    process(estimate)
}

fn process(estimate: &Estimate) -> Process {
    let structure = estimate.structure();
    let intervals = estimate.iter();
    let known = |(parameter, interval): (crate::Parameter, _)| {
        let symbol = parameter.symbol_in(structure);
        (parameter.key(), Known { symbol, interval })
    };
    Process {
        structure: structure.name(),
        parameters: Parameters(intervals.map(known).collect()),
    }
}

/// Keys of the parameters that are below the upper end of their interval.
fn below(estimate: &Estimate) -> Vec<&'static str> {
    let parameters = estimate.iter().map(|(parameter, _)| parameter);
    let below = parameters.filter(|parameter| estimate.is_below(*parameter));
    below.map(crate::Parameter::key).collect()
}

fn refused(of: &crate::Refused) -> RefusedFit {
    RefusedFit {
        structure: of.model.structure().name(),
        process: Parameters::of_model(&of.model),
        fit: fit(&of.fit),
    }
}

fn fit(of: &onecycle_identify::Fit) -> Fit {
    let refined = of.refined();
    let innovations = of.innovations();
    Fit {
        misfit: of.misfit,
        response_error: refined.map(|refined| refined.response_error),
        residual_sigma: refined.map(|refined| refined.residual_sigma),
        noise_sigma: (refined.map(|refined| refined.noise_sigma))
            .or(innovations.map(|innovations| innovations.noise.sigma))
            .or(of.set_point_response().map(|response| response.noise_sigma)),
        response: of.set_point_response().map(response),
    }
}

fn response(of: &crate::SetPointResponse) -> Response {
    Response {
        segments: of.segments,
        chi_squared: of.chi_squared,
        degrees_of_freedom: of.freedom,
        widened: of.widened,
        frequency_rad_per_s: of.points.iter().map(|at| at.omega_rad_per_s).collect(),
        measured: of
            .points
            .iter()
            .map(|at| [at.measured.re, at.measured.im])
            .collect(),
        relative_deviation: of.points.iter().map(|at| at.deviation).collect(),
        fitted: of
            .points
            .iter()
            .map(|at| [at.fitted.re, at.fitted.im])
            .collect(),
    }
}

/// The controller of a design in a style.
fn of_style(design: &Design, style: Style) -> Controller {
    Controller {
        style: Some(style.name()),
        ..controller(&design.controller)
    }
}

pub fn controller(controller: &crate::Controller) -> Controller {
    let pid = controller.pid();
    let gains = match controller {
        crate::Controller::Autopilot(autopilot) => Some(autopilot.gains),
        _ => None,
    };
    let pd = controller.pd();
    Controller {
        form: controller.form().name(),
        style: None,
        kp: pid.kp,
        ki: pid.ki,
        kd: pid.kd,
        filter_s: pid.filter_s,
        setpoint_weight: pid.setpoint_weight,
        angle_p: (gains.map(|gains| gains.angle_p)).or(pd.map(|pd| pd.angle_p())),
        rate_p: (gains.map(|gains| gains.rate_p)).or(pd.map(|pd| pd.rate_p())),
        rate_i_per_s: gains.map(|gains| gains.rate_i),
        rate_d_s: gains.map(|gains| gains.rate_d),
    }
}

/// Figures of the chosen controller.
fn figures(choice: &Controllers) -> Option<&Assessment> {
    choice.design().map(|(_, figures)| figures)
}

fn margins(
    margins: &Margins,
    phase_margin_rad: Option<&Interval>,
    figures: Option<&Assessment>,
) -> MarginsReport {
    MarginsReport {
        ms: figures.map(|figures| figures.ms),
        mt: figures.map(|figures| figures.mt),
        phase_margin_deg: margins.phase_margin_rad.to_degrees(),
        phase_margin_deg_interval: phase_margin_rad.map(|interval| Interval {
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

fn step(metrics: &StepMetrics, intervals: Option<StepIntervals>) -> Step {
    Step {
        overshoot: metrics.overshoot,
        rise_time_s: metrics.rise_time_s,
        settling_time_s: metrics.settling_time_s,
        peak_time_s: metrics.peak_time_s,
        peak_input: metrics.peak_input,
        intervals: intervals.map(Into::into),
    }
}
