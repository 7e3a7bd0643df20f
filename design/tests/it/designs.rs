//! Designs in the named styles on random processes of every structure.

use onecycle_design::{
    Controller, DesignError, Execution, Form, Linear, LowPass, MeasurementNoise, Model, Parameter,
    Specification, Structure, Style, design, design_over, load_iae, margins, noise_amplification,
    sensitivity, step_response,
};

/// Numbers of the splitmix64 sequence (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * (z >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Ten to the power of a uniform number.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.uniform(low, high))
    }

    fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.uniform(0.0, choices.len() as f64) as usize]
    }

    /// Process of any structure: gains of either sign over six decades, a time scale from 0.1 ms to 10^5 s, and times
    /// spread over four decades about it.
    fn process(&mut self) -> Model {
        let structure = self.one_of(&Structure::ALL);
        let scale_s = self.decades(-3.0, 4.0);
        let sign = self.one_of(&[1.0, 1.0, 1.0, -1.0]);
        let natural = 1.0 / scale_s;
        let damping = self.decades(-2.5, 0.7);
        Linear::new(structure)
            .with_gain(sign * self.decades(-3.0, 3.0))
            .with_lags_s([
                scale_s * self.decades(-3.0, 0.0),
                scale_s * self.decades(-3.0, 0.0),
            ])
            .with_pole_per_s(self.one_of(&[0.0, 1.0, 1.0, 1.0]) * self.decades(-2.0, 1.5) / scale_s)
            .with_pair(2.0 * damping * natural, natural * natural)
            .with_tau_s(scale_s * self.decades(-3.0, 1.0))
            .into()
    }

    fn specification(&mut self, model: &Model) -> Specification {
        let form = self.one_of(&Form::ALL);
        let style = self.one_of(&[Style::Sharp, Style::Balanced, Style::Calm]);
        let asked = Specification::new(form, style);
        let tau_s = model.linear().tau_s();
        let asked = match self.one_of(&[0, 0, 1, 2]) {
            1 => asked.with_execution(Execution::sampled(tau_s * self.decades(-2.0, 0.3))),
            _ => asked,
        };
        if self.uniform(0.0, 1.0) < 0.15 {
            let std = self.decades(-4.0, -1.0);
            asked.with_noise(MeasurementNoise::new(
                std,
                tau_s * self.decades(-2.0, 0.0),
                1.0,
            ))
        } else {
            asked
        }
    }
}

fn has_two_integrators(model: &Model) -> bool {
    let linear = model.linear();
    let stages = linear.structure().stages();
    stages.integrators + usize::from(stages.poles > 0 && linear.pole_per_s() == 0.0) > 1
}

// A design is stable, keeps Ms and Mt to 1e-6, keeps the noise to 1e-6, and is refused for a reason only: forms without
// integral on processes that settle, cascades on processes without rate, P and PI on two
// integrators.
#[test]
fn every_design_is_stable_and_keeps_its_limits() {
    let mut random = Random(1);
    let (mut designed, mut searches_given_up) = (0, 0);
    for case in 0..1200 {
        let model = random.process();
        let asked = random.specification(&model);
        let form = asked.form;
        match design(&model, &asked) {
            Ok(found) => {
                let peaks = sensitivity(&model, &found.controller).unwrap();
                assert!(peaks.ms < asked.ms * (1.0 + 1e-6), "{case} {peaks:?}");
                assert!(peaks.mt < asked.mt * (1.0 + 1e-6), "{case} {peaks:?}");
                assert_eq!(margins(&model, &found.controller), Some(found.margins));
                if let Some(noise) = asked.noise {
                    let period_s = noise.sample_period_s;
                    let kappa = noise_amplification(&model, &found.controller, period_s).unwrap();
                    let share = kappa * noise.std / noise.input_amplitude;
                    assert!(share < asked.noise_share * (1.0 + 1e-6), "{case} {share}");
                }
                designed += 1;
            }
            Err(DesignError::NoIntegral(_)) => {
                assert!(matches!(form, Form::P | Form::Pd), "{case}");
            }
            Err(DesignError::NoRate(_)) => {
                let is_pure = model.structure() == Structure::Iptd;
                assert!(
                    is_pure || model.structure().stages().integrators == 0,
                    "{case}"
                );
            }
            Err(DesignError::Infeasible { .. }) => {
                let is_hopeless = matches!(form, Form::P | Form::Pi);
                let is_expected = is_hopeless && has_two_integrators(&model);
                assert!(
                    is_expected || asked.noise.is_some(),
                    "{case} {form:?} {model:?}"
                );
                searches_given_up += usize::from(!is_expected);
            }
            Err(other) => panic!("{case}: {other}"),
        }
    }
    assert!(designed > 700, "{designed}");
    // Noise of many times the usual share of the input asks for filters far from the starts of the search.
    assert!(searches_given_up <= 3, "{searches_given_up}");
}

