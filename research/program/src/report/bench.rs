//! The leaderboard of a benchmark, and its rules as a README.

use onecycle_cli::report::number::{percent, significant};
use onecycle_lab::experiments::CYCLES_KEPT;
use onecycle_lab::judge::evaluate::PHASE_MARGIN_DEG;

use crate::results::bench::{BenchManifest, BenchResults, FORMAT, RecordingFormat};

/// The leaderboard as Markdown: one row for each method, best score first.
pub(crate) fn leaderboard(results: &BenchResults<'_>) -> String {
    let of = &results.benchmark.benchmark;
    let mut text = format!(
        "{} experiments, seed {}: costs and errors in %, processor times in ms; a score of 100 % means \
         no answer\n\n\
         | method | score | mean abs J | median | 95 % | 99 % | worst | unstable | no answer \
         | least margin (deg) | K/T_body | T_prop | tau (ms) | intervals hold | time (ms) |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
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
            scaled(row.coverage, 100.0),
            scaled(row.median_seconds, 1e3),
        ];
        text += &format!("| {} |\n", cells.join(" | "));
    }
    text
}

/// README of the folder: files, task and score.
pub(crate) fn rules(manifest: &BenchManifest) -> String {
    let (experiments, seed) = (manifest.benchmark.experiments, manifest.benchmark.seed);
    let most_noise = percent(manifest.benchmark.sigma);
    let recordings = match manifest.recordings {
        RecordingFormat::Csv => format!(
            "`recordings/0001.csv` to `recordings/{experiments:04}.csv`: `time_s`, `output`, `input`"
        ),
        RecordingFormat::Parquet => {
            "`recordings.parquet`: `experiment`, `time_s`, `output`, `input`, one row \
                            group for each experiment"
                .to_owned()
        }
    };
    format!(
        "# Relay experiments of unknown processes\n\n\
         {experiments} recordings of a relay test, seed {seed}, format {FORMAT}, made by onecycle {}. \
         Task: find the process of each recording, or the gains of its controller.\n\n\
         ## The experiments\n\n\
         - Process `K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))`: `T_prop` 0.015 to 0.3 s, `T_body` 0.2 \
         to 2 s, `tau` 0.0005 to 0.1 s, each uniform; `K` 0.1 to 10, uniform in logarithms.\n\
         - A modified relay feedback test at `beta` -0.73 and 1 kHz, relay amplitude 1. The recorded input is \
         held from each sample to the next.\n\
         - An input bias, which is not recorded: constant, uniform between -0.5 and 0.5. In odd experiments \
         the relay moves its centre until it cancels the bias (protocol `trimmed`); in even ones the bias \
         stays in the data (`biased`).\n\
         - White measurement noise, in the loop: its standard deviation is uniform up to {most_noise} of the \
         amplitude of the noise-free oscillation.\n\
         - A recording has the last {CYCLES_KEPT} complete cycles (they begin where the input rises), one and \
         a half periods before them, and the samples after them. Outputs are rounded to less than a \
         millionth of the amplitude.\n\n\
         ## Files\n\n\
         - {recordings}. SI units.\n\
         - `truth.csv`: the true process, bias and noise of each recording. For scoring only: a method must \
         not read it.\n\
         - `benchmark.json`: format version, number of experiments, seed and largest noise.\n\n\
         ## Answers\n\n\
         A CSV file with a header and one row for each experiment: either the process, or the gains of \
         `u = kp (r - y) - kd dy/dt`:\n\n\
         ```text\n\
         experiment,K,T_prop_s,T_body_s,tau_s\n\
         experiment,kp,kd\n\
         ```\n\n\
         For a process, the PD controller with the smallest squared error (unit step of the reference) at a \
         phase margin of at least {PHASE_MARGIN_DEG} degrees is computed. Leave out the rows without an \
         answer. The column `seconds`, the time for each answer, is optional. Score the answers with\n\n\
         ```text\n\
         onecycle-lab bench run FOLDER --answers NAME=answers.csv\n\
         ```\n\n\
         ## Score\n\n\
         `J` is the relative increase of the integral of the squared error of your controller on the true \
         process over that of the optimal controller at that margin, computed exactly. The score is the mean \
         of `min(|J|, 1)` over all experiments. An unstable loop and a missing answer count as 1, so refusing \
         has no advantage. A negative `J` with the full margin counts as 0: no PD controller reaches it, \
         other controllers may. Mean, median, percentiles and worst value in the leaderboard are over the \
         stable loops; unstable loops and missing answers are counted separately.\n\n\
         ## Licence\n\n\
         MIT or Apache-2.0, like the program that made it.\n",
        env!("CARGO_PKG_VERSION")
    )
}
