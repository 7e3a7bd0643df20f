//! Designs over draws of a posterior, judged draw by draw.

use onecycle_design::{
    Controller, DesignError, Execution, Form, Linear, MeasurementNoise, Model, Specification,
    Structure, Style, design_over, proposals, sensitivity,
};

use crate::random::Random;

/// Draws, and how many of them may miss the limits: P[Bin(200, 0.05) <= 5] = 6.2 %.
const DRAWS: usize = 200;
const GIVEN_UP: usize = 5;

/// Two independent standard normal numbers (Box and Muller).
fn normal(random: &mut Random) -> [f64; 2] {
    let radius = (-2.0 * random.uniform(1e-12, 1.0).ln()).sqrt();
    let (sin, cos) = random.uniform(0.0, std::f64::consts::TAU).sin_cos();
    [radius * cos, radius * sin]
}

/// A multirotor as a relay test of 8 s with 3 % of noise shows it: standard deviations of 0.21 % of K/T_body, 1.1 % of
/// T_prop, 1.3 % of T_body and 1.25 % of the dead time, correlations 0.84 of the first two, -0.99 of T_prop and dead time;
/// all times `width`.
fn posterior(random: &mut Random, model: &Model, width: f64) -> Vec<Model> {
    let linear = model.linear();
    let with = |[a, b, c, d]: [f64; 4]| -> Model {
        Linear::new(Structure::Soiptd)
            .with_gain(linear.gain() * (width * 0.0021 * (0.84 * a + 0.54 * b)).exp())
            .with_lags_s([linear.lags_s()[0] * (width * 0.0114 * a).exp(), 1.0])
            .with_pole_per_s(linear.pole_per_s() * (width * 0.0131 * c).exp())
            .with_tau_s(linear.tau_s() * (-width * 0.0125 * (0.988 * a + 0.154 * d)).exp())
            .into()
    };
    let pair = |_| {
        let ([a, b], [c, d]) = (normal(random), normal(random));
        [with([a, b, c, d]), with([-a, -b, -c, -d])]
    };
    (0..DRAWS / 2).flat_map(pair).collect()
}

fn multirotor(gain: f64, t_prop_s: f64, pole_per_s: f64, tau_s: f64) -> Model {
    Linear::new(Structure::Soiptd)
        .with_gain(gain)
        .with_lags_s([t_prop_s, 1.0])
        .with_pole_per_s(pole_per_s)
        .with_tau_s(tau_s)
        .into()
}

/// That of `examples/simulated_hover.csv`, with its noise and sample period.
fn hover(style: Style) -> (Model, Specification) {
    let asked = Specification::new(Form::Pid, style)
        .with_noise(MeasurementNoise::new(6.8e-5, 1e-3, 1.18))
        .with_execution(Execution::sampled(1e-3).with_computation_delay_s(0.0));
    (multirotor(0.5919, 0.0321, 0.595, 0.0237), asked)
}

/// Draws on which the limits do not hold, to 1e-3.
fn missed(draws: &[Model], controller: &Controller, peak: f64) -> usize {
    let is_missed = |draw: &&Model| {
        sensitivity(draw, controller).is_none_or(|found| found.ms.max(found.mt) > peak * 1.001)
    };
    draws.iter().filter(is_missed).count()
}

// The search once refused the style calm for this posterior and offered an Ms of 1.41: from the optimum of one process it
// took the limit of the noise for a lack of robustness.
#[test]
fn the_hover_example_has_a_calm_controller() {
    let (model, asked) = hover(Style::Calm);
    let draws = posterior(&mut Random::new(1), &model, 1.0);
    let found = design_over(&model, &draws, &asked).unwrap();
    assert!(missed(&draws, &found.controller, 1.4) <= GIVEN_UP);
    assert!(found.robustness.unwrap().coverage >= 0.975);
}

// What keeps the limits of a calmer style keeps those of a sharper one. So no style is refused beside a calmer one that is
// designed, and each costs less than the calmer one. Twelve random multirotors and posteriors of 1 to 6 times the width.
#[test]
fn a_sharper_style_is_never_refused() {
    for case in 0..12 {
        let mut random = Random::new(case);
        let model = multirotor(
            1.0,
            random.uniform(0.015, 0.06),
            1.0 / random.uniform(0.3, 3.0),
            random.uniform(0.005, 0.04),
        );
        let draws = posterior(&mut random, &model, 1.0 + 5.0 * case as f64 / 11.0);
        let (_, asked) = hover(Style::Balanced);
        let found = proposals(&model, &draws, &asked, None);
        let mut least: Option<f64> = None;
        for proposal in found[1..].iter().rev() {
            let style = proposal.specification.style;
            match &proposal.outcome {
                Ok(design) => {
                    let cost = design.robustness.unwrap().mean_iae;
                    assert!(least.is_none_or(|least| cost < least), "{case} {style:?}");
                    least = Some(cost);
                    let missed = missed(&draws, &design.controller, style.peak());
                    assert!(missed <= GIVEN_UP, "{case} {style:?}: {missed}");
                }
                Err(error) => assert!(least.is_none(), "{case} {style:?}: {error}"),
            }
        }
        assert!(least.is_some(), "{case}");
    }
}

