//! The report of a distinguishing phase: as text and as JSON; `page` has the figures.

mod page;

use std::fmt::Write;

use onecycle_cli::report::json::to_text;
use onecycle_cli::report::number::significant;
use onecycle_lab::space::Space;
use onecycle_lab::space::phase::{AppliedRule, LocalRule};
use serde::Serialize;

use crate::results::phase::{PhaseSearch, RoundPhase};

pub(crate) use self::page::html;

const SCHEMA: &str = "onecycle.phase/1";

/// The result as text, at most 100 columns wide.
pub(crate) fn text(found: &PhaseSearch) -> String {
    let PhaseSearch { space, phase, .. } = found;
    let mut text = String::new();
    let shapes = match phase.rules.len() {
        1 => "one shape".to_owned(),
        count => format!("{count} shapes"),
    };
    let _ = writeln!(
        text,
        "Distinguishing phase of {shapes} of processes at a phase margin of {} deg",
        space.phase_margin_deg
    );
    let ranges = space.ranges_s().map(|(low, high)| {
        let (low, high) = (significant(low), significant(high));
        format!("{low} .. {high} s")
    });
    let _ = writeln!(
        text,
        "  T_prop {}   T_body {}   tau {}",
        ranges[0], ranges[1], ranges[2]
    );
    let _ = writeln!(
        text,
        "\n{:<20}{:>9}{:>10}{:>9}{:>9}     deterioration (%)\n\
         {:<20}{:>9}{:>10}{:>9}{:>9}{:>10}{:>9}",
        "", "phase", "beta", "c1", "c3", "", "(deg)", "", "", "", "worst", "mean"
    );
    rule_line(&mut text, "Best local rule", &phase.best.applied);
    rule_line(&mut text, "Best rule of all", &phase.minimax);
    let _ = writeln!(
        text,
        "\nThe best local rule is the optimum of {};\nits deterioration is worst on {}.",
        times(phase.best.times_s),
        times(phase.best.applied.worst_on_s)
    );
    table(&mut text, found);
    text
}

fn rule_line(text: &mut String, name: &str, applied: &AppliedRule) {
    let rule = applied.rule;
    let _ = writeln!(
        text,
        "{name:<20}{:>9.2}{:>10.4}{:>9.4}{:>9.4}{:>10.2}{:>9.2}",
        applied.phase_rad.to_degrees(),
        rule.beta,
        rule.c1,
        rule.c3,
        100.0 * applied.worst,
        100.0 * applied.mean
    );
}

fn times([t_prop_s, t_body_s, tau_s]: [f64; 3]) -> String {
    format!(
        "T_prop {} s, T_body {} s, tau {} s",
        significant(t_prop_s),
        significant(t_body_s),
        significant(tau_s)
    )
}

/// Writes the table of rules at round phases.
fn table(text: &mut String, found: &PhaseSearch) {
    let _ = writeln!(
        text,
        "\nPhase of the rule   local rules   deterioration (%)        worst on (ms)\n\
         {:<20}{:>11}{:>12}{:>9}   {:>8}{:>9}{:>9}",
        "(deg)", "near it", "worst", "mean", "T_prop", "T_body", "tau"
    );
    for line in &found.table {
        let RoundPhase {
            phase_deg,
            local_rules,
            applied,
        } = line;
        let [t_prop, t_body, tau] = applied.worst_on_s.map(|time_s| significant(1e3 * time_s));
        let _ = writeln!(
            text,
            "{phase_deg:<20}{local_rules:>11}{:>12.2}{:>9.2}   {t_prop:>8}{t_body:>9}{tau:>9}",
            100.0 * applied.worst,
            100.0 * applied.mean,
        );
    }
}

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    space: &'a Space,
    distinguishing: Local,
    minimax: Rule,
    rules: Vec<Local>,
}

#[derive(Serialize)]
struct Local {
    process: Times,
    #[serde(flatten)]
    rule: Rule,
}

#[derive(Serialize)]
struct Rule {
    phase_deg: f64,
    lead_deg: f64,
    beta: f64,
    c1: f64,
    c3: f64,
    worst: f64,
    mean: f64,
    worst_on: Times,
}

#[derive(Serialize)]
struct Times {
    t_prop_s: f64,
    t_body_s: f64,
    tau_s: f64,
}

/// The result as JSON. Deteriorations are fractions; infinite ones are null.
pub(crate) fn json(found: &PhaseSearch) -> String {
    to_text(&Report {
        schema: SCHEMA,
        space: &found.space,
        distinguishing: Local::of(&found.phase.best),
        minimax: Rule::of(&found.phase.minimax),
        rules: found.phase.rules.iter().map(Local::of).collect(),
    })
}

impl Local {
    fn of(local: &LocalRule) -> Self {
        Self {
            process: Times::of(local.times_s),
            rule: Rule::of(&local.applied),
        }
    }
}

impl Rule {
    fn of(applied: &AppliedRule) -> Self {
        Self {
            phase_deg: applied.phase_rad.to_degrees(),
            lead_deg: applied.lead_rad.to_degrees(),
            beta: applied.rule.beta,
            c1: applied.rule.c1,
            c3: applied.rule.c3,
            worst: applied.worst,
            mean: applied.mean,
            worst_on: Times::of(applied.worst_on_s),
        }
    }
}

impl Times {
    fn of([t_prop_s, t_body_s, tau_s]: [f64; 3]) -> Self {
        Self {
            t_prop_s,
            t_body_s,
            tau_s,
        }
    }
}
