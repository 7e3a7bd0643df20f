//! `onecycle-lab phase`: find the distinguishing phase of a space of processes.

use std::io::{self, Write};
use std::process::ExitCode;

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::space::Space;
use onecycle_lab::space::phase::{AppliedRule, DistinguishingPhase, LocalOptima, LocalRule};

use crate::args::Phase;
use crate::output::{Waiting, print, write_file, write_text};
use crate::report::phase::{html, json, text};
use crate::results::phase::{PhaseSearch, RoundPhase};
use crate::settings;

pub(crate) fn run(arguments: &Phase) -> Result<ExitCode, Failure> {
    let space = settings::space(arguments.file.as_deref())?;
    let (rows, columns) = (arguments.rows as usize, arguments.columns as usize);
    let waiting = Waiting::on("designing the optimal controllers");
    let optima = LocalOptima::of_shapes(&space, rows, columns).map_err(Failure::usage)?;
    waiting.goes_on("applying every rule to every process");
    let phase = optima.distinguishing_phase().map_err(Failure::usage)?;
    let found = PhaseSearch {
        table: table(&space, &optima, &phase),
        curve: if arguments.report.is_some() {
            curve(&space, &optima, &phase)
        } else {
            vec![]
        },
        space,
        phase,
    };
    drop(waiting);
    if let Some(path) = &arguments.csv {
        write_file(path, |file| write_rules(file, &found.phase.rules))?;
    }
    if let Some(path) = &arguments.report {
        write_text(path, &html(&found))?;
    }
    print(&if arguments.json {
        json(&found)
    } else {
        text(&found)
    })?;
    Ok(ExitCode::from(exit::DONE))
}

/// Largest number of lines of the table.
const MOST_LINES: f64 = 16.0;

/// Rules at whole degrees that cover all local rules.
fn table(space: &Space, optima: &LocalOptima, phase: &DistinguishingPhase) -> Vec<RoundPhase> {
    let margin_deg = space.phase_margin_deg;
    let (low, high) = optima.lead_range_rad();
    let range_deg = (high - low).to_degrees();
    let step_deg = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|step| range_deg < MOST_LINES * step)
        .unwrap_or(10.0);
    let nearest = |phase_deg: f64| (phase_deg / step_deg).round() as i32;
    let first = nearest(margin_deg - high.to_degrees());
    let last = nearest(margin_deg - low.to_degrees());
    let line = |multiple: i32| {
        let phase_deg = f64::from(multiple) * step_deg;
        let applied = optima.apply((margin_deg - phase_deg).to_radians()).ok()?;
        let is_near =
            |local: &&LocalRule| nearest(local.applied.phase_rad.to_degrees()) == multiple;
        Some(RoundPhase {
            phase_deg,
            local_rules: phase.rules.iter().filter(is_near).count(),
            applied,
        })
    };
    (first..=last).rev().filter_map(line).collect()
}

/// Number of points of the curve.
const CURVE_POINTS: usize = 300;
/// Range of the curve beyond the local rules: a fraction of their range, and at least this number of degrees.
const BEYOND: f64 = 0.06;
const LEAST_BEYOND_DEG: f64 = 0.5;

fn curve(space: &Space, optima: &LocalOptima, phase: &DistinguishingPhase) -> Vec<AppliedRule> {
    let phases_deg = (phase.rules.iter()).map(|local| local.applied.phase_rad.to_degrees());
    let (low, high) = phases_deg.fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(low, high), phase_deg| (low.min(phase_deg), high.max(phase_deg)),
    );
    let beyond = (BEYOND * (high - low)).max(LEAST_BEYOND_DEG);
    let (low, high) = (low - beyond, high + beyond);
    (0..=CURVE_POINTS)
        .filter_map(|point| {
            let phase_deg = low + (high - low) * point as f64 / CURVE_POINTS as f64;
            let lead_deg = space.phase_margin_deg - phase_deg;
            optima.apply(lead_deg.to_radians()).ok()
        })
        .collect()
}

/// Writes one line for each rule; deteriorations are fractions.
fn write_rules(file: &mut dyn Write, rules: &[LocalRule]) -> io::Result<()> {
    let mut file = io::BufWriter::new(file);
    writeln!(
        file,
        "t_prop_s,t_body_s,tau_s,phase_deg,beta,c1,c3,worst,mean,\
         worst_on_t_prop_s,worst_on_t_body_s,worst_on_tau_s"
    )?;
    for LocalRule { times_s, applied } in rules {
        let [t_prop_s, t_body_s, tau_s] = times_s;
        let [on_t_prop_s, on_t_body_s, on_tau_s] = applied.worst_on_s;
        let phase_deg = applied.phase_rad.to_degrees();
        let rule = applied.rule;
        writeln!(
            file,
            "{t_prop_s},{t_body_s},{tau_s},{phase_deg},{},{},{},{},{},\
             {on_t_prop_s},{on_t_body_s},{on_tau_s}",
            rule.beta, rule.c1, rule.c3, applied.worst, applied.mean
        )?;
    }
    file.flush()
}
