//! Campaigns of recordings: combinations, reproducibility, and the intervals of a small one.

use onecycle_design::{Parameter, Structure};
use onecycle_lab::experiments::RecordingCampaign;
use onecycle_lab::experiments::campaign::Measure;
use onecycle_lab::experiments::recording::{Excitation, ProcessRange, SensorDefects, Signal, Span};
use onecycle_lab::judge::recording::{RecordingTally, recording_outcome};

/// Lag processes with a chirp or a PRBS, in open loop.
fn campaign() -> RecordingCampaign {
    let excitation = |signal, band_hz, pulse_s| Excitation {
        signal,
        amplitude: 1.0,
        band_hz,
        pulse_s,
        beta: -0.73,
    };
    RecordingCampaign {
        measure: Measure::Recording,
        cases: 60,
        seed: 1,
        sample_rate_hz: 50.0,
        durations_s: vec![8.0],
        noise: 0.02,
        bias: 0.1,
        structure: Some(Structure::Foptd),
        processes: vec![ProcessRange {
            structure: Structure::Foptd,
            k: Some(Span::Range(0.5, 2.0)),
            k_over_t_body: None,
            t_prop_s: None,
            t_prop2_s: None,
            t_body_s: Some(Span::Range(0.2, 0.5)),
            natural_frequency_rad_per_s: None,
            zeta: None,
            tau_s: Some(Span::Value(0.05)),
        }],
        excitations: vec![
            excitation(Signal::Chirp, Some([0.1, 4.0]), None),
            excitation(Signal::Prbs, None, Some(0.2)),
        ],
        disturbances: vec![],
        loops: vec![],
        sensors: vec![SensorDefects {
            drop_outs: 0.02,
            ..SensorDefects::default()
        }],
    }
}

// Case 5 of two signals and three durations: signal 5 mod 2 = 1, duration 5 / 2 = 2. Its parameters lie in their ranges, and
// it is the same to the bit whatever ran before it.
#[test]
fn cases_are_combinations_and_reproducible() {
    let mut campaign = campaign();
    campaign.durations_s = vec![2.0, 3.0, 4.0];
    campaign.validate().unwrap();
    let at = campaign.combination(5);
    assert_eq!((at.excitation, at.duration, at.disturbance), (1, 2, 0));
    let case = campaign.record(5).unwrap();
    let _ = campaign.record(4).unwrap();
    assert_eq!(case, campaign.record(5).unwrap());
    assert_ne!(case.trace, campaign.record(11).unwrap().trace);
    // 200 samples, of which 2 % are dropped.
    let samples = case.trace.len();
    assert!((180..200).contains(&samples), "{samples}");
    for (parameter, low, high) in [
        (Parameter::K, 0.5, 2.0),
        (Parameter::TBody, 0.2, 0.5),
        (Parameter::Tau, 0.05, 0.05),
    ] {
        let value = case.model.parameter(parameter).unwrap();
        assert!((low..=high).contains(&value), "{parameter:?} {value}");
    }
}

// Of 60 intervals that hold the truth with probability 0.9, 54 do, with a standard deviation of 2.3: 47 to 60 are three of
// that. The mean error of 60 has a deviation of 0.13, the rms of 0.09.
#[test]
fn a_small_campaign_is_calibrated() {
    let campaign = campaign();
    let mut tally = RecordingTally::default();
    for n in 0..campaign.cases {
        let recording = campaign.record(n).unwrap();
        tally.add(
            Structure::Foptd,
            &recording_outcome(&recording, &campaign.options()),
        );
    }
    assert_eq!((tally.refusals(), tally.true_structures()), (0, 60));
    for key in ["k", "t_body_s", "tau_s", "input_bias"] {
        let parameter = tally.parameters[key];
        let (held, bias, rms) = (parameter.coverage(), parameter.bias(), parameter.rms());
        assert!(held.unwrap() >= 47.0 / 60.0, "{key}: {parameter:?}");
        assert!(bias.unwrap().abs() < 0.4, "{key}: {parameter:?}");
        // A disturbance too weak to show may move the bias most, so its interval is wider than this noise alone asks for.
        let least = if key == "input_bias" { 0.5 } else { 0.7 };
        assert!((least..1.3).contains(&rms.unwrap()), "{key}: {parameter:?}");
    }
}
