//! The reports for people: text, aligned, at most 100 columns; headings and verdicts in their styles.

use std::fmt::Write;

use onecycle_design::soiptd_pd::optimum::Optimum;
use onecycle_design::soiptd_pd::step_metrics::StepMetrics;
use onecycle_identify::{Identification, Identified, Interval, OscillationFound, Reading};
use onecycle_link::Recording;
use onecycle_onboard::Soiptd;
use onecycle_onboard::classify::Familiarity;

use super::number::{bounded, seconds, significant};
use crate::style::{HEADING, HOLDS, REFUSAL, REMARK, headed, painted};

/// Widest line of remarks, as terminals are.
const WIDTH: usize = 96;

/// What is identified.
pub(super) const FORMULA: &str = "K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))";

/// Units of the recording, for the parameters that are made of them.
#[derive(Default)]
pub(super) struct Units {
    pub(super) input: String,
    pub(super) output: String,
}

impl Units {
    pub(super) fn of(recording: &Recording) -> Self {
        let unit = |column: &onecycle_link::Column| column.unit.clone().unwrap_or_default();
        Self {
            input: unit(&recording.columns().input),
            output: unit(&recording.columns().output),
        }
    }

    /// `output/(input per)`, nothing where the recording gives no units.
    pub(super) fn gain(&self, per: &str) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        format!("{}/({} {per})", self.output, self.input)
    }

    /// ` input/output` with what stands behind, nothing where the recording gives no units.
    pub(super) fn controller(&self, behind: &str) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        format!(" {}{behind}/{}", self.input, self.output)
    }

    /// What an axis is of, with its unit where there is one.
    pub(super) fn titled(name: &str, unit: &str) -> String {
        if unit.is_empty() {
            name.to_owned()
        } else {
            format!("{name} ({unit})")
        }
    }
}

/// The report of an identification.
pub(crate) fn identification(file: &str, recording: &Recording, found: &Identification) -> String {
    let mut text = String::new();
    let units = Units::of(recording);
    let _ = writeln!(text, "{}", painted(HEADING, file));
    for note in recording.notes() {
        remark(&mut text, "  note: ", &note.to_string());
    }
    if let Some(oscillation) = &found.oscillation {
        describe_oscillation(&mut text, oscillation, &units);
        if let Some(reading) = &found.reading {
            let Reading { classification, .. } = reading;
            let is_known = classification.familiarity == Familiarity::Known;
            let _ = writeln!(
                text,
                "  last cycle  {} (score {}, known up to 1)",
                painted(
                    if is_known { HOLDS } else { REMARK },
                    &classification.familiarity.to_string()
                ),
                significant(classification.score)
            );
        }
    }
    match &found.outcome {
        Ok(identified) => {
            describe_process(&mut text, identified, &units);
            let margin = Some(&identified.phase_margin_rad);
            describe_controller(&mut text, &identified.controller, margin, &units);
            if !identified.process.input_bias.holds(0.0) {
                text.push_str("  subtract the input bias from u: there is no integral action\n");
            }
            describe_step(&mut text, identified.step.as_ref(), &units);
        }
        Err(verdict) => {
            let _ = writeln!(text, "\n{}", painted(REFUSAL, "No process identified"));
            wrapped(&mut text, "  ", &sentence(&verdict.to_string()));
            wrapped(&mut text, "  ", verdict.advice());
        }
    }
    if !found.remarks.is_empty() {
        text.push_str(&headed("\nRemarks\n"));
        for one in &found.remarks {
            remark(&mut text, "  - ", &one.to_string());
        }
    }
    text
}

/// The report of a design.
pub(crate) fn design(process: &Soiptd, optimum: &Optimum, step: Option<&StepMetrics>) -> String {
    let mut text = String::new();
    let infinite = |value: Option<f64>| value.map_or("infinite".to_owned(), significant);
    let _ = writeln!(text, "{}", headed(&format!("Process  {FORMULA}")));
    for (name, value, unit) in [
        ("K", infinite(process.k()), ""),
        ("K/T_body", significant(process.k_over_t_body()), ""),
        ("T_prop", significant(process.t_prop_s()), "s"),
        ("T_body", infinite(process.t_body_s()), "s"),
        ("tau", significant(process.tau_s()), "s"),
    ] {
        let _ = writeln!(
            text,
            "{}",
            format!("  {name:<10}{value:>12} {unit}").trim_end()
        );
    }
    describe_controller(&mut text, optimum, None, &Units::default());
    let _ = writeln!(
        text,
        "  squared error of a unit step {}",
        significant(optimum.ise)
    );
    describe_step(&mut text, step, &Units::default());
    text
}

