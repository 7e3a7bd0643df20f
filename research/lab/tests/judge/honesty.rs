//! Campaigns of wrong data: reproducibility, the plants, and the judge on cases known by hand.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use onecycle_design::{Model, Structure};
use onecycle_lab::experiments::actuator::Actuator;
use onecycle_lab::experiments::campaign::Measure;
use onecycle_lab::experiments::defect::plant::DefectPlant;
use onecycle_lab::experiments::honesty::{
    Fault, FaultyRecording, HonestyCampaign, Kind, Test, TruePlant,
};
use onecycle_lab::experiments::recording::{DisturbanceLevel, ProcessRange, Span};
use onecycle_lab::experiments::{Defect, HonestyError, Oscillation};
use onecycle_lab::judge::honesty::{
    Accepted, Broken, HonestyOutcome, HonestyTally, honesty_outcome,
};
use onecycle_onboard::Soiptd;
use onecycle_plant::{Disturbances, Noise};

fn kind(name: &str, fault: Option<Fault>, strength: Option<Span>) -> Kind {
    Kind {
        name: name.to_owned(),
        control: fault.is_none(),
        fault,
        strength,
        defect: None,
        named_by: vec![],
        test: Test::default(),
        process: None,
        noise: None,
        bias: None,
        periods: None,
        samples_per_period: None,
        wind: DisturbanceLevel::default(),
    }
}

/// Right data, and data with two faults.
fn campaign() -> HonestyCampaign {
    let range = |low, high| Some(Span::Range(low, high));
    HonestyCampaign {
        measure: Measure::Honesty,
        cases: 2,
        seed: 1,
        noise: Span::Value(0.005),
        bias: 0.2,
        periods: 20.0,
        samples_per_period: Span::Value(150.0),
        process: ProcessRange {
            structure: Structure::Soiptd,
            k: None,
            k_over_t_body: Some(Span::Value(1.0)),
            t_prop_s: range(0.03, 0.06),
            t_prop2_s: None,
            t_body_s: range(0.5, 1.0),
            natural_frequency_rad_per_s: None,
            zeta: None,
            tau_s: range(0.02, 0.04),
        },
        kinds: vec![
            kind("right", None, None),
            kind("swapped", Some(Fault::SwappedColumns), None),
            kind("late", Some(Fault::InputLate), Some(Span::Value(0.03))),
        ],
    }
}

fn recording(kind: usize, n: u64) -> FaultyRecording {
    let campaign = campaign();
    campaign.validate().unwrap();
    campaign.record(kind, n).unwrap().unwrap()
}

fn accepted(recording: &FaultyRecording) -> Accepted {
    match honesty_outcome(Some(recording)) {
        HonestyOutcome::Accepted(accepted) => accepted,
        other => panic!("{other:?}"),
    }
}

// The fault changes the columns and not the plant; what ran before changes nothing. An input that is late by 3 % of 150
// samples is late by ceil(4.5) = 5.
#[test]
fn a_case_depends_on_seed_and_number_alone() {
    let (right, late) = (recording(0, 1), recording(2, 1));
    assert_eq!(right, recording(0, 1));
    assert_eq!(right.truth, late.truth);
    assert_eq!(right.columns.output, late.columns.output);
    let count = right.columns.input.len();
    assert_eq!(right.columns.input[..count - 5], late.columns.input[5..]);
    assert_ne!(right.truth, recording(0, 0).truth);
    assert_eq!(right.columns.time_s.len(), 20 * 150);
}

#[test]
fn right_data_are_accepted_and_every_promise_holds() {
    for n in 0..2 {
        let found = accepted(&recording(0, n));
        assert_eq!(found.broken, [], "{found:?}");
        let (promised, found) = (found.promised_margin_deg, found.true_margin_deg);
        assert!(found.unwrap() > promised.unwrap() - 1.0);
    }
    let swapped = honesty_outcome(Some(&recording(1, 0)));
    assert_eq!(swapped, HonestyOutcome::Refused("no_relay".to_owned()));
}

