//! Recordings of only one complete cycle: the paper's promise.

use onecycle_design::soiptd_pd::deterioration::{Deterioration, deterioration};
use onecycle_design::soiptd_pd::optimum::pd;
use onecycle_design::{Model, Parameter, Specification};
use onecycle_identify::{
    Identification, Identified, Method, Options, Remark, Signals, Verdict, identify,
};
use onecycle_lab::experiments::{Campaign, RelayExperiment};
use onecycle_onboard::Soiptd;
use onecycle_onboard::cycle::{Cycle, CycleDetector};
use onecycle_plant::Trace;

/// The paper's multirotors with 1 % noise, the bias left in.
const CAMPAIGN: Campaign = Campaign {
    cases: 200,
    bias: 0.5,
    sigma: 0.01,
    cycles: 8,
    ..Campaign::QUIET
};
/// Number of periods after which every relay has settled.
const PERIODS: f64 = 25.0;
const SAMPLE_S: f64 = 1e-3;

/// An experiment from which recordings are cut.
struct Experiment {
    case: RelayExperiment,
    trace: Trace,
}

impl Experiment {
    fn first(count: u64) -> impl Iterator<Item = Self> {
        (0..count).map(|n| {
            let case = CAMPAIGN.experiment(n).unwrap();
            let (trace, _) = case.run(PERIODS).unwrap();
            Self { case, trace }
        })
    }

    /// Cycles from rise to rise, or from fall to fall.
    fn cycles(&self, from_rises: bool) -> Vec<Cycle> {
        let mut detector = CycleDetector::new();
        let rows = 0..self.trace.len();
        rows.filter_map(|k| {
            let high = self.trace.input[k] > 0.0;
            detector.push(self.trace.time_s[k], high == from_rises, 0.0)
        })
        .collect()
    }

    /// The last but one of [`Experiment::cycles`].
    fn steady_cycle(&self, from_rises: bool) -> Cycle {
        let cycles = self.cycles(from_rises);
        cycles[cycles.len() - 2]
    }

    /// Identifies from the rows between `from_s` and `to_s` and the row before, so that an edge at
    /// either end is included.
    fn identify(&self, from_s: f64, to_s: f64, method: Method) -> Identification {
        let row = |time_s: f64| {
            (self.trace.time_s).partition_point(|&before| before < time_s - 0.5 * SAMPLE_S)
        };
        let rows = row(from_s) - 1..row(to_s) + 1;
        let signals = Signals {
            time_s: &self.trace.time_s[rows.clone()],
            input: &self.trace.input[rows.clone()],
            output: &self.trace.output[rows],
            samples_per_point: 1,
            sample_period_s: SAMPLE_S,
            breaks: &[],
        };
        identify(
            &signals,
            &Options::default()
                .cycles(8)
                .method(method)
                .specification(Specification::paper()),
        )
    }

    /// Cost of the controller above or below the optimum, as a fraction of it; asserts that it is
    /// stable.
    fn deterioration(&self, identified: &Identified) -> f64 {
        let process = &self.case.process;
        let best = pd(process, Specification::paper().phase_margin_rad).unwrap();
        match deterioration(
            identified.design.unwrap().controller.pd().unwrap(),
            process,
            &best,
        ) {
            Deterioration::Stable { relative, .. } => relative.abs(),
            Deterioration::Unstable => panic!("unstable: {:?}", self.case),
        }
    }

    /// Whether the intervals of gain, both lags, delay and bias contain the truth.
    fn held(&self, identified: &Identified) -> [bool; 5] {
        let process = &self.case.process;
        // With the lags in order.
        let (sum_per_s, ratio) = process.pole_sum();
        let truth = Soiptd::from_pole_sum(1.0, sum_per_s, ratio, process.tau_s()).unwrap();
        let truth = truth
            .with_gain_scaled(process.jerk_gain() * truth.t_prop_s())
            .unwrap();
        let holds = |parameter| {
            let truth = match parameter {
                Parameter::InputBias => self.case.input_bias,
                _ => Model::from(truth).parameter(parameter).unwrap(),
            };
            identified.estimate.get(parameter).unwrap().holds(truth)
        };
        [
            Parameter::KOverTBody,
            Parameter::TProp,
            Parameter::TBody,
            Parameter::Tau,
            Parameter::InputBias,
        ]
        .map(holds)
    }
}

/// Mean and worst of deteriorations (%).
fn mean_and_worst(costs: &[f64]) -> (f64, f64) {
    let mean = costs.iter().sum::<f64>() / costs.len() as f64;
    let worst = costs.iter().copied().fold(0.0, f64::max);
    (100.0 * mean, 100.0 * worst)
}

/// Results for one kind of recording.
#[derive(Default)]
struct Tally {
    costs: Vec<f64>,
    held: [usize; 5],
}

