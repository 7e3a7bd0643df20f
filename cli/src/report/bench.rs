//! The rules of the benchmark, and its leaderboard.

use onecycle_lab::experiments::CYCLES_KEPT;
use onecycle_lab::judge::evaluate::PHASE_MARGIN_DEG;

use super::number::significant;
use crate::results::bench::{BenchManifest, BenchResults, FORMAT, RecordingFormat};

/// The leaderboard as Markdown: a row a method, the best score first.
pub(crate) fn leaderboard(results: &BenchResults<'_>) -> String {
    let of = &results.benchmark.benchmark;
    let mut text = format!(
        "{} experiments, seed {}: costs and errors in %, processor times in ms; a score of 100 % is \
         no answer at all\n\n\
         | method | score | mean abs J | median | 95 % | 99 % | worst | unstable | no answer \
         | least margin (deg) | K/T_body | T_prop | tau (ms) | time (ms) |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        of.experiments, of.seed
    );
    for row in &results.leaderboard {
        let costs = &row.costs;
        let scaled = |value: Option<f64>, factor: f64| {
            value.map_or("-".to_owned(), |value| significant(factor * value))
        };
        let cells = [
            row.method.clone(),
            scaled(Some(costs.score), 100.0),
            scaled(costs.mean, 100.0),
            scaled(costs.median, 100.0),
            scaled(costs.percentile_95, 100.0),
            scaled(costs.percentile_99, 100.0),
            scaled(costs.worst, 100.0),
            costs.unstable.to_string(),
            costs.no_answer.to_string(),
            scaled(costs.least_phase_margin_deg, 1.0),
            scaled(row.median_k_over_t_body_error, 100.0),
            scaled(row.median_t_prop_error, 100.0),
            scaled(row.median_tau_error_s, 1e3),
            scaled(row.median_seconds, 1e3),
        ];
        text += &format!("| {} |\n", cells.join(" | "));
    }
    text
}

/// What lies in the folder, what is asked for and how it is scored.
pub(crate) fn rules(manifest: &BenchManifest) -> String {
    let (experiments, seed) = (manifest.benchmark.experiments, manifest.benchmark.seed);
    let recordings = match manifest.recordings {
        RecordingFormat::Csv => format!(
            "`recordings/0001.csv` to `recordings/{experiments:04}.csv`: `time_s`, `output`, `input`"
        ),
        RecordingFormat::Parquet => {
            "`recordings.parquet`: `experiment`, `time_s`, `output`, `input`, a row \
                            group an experiment"
                .to_owned()
        }
    };
    format!(
        "# Relay experiments of unknown processes\n\n\
         {experiments} recordings of a relay test, seed {seed}, format {FORMAT}, made by onecycle {}. \
         From each, find the process, or the gains of its controller.\n\n\
         ## The experiments\n\n\
         - Process `K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))`: `T_prop` 0.015 to 0.3 s, `T_body` 0.2 \
         to 2 s, `tau` 0.0005 to 0.1 s, each uniform; `K` 0.1 to 10, uniform in logarithms.\n\
         - A modified relay feedback test at `beta` -0.73 and 1 kHz with the amplitude 1. The recorded \
         input is held from each sample to the next.\n\
         - A constant that is not recorded is added to the input: uniform within 0.5 either way. With odd \
         numbers the relay moves its own centre until the bias is made up for (protocol `trimmed`); with \
         even ones it stays in the data (`biased`).\n\
         - White noise on the output, in the loop: its standard deviation is uniform up to 3 % of the \
         amplitude that the oscillation has without.\n\
         - Kept are the last {CYCLES_KEPT} complete cycles (they begin where the input rises), a period \
         and a half before them, and what follows. Outputs are rounded to less than a millionth of the \
         amplitude.\n\n\
         ## Files\n\n\
         - {recordings}. SI units.\n\
         - `truth.csv`: what is behind each recording. For the score; an answer that looks there is none.\n\
         - `benchmark.json`: format, number and seed.\n\n\
         ## Answers\n\n\
         A CSV with a header and a row an experiment, either the process or the gains of \
         `u = kp (r - y) - kd dy/dt`:\n\n\
         ```text\n\
         experiment,K,T_prop_s,T_body_s,tau_s\n\
         experiment,kp,kd\n\
         ```\n\n\
         A process gets its PD of least squared error (unit step of the reference) at a phase margin of \
         {PHASE_MARGIN_DEG} degrees at least. Leave the row out where you have no answer. A column \
         `seconds` for the time that each took is shown. Score it beside the others with\n\n\
         ```text\n\
         onecycle bench run FOLDER --answers NAME=answers.csv\n\
         ```\n\n\
         ## Score\n\n\
         `J` is the integral of the squared error of your controller on the true process, above that of \
         the true process's own best at that margin, as a fraction of it: exact, without a simulation. \
         The score is the mean over all experiments of `min(|J|, 1)`; an unstable loop and a missing \
         answer count 1, so that nothing is won by refusing, and a `J` below zero that leaves the full \
         margin counts nothing: no PD has one, richer controllers may. Mean, median, percentiles and worst in the \
         leaderboard are over the stable loops; unstable loops and missing answers stand beside them.\n\n\
         ## Licence\n\n\
         MIT or Apache-2.0, as the program that made it.\n",
        env!("CARGO_PKG_VERSION")
    )
}
