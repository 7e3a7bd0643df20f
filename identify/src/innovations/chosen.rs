//! The structure, chosen on the parts of a record that tell most, and what was before the record: step 2 of the [module](super).

use std::ops::Range;

use super::choose::{Choice, Limits, NEARLY, choose};
use super::likelihood::Evaluation;
use super::record::{Blocks, Hold, Record, Rest};
use super::search;
use super::theta::{NoiseKind, Theta};
use super::{LONGEST_TAU, ROWS, spectrum};
use crate::progress;
use crate::remark::Remark;
use crate::settings::Options;
use crate::signals::{begins_with_a_step, is_constant};

/// Time at the start whose outputs are left out while the dead time is not known, as a share of the record. Most records
/// begin with the input at rest, and some with all their excitation.
const SKIPPED: f64 = 1.0 / 40.0;
/// Most rows of the final fit: they take a few seconds.
const MOST_ROWS: usize = 40_000;
/// Most samples of the part that chooses the structure.
const CHOOSING: usize = 20_000;
/// Uneven time stamps are rounded to this part of the sample period while the structure is chosen.
const CHOOSING_STAMP: f64 = 1.0 / 16.0;
/// Samples between the outputs of a second difference that shows how much such a part moves: several periods of what moves
/// it, and less of its noise than between neighbours.
const CURVED: usize = CHOOSING / 100;
/// Fewest samples of a part that chooses.
const LEAST_PART: usize = 300;
/// Starts that are descended for each hypothesis about the state at the start.
const DESCENDED: usize = 2;
/// Difference of the log-likelihood above which the input is taken as straight lines between the samples.
const STRAIGHT: f64 = 3.0;

/// Shares of the time after the choice with an unknown start, and after the start was judged.
const FREE: f64 = 0.65;
const RESTED: f64 = 0.9;

/// Step 2, with the state at the start unknown, and at rest if that explains the whole record better, which the record then
/// keeps; unless it is known.
pub(super) fn choose_start(
    record: &mut Record,
    limits: &Limits,
    options: &Options,
    remarks: &mut Vec<Remark>,
) -> Option<(Range<usize>, Choice)> {
    let mut of_free = vec![];
    let free = progress::part(0.0..FREE, || {
        choose_on_parts(record, limits, options, &[], &mut of_free)
    });
    if record.rest.is_none() && !options.is_under_way {
        let choice = free.as_ref().map(|(_, choice)| choice);
        let at_rest = record.at_rest(true).rounded(CHOOSING_STAMP);
        let mut starts = search::screen_whole(&at_rest, limits.structure, limits.longest_tau_s);
        starts.extend(choice.and_then(Choice::chosen).map(|of| of.found.theta));
        let before = progress::part(FREE..RESTED, || before(record, limits, &starts));
        let mut limits = *limits;
        match before {
            Before::Rest { may_drift } => *record = record.at_rest(may_drift),
            Before::Another { skip_s } if skip_s > SKIPPED * record.time_s(record.len() - 1) => {
                limits.skip_s = skip_s;
            }
            _ => {
                remarks.append(&mut of_free);
                return free;
            }
        }
        starts.extend(choice.iter().flat_map(|choice| choice.thetas()));
        let again = progress::part(RESTED..1.0, || {
            choose_on_parts(record, &limits, options, &starts, remarks)
        });
        return again.or(free);
    }
    remarks.append(&mut of_free);
    free
}

/// What was before a record.
enum Before {
    /// Rest under the first input, where an integrator may drift or not.
    Rest { may_drift: bool },
    /// Any state under the first input, or under another one of which nothing shows.
    Unknown,
    /// Another input, whose effect lasts until `skip_s`.
    Another { skip_s: f64 },
}

