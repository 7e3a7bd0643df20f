//! Comparison of the styles with the rules of the field, as tables for `docs/benchmarks/controllers.md`.
//!
//! ```sh
//! cargo run --release -p onecycle-design --example comparison
//! ```

#![expect(clippy::print_stdout, reason = "the tables are the result")]

use onecycle_design::rules::{
    Gmvc, HalfRule, StepFeatures, Ultimate, amigo, simc, tyreus_luyben, ziegler_nichols,
};
use onecycle_design::{
    Autopilot, Controller, Form, Linear, MeasurementNoise, Model, Pid, Specification, Structure,
    Style, design, load_iae, noise_amplification, sensitivity,
};
use onecycle_onboard::Soiptd;

/// A rule gets a measurement filter with this share of its derivative time.
const FILTER_SHARE: f64 = 0.1;

/// Sample period of the noise, as a share of the dead time of the second-order model by the half rule.
const PERIOD_SHARE: f64 = 0.1;

/// Parameter of the relay, and noise as a share of the amplitude of its oscillation: as in the other campaigns.
const BETA: f64 = -0.73;
const NOISE: f64 = 0.02;

/// What one controller does on one process.
#[derive(Clone, Copy)]
struct Figures {
    iae: f64,
    ms: f64,
    noise: f64,
}

