//! The measured response at the harmonics of an oscillation, compared with the exact response of the
//! process.

use num_complex::Complex64;
use onecycle_identify::{Harmonic, harmonics};
use onecycle_identify::{Oscillation, Signals, find_oscillation};
use onecycle_lab::experiments::{Campaign, signals_of};
use onecycle_onboard::Soiptd;
use onecycle_onboard::relay::Relay;
use onecycle_plant::{Experiment, Noise, Sensor, Trace};

const SAMPLE_S: f64 = 1e-3;
/// T_prop, T_body, tau (s): slow and fast multirotors of the paper's space and its hexacopter.
const PROCESSES: [[f64; 3]; 5] = [
    [0.3, 2.0, 0.1],
    [0.3, 2.0, 0.0005],
    [0.015, 0.2, 0.1],
    [0.015, 0.2, 0.0005],
    [0.0321, 1.6886, 0.0237],
];
/// A process whose relay switches after 219 and 365 samples in every cycle with bias, and after 296
/// without: 592 samples, a multiple of four.
const EVEN: [f64; 3] = PROCESSES[2];

fn process([t_prop, t_body, tau]: [f64; 3]) -> Soiptd {
    Soiptd::new(1.0, t_prop, t_body, tau).unwrap()
}

/// A noise-free test, long enough for the transient to vanish.
fn settled(process: Soiptd, bias: f64) -> Trace {
    let mut experiment = Campaign::QUIET.quiet_experiment(process, 1).unwrap();
    experiment.input_bias = bias;
    experiment.run(80.0).unwrap().0
}

fn found_in(signals: &Signals<'_>, cycles: usize) -> Oscillation {
    let found = find_oscillation(signals, cycles).unwrap();
    assert_eq!(found.cycles_used, cycles);
    found
}

fn truth(process: &Soiptd, omega: f64) -> Complex64 {
    let value = Complex64::from_polar(
        process.magnitude(omega.abs()),
        process.phase_rad(omega.abs()),
    );
    if omega > 0.0 { value } else { value.conj() }
}

fn error(process: &Soiptd, harmonic: &Harmonic) -> f64 {
    let truth = truth(process, harmonic.omega_rad_per_s);
    (harmonic.response - truth).norm() / truth.norm()
}

fn orders(harmonics: &[Harmonic]) -> Vec<usize> {
    harmonics.iter().map(|harmonic| harmonic.order).collect()
}

// The relay's square wave has coefficients proportional to 1/n at odd n, and sampling adds those at n +
// m N to that at n, so the measured response is G(j n w) + sum_m n/(n + m N) G(j (n + m N) w). The
// terms fall as m^-4: those beyond 300 are 1e-8 of the sum, which is at most 2e-4 of G. That leaves
// 1e-11 and the rounding of the simulation. A hold of half a sample would add pi n/N, 0.03 at N = 96.
// Compared with G alone the error is 25 (n/N)^4: the lag of the actuator is at least a fortieth of the
// period, and below it the response falls as n^-2 only.
#[test]
fn a_settled_oscillation_has_the_response_of_the_process() {
    for times in PROCESSES {
        let (process, trace) = (process(times), settled(process(times), 0.0));
        let signals = signals_of(&trace, SAMPLE_S);
        let found = found_in(&signals, 8);
        let harmonics = harmonics(&signals, &found, 9);
        assert_eq!(orders(&harmonics), [1, 3, 5, 7, 9], "{times:?}");
        let points = found.period_s / SAMPLE_S;
        for harmonic in harmonics {
            let n = harmonic.order as f64;
            let at = |m: i32| n + f64::from(m) * points.round();
            let sampled: Complex64 = (-300..=300)
                .map(|m| truth(&process, at(m) * harmonic.omega_rad_per_s / n) * (n / at(m)))
                .sum();
            let off = (harmonic.response - sampled).norm() / sampled.norm();
            let plain = error(&process, &harmonic);
            assert!(off < 1e-11, "{times:?} {n} {off:e}");
            assert!(
                plain < 25.0 * (n / points).powi(4),
                "{times:?} {n} {plain:e}"
            );
        }
    }
}

