//! Outcomes of an identification on a simulated relay test without noise.

use onecycle_design::{
    DesignError, Execution, Form, Parameter, Proposal, Specification, Structure, Style, assess,
    margins,
};
use onecycle_identify::{
    Excitation, Identification, MOST_CYCLES, Method, Options, Signals, Verdict, identify,
    identify_by,
};
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::FixedStepProcess;

/// Sample period (s).
pub(crate) const SAMPLE_S: f64 = 1e-3;

/// Eight seconds of the paper's hexacopter under a relay: time (s), input, output.
fn relay_test() -> [Vec<f64>; 3] {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    let mut axis = FixedStepProcess::new(&process, SAMPLE_S);
    let settings = RelaySettings::new(0.5, RelaySettings::DISTINGUISHING_BETA);
    let mut relay = Relay::new(settings).unwrap();
    let mut columns = [vec![], vec![], vec![]];
    for tick in 0..8000 {
        let output = axis.output();
        let input = f64::from(relay.step(-output as f32, SAMPLE_S as f32));
        for (column, value) in columns
            .iter_mut()
            .zip([SAMPLE_S * f64::from(tick), input, output])
        {
            column.push(value);
        }
        axis.step(input);
    }
    columns
}

pub(crate) fn signals([time_s, input, output]: &[Vec<f64>; 3]) -> Signals<'_> {
    Signals {
        time_s,
        input,
        output,
        samples_per_point: 1,
        sample_period_s: SAMPLE_S,
        breaks: &[],
    }
}

fn identified_with(options: &Options) -> Identification {
    identify(&signals(&relay_test()), options)
}

// A report prints the estimate in this order: the parameters of the structure, then the input bias.
#[test]
fn an_estimate_lists_its_parameters_in_the_order_of_the_structure() {
    let found = identified_with(&Options::default()).outcome.unwrap();
    let listed: Vec<Parameter> = found
        .estimate
        .iter()
        .map(|(parameter, _)| parameter)
        .collect();
    let expected = [
        Parameter::K,
        Parameter::KOverTBody,
        Parameter::TProp,
        Parameter::TBody,
        Parameter::Tau,
        Parameter::InputBias,
    ];
    assert_eq!(listed, expected);
    assert_eq!(found.estimate.structure(), Structure::Soiptd);
    assert_eq!(listed[..5], *found.estimate.structure().parameters());
    for (parameter, interval) in found.estimate.iter() {
        assert_eq!(found.estimate.get(parameter), Some(interval));
    }
    // Reported elsewhere than in the estimate.
    assert_eq!(found.estimate.get(Parameter::InverseTBody), None);
}

// The estimate is the model's, and margins and interval are those of the controller.
#[test]
fn model_estimate_and_margins_agree() {
    let found = identified_with(&Options::default()).outcome.unwrap();
    for &parameter in found.model.structure().parameters() {
        let value = found.model.parameter(parameter).unwrap();
        let estimate = found.estimate.get(parameter).unwrap().estimate.unwrap();
        // The estimate has gone through the coordinates of the estimator and back: rounding.
        assert!((estimate / value - 1.0).abs() < 1e-9, "{parameter:?}");
    }
    let design = found.design.unwrap();
    assert_eq!(
        margins(&found.model, &design.controller),
        Some(design.margins)
    );
    let interval = found.phase_margin_rad.unwrap();
    assert!(interval.holds(design.margins.phase_margin_rad));
}

// A clean simulation has no noise to limit the gains; the controller runs at the sample period of the recording, and its
// output leaves at once. What the user sets stays.
#[test]
fn a_recording_completes_the_requirements() {
    let found = identified_with(&Options::default()).outcome.unwrap();
    let completed = found.specification;
    assert_eq!(
        (completed.form, completed.style),
        (Form::Pid, Style::Balanced)
    );
    assert_eq!(completed.noise, None);
    let sample_s = completed.execution.sample_period_s;
    assert!((sample_s / SAMPLE_S - 1.0).abs() < 1e-12);
    assert_eq!(completed.execution.dead_time_s(), 0.5 * sample_s);
    let own = Specification::paper().with_execution(Execution::sampled(0.004));
    let found = identified_with(&Options::default().specification(own))
        .outcome
        .unwrap();
    // The frequency of the oscillation limits the crossover of the other styles.
    assert!(found.specification.crossover_rad_per_s.is_some());
    let mut asked = found.specification;
    asked.crossover_rad_per_s = None;
    assert_eq!(asked, own);
    assert!(found.design.unwrap().controller.pd().is_some());
    // The other styles of the same recording, with the design of the library.
    let calm = found.propose(&own.in_style(Style::Calm));
    let design = calm.outcome.unwrap();
    assert_eq!(design.controller.execution(), own.execution);
    assert!(design.robustness.unwrap().coverage >= 0.95);
    let choices = Proposal::choices(found.model.structure(), &found.specification);
    assert_eq!(choices.len(), Style::ALL.len());
}