/// What explains the beginning of a record best, from each of `thetas`.
fn before(record: &Record, limits: &Limits, thetas: &[Theta]) -> Before {
    let longest_tau_s = limits.longest_tau_s;
    let rows = thetas.iter().map(|theta| rows_for(record, theta).0);
    let Some(samples) = rows.min() else {
        return Before::Unknown;
    };
    let all = (record.len() / samples) as f64;
    let bic = |theta: &Theta, at: &Evaluation| at.profile_bic(theta.free().len(), all);
    let fit = |blocks: &Blocks<'_>, theta: &Theta| {
        search::warm(blocks, theta, longest_tau_s, search::CHOOSING)
    };
    // On all rows, the first ones too.
    let least = |of: &Record| {
        let blocks = Blocks::from(of, samples, 0);
        let starts = search::ranked(&blocks, thetas.iter().copied(), longest_tau_s, bic);
        let fits = starts.iter().take(DESCENDED).filter_map(|(_, theta)| {
            let found = fit(&blocks, theta)?;
            Some((bic(&found.theta, &found.at), found.theta))
        });
        fits.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let at_rest = least(&record.at_rest(true));
    let least_bic = |found: Option<(f64, Theta)>| found.map_or(f64::INFINITY, |(bic, _)| bic);
    // Another constant input is one unknown more. What comes of it ends with the dead time: the rows before are as likely as those
    // after it, by chance three deviations of their chi-squared more.
    let after = |theta: &Theta| {
        let skip_s = rows_for(record, theta).1;
        let found = fit(&Blocks::new(record, samples, skip_s), theta)?;
        let bic = found.at.profile_bic(theta.free().len() + 1, all);
        let chance = 3.0 * (2.0 * (all - found.at.rows() as f64)).max(0.0).sqrt();
        let is_told = !is_constant(&record.input[record.skipped(skip_s)..]);
        is_told.then_some((bic + chance + NEARLY, skip_s))
    };
    let at_rest_theta = at_rest.map(|(_, theta)| theta);
    let of_another = thetas.last().into_iter().chain(&at_rest_theta);
    let another = (of_another.filter_map(after)).min_by(|a, b| a.0.total_cmp(&b.0));
    // Few rows before a step hardly tell that they are at rest, but who records one waits for it.
    let still = begins_with_a_step(&record.input).then(|| least(&record.at_rest(false)));
    let still = still.map_or(f64::INFINITY, least_bic);
    let (at_rest, unknown) = (least_bic(at_rest), least_bic(least(record)));
    match another {
        Some((bic, skip_s)) if bic < at_rest.min(unknown) => Before::Another { skip_s },
        _ if still < at_rest.min(unknown) + NEARLY => Before::Rest { may_drift: false },
        _ if at_rest < unknown => Before::Rest { may_drift: true },
        _ => Before::Unknown,
    }
}

/// Step 2: the choice on the part of a record that tells most, and this part. The searches begin at `starts`, or where a
/// screening says.
pub(super) fn choose_on_parts(
    record: &mut Record,
    limits: &Limits,
    options: &Options,
    starts: &[Theta],
    remarks: &mut Vec<Remark>,
) -> Option<(Range<usize>, Choice)> {
    let mut choices = Vec::new();
    let mut parts = excited_parts(record);
    let mut done = 0.0;
    while let Some(part) = parts.pop() {
        // The part and those that are left share what is to do; one more may be found in it.
        let end = done + (1.0 - done) / (parts.len() + 1) as f64;
        let choice = progress::part(done..end, || {
            choose_on(record, part.clone(), limits, options, starts, remarks)
        });
        done = end;
        let Some(choice) = choice else {
            continue;
        };
        // Rows longer than the shortest lag do not show it: a shorter part has shorter rows.
        let row_s = choice.samples as f64 * record.dt_s;
        let shortest_s = (choice.chosen()).map(|found| found.found.theta.shortest_lag_s());
        let length = part.len() / search::ZOOM;
        if choice.samples > limits.fewest_samples
            && length > LEAST_PART
            && shortest_s.is_some_and(|lag_s| lag_s < 2.0 * row_s)
        {
            let inside = search::liveliest(&record.part(part.clone()), length);
            parts.push(part.start + inside.start..part.start + inside.end);
        }
        choices.push((part, choice));
    }
    most_likely(choices, record, limits.longest_tau_s)
}

/// Step 2 on a part of a record, whose input is taken as straight lines from then on if that explains the part better.
fn choose_on(
    record: &mut Record,
    part: Range<usize>,
    limits: &Limits,
    options: &Options,
    starts: &[Theta],
    remarks: &mut Vec<Remark>,
) -> Option<Choice> {
    let mut part = record.part(part).rounded(CHOOSING_STAMP);
    let samples = Blocks::new(&part, 1, 0.0);
    let slowest_s = spectrum::slowest_s(&samples).unwrap_or(f64::INFINITY);
    let period_s = spectrum::period_s(&samples).unwrap_or(f64::INFINITY);
    // At rest before the record, at rest where a part begins: the input moves where the part tells most.
    part.rest = part.rest.or(record.rest.map(|_| Rest {
        input: part.input[0],
        may_drift: true,
    }));
    let length_s = part.time_s(part.len() - 1);
    let limits = Limits {
        skip_s: limits.skip_s.max(SKIPPED * length_s),
        longest_tau_s: limits.longest_tau_s.min(LONGEST_TAU * length_s),
        slowest_s,
        period_s,
        ..*limits
    };
    let mut choice = choose(&part, &limits, starts);
    if record.hold == Hold::Held
        && let Some(gain) = straight(&part, &choice, &limits, options)
    {
        record.hold = Hold::Interpolated;
        part.hold = Hold::Interpolated;
        remarks.push(Remark::Interpolated(gain));
        choice = choose(&part, &limits, starts);
    }
    choice.chosen().is_some().then_some(choice)
}

