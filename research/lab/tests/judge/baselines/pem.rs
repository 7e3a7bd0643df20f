//! The prediction error method.

use onecycle_identify::{Signals, find_oscillation};
use onecycle_lab::experiments::relays::SweptRelay;
use onecycle_lab::experiments::signals_of;
use onecycle_lab::experiments::{Campaign, Measure};
use onecycle_lab::judge::baselines::BaselineError;
use onecycle_lab::judge::baselines::pem::{
    Data, InitialState, InputBias, PemSettings, fit, identify,
};
use onecycle_onboard::{RelayError, RelaySettings};

use super::{SAMPLE_S, cost, margin, process, relay_test, run};

/// The paper's five guesses for (0.02, 0.3, 0.001), table V.
const GUESSES_S: [[f64; 3]; 5] = [
    [0.015, 0.2, 5e-4],
    [0.015, 0.2, 0.1],
    [0.3, 2.0, 5e-4],
    [0.3, 2.0, 0.1],
    [0.15, 1.0, 0.05],
];

fn from(start_s: [f64; 3], data: Data) -> PemSettings {
    PemSettings {
        starts_s: vec![start_s],
        ..PemSettings::paper(data)
    }
}

// The model equals the process and there is no noise: the fit is the truth, to the rounding that stops
// the optimiser. From rest over the whole recording, from one steady cycle with an unknown state, and
// with a bias of 0.3, which is estimated.
#[test]
fn the_truth_is_found_without_noise() {
    let truth = process(2.5, 0.05, 0.5, 0.0207);
    for (initial_state, input_bias, bias) in [
        (InitialState::Rest, InputBias::Ignored, 0.0),
        (InitialState::Rest, InputBias::Estimated, 0.3),
        (InitialState::Estimated, InputBias::Ignored, 0.0),
        (InitialState::Estimated, InputBias::Estimated, 0.3),
    ] {
        let trace = relay_test(truth, bias, 30.0);
        let signals = signals_of(&trace, SAMPLE_S);
        let window = match initial_state {
            InitialState::Rest => 0..trace.len(),
            InitialState::Estimated => {
                let found = find_oscillation(&signals, 1).unwrap();
                let index = |time_s: f64| (time_s / SAMPLE_S).round() as usize;
                index(found.start_s)..index(found.end_s)
            }
        };
        let settings = PemSettings {
            initial_state,
            input_bias,
            ..from([0.06, 0.4, 0.025], Data::Whole)
        };
        let found = fit(&signals, window, &settings).unwrap();
        let times = [
            (found.process.k().unwrap(), 2.5),
            (found.process.t_prop_s(), 0.05),
            (found.process.t_body_s().unwrap(), 0.5),
            (found.process.tau_s(), 0.0207),
        ];
        for (value, expected) in times {
            assert!(
                (value / expected - 1.0).abs() < 1e-6,
                "{settings:?}: {found:?}"
            );
        }
        if let Some(input_bias) = found.input_bias {
            assert!((input_bias - bias).abs() < 1e-6, "{found:?}");
        }
    }
}

// Table V of the paper, without noise or bias. Its first guess converges (J 0.0 %). Its second, fourth
// and fifth, whose dead time is a period or half a period, do not: unstable in the paper, unstable or
// hundreds of per cent here. The starts of `PemSettings::fair` converge without any guess.
#[test]
fn the_guess_decides() {
    let truth = process(1.0, 0.02, 0.3, 0.001);
    let trace = relay_test(truth, 0.0, 30.0);
    let signals = signals_of(&trace, SAMPLE_S);
    let costs = GUESSES_S.map(|guess_s| {
        let settings = PemSettings {
            input_bias: InputBias::Ignored,
            ..from(guess_s, Data::LastCycle)
        };
        cost(identify(&signals, &settings, margin()), &truth)
    });
    assert!(costs[0].is_some_and(|cost| cost.abs() < 1e-6), "{costs:?}");
    for index in [1, 3, 4] {
        assert!(costs[index].is_none_or(|cost| cost > 0.5), "{costs:?}");
    }
    let fair = cost(identify(&signals, &PemSettings::fair(), margin()), &truth);
    assert!(fair.is_some_and(|cost| cost.abs() < 1e-6), "{fair:?}");
}

