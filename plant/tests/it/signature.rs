//! Signatures of simulated relay experiments: what they do not depend on, and how well.

use onecycle_onboard::cycle::{Cycle, CycleDetector};
use onecycle_onboard::signature::{LENGTH, Signature};
use onecycle_onboard::window::Window;
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Controller, Experiment, Noise, Sensed, Trace};

/// The paper's hover process and the period of its limit cycle at 1 ms.
const HOVER_S: [f64; 3] = [0.0321, 1.6886, 0.0237];
const PERIOD_S: f64 = 0.42;
const SAMPLE_S: f64 = 1e-3;

fn process(k: f64, scale: f64) -> Soiptd {
    let [t_prop_s, t_body_s, tau_s] = HOVER_S.map(|time_s| scale * time_s);
    Soiptd::new(k, t_prop_s, t_body_s, tau_s).unwrap()
}

/// Thirty periods with an input bias, so that the halves of a cycle differ.
fn experiment(k: f64, scale: f64) -> Experiment {
    Experiment::new(process(k, scale), scale * SAMPLE_S, 30.0 * scale * PERIOD_S)
        .with_input_bias(0.2)
}

fn relay() -> Relay {
    let settings = RelaySettings::bare(1.0, RelaySettings::DISTINGUISHING_BETA);
    Relay::new(settings).unwrap()
}

/// The relay with reversed output, for a process of negative gain.
struct Reversed(Relay);

impl Controller for Reversed {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        f64::from(self.0.step((sensed.output - reference) as f32, dt_s as f32))
    }
}

fn run(experiment: &Experiment, controller: &mut impl Controller) -> Trace {
    experiment.run(controller, &mut Noise::from_seed(0))
}

fn last_cycle(trace: &Trace) -> Cycle {
    let mut detector = CycleDetector::new();
    (0..trace.len())
        .filter_map(|row| {
            let high = trace.input[row] > 0.0;
            detector.push(trace.time_s[row], high, trace.output[row])
        })
        .last()
        .unwrap()
}

/// Signature of the last cycle, in a window that begins seven samples before it; and the number of bins per
/// period.
fn signature<const BINS: usize>(trace: &Trace) -> (Signature, f64) {
    let cycle = last_cycle(trace);
    let sample_s = trace.time_s[1] - trace.time_s[0];
    let end_s = cycle.start_s + cycle.period_s + 0.5 * sample_s;
    let mut window = Window::<BINS, 8>::new(cycle.start_s - 7.0 * sample_s, sample_s);
    for row in 0..trace.len() {
        if (window.start_s() - 0.5 * sample_s..end_s).contains(&trace.time_s[row]) {
            window.push_output(trace.time_s[row], trace.output[row]);
        }
    }
    let bins = cycle.period_s / window.bin_s();
    (Signature::new(&window, &cycle).unwrap(), bins)
}

fn apart(a: &[f32; LENGTH], b: &[f32; LENGTH]) -> f32 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max)
}

// The output is minus the other to the bit, and so are its mean and its sign.
#[test]
fn a_negative_gain_is_the_same_signature() {
    let (positive, _) = signature::<512>(&run(&experiment(1.0, 1.0), &mut relay()));
    let (negative, _) = signature::<512>(&run(&experiment(-1.0, 1.0), &mut Reversed(relay())));
    assert_eq!(negative.values, positive.values);
    assert_eq!((positive.sign, negative.sign), (1.0, -1.0));
    assert_eq!(negative.centre, -positive.centre);
    assert_eq!(negative.amplitude, positive.amplitude);
}

// The switches do not move; the difference is one rounding of f64 and one of f32: values up to 6 (the logarithm
// of the samples in a period) within 2^-22.
#[test]
fn gain_and_offset_leave_only_rounding() {
    let (unit, _) = signature::<512>(&run(&experiment(1.0, 1.0), &mut relay()));
    let (large, _) = signature::<512>(&run(&experiment(37.3, 1.0), &mut relay()));
    let away = experiment(1.0, 1.0)
        .with_reference(5.3)
        .with_initial_output(5.3);
    let (offset, _) = signature::<512>(&run(&away, &mut relay()));
    assert!(apart(&large.values, &unit.values) < 2.4e-7);
    assert!(apart(&offset.values, &unit.values) < 2.4e-7);
    assert!((large.amplitude / unit.amplitude / 37.3 - 1.0).abs() < 1e-9);
    assert!((offset.centre - unit.centre - 5.3).abs() < 1e-9);
}

// Ten times slower in all times and sampled ten times more slowly: the same numbers of samples.
#[test]
fn the_time_scale_leaves_only_rounding() {
    let (fast, _) = signature::<512>(&run(&experiment(1.0, 1.0), &mut relay()));
    let (slow, _) = signature::<512>(&run(&experiment(1.0, 10.0), &mut relay()));
    let apart = apart(&slow.values, &fast.values);
    assert!(apart < 2.4e-7, "{apart}");
}

// Bins of 1, 2, 4 and 8 samples: up to 25 / n^2 of the amplitude apart for n bins per period, and as much again
// for mean and scale.
#[test]
fn resolutions_agree() {
    let trace = run(&experiment(1.0, 1.0), &mut relay());
    let (fine, all) = signature::<600>(&trace);
    let samples = f64::from(fine.values[LENGTH - 1].exp());
    assert!(
        (all - samples).abs() < 1e-3,
        "{all} bins, {samples} samples"
    );
    for (coarse, bins) in [
        signature::<300>(&trace),
        signature::<150>(&trace),
        signature::<80>(&trace),
    ] {
        let apart = f64::from(apart(&coarse.values, &fine.values));
        assert!(apart < 50.0 / (bins * bins), "{apart} at {bins} bins");
    }
}

// A bias makes one half longer; the sign is right on either side. The amplitude of the parts is smaller than
// that of the samples by what averaging a sine over w = 2 pi / 32 takes off its top: w^2 / 24 = 1.6e-3 with the
// top in the middle of a part, w^2 / 6 = 6.4e-3 with the top between two. The third harmonic changes that by
// less than a fifth.
#[test]
fn signs_and_sizes_are_those_of_the_cycle() {
    for input_bias in [-0.5, -0.2, 0.0, 0.2, 0.5] {
        let biased = experiment(1.0, 1.0).with_input_bias(input_bias);
        let trace = run(&biased, &mut relay());
        let (cycle, (signature, _)) = (last_cycle(&trace), signature::<512>(&trace));
        assert_eq!(signature.sign, 1.0);
        assert_eq!(signature.values[LENGTH - 2], cycle.duty as f32);
        let short = 1.0 - signature.amplitude / cycle.amplitude;
        assert!(short > 1.3e-3 && short < 7.7e-3, "{short} at {input_bias}");
    }
}
