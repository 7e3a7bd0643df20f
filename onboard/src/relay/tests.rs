//! The relay on synthetic signals.

extern crate std;

use core::f32::consts::TAU;
use std::vec::Vec;

use libm::{asinf, sinf};

use super::*;

const DT_S: f32 = 1e-3;

fn relay(settings: RelaySettings) -> Relay {
    Relay::new(settings).unwrap()
}

/// Levels of the output for each error in turn, 1 ms apart.
fn levels(relay: &mut Relay, errors: impl IntoIterator<Item = f32>) -> Vec<bool> {
    errors
        .into_iter()
        .map(|error| relay.step(error, DT_S) > relay.trim())
        .collect()
}

/// `A sin(2 pi t + phase)`, 1000 samples a period.
fn sine(periods: usize, amplitude: f32, phase: f32) -> impl Iterator<Item = f32> {
    (0..1000 * periods).map(move |k| amplitude * sinf(TAU * (k % 1000) as f32 / 1000.0 + phase))
}

/// Samples at which the level changes.
fn switches(levels: &[bool]) -> Vec<usize> {
    (1..levels.len())
        .filter(|&k| levels[k] != levels[k - 1])
        .collect()
}

/// Straight lines through these errors, `samples` apart.
fn lines(corners: &[f32], samples: usize) -> Vec<f32> {
    let between = |pair: &[f32]| {
        let (from, to) = (pair[0], pair[1]);
        (0..samples).map(move |k| from + (to - from) * k as f32 / samples as f32)
    };
    corners.windows(2).flat_map(between).collect()
}

#[test]
fn errors_name_the_setting() {
    let new = RelaySettings::new;
    let error = |settings| Relay::new(settings).unwrap_err();
    assert_eq!(error(new(0.0, -0.7)), RelayError::Amplitude(0.0));
    assert_eq!(
        error(new(f32::INFINITY, -0.7)),
        RelayError::Amplitude(f32::INFINITY)
    );
    assert_eq!(error(new(1.0, -1.0)), RelayError::Beta(-1.0));
    assert_eq!(error(new(1.0, 1.0)), RelayError::Beta(1.0));
    assert!(matches!(error(new(1.0, f32::NAN)), RelayError::Beta(_)));
    let base = new(1.0, -0.73);
    for (settings, name) in [
        (
            RelaySettings {
                preroll_s: -1.0,
                ..base
            },
            "the pre-roll",
        ),
        (
            RelaySettings {
                noise_sigma: -1.0,
                ..base
            },
            "the noise sigma",
        ),
        (
            RelaySettings {
                smoothing: -1.0,
                ..base
            },
            "the smoothing",
        ),
        (
            RelaySettings {
                dwell: -1.0,
                ..base
            },
            "the dwell",
        ),
        (
            RelaySettings {
                trim_gain: -1.0,
                ..base
            },
            "the trim gain",
        ),
    ] {
        assert_eq!(error(settings), RelayError::Setting(name, -1.0));
    }
}

// Second differences of the triangle 0, 1, 0, -1, 0, ... are 0, -2, 0, 2: the mean square is 2 and the variance,
// a sixth of it, 1/3. 2002 samples give 2000 differences.
#[test]
fn preroll_measures_the_noise_and_puts_out_nothing() {
    let settings = RelaySettings {
        preroll_s: 2.0015,
        ..RelaySettings::new(1.0, -0.73)
    };
    let mut relay = relay(settings);
    for k in 0..2002 {
        assert_eq!(relay.phase(), RelayPhase::Preroll);
        assert_eq!(relay.step([0.0, 1.0, 0.0, -1.0][k % 4], DT_S), 0.0);
    }
    assert_eq!(relay.phase(), RelayPhase::Kick);
    assert!((relay.noise_sigma() - sqrtf(1.0 / 3.0)).abs() < 1e-6);
}

#[test]
fn the_given_noise_is_the_least() {
    let settings = RelaySettings {
        preroll_s: 0.1,
        noise_sigma: 0.02,
        ..RelaySettings::new(1.0, -0.73)
    };
    let mut relay = relay(settings);
    levels(&mut relay, [0.5; 200]);
    assert_eq!(relay.noise_sigma(), 0.02);
}