// Noise of 1 % of the amplitude limits the gains: the noise at the actuator is at most a quarter of the relay's
// amplitude. The noise is a fixed sequence of +-sigma.
#[test]
fn noise_of_the_recording_limits_the_gains() {
    let [time_s, input, mut output] = relay_test();
    let mut state = 1_u32;
    for value in &mut output {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value += if state >> 31 == 0 { 3e-5 } else { -3e-5 };
    }
    let columns = [time_s, input, output];
    let found = identify(&signals(&columns), &Options::default())
        .outcome
        .unwrap();
    let noise = found.specification.noise.unwrap();
    assert!((noise.std / 3e-5 - 1.0).abs() < 0.1, "{noise:?}");
    assert!((noise.sample_period_s / SAMPLE_S - 1.0).abs() < 1e-12);
    assert_eq!(noise.input_amplitude, 0.5);
    let controller = found.design.unwrap().controller;
    let figures = assess(&found.model, &controller, Some(&noise)).unwrap();
    let share = figures.noise_share.unwrap();
    assert!(share > 0.05 && share < 0.26, "{share}");
}

// A phase margin out of range is a verdict that names the value. The oscillation is reported all the same.
#[test]
fn a_phase_margin_out_of_range_is_a_verdict() {
    // Zero is no limit in the style balanced, and no margin in the paper's style.
    let paper = Options::default().specification(Specification::paper());
    for (margin_rad, options) in [
        (0.0, paper),
        (-1.0, Options::default()),
        (2.0, Options::default()),
        (f64::INFINITY, paper),
        (f64::NAN, Options::default()),
    ] {
        let found = identified_with(&options.cycles(8).phase_margin_rad(margin_rad));
        let whole = identified_with(&options.phase_margin_rad(margin_rad));
        assert_eq!(whole.outcome.unwrap_err().kind(), "no_controller");
        let Err(Verdict::NoController(DesignError::PhaseMargin(named))) = found.outcome else {
            panic!("{margin_rad}: {:?}", found.outcome);
        };
        assert_eq!(named.to_bits(), margin_rad.to_bits());
        assert!(found.oscillation().is_some());
        assert_eq!(
            found.excitation.as_ref().map(Excitation::name),
            Some("relay")
        );
    }
}

#[test]
fn the_number_of_cycles_has_limits() {
    assert_eq!(Options::default().cycles, None);
    assert_eq!(Options::default().cycles(0).cycles, Some(1));
    assert_eq!(Options::default().cycles(1000).cycles, Some(MOST_CYCLES));
    // The field is public, so a value out of range is possible. It is limited where it is used: to 1, and to all steady
    // cycles, which are fewer than 50 here.
    let oscillation = |cycles: usize| {
        let mut options = Options::default();
        options.cycles = Some(cycles);
        *identified_with(&options).oscillation().unwrap()
    };
    assert_eq!(oscillation(0).cycles_used, 1);
    let all = oscillation(usize::MAX);
    assert_eq!(all.cycles_used, all.cycles_steady);
    assert!((10..MOST_CYCLES).contains(&all.cycles_used), "{all:?}");
}

// Without a pack, classification has nothing to classify by; least squares needs none.
#[test]
fn without_a_pack_least_squares_is_left() {
    let columns = relay_test();
    let outcome = |method| {
        let options = Options::default().cycles(8).method(method);
        identify_by(&signals(&columns), &options, None).outcome
    };
    assert_eq!(
        outcome(Method::Classify),
        Err(Verdict::Unknown { score: None })
    );
    let fitted = outcome(Method::Map).unwrap();
    assert_eq!(Ok(fitted), outcome(Method::Refine));
}

// A pack names what it is for as the values off board do.
#[test]
fn packs_name_structure_excitation_and_form() {
    use onecycle_onboard::pack::{CONTROLLER_FORM, EXCITATION, STRUCTURE};
    let found = identified_with(&Options::default().cycles(1));
    let excitation = found.excitation.unwrap();
    assert_eq!(STRUCTURE, Structure::Soiptd.name());
    assert_eq!(EXCITATION, excitation.name());
    assert_eq!(CONTROLLER_FORM, Form::Pd.name());
}