// High for 3/8 of the cycle: even orders are excited too, except for the eighth, sin(8 pi 3/8) = 0.
// With the input negated the gain is negative and the rest is the same.
#[test]
fn a_bias_brings_even_orders_and_a_negative_gain_its_sign() {
    let process = process(EVEN);
    let trace = settled(process, 0.25);
    let mirrored_input: Vec<f64> = trace.input.iter().map(|input| -input).collect();
    for (input, sign) in [(&trace.input, 1.0), (&mirrored_input, -1.0)] {
        let signals = Signals {
            input,
            ..signals_of(&trace, SAMPLE_S)
        };
        let found = found_in(&signals, 8);
        let harmonics = harmonics(&signals, &found, 9);
        assert_eq!(orders(&harmonics), [1, 2, 3, 4, 5, 6, 7, 9]);
        for harmonic in harmonics {
            let expected = truth(&process, harmonic.omega_rad_per_s) * sign;
            let off = (harmonic.response - expected).norm() / expected.norm();
            let aliases = 25.0 * (harmonic.order as f64 / 584.0).powi(4);
            assert!(off < aliases, "{} {off:e}", harmonic.order);
        }
    }
}

// Four samples per point from a rise on: 148 points per cycle, still exact to the aliases. Half a point
// too late, 1.5 samples, would be 0.016 rad at the first order; the average over a point takes 0.6 %
// off a sine of the ninth order.
#[test]
fn points_of_several_samples_are_as_exact() {
    let process = process(EVEN);
    let trace = settled(process, 0.0);
    let found = found_in(&signals_of(&trace, SAMPLE_S), 8);
    let offset = (found.start_s / SAMPLE_S).round() as usize % 4;
    let mean = |column: &[f64]| -> Vec<f64> {
        let groups = column[offset..].chunks_exact(4);
        groups
            .map(|group| group.iter().sum::<f64>() / 4.0)
            .collect()
    };
    let (input, output) = (mean(&trace.input), mean(&trace.output));
    let time_s: Vec<f64> = trace.time_s[offset..]
        .chunks_exact(4)
        .map(|group| group[0])
        .collect();
    let signals = Signals {
        time_s: &time_s,
        input: &input,
        output: &output,
        samples_per_point: 4,
        sample_period_s: SAMPLE_S,
        breaks: &[],
    };
    for harmonic in harmonics(&signals, &found_in(&signals, 8), 9) {
        let off = error(&process, &harmonic);
        assert!(
            off < 25.0 * (harmonic.order as f64 / 148.0).powi(4),
            "{off:e}"
        );
    }
}

// Sample periods that vary by a fifth: half a sample of hold would still be 0.7 %. The lines fitted at
// both ends see parts of the wave that differ by a sample or two, and the cycles differ slightly; 0.02
// % in all.
#[test]
fn uneven_stamps_will_do() {
    let process = process(PROCESSES[4]);
    let quiet = Campaign::QUIET.quiet_experiment(process, 1).unwrap();
    let mut relay = Relay::new(quiet.relay).unwrap();
    let mut experiment = Experiment::new(process, SAMPLE_S, 15.0);
    experiment.jitter = 0.2;
    let trace = experiment.run(&mut relay, &mut Noise::from_seed(1));
    let signals = signals_of(&trace, SAMPLE_S);
    let first = harmonics(&signals, &found_in(&signals, 8), 1)[0];
    assert!(error(&process, &first) < 1e-3, "{first:?}");
}

/// Mean of |error|^2 over twice the variance; 1 if the stated deviation is right.
fn squared_errors(errors: &[(Harmonic, Complex64)]) -> f64 {
    let square = |(harmonic, truth): &(Harmonic, Complex64)| {
        (harmonic.response - truth).norm_sqr() / (2.0 * harmonic.deviation.powi(2))
    };
    errors.iter().map(square).sum::<f64>() / errors.len() as f64
}