// High until the error exceeds six sigma, 0.06; then against it.
#[test]
fn kick_ends_outside_the_noise() {
    for (error, high) in [(-0.0601, false), (0.0601, true)] {
        let settings = RelaySettings {
            noise_sigma: 0.01,
            ..RelaySettings::new(1.5, -0.73)
        };
        let mut relay = relay(settings);
        for quiet in [0.0, 0.0599, -0.0599] {
            assert_eq!(relay.step(quiet, DT_S), 1.5);
            assert_eq!(relay.phase(), RelayPhase::Kick);
        }
        assert_eq!(relay.step(error, DT_S), if high { 1.5 } else { -1.5 });
        assert_eq!(relay.phase(), RelayPhase::Oscillate);
    }
}

// An output that wanders by 0.2 at rest, behind a filter that leaves no noise from sample to sample: the kick goes on to
// there, and the lead of 130.2 samples (see below) is complete from the first switch on.
#[test]
fn a_wandering_output_is_at_rest() {
    for (level, phase) in [(0.0, RelayPhase::Oscillate), (0.2, RelayPhase::Kick)] {
        let mut relay = relay(RelaySettings::bare(1.0, -0.73));
        relay.begin_within(level);
        relay.step(0.19, DT_S);
        assert_eq!(relay.phase(), phase);
        let levels = levels(&mut relay, sine(3, 1.0, 0.2));
        // The first maximum is at 250 samples less those of 0.2 rad, the crossing 250 later.
        let crossing = 500.0 - 1000.0 * 0.2 / TAU;
        let lead = crossing - switches(&levels)[0] as f32;
        let expected = if level > 0.0 { 130.2 } else { 0.0 };
        assert!((lead - expected).abs() <= 1.5, "{level}: {lead}");
    }
}

// Under A sin(wt) the fall is due when the sine has fallen to -beta: wt = pi + asin(beta); the rise follows half
// a period later. Sample 500 + 1000 asin(beta) / 2 pi, rounded up.
#[test]
fn beta_sets_the_phase_of_the_switches() {
    for beta in [-0.9, -0.73, -0.3, 0.2, 0.73] {
        let mut relay = relay(RelaySettings::bare(1.0, beta));
        // From rest: the first sample is zero.
        let levels = levels(&mut relay, sine(4, 2.5, 0.0));
        let due = 500.0 + 1000.0 * asinf(beta) / TAU;
        for (index, &at) in switches(&levels).iter().enumerate() {
            let expected = due + 500.0 * index as f32;
            let late = at as f32 - expected;
            assert!(
                (-0.01..1.01).contains(&late),
                "beta {beta}: {at} for {expected}"
            );
        }
        assert!(switches(&levels).len() >= 7);
    }
}

// Two periods at beta = -0.73, then -0.3: switches up to sample 2000 are due for -0.73, later ones for -0.3. A
// beta out of range is refused and changes nothing.
#[test]
fn a_changed_beta_moves_the_next_switches() {
    let mut relay = relay(RelaySettings::bare(1.0, -0.73));
    let mut levels_seen = levels(&mut relay, sine(2, 2.5, 0.0));
    relay.set_beta(-0.3).unwrap();
    assert_eq!(relay.set_beta(-1.0), Err(RelayError::Beta(-1.0)));
    levels_seen.extend(levels(&mut relay, sine(2, 2.5, 0.0)));
    let switches = switches(&levels_seen);
    assert_eq!(switches.len(), 8);
    for (index, &at) in switches.iter().enumerate() {
        let beta: f32 = if at < 2000 { -0.73 } else { -0.3 };
        let due = 500.0 + 1000.0 * asinf(beta) / TAU + 500.0 * index as f32;
        let late = at as f32 - due;
        assert!((-0.01..1.01).contains(&late), "{at} for {due}");
    }
}

// A fixed hysteresis b = beta A is the same relay under a steady oscillation.
#[test]
fn positive_beta_is_the_classical_hysteresis() {
    let (amplitude, beta) = (2.5_f32, 0.4);
    let mut relay = relay(RelaySettings::bare(1.0, beta));
    let mut high = true;
    let errors: Vec<f32> = sine(6, amplitude, 0.0).collect();
    let classical = errors.iter().map(|&error| {
        // The peak is the largest sample, which equals the amplitude exactly at sample 250.
        if error.abs() >= beta * amplitude {
            high = error > 0.0;
        }
        high
    });
    let classical: Vec<bool> = classical.collect();
    assert_eq!(levels(&mut relay, errors), classical);
}

#[test]
fn negated_errors_negate_the_output() {
    // From an offset, so that the first error gives the sign; without a trim, which moves at rises.
    let settings = RelaySettings {
        noise_sigma: 0.01,
        ..RelaySettings::new(1.0, -0.73)
    };
    let wobble = |k: usize| 0.3 * sinf(0.037 * k as f32) + 0.02 * sinf(1.7 * k as f32);
    let errors: Vec<f32> = sine(12, 1.0, 1.0)
        .enumerate()
        .map(|(k, error)| error + wobble(k))
        .collect();
    let mut up = relay(settings);
    let mut down = relay(settings);
    for error in errors {
        assert_eq!(up.step(error, DT_S), -down.step(-error, DT_S));
    }
    assert!(up.switches() > 10);
}

