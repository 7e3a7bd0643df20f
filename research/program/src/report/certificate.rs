//! The certificate of a space of processes, or of single ones: as text and as JSON; `page` has the figures.

mod page;

use std::fmt::Write;

use onecycle_cli::report::json;
use onecycle_cli::report::number::significant;
use onecycle_cli::style::{HEADING, REFUSAL, headed, painted, verdict};
use onecycle_lab::space::Space;
use onecycle_lab::space::certificate::{
    Certificate, CertificateSummary, CycleStability, RelayCounts,
};
use onecycle_lab::space::limit_cycle::LimitCycle;
use onecycle_lab::space::limit_cycle::sampled::Motion;
use serde_json::{Value, json};

use crate::results::certify::{BiasRow, CertifiedProcess, CertifiedSpace, SampledRelay};

pub(crate) use self::page::html;

/// The certificate of a space as text.
pub(crate) fn text(certified: &CertifiedSpace) -> String {
    let mut text = String::new();
    let CertifiedSpace { space, rows, .. } = certified;
    let range = |(low, high): (f64, f64)| format!("{low} .. {high} s");
    text.push_str(&headed(&format!(
        "Space   T_prop {}, T_body {}, tau {}\nRelay   beta {}, {:.2} deg\n\n",
        range(space.t_prop_s),
        range(space.t_body_s),
        range(space.tau_s),
        space.beta,
        space.beta.asin().to_degrees(),
    )));
    without_bias(&mut text, certified);
    corners(&mut text, space, &certified.corners);
    under_bias(&mut text, rows);
    let holds = certified.holds();
    let _ = writeln!(text, "\n{}", verdict(holds, holds_text(holds)));
    text
}

/// The verdict in one sentence.
fn holds_text(holds: bool) -> &'static str {
    if holds {
        "Certified: stable without bias, and with the trim under every bias above."
    } else {
        "Not certified: some processes have no stable cycle."
    }
}

fn without_bias(text: &mut String, certified: &CertifiedSpace) {
    let shapes = certified.unbiased.len();
    let one = certified
        .unbiased
        .iter()
        .filter(|certificate| CycleStability::of(&certificate.bare) == CycleStability::Stable)
        .count();
    let worst = &certified.least_stable;
    let [t_prop, t_body, tau] = worst.times_s.map(significant);
    let _ = writeln!(
        text,
        "{}, {shapes} shapes of processes (the time scale plays no part)\n  \
         exactly one stable limit cycle: {one} of {shapes}\n  \
         least stable: T_prop {t_prop} s, T_body {t_body} s, tau {tau} s\n    \
         where {} of a deviation is left after a cycle",
        painted(HEADING, "Without bias"),
        percent(worst.spectral_radius),
    );
    let _ = writeln!(
        text,
        "  exact period over the describing function's: {}; amplitude: {}\n",
        span_of_ratios(certified, |(period, _)| period),
        span_of_ratios(certified, |(_, amplitude)| amplitude),
    );
}

/// Range of exact periods or amplitudes over those of the describing function, of all shapes.
fn span_of_ratios(certified: &CertifiedSpace, of: fn((f64, f64)) -> f64) -> String {
    let ratios = (certified.unbiased.iter()).filter_map(Certificate::describing_function_ratios);
    span(ratios.map(of))
}

/// `low .. high` of the values.
fn span(values: impl Iterator<Item = f64> + Clone) -> String {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    if low <= high {
        format!("{low:.3} .. {high:.3}")
    } else {
        "-".to_owned()
    }
}

fn percent(share: f64) -> String {
    if share.is_finite() {
        format!("{:.1} %", 100.0 * share)
    } else {
        "-".to_owned()
    }
}

