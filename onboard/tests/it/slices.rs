//! Fit and classification in slices: the same results, within the stated number of slices.

use crate::common::{every, run};
use onecycle_onboard::classify::{Classifier, classify_by};
use onecycle_onboard::cycle::{Cycle, CycleDetector};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::refine::{
    PriorKnowledge, RefineError, Refined, Refiner, ShapePrior, refine, refine_with, residuals,
};
use onecycle_onboard::signature::{Signature, Signing};
use onecycle_onboard::window::Window;
use onecycle_onboard::{Relay, RelaySettings, Soiptd};

/// As on a board.
const BINS: usize = 69;
type Coarse = Window<BINS, 16>;
type Fine = Window<133, 0>;

fn process() -> Soiptd {
    Soiptd::from_acceleration_gain(4.0, 0.05, 2.0, 0.02).unwrap()
}

/// Last cycle of a relay test at 1 kHz, with two periods of input before it; `noise` is added to the outputs
/// relative to the largest one, in a fixed pattern.
fn last_cycle(process: &Soiptd, noise: f64) -> (Coarse, Fine, Cycle) {
    let settings = RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA);
    let run = run(
        process,
        &mut Relay::new(settings).unwrap(),
        0.1,
        every(1e-3, 8000),
    );
    let mut detector = CycleDetector::new();
    let cycles = (0..run.time_s.len())
        .filter_map(|k| detector.push(run.time_s[k], run.input[k] > 0.0, run.output[k]));
    let cycle = cycles.last().unwrap();
    let (begin_s, end_s) = (cycle.start_s, cycle.start_s + cycle.period_s);
    let (mut coarse, mut fine) = (Coarse::new(begin_s, 1e-3), Fine::new(begin_s, 1e-3));
    for k in 0..run.time_s.len() {
        let time_s = run.time_s[k];
        if time_s < begin_s - 2.0 * cycle.period_s || time_s > end_s {
            continue;
        }
        coarse.push_input(time_s, run.input[k]).unwrap();
        if time_s > begin_s - 5e-4 {
            // Between -1 and 1, not periodic.
            let rough = (1e4 * (k as f64).sin()).fract();
            let output = run.output[k] + noise * cycle.amplitude * rough;
            coarse.push_output(time_s, output);
            fine.push_output(time_s, output);
        }
    }
    (coarse, fine, cycle)
}

/// Result and number of slices.
fn finish(refiner: &mut Refiner<BINS>, window: &Coarse) -> (Result<Refined, RefineError>, usize) {
    for slices in 1.. {
        if let Some(outcome) = refiner.advance(window) {
            return (outcome, slices);
        }
    }
    unreachable!()
}

// With a noisy cycle all three searches end at the noise or earlier. The 12 fits of 50 slices each and as many
// steps of 150 slices are thousands of slices. The bound, for 60 steps and as many failures from each of three
// starts, is at least five times as large.
#[test]
fn a_refinement_takes_no_more_slices_than_it_says() {
    for noise in [0.0, 0.01, 0.2] {
        let (window, _, cycle) = last_cycle(&process(), noise);
        let mut refiner = Refiner::new();
        refiner
            .begin(&window, cycle.period_s, &PriorKnowledge::default())
            .unwrap();
        let most = refiner.most_slices(&window);
        let (outcome, slices) = finish(&mut refiner, &window);
        assert_eq!(outcome, refine(&window, cycle.period_s));
        assert!(
            (1000..most / 5).contains(&slices),
            "{slices} slices of {most} at noise {noise}"
        );
    }
}

