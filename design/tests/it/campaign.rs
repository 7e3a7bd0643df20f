//! Designs on random processes of every structure, judged by a Nyquist plot that shares nothing with the search.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use onecycle_design::{
    Controller, DesignError, Form, Model, Specification, Structure, Style, design,
    noise_amplification,
};

use crate::random::Random;

/// Largest turn of `1 + L` that counts as one step (rad), and longest step of the frequency, as a share.
const LARGEST_TURN_RAD: f64 = 0.2;
const LONGEST_STEP: f64 = 0.02;

/// The plot begins where `|L|` exceeds the first of these, and ends above a resonance where it falls below the second.
const LARGE: f64 = 1e3;
const SMALL: f64 = 1e-2;

/// Nyquist plot of a loop: the turn of `1 + L` about zero (rad), and the largest `|S|` and `|T|`.
struct Nyquist {
    turn_rad: f64,
    ms: f64,
    mt: f64,
}

fn nyquist(model: &Model, controller: &Controller) -> Nyquist {
    let at = |omega: f64| model.frequency_response(omega) * controller.frequency_response(omega);
    let (linear, pid) = (model.linear(), controller.pid());
    let stages = linear.structure().stages();
    let tau_s = linear.tau_s() + controller.execution().dead_time_s();
    let resonance = linear.pair()[1].sqrt() * stages.pairs as f64;
    // Below all corners, and where the integrators make |L| large.
    let times = [
        tau_s,
        linear.lags_s().iter().sum(),
        stages.poles as f64 / linear.pole_per_s().abs(),
        linear.pair()[0] / linear.pair()[1] * stages.pairs as f64,
        1.0 / resonance,
        pid.kp / pid.ki,
        pid.kd / pid.kp,
    ];
    let finite = times.into_iter().filter(|time| time.is_finite());
    let mut omega = 1e-3 / finite.fold(0.0, f64::max);
    while at(omega).norm() < LARGE {
        omega *= 0.5;
    }
    let mut here = 1.0 + at(omega);
    let mut found = Nyquist {
        turn_rad: 0.0,
        ms: 1.0,
        mt: 0.0,
    };
    while omega < 2.0 * resonance || (here - 1.0).norm() > SMALL {
        let mut step = (LONGEST_STEP * omega).min(LARGEST_TURN_RAD / tau_s);
        let (there, part) = loop {
            let there = 1.0 + at(omega + step);
            let part = (there / here).arg();
            if part.abs() < LARGEST_TURN_RAD || step < 1e-12 * omega {
                break (there, part);
            }
            step *= 0.5;
        };
        omega += step;
        found.turn_rad += part;
        found.ms = found.ms.max(1.0 / there.norm());
        found.mt = found.mt.max(((there - 1.0) / there).norm());
        here = there;
    }
    found.turn_rad -= here.arg();
    found
}

/// Poles of the loop in the origin.
fn integrators(model: &Model, form: Form) -> usize {
    integrators_of(model) + usize::from(form.has_integral())
}

fn integrators_of(model: &Model) -> usize {
    let linear = model.linear();
    let stages = linear.structure().stages();
    stages.integrators + usize::from(stages.poles > 0 && linear.pole_per_s() == 0.0)
}

/// Whether a controller keeps what was asked, to 1e-3. The plot of a stable loop turns by a quarter for each integrator
/// and by half for an unstable pole.
fn verdict(model: &Model, asked: &Specification, controller: &Controller) -> &'static str {
    let found = nyquist(model, controller);
    let unstable = usize::from(model.linear().pole_per_s() < 0.0);
    let turn_rad = (integrators(model, asked.form) + 2 * unstable) as f64 * FRAC_PI_2;
    let noise = asked.noise.map_or(0.0, |noise| {
        let kappa = noise_amplification(model, controller, noise.sample_period_s);
        kappa.unwrap_or(f64::INFINITY) * noise.std / noise.input_amplitude
    });
    if (found.turn_rad - turn_rad).abs() > 0.1 {
        "unstable"
    } else if found.ms > asked.ms * 1.001 || found.mt > asked.mt * 1.001 {
        "limit not kept"
    } else if noise > asked.noise_share * 1.001 {
        "noise not kept"
    } else {
        "designed"
    }
}

/// What becomes of one random case. A refusal that its process does not explain is "unexplained".
fn outcome(case: u64) -> &'static str {
    let mut random = Random::new(case);
    let model = random.process();
    let asked = random.specification(&model);
    let form = asked.form;
    let has_integrator = integrators_of(&model) > 0;
    match design(&model, &asked) {
        Ok(found) => verdict(&model, &asked, &found.controller),
        Err(DesignError::NoIntegral(Form::P | Form::Pd)) if !has_integrator => {
            "no integral term for a process that settles"
        }
        Err(DesignError::NoRate(Form::CascadePi | Form::CascadePid))
            if !has_integrator || model.linear().structure().stages().states() == 1 =>
        {
            "cascade for a process without rate"
        }
        Err(DesignError::Infeasible { .. })
            if matches!(form, Form::P | Form::Pi) && integrators_of(&model) > 1 =>
        {
            "P or PI for two integrators"
        }
        Err(DesignError::Infeasible { .. }) if asked.noise.is_some() => "limit of the noise",
        Err(_) => "unexplained",
    }
}

