//! 100,000 runs with a fault: no guard is a tick late, and an unproven controller never stays in use after a
//! fault.
//!
//! The required reaction is computed here from the samples alone, in double precision, and compared with the
//! tuner in every tick.

use std::collections::BTreeMap;
use std::ops::Range;

use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::{Abort, Limits};
use onecycle_onboard::tuner::{Consent, Tuner, TunerPhase, TunerSettings};
use onecycle_onboard::{RelaySettings, Soiptd};

use super::axis::{Axis, Noise};

const SAMPLE_S: f64 = 0.002;
/// Longer than any test here takes until its controller and four periods after.
const SECONDS: f64 = 4.0;
/// Ticks after the end of a test.
const AFTERWARDS: usize = 10;
/// Rounding of single precision over a run: nearer to a limit of time both reactions are accepted.
const ROUNDING_S: f64 = 2e-4;

/// Fault of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fault {
    None,
    ValueNotFinite,
    RateNotFinite,
    ReferenceNotFinite,
    TimeNotFinite,
    TimeStands,
    TimeRunsBack,
    Gap,
    OldSample,
    ValueJumps,
    RateJumps,
    SensorSticks,
    ActuatorDead,
    Operator,
    GainGrows,
    GainTurns,
}

const FAULTS: [Fault; 16] = [
    Fault::None,
    Fault::ValueNotFinite,
    Fault::RateNotFinite,
    Fault::ReferenceNotFinite,
    Fault::TimeNotFinite,
    Fault::TimeStands,
    Fault::TimeRunsBack,
    Fault::Gap,
    Fault::OldSample,
    Fault::ValueJumps,
    Fault::RateJumps,
    Fault::SensorSticks,
    Fault::ActuatorDead,
    Fault::Operator,
    Fault::GainGrows,
    Fault::GainTurns,
];

/// Input of the tuner at a tick.
struct Told {
    time_s: f64,
    measurement: Measurement,
    reference: f32,
}

/// The samples so far, and the reaction that they require.
struct Judge {
    limits: Limits,
    last_s: f64,
    test_s: f64,
    since_switch_s: f64,
    usable: (f32, f32),
}

#[derive(Debug, PartialEq)]
enum Must {
    End,
    GoOn,
    /// So close to a limit of time that rounding decides.
    Either,
}

impl Judge {
    /// Required reaction at a tick, in a test or outside, with or without a relay.
    fn tick(&mut self, told: &Told, phase: TunerPhase, is_proven: bool) -> Must {
        let Measurement { value, rate, age_s } = told.measurement;
        let rate = rate.unwrap_or(0.0);
        let finite = value.is_finite() && rate.is_finite() && told.reference.is_finite();
        let dt_s = told.time_s - self.last_s;
        if !(finite && told.time_s.is_finite()) {
            return Must::End;
        }
        if dt_s > 0.0 {
            self.last_s = told.time_s;
        }
        let stale_s = f64::from(self.limits.stale_s);
        if dt_s <= 0.0 || dt_s > stale_s || f64::from(age_s) > stale_s {
            return Must::End;
        }
        self.usable = (value, rate);
        if is_proven {
            return Must::GoOn;
        }
        self.test_s += dt_s;
        self.since_switch_s += dt_s;
        if value.abs() > self.limits.excursion || rate.abs() > self.limits.rate {
            return Must::End;
        }
        let mut must = Must::GoOn;
        for (applies, so_far_s, limit_s) in [
            (
                phase != TunerPhase::Control,
                self.test_s,
                self.limits.duration_s,
            ),
            (
                matches!(phase, TunerPhase::Relay | TunerPhase::Identify),
                self.since_switch_s,
                self.limits.no_switch_s,
            ),
        ] {
            let beyond_s = so_far_s - f64::from(limit_s);
            if applies && beyond_s > ROUNDING_S {
                return Must::End;
            }
            if applies && beyond_s > -ROUNDING_S {
                must = Must::Either;
            }
        }
        must
    }
}

struct Run {
    fault: Fault,
    at: usize,
    axis: Axis,
    tuner: Tuner<'static>,
    settings: TunerSettings,
    noise: Noise,
}