// Table VI of the paper at -0.3 h, from the guess that converges without bias. If the bias is ignored:
// unstable from the sweep, and off by more than a tenth from a cycle. If the mean is removed: within 5
// % from a cycle, as in the paper, but more than 5 % from the sweep, which does not consist of whole
// cycles. If the bias is estimated: no error.
#[test]
fn a_bias_spoils_it_unless_it_is_estimated() {
    let truth = process(1.0, 0.02, 0.3, 0.001);
    let cycle = relay_test(truth, -0.3, 40.0);
    let mut relay = SweptRelay::paper(RelaySettings::new(1.0, -0.1)).unwrap();
    let sweep = run(truth, -0.3, SweptRelay::PAPER_DURATION_S, &mut relay);
    let costs = |input_bias| {
        [(Data::LastCycle, &cycle), (Data::Whole, &sweep)].map(|(data, trace)| {
            let settings = PemSettings {
                input_bias,
                ..from(GUESSES_S[0], data)
            };
            let signals = signals_of(trace, SAMPLE_S);
            cost(identify(&signals, &settings, margin()), &truth)
        })
    };
    let [of_cycle, of_sweep] = costs(InputBias::Ignored);
    assert!(of_cycle.is_none_or(|cost| cost.abs() > 0.1), "{of_cycle:?}");
    assert!(of_sweep.is_none_or(|cost| cost.abs() > 0.1), "{of_sweep:?}");
    let [of_cycle, of_sweep] = costs(InputBias::MeanRemoved);
    assert!(
        of_cycle.is_some_and(|cost| cost.abs() < 0.05),
        "{of_cycle:?}"
    );
    assert!(
        of_sweep.is_none_or(|cost| cost.abs() > 0.05),
        "{of_sweep:?}"
    );
    for cost in costs(InputBias::Estimated) {
        assert!(cost.is_some_and(|cost| cost.abs() < 1e-6), "{cost:?}");
    }
}

// The describing function gives the periods at beta = -0.1 and -0.9 with an error of up to 30 %. The
// sweep follows a symmetric triangle of phases between them; its end periods are within a third of
// those.
#[test]
fn the_sweep_goes_from_slow_to_fast() {
    let truth = process(1.0, 0.15, 1.0, 0.05);
    let mut relay = SweptRelay::paper(RelaySettings::bare(1.0, 0.0)).unwrap();
    let trace = run(truth, 0.0, SweptRelay::PAPER_DURATION_S, &mut relay);
    let rises: Vec<f64> = (1..trace.len())
        .filter(|&k| trace.input[k] > trace.input[k - 1])
        .map(|k| trace.time_s[k])
        .collect();
    let first_s = rises[2] - rises[1];
    let last_s = rises[rises.len() - 1] - rises[rises.len() - 2];
    for (period_s, beta) in [(first_s, -0.1), (last_s, -0.9)] {
        let (omega, _) = truth.describing_function_oscillation(1.0, beta).unwrap();
        let ratio = period_s * omega / std::f64::consts::TAU;
        assert!((0.75..1.33).contains(&ratio), "{beta}: {ratio}");
    }
    assert!(first_s > 1.5 * last_s, "{first_s} {last_s}");

    let of = |sweep| SweptRelay::new(RelaySettings::bare(1.0, 0.0), sweep, 20.0).err();
    assert_eq!(of((-0.1, -1.0)), Some(RelayError::Beta(-1.0)));
    assert_eq!(of((1.5, -0.9)), Some(RelayError::Beta(1.5)));
}

// Processes of the paper's domain with 3 % noise and a bias of up to half the relay's amplitude. Every
// one still switches in the last four seconds of the sweep (periods are at most 4 s), and none runs
// away: outputs stay within thirty amplitudes of the oscillation.
#[test]
fn the_sweep_survives_noise_and_bias() {
    let campaign = Campaign {
        measure: Measure::Relay,
        cases: 30,
        seed: 7,
        bias: 0.5,
        sigma: 0.03,
        ..Campaign::QUIET
    };
    for n in 0..campaign.cases {
        let case = campaign.experiment(n).unwrap();
        let settings = RelaySettings {
            preroll_s: 0.1,
            ..RelaySettings::new(1.0, -0.1)
        };
        let mut relay = SweptRelay::paper(settings).unwrap();
        let trace = case.simulate(&mut relay, SweptRelay::PAPER_DURATION_S);
        let tail = &trace.input[trace.len() - 4000..];
        assert!(tail.iter().any(|&u| u != tail[0]), "{case:?}");
        let farthest = trace
            .true_output
            .iter()
            .fold(0.0_f64, |most, y| most.max(y.abs()));
        assert!(
            farthest < 30.0 * case.oscillation.amplitude,
            "{case:?}: {farthest}"
        );
    }
}

#[test]
fn errors_say_what_is_wrong() {
    let trace = relay_test(process(1.0, 0.02, 0.3, 0.01), 0.0, 10.0);
    let signals = signals_of(&trace, SAMPLE_S);
    let settings = PemSettings::paper(Data::Whole);
    let short = fit(&signals, 0..7, &settings);
    assert_eq!(short, Err(BaselineError::TooShort { samples: 7 }));
    let beyond = fit(&signals, 0..trace.len() + 1, &settings);
    assert!(
        matches!(beyond, Err(BaselineError::TooShort { .. })),
        "{beyond:?}"
    );
    let start = fit(&signals, 0..300, &from([0.1, -1.0, 0.1], Data::Whole));
    assert_eq!(
        start,
        Err(BaselineError::Setting("a time of a start", -1.0))
    );
    let uneven = Signals {
        sample_period_s: 1.001e-3,
        ..signals
    };
    assert_eq!(fit(&uneven, 0..300, &settings), Err(BaselineError::Uneven));
    let constant = vec![1.0; trace.len()];
    let still = Signals {
        input: &constant,
        ..signals
    };
    let found = identify(&still, &PemSettings::fair(), margin());
    assert!(
        matches!(found, Err(BaselineError::NoOscillation(_))),
        "{found:?}"
    );
}