/// The parts of a long record that choose the structure: all of it for slow lags, that with the largest curvature of the output, and
/// that with the largest changes of the input for fast ones, since the rows of a longer part would be longer than they are. In a
/// chirp the last one has the highest frequencies, to which the process hardly answers.
fn excited_parts(record: &Record) -> Vec<Range<usize>> {
    if record.len() <= CHOOSING {
        return std::iter::once(0..record.len()).collect();
    }
    let of_input = |part: &Range<usize>| -> f64 {
        let pairs = record.input[part.clone()].windows(2);
        pairs.map(|pair| (pair[1] - pair[0]).powi(2)).sum()
    };
    // Second differences, since an output may drift at any rate.
    let of_output = |part: &Range<usize>| -> f64 {
        let triples = record.output[part.clone()].windows(2 * CURVED + 1);
        triples
            .map(|y| (y[0] - 2.0 * y[CURVED] + y[2 * CURVED]).powi(2))
            .sum()
    };
    let largest = |size: &dyn Fn(&Range<usize>) -> f64| {
        (0..=record.len() - CHOOSING)
            .step_by(CHOOSING / 2)
            .map(|start| start..start + CHOOSING)
            .max_by(|a, b| size(a).total_cmp(&size(b)))
    };
    let mut parts: Vec<Range<usize>> = largest(&of_input).into_iter().collect();
    parts.extend(largest(&of_output).filter(|part| !parts.contains(part)));
    parts.push(0..record.len());
    parts
}

/// The choice that explains the whole record best.
fn most_likely(
    mut choices: Vec<(Range<usize>, Choice)>,
    record: &Record,
    longest_tau_s: f64,
) -> Option<(Range<usize>, Choice)> {
    if choices.len() == 1 {
        return choices.pop();
    }
    let thetas: Vec<Theta> = (choices.iter())
        .filter_map(|(_, choice)| Some(choice.chosen()?.found.theta))
        .collect();
    // Likelihoods of different rows do not compare.
    let rows = thetas.iter().map(|theta| rows_for(record, theta));
    let (samples, skip_s) = rows.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    let blocks = Blocks::new(record, samples, skip_s);
    let bic = |theta: &Theta| {
        let found = search::fit(&blocks, theta, longest_tau_s);
        found.map_or(f64::INFINITY, |found| found.bic)
    };
    let bics: Vec<f64> = thetas.iter().map(bic).collect();
    let best = (0..bics.len()).min_by(|a, b| bics[*a].total_cmp(&bics[*b]))?;
    Some(choices.swap_remove(best))
}

/// Samples a row of the fit to a record, and the time at its start (s) whose output is not used.
pub(super) fn rows_for(record: &Record, theta: &Theta) -> (usize, f64) {
    let length_s = record.time_s(record.len() - 1);
    let tau_s = theta.tau_s().max(0.0);
    let skip_s = (1.5 * tau_s + 2.0 * record.dt_s).min(LONGEST_TAU * length_s);
    let rows = record.len() - record.skipped(skip_s);
    let fastest_noise = NoiseKind::ALL.map(|kind| theta.noise(kind));
    let noise_s = 1.0 / fastest_noise.into_iter().fold(0.0, f64::max);
    let fast_s = theta.shortest_lag_s().min(noise_s).min(length_s) + tau_s;
    let samples = (rows / ROWS).min((fast_s / record.dt_s) as usize);
    (samples.max(rows.div_ceil(MOST_ROWS)).max(1), skip_s)
}

/// Gain of the log-likelihood if the input runs straight from sample to sample, where that explains the record better.
/// `None` otherwise, and if the input is piecewise constant or the user has said what it does.
pub(super) fn straight(
    record: &Record,
    choice: &Choice,
    limits: &Limits,
    options: &Options,
) -> Option<f64> {
    if options.hold.is_some() || record.keeps_its_input() {
        return None;
    }
    let lead = choice.candidates.first()?;
    let mut other = record.clone();
    other.hold = Hold::Interpolated;
    let blocks = Blocks::new(&other, choice.samples, limits.skip_s);
    // Half a sample lies between the two readings of the input.
    let mut theta = lead.found.theta;
    theta.values[theta.layout().tau()] += 0.5 * record.dt_s;
    let fitted = search::warm(&blocks, &theta, limits.longest_tau_s, search::FINE)?;
    let gain = fitted.at.log_likelihood - lead.found.at.log_likelihood;
    (gain > STRAIGHT).then_some(gain)
}