/// Draws about the paper's hexacopter: 90 % of them within these factors of gain / body lag, actuator lag, body lag, delay.
fn posterior(count: usize, seed: u64, spread: [f64; 4]) -> Vec<Model> {
    let mut random = Random(seed);
    let mut draw = || {
        let mut factor = |spread: f64| {
            let (u, v) = (
                random.uniform(1e-12, 1.0),
                random.uniform(0.0, std::f64::consts::TAU),
            );
            (spread * (-2.0 * u.ln()).sqrt() * v.cos() / 1.645).exp()
        };
        let [slope, lag, body, tau] = spread.map(&mut factor);
        Linear::new(Structure::Soiptd)
            .with_gain(slope / 1.6886)
            .with_lags_s([0.0321 * lag, 1.0])
            .with_pole_per_s(1.0 / (1.6886 * body))
            .with_tau_s(0.0237 * tau)
            .into()
    };
    (0..count).map(|_| draw()).collect()
}

fn hexacopter() -> Model {
    posterior(1, 1, [0.0; 4])[0]
}

// An independent implementation found on the same posterior, with other draws: the design of the most probable model keeps
// M = 1.6 on 32 % of the draws, the robust one on 97 % of fresh draws, for 15 % more IAE.
#[test]
fn a_design_over_draws_keeps_its_limits_on_fresh_draws() {
    let spread = [0.0075, 0.044, 0.2, 0.046];
    let asked = Specification::new(Form::Pid, Style::Balanced).with_filter_s(0.002);
    let found = design_over(&hexacopter(), &posterior(200, 3, spread), &asked).unwrap();
    let robustness = found.robustness.unwrap();
    assert!(robustness.coverage >= 0.975, "{robustness:?}");
    assert!(
        (0.2..0.45).contains(&robustness.nominal_coverage),
        "{robustness:?}"
    );
    let price = robustness.mean_iae / robustness.nominal_mean_iae;
    assert!((1.05..1.25).contains(&price), "{price}");
    let fresh = posterior(400, 4, spread);
    let keeps = |model: &&Model| {
        sensitivity(model, &found.controller).is_some_and(|peaks| peaks.ms.max(peaks.mt) < 1.6)
    };
    assert!(fresh.iter().filter(keeps).count() >= 380);
}

// The same draw many times is one process: the design over it is that for it, within the tolerance of the two searches.
#[test]
fn draws_without_spread_change_nothing() {
    let asked = Specification::new(Form::Pi, Style::Calm);
    let model: Model = Linear::new(Structure::Foptd)
        .with_pole_per_s(1.0)
        .with_tau_s(0.5)
        .into();
    let alone = design(&model, &asked).unwrap();
    let over = design_over(&model, &[model; 40], &asked).unwrap();
    let ratio =
        load_iae(&model, &over.controller).unwrap() / load_iae(&model, &alone.controller).unwrap();
    assert!((ratio - 1.0).abs() < 3e-3, "{ratio}");
    assert_eq!(over.robustness.unwrap().coverage, 1.0);
    assert_eq!(design_over(&model, &[], &asked), Ok(alone));
}

// A process of negative gain takes the gains of its mirror image with the other sign; a process that is 1000 times slower
// takes a thousandth of its rates. Powers of two only: to the bit for the sign, to 1e-9 for the time.
#[test]
fn sign_and_time_scale_the_gains() {
    let asked = Specification::new(Form::Pid, Style::Sharp);
    let process = |gain: f64, unit_s: f64| -> Model {
        Linear::new(Structure::Soptd)
            .with_gain(gain / unit_s)
            .with_pole_per_s(1.0 / unit_s)
            .with_lags_s([0.2 * unit_s, 1.0])
            .with_tau_s(0.1 * unit_s)
            .into()
    };
    let gains = |model: &Model| {
        let pid = design(model, &asked).unwrap().controller.pid();
        [pid.kp, pid.ki, pid.kd]
    };
    let [kp, ki, kd] = gains(&process(2.0, 1.0));
    assert_eq!(gains(&process(-2.0, 1.0)), [-kp, -ki, -kd]);
    let slow = gains(&process(2.0, 1000.0));
    for (found, expected) in slow.iter().zip([kp, ki / 1000.0, kd * 1000.0]) {
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }
}

