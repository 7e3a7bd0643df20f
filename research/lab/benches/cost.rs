//! One cost, one set of margins, one optimum (by search and from a table), one step response.

use divan::{Bencher, black_box};
use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::margins::margins;
use onecycle_design::soiptd_pd::optimum::{pd, pd_at_phase_margin};
use onecycle_design::soiptd_pd::step_response::step_response;
use onecycle_lab::learn::lead_table::{POINTS, build};
use onecycle_onboard::gains::LeadTable;
use onecycle_onboard::{Pd, Soiptd};

/// The paper's hover process, and a process dominated by its dead time, whose optimum lies above the
/// least margin.
const HOVER: (f64, f64, f64) = (0.0321, 1.6886, 0.0237);
const DELAYED: (f64, f64, f64) = (0.015, 0.2, 0.1);

const PHASE_MARGIN_RAD: f64 = std::f64::consts::PI / 9.0;

fn main() {
    divan::main();
}

fn process((t_prop_s, t_body_s, tau_s): (f64, f64, f64)) -> Soiptd {
    Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).expect("the times are positive")
}

fn best(process: &Soiptd) -> Pd {
    pd_at_phase_margin(process, PHASE_MARGIN_RAD)
        .expect("20 deg is a margin")
        .pd
}

#[divan::bench]
fn ise_of_a_pd(bencher: Bencher) {
    let process = process(HOVER);
    let pd = best(&process);
    bencher.bench(|| ise(black_box(&process), black_box(pd)));
}

#[divan::bench]
fn margins_of_a_pd(bencher: Bencher) {
    let process = process(HOVER);
    let pd = best(&process);
    bencher.bench(|| margins(black_box(&process), black_box(pd)));
}

#[divan::bench(args = [HOVER, DELAYED])]
fn optimum_at_phase_margin(bencher: Bencher, times: (f64, f64, f64)) {
    let process = process(times);
    bencher.bench(|| pd_at_phase_margin(black_box(&process), PHASE_MARGIN_RAD));
}

#[divan::bench(args = [HOVER, DELAYED])]
fn optimum_above_phase_margin(bencher: Bencher, times: (f64, f64, f64)) {
    let process = process(times);
    bencher.bench(|| pd(black_box(&process), PHASE_MARGIN_RAD));
}

/// From a table, as on the board.
#[divan::bench(args = [HOVER, DELAYED])]
fn tabled_at_phase_margin(bencher: Bencher, times: (f64, f64, f64)) {
    let numbers = build(PHASE_MARGIN_RAD, 0.0, POINTS).expect("20 deg is a margin");
    let table = LeadTable::from_floats(&numbers).expect("what is built is a table");
    let process = process(times);
    bencher.bench(|| table.pd_at_phase_margin(black_box(&process)));
}

/// From a table, as on the board.
#[divan::bench(args = [HOVER, DELAYED])]
fn tabled_above_phase_margin(bencher: Bencher, times: (f64, f64, f64)) {
    let numbers = build(PHASE_MARGIN_RAD, 0.0, POINTS).expect("20 deg is a margin");
    let table = LeadTable::from_floats(&numbers).expect("what is built is a table");
    let process = process(times);
    bencher.bench(|| table.pd(black_box(&process)));
}

#[divan::bench(args = [HOVER, DELAYED])]
fn step_response_until_settled(bencher: Bencher, times: (f64, f64, f64)) {
    let process = process(times);
    let pd = best(&process);
    bencher.bench(|| step_response(black_box(&process), black_box(pd)));
}
