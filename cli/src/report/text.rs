//! The reports for people: text, aligned, at most 100 columns; headings and verdicts in their styles.

use std::fmt::Write;

use onecycle::{
    Design, Estimate, Excitation, Identification, Identified, Interval, Model, Oscillation,
    Parameter, Recording, StepIntervals, StepMetrics,
};
use onecycle_identify::Reading;
use onecycle_link::Note;

use super::answer;
use super::controllers;
use super::family;
use super::number::{bounded, short, significant};
use super::record::{self, Fact};
use super::units::Units;
use super::wrap::wrapped;
use crate::results::answer::Answer;
use crate::results::controllers::{Controllers, Source};
use crate::results::family::OfOscillation;
use crate::style::{HEADING, HOLDS, REFUSAL, REMARK, headed, painted};
use crate::words;
use crate::words::recording;
use crate::words::remark::{details, grouped, reasons};
use crate::words::sentence;
use crate::words::verdict::advice;

/// The card of an identification.
pub(crate) fn card(
    title: &str,
    recording: &Recording,
    found: &Identification,
    answer: &Answer,
    has_details: bool,
) -> String {
    let units = Units::of(recording);
    let process = found.outcome.as_ref().ok();
    let told = reasons(found).len() + details(found).len();
    let on_card = usize::from(!reasons(found).is_empty());
    let more = (!has_details).then_some(told - on_card);
    let is_choice =
        |note: &&Note| matches!(note, Note::ColumnsChosen { .. } | Note::TagsChosen { .. });
    let chosen = recording.notes().iter().find(is_choice);
    let read = (chosen.or_else(|| recording.notes().first()))
        .filter(|_| !has_details && !recording.is_of_a_flight_log())
        .map(|note| sentence(&recording::note(note)));
    let titles = (title, read.as_deref());
    answer::card(titles, answer, process.map(|of| (of, &units)), more)
}

/// All that is known of an identification.
/// `choice`: the controllers of an identified process.
pub(crate) fn identification(
    file: &str,
    recording: &Recording,
    found: &Identification,
    choice: Option<&Controllers>,
) -> String {
    let mut text = String::new();
    let units = Units::of(recording);
    let _ = writeln!(text, "{}", painted(HEADING, file));
    for note in recording.notes() {
        remark(&mut text, "  note: ", &recording::note(note));
    }
    match &found.excitation {
        Some(Excitation::Relay {
            oscillation,
            last_cycle,
        }) => {
            describe_oscillation(&mut text, oscillation, &units);
            if let Some(reading) = last_cycle {
                describe_last_cycle(&mut text, reading);
            }
            facts(&mut text, &record::of_relay(found));
        }
        Some(Excitation::Recorded(recorded)) => {
            text.push_str(&headed("\nRecording\n"));
            facts(&mut text, &record::of_recording(found, recorded, &units));
        }
        _ => {}
    }
    match &found.outcome {
        Ok(identified) => {
            describe_process(&mut text, identified, &units);
            describe_model(&mut text, identified, &units);
            if let Some(choice) = choice {
                text.push_str(&controllers::table(choice));
            }
            if let Some((choice, design)) = choice.zip(identified.design.as_ref()) {
                describe_own_controller(&mut text, identified, (choice, design), &units);
                let excited = found.excitation.and_then(|found| found.highest_rad_per_s());
                if let Some((factor, excited)) = identified.resonance.zip(excited) {
                    text.push('\n');
                    wrapped(
                        &mut text,
                        "",
                        &words::controllers::resonance(factor, excited),
                    );
                }
            }
        }
        Err(verdict) => {
            let _ = writeln!(text, "\n{}", painted(REFUSAL, "No process identified"));
            wrapped(&mut text, "  ", &sentence(&verdict.to_string()));
            wrapped(&mut text, "  ", &advice(verdict));
        }
    }
    describe_remarks(&mut text, found);
    text
}

fn describe_remarks(text: &mut String, found: &Identification) {
    for (heading, sentences) in grouped(found) {
        text.push_str(&headed(&format!("\n{heading}\n")));
        for sentence in sentences {
            remark(text, "  - ", &sentence);
        }
    }
}

/// The report of a design. `oscillation`: what is known of the process, if its parameters are not.
pub(crate) fn design(
    model: &Model,
    choice: &Controllers,
    design: &Design,
    oscillation: Option<&OfOscillation>,
) -> String {
    let mut text = String::new();
    let structure = model.structure();
    let units = Units::default();
    if let Some(of) = oscillation {
        text.push_str(&headed("Oscillation\n"));
        facts(&mut text, &family::known(of));
        text.push('\n');
    }
    let heading = headed(&format!("Process  {}", structure.transfer_function()));
    let _ = writeln!(text, "{heading}");
    match oscillation {
        Some(of) => describe_family(&mut text, model, of, &units),
        None => describe_parameters(&mut text, model, &units),
    }
    text.push_str(&controllers::table(choice));
    describe_controller(&mut text, (choice, design), None, &units);
    if let Some(of) = oscillation {
        wrapped(
            &mut text,
            "  family      ",
            &family::margins(of.margins.as_ref()),
        );
    }
    let _ = writeln!(
        text,
        "  squared error of a unit step {}",
        significant(design.ise)
    );
    let step = choice.design().and_then(|(_, figures)| figures.step);
    describe_step(&mut text, step.as_ref(), None, &units);
    text
}

