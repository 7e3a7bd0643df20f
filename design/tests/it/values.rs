//! Models, controllers and designs as values: names that files and programs depend on, and consistency of a design.

use std::collections::HashSet;

use onecycle_design::{
    Controller, DesignError, Execution, Form, MeasurementNoise, Model, Parameter, Specification,
    Structure, Style, Unit, design, design_over, ise, margins,
};
use onecycle_onboard::Soiptd;

/// Every parameter with its key in JSON, its symbol and its unit.
const PARAMETERS: [(Parameter, &str, &str, Unit); 7] = [
    (Parameter::K, "k", "K", Unit::OutputPerInputSecond),
    (
        Parameter::KOverTBody,
        "k_over_t_body",
        "K/T_body",
        Unit::OutputPerInputSecondSquared,
    ),
    (Parameter::TProp, "t_prop_s", "T_prop", Unit::Second),
    (Parameter::TBody, "t_body_s", "T_body", Unit::Second),
    (
        Parameter::InverseTBody,
        "inv_t_body_per_s",
        "1/T_body",
        Unit::PerSecond,
    ),
    (Parameter::Tau, "tau_s", "tau", Unit::Second),
    (
        Parameter::InputBias,
        "input_bias",
        "input bias",
        Unit::Input,
    ),
];

/// The paper's hexacopter, a slow multirotor, a double integrator, a process of negative gain.
fn models() -> [Model; 4] {
    [
        Soiptd::new(1.0, 0.0321, 1.6886, 0.0237),
        Soiptd::new(1.0, 0.3, 2.0, 0.1),
        Soiptd::from_acceleration_gain(3.0, 0.05, 0.0, 0.02),
        Soiptd::new(-2.0, 0.1, 1.0, 0.05),
    ]
    .map(|process| process.unwrap().into())
}

// JSON and command lines of users hold these names, so a name must not change and must not mean two things.
#[test]
fn names_are_stable_and_unique() {
    for structure in Structure::ALL {
        assert_eq!(Structure::from_name(structure.name()), Some(structure));
    }
    assert_eq!(Structure::Soiptd.name(), "soiptd");
    assert_eq!(
        Structure::Soiptd.transfer_function(),
        "K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))"
    );
    assert_eq!(Form::Pd.name(), "pd");
    assert_eq!(Form::Pd.law(), "u = Kp (r - y) - Kd dy/dt");
    for (parameter, key, symbol, unit) in PARAMETERS {
        assert_eq!(parameter.key(), key);
        assert_eq!(parameter.symbol(), symbol);
        assert_eq!(Structure::Soiptd.unit(parameter), unit, "{key}");
    }
    let keys: HashSet<&str> = PARAMETERS.map(|(_, key, ..)| key).into();
    let symbols: HashSet<&str> = PARAMETERS.map(|(_, _, symbol, _)| symbol).into();
    assert_eq!((keys.len(), symbols.len()), (7, 7));
}

// The lags of a process that is no body are T, or T1 to T3 from the longest; the formula has these symbols, and no two are alike.
#[test]
fn symbols_are_those_of_the_formula() {
    let symbols = |structure: Structure| -> Vec<&str> {
        let parameters = structure.parameters().iter();
        parameters
            .map(|parameter| parameter.symbol_in(structure))
            .collect()
    };
    assert_eq!(symbols(Structure::Foptd), ["K", "K/T", "T", "tau"]);
    assert_eq!(
        symbols(Structure::Toptd),
        ["K", "K/T1", "T1", "T2", "T3", "tau"]
    );
    for structure in Structure::ALL {
        let formula = structure.transfer_function();
        let symbols = symbols(structure);
        for symbol in symbols.iter().filter(|symbol| !symbol.contains('/')) {
            assert!(formula.contains(symbol), "{symbol} in {formula}");
        }
        assert_eq!(symbols.iter().collect::<HashSet<_>>().len(), symbols.len());
    }
}

// A report lists the parameters of the structure: each has a value in the model, none is listed twice, and all are in
// the table above.
#[test]
fn a_structure_lists_the_parameters_of_its_models() {
    for model in models() {
        let listed = model.structure().parameters();
        let different: HashSet<Parameter> = listed.iter().copied().collect();
        assert_eq!(different.len(), listed.len());
        for &parameter in listed {
            assert!(model.parameter(parameter).is_some(), "{parameter:?}");
            assert!(PARAMETERS.iter().any(|(known, ..)| *known == parameter));
        }
    }
}