// Noise of 1 % on a settled oscillation, 200 seeds. Each value is half a chi-square with two degrees of
// freedom, with mean 1 and variance 1, so the mean of 200 is 1 with a deviation of 0.07; the limit is
// 0.25. The noise of the drift is an eighth of the variance for 8 cycles and a third for two.
#[test]
fn the_scatter_under_noise_is_the_deviation() {
    let process = process(PROCESSES[4]);
    let trace = settled(process, 0.0);
    let sensor = Sensor::noisy(0.01 * trace.amplitude_of_last(1000));
    for (cycles, most) in [(8, 3), (2, 1)] {
        let clean = signals_of(&trace, SAMPLE_S);
        let exact = harmonics(&clean, &found_in(&clean, cycles), most);
        let mut errors = vec![Vec::new(); exact.len()];
        for seed in 0..200 {
            let mut rng = Noise::from_seed(seed);
            let output: Vec<f64> = trace
                .output
                .iter()
                .map(|y| sensor.read(*y, &mut rng))
                .collect();
            let signals = Signals {
                output: &output,
                ..clean
            };
            let found = harmonics(&signals, &found_in(&signals, cycles), most);
            assert_eq!(orders(&found), orders(&exact));
            for ((list, noisy), exact) in errors.iter_mut().zip(found).zip(&exact) {
                list.push((noisy, exact.response));
            }
        }
        for list in &errors {
            assert!(
                (squared_errors(list) - 1.0).abs() < 0.25,
                "{}",
                squared_errors(list)
            );
        }
    }
}

// With 1 % noise and a bias in the loop of the relay the cycles differ. Over 200 cases the mean square
// is 1.1 and its median 0.76; with the drift left in it is 5.2. The mean of 50 has a deviation of 0.16.
#[test]
fn cycles_that_differ_are_worth_as_much() {
    let campaign = Campaign {
        bias: 0.5,
        sigma: 0.01,
        trim: true,
        ..Campaign::QUIET
    };
    let errors: Vec<(Harmonic, Complex64)> = (0..50)
        .map(|number| {
            let case = campaign.experiment(number).unwrap();
            let trace = case.run(25.0).unwrap().0;
            let signals = signals_of(&trace, SAMPLE_S);
            let first = harmonics(&signals, &found_in(&signals, 8), 1)[0];
            (first, truth(&case.process, first.omega_rad_per_s))
        })
        .collect();
    assert!(
        (0.5..1.8).contains(&squared_errors(&errors)),
        "{}",
        squared_errors(&errors)
    );
}

// A recording cut at the ends of the cycles has no samples beyond them to measure a drift; here there
// is no drift.
#[test]
fn a_recording_of_the_cycles_alone_will_do() {
    let process = process(EVEN);
    let trace = settled(process, 0.0);
    let whole = signals_of(&trace, SAMPLE_S);
    let found = found_in(&whole, 2);
    let index = |time_s: f64| (time_s / SAMPLE_S).round() as usize;
    let rows = index(found.start_s)..index(found.end_s) + 1;
    let signals = Signals {
        time_s: &trace.time_s[rows.clone()],
        input: &trace.input[rows.clone()],
        output: &trace.output[rows],
        ..whole
    };
    let first = harmonics(&signals, &found, 1)[0];
    assert!(error(&process, &first) < 1e-9, "{first:?}");
}

#[test]
fn what_has_no_fundamental_has_no_harmonics() {
    let trace = settled(process(EVEN), 0.0);
    let signals = signals_of(&trace, SAMPLE_S);
    let found = found_in(&signals, 8);
    assert_eq!(harmonics(&signals, &found, 0), []);
    let level = vec![0.3; trace.len()];
    assert_eq!(
        harmonics(
            &Signals {
                input: &level,
                ..signals
            },
            &found,
            5
        ),
        []
    );
    for (start_s, end_s, cycles_used) in [
        (found.start_s, found.start_s, 8),
        (found.end_s, found.start_s, 8),
        (1e6, 1e6 + 1.0, 8),
        (found.start_s, found.end_s + 1e3, 8),
        (found.start_s - 1e3, found.end_s, 8),
        (found.start_s, found.end_s - 0.4 * SAMPLE_S, 8),
        (f64::NAN, found.end_s, 8),
        (found.start_s, f64::INFINITY, 8),
        (found.start_s, found.end_s, 0),
        (found.start_s, found.end_s, 100_000),
    ] {
        let mut wrong = found;
        (wrong.start_s, wrong.end_s, wrong.cycles_used) = (start_s, end_s, cycles_used);
        assert_eq!(
            harmonics(&signals, &wrong, 5),
            [],
            "{start_s} {end_s} {cycles_used}"
        );
    }
    // More orders than the samples resolve: only those above the noise level are returned.
    let many = harmonics(&signals, &found, 10_000);
    assert!(
        many.iter()
            .all(|harmonic| harmonic.order < 296 && harmonic.response.is_finite())
    );
}
