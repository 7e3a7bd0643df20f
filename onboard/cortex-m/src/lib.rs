//! Flight of the whole tuner on one simulated axis, with the same code on a microcontroller and on the host.
//!
//! Twenty seconds at 1 kHz: five under the safe controller, then relay, identification and the controller found;
//! at 18 s the reference steps by 0.1 m. Every tick and every number found becomes a line of text, with
//! floating-point numbers as their bits. Two machines agree if their lines do.
//!
//! ```text
//! tick <number> <phase before> <phase after> <bits of the output> <instructions> <stage before>
//! found <name> <bits>
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub mod axis;
mod line;

use core::hint::black_box;

use onecycle_onboard::RelaySettings;
use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::Limits;
use onecycle_onboard::identification::{Analysis, Bench, Desk, Stage, TuningResult};
use onecycle_onboard::tuner::{Consent, TunerCore, TunerSettings};

use crate::axis::{Axis, K_OVER_T_BODY, TICK_S};
pub use crate::line::Line;

/// Half the jump of the relay (part of hover).
const AMPLITUDE: f32 = 0.05;
/// Twenty seconds.
const TICKS: u32 = 20_000;
/// Five seconds: five time constants of the filter for the safe controller's output.
const START_TICK: u32 = 5000;
/// Step of the reference: time (s) and height (m).
const STEP_AT_S: f64 = 18.0;
const STEP: f32 = 0.1;

/// Slices of the analysis in a tick.
const SLICES: u16 = 1;

/// Largest relative error of `K/T_body`: four standard deviations, each 1.3 % as the tuner reports. Largest
/// distance from the reference 2 s after its step (m): a tenth of the step, which has settled by then.
const GAIN_TOLERANCE: f64 = 0.05;
const STEP_TOLERANCE: f64 = 0.01;

/// What a tuner needs beside its core. The caller places desk and bench: they are nearly all of its memory.
pub struct Analyst<'a> {
    /// The analysis.
    pub analysis: Analysis<'a>,
    /// What it shares with the core.
    pub desk: &'a mut Desk,
    /// Its own memory.
    pub bench: &'a mut Bench,
}

impl Analyst<'_> {
    fn stage(&self, tuner: &TunerCore) -> Stage {
        if tuner.is_collecting() {
            Stage::Collect
        } else {
            self.analysis.stage()
        }
    }
}

/// Settings of the tuner, the same as in `c/examples/axis.c`.
#[must_use]
pub fn settings() -> TunerSettings {
    let new = TunerSettings::new(AMPLITUDE, TICK_S as f32);
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
        slices: SLICES,
        bias_filter_s: 1.0,
        consent: Consent::Automatic,
        ..new
    }
}

/// Flies the axis with a tuner of these [`settings`]. `lap` returns the instructions since its last call; `say`
/// receives every line. Returns whether the controller has proven itself, belongs to the right process and
/// follows the reference.
pub fn fly(
    tuner: &mut TunerCore,
    analyst: &mut Analyst<'_>,
    mut lap: impl FnMut() -> u64,
    mut say: impl FnMut(&mut Line),
) -> bool {
    let mut axis = Axis::default();
    // The second call returns what counting itself costs.
    lap();
    let idle = lap();
    for tick in 0..TICKS {
        let time_s = f64::from(tick) * TICK_S;
        let measurement = axis.measure();
        let reference = if time_s < STEP_AT_S { 0.0 } else { STEP };
        if tick == START_TICK {
            tuner.start();
        }
        let (before, stage) = (tuner.phase(), analyst.stage(tuner));
        lap();
        let output = step(tuner, analyst, time_s, &measurement, reference);
        let instructions = lap().saturating_sub(idle);
        let mut line = Line::default();
        line.word("tick")
            .number(tick.into())
            .word(before.name())
            .word(tuner.phase().name())
            .number(output.to_bits().into())
            .number(instructions)
            .word(stage.name());
        say(&mut line);
        axis.push(output.into());
    }
    let Some(identified) = tuner.identified() else {
        return false;
    };
    for (name, value) in numbers(identified) {
        say(Line::default()
            .word("found")
            .word(name)
            .number(value.to_bits()));
    }
    let gain = identified.process.k_over_t_body() / K_OVER_T_BODY;
    tuner.is_proven()
        && (gain - 1.0).abs() < GAIN_TOLERANCE
        && (axis.value() - f64::from(STEP)).abs() < STEP_TOLERANCE
}

/// Flies the first seconds of the test with the core alone, whose analysis never comes.
#[inline(never)]
pub fn fly_core(tuner: &mut TunerCore, desk: &mut Desk) {
    let mut axis = Axis::default();
    tuner.start();
    for tick in 0..START_TICK {
        let time_s = f64::from(tick) * TICK_S;
        tuner.tick(Some(desk), black_box(time_s), &axis.measure(), 0.0);
        axis.push(tuner.conclude(desk).into());
    }
}

/// Not inlined, so that no part of a tick is moved out of the count.
#[inline(never)]
fn step(
    tuner: &mut TunerCore,
    analyst: &mut Analyst<'_>,
    time_s: f64,
    measurement: &Measurement,
    reference: f32,
) -> f32 {
    let Analyst {
        analysis,
        desk,
        bench,
    } = analyst;
    tuner.tick(Some(desk), black_box(time_s), measurement, reference);
    analysis.work(desk, bench, SLICES);
    black_box(tuner.conclude(desk))
}

/// All numbers found, by name.
#[must_use]
pub fn numbers(found: &TuningResult) -> [(&'static str, f64); 17] {
    let (process, deviations) = (&found.process, &found.deviations);
    [
        ("k_over_t_body", process.k_over_t_body()),
        ("t_prop_s", process.t_prop_s()),
        ("inv_t_body_per_s", process.inv_t_body_per_s()),
        ("tau_s", process.tau_s()),
        ("kp", found.pd.kp),
        ("kd", found.pd.kd),
        ("phase_margin_rad", found.phase_margin_rad),
        ("input_bias", found.input_bias),
        ("score", found.score),
        ("period_s", found.period_s),
        ("amplitude", found.amplitude),
        ("noise_sigma", found.noise_sigma),
        ("ln_k_over_t_body_deviation", deviations.ln_k_over_t_body),
        ("t_prop_deviation_s", deviations.t_prop_s),
        ("inv_t_body_deviation_per_s", deviations.inv_t_body_per_s),
        ("tau_deviation_s", deviations.tau_s),
        ("phase_margin_deviation_rad", deviations.phase_margin_rad),
    ]
}