#[test]
fn a_specification_is_a_balanced_pid_by_default() {
    let default = Specification::default();
    assert_eq!((default.form, default.style), (Form::Pid, Style::Balanced));
    assert_eq!(
        (default.ms, default.mt, default.noise_share),
        (1.6, 1.6, 0.25)
    );
    assert_eq!(default.phase_margin_rad, 0.0);
    let larger = default.with_phase_margin_rad(1.0);
    assert_eq!((larger.form, larger.phase_margin_rad), (Form::Pid, 1.0));
    let paper = Specification::paper();
    assert_eq!((paper.form, paper.style), (Form::Pd, Style::Paper));
    assert_eq!(paper.phase_margin_rad, 20_f64.to_radians());
    assert_eq!((default.draws(), paper.draws()), (200, 96));
    // Ms = 2 leaves 2 asin(1/4) = 28.955 degrees.
    let sharp = Specification::new(Form::Pi, Style::Sharp);
    assert!((sharp.implied_phase_margin_rad().to_degrees() - 28.955).abs() < 1e-3);
    assert_eq!(paper.implied_phase_margin_rad(), paper.phase_margin_rad);
}

// Another style has its own limits, and keeps what belongs to the task: form, noise, sampling, further limits. The
// paper's form and margin do not go over to another style, nor the other way round.
#[test]
fn another_style_keeps_the_task() {
    let noise = MeasurementNoise::new(0.1, 0.01, 2.0);
    let asked = Specification::new(Form::Pi, Style::Balanced)
        .with_peak(1.5)
        .with_noise(noise)
        .with_execution(Execution::sampled(0.01))
        .with_phase_margin_rad(0.9);
    assert_eq!(asked.in_style(Style::Balanced), asked);
    let calm = asked.in_style(Style::Calm);
    let expected = Specification::new(Form::Pi, Style::Calm)
        .with_noise(noise)
        .with_execution(Execution::sampled(0.01))
        .with_phase_margin_rad(0.9);
    assert_eq!(calm, expected);
    let paper = asked.in_style(Style::Paper);
    assert_eq!(
        (paper.form, paper.phase_margin_rad),
        (Form::Pd, 20_f64.to_radians())
    );
    assert_eq!(paper.noise, Some(noise));
    let back = Specification::paper()
        .with_phase_margin_rad(0.5)
        .in_style(Style::Sharp);
    assert_eq!(back, Specification::new(Form::Pid, Style::Sharp));
}

// Margins and cost of a design are those of its controller on the model: margins to the bit, since both come from the
// same function; the cost to 1e-11, since the optimum uses the specified phase margin and `ise` the computed one.
#[test]
fn a_design_reports_the_margins_and_cost_of_its_controller() {
    for model in models() {
        for margin_deg in [5.0_f64, 20.0, 45.0, 60.0] {
            let asked = Specification::paper().with_phase_margin_rad(margin_deg.to_radians());
            let found = design(&model, &asked).unwrap();
            assert_eq!(Some(found.margins), margins(&model, &found.controller));
            assert!(found.margins.phase_margin_rad >= margin_deg.to_radians() - 1e-12);
            let cost = ise(&model, &found.controller).unwrap();
            assert!((found.ise / cost - 1.0).abs() < 1e-11, "{model:?}");
            assert_eq!(found.controller.form(), asked.form);
        }
    }
}

// The draws change the controller, not the model on which cost and margins are reported: both to the bit.
#[test]
fn a_design_over_draws_reports_margins_and_cost_on_the_model() {
    let [model, ..] = models();
    let strong = model.soiptd().unwrap().with_gain_scaled(1.1).unwrap();
    let asked = Specification::paper();
    let found = design_over(&model, &[strong.into(); 3], &asked).unwrap();
    assert_eq!(
        found.controller,
        design(&strong.into(), &asked).unwrap().controller
    );
    assert_eq!(Some(found.margins), margins(&model, &found.controller));
    assert_eq!(Some(found.ise), ise(&model, &found.controller));
}

// The frequency response of a PD is Kp + j w Kd: gains 3 and 2 at 5 rad/s give 3 + 10 j.
#[test]
fn a_controller_is_its_gains() {
    let controller = Controller::from(onecycle_onboard::Pd { kp: 3.0, kd: 2.0 });
    assert_eq!((controller.kp(), controller.kd()), (3.0, 2.0));
    let response = controller.frequency_response(5.0);
    assert_eq!((response.re, response.im), (3.0, 10.0));
}

#[test]
fn a_design_error_names_the_value() {
    let [model, ..] = models();
    let asked = Specification::paper().with_phase_margin_rad(1.6);
    let error = design(&model, &asked).unwrap_err();
    assert_eq!(error, DesignError::PhaseMargin(1.6));
    assert_eq!(
        error.to_string(),
        "the phase margin must lie between 0 and pi/2 rad, but is 1.6 rad"
    );
}
