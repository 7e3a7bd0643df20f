//! The tuner of a board, with any settings, times, measurements and references.

use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::Limits;
use onecycle_onboard::tuner::{Consent, TakeOffSettings, Tuner, TunerSettings};

use crate::numbers::Numbers;

/// Most ticks: an identification takes some thousands of slices.
const MOST_TICKS: usize = 4000;

/// Its output is finite at every tick, and within its limits where it is its own.
pub(crate) fn tuner(bytes: &[u8]) {
    let mut numbers = Numbers(bytes);
    let settings = settings(&mut numbers);
    let Ok(mut tuner) = Tuner::new(&settings) else {
        return;
    };
    let (mut time_s, mut value, mut reference) = (0.0, 0.0, 0.0);
    for _ in 0..MOST_TICKS {
        if numbers.is_empty() {
            break;
        }
        let what = numbers.byte();
        time_s += f64::from(settings.sample_s);
        let mut measurement = Measurement::of(value);
        match what % 16 {
            0 => tuner.start(),
            1 => drop(tuner.accept()),
            2 => tuner.abort(),
            3 => tuner.reset(),
            4 => time_s = numbers.double(),
            5 => reference = numbers.single(),
            6 => measurement = measurement.with_rate(numbers.single()),
            7 => measurement.age_s = numbers.single(),
            8 => measurement.value = numbers.single(),
            9 => tuner.beside(numbers.single()),
            // A process that follows the relay, so that cycles are found.
            of => {
                let repeat = usize::from(what / 16) * 8 + 1;
                for _ in 0..repeat {
                    time_s += f64::from(settings.sample_s);
                    let output = tuner.step(time_s, &Measurement::of(value), reference);
                    check(&tuner, output, &settings);
                    let speed = f32::from(of % 16) * settings.sample_s;
                    value += (output - 0.5 * value) * speed;
                }
            }
        }
        let output = tuner.step(time_s, &measurement, reference);
        check(&tuner, output, &settings);
        let _ = (tuner.usual(), tuner.phase(), tuner.reason(), tuner.stage());
        if let Some(law) = tuner.law() {
            let of = law.settings();
            assert!([of.kp, of.ki, of.kd].iter().all(|gain| gain.is_finite()));
        }
    }
}

fn check(tuner: &Tuner<'_>, output: f32, settings: &TunerSettings) {
    let limits = settings.output_lowest..=settings.output_highest;
    let is_own = tuner.is_in_charge();
    let is_kept = output.is_finite() && (!is_own || limits.contains(&output));
    assert!(is_kept, "{output} in {:?}, {limits:?}", tuner.phase());
}

/// Usual settings, and any number in the place of some of them.
fn settings(numbers: &mut Numbers<'_>) -> TunerSettings {
    let mut settings = TunerSettings::new(1.0, 0.002);
    settings.limits = Limits::NONE;
    (settings.output_lowest, settings.output_highest) = (-2.0, 2.0);
    settings.consent = Consent::Automatic;
    for _ in 0..numbers.byte() % 12 {
        let which = numbers.byte();
        let value = numbers.single();
        match which % 28 {
            0 => settings.relay.amplitude = value,
            1 => settings.relay.beta = value,
            2 => settings.relay.trim_gain = value,
            3 => settings.relay.noise_sigma = value,
            4 => settings.sample_s = value,
            5 => settings.cycles = which / 28,
            6 => settings.attempts = which / 28,
            7 => settings.slices = u16::from(which),
            8 => {
                settings.take_off = Some(TakeOffSettings {
                    gain: value,
                    climb: numbers.single(),
                });
            }
            9 => settings.limits.excursion = value,
            10 => settings.limits.rate = value,
            11 => settings.limits.duration_s = value,
            12 => settings.limits.no_switch_s = value,
            13 => settings.limits.stale_s = value,
            14 => settings.output_lowest = value,
            15 => settings.output_highest = value,
            16 => {
                settings.safe = PdLaw {
                    kp: value,
                    kd: numbers.single(),
                    offset: numbers.single(),
                };
            }
            17 => settings.bias_filter_s = value,
            18 => settings.rate_lag_s = value,
            19 => settings.rate_delay_s = value,
            20 => settings.integral_phase_rad = value,
            21 => settings.second_amplitude = value,
            22 => settings.consent = Consent::Ask,
            23 => settings.consent = Consent::Never,
            24 => settings.second_amplitude = TunerSettings::SECOND_AMPLITUDE,
            _ => {}
        }
    }
    settings
}