fn describe_oscillation(text: &mut String, found: &OscillationFound, units: &Units) {
    let OscillationFound {
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

fn describe_process(text: &mut String, identified: &Identified, units: &Units) {
    let process = &identified.process;
    let _ = writeln!(text, "\n{}", headed(&format!("Process  {FORMULA}")));
    let _ = writeln!(text, "  {:<10}{:>12}   90 % interval", "", "estimate");
    let (velocity, acceleration) = (units.gain("s"), units.gain("s^2"));
    let mut row = |name: &str, interval: &Interval, unit: &str| {
        let Interval {
            estimate,
            low,
            high,
        } = *interval;
        let estimate = estimate.map_or("infinite".to_owned(), significant);
        let range = format!("{} .. {}", bounded(low), bounded(high));
        let line = format!("  {name:<10}{estimate:>12}   {range:<26} {unit}");
        let _ = writeln!(text, "{}", line.trim_end());
    };
    row("K", &process.k, &velocity);
    row("K/T_body", &process.k_over_t_body, &acceleration);
    row("T_prop", &process.t_prop_s, "s");
    row("T_body", &process.t_body_s, "s");
    row("tau", &process.tau_s, "s");
    row("input bias", &process.input_bias, &units.input);
    if let Some(probability) = identified.joint_probability {
        let _ = writeln!(
            text,
            "  {:<24}gain, lags and delay all within at once: {:.0} %",
            "",
            100.0 * probability
        );
    }
}

fn describe_controller(
    text: &mut String,
    optimum: &Optimum,
    phase_margin_rad: Option<&Interval>,
    units: &Units,
) {
    let pd = optimum.pd;
    let (gain, rate) = (units.controller(""), units.controller(" s"));
    text.push_str(&headed("\nController  u = Kp (r - y) - Kd dy/dt\n"));
    let _ = writeln!(
        text,
        "  Kp {}{gain}   Kd {}{rate}   as cascade: angle P {} 1/s, rate P {}{rate}",
        significant(pd.kp),
        significant(pd.kd),
        significant(pd.angle_p()),
        significant(pd.rate_p())
    );
    let margins = &optimum.margins;
    let _ = write!(
        text,
        "  phase margin {:.1} deg",
        margins.phase_margin_rad.to_degrees()
    );
    if let Some(Interval {
        low: Some(low),
        high: Some(high),
        ..
    }) = phase_margin_rad
    {
        let _ = write!(
            text,
            " (90 %: {:.1} .. {:.1})",
            low.to_degrees(),
            high.to_degrees()
        );
    }
    if let Some(gain_margin) = margins.gain_margin {
        let decibels = 20.0 * gain_margin.log10();
        let _ = write!(text, "   gain margin {gain_margin:.2} ({decibels:.1} dB)");
    }
    let _ = writeln!(text, "   delay margin {}", seconds(margins.delay_margin_s));
}

fn describe_step(text: &mut String, step: Option<&StepMetrics>, units: &Units) {
    let _ = writeln!(
        text,
        "\n{}",
        painted(HEADING, "Predicted step of the reference")
    );
    let _ = match step {
        Some(step) => writeln!(
            text,
            "  overshoot {:.0} %   rise {} s   settling {} s   largest input {}{}",
            100.0 * step.overshoot,
            significant(step.rise_time_s),
            significant(step.settling_time_s),
            significant(step.peak_input),
            match units.controller("") {
                none if none.is_empty() => " per unit".to_owned(),
                unit => unit,
            }
        ),
        None => writeln!(text, "  too slow to simulate"),
    };
}

/// Writes what one should know besides, wrapped.
fn remark(text: &mut String, lead: &str, words: &str) {
    let mut lines = String::new();
    wrapped(&mut lines, lead, words);
    text.push_str(&painted(REMARK, &lines));
}

/// The same with a capital letter and a full stop.
pub(super) fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first
        .into_iter()
        .chain(letters)
        .chain(std::iter::once('.'))
        .collect()
}

/// Writes `words` behind `lead`, in lines as wide as a terminal, indented like the first.
pub(super) fn wrapped(text: &mut String, lead: &str, words: &str) {
    let mut line = lead.to_owned();
    let mut is_first = true;
    for word in words.split_whitespace() {
        if !is_first && line.len() + 1 + word.len() > WIDTH {
            let _ = writeln!(text, "{line}");
            line = " ".repeat(lead.len());
            is_first = true;
        }
        if !is_first {
            line.push(' ');
        }
        line.push_str(word);
        is_first = false;
    }
    let _ = writeln!(text, "{line}");
}
