//! The table of a campaign of wrong data.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use onecycle_design::Parameter;
use onecycle_lab::experiments::HonestyCampaign;
use onecycle_lab::experiments::honesty::Kind;
use onecycle_lab::judge::honesty::{Accepted, Broken, HonestyOutcome, HonestyTally};

use serde::Serialize;

use super::{or_dash, quantile_text};

/// A case in JSON.
#[derive(Serialize)]
pub(crate) struct Named<'a> {
    kind: &'a str,
    case: usize,
    /// Whether a remark names the trouble.
    is_named: bool,
    outcome: &'a HonestyOutcome,
}

/// The outcomes with their kinds.
pub(crate) fn named<'a>(
    campaign: &'a HonestyCampaign,
    outcomes: &'a [HonestyOutcome],
) -> Vec<Named<'a>> {
    let of_kind = |(kind, outcomes): OfKind<'a>| {
        let is_named = |outcome: &HonestyOutcome| {
            outcome
                .accepted()
                .is_some_and(|of| of.is_named(&kind.named_by))
        };
        (outcomes.into_iter().enumerate()).map(move |(case, outcome)| Named {
            kind: &kind.name,
            case,
            is_named: is_named(outcome),
            outcome,
        })
    };
    kinds(campaign, outcomes).flat_map(of_kind).collect()
}

/// One line for each kind, the sums beside the targets, then every promise that was broken without a naming remark.
/// Writing to a string cannot fail.
pub(crate) fn table(campaign: &HonestyCampaign, outcomes: &[HonestyOutcome]) -> String {
    let mut text = format!(
        "{} recordings of each of {} kinds; wrong: a promise does not hold on the real plant\n\n\
         | kind | recordings | refused | named | other remark: right, wrong | silent: right, wrong | unstable | of these not named |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
        campaign.cases,
        campaign.kinds.len(),
    );
    let kinds: Vec<_> = kinds(campaign, outcomes).collect();
    let [mut control, mut faulty] = [HonestyTally::default(); 2];
    for (kind, outcomes) in &kinds {
        let mut tally = HonestyTally::default();
        for outcome in outcomes {
            tally.add(outcome, &kind.named_by);
        }
        row(&mut text, &kind.name, &tally);
        let sum = if kind.control {
            &mut control
        } else {
            &mut faulty
        };
        *sum = sum.and(tally);
    }
    let all = control.and(faulty);
    row(&mut text, "**right data**", &control);
    row(&mut text, "**wrong data**", &faulty);
    row(&mut text, "all", &all);
    targets(&mut text, &control, &all);
    paper(&mut text, &kinds);
    right(&mut text, &kinds);
    remarks(&mut text, &kinds);
    text.push_str("\nwrong and not named (kind, case, strength, promised margin, true margin, remarks, what broke)\n");
    for (kind, outcomes) in &kinds {
        for (n, outcome) in outcomes.iter().enumerate() {
            if let Some(accepted) = outcome.accepted()
                && !accepted.broken.is_empty()
                && !accepted.is_named(&kind.named_by)
            {
                let _ = writeln!(text, "{}", line(&kind.name, n, accepted));
            }
        }
    }
    text
}

/// A kind with the outcomes of its cases.
type OfKind<'a> = (&'a Kind, Vec<&'a HonestyOutcome>);

fn accepted<'a>(kinds: &'a [OfKind<'a>]) -> impl Iterator<Item = (&'a Kind, &'a Accepted)> {
    let of = |(kind, outcomes): &'a OfKind<'a>| {
        let accepted = outcomes.iter().filter_map(|outcome| outcome.accepted());
        accepted.map(|accepted| (*kind, accepted))
    };
    kinds.iter().flat_map(of)
}