fn describe_parameters(text: &mut String, model: &Model, units: &Units) {
    let structure = model.structure();
    for &parameter in structure.parameters() {
        let value = model.parameter(parameter).filter(|value| value.is_finite());
        let value = value.map_or("infinite".to_owned(), significant);
        let (name, unit) = (
            parameter.symbol_in(structure),
            units.parameter(structure, parameter),
        );
        let _ = writeln!(
            text,
            "{}",
            format!("  {name:<10}{value:>12} {unit}").trim_end()
        );
    }
}

/// A line for each parameter of the processes that agree with an oscillation.
fn describe_family(text: &mut String, middle: &Model, of: &OfOscillation, units: &Units) {
    let _ = writeln!(text, "  {:<10}{:>12}   all that agree", "", "middle");
    for (parameter, value, range) in family::parameters(middle, of) {
        let (structure, unit) = (
            middle.structure(),
            units.parameter(middle.structure(), parameter),
        );
        text.push_str(&ranged(
            parameter.symbol_in(structure),
            &value,
            &range,
            &unit,
        ));
    }
}

/// A line with a parameter, its value and its range.
fn ranged(name: &str, value: &str, range: &str, unit: &str) -> String {
    let line = format!("  {name:<10}{value:>12}   {range:<26} {unit}");
    format!("{}\n", line.trim_end())
}

fn describe_last_cycle(text: &mut String, reading: &Reading) {
    let (style, place) = if reading.is_known() {
        (HOLDS, "in the pack's family")
    } else {
        (REMARK, "not in the pack's family")
    };
    let _ = writeln!(
        text,
        "  last cycle  {} (misfit score {}, limit 1)",
        painted(style, place),
        significant(reading.classification.score)
    );
}

fn describe_oscillation(text: &mut String, found: &Oscillation, units: &Units) {
    let Oscillation {
        cycles_used,
        cycles_steady,
        start_s,
        end_s,
        ..
    } = *found;
    text.push_str(&headed("\nOscillation\n"));
    let _ = writeln!(
        text,
        "  the last {cycles_used} of {cycles_steady} steady cycles, {start_s:.3} to {end_s:.3} s"
    );
    let noise = 100.0 * found.noise_sigma / found.amplitude;
    for (name, value, unit, more) in [
        ("period", found.period_s, "s", String::new()),
        (
            "amplitude",
            found.amplitude,
            units.output.as_str(),
            String::new(),
        ),
        (
            "noise",
            found.noise_sigma,
            &units.output,
            format!("({noise:.1} % of the amplitude)"),
        ),
        (
            "relay",
            found.relay_amplitude,
            &units.input,
            format!("(high {:.0} % of the time)", 100.0 * found.duty),
        ),
    ] {
        let _ = writeln!(
            text,
            "{}",
            format!("  {name:<10}{:>12} {unit} {more}", significant(value)).trim_end()
        );
    }
}

#[cfg(feature = "program")]
/// Table of the parameters with the intervals to expect from a planned test.
pub(crate) fn expected(model: &Model, estimate: &Estimate) -> String {
    let mut text = String::new();
    let formula = model.structure().transfer_function();
    let _ = writeln!(text, "{}", headed(&format!("Process  {formula}")));
    let columns = ("true", "expected 90 % interval");
    describe_estimate(&mut text, estimate, columns, &Units::default());
    text.push_str(
        "\nThe intervals are those of an efficient estimator. An error of the model is not in them.\n",
    );
    text
}

/// A line for each parameter, under the titles of the two columns.
fn describe_estimate(
    text: &mut String,
    estimate: &Estimate,
    (value, range): (&str, &str),
    units: &Units,
) {
    let _ = writeln!(text, "  {:<10}{value:>12}   {range}", "");
    let structure = estimate.structure();
    for (parameter, interval) in estimate.iter() {
        let (name, unit) = (
            parameter.symbol_in(structure),
            units.parameter(structure, parameter),
        );
        let is_below = estimate.is_below(parameter);
        let Interval {
            estimate,
            low,
            high,
        } = interval;
        let (value, range) = if is_below {
            (String::new(), format!("below {}", bounded(high)))
        } else {
            let value = estimate.map_or("infinite".to_owned(), significant);
            (value, format!("{} .. {}", bounded(low), bounded(high)))
        };
        text.push_str(&ranged(name, &value, &range, &unit));
    }
}