/// Outcomes of the cases with their numbers, on all cores.
fn campaign(cases: Range<u64>) -> BTreeMap<&'static str, Vec<u64>> {
    let (next, outcomes) = (AtomicU64::new(cases.start), Mutex::new(BTreeMap::new()));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let case = next.fetch_add(1, Ordering::Relaxed);
                    if case >= cases.end {
                        break;
                    }
                    let outcome = outcome(case);
                    let mut outcomes = outcomes.lock().unwrap();
                    outcomes.entry(outcome).or_insert_with(Vec::new).push(case);
                }
            });
        }
    });
    let mut outcomes: BTreeMap<_, Vec<u64>> = outcomes.into_inner().unwrap();
    outcomes
        .values_mut()
        .for_each(|cases| cases.sort_unstable());
    outcomes
}

#[expect(clippy::print_stdout, reason = "a campaign shows its counts")]
fn check(cases: Range<u64>) {
    let count = cases.end - cases.start;
    let found = campaign(cases);
    let of = |outcome: &str| found.get(outcome).map_or(0, Vec::len);
    for (outcome, cases) in &found {
        let first = &cases[..cases.len().min(12)];
        println!("{outcome}: {}, first {first:?}", cases.len());
    }
    for never in [
        "unstable",
        "limit not kept",
        "noise not kept",
        "unexplained",
    ] {
        assert_eq!(of(never), 0, "{never}: {:?}", found.get(never));
    }
    assert!(of("designed") as u64 > count / 2);
    // Noise that asks for gains thousands of times below those of the other limits: the search gives such loops up.
    assert!(of("limit of the noise") as u64 <= count / 300);
}

// A design is stable, keeps its limits, and is refused for a reason only.
#[test]
fn designs_of_a_thousand_processes() {
    check(0..1000);
}

// The variables FROM and TO of the environment choose a part of the cases, each of which has its own seed.
#[test]
#[ignore = "ten minutes on two cores; see docs/benchmarks/controllers.md"]
fn designs_of_a_hundred_thousand_processes() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |value| value.parse().unwrap())
    };
    check(number("FROM", 0)..number("TO", 100_000));
}

// Unstable processes with dead times up to what a controller can bear: a design is stable and keeps its limits. One that does not
// exist at these limits does at the least that is reported.
#[test]
fn designs_of_unstable_processes() {
    let mut designed = 0;
    for case in 0..100 {
        let mut random = Random::new(case);
        let model = random.unstable_process();
        let mut asked =
            Specification::new([Form::Pi, Form::Pid][case as usize % 2], Style::Balanced);
        (asked.ms, asked.mt) = (3.0, 3.0);
        let found = match design(&model, &asked) {
            Err(DesignError::Infeasible {
                least_peak: Some(least),
                ..
            }) => {
                (asked.ms, asked.mt) = (1.01 * least, 1.01 * least);
                design(&model, &asked)
            }
            found => found,
        };
        let found = found.unwrap_or_else(|error| panic!("{case}: {error} of {model:?}"));
        assert_eq!(
            verdict(&model, &asked, &found.controller),
            "designed",
            "{case}"
        );
        designed += usize::from(asked.ms == 3.0);
    }
    assert!(designed > 50, "{designed}");
}

// No PI controller of a grid has lower peaks than the least that is reported of an unstable process, and one is as low.
#[test]
fn the_least_peak_of_an_unstable_process_is_that_of_a_grid() {
    use onecycle_design::{Linear, Pid};
    for tau_s in [0.2, 0.3] {
        let model: Model = Linear::new(Structure::Foptd)
            .with_gain(1.0)
            .with_pole_per_s(-1.0)
            .with_tau_s(tau_s)
            .into();
        let mut asked = Specification::new(Form::Pi, Style::Balanced);
        (asked.ms, asked.mt) = (1.05, 1.05);
        let Err(DesignError::Infeasible {
            least_peak: Some(least),
            ..
        }) = design(&model, &asked)
        else {
            panic!("no PI keeps a peak of 1.05");
        };
        let mut lowest = f64::INFINITY;
        for kp in (0..60).map(|k| 1.05 * 1.03_f64.powi(k)) {
            for ti in (0..16).map(|k| 1.5_f64.powi(k)) {
                let found = nyquist(&model, &Pid::new(kp, kp / ti, 0.0).into());
                if (found.turn_rad - 3.0 * FRAC_PI_2).abs() < 0.1 {
                    lowest = lowest.min(found.ms.max(found.mt));
                }
            }
        }
        assert!(
            (lowest / least - 1.0).abs() < 0.02,
            "{tau_s}: {lowest} {least}"
        );
    }
}

// An integrator behind a lag of 1/8,000 of the dead time, under a cascade with rate PID: the filter and not the lag tells
// above which frequencies the loop only falls, and there are too many below the lag.
#[test]
fn a_lag_far_below_the_dead_time_is_designed() {
    assert_eq!(outcome(1652), "designed");
}

// By hand: the plot of 1 + k e^(-s)/s turns by a quarter below the ultimate gain pi/2, and by a whole turn less above.
#[test]
fn the_judge_sees_instability() {
    use onecycle_design::{Linear, Pid};
    let model: Model = Linear::new(Structure::Iptd).with_tau_s(1.0).into();
    let turn = |gain: f64| nyquist(&model, &Pid::new(gain, 0.0, 0.0).into()).turn_rad;
    assert!((turn(1.5) - FRAC_PI_2).abs() < 0.01);
    assert!((turn(1.6) + 3.0 * FRAC_PI_2).abs() < 0.01);
}