/// The paper's PD on the real plants.
fn paper(text: &mut String, kinds: &[OfKind<'_>]) {
    let margins: Vec<f64> = accepted(kinds)
        .filter_map(|(_, accepted)| accepted.paper_margin_deg)
        .collect();
    let below = |limit: f64| margins.iter().filter(|margin| **margin < limit).count();
    let _ = writeln!(
        text,
        "PD of the paper, 20 deg  {} judged, {} below 17 deg, {} unstable",
        margins.len(),
        below(17.0),
        below(0.0),
    );
}

/// Parameters whose intervals are counted.
const COUNTED: [Parameter; 5] = [
    Parameter::KOverTBody,
    Parameter::TProp,
    Parameter::TBody,
    Parameter::Tau,
    Parameter::InputBias,
];

/// Right data: how often each interval holds the truth, the cost of the paper's PD, and why recordings were refused.
fn right(text: &mut String, kinds: &[OfKind<'_>]) {
    let symbols = COUNTED.map(|parameter| format!(" {:>10}", parameter.symbol()));
    let _ = writeln!(
        text,
        "\n{:<34} accepted  90 % intervals hold (%)\n{:<34}         {}  |J| (%): median worst  unstable  refused",
        "right data",
        "",
        symbols.concat(),
    );
    for (kind, outcomes) in kinds.iter().filter(|(kind, _)| kind.control) {
        let accepted: Vec<&Accepted> = outcomes.iter().filter_map(|of| of.accepted()).collect();
        let shares = COUNTED.map(|parameter| {
            let held = accepted
                .iter()
                .filter_map(|found| found.held.get(parameter.key()));
            let (all, right) = held.fold((0, 0), |(all, right), &held| {
                (all + 1, right + u32::from(held))
            });
            let share = (all > 0).then(|| 100.0 * f64::from(right) / f64::from(all));
            format!(" {:>10}", or_dash(share, 1))
        });
        let costs = accepted.iter().filter_map(|found| found.deterioration);
        let mut costs: Vec<f64> = costs.map(|cost| 100.0 * cost).collect();
        let unstable = accepted.iter().filter(|found| found.is_unstable()).count();
        let line = format!(
            "{:<34} {:>8}{}  {:>15} {:>5}  {unstable:>8}  {}",
            kind.name,
            accepted.len(),
            shares.concat(),
            quantile_text(&mut costs, 0.5, 2),
            quantile_text(&mut costs, 1.0, 1),
            reasons(outcomes),
        );
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

/// Kinds of the verdicts, each with its number.
fn reasons(outcomes: &[&HonestyOutcome]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for outcome in outcomes {
        if let HonestyOutcome::Refused(reason) = outcome {
            *counts.entry(reason).or_default() += 1;
        }
    }
    let named = counts
        .iter()
        .map(|(reason, count)| format!("{reason} {count}"));
    named.collect::<Vec<_>>().join(", ")
}

/// How often each remark stands on accepted right and wrong data: one that stands on both alike tells nothing.
fn remarks(text: &mut String, kinds: &[OfKind<'_>]) {
    let mut counts: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    let mut all = [0; 2];
    for (kind, accepted) in accepted(kinds) {
        let group = usize::from(!kind.control);
        all[group] += 1;
        // One of each kind: a remark that names a parameter may stand there for several.
        for remark in accepted.remarks.iter().collect::<BTreeSet<_>>() {
            counts.entry(remark).or_default()[group] += 1;
        }
    }
    let percent = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
    let _ = writeln!(
        text,
        "\n{:<34} right data (%) wrong data (%)",
        "remark, of the accepted"
    );
    for (remark, [right, wrong]) in counts {
        let _ = writeln!(
            text,
            "{remark:<34} {:14.1} {:14.1}",
            percent(right, all[0]),
            percent(wrong, all[1]),
        );
    }
}

/// The kinds with the outcomes of their cases, which take turns.
fn kinds<'a>(
    campaign: &'a HonestyCampaign,
    outcomes: &'a [HonestyOutcome],
) -> impl Iterator<Item = OfKind<'a>> {
    let count = campaign.kinds.len();
    let of = move |number| outcomes.iter().skip(number).step_by(count).collect();
    (campaign.kinds.iter().enumerate()).map(move |(number, kind)| (kind, of(number)))
}

fn row(text: &mut String, name: &str, tally: &HonestyTally) {
    let _ = writeln!(
        text,
        "| {name} | {} | {} | {} | {}, {} | {}, {} | {} | {} |",
        tally.cases,
        tally.refused,
        tally.named,
        tally.remarked_right,
        tally.remarked_wrong,
        tally.silent_right,
        tally.silent_wrong,
        tally.unstable,
        tally.unstable_unnamed,
    );
}

fn targets(text: &mut String, control: &HonestyTally, all: &HonestyTally) {
    let percent =
        |count: usize, of: usize| or_dash((of > 0).then(|| 100.0 * count as f64 / of as f64), 1);
    let _ = writeln!(
        text,
        "\nsilent and wrong         {} % (target: 1 % at most)\n\
         unnamed and wrong        {} %\n\
         unstable and not named   {} (target: none)\n\
         right data refused       {} % (target: 3 % at most)",
        percent(all.silent_wrong, all.cases),
        percent(all.silent_wrong + all.remarked_wrong, all.cases),
        all.unstable_unnamed,
        percent(control.refused, control.cases),
    );
}

fn line(name: &str, n: usize, accepted: &Accepted) -> String {
    let degrees = |margin: Option<f64>| or_dash(margin, 1);
    let remarks = if accepted.remarks.is_empty() {
        "silent".to_owned()
    } else {
        accepted.remarks.join("+")
    };
    let broken: Vec<String> = accepted.broken.iter().map(broken).collect();
    format!(
        "{name} #{n}, {}, {} deg, {} deg, {}, {remarks}: {}",
        or_dash(accepted.strength, 4),
        degrees(accepted.promised_margin_deg),
        degrees(accepted.true_margin_deg),
        accepted.structure,
        broken.join("; ")
    )
}

fn broken(broken: &Broken) -> String {
    match broken {
        Broken::Unstable { limit_cycle: None } => "unstable".to_owned(),
        Broken::Unstable {
            limit_cycle: Some(amplitude),
        } => format!("limit cycle of {amplitude:.2} a"),
        Broken::Margin {
            promised_deg,
            true_deg,
        } => format!("margin {true_deg:.1} below {promised_deg:.1} deg"),
        Broken::FinalValue { truth } => format!("step of the PD ends at {truth:.2}"),
        Broken::Parameter {
            key,
            low,
            high,
            truth,
        } => format!(
            "{key} {truth:.5} not in {} to {}",
            or_dash(*low, 5),
            or_dash(*high, 5)
        ),
        _ => "another promise".to_owned(),
    }
}
