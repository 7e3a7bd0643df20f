//! What a fit cannot see: clocks, amplitudes, frequencies that were not excited.

use onecycle_design::{Parameter, Specification};
use onecycle_identify::{Identification, Options, Remark, Verdict, identify};
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{FixedStepProcess, Noise, NoiseSource};

use crate::outcomes::{SAMPLE_S, signals};

/// Dead time (s).
const TAU_S: f64 = 0.0237;
/// Standard deviation of the measurement noise (output unit), half a per cent of the oscillation.
const SIGMA: f64 = 3e-5;

/// The paper's hexacopter under a relay of amplitude 1, and of 0.6 after half of the time if `has_two`. The actuator
/// ignores inputs up to `dead_zone` (input unit).
fn relay_test(beta: f32, has_two: bool, dead_zone: f64) -> [Vec<f64>; 3] {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, TAU_S).unwrap();
    let mut axis = FixedStepProcess::new(&process, SAMPLE_S);
    let settings = RelaySettings {
        noise_sigma: SIGMA as f32,
        ..RelaySettings::new(1.0, beta)
    };
    let mut relay = Relay::new(settings).unwrap();
    let mut noise = Noise::from_seed(3);
    let mut columns = [vec![], vec![], vec![]];
    for tick in 0..10_000 {
        if has_two && tick == 5000 {
            relay.set_amplitude(0.6).unwrap();
        }
        let output = axis.output() + SIGMA * noise.standard_normal();
        let input = f64::from(relay.step(-output as f32, SAMPLE_S as f32));
        for (column, value) in (columns.iter_mut()).zip([SAMPLE_S * f64::from(tick), input, output])
        {
            column.push(value);
        }
        axis.step(input.signum() * (input.abs() - dead_zone).max(0.0));
    }
    columns
}

fn found(columns: &[Vec<f64>; 3], options: &Options) -> Identification {
    identify(&signals(columns), options)
}

fn has(found: &Identification, kind: &str) -> bool {
    found.remarks.iter().any(|remark| remark.kind() == kind)
}

/// The input stamped `late` samples after it acted.
fn logged_late(columns: &[Vec<f64>; 3], late: usize) -> [Vec<f64>; 3] {
    let [time_s, input, output] = columns.clone();
    let mut later = vec![input[0]; late];
    later.extend(&input[..input.len() - late]);
    [time_s, later, output]
}

// A relay with beta -0.73 averages the error over 3 % of its half period and so switches some 2 ms later: at -0.70.
#[test]
fn the_relay_shows_its_law() {
    let columns = relay_test(-0.73, false, 0.0);
    let found = found(&columns, &Options::default().beta(Some(-0.73)));
    let seen = found.switching.unwrap();
    assert!(found.outcome.is_ok() && !has(&found, "clock_unknown"));
    assert!(
        (seen.beta + 0.70).abs() < 0.02 && seen.deviation < 0.01,
        "{seen:?}"
    );
}

// Logged 20 ms late, the process seems to have next to no dead time. The relay's law tells: a remark if the relay is not
// known, a refusal if it is, and the right dead time once the offset is corrected.
#[test]
fn a_late_input_contradicts_the_law() {
    let columns = logged_late(&relay_test(-0.73, false, 0.0), 20);
    let unknown = found(&columns, &Options::default());
    let offset = unknown.remarks.iter().find_map(|remark| match remark {
        Remark::ClockUnknown {
            late_s,
            phase_margin_rad,
            ..
        } => late_s.zip(*phase_margin_rad),
        _ => None,
    });
    let (late_s, margin_rad) = offset.unwrap();
    assert!((late_s - 0.020).abs() < 0.003, "{late_s}");
    let promised = unknown.outcome.as_ref().unwrap().phase_margin_rad.unwrap();
    assert!(margin_rad < promised.low.unwrap());
    let known = found(&columns, &Options::default().beta(Some(-0.73)));
    assert!(matches!(known.outcome, Err(Verdict::ClockOffset { seen, .. }) if seen > -0.6));
    let corrected = found(&columns, &Options::default().input_late_s(Some(0.02)));
    assert!(!has(&corrected, "clock_unknown"));
    let tau = corrected
        .outcome
        .unwrap()
        .estimate
        .get(Parameter::Tau)
        .unwrap();
    assert!((tau.estimate.unwrap() - TAU_S).abs() < 1e-3, "{tau:?}");
}

// A relay that leads switches at -0.37 if it has halved its beta, or if its input was logged late by an eighth of the
// period: nothing tells which, and so it is a remark.
#[test]
fn a_relay_that_halved_its_beta_is_not_refused() {
    let columns = relay_test(-0.365, false, 0.0);
    let halved = found(&columns, &Options::default().beta(Some(-0.73)));
    assert!(halved.outcome.is_ok() && has(&halved, "clock_unknown"));
    let other = found(&columns, &Options::default().beta(Some(-0.5)));
    assert!(matches!(other.outcome, Err(Verdict::ClockOffset { .. })));
}

// The noise of this recording is far too small for a relay that switches 8 ms before its ratio.
#[test]
fn an_output_that_was_logged_late_is_remarked_on() {
    let [time_s, input, output] = relay_test(-0.73, false, 0.0);
    let mut later = vec![output[0]; 8];
    later.extend(&output[..output.len() - 8]);
    let found = found(&[time_s, input, later], &Options::default());
    let late_s = found.remarks.iter().find_map(|remark| match remark {
        Remark::ClockUnknown { late_s, .. } => *late_s,
        _ => None,
    });
    assert!(
        late_s.is_some_and(|late_s| (late_s + 8e-3).abs() < 3e-3),
        "{late_s:?}"
    );
}

// With a dead zone of 0.2, relays of 1 and 0.6 act as 0.8 and 0.4: the gain changes from 0.8 to 0.67, by a sixth.
#[test]
fn two_amplitudes_show_a_dead_zone() {
    let linear = found(&relay_test(-0.73, true, 0.0), &Options::default());
    assert!(linear.outcome.is_ok() && !has(&linear, "one_amplitude"));
    assert!(linear.amplitudes.unwrap().is_alike);
    let one = found(&relay_test(-0.73, false, 0.2), &Options::default());
    assert!(one.outcome.is_ok() && has(&one, "one_amplitude"));
    let two = found(&relay_test(-0.73, true, 0.2), &Options::default());
    let Err(Verdict::AmplitudeDependent(test)) = two.outcome else {
        panic!("{:?}", two.outcome)
    };
    assert!(
        (test.gain_ratio / (0.4 / 0.6 / 0.8) - 1.0).abs() < 0.02,
        "{test:?}"
    );
}

// A plain relay oscillates more slowly than a leading one. From its cycles, the paper's controller crosses over above twice that
// frequency and is withdrawn; a balanced one stays below twice the highest frequency that the whole recording shows.
#[test]
fn a_controller_stays_near_the_excited_frequencies() {
    let columns = relay_test(0.0, false, 0.0);
    let paper = found(
        &columns,
        &(Options::default().cycles(8)).specification(Specification::paper()),
    );
    let balanced = found(&columns, &Options::default());
    let excited = balanced.excitation.unwrap().highest_rad_per_s().unwrap();
    let identified = balanced.outcome.unwrap();
    let crossover = identified.design.unwrap().margins.gain_crossover_rad_per_s;
    assert!(crossover < 2.001 * excited);
    // |T| is at most 1.6: the response may rise by 1 + 1/1.6.
    assert!(identified.resonance.unwrap() > 1.62);
    assert!(has(&paper, "extrapolated") && paper.outcome.unwrap().design.is_none());
}
