//! The tables of a campaign.

pub(crate) mod honesty;
pub(crate) mod recording;

use std::fmt::Write;

use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_lab::experiments::Campaign;
use onecycle_lab::experiments::DefectKind;
use onecycle_lab::judge::bound::BOUND_DRAWS;
use onecycle_lab::judge::evaluate::{Costs, quantile};
use onecycle_lab::judge::out_of_family::CYCLES;
use onecycle_lab::judge::promises::PROMISES;
use onecycle_onboard::refine::coordinate;

use crate::results::campaign::{IdentificationCase, OutsiderCase, RelayCase};

/// A quantile as text, `-` without values.
fn quantile_text(values: &mut [f64], q: f64, decimals: usize) -> String {
    or_dash(quantile(values, q), decimals)
}

/// A value as text, `-` without one.
fn or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
}

fn on_or_off(is_on: bool) -> &'static str {
    if is_on { "on" } else { "off" }
}

/// Table of the relay: how many cases reached a steady oscillation.
pub(crate) fn relay(campaign: &Campaign, cases: &[RelayCase]) -> String {
    let steady = cases.iter().filter(|case| case.steady_at.is_some()).count();
    let run_away = cases.iter().filter(|case| !case.alive).count();
    let undone: u32 = cases.iter().map(|case| case.undone).sum();
    let mut at: Vec<f64> = cases
        .iter()
        .filter_map(|case| case.steady_at)
        .map(f64::from)
        .collect();
    let mut ratio: Vec<f64> = cases.iter().map(|case| case.period_ratio).collect();
    let mut farthest: Vec<f64> = cases.iter().map(|case| case.excursion).collect();
    format!(
        "{} random processes, bias up to {} h, noise up to {} of the amplitude, offset {}, trim {}\n\
         steady oscillation      {steady} ({:.2} %)\n\
         run away                {run_away}\n\
         cycles until steady     median {}, 99 % {}, most {}\n\
         period / describing fn  {} .. {}, median {}\n\
         farthest / amplitude    median {}, most {}\n\
         switches taken back     {undone}\n",
        cases.len(),
        campaign.bias,
        campaign.sigma,
        campaign.offset,
        on_or_off(campaign.trim),
        100.0 * steady as f64 / cases.len() as f64,
        quantile_text(&mut at, 0.5, 0),
        quantile_text(&mut at, 0.99, 0),
        quantile_text(&mut at, 1.0, 0),
        quantile_text(&mut ratio, 0.0, 2),
        quantile_text(&mut ratio, 1.0, 2),
        quantile_text(&mut ratio, 0.5, 2),
        quantile_text(&mut farthest, 0.5, 1),
        quantile_text(&mut farthest, 1.0, 1),
    )
}

/// Table of the identification: errors, intervals and cost.
pub(crate) fn identification(campaign: &Campaign, cases: &[IdentificationCase]) -> String {
    let held: Vec<[bool; 6]> = cases.iter().filter_map(|case| case.held).collect();
    let refused = cases.len() - held.len();
    let costs = Costs::of(cases.iter().map(IdentificationCase::deterioration));
    let percent = |cost: Option<f64>, decimals| or_dash(cost.map(|cost| 100.0 * cost), decimals);
    let bound = error_over_bound(cases);
    let at_bound = at_bound(cases);
    let [k, k_over_t_body, t_prop, t_body, tau, bias] = coverage(&held);
    let promised: Vec<_> = (cases.iter())
        .filter_map(|case| case.promises_held)
        .collect();
    let shares = PROMISES.into_iter().zip(coverage(&promised));
    let promised: Vec<String> = shares
        .map(|(name, share)| format!("{name} {share:.1}"))
        .collect();
    let promised = promised.join(", ");
    format!(
        "{} random processes, bias up to {} h, noise {}{} of the amplitude, trim {}, {} cycle(s)\n\
         refused                 {refused}\n\
         unstable                {}\n\
         deterioration |J| (%)   mean {}, median {}, 95 % {}, 99 % {}, worst {}\n\
         the same at the bound   {at_bound}\n\
         least phase margin      {} deg\n\
         90 % intervals hold (%) K {k:.1}, K/T_body {k_over_t_body:.1}, T_prop {t_prop:.1}, \
         T_body {t_body:.1}, tau {tau:.1}, bias {bias:.1}\n\
         of the controller   (%) {promised}\n\
         error / Cramer-Rao      {bound}\n",
        cases.len(),
        campaign.bias,
        if campaign.sigma_uniform { "up to " } else { "" },
        campaign.sigma,
        on_or_off(campaign.trim),
        campaign.cycles,
        costs.unstable,
        percent(costs.mean, 3),
        percent(costs.median, 3),
        percent(costs.percentile_95, 2),
        percent(costs.percentile_99, 2),
        percent(costs.worst, 2),
        or_dash(costs.least_phase_margin_deg, 1),
    )
}

