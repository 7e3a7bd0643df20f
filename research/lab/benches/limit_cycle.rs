//! One limit cycle, one certificate, all sampled cycles of a process.

use divan::{Bencher, black_box};
use onecycle_lab::space::certificate::Certificate;
use onecycle_lab::space::limit_cycle::sampled::symmetric_cycles;
use onecycle_lab::space::limit_cycle::{limit_cycles, symmetric};
use onecycle_onboard::Soiptd;

const BETA: f64 = -0.73;

/// The paper's hover process.
const HOVER: [f64; 3] = [0.0321, 1.6886, 0.0237];

fn main() {
    divan::main();
}

fn hover() -> Soiptd {
    let [t_prop_s, t_body_s, tau_s] = HOVER;
    Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).expect("the times are positive")
}

/// Exact, with the spectral radius of its Poincare map.
#[divan::bench]
fn limit_cycle_without_bias(bencher: Bencher) {
    let process = hover();
    bencher.bench(|| symmetric(black_box(&process), BETA));
}

/// All cycles within seven octaves of periods.
#[divan::bench(args = [0.0, 0.3])]
fn limit_cycles_under_bias(bencher: Bencher, bias: f64) {
    let process = hover();
    bencher.bench(|| limit_cycles(black_box(&process), [BETA; 2], bias));
}

#[divan::bench]
fn sampled_limit_cycles(bencher: Bencher) {
    let process = hover();
    bencher.bench(|| symmetric_cycles(black_box(&process), BETA, 1e-3));
}

#[divan::bench]
fn certificate_under_bias(bencher: Bencher) {
    bencher.bench(|| Certificate::new(black_box(HOVER), BETA, 0.3));
}