impl Run {
    fn new(seed: u64) -> Self {
        let mut noise = Noise(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        let h = noise.between(0.05, 0.5);
        let process = Soiptd::from_acceleration_gain(
            noise.between(2.0, 30.0),
            noise.between(0.01, 0.05),
            noise.between(0.0, 2.0),
            noise.between(0.004, 0.02),
        )
        .unwrap();
        let beta = RelaySettings::DISTINGUISHING_BETA;
        let (omega, amplitude) = process
            .describing_function_oscillation(h, f64::from(beta))
            .unwrap();
        let mut axis = Axis::new(process, SAMPLE_S, seed);
        axis.bias = noise.between(-0.3, 0.3) * h;
        axis.noise_sigma = noise.between(0.0, 0.02) * amplitude;
        let safe = if noise.uniform() < 0.5 {
            PdLaw::ZERO
        } else {
            PdLaw {
                kp: noise.between(0.0, 3.0) as f32,
                kd: noise.between(0.0, 1.0) as f32,
                offset: noise.between(-0.1, 0.1) as f32,
            }
        };
        let new = TunerSettings::new(h as f32, SAMPLE_S as f32);
        let settings = TunerSettings {
            relay: RelaySettings {
                noise_sigma: axis.noise_sigma as f32,
                ..new.relay
            },
            limits: Limits {
                excursion: (8.0 * amplitude) as f32,
                rate: (10.0 * amplitude * omega) as f32,
                duration_s: noise.between(0.5, 4.0) as f32,
                no_switch_s: (4.0 * std::f64::consts::TAU / omega) as f32,
                stale_s: 0.005,
            },
            output_lowest: (-1.5 * h) as f32,
            output_highest: (1.5 * h) as f32,
            safe,
            cycles: 1 + (seed % 2) as u8,
            slices: 1 + (seed % 50) as u16,
            consent: Consent::Automatic,
            ..new
        };
        Self {
            fault: FAULTS[(seed % FAULTS.len() as u64) as usize],
            at: 1 + (noise.uniform() * 0.5 * SECONDS / SAMPLE_S) as usize,
            axis,
            tuner: Tuner::new(&settings).unwrap(),
            settings,
            noise,
        }
    }

    /// Input of the tuner at the next tick. Faults of the process are applied to the process.
    fn told(&mut self, tick: usize, frozen: &mut Option<Measurement>) -> Told {
        let measurement = self.axis.measure();
        let mut told = Told {
            time_s: self.axis.time_s(),
            measurement,
            reference: 0.0,
        };
        if tick < self.at {
            return told;
        }
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][tick % 3];
        let now = tick == self.at;
        let limits = self.settings.limits;
        match self.fault {
            Fault::ValueNotFinite if now => told.measurement.value = odd,
            Fault::RateNotFinite if now => told.measurement.rate = Some(odd),
            Fault::ReferenceNotFinite if now => told.reference = odd,
            Fault::TimeNotFinite if now => told.time_s = f64::from(odd),
            Fault::TimeStands if now => told.time_s -= SAMPLE_S,
            Fault::TimeRunsBack if now => told.time_s -= 1.0,
            Fault::Gap => told.time_s += 0.1,
            Fault::OldSample if now => told.measurement.age_s = 0.02,
            Fault::ValueJumps if now => told.measurement.value += 3.0 * limits.excursion,
            Fault::RateJumps if now => told.measurement.rate = Some(-3.0 * limits.rate),
            Fault::SensorSticks => told.measurement = *frozen.get_or_insert(measurement),
            Fault::Operator if now => self.tuner.abort(),
            Fault::GainGrows | Fault::GainTurns if now => {
                let factor = self.noise.between(3.0, 10.0);
                let sign = if self.fault == Fault::GainTurns {
                    -1.0
                } else {
                    1.0
                };
                let process = self.axis.process.with_gain_scaled(sign * factor).unwrap();
                self.axis.becomes(process);
            }
            _ => {}
        }
        told
    }

