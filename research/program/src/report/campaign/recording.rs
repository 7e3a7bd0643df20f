//! The table of a campaign of recordings.

use std::collections::BTreeMap;
use std::fmt::Write;

use onecycle_design::{Parameter, Structure};
use onecycle_lab::experiments::RecordingCampaign;
use onecycle_lab::experiments::recording::{
    Combination, DisturbanceLevel, EntryName, ProcessRange, SensorDefects,
};
use onecycle_lab::judge::promises::PROMISES;
use onecycle_lab::judge::recording::{ParameterTally, RecordingOutcome, RecordingTally};

use super::or_dash;

/// Columns of the parameters, in the order of a table.
const PARAMETERS: [Parameter; 9] = [
    Parameter::K,
    Parameter::KOverTBody,
    Parameter::NaturalFrequency,
    Parameter::Zeta,
    Parameter::TProp,
    Parameter::TProp2,
    Parameter::TBody,
    Parameter::Tau,
    Parameter::InputBias,
];

/// Rows: all recordings, then those of each entry of each list of the campaign that has several.
pub(crate) fn table(campaign: &RecordingCampaign, outcomes: &[RecordingOutcome]) -> String {
    let rows = rows(campaign, outcomes);
    let estimator = campaign.structure.map_or("chosen", Structure::name);
    let mut text = format!(
        "{} recordings at {} Hz, noise {} of the amplitude, bias up to {}, structure {estimator}\n",
        outcomes.len(),
        campaign.sample_rate_hz,
        campaign.noise,
        campaign.bias,
    );
    outcome_rows(&mut text, &rows);
    remark_rows(&mut text, &rows);
    let blocks: [(&str, Figure, f64, usize); 4] = [
        (
            "90 % intervals hold (%)",
            ParameterTally::coverage,
            100.0,
            1,
        ),
        (
            "mean error / standard deviation",
            ParameterTally::bias,
            1.0,
            2,
        ),
        (
            "rms error / standard deviation",
            ParameterTally::rms,
            1.0,
            2,
        ),
        (
            "rms error / Cramer-Rao bound",
            ParameterTally::rms_over_bound,
            1.0,
            2,
        ),
    ];
    for block in blocks {
        parameter_rows(&mut text, &rows, block);
    }
    summary(&mut text, &rows);
    text
}

/// The same in short, as docs/benchmarks has it. Writing to a string cannot fail.
fn summary(text: &mut String, rows: &[(String, RecordingTally)]) {
    const RATIOS: [Parameter; 3] = [Parameter::KOverTBody, Parameter::TProp, Parameter::Tau];
    let Some((_, all)) = rows.first() else {
        return;
    };
    let estimated = |parameter: &Parameter| all.parameters.contains_key(parameter.key());
    let columns: Vec<Parameter> = PARAMETERS.into_iter().filter(estimated).collect();
    let symbols: Vec<&str> = columns.iter().map(|of| of.symbol()).collect();
    let ratios = RATIOS.map(|parameter| parameter.symbol()).join(", ");
    let _ = writeln!(
        text,
        "\n| | refused | {} | rms error over posterior: {ratios} | over Cramer-Rao bound |\n|{}",
        symbols.join(" | "),
        " --- |".repeat(columns.len() + 4)
    );
    for (name, tally) in rows {
        let figure = |parameter: &Parameter, figure: Figure, scale, decimals| {
            let value = tally.parameters.get(parameter.key()).and_then(figure);
            or_dash(value.map(|value| scale * value), decimals)
        };
        let held = (columns.iter()).map(|of| figure(of, ParameterTally::coverage, 100.0, 0));
        let ratios = [ParameterTally::rms, ParameterTally::rms_over_bound]
            .map(|rms| RATIOS.map(|of| figure(&of, rms, 1.0, 2)).join(", "));
        let _ = writeln!(
            text,
            "| {name} | {:.1} % | {} | {} |",
            100.0 * tally.refusals() as f64 / tally.cases as f64,
            held.collect::<Vec<_>>().join(" | "),
            ratios.join(" | ")
        );
    }
}

/// A figure of a parameter.
type Figure = fn(&ParameterTally) -> Option<f64>;

/// Tallies with their names, `all` first.
fn rows(
    campaign: &RecordingCampaign,
    outcomes: &[RecordingOutcome],
) -> Vec<(String, RecordingTally)> {
    let mut all = RecordingTally::default();
    // By list and entry.
    let mut parts: BTreeMap<(usize, usize), RecordingTally> = BTreeMap::new();
    for (n, outcome) in (0..).zip(outcomes) {
        let at = campaign.combination(n);
        let truth = campaign.processes[at.process].structure;
        all.add(truth, outcome);
        for (list, (entry, length)) in indices(campaign, &at).into_iter().enumerate() {
            if length > 1 {
                parts.entry((list, entry)).or_default().add(truth, outcome);
            }
        }
    }
    let named =
        (parts.into_iter()).map(|((list, entry), tally)| (name(campaign, list, entry), tally));
    std::iter::once(("all".to_owned(), all))
        .chain(named)
        .collect()
}