fn corners(text: &mut String, space: &Space, corners: &[Certificate]) {
    let _ = writeln!(
        text,
        "{}, and the describing function's error (velocity gain and relay \
         amplitude 1)\n  \
         T_prop   T_body   tau        period (s)     DF           amplitude     DF        left\n  \
         (s)      (s)      (s)        exact          error        exact         error     a cycle",
        painted(HEADING, "Corners of the space"),
    );
    for certificate in corners {
        let [t_prop, t_body, tau] = certificate.times_s;
        let Some((cycle, (period, amplitude))) = certificate
            .unbiased
            .zip(certificate.describing_function_ratios())
        else {
            let _ = writeln!(
                text,
                "  {t_prop:<8} {t_body:<8} {tau:<10} no limit cycle at beta {}",
                space.beta
            );
            continue;
        };
        let _ = writeln!(
            text,
            "  {t_prop:<8} {t_body:<8} {tau:<10} {:<14} {:<12} {:<13} {:<9} {}",
            significant(cycle.period_s()),
            error(period),
            significant(cycle.amplitude),
            error(amplitude),
            percent(cycle.spectral_radius),
        );
    }
}

/// Error of the describing function; `ratio` is the exact value over that of the describing function.
fn error(ratio: f64) -> String {
    format!("{:+.1} %", 100.0 * (ratio.recip() - 1.0))
}

fn under_bias(text: &mut String, rows: &[BiasRow]) {
    let processes = rows.first().map_or(0, |row| row.summary.processes);
    let _ = writeln!(
        text,
        "\n{}, in amplitudes of the relay; counts of {processes} processes, stable periods in \
         those\nwithout bias, and the largest part of a deviation that is left after a cycle\n        \
         bare relay                         turning back              with trim   simulated, settled\n  \
         bias  stable unstable none periods       cycles periods            stable left   untrimmed trimmed",
        painted(HEADING, "Under a bias"),
    );
    for row in rows {
        let summary = &row.summary;
        let RelayCounts {
            stable,
            coexisting,
            unstable,
            no_cycle,
            ..
        } = summary.bare;
        let cycles = cycle_count(summary);
        let _ = writeln!(
            text,
            "  {:<5} {:<6} {unstable:<8} {no_cycle:<4} {:<13} {cycles:<6} {:<18} {:<6} {:<7} {:<9} {}",
            summary.bias,
            stable + coexisting,
            stretch(&summary.bare),
            stretch(&summary.turned_back),
            summary.trimmed,
            summary.trimmed_radius.map_or("-".to_owned(), percent),
            row.settled[0],
            row.settled[1],
        );
    }
}

/// Fewest and most stable cycles of the relay that turns back.
fn cycle_count(summary: &CertificateSummary) -> String {
    match summary.turned_back.stable_cycles {
        (fewest, most) if fewest == most => fewest.to_string(),
        (fewest, most) => format!("{fewest}..{most}"),
    }
}

fn stretch(kind: &RelayCounts) -> String {
    kind.stretch.map_or("-".to_owned(), |(low, high)| {
        format!("{low:.2} .. {high:.2}")
    })
}

/// The certificate of a space as JSON.
pub(crate) fn json(certified: &CertifiedSpace) -> String {
    let worst = &certified.least_stable;
    let [t_prop_s, t_body_s, tau_s] = worst.times_s;
    let rows: Vec<Value> = certified
        .rows
        .iter()
        .map(|row| {
            json!({
                "certified": row.summary,
                "simulated_settled": { "untrimmed": row.settled[0], "trimmed": row.settled[1] },
            })
        })
        .collect();
    json::to_text(&json!({
        "schema": "onecycle.certificate/1",
        "space": certified.space,
        "holds": certified.holds(),
        "least_stable": {
            "t_prop_s": t_prop_s,
            "t_body_s": t_body_s,
            "tau_s": tau_s,
            // It is infinite without a cycle.
            "spectral_radius": worst.spectral_radius.is_finite().then_some(worst.spectral_radius),
        },
        "corners": certified.corners.iter().map(corner).collect::<Vec<_>>(),
        "biases": rows,
    }))
}

