//! The relay around processes, and with any input from a sensor.

use crate::common::{every, run};
use onecycle_onboard::{Relay, RelayError, RelaySettings, Soiptd};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

// In steady state the mean of the input is minus the bias. The trim removes 0.8 of the remaining bias per cycle,
// so it converges to the resolution of the duty: half a sample per half cycle on either side, 2 h dt / period =
// 0.005 h.
#[test]
fn trim_converges_to_minus_the_bias() {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    for bias in [-0.5, -0.2, 0.0, 0.35, 0.5] {
        let settings = RelaySettings {
            trim_gain: RelaySettings::TRIM_GAIN,
            ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
        };
        let mut relay = Relay::new(settings).unwrap();
        run(&process, &mut relay, bias, every(1e-3, 15_000));
        assert!(
            (f64::from(relay.trim()) + bias).abs() < 0.005,
            "{bias}: {}",
            relay.trim()
        );
    }
}

// With an asymmetry of 0.2 the output is high for 0.6 of a cycle, or for 0.4 if the bias is positive, to half a
// sample per half cycle. The trim leaves a bias of a fifth of the relay's amplitude.
#[test]
fn the_trim_leaves_the_asymmetry_asked_for() {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    for bias in [-0.5_f64, -0.3, 0.3, 0.5] {
        let settings = RelaySettings {
            trim_gain: RelaySettings::TRIM_GAIN,
            asymmetry: 0.2,
            ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
        };
        let mut relay = Relay::new(settings).unwrap();
        let run = run(&process, &mut relay, bias, every(1e-3, 20_000));
        let middle = f64::from(relay.trim());
        assert!(
            (middle + bias - 0.2_f64.copysign(bias)).abs() < 0.01,
            "{bias}: {middle}"
        );
        let rises: Vec<usize> = (1..run.input.len())
            .filter(|&k| run.input[k] > run.input[k - 1] + 1.0)
            .collect();
        let cycles = &run.input[rises[rises.len() - 6]..rises[rises.len() - 1]];
        let high = cycles.iter().filter(|&&input| input > middle).count();
        let duty = high as f64 / cycles.len() as f64;
        assert!(
            (duty - 0.5 + 0.1_f64.copysign(bias)).abs() < 0.005,
            "{bias}: {duty}"
        );
    }
    let settings = RelaySettings {
        asymmetry: 1.0,
        ..RelaySettings::new(1.0, 0.0)
    };
    assert_eq!(Relay::new(settings).err(), Some(RelayError::Asymmetry(1.0)));
}

// Without a trim the duty balances the bias: mean(u) = h (2 duty - 1) = -bias over whole cycles.
#[test]
fn duty_carries_the_bias_without_a_trim() {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    let mut relay = Relay::new(RelaySettings::bare(1.0, -0.73)).unwrap();
    let bias = 0.2;
    let run = run(&process, &mut relay, bias, every(1e-3, 30_000));
    let rises: Vec<usize> = (1..run.input.len())
        .filter(|&k| run.input[k] > run.input[k - 1])
        .collect();
    let (first, last) = (rises[rises.len() - 11], rises[rises.len() - 1]);
    let mean = run.input[first..last].iter().sum::<f64>() / (last - first) as f64;
    assert!((mean + bias).abs() < 1e-3, "{mean}");
}

fn errors() -> impl Strategy<Value = Vec<(f32, f32)>> {
    let error = prop_oneof![
        4 => -1.0..1.0_f32,
        2 => (-30.0..38.0_f32, any::<bool>()).prop_map(|(power, up)| {
            let size = 10_f32.powf(power);
            if up { size } else { -size }
        }),
        1 => Just(0.0),
        1 => prop_oneof![Just(f32::MAX), Just(f32::MIN), Just(f32::MIN_POSITIVE), Just(1e-45)],
    ];
    let dt_s = prop_oneof![8 => 1e-4..1e-1_f32, 1 => Just(0.0), 1 => 1.0..1e3_f32];
    prop::collection::vec((error, dt_s), 1..400)
}

proptest! {
    #![proptest_config(Config {
        cases: 2000,
        rng_seed: RngSeed::Fixed(46),
        failure_persistence: None,
        ..Config::default()
    })]

    // For any errors the output is zero in the pre-roll, then trim + h or trim - h with a trim within 0.9 h.
    #[test]
    fn output_is_always_one_of_two_levels(
        errors in errors(),
        beta in -0.99..0.99_f32,
        noise_sigma in prop_oneof![Just(0.0_f32), 1e-6..1.0_f32],
        preroll_s in prop_oneof![Just(0.0_f32), 0.0..1.0_f32],
        trim_gain in prop_oneof![Just(0.0_f32), 0.0..2.0_f32],
        plain_switches in 0..5_u16,
        ramp_switches in 0..5_u16,
    ) {
        let h = 0.75;
        let settings = RelaySettings {
            noise_sigma,
            preroll_s,
            trim_gain,
            plain_switches,
            ramp_switches,
            ..RelaySettings::new(h, beta)
        };
        let mut relay = Relay::new(settings).unwrap();
        for (error, dt_s) in errors {
            let was = relay.phase();
            let output = relay.step(error, dt_s);
            let trim = relay.trim();
            prop_assert!(trim.abs() <= 0.9 * h);
            if was == onecycle_onboard::RelayPhase::Preroll {
                prop_assert_eq!(output, 0.0);
            } else {
                prop_assert_eq!(output, if relay.is_high() { trim + h } else { trim - h });
            }
        }
    }
}
