//! Time of a design: one process, and 200 draws from a posterior.

use onecycle_design::{
    Form, Linear, Model, Specification, Structure, Style, design, design_over, margins, proposals,
    sensitivity, step_response,
};

fn main() {
    divan::main();
}

const FORMS: [&str; 6] = ["p", "pi", "pd", "pid", "cascade_pi", "cascade_pid"];

/// The paper's hexacopter.
fn model() -> Model {
    with_factors([1.0; 4])
}

fn with_factors([gain, lag, body, tau]: [f64; 4]) -> Model {
    Linear::new(Structure::Soiptd)
        .with_gain(gain / 1.6886)
        .with_lags_s([0.0321 * lag, 1.0])
        .with_pole_per_s(1.0 / (1.6886 * body))
        .with_tau_s(0.0237 * tau)
        .into()
}

/// 200 draws with spreads of 0.5, 3, 12 and 3 % about it times `width`, by the Weyl sequence of four irrational numbers.
fn draws(width: f64) -> Vec<Model> {
    let spreads = [0.005, 0.03, 0.12, 0.03].map(|spread| width * spread);
    let steps = [
        2.0_f64.sqrt(),
        3.0_f64.sqrt(),
        5.0_f64.sqrt(),
        7.0_f64.sqrt(),
    ];
    (1..=200)
        .map(|i| {
            let factor = |j: usize| {
                let uniform = (f64::from(i) * steps[j]).fract();
                ((2.0 * uniform - 1.0) * 3.0_f64.sqrt() * spreads[j]).exp()
            };
            with_factors([factor(0), factor(1), factor(2), factor(3)])
        })
        .collect()
}

fn balanced(form: &str) -> Specification {
    Specification::new(Form::from_name(form).expect("a name"), Style::Balanced)
}

#[divan::bench(args = FORMS)]
fn one_process(bencher: divan::Bencher, form: &str) {
    let (model, asked) = (model(), balanced(form));
    bencher.bench(|| design(&model, &asked).expect("feasible"));
}

#[divan::bench(args = ["pi_rate", "pid_rate"])]
fn one_rate_process(bencher: divan::Bencher, form: &str) {
    let model: Model = Linear::new(Structure::Soptd)
        .with_gain(1.0 / 1.6886)
        .with_lags_s([0.0321, 1.0])
        .with_pole_per_s(1.0 / 1.6886)
        .with_tau_s(0.0237)
        .into();
    let asked = balanced(form.trim_end_matches("_rate"));
    bencher.bench(|| design(&model, &asked).expect("feasible"));
}

#[divan::bench(args = ["pd", "pid", "cascade_pi", "cascade_pid"], sample_count = 20)]
fn two_hundred_draws(bencher: divan::Bencher, form: &str) {
    let (model, draws, asked) = (model(), draws(1.0), balanced(form));
    bencher.bench(|| design_over(&model, &draws, &asked).expect("feasible"));
}

// Six double integrators among the draws, which no PI controls.
#[divan::bench(sample_count = 20)]
fn two_hundred_draws_refused(bencher: divan::Bencher) {
    let (model, mut draws) = (model(), draws(1.0));
    draws[..6].fill(
        Linear::new(Structure::Soiptd)
            .with_lags_s([0.03, 1.0])
            .with_tau_s(0.02)
            .into(),
    );
    let asked = balanced("pi");
    bencher.bench(|| design_over(&model, &draws, &asked).expect_err("infeasible"));
}

// Sharp, balanced and calm: these share most of the work.
#[divan::bench(sample_count = 20)]
fn three_styles_over_two_hundred_draws(bencher: divan::Bencher) {
    let (model, draws, asked) = (model(), draws(1.0), balanced("pid"));
    bencher.bench(|| proposals(&model, &draws, &asked, None));
}

#[divan::bench]
fn margins_and_peaks(bencher: divan::Bencher) {
    let model = model();
    let best = design(&model, &balanced("pid")).expect("feasible");
    bencher.bench(|| {
        (
            margins(&model, &best.controller),
            sensitivity(&model, &best.controller),
        )
    });
}

#[divan::bench]
fn response(bencher: divan::Bencher) {
    let model = model();
    let best = design(&model, &balanced("pid")).expect("feasible");
    bencher.bench(|| step_response(&model, &best.controller).expect("stable"));
}
