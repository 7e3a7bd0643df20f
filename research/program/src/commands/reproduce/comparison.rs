//! Table IV and the tuning rules: several methods on the same random processes, with both protocols.

use onecycle_cli::failure::Failure;
use onecycle_cli::pages::plot::{Marks, Series};
use onecycle_cli::report::number::{percent, seconds};
use onecycle_lab::experiments::Benchmark;
use onecycle_lab::judge::evaluate::{Contender, EvaluationError, Judge, Record, Summary, records};
use onecycle_lab::paper::classifier::Protocol;
use onecycle_lab::paper::network::{Card, PaperNetwork};
use serde::Deserialize;

use crate::commands::clock::thread_seconds;
use crate::results::reproduction::{Numbers, Row, or_dash};
use crate::workers::Workers;

/// The experiments and the methods.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ComparisonSettings {
    /// Number of processes for each protocol.
    systems: u64,
    seed: u64,
    /// Names of methods, and their names in the table.
    methods: Vec<(String, String)>,
    /// Name of the network of the paper's size in the table, where it comes first.
    #[serde(default)]
    network: Option<String>,
}

/// The method with this name.
fn contender(name: &str) -> Result<Contender, Failure> {
    Contender::from_name(name).ok_or_else(|| Failure::usage(format!("there is no method '{name}'")))
}

pub(super) fn find(
    settings: &ComparisonSettings,
    network: Option<&PaperNetwork>,
    workers: &Workers,
) -> Result<Numbers, Failure> {
    let contenders = settings.methods.iter().map(|(name, _)| contender(name));
    let contenders: Vec<Contender> = contenders.collect::<Result<_, _>>()?;
    let network = network.zip(settings.network.as_ref());
    let benchmark = Benchmark {
        experiments: 2 * settings.systems,
        seed: settings.seed,
        ..Benchmark::default()
    };
    let judged = workers.map(benchmark.experiments as usize, |index| {
        let (truth, recorded) = benchmark.experiment(index as u64 + 1)?;
        let signals = recorded.signals();
        let mut found = Vec::with_capacity(contenders.len() + 1);
        if let Some((network, name)) = network {
            let answer = || network.answer(&signals).map_err(|error| error.to_string());
            let judge = Judge::new(&truth.process)?;
            found.push(judge.timed(truth.number, name, answer, &thread_seconds));
        }
        found.extend(records(&truth, &signals, &contenders, &thread_seconds)?);
        Ok((truth.is_trimmed, found))
    });
    let judged: Result<Vec<(bool, Vec<Record>)>, EvaluationError> = judged.into_iter().collect();
    let judged = judged.map_err(Failure::usage)?;
    let mut found = Numbers::default();
    for is_trimmed in [false, true] {
        let of_protocol = judged.iter().filter(|(trimmed, _)| *trimmed == is_trimmed);
        let records: Vec<&Vec<Record>> = of_protocol.map(|(_, records)| records).collect();
        let of_method = |number: usize| -> Vec<&Record> {
            records.iter().map(|records| &records[number]).collect()
        };
        let methods = settings.methods.iter().map(|(_, label)| label);
        let labels = network
            .iter()
            .map(|&(_, label)| label)
            .chain(methods)
            .enumerate();
        found.tables.push(
            labels
                .clone()
                .map(|(number, label)| row(label, &Summary::of(label, &of_method(number))))
                .collect(),
        );
        found.figures.push(
            labels
                .map(|(number, label)| sorted(label, &of_method(number)))
                .collect(),
        );
    }
    found
        .tables
        .extend(network.map(|(network, _)| training(&network.card)));
    Ok(found)
}

/// How the network was trained.
fn training(card: &Card) -> Vec<Row> {
    let recipe = &card.recipe;
    let widths = recipe.hidden.iter().map(ToString::to_string);
    let row = |name, cell: String| Row::new(name, [cell]);
    vec![
        row("hidden layers", widths.collect::<Vec<_>>().join(", ")),
        row("classes", card.classes_s.len().to_string()),
        row("experiments learnt from", recipe.examples.to_string()),
        row("epochs", recipe.epochs.to_string()),
        row(
            "bias",
            match recipe.protocol {
                Protocol::Trimmed => "trimmed away",
                Protocol::Untrimmed => "left in",
                Protocol::Both => "left in and trimmed away, in turn",
            }
            .to_owned(),
        ),
    ]
}

fn row(label: &str, summary: &Summary) -> Row {
    let costs = &summary.costs;
    let worst = if costs.unstable > 0 {
        format!("unstable ({})", or_dash(costs.worst, percent))
    } else {
        or_dash(costs.worst, percent)
    };
    Row::new(
        label,
        [
            or_dash(costs.mean, percent),
            worst,
            costs.unstable.to_string(),
            costs.no_answer.to_string(),
            or_dash(summary.median_seconds, seconds),
        ],
    )
}

/// Smallest `|J|` on the logarithmic axis (%).
const LEAST_SHOWN: f64 = 1e-3;

/// `|J|` of the stable loops (%) in rising order, over the fraction of systems with at most that `|J|` (%).
fn sorted(label: &str, records: &[&Record]) -> Series {
    let costs = records.iter().filter_map(|record| record.deterioration);
    let mut costs: Vec<f64> = costs.map(f64::abs).collect();
    costs.sort_unstable_by(f64::total_cmp);
    let whole = records.len().max(1) as f64;
    let points = costs.iter().enumerate().map(|(rank, cost)| {
        (
            100.0 * (rank + 1) as f64 / whole,
            (100.0 * cost).max(LEAST_SHOWN),
        )
    });
    Series::of_points(label, Marks::Line, points)
}
