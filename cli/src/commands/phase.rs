//! `onecycle phase`: a space of processes in, its distinguishing phase out.

use std::io::{self, Write};
use std::process::ExitCode;

use onecycle_lab::space::phase::LocalOptima;
use onecycle_lab::space::phase::LocalRule;

use crate::args::Phase;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, write_file};
use crate::report::phase::{json, text};
use crate::results::phase::PhaseSearch;
use crate::{pictures, settings};

pub(crate) fn run(arguments: &Phase) -> Result<ExitCode, Failure> {
    let space = settings::space(arguments.file.as_deref())?;
    let (rows, columns) = (arguments.rows as usize, arguments.columns as usize);
    let waiting = Waiting::on("designing the optimal controllers");
    let optima = LocalOptima::of_shapes(&space, rows, columns).map_err(Failure::usage)?;
    waiting.goes_on("applying every rule to every process");
    let phase = optima.distinguishing_phase().map_err(Failure::usage)?;
    drop(waiting);
    if let Some(path) = &arguments.csv {
        write_file(path, |file| write_rules(file, &phase.rules))?;
    }
    if let Some(path) = &arguments.picture {
        pictures::phase::write(path, &space, &optima, &phase)?;
    }
    let found = PhaseSearch {
        space,
        optima,
        phase,
    };
    print(&if arguments.json {
        json(&found)
    } else {
        text(&found)
    })?;
    Ok(ExitCode::from(exit::DONE))
}

/// A line for every rule; deteriorations as fractions.
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