// Dead time that the recording does not show turns the open loop by the crossover times this time and leaves its magnitude:
// twice the time costs twice the margin.
#[test]
fn hidden_dead_time_costs_margin_in_proportion() {
    let mut recording = recording(0, 0);
    let honest = accepted(&recording);
    let process = recording.truth.process;
    let mut lost_deg = |hidden_s: f64| {
        recording.truth.process = process.with_tau_s(process.tau_s() + hidden_s);
        let found = accepted(&recording);
        let lost = honest.true_margin_deg.unwrap() - found.true_margin_deg.unwrap();
        (lost, found.broken)
    };
    let (once_deg, broken) = lost_deg(0.006);
    let is_tau =
        |broken: &Broken| matches!(broken, Broken::Parameter { key, .. } if key == "tau_s");
    assert!(broken.iter().any(is_tau), "{broken:?}");
    let (twice_deg, broken) = lost_deg(0.012);
    assert!(once_deg > 1.0, "{once_deg}");
    assert!((twice_deg / once_deg - 2.0).abs() < 1e-9);
    let is_margin = |broken: &Broken| matches!(broken, Broken::Margin { .. });
    assert_eq!(broken.iter().any(is_margin), twice_deg > 3.0 + 1.0);
}

// Six times the gain is beyond any gain margin of a `Ms` of 1.6 that is not far larger than its guarantee of 2.67.
#[test]
fn a_hidden_gain_makes_the_loop_unstable() {
    let mut recording = recording(0, 0);
    let process = recording.truth.process;
    recording.truth.process = process.with_gain(6.0 * process.gain());
    let found = accepted(&recording);
    assert!(found.is_unstable(), "{found:?}");
    assert!(found.true_margin_deg.unwrap() < 0.0, "{found:?}");
}

// An integral cannot bring a valve to rest that sticks within half of the relay's amplitude and then jumps.
#[test]
fn a_sticking_valve_ends_in_a_limit_cycle() {
    let mut recording = recording(0, 0);
    recording.truth.actuator = Actuator::Sticking { band: 0.5 };
    let found = accepted(&recording);
    let amplitude = found.broken.iter().find_map(|broken| match broken {
        Broken::Unstable { limit_cycle } => *limit_cycle,
        _ => None,
    });
    assert!(
        amplitude.is_some_and(|a| (0.02..10.0).contains(&a)),
        "{found:?}"
    );
}

#[test]
fn a_tally_by_hand() {
    let accepted = |remarks: &[&str], broken: Vec<Broken>| {
        HonestyOutcome::Accepted(Accepted {
            remarks: remarks.iter().map(|&remark| remark.to_owned()).collect(),
            is_silent: !remarks.contains(&"noisy"),
            structure: "soiptd".to_owned(),
            strength: None,
            promised_margin_deg: None,
            true_margin_deg: None,
            paper_margin_deg: None,
            deterioration: None,
            held: BTreeMap::new(),
            broken,
        })
    };
    let unstable = || vec![Broken::Unstable { limit_cycle: None }];
    let strings =
        |kinds: &[&str]| -> Vec<String> { kinds.iter().map(|&kind| kind.to_owned()).collect() };
    let named_by = strings(&["clock"]);
    let mut tally = HonestyTally::default();
    for outcome in [
        HonestyOutcome::NotRecorded,
        HonestyOutcome::Refused("no_relay".to_owned()),
        accepted(&["clock"], unstable()),
        accepted(&["noisy"], vec![]),
        accepted(&["noisy", "one_amplitude"], unstable()),
        accepted(&["one_amplitude"], unstable()),
        accepted(&[], vec![]),
        accepted(&[], unstable()),
    ] {
        tally.add(&outcome, &named_by);
    }
    let expected = HonestyTally {
        cases: 7,
        refused: 1,
        named: 1,
        remarked_right: 1,
        remarked_wrong: 1,
        silent_right: 1,
        silent_wrong: 2,
        unstable: 4,
        unstable_unnamed: 3,
    };
    assert_eq!(tally, expected);
    assert_eq!(tally.and(HonestyTally::default()), tally);
}

fn process() -> Soiptd {
    Soiptd::new(1.0, 0.05, 0.3, 0.02).unwrap()
}

fn oscillation() -> Oscillation {
    Oscillation::approximate(&process(), -0.73).unwrap()
}