/// What the model rests on. A steady oscillation says so elsewhere.
fn describe_model(text: &mut String, identified: &Identified, units: &Units) {
    let (structure, fit) = (identified.model.structure(), &identified.fit);
    let of_model = match (fit.innovations(), fit.set_point_response()) {
        (Some(innovations), _) => record::of_model(structure, innovations, units),
        (_, Some(response)) => record::of_response(structure, response, units),
        _ => return,
    };
    text.push_str(&headed("\nModel\n"));
    facts(text, &of_model);
}

fn describe_process(text: &mut String, identified: &Identified, units: &Units) {
    let formula = identified.model.structure().transfer_function();
    let _ = writeln!(text, "\n{}", headed(&format!("Process  {formula}")));
    let columns = ("estimate", "90 % interval");
    describe_estimate(text, &identified.estimate, columns, units);
    if let Some(probability) = identified.joint_probability {
        let _ = writeln!(
            text,
            "  {:<24}all intervals of the process hold at once: {:.0} %",
            "",
            100.0 * probability
        );
    }
}

/// The controller of an identified process, with its margins and step.
fn describe_own_controller(
    text: &mut String,
    identified: &Identified,
    (choice, design): (&Controllers, &Design),
    units: &Units,
) {
    let margin = identified.phase_margin_rad.as_ref();
    describe_controller(text, (choice, design), margin, units);
    let bias = identified.estimate.get(Parameter::InputBias);
    let is_left = !design.controller.form().has_integral();
    if is_left && bias.is_some_and(|bias| !bias.holds(0.0)) {
        text.push_str("  subtract the input bias from u: there is no integral action\n");
    }
    let intervals = identified.step_intervals();
    describe_step(text, identified.step.as_ref(), intervals.as_ref(), units);
}

fn describe_controller(
    text: &mut String,
    (choice, design): (&Controllers, &Design),
    phase_margin_rad: Option<&Interval>,
    units: &Units,
) {
    let law = design.controller.form().law();
    let style = words::controllers::style(choice.asked.style);
    text.push_str(&headed(&format!("\nController  {style}: {law}\n")));
    let plant = controllers::in_plant(choice, &design.controller);
    for (name, value) in controllers::forms(&design.controller, units)
        .into_iter()
        .chain(plant)
        .chain(choice.device_model.clone())
    {
        wrapped(text, &format!("  {name:<11} "), &value);
    }
    let margins = controllers::margins(choice, design, phase_margin_rad);
    wrapped(text, "  margins     ", &margins);
    if let Some(robustness) = &design.robustness {
        let price = words::controllers::price(robustness, choice.source);
        wrapped(text, "  robustness  ", &price);
    }
    let is_recorded = choice.source == Source::Recording;
    if let Some(assumed) = words::controllers::assumed(&choice.asked, is_recorded) {
        wrapped(text, "  assumed     ", &assumed);
    }
    for sentence in words::controllers::not_kept(choice) {
        remark(text, "  limits      ", &sentence);
    }
}

fn describe_step(
    text: &mut String,
    step: Option<&StepMetrics>,
    intervals: Option<&StepIntervals>,
    units: &Units,
) {
    let _ = writeln!(
        text,
        "\n{}",
        painted(HEADING, "Predicted step of the reference")
    );
    let Some(step) = step else {
        text.push_str("  too slow to simulate\n");
        return;
    };
    let ends = |of: fn(&StepIntervals) -> &Interval, scale: f64| {
        intervals.map_or(String::new(), |intervals| {
            let end = |end: Option<f64>| end.map_or("unbounded".to_owned(), |v| short(scale * v));
            let interval = of(intervals);
            format!(" ({} .. {})", end(interval.low), end(interval.high))
        })
    };
    let unit = match units.controller("") {
        none if none.is_empty() => " per unit".to_owned(),
        unit => unit,
    };
    let facts = format!(
        "overshoot {} %{}, rise {} s{}, settling {} s{}, largest input {}{}{unit}",
        short(100.0 * step.overshoot),
        ends(|step| &step.overshoot, 100.0),
        significant(step.rise_time_s),
        ends(|step| &step.rise_time_s, 1.0),
        significant(step.settling_time_s),
        ends(|step| &step.settling_time_s, 1.0),
        significant(step.peak_input),
        ends(|step| &step.peak_input, 1.0),
    );
    wrapped(text, "  ", &facts);
}

/// Writes names and values, wrapped.
fn facts(text: &mut String, facts: &[Fact]) {
    for (name, value) in facts {
        wrapped(text, &format!("  {name:<12}"), value);
    }
}

/// Writes a remark in its colour, wrapped.
fn remark(text: &mut String, lead: &str, words: &str) {
    let mut lines = String::new();
    wrapped(&mut lines, lead, words);
    text.push_str(&painted(REMARK, &lines));
}
