//! A trained classifier as a method: its file, its answers.

use onecycle_lab::experiments::{Campaign, IDENTIFICATION_PERIODS};
use onecycle_lab::experiments::{SAMPLE_S, signals_of};
use onecycle_lab::judge::evaluate::{Answer, Feedback, Judge};
use onecycle_lab::learn::onnx;
use onecycle_lab::learn::train::{Layer, Loss, Network};
use onecycle_lab::paper::classifier::{ClassifierRecipe, INPUTS, PickRule};
use onecycle_lab::paper::network::{Card, FORMAT, NoPick, PaperNetwork, PaperNetworkError};
use onecycle_onboard::Soiptd;
use onecycle_plant::Trace;

const RECIPE: &str = r#"{
  "network": "classifier", "seed": 1, "deterioration": 0.3, "fit": "stretched", "hidden": [4], "dropout": 0.0,
  "examples": 100, "class_every": 0, "verification": 1, "bias": 0.5, "sigma": 0.03, "protocol": "trimmed", "tests": [],
  "method": {"sgd": {"momentum": 0.9, "decay": 0.0}},
  "schedule": {"rate": 0.05, "shape": {"cosine": {"epochs": 1.0, "least": 0.01}}},
  "batch": 32, "epochs": 1, "losses": [{"loss": "cross_entropy"}]
}"#;

/// Times (s) of two classes.
const CLASSES_S: [[f64; 3]; 2] = [[0.05, 0.8, 0.02], [0.1, 1.5, 0.05]];

fn card() -> Card {
    let recipe: ClassifierRecipe = serde_json::from_str(RECIPE).unwrap();
    Card {
        recipe,
        loss: Loss::CrossEntropy,
        rule: PickRule::MostLikely,
        classes_s: CLASSES_S.to_vec(),
    }
}

/// A network that always picks a class: all its weights are zero, the bias of that class is one.
fn always(class: usize) -> Network {
    let network = Network::zeros(INPUTS, &[Layer::Dense { outputs: 2 }]).unwrap();
    let mut numbers = network.numbers();
    let at = numbers.len() - 2 + class;
    numbers[at] = 1.0;
    network.with_numbers(&numbers).unwrap()
}

fn file(network: &Network, card: &Card) -> Vec<u8> {
    let card = serde_json::to_string(card).unwrap();
    onnx::export(network, None, &[(FORMAT, card)]).unwrap()
}

/// A relay test of class 0 at a gain of 3, without noise and bias.
fn test_of_the_first() -> (Soiptd, Trace) {
    let [t_prop_s, t_body_s, tau_s] = CLASSES_S[0];
    let process = Soiptd::new(3.0, t_prop_s, t_body_s, tau_s).unwrap();
    let experiment = Campaign::QUIET.quiet_experiment(process, 1).unwrap();
    let (trace, _) = experiment.run(IDENTIFICATION_PERIODS).unwrap();
    (process, trace)
}

// The true class has the true gain and the optimal controller, but for what sampling does to its gain; the other class costs
// more. The file keeps its card.
#[test]
fn the_class_that_is_picked() {
    let (process, trace) = test_of_the_first();
    let judge = Judge::new(&process).unwrap();
    let costs = [0, 1].map(|class| {
        let network = PaperNetwork::read(&file(&always(class), &card())).unwrap();
        assert_eq!(network.card, card());
        let answer = network.answer(&signals_of(&trace, SAMPLE_S)).unwrap();
        let found = answer.process.unwrap();
        assert!((found.t_prop_s() / CLASSES_S[class][0] - 1.0).abs() < 1e-12);
        if class == 0 {
            let gain = found.k_over_t_body() / process.k_over_t_body();
            assert!((gain - 1.0).abs() < 1e-2, "{gain}");
        }
        assert!(matches!(answer.feedback, Feedback::Pd(_)));
        judge
            .deterioration(answer.feedback)
            .relative()
            .unwrap()
            .abs()
    });
    assert!(costs[0] < 1e-2 && costs[1] > costs[0], "{costs:?}");
}

// Levels 3 and 13 in the place of -1 and 1, from 20 s on: a gain a fifth as large, and five times the controller. Ten times
// as slow, no class has its period.
#[test]
fn a_relay_of_any_levels() {
    let (_, trace) = test_of_the_first();
    let network = PaperNetwork::read(&file(&always(0), &card())).unwrap();
    let plain = network.answer(&signals_of(&trace, SAMPLE_S)).unwrap();
    let mut other = trace.clone();
    other.input.iter_mut().for_each(|u| *u = 8.0 + 5.0 * *u);
    other.time_s.iter_mut().for_each(|t| *t += 20.0);
    let pick = network
        .answer_to_any(&signals_of(&other, SAMPLE_S))
        .unwrap();
    let gain = |answer: &Answer| answer.process.unwrap().k_over_t_body();
    // A sample more or less of the cycle.
    let ratio = 5.0 * gain(&pick.answer) / gain(&plain);
    assert!((ratio - 1.0).abs() < 1e-2, "{ratio}");
    let (Feedback::Pd(pd), Feedback::Pd(of_plain)) = (pick.answer.feedback, plain.feedback) else {
        panic!("no PD");
    };
    assert!((pd.kp / of_plain.kp / 5.0 - 1.0).abs() < 1e-2);
    let periods = pick.period_s / pick.class_period_s;
    assert!((periods - 1.0).abs() < 0.1, "{periods}");
    other.time_s.iter_mut().for_each(|t| *t *= 10.0);
    let none = network.answer_to_any(&signals_of(&other, 10.0 * SAMPLE_S));
    assert!(matches!(none, Err(NoPick::Period { .. })), "{none:?}");
}

#[test]
fn what_it_refuses() {
    let plain = onnx::export(&always(0), None, &[]).unwrap();
    let error = PaperNetwork::read(&plain).unwrap_err();
    assert!(matches!(error, PaperNetworkError::Card(_)), "{error}");
    let mut three = card();
    three.classes_s.push([0.2, 1.5, 0.05]);
    let error = PaperNetwork::read(&file(&always(0), &three)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "it has 4520 inputs and 2 outputs; 3 classes need 4520 and 3"
    );
    assert!(PaperNetwork::read(b"no model").is_err());

    let network = PaperNetwork::read(&file(&always(0), &card())).unwrap();
    let (_, mut trace) = test_of_the_first();
    trace.input.fill(0.0);
    let none = network.answer(&signals_of(&trace, SAMPLE_S)).unwrap_err();
    assert_eq!(none, NoPick::NotSteady);
}