    /// Fault of the run, and the reason for which the test ended, if it did.
    fn fly(mut self, seed: u64) -> (Fault, Option<Abort>, bool) {
        let mut judge = Judge {
            limits: self.settings.limits,
            last_s: -SAMPLE_S,
            test_s: 0.0,
            since_switch_s: 0.0,
            usable: (0.0, 0.0),
        };
        let (lowest, highest) = (self.settings.output_lowest, self.settings.output_highest);
        let (mut frozen, mut left) = (None, AFTERWARDS);
        self.tuner.start();
        for tick in 0..(SECONDS / SAMPLE_S) as usize {
            let told = self.told(tick, &mut frozen);
            let (before, was_proven) = (self.tuner.phase(), self.tuner.is_proven());
            let was_high = self.tuner.relay().is_high();
            let must = judge.tick(&told, before, was_proven);
            let output = self
                .tuner
                .step(told.time_s, &told.measurement, told.reference);
            let after = self.tuner.phase();
            let context = || {
                format!(
                    "seed {seed} tick {tick} {:?}: {must:?} {before:?} {after:?} {:?}",
                    self.fault,
                    self.tuner.reason()
                )
            };
            assert!(
                output >= lowest && output <= highest,
                "{} {output}",
                context()
            );
            if before == TunerPhase::Aborted || must == Must::End {
                assert_eq!(after, TunerPhase::Aborted, "{}", context());
            }
            if after == TunerPhase::Aborted {
                let (value, rate) = judge.usable;
                let safe = self.settings.safe.output(0.0, value, rate);
                assert_eq!(output, safe.max(lowest).min(highest), "{}", context());
                let by_model = matches!(
                    self.tuner.reason(),
                    Some(Abort::Refused(_) | Abort::Mismatch(_) | Abort::Operator)
                );
                assert!(
                    before == TunerPhase::Aborted || must != Must::GoOn || by_model,
                    "{}",
                    context()
                );
                left -= 1;
            } else {
                assert!(is_a_way(before, after), "{}", context());
            }
            if after != TunerPhase::Control {
                assert_eq!(self.tuner.law(), None, "{}", context());
            }
            if self.tuner.relay().is_high() != was_high {
                judge.since_switch_s = 0.0;
            }
            let is_dead = self.fault == Fault::ActuatorDead && tick >= self.at;
            self.axis.push(if is_dead { 0.0 } else { output });
            if left == 0 {
                break;
            }
        }
        (self.fault, self.tuner.reason(), self.tuner.is_proven())
    }
}

/// Transitions in the tuner's table, except those to Aborted.
fn is_a_way(from: TunerPhase, to: TunerPhase) -> bool {
    from == to
        || matches!(
            (from, to),
            (
                TunerPhase::Relay,
                TunerPhase::Identify | TunerPhase::Control
            ) | (
                TunerPhase::Identify,
                TunerPhase::Relay | TunerPhase::Control
            )
        )
}

fn fly(seeds: Range<u64>) {
    let mut ends: BTreeMap<(Fault, String), u32> = BTreeMap::new();
    let most = seeds.end - seeds.start;
    for seed in seeds {
        let (fault, reason, is_proven) = Run::new(seed).fly(seed);
        let end = match reason {
            Some(reason) => format!("{reason:?}")
                .split('(')
                .next()
                .unwrap_or("")
                .to_owned(),
            None if is_proven => "Proven".to_owned(),
            None => "Running".to_owned(),
        };
        *ends.entry((fault, end)).or_default() += 1;
    }
    // Every reason must occur, so that no check is empty.
    for (fault, end) in [
        (Fault::None, "Proven"),
        (Fault::None, "Duration"),
        (Fault::ValueNotFinite, "NotFinite"),
        (Fault::RateNotFinite, "NotFinite"),
        (Fault::ReferenceNotFinite, "NotFinite"),
        (Fault::TimeNotFinite, "NotFinite"),
        (Fault::TimeStands, "Stale"),
        (Fault::TimeRunsBack, "Stale"),
        (Fault::Gap, "Stale"),
        (Fault::OldSample, "Stale"),
        (Fault::ValueJumps, "Excursion"),
        (Fault::RateJumps, "Rate"),
        (Fault::SensorSticks, "NoOscillation"),
        (Fault::ActuatorDead, "NoOscillation"),
        (Fault::Operator, "Operator"),
        (Fault::GainGrows, "Excursion"),
        (Fault::GainTurns, "Excursion"),
    ] {
        let count = ends.get(&(fault, end.to_owned())).copied().unwrap_or(0);
        assert!(
            u64::from(count) > most / 1000,
            "{fault:?} {end}: {count} of {ends:?}"
        );
    }
}

#[test]
fn no_guard_is_late_1() {
    fly(0..50_000);
}

#[test]
fn no_guard_is_late_2() {
    fly(50_000..100_000);
}
