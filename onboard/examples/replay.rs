//! Replays what a program in C has written of its ticks, and compares every output, bit by bit.
//!
//! Lines of standard input: time, measured value, measured rate, reference, output, as C's `%a` writes
//! them. The settings are those of `c/examples/axis.c`, the tick of the start its 5000th.

use std::io::{BufRead, Write};
use std::process::ExitCode;

use onecycle_onboard::RelaySettings;
use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::Limits;
use onecycle_onboard::tuner::{Tuner, TunerSettings};

const START: usize = 5000;

fn settings() -> TunerSettings {
    let new = TunerSettings::new(0.05, 0.001);
    TunerSettings {
        relay: RelaySettings {
            noise_sigma: 0.0001,
            ..new.relay
        },
        limits: Limits {
            excursion: 0.5,
            rate: 2.0,
            duration_s: 20.0,
            no_switch_s: 3.0,
            stale_s: 0.01,
        },
        output_lowest: -0.5,
        output_highest: 0.5,
        safe: PdLaw {
            kp: 0.3,
            kd: 0.3,
            offset: 0.0,
        },
        slices: 1,
        bias_filter_s: 1.0,
        ..new
    }
}

/// A hexadecimal number as C99 writes it: `[-]0x<digit>.<digits>p<exponent>`.
fn number(text: &str) -> Option<f64> {
    let (sign, text) = match text.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, text),
    };
    let (digits, exponent) = text.strip_prefix("0x")?.split_once('p')?;
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let mantissa = u64::from_str_radix(&format!("{whole}{fraction}"), 16).ok()?;
    let shift = exponent.parse::<i32>().ok()? - 4 * i32::try_from(fraction.len()).ok()?;
    Some(sign * mantissa as f64 * 2_f64.powi(shift))
}

/// The number of ticks replayed, or what went wrong.
fn replay() -> Result<usize, String> {
    let mut tuner = Tuner::new(&settings()).map_err(|error| error.to_string())?;
    let mut ticks = 0;
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|error| error.to_string())?;
        let numbers: Option<Vec<f64>> = line.split_whitespace().map(number).collect();
        let Some(&[time_s, value, rate, reference, output]) = numbers.as_deref() else {
            return Err(format!("line {}: five numbers are needed", ticks + 1));
        };
        if ticks == START {
            tuner.start();
        }
        let measurement = Measurement::of(value as f32).with_rate(rate as f32);
        let ours = tuner.step(time_s, &measurement, reference as f32);
        if ours.to_bits() != (output as f32).to_bits() {
            return Err(format!("tick {ticks}: {ours} here, {output} there"));
        }
        ticks += 1;
    }
    if ticks > START && tuner.is_proven() {
        Ok(ticks)
    } else {
        Err(format!("after {ticks} ticks there is no controller"))
    }
}

fn main() -> ExitCode {
    let (status, sentence) = match replay() {
        Ok(ticks) => (ExitCode::SUCCESS, format!("{ticks} outputs, the same bits")),
        Err(sentence) => (ExitCode::FAILURE, sentence),
    };
    let _ = writeln!(std::io::stdout(), "{sentence}");
    status
}