/// Entry of a combination in each list of the campaign, with the length of the list.
fn indices(campaign: &RecordingCampaign, at: &Combination) -> [(usize, usize); 6] {
    [
        (at.process, campaign.processes.len()),
        (at.excitation, campaign.excitations.len()),
        (at.disturbance, campaign.disturbances.len()),
        (at.duration, campaign.durations_s.len()),
        (at.closed_loop, campaign.loops.len()),
        (at.sensor, campaign.sensors.len()),
    ]
}

/// Name of an entry of a list, in the order of [`indices`].
fn name(campaign: &RecordingCampaign, list: usize, entry: usize) -> String {
    match list {
        0 => process(campaign, entry),
        1 => campaign.excitations[entry].signal.name().to_owned(),
        2 => disturbance(&campaign.disturbances[entry]),
        3 => format!("{} s", campaign.durations_s[entry]),
        4 => match campaign.loops[entry].entry {
            EntryName::Input => "at the input".to_owned(),
            EntryName::Setpoint => "at the set-point".to_owned(),
        },
        _ => sensor(&campaign.sensors[entry]),
    }
}

/// Structure of a process, with its number among several of the same structure.
fn process(campaign: &RecordingCampaign, entry: usize) -> String {
    let structure = campaign.processes[entry].structure;
    let is_same = |process: &&ProcessRange| process.structure == structure;
    let before = campaign.processes[..entry].iter().filter(is_same).count();
    match campaign.processes.iter().filter(is_same).count() {
        1 => structure.name().to_owned(),
        _ => format!("{}, process {}", structure.name(), before + 1),
    }
}

fn sensor(defects: &SensorDefects) -> String {
    let mut named = vec![];
    if defects.outliers > 0.0 {
        named.push(format!(
            "{} % outliers of {}",
            100.0 * defects.outliers,
            defects.outlier_size
        ));
    }
    if defects.drop_outs > 0.0 {
        named.push(format!("{} % dropped", 100.0 * defects.drop_outs));
    }
    if named.is_empty() {
        "good sensor".to_owned()
    } else {
        named.join(", ")
    }
}

fn disturbance(level: &DisturbanceLevel) -> String {
    let named: Vec<_> = level
        .named()
        .map(|(name, value)| format!("{name} {value}"))
        .collect();
    if named.is_empty() {
        "undisturbed".to_owned()
    } else {
        named.join(", ")
    }
}

/// Cases, refusals and structures. Writing to a string cannot fail.
fn outcome_rows(text: &mut String, rows: &[(String, RecordingTally)]) {
    let _ = writeln!(text, "\n{:<28} cases refused (%) true structure (%)", "");
    for (name, tally) in rows {
        let accepted = tally.cases - tally.refusals();
        let percent = |count: usize, of: usize| {
            or_dash((of > 0).then(|| 100.0 * count as f64 / of as f64), 1)
        };
        let mut notes: Vec<String> = (tally.refused.iter())
            .map(|(kind, count)| format!("{kind} {count}"))
            .collect();
        notes.extend(
            tally
                .confused
                .iter()
                .map(|((truth, found), count)| format!("{truth} taken for {found} {count}")),
        );
        let line = format!(
            "{name:<28} {:5} {:>11} {:>18}  {}",
            tally.cases,
            percent(tally.refusals(), tally.cases),
            percent(tally.true_structures(), accepted),
            notes.join(", ")
        );
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

/// How often each remark stands on an identified recording.
fn remark_rows(text: &mut String, rows: &[(String, RecordingTally)]) {
    let _ = writeln!(text, "\nidentified recordings with a remark (%)");
    for (name, tally) in rows {
        let accepted = (tally.cases - tally.refusals()) as f64;
        let remarks: Vec<String> = (tally.remarks.iter())
            .map(|(kind, count)| format!("{kind} {:.1}", 100.0 * *count as f64 / accepted))
            .collect();
        let line = format!("{name:<28} {}", remarks.join(", "));
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

/// A figure of every parameter that was estimated in any row, and of the promises about its loop.
fn parameter_rows(
    text: &mut String,
    rows: &[(String, RecordingTally)],
    (title, figure, scale, decimals): (&str, Figure, f64, usize),
) {
    let Some((_, all)) = rows.first() else {
        return;
    };
    let parameters = PARAMETERS.map(|parameter| (parameter.key(), parameter.symbol()));
    let columns = (parameters.into_iter()).chain(PROMISES.map(|name| (name, name)));
    let has_figure = |key: &str| all.parameters.get(key).and_then(figure).is_some();
    let columns: Vec<_> = columns.filter(|(key, _)| has_figure(key)).collect();
    let _ = write!(text, "\n{title}\n{:<28}", "");
    for (_, symbol) in &columns {
        let _ = write!(text, " {symbol:>10}");
    }
    let _ = writeln!(text);
    for (name, tally) in rows {
        let _ = write!(text, "{name:<28}");
        for (key, _) in &columns {
            let value = tally.parameters.get(*key).and_then(figure);
            let _ = write!(text, " {:>10}", or_dash(value.map(|v| scale * v), decimals));
        }
        let _ = writeln!(text);
    }
}