// From an offset the first three switches are those of a plain relay, at zero. After seven (three plain, four of
// the ramp) the lead is complete, asin(0.73) = 46.89 deg = 130.2 samples; in between it never decreases.
#[test]
fn ramp_from_an_offset() {
    let mut relay = relay(RelaySettings::bare(1.0, -0.73));
    let levels = levels(&mut relay, sine(8, 1.0, TAU / 4.0));
    // Zero crossings at samples 250, 750, ...
    let leads: Vec<f32> = switches(&levels)
        .iter()
        .enumerate()
        .map(|(index, &at)| 250.0 + 500.0 * index as f32 - at as f32)
        .collect();
    assert!(leads.len() >= 12);
    assert!(leads[..3].iter().all(|lead| lead.abs() <= 1.0), "{leads:?}");
    assert!(
        leads.windows(2).all(|pair| pair[1] >= pair[0] - 1.0),
        "{leads:?}"
    );
    assert!(
        leads[7..].iter().all(|lead| (lead - 130.2).abs() <= 1.0),
        "{leads:?}"
    );
}

// Sigma 0.1. The signal rises to 1 and falls to 0.69: three sigma below the peak, at 0.7, the extremum counts
// and the relay switches. Then it rises to 2: at 1.25, 2.5 sigma above the peak, the extremum is disproved (a
// turn-back by six sigma would be at 1.29). The genuine fall is due at 0.73 of 2.
#[test]
fn a_false_extremum_is_undone() {
    let settings = RelaySettings {
        noise_sigma: 0.1,
        ..RelaySettings::bare(1.0, -0.73)
    };
    let mut relay = relay(settings);
    let errors = lines(&[0.0, 1.0, 0.69, 2.0, -2.0], 100);
    let levels = levels(&mut relay, errors.iter().copied());
    let at = switches(&levels);
    assert_eq!((at.len(), relay.undone(), relay.switches()), (3, 1, 1));
    for (&at, error) in at.iter().zip([0.7, 1.25, 1.46]) {
        let (before, after) = (errors[at - 1], errors[at]);
        let crossed = (before - error) * (after - error) <= 0.0;
        assert!(crossed, "at {at}: {before} to {after}, not across {error}");
    }
}

// The switch at 0.73 came too early: the signal falls to 0.3, rises to 0.6 (below the old peak) and only then
// falls for good. The switch is reversed at once; the next one is at zero.
#[test]
fn a_signal_that_turns_back_is_given_time() {
    let mut relay = relay(RelaySettings::bare(1.0, -0.73));
    let errors = lines(&[0.0, 1.0, 0.3, 0.6, -1.0], 100);
    let levels = levels(&mut relay, errors.iter().copied());
    let at = switches(&levels);
    assert_eq!((at.len(), relay.undone(), relay.switches()), (3, 1, 1));
    assert!(errors[at[0]] <= 0.73 && errors[at[0] - 1] > 0.73);
    assert!((200..203).contains(&at[1]), "{at:?}");
    assert!(errors[at[2]] <= 0.0 && errors[at[2] - 1] > 0.0);
}

// Half periods of 500 samples, then the error jumps about every 20 samples: the next switch may not come before
// 150 samples, 0.3 of the last half period, and each one after it not before 0.3 of the mean of two.
#[test]
fn dwell_keeps_switches_apart() {
    let settings = RelaySettings {
        dwell: 0.3,
        ..RelaySettings::bare(1.0, 0.0)
    };
    let mut relay = relay(settings);
    let jumpy = (0..1000).map(|k| if k / 20 % 2 == 0 { 1.0 } else { -1.0 });
    let levels = levels(&mut relay, sine(3, 1.0, 0.0).chain(jumpy));
    let at = switches(&levels);
    assert!(at.len() > 6, "{at:?}");
    let gaps: Vec<usize> = at.windows(2).map(|pair| pair[1] - pair[0]).collect();
    for gaps in gaps.windows(3) {
        let least = 0.15 * (gaps[0] + gaps[1]) as f32;
        assert!(gaps[2] as f32 > least - 0.01, "{at:?}");
    }
    assert_eq!(at[6] - at[5], 150);
}