// A sine for 40 periods, then correlated with sine and cosine over 10 more: the transients have decayed by then, and whole
// periods leave no trace of a constant offset.
#[test]
fn frequency_responses_are_those_of_the_simulated_plants() {
    let oscillation = oscillation();
    let omega = 0.8 * TAU / oscillation.period_s;
    let steps = 2000.0;
    let step_s = TAU / omega / steps;
    for defect in [
        Defect::None,
        Defect::ExtraLag { lag_s: 0.07 },
        Defect::SlowSensor { lag_s: 0.04 },
        Defect::RateSensor,
        Defect::SecondPath {
            share: 0.4,
            delay_s: 0.05,
        },
        Defect::Resonance {
            rad_per_s: 2.5 * omega,
            damping: 0.05,
            mass_ratio: 0.0,
        },
        Defect::Resonance {
            rad_per_s: 2.5 * omega,
            damping: 0.05,
            mass_ratio: 0.4,
        },
    ] {
        let truth = TruePlant {
            process: Model::from(process()).linear(),
            defect,
            actuator: Actuator::Ideal,
            last_gain: 1.0,
            oscillation,
        };
        let mut noise = Noise::from_seed(0);
        let mut plant = truth.plant(step_s, &Disturbances::default(), false, &mut noise);
        let mut sum = num_complex::Complex64::ZERO;
        for step in 0..(50.0 * steps) as usize {
            let phase = TAU * step as f64 / steps;
            if step as f64 >= 40.0 * steps {
                sum += plant.output() * num_complex::Complex64::cis(-phase);
            }
            // The hold delays by half a step.
            plant.step((phase + 0.5 * TAU / steps).sin(), 0.0, step_s, &mut noise);
        }
        // A sine is the imaginary part of cis: its sum with cis(-phase) is n/(2j) of the response.
        let found = sum * 2.0 / (10.0 * steps) * num_complex::Complex64::I;
        let expected = truth.responses()[0](omega);
        let error = (found - expected).norm() / expected.norm();
        assert!(error < 2e-3, "{defect:?}: {found} {expected}");
    }
}

fn moved(defect: Defect, inputs: &[(f64, f64)]) -> DefectPlant {
    let undamped = Soiptd::from_acceleration_gain(2.0, 0.05, 0.0, 0.0).unwrap();
    let step_s = 1e-3;
    let mut plant = DefectPlant::new(&undamped, &defect, oscillation(), step_s);
    for &(input, duration_s) in inputs {
        for _ in 0..(duration_s / step_s).round() as usize {
            plant.step(input);
        }
    }
    plant
}

// Without damping the rate is K/T_body times the integral of the force, K/T_body = 2. After 1 for 1 s and 0 for 3 s that is
// 1 - 0.05 s of the rise and the falling lag's 0.15 s. A rate of 0.5 at which the drag takes a quarter of h stops growing at
// 1, where it takes all of it. A force of 1 that acts as 1 + 0.3 gives 2 * 1.3 of rate in each second.
#[test]
fn new_defects_by_hand() {
    let lag = Defect::AsymmetricLag { falling_s: 0.15 };
    let rate = moved(lag, &[(1.0, 1.0), (0.0, 3.0)]).rate();
    assert!((rate - 2.0 * (1.0 - 0.05 + 0.15)).abs() < 1e-6, "{rate}");
    let drag = Defect::Drag {
        force: 0.25,
        rate: 0.5,
    };
    let rate = moved(drag, &[(1.0, 10.0)]).rate();
    assert!((rate - 1.0).abs() < 1e-9, "{rate}");
    let thrust = Defect::Thrust { curvature: 0.3 };
    let grown = moved(thrust, &[(1.0, 3.0)]).rate() - moved(thrust, &[(1.0, 2.0)]).rate();
    assert!((grown - 2.6).abs() < 1e-6, "{grown}");
}

#[test]
fn wrong_fields_are_named() {
    let refused = |change: &dyn Fn(&mut HonestyCampaign)| {
        let mut campaign = campaign();
        change(&mut campaign);
        campaign.validate().unwrap_err()
    };
    let no_kinds = refused(&|campaign| campaign.kinds.clear());
    assert!(
        no_kinds.to_string().starts_with("kinds must be"),
        "{no_kinds}"
    );
    let late = refused(&|campaign| campaign.kinds[2].strength = None);
    assert!(matches!(late, HonestyError::Strength { .. }), "{late}");
    assert!(late.to_string().contains("\"late\""), "{late}");
    let noise = refused(&|campaign| campaign.noise = Span::Value(f64::NAN));
    assert!(noise.to_string().starts_with("noise must be"), "{noise}");
    let mut undelayed = campaign();
    undelayed.process.tau_s = Some(Span::Value(0.0));
    undelayed.process.structure = Structure::IntegratorLag;
    undelayed.process.k = Some(Span::Value(1.0));
    undelayed.process.k_over_t_body = None;
    undelayed.process.t_body_s = None;
    undelayed.validate().unwrap();
    let error = undelayed.record(0, 0).map(|_| ()).unwrap_err();
    assert!(
        matches!(error, HonestyError::NoOscillation { .. }),
        "{error}"
    );
}
