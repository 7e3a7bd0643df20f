//! Time of every tick of a tuner in flight, by activity: the whole test of the paper's altitude, from rest to
//! the proven controller.
//!
//! The same flight is repeated with the same bits, and the shortest time of each tick counts, so other load of
//! the machine has little influence. The time to read the clock is measured and subtracted.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::io::Write;
use std::time::Instant;

use onecycle_onboard::control::Measurement;
use onecycle_onboard::guard::Limits;
use onecycle_onboard::tuner::{Consent, Tuner, TunerPhase, TunerSettings};
use onecycle_onboard::{RelaySettings, Soiptd};
use onecycle_plant::FixedStepProcess;

const SAMPLE_S: f64 = 1e-3;
const SECONDS: f64 = 12.0;
const FLIGHTS: usize = 20;

/// A tick: activity and time (ns).
type Tick = (&'static str, u64);

fn flight(slices: u16) -> Vec<Tick> {
    let new = TunerSettings::new(0.1, SAMPLE_S as f32);
    let settings = TunerSettings {
        relay: RelaySettings {
            noise_sigma: 1e-5,
            ..new.relay
        },
        output_lowest: -1.0,
        output_highest: 1.0,
        slices,
        consent: Consent::Automatic,
        limits: Limits::NONE,
        ..new
    };
    let process = Soiptd::from_acceleration_gain(4.0, 0.0321, 1.0 / 1.6886, 0.024)
        .expect("the times are positive");
    let mut axis = FixedStepProcess::new(&process, SAMPLE_S);
    let mut tuner = Tuner::new(&settings).expect("the settings are in range");
    let ticks = (SECONDS / SAMPLE_S) as usize;
    let mut times = Vec::with_capacity(ticks);
    for tick in 0..ticks {
        if tick == 1000 {
            tuner.start();
        }
        let measurement = Measurement::of(axis.output() as f32).with_rate(axis.rate() as f32);
        let name = match tuner.phase() {
            TunerPhase::Idle => "safe",
            TunerPhase::Relay => "relay",
            TunerPhase::Identify => "identify",
            TunerPhase::Control if tuner.is_proven() => "control",
            TunerPhase::Control => "control, checked",
            TunerPhase::TakeOff | TunerPhase::Proposed | TunerPhase::Aborted => "other",
        };
        let begin = Instant::now();
        let output = black_box(tuner.step(
            black_box(tick as f64 * SAMPLE_S),
            black_box(&measurement),
            0.0,
        ));
        times.push((name, begin.elapsed().as_nanos() as u64));
        axis.step(f64::from(output));
    }
    times
}

/// Shortest time between two readings of the clock (ns).
fn clock_ns() -> u64 {
    let readings = (0..10_000).map(|_| {
        let begin = Instant::now();
        begin.elapsed().as_nanos() as u64
    });
    readings.min().unwrap_or(0)
}

fn main() {
    let clock_ns = clock_ns();
    let mut out = std::io::stdout().lock();
    for slices in [1, 10] {
        let mut least = flight(slices);
        for _ in 1..FLIGHTS {
            for (kept, (_, time_ns)) in least.iter_mut().zip(flight(slices)) {
                kept.1 = kept.1.min(time_ns);
            }
        }
        let mut by_name: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
        for (name, time_ns) in least {
            let times = by_name.entry(name).or_default();
            times.push(time_ns.saturating_sub(clock_ns));
        }
        let _ = writeln!(
            out,
            "slices a tick: {slices}           ticks   median    99 %    worst (ns)"
        );
        for (name, mut times) in by_name {
            times.sort_unstable();
            let at = |part: f64| times[((times.len() - 1) as f64 * part) as usize];
            let _ = writeln!(
                out,
                "  {name:<22} {:>7} {:>8} {:>7} {:>8}",
                times.len(),
                at(0.5),
                at(0.99),
                at(1.0)
            );
        }
    }
}