// Every process of one sign of the gain has a controller that is slow enough. 60 times the usual width are a factor of 3
// either way in T_prop, T_body and dead time.
#[test]
fn a_wide_posterior_is_controlled_slowly() {
    let (model, asked) = hover(Style::Calm);
    let draws = posterior(&mut Random::new(2), &model, 60.0);
    let found = design_over(&model, &draws, &asked).unwrap();
    assert!(missed(&draws, &found.controller, 1.4) <= GIVEN_UP);
}

// No PI keeps any limit on a double integrator: five draws of one can be given up, six cannot.
#[test]
fn six_draws_that_nothing_controls_are_refused() {
    let (model, _) = hover(Style::Balanced);
    let asked = Specification::new(Form::Pi, Style::Balanced);
    let undamped = multirotor(0.5919, 0.0321, 0.0, 0.0237);
    let mut draws = posterior(&mut Random::new(3), &model, 1.0);
    draws[100..105].fill(undamped);
    let found = design_over(&model, &draws, &asked).unwrap();
    assert_eq!(missed(&draws, &found.controller, 1.6), GIVEN_UP);
    draws[105] = undamped;
    assert_eq!(
        design_over(&model, &draws, &asked),
        Err(DesignError::Infeasible {
            form: Form::Pi,
            least_peak: None
        })
    );
}

// A body whose damping hardly shows: the pole is anything from zero to a thousandth of the crossover, which changes no gain by
// more than a flat cost allows. Far slower poles than those of the controller were once passed over, and no controller was found.
#[test]
fn poles_that_are_nearly_integrators_change_nothing() {
    let asked = Specification::new(Form::Pid, Style::Balanced)
        .with_noise(MeasurementNoise::new(6.7e-4, 1e-3, 0.25))
        .with_execution(Execution::sampled(1e-3).with_computation_delay_s(0.0));
    let damped = |pole_per_s: f64| multirotor(40.0, 0.05, pole_per_s, 0.015);
    let undamped: Model = Linear::new(Structure::DoubleIntegratorLag)
        .with_gain(40.0)
        .with_lags_s([0.05, 1.0])
        .with_tau_s(0.015)
        .into();
    let kp = |model: &Model, draws: &[Model]| {
        let found = design_over(model, draws, &asked).unwrap().controller;
        assert_eq!(missed(draws, &found, 1.6), 0);
        found.kp()
    };
    let alone = kp(&undamped, &[]);
    let poles: Vec<f64> = (3..=12).map(|power| 10f64.powi(-power)).collect();
    for &pole in &poles {
        let share = kp(&damped(pole), &[]) / alone;
        assert!((share - 1.0).abs() < 0.06, "{pole} {share}");
    }
    let draws: Vec<Model> = poles
        .iter()
        .cycle()
        .take(40)
        .map(|&pole| damped(pole))
        .collect();
    let share = kp(&undamped, &draws) / alone;
    assert!((share - 1.0).abs() < 0.06, "{share}");
}

// A looser limit never costs: what keeps a peak of 1.5 keeps one of 1.504. A search that ends where its simplex is flat along a limit
// does not see that: one from a single start did not by 5 %. Multirotors under PID, with noise, and posteriors of 1 to 20 times the width.
#[test]
fn a_looser_limit_never_costs_more() {
    let mut worst: f64 = 0.0;
    for case in 0..8 {
        let mut random = Random::new(200 + case);
        let model = multirotor(
            1.0,
            random.uniform(0.015, 0.06),
            1.0 / random.uniform(0.3, 3.0),
            random.uniform(0.005, 0.04),
        );
        let draws = posterior(&mut random, &model, 20_f64.powf(case as f64 / 7.0));
        let mut least = f64::INFINITY;
        for peak in (0..8).map(|step| 1.5 + 0.004 * f64::from(step)) {
            let (_, asked) = hover(Style::Balanced);
            let found = design_over(&model, &draws, &asked.with_peak(peak));
            let cost = found.unwrap().robustness.unwrap().mean_iae;
            worst = worst.max(cost / least - 1.0);
            least = least.min(cost);
        }
    }
    assert!(worst < 0.01, "{worst}");
}