fn corner(certificate: &Certificate) -> Value {
    let [t_prop_s, t_body_s, tau_s] = certificate.times_s;
    json!({
        "t_prop_s": t_prop_s,
        "t_body_s": t_body_s,
        "tau_s": tau_s,
        "period_s": certificate.unbiased.map(|cycle| cycle.period_s()),
        "amplitude": certificate.unbiased.map(|cycle| cycle.amplitude),
        "spectral_radius": certificate.unbiased.map(|cycle| cycle.spectral_radius),
        "describing_function": certificate.describing_function.map(|(period_s, amplitude)| {
            json!({ "period_s": period_s, "amplitude": amplitude })
        }),
    })
}

/// The certificates of single processes as text.
pub(crate) fn processes(processes: &[CertifiedProcess]) -> String {
    let mut text = String::new();
    for process in processes {
        let [t_prop, t_body, tau] = process.times_s;
        text.push_str(&headed(&format!(
            "Process  T_prop {t_prop} s, T_body {t_body} s, tau {tau} s, velocity gain 1; relay \
             amplitude 1, beta {}\n",
            process.beta
        )));
        for (certificate, sampled) in &process.biases {
            one_bias(&mut text, certificate);
            if let Some(sampled) = sampled {
                sampled_relay(&mut text, sampled);
            }
        }
        text.push('\n');
    }
    text
}

fn one_bias(text: &mut String, certificate: &Certificate) {
    let bias = certificate.bias;
    if let Some((period_s, amplitude)) = certificate.describing_function {
        let _ = writeln!(
            text,
            "  bias {bias}\n    describing function  period {} s, amplitude {}{}",
            significant(period_s),
            significant(amplitude),
            if bias == 0.0 { "" } else { ", without bias" },
        );
    }
    if certificate.bare.is_empty() {
        let _ = writeln!(
            text,
            "    bare relay           no limit cycle of two switches"
        );
    }
    for cycle in &certificate.bare {
        let _ = writeln!(text, "    bare relay           {}", described(cycle));
    }
    for (halvings, cycle) in &certificate.turned_back {
        let _ = writeln!(
            text,
            "    turned back, 1/{:<5} {}",
            1_u32 << halvings,
            described(cycle)
        );
    }
    if let (Some(radius), true) = (certificate.trimmed, bias != 0.0) {
        let _ = writeln!(
            text,
            "    with trim            as without bias, {} left after a cycle",
            percent(radius)
        );
    }
}

fn described(cycle: &LimitCycle) -> String {
    format!(
        "period {} s (high {} s), amplitude {}, {} left after a cycle{}",
        significant(cycle.period_s()),
        significant(cycle.high_s),
        significant(cycle.amplitude),
        percent(cycle.spectral_radius),
        if cycle.is_stable() {
            String::new()
        } else {
            painted(REFUSAL, ": unstable")
        },
    )
}

fn sampled_relay(text: &mut String, sampled: &SampledRelay) {
    let sample_s = sampled.sample_s;
    for cycle in &sampled.cycles {
        let _ = writeln!(
            text,
            "    sampled              period {} s ({} samples), amplitude {}",
            significant(f64::from(2 * cycle.half_period) * sample_s),
            2 * cycle.half_period,
            significant(cycle.amplitude),
        );
    }
    let settled = match &sampled.motion {
        None => return,
        Some(Motion::Stopped) => "the bare relay stops switching".to_owned(),
        Some(Motion::Wandering { period, mean }) => format!(
            "no repetition: periods of {} .. {} samples, {mean:.1} in the mean",
            period.0, period.1
        ),
        Some(Motion::Pattern(cycles)) => {
            let samples: u32 = cycles.iter().map(|(high, low)| high + low).sum();
            format!(
                "a pattern of {} cycle(s), mean period {} s",
                cycles.len(),
                significant(f64::from(samples) * sample_s / cycles.len() as f64)
            )
        }
    };
    let _ = writeln!(text, "    sampled, from rest   {settled}");
}