// Extrema less than six sigma apart are noise: 5 sigma peak to peak never switch, 7 sigma do. The kick ends at
// once because of the offset; then the signal stays small.
#[test]
fn extrema_within_the_noise_do_not_switch() {
    for (peak_to_peak, some) in [(5.0, false), (7.0, true)] {
        let settings = RelaySettings {
            noise_sigma: 0.01,
            ..RelaySettings::bare(1.0, 0.0)
        };
        let mut relay = relay(settings);
        relay.step(0.065, DT_S);
        // A first crossing replaces the offset as a peak by the small signal.
        levels(&mut relay, lines(&[0.065, -0.001, -0.005], 50));
        let before = relay.switches();
        assert_eq!(before, 1);
        relay.excursion.opposite_peak = 0.5 * peak_to_peak * 0.01;
        relay.undoable = [None; 2];
        levels(&mut relay, sine(2, 0.5 * peak_to_peak * 0.01, TAU / 2.0));
        assert_eq!(relay.switches() > before, some);
    }
}

// The average of n samples has 1/n of the variance and a delay of (n - 1)/2 samples. The impulse response g_k of
// the smoothing has sum g^2 = 1/n and sum k g = (n - 1)/2; with 3 % of half periods of 500 samples, n = 15.
#[test]
fn smoothing_has_the_variance_and_delay_of_an_average() {
    let settings = RelaySettings {
        noise_sigma: 0.01,
        ..RelaySettings::new(1.0, 0.0)
    };
    let mut relay = relay(settings);
    levels(&mut relay, sine(4, 1.0, 0.0));
    let half_period = relay.half_period_s() / DT_S;
    assert!((half_period - 500.0).abs() < 1.0);
    let n = 0.03 * half_period;
    relay.smoothed = 0.0;
    let (mut sum, mut squares, mut moment) = (0.0, 0.0, 0.0);
    for k in 0..400 {
        relay.follow(if k == 0 { 1.0 } else { 0.0 }, DT_S);
        sum += relay.smoothed;
        squares += relay.smoothed * relay.smoothed;
        moment += k as f32 * relay.smoothed;
    }
    assert!((sum - 1.0).abs() < 1e-5);
    assert!((squares * n - 1.0).abs() < 1e-4, "{squares}");
    assert!((moment - 0.5 * (n - 1.0)).abs() < 1e-3, "{moment}");
    assert!((relay.smoothed_sigma - 0.01 / sqrtf(n)).abs() < 1e-7);
}

// A synthetic error has no input bias, but its duty can show one: high for 0.6 of every cycle, mean(u) = 0.2 h.
// The trim then moves by 0.8 of 0.2 h per cycle, up to its limit.
#[test]
fn trim_follows_the_mean_of_the_output() {
    let settings = RelaySettings {
        trim_gain: 0.8,
        ..RelaySettings::bare(2.0, 0.0)
    };
    let mut relay = relay(settings);
    // Zero crossings at 0, 600, 1000, 1600, ...; extrema of one.
    let lopsided = lines(&[0.0, 1.0, 1.0, 0.0, -1.0, 0.0], 200);
    assert_eq!(lopsided.len(), 1000);
    let mut trims = Vec::new();
    for _ in 0..12 {
        levels(&mut relay, lopsided.iter().copied());
        trims.push(relay.trim());
    }
    let step = 0.8 * 2.0 * 0.2;
    let mut moves: Vec<f32> = trims.windows(2).map(|pair| pair[1] - pair[0]).collect();
    moves.retain(|moved| *moved > 0.0);
    // The first moves are complete; the last is cut by the limit of 0.9 h.
    assert!(
        moves[..4].iter().all(|moved| (moved - step).abs() < 0.01),
        "{trims:?}"
    );
    assert_eq!(relay.trim(), RelaySettings::TRIM_LIMIT * 2.0);
}

#[test]
fn an_error_that_is_no_number_is_passed_over() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut relay = relay(RelaySettings::new(1.0, -0.73));
        levels(&mut relay, sine(3, 1.0, 0.0));
        let before = relay.switches();
        relay.step(bad, DT_S);
        levels(&mut relay, sine(3, 1.0, 0.0));
        assert!(relay.switches() >= before + 5);
    }
}

#[test]
fn a_tick_without_time_is_harmless() {
    let mut relay = relay(RelaySettings::new(1.0, -0.73));
    for (k, error) in sine(8, 1.0, 0.0).enumerate() {
        relay.step(error, if k % 2 == 0 { 0.0 } else { 2.0 * DT_S });
    }
    assert!(relay.switches() >= 12, "{}", relay.switches());
}