// Each further limit holds where it is stricter than the style.
#[test]
fn further_limits_hold() {
    let model = hexacopter();
    let asked = Specification::new(Form::Pid, Style::Sharp);
    let found = |asked: &Specification| design(&model, asked).unwrap();
    let free = found(&asked);
    assert!(free.margins.phase_margin_rad < 60_f64.to_radians());
    let margin_rad = 60_f64.to_radians();
    let phase = found(&asked.with_phase_margin_rad(margin_rad));
    assert!(
        phase.margins.phase_margin_rad > margin_rad - 1e-2,
        "{:?}",
        phase.margins
    );

    let mut gain = asked;
    gain.gain_margin = 6.0;
    assert!(free.margins.gain_margin.unwrap() < 5.0);
    assert!(found(&gain).margins.gain_margin.unwrap() > 6.0 - 1e-2);

    let mut delay = asked;
    delay.delay_margin_s = 0.15;
    assert!(free.margins.delay_margin_s < 0.1);
    assert!(found(&delay).margins.delay_margin_s > 0.15 - 1e-3);

    let mut peak = asked;
    let of = |controller: &Controller| {
        step_response(&model, controller)
            .unwrap()
            .metrics
            .peak_input
    };
    peak.input_peak = Some(0.3 * of(&free.controller));
    assert!(of(&found(&peak).controller) < peak.input_peak.unwrap() * 1.001);
}

// The filter of a measurement acts on the loop as an actuator lag does. Sampling adds one and a half periods of dead time.
#[test]
fn filters_and_sampling_are_in_the_loop() {
    let model = hexacopter();
    let controller = design(&model, &Specification::new(Form::Pid, Style::Balanced))
        .unwrap()
        .controller;
    let ms = |model: &Model, execution: Execution| {
        let controller = controller.pid().with_execution(execution).into();
        sensitivity(model, &controller).unwrap().ms
    };
    let three_lags = Linear::new(Structure::Toiptd)
        .with_gain(1.0 / 1.6886)
        .with_lags_s([0.0321, 0.004])
        .with_pole_per_s(1.0 / 1.6886)
        .with_tau_s(0.0237);
    let filtered = Execution::default().with_sensor_filter(LowPass::FirstOrder(0.004));
    let (lag, filter) = (
        ms(&three_lags.into(), Execution::default()),
        ms(&model, filtered),
    );
    assert!((lag / filter - 1.0).abs() < 1e-9, "{lag} {filter}");
    let later = model.linear().with_tau_s(0.0237 + 1.5 * 0.004).into();
    let (delay, sampled) = (
        ms(&later, Execution::default()),
        ms(&model, Execution::sampled(0.004)),
    );
    assert!((delay / sampled - 1.0).abs() < 1e-9, "{delay} {sampled}");
    assert!(sampled > 1.65);
}

// Refusals name their reason.
#[test]
fn designs_that_do_not_exist_are_refused() {
    let of = |structure: Structure| Linear::new(structure).with_pole_per_s(1.0).with_tau_s(0.1);
    let refused = |model: Linear, form: Form| {
        design(&model.into(), &Specification::new(form, Style::Balanced)).unwrap_err()
    };
    assert_eq!(
        refused(of(Structure::Foptd), Form::Pd),
        DesignError::NoIntegral(Form::Pd)
    );
    assert_eq!(
        refused(of(Structure::Foptd), Form::CascadePi),
        DesignError::NoRate(Form::CascadePi)
    );
    let immediate = of(Structure::Foptd).with_tau_s(0.0);
    assert_eq!(refused(immediate, Form::Pi), DesignError::Unbounded);
    assert_eq!(refused(immediate, Form::Pid), DesignError::Unbounded);
    let unstable = of(Structure::Foptd).with_pole_per_s(-1.0);
    assert_eq!(refused(unstable, Form::Pi), DesignError::UnstableProcess);
    let double = of(Structure::DoubleIntegratorLag);
    assert!(matches!(
        refused(double, Form::Pi),
        DesignError::Infeasible {
            least_peak: None,
            ..
        }
    ));
    let mut asked = Specification::new(Form::Pi, Style::Balanced);
    asked.ms = 1.0;
    let error = design(&of(Structure::Foptd).into(), &asked).unwrap_err();
    assert_eq!(error.to_string(), "ms must be 1.01 or more, but is 1");
}

// A refined design costs no more than a plain one, and keeps the limits.
#[test]
fn a_refined_design_costs_no_more() {
    let model = hexacopter();
    assert_eq!(model.parameter(Parameter::Tau), Some(0.0237));
    let asked = Specification::new(Form::Pid, Style::Balanced);
    let cost = |asked: &Specification| {
        let found = design(&model, asked).unwrap();
        load_iae(&model, &found.controller).unwrap()
    };
    let (plain, refined) = (cost(&asked), cost(&asked.with_refined(true)));
    assert!(
        refined <= plain * (1.0 + 1e-6) && refined > 0.99 * plain,
        "{refined} {plain}"
    );
}