impl Tally {
    /// Adds a recording of one cycle and `past` periods before it.
    fn add(&mut self, experiment: &Experiment, from_rises: bool, past: f64) {
        let cycle = experiment.steady_cycle(from_rises);
        let to_s = cycle.start_s + cycle.period_s;
        let from_s = cycle.start_s - past * cycle.period_s;
        let found = experiment.identify(from_s, to_s, Method::Map);
        let oscillation = found.oscillation().unwrap();
        let duty = if from_rises {
            cycle.duty
        } else {
            1.0 - cycle.duty
        };
        assert_eq!((oscillation.cycles_used, oscillation.cycles_steady), (1, 1));
        for (found, expected) in [
            (oscillation.start_s, cycle.start_s),
            (oscillation.period_s, cycle.period_s),
            (oscillation.duty, duty),
        ] {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        assert!(is_one_cycle(&found, true) || is_one_cycle(&found, false));
        let identified = found.outcome.as_ref().unwrap();
        self.costs.push(experiment.deterioration(identified));
        for (count, holds) in self.held.iter_mut().zip(experiment.held(identified)) {
            *count += usize::from(holds);
        }
    }
}

fn is_one_cycle(found: &Identification, is_known: bool) -> bool {
    found.remarks.contains(&Remark::OneCycle { is_known })
}

// One cycle of a steady oscillation, edge to edge, with 0 or 0.5 periods before it; none is refused or
// unstable. With all of the past, the same cycles cost 0.098 % on average and 1.2 % at worst. Without
// it the cost is 0.17 % and 2.0 % (1.1 % from fall to fall), because the jitter of the relay makes the
// assumed repetition inexact. The mean varies by 8 % from seed to seed; the limit is three of that. A
// true share of 90 % of 200 intervals is 180 +- 4.2; the limits are three of that.
#[test]
fn one_steady_cycle_is_enough() {
    const KINDS: [(bool, f64); 4] = [(true, 0.0), (true, 0.5), (false, 0.0), (false, 0.5)];
    let mut tallies: [Tally; KINDS.len()] = Default::default();
    for experiment in Experiment::first(200) {
        for (tally, (from_rises, past)) in tallies.iter_mut().zip(KINDS) {
            tally.add(&experiment, from_rises, past);
        }
    }
    for (Tally { costs, held }, kind) in tallies.iter().zip(KINDS) {
        let (mean, worst) = mean_and_worst(costs);
        println!("{kind:?}: J mean {mean:.3} %, worst {worst:.2} %; held {held:?}");
        assert!(mean < 0.21 && worst < 3.0, "{kind:?}: {mean} {worst}");
        assert!(held.iter().all(|held| (167..=193).contains(held)));
    }
}

// Without a pack the cycle is not known to be steady, and its initial state stays unknown. Of 200 the
// mean is 0.40 %, the worst 4.9 %, and one is too uncertain.
#[test]
fn without_a_pack_nothing_is_taken_for_steady() {
    let mut costs = Vec::new();
    for experiment in Experiment::first(100) {
        let cycle = experiment.steady_cycle(true);
        let to_s = cycle.start_s + cycle.period_s;
        let found = experiment.identify(cycle.start_s, to_s, Method::Refine);
        assert!(is_one_cycle(&found, false));
        let identified = found.outcome.as_ref().ok();
        costs.extend(identified.map(|identified| experiment.deterioration(identified)));
    }
    let (mean, worst) = mean_and_worst(&costs);
    println!(
        "{} of 100: J mean {mean:.3} %, worst {worst:.2} %",
        costs.len()
    );
    assert!(costs.len() >= 98 && mean < 0.6 && worst < 8.0);
}

// The first complete cycle of a test from rest: the pack wrongly takes 8 of 200 for steady, and 29 are
// refused. For the others the fit does not assume a steady oscillation. None is unstable, although the
// smallest amplitudes are below the noise: worst 27 % of 200.
#[test]
fn a_transient_is_hardly_taken_for_steady() {
    let (mut known, mut worst) = (0, 0.0_f64);
    for experiment in Experiment::first(100) {
        let cycle = experiment.cycles(false)[0];
        let to_s = cycle.start_s + cycle.period_s;
        let found = experiment.identify(cycle.start_s, to_s, Method::Map);
        known += usize::from(is_one_cycle(&found, true));
        // A transient of plain switches is no relay that leads: a controller far above its frequency is withdrawn.
        if let Ok(identified) = &found.outcome
            && identified.design.is_some()
        {
            worst = experiment.deterioration(identified).max(worst);
        }
    }
    println!("known {known} of 100, J worst {:.1} %", 100.0 * worst);
    assert!(known <= 10 && worst < 0.5, "{known} {worst}");
}

// With 1.5 periods before it there are two complete cycles, and both are fitted: 0.09 % on average of
// 200; one of 200 is refused because its cycles differ.
#[test]
fn a_period_and_a_half_more_is_a_second_cycle() {
    let mut costs = Vec::new();
    for experiment in Experiment::first(100) {
        let cycle = experiment.steady_cycle(true);
        let from_s = cycle.start_s - 1.5 * cycle.period_s;
        let found = experiment.identify(from_s, cycle.start_s + cycle.period_s, Method::Map);
        match &found.outcome {
            Ok(identified) => {
                assert_eq!(found.oscillation().unwrap().cycles_used, 2);
                costs.push(experiment.deterioration(identified));
            }
            Err(verdict) => assert_eq!(*verdict, Verdict::TooShort { cycles: 2 }),
        }
    }
    let (mean, worst) = mean_and_worst(&costs);
    println!(
        "{} of 100: J mean {mean:.3} %, worst {worst:.2} %",
        costs.len()
    );
    assert!(costs.len() >= 98 && mean < 0.13 && worst < 3.0);
}

// Any recording of less than a period has no two switches in the same direction, so no cycle.
#[test]
fn less_than_a_cycle_is_refused() {
    let experiment = Experiment::first(1).next().unwrap();
    let cycle = experiment.steady_cycle(true);
    for (from, to) in [(0.0, 0.95), (0.1, 1.0), (0.2, 1.2), (-0.3, 0.3)] {
        let [from_s, to_s] = [from, to].map(|part| cycle.start_s + part * cycle.period_s);
        let found = experiment.identify(from_s, to_s, Method::Map);
        assert_eq!(
            found.outcome,
            Err(Verdict::TooShort { cycles: 0 }),
            "{from}"
        );
        assert_eq!((found.oscillation(), found.remarks.len()), (None, 0));
    }
}