// A new fit gives the same bits whatever was in progress before: dropped in the fits at the starts, in the
// search, in the covariance, and after the end.
#[test]
fn a_refiner_can_be_begun_anew_at_any_time() {
    let pack = Pack::embedded().unwrap();
    let (window, _, cycle) = last_cycle(&process(), 0.01);
    let other = Soiptd::from_acceleration_gain(-1.0, 0.2, 0.5, 0.1).unwrap();
    let (other_window, _, other_cycle) = last_cycle(&other, 0.05);
    let starts = [[2.5, 0.1, 0.05], [4.0, 0.01, 0.1]];
    let prior_knowledge = PriorKnowledge {
        may_walk: false,
        starts: &starts,
        prior: ShapePrior::of_pack(&pack),
    };
    let expected = refine_with(&window, cycle.period_s, &prior_knowledge).unwrap();
    let mut refiner = Refiner::new();
    refiner
        .begin(
            &other_window,
            other_cycle.period_s,
            &PriorKnowledge::default(),
        )
        .unwrap();
    let (_, all) = finish(&mut refiner, &other_window);
    for abandoned in [3, all / 20, all / 2, all - 40, all] {
        refiner
            .begin(
                &other_window,
                other_cycle.period_s,
                &PriorKnowledge::default(),
            )
            .unwrap();
        for _ in 0..abandoned {
            let _ = refiner.advance(&other_window);
        }
        refiner
            .begin(&window, cycle.period_s, &prior_knowledge)
            .unwrap();
        let (outcome, _) = finish(&mut refiner, &window);
        assert_eq!(outcome, Ok(expected), "abandoned after {abandoned}");
    }
}

#[test]
fn nothing_comes_of_what_was_not_begun() {
    let (window, _, cycle) = last_cycle(&process(), 0.0);
    let mut refiner = Refiner::new();
    assert_eq!(refiner.advance(&window), Some(Err(RefineError::NoFit)));
    let prior_knowledge = PriorKnowledge::default();
    refiner
        .begin(&window, cycle.period_s, &prior_knowledge)
        .unwrap();
    assert_eq!(
        refiner.begin(&Coarse::new(0.0, 1e-3), cycle.period_s, &prior_knowledge),
        Err(RefineError::NoInput)
    );
    assert_eq!(refiner.advance(&window), Some(Err(RefineError::NoFit)));
    let mut classifier = Classifier::new();
    let outcome = classifier.advance(&Pack::embedded().unwrap());
    assert!(outcome.is_some_and(|outcome| outcome.is_err()));
}

// The residual of the fit at the refined process is that of the refinement: its root mean square over the fitted
// bins, which all hold equally many samples except the last, equals the reported one up to the degrees of
// freedom, 9 of 60 bins.
#[test]
fn residuals_are_those_of_the_refinement() {
    let (window, _, cycle) = last_cycle(&process(), 0.01);
    let refined = refine(&window, cycle.period_s).unwrap();
    let mut left = [0.0; BINS];
    let bins = residuals(&window, cycle.period_s, &refined.process, &mut left).unwrap();
    let used = left[..bins].iter().filter(|left| **left != 0.0).count() as f64;
    let squares: f64 = left.iter().map(|left| left * left).sum();
    let rms = (squares / (used - 9.0)).sqrt();
    assert!(
        (rms / refined.residual_rms - 1.0).abs() < 1e-3,
        "{rms} {refined:?}"
    );
}

// 32 bins a slice: the last cycle has 125 to 128.
#[test]
fn a_signature_takes_four_slices() {
    let (_, window, cycle) = last_cycle(&process(), 0.02);
    let mut signing = Signing::NONE;
    for slice in 1..=4 {
        let found = signing.advance(&window, &cycle);
        let expected = (slice == 4).then(|| Signature::new(&window, &cycle));
        assert_eq!(found, expected, "{slice}, {} bins", window.bins().len());
    }
}

// One slice per layer, the posterior, its axis, the candidates, 15 harmonics 8 at a time, twice the response 3
// harmonics at a time, the equations, and 7 rows of the factor in two, and one for the result.
#[test]
fn a_classification_takes_as_many_slices_as_it_says() {
    let pack = Pack::embedded().unwrap();
    let slices = pack.layers().count() + 1 + 1 + 1 + 2 + 2 * (5 + 1 + 2) + 1;
    let mut classifier = Classifier::new();
    for noise in [0.0, 0.02] {
        let (_, window, cycle) = last_cycle(&process(), noise);
        let signature = Signature::new(&window, &cycle).unwrap();
        let noise_sigma = window.noise_sigma();
        let expected = classify_by(&pack, &signature, cycle.period_s, noise_sigma).unwrap();
        // Dropped after no slice, within the network, before the end, and after it.
        for abandoned in [0, 1, slices - 1, slices] {
            for until in [abandoned, slices] {
                classifier
                    .begin(&pack, &signature, cycle.period_s, noise_sigma)
                    .unwrap();
                for slice in 1..=until {
                    let found = classifier.advance(&pack);
                    assert_eq!(found, (slice == slices).then_some(Ok(expected)), "{slice}");
                }
            }
        }
    }
}