type Method = (&'static str, Box<dyn Fn(&Model) -> Option<Controller>>);

fn figures(model: &Model, controller: &Controller, period_s: f64) -> Option<Figures> {
    Some(Figures {
        iae: load_iae(model, controller)?,
        ms: sensitivity(model, controller)?.ms,
        noise: noise_amplification(model, controller, period_s)?,
    })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Prints a row for each method: medians over the processes, IAE and noise per those of the first method.
fn table(title: &str, models: &[(Model, f64)], methods: &[Method]) {
    println!("\n{title}: {} processes\n", models.len());
    println!(
        "| controller | none | unstable | Ms | IAE | largest IAE | noise |\n| --- | --- | --- | --- | --- | --- | --- |"
    );
    let of = |method: &Method, (model, period_s): &(Model, f64)| {
        method.1(model).map(|controller| figures(model, &controller, *period_s))
    };
    let reference: Vec<_> = models.iter().map(|model| of(&methods[0], model)).collect();
    for method in methods {
        let found: Vec<_> = models.iter().map(|model| of(method, model)).collect();
        let none = found.iter().filter(|found| found.is_none()).count();
        let unstable = found
            .iter()
            .filter(|found| matches!(found, Some(None)))
            .count();
        let pairs: Vec<(Figures, Figures)> = (found.iter().zip(&reference))
            .filter_map(|(found, reference)| Some(((*found)??, (*reference)??)))
            .collect();
        let of = |value: &dyn Fn(&(Figures, Figures)) -> f64| pairs.iter().map(value).collect();
        let ratios: Vec<f64> = of(&|(found, reference)| found.iae / reference.iae);
        println!(
            "| {} | {none} | {unstable} | {:.2} | {:.2} | {:.3} | {:.2} |",
            method.0,
            median(of(&|(found, _)| found.ms)),
            median(ratios.clone()),
            ratios.iter().copied().fold(0.0, f64::max),
            median(of(&|(found, reference)| found.noise / reference.noise)),
        );
    }
}

fn filtered(pid: Pid) -> Controller {
    pid.with_filter_s(FILTER_SHARE * pid.kd / pid.kp).into()
}

fn style(form: Form, style: Style) -> impl Fn(&Model) -> Option<Controller> {
    move |model| {
        Some(
            design(model, &Specification::new(form, style))
                .ok()?
                .controller,
        )
    }
}

/// The styles and the rules in one form.
fn methods(form: Form) -> Vec<Method> {
    vec![
        ("balanced", Box::new(style(form, Style::Balanced))),
        ("sharp", Box::new(style(form, Style::Sharp))),
        ("calm", Box::new(style(form, Style::Calm))),
        (
            "SIMC",
            Box::new(move |model| {
                let half = HalfRule::of(model, form)?;
                simc(&half, half.dead_time_s).map(filtered)
            }),
        ),
        (
            "AMIGO",
            Box::new(move |model| amigo(&StepFeatures::of(model)?, form).map(filtered)),
        ),
        (
            "Ziegler-Nichols",
            Box::new(move |model| ziegler_nichols(&Ultimate::of(model)?, form).map(filtered)),
        ),
        (
            "Tyreus-Luyben",
            Box::new(move |model| tyreus_luyben(&Ultimate::of(model)?, form).map(filtered)),
        ),
    ]
}

/// A process with the sample period of its noise (s). The half rule has no model of a resonance, which counts with the time of
/// its actuator lag.
fn with_period(model: impl Into<Model>) -> (Model, f64) {
    let model = model.into();
    let linear = model.linear();
    let other_s = linear.tau_s() + linear.lags_s().iter().sum::<f64>();
    let half_s = HalfRule::of(&model, Form::Pid).map_or(other_s, |half| half.dead_time_s);
    (model, PERIOD_SHARE * half_s)
}

fn foptd(lag_s: f64, tau_s: f64) -> Linear {
    (Linear::new(Structure::Foptd))
        .with_gain(1.0 / lag_s)
        .with_pole_per_s(1.0 / lag_s)
        .with_tau_s(tau_s)
}

fn soptd(first_s: f64, second_s: f64, tau_s: f64) -> Linear {
    (Linear::new(Structure::Soptd))
        .with_gain(1.0 / first_s)
        .with_pole_per_s(1.0 / first_s)
        .with_lags_s([second_s, 1.0])
        .with_tau_s(tau_s)
}

fn resonant_lag(lag_s: f64, time_s: f64, damping: f64) -> Linear {
    let natural = 1.0 / time_s;
    (Linear::new(Structure::ResonantLag))
        .with_gain(natural * natural)
        .with_lags_s([lag_s, 1.0])
        .with_pair(2.0 * damping * natural, natural * natural)
}

/// The members of the test batch of Astrom and Hagglund (J. Process Control 14, 2004, eq. 4) that the structures of the library
/// represent: all but those with more than three lags or a zero.
fn batch() -> Vec<(Model, f64)> {
    let long = [
        0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.3, 1.5, 2.0, 4.0, 6.0, 8.0, 10.0, 20.0, 50.0,
        100.0, 200.0, 500.0, 1000.0,
    ];
    let double = [
        0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.3, 1.5, 2.0, 4.0, 6.0, 8.0, 10.0, 20.0,
        50.0, 100.0, 200.0, 500.0,
    ];
    let delays = [0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0];
    let mut found: Vec<Linear> = long.map(|lag_s| foptd(lag_s, 1.0)).to_vec();
    found.extend(double.map(|lag_s| soptd(lag_s, lag_s, 1.0)));
    found.extend(
        [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
            .map(|time_s| resonant_lag(1.0, time_s, 1.0)),
    );
    found.extend(delays.map(|tau_s| {
        (Linear::new(Structure::IntegratorLag))
            .with_lags_s([f64::max(1.0 - tau_s, 1e-6), 1.0])
            .with_tau_s(tau_s)
    }));
    for lag_s in [1.0, 2.0, 5.0, 10.0] {
        found.extend(delays.map(|tau_s| soptd(lag_s, f64::max(1.0 - tau_s, 1e-6), tau_s)));
    }
    found.extend((1..=10).map(|tenths| resonant_lag(1.0, 0.1 * f64::from(tenths), 0.7)));
    found.into_iter().map(with_period).collect()
}

/// Fifty multirotors of the paper's box by the Weyl sequence of three irrational numbers, with their noise of a relay test.
fn multirotors() -> Vec<(Soiptd, MeasurementNoise)> {
    let draw = |i: f64| {
        let uniform =
            |prime: f64, low: f64, high: f64| low + (high - low) * (i * prime.sqrt()).fract();
        let lags = (uniform(2.0, 0.015, 0.3), uniform(3.0, 0.2, 2.0));
        let process = Soiptd::new(1.0, lags.0, lags.1, uniform(5.0, 0.0005, 0.1)).ok()?;
        let omega = process.frequency_at_phase(BETA.asin() - std::f64::consts::PI)?;
        let amplitude = 4.0 / std::f64::consts::PI * process.magnitude(omega);
        Some((
            process,
            MeasurementNoise::new(NOISE * amplitude, 0.001, 1.0),
        ))
    };
    (1..=50).filter_map(|i| draw(f64::from(i))).collect()
}

/// PX4's gains for a vehicle, from the model that its identification would find without error: the rate at samples a sixteenth
/// of the period of the relay test apart, or one dead time, since the model holds no longer one.
fn px4(model: &Model) -> Option<Controller> {
    let process = model.soiptd()?;
    let omega = process.frequency_at_phase(BETA.asin() - std::f64::consts::PI)?;
    let period_s = std::f64::consts::TAU / omega;
    let sample_s = process.tau_s().max(period_s / 16.0);
    let (gain, fast_s, slow_s) = (process.k()?, process.t_prop_s(), process.t_body_s()?);
    // Rate after a unit step of the input, at sample `k`.
    let step = |k: f64| {
        let t = k * sample_s - process.tau_s();
        let part = |lag_s: f64| lag_s * (-t / lag_s).exp();
        let rest = (part(slow_s) - part(fast_s)) / (slow_s - fast_s);
        if t > 0.0 { gain * (1.0 - rest) } else { 0.0 }
    };
    let [h1, h2, h3] = [1.0, 2.0, 3.0].map(|k| step(k) - step(k - 1.0));
    let [fast, slow] = [fast_s, slow_s].map(|lag_s| (-sample_s / lag_s).exp());
    let (a1, a2) = (-fast - slow, fast * slow);
    let coefficients = [a1, a2, h1, h2 + a1 * h1, h3 + a1 * h2 + a2 * h1];
    let ratio = 4.0 / std::f64::consts::PI * process.magnitude(omega);
    let gains = Gmvc::scaled_to(period_s, ratio).cascade(&coefficients, sample_s)?;
    Some(
        Autopilot::from(gains)
            .with_filter_s(FILTER_SHARE * gains.rate_d)
            .into(),
    )
}

/// A method for a vehicle with its noise.
type VehicleMethod = (
    &'static str,
    Box<dyn Fn(&Model, MeasurementNoise) -> Option<Controller>>,
);

/// The styles and the rules for a vehicle.
fn vehicle_methods(has_noise_limit: bool) -> Vec<VehicleMethod> {
    let ours = |form: Form, style: Style| -> Box<dyn Fn(&Model, MeasurementNoise) -> _> {
        Box::new(move |model, noise| {
            let asked = Specification::new(form, style);
            let asked = if has_noise_limit {
                asked.with_noise(noise)
            } else {
                asked
            };
            design(model, &asked).ok().map(|found| found.controller)
        })
    };
    let cascades = [Form::CascadePi, Form::CascadePid].map(|form| ours(form, Style::Balanced));
    let [rate_pi, rate_pid] = cascades;
    let rules = methods(Form::Pid).split_off(3);
    let rules = rules
        .into_iter()
        .map(|(name, rule)| -> VehicleMethod { (name, Box::new(move |model, _| rule(model))) });
    let styles: [VehicleMethod; 5] = [
        ("balanced PID", ours(Form::Pid, Style::Balanced)),
        ("sharp PID", ours(Form::Pid, Style::Sharp)),
        ("calm PID", ours(Form::Pid, Style::Calm)),
        ("balanced cascade, rate PI", rate_pi),
        ("balanced cascade, rate PID", rate_pid),
    ];
    let px4: VehicleMethod = ("PX4's GMVC", Box::new(|model, _| px4(model)));
    styles.into_iter().chain(rules).chain([px4]).collect()
}

/// Designs of multirotors: noise as a share of the amplitude of the relay, IAE per that of the first method.
fn multirotor_table(title: &str, has_noise_limit: bool) {
    println!(
        "\n{title}\n\n| controller | unstable | Ms | IAE | IAE, least to largest | noise |\n| --- | --- | --- | --- | --- | --- |"
    );
    let rows = vehicle_methods(has_noise_limit);
    let vehicles = multirotors();
    let of = |row: &VehicleMethod| -> Vec<Option<(Figures, f64)>> {
        let figures = |(process, noise): &(Soiptd, MeasurementNoise)| {
            let model = Model::from(*process);
            let controller = row.1(&model, *noise)?;
            let found = figures(&model, &controller, noise.sample_period_s)?;
            Some((found, found.noise * noise.std))
        };
        vehicles.iter().map(figures).collect()
    };
    let reference = of(&rows[0]);
    for row in &rows {
        let found = of(row);
        let stable: Vec<(Figures, f64)> = found.iter().flatten().copied().collect();
        let mut ratios: Vec<f64> = (found.iter().zip(&reference))
            .filter_map(|(found, reference)| {
                Some(found.as_ref()?.0.iae / reference.as_ref()?.0.iae)
            })
            .collect();
        ratios.sort_by(f64::total_cmp);
        println!(
            "| {} | {} | {:.2} | {:.2} | {:.2} to {:.2} | {:.2} |",
            row.0,
            found.len() - stable.len(),
            median(stable.iter().map(|found| found.0.ms).collect()),
            median(ratios.clone()),
            ratios.first().copied().unwrap_or(f64::NAN),
            ratios.last().copied().unwrap_or(f64::NAN),
            median(stable.iter().map(|found| found.1).collect()),
        );
    }
}

fn main() {
    let ratios = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];
    let first_order: Vec<(Model, f64)> = ratios
        .iter()
        .map(|ratio| with_period(foptd(1.0, *ratio)))
        .collect();
    for form in [Form::Pi, Form::Pid] {
        table(
            &format!("Batch of Astrom and Hagglund, {}", form.name()),
            &batch(),
            &methods(form),
        );
        table(
            &format!("FOPTD, tau/T 0.05 to 10, {}", form.name()),
            &first_order,
            &methods(form),
        );
    }
    multirotor_table(
        "Multirotors, noise of 2 % of the oscillation limited by the style",
        true,
    );
    multirotor_table("Multirotors, without limit of the noise", false);
}