/// Shares of the cases that hold (%).
fn coverage<const N: usize>(held: &[[bool; N]]) -> [f64; N] {
    std::array::from_fn(|k| {
        let count = held.iter().filter(|held| held[k]).count();
        100.0 * count as f64 / held.len().max(1) as f64
    })
}

/// Root mean squares of the errors over their standard deviations.
fn error_over_bound(cases: &[IdentificationCase]) -> String {
    let errors: Vec<_> = cases
        .iter()
        .filter_map(|case| case.squared_errors)
        .collect();
    let rms = |k: usize| {
        let sum = errors.iter().map(|squares| squares[k]).sum::<f64>();
        (sum / errors.len().max(1) as f64).sqrt()
    };
    format!(
        "pole sum {:.2}, pole ratio {:.2}, tau {:.2}, gain {:.2} (of {} cases)",
        rms(coordinate::LN_POLE_SUM),
        rms(coordinate::POLE_RATIO),
        rms(coordinate::TAU_S),
        rms(coordinate::LN_JERK_GAIN),
        errors.len()
    )
}

/// Cost of the controllers of an ideal estimator: medians over as many campaigns as there are draws, and the range of the
/// worst.
fn at_bound(cases: &[IdentificationCase]) -> String {
    let draws = |draw: usize| {
        let costs = cases.iter().filter_map(|case| case.bound);
        Costs::of(costs.map(|costs| costs[draw].map(Deterioration::from)))
    };
    let campaigns: [Costs; BOUND_DRAWS] = std::array::from_fn(draws);
    let text = |of: fn(&Costs) -> Option<f64>, q: f64, decimals| {
        let mut values: Vec<f64> = campaigns.iter().filter_map(of).map(|v| 100.0 * v).collect();
        quantile_text(&mut values, q, decimals)
    };
    let worst = |costs: &Costs| costs.worst;
    format!(
        "mean {}, median {}, 95 % {}, 99 % {}, worst {} ({} to {})",
        text(|costs| costs.mean, 0.5, 3),
        text(|costs| costs.median, 0.5, 3),
        text(|costs| costs.percentile_95, 0.5, 2),
        text(|costs| costs.percentile_99, 0.5, 2),
        text(worst, 0.5, 2),
        text(worst, 0.0, 2),
        text(worst, 1.0, 2),
    )
}

/// Table of processes in the family and of each kind out of it.
pub(crate) fn unknown(campaign: &Campaign, rows: &[(DefectKind, Vec<OutsiderCase>)]) -> String {
    let mut text = format!(
        "{} random processes with each defect, bias up to {} h, noise up to {} of the amplitude, trim {}\n\
         refused: not identified from {} cycles; harmful: identified, but the controller costs over 10 % \
         more\nthan predicted; silent: harmful, and no remark is about the recording\n",
        campaign.cases,
        campaign.bias,
        campaign.sigma,
        on_or_off(campaign.trim),
        CYCLES.map(|cycles| cycles.to_string()).join(", "),
    );
    let of_cycles: String = CYCLES
        .map(|cycles| format!("  refused {cycles} harmful {cycles} silent {cycles}"))
        .concat();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{:<13} cases unsteady  harmful unknown  harmless unknown{of_cycles}",
        "kind"
    );
    for (kind, cases) in rows {
        let unsteady = cases.iter().filter(|case| !case.is_steady).count();
        let _ = write!(text, "{:<13} {:5} {unsteady:8}", kind.name(), cases.len());
        for harmful in [true, false] {
            let [all, unknown] = by_score(cases, harmful);
            let _ = write!(text, "  {all:8} {unknown:7}");
        }
        for k in 0..CYCLES.len() {
            let [refused, harmful, silent] = by_identification(cases, k);
            let _ = write!(text, "  {refused:9} {harmful:9} {silent:8}");
        }
        text += "\n";
    }
    text
}

/// Cases with a score that are harmful, or not: all of them, and those judged unknown.
fn by_score(cases: &[OutsiderCase], harmful: bool) -> [usize; 2] {
    let scored = || {
        (cases.iter())
            .filter_map(|case| case.scored)
            .filter(move |scored| scored.is_harmful == harmful)
    };
    let unknown = scored().filter(|scored| !scored.is_known);
    [scored().count(), unknown.count()]
}

/// Cases refused by the identification of a number of cycles, those accepted but harmful, and of these the silent ones.
fn by_identification(cases: &[OutsiderCase], k: usize) -> [usize; 3] {
    let accepted = || cases.iter().filter_map(move |case| case.accepted[k]);
    let harmful = || accepted().filter(|accepted| accepted.is_harmful);
    let silent = harmful().filter(|accepted| accepted.is_silent);
    [
        cases.len() - accepted().count(),
        harmful().count(),
        silent.count(),
    ]
}
