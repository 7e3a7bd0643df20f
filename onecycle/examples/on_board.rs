//! The on-board tuner in a control loop: `cargo run -p onecycle --example on_board`.
//!
//! The loop is what firmware runs at every tick; only [`Axis`], sensors and motors, is simulated. Five seconds under a
//! safe controller, then the test: relay, identification in slices, the controller that was found, checked against its
//! prediction. At 15 s the reference steps.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{Pd, RelaySettings, Sensor, Soiptd};
use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::Limits;
use onecycle_onboard::tuner::{Tuner, TunerPhase, TunerSettings};
use onecycle_plant::{FixedStepProcess, Noise};

/// Time between ticks (s).
const TICK_S: f64 = 0.001;
/// Standard deviation of a sample (m): 1 % of the oscillation's amplitude.
const NOISE_SIGMA: f64 = 3e-5;
/// When the test starts, when the reference steps, when it all ends (ticks).
const START: u32 = 5_000;
const STEP: u32 = 15_000;
const END: u32 = 18_000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut axis = Axis::new()?;
    let mut tuner = Tuner::new(&settings())?;
    let mut phase = tuner.phase();
    for tick in 0..END {
        if tick == START {
            tuner.start();
        }
        // These three lines are the firmware's.
        let reference = if tick < STEP { 0.0 } else { 0.1 };
        let command = tuner.step(f64::from(tick) * TICK_S, &axis.measure(), reference);
        axis.command(command);

        if tuner.phase() != phase {
            phase = tuner.phase();
            println!("{:6.3} s  {}", f64::from(tick) * TICK_S, phase.name());
        }
        // The output is the safe controller's since this very tick; a pilot lands and reads why.
        if let (TunerPhase::Aborted, Some(reason)) = (phase, tuner.reason()) {
            return Err(reason.to_string().into());
        }
    }
    report(&tuner)?;
    println!(
        "3 s after a step of 0.1 m it is at {:.4} m",
        axis.process.output()
    );
    Ok(())
}

/// What the vehicle needs to be safe: see `docs/onboard.md` for how to choose.
fn settings() -> TunerSettings {
    let new = TunerSettings::new(0.05, TICK_S as f32);
    TunerSettings {
        relay: RelaySettings {
            noise_sigma: NOISE_SIGMA as f32,
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
        // Damped and slow; the thrust that hovers is only roughly known.
        safe: PdLaw::new(Pd { kp: 0.3, kd: 0.3 }, 0.0),
        bias_filter_s: 1.0,
        ..new
    }
}

fn report(tuner: &Tuner<'_>) -> Result<(), Box<dyn Error>> {
    let found = tuner.identified().ok_or("the test has told nothing")?;
    let (process, truth) = (&found.process, truth()?);
    for (name, found, truth) in [
        ("K/T_body", process.k_over_t_body(), truth.k_over_t_body()),
        (
            "T_prop (ms)",
            1e3 * process.t_prop_s(),
            1e3 * truth.t_prop_s(),
        ),
        ("delay (ms)", 1e3 * process.tau_s(), 1e3 * truth.tau_s()),
    ] {
        println!("{name:<12} {found:>7.3}   (truth {truth:.3})");
    }
    println!(
        "Kp {:.3}, Kd {:.3}, phase margin {:.1} deg",
        found.pd.kp,
        found.pd.kd,
        found.phase_margin_rad.to_degrees()
    );
    if tuner.is_proven() {
        Ok(())
    } else {
        Err("the controller has not proven itself".into())
    }
}

/// The paper's altitude, thrust as a part of hover.
fn truth() -> Result<Soiptd, onecycle::SoiptdError> {
    Soiptd::from_acceleration_gain(9.81, 0.0321, 1.0 / 1.6886, 0.0237)
}

/// Sensors and motors.
struct Axis {
    process: FixedStepProcess,
    sensor: Sensor,
    noise: Noise,
}

impl Axis {
    fn new() -> Result<Self, onecycle::SoiptdError> {
        Ok(Self {
            process: FixedStepProcess::new(&truth()?, TICK_S),
            sensor: Sensor::noisy(NOISE_SIGMA),
            noise: Noise::from_seed(1),
        })
    }

    /// Position with noise, rate without.
    fn measure(&mut self) -> Measurement {
        let value = self.sensor.read(self.process.output(), &mut self.noise);
        Measurement::of(value as f32).with_rate(self.process.rate() as f32)
    }

    /// Held until the next tick. It takes 1 % more thrust to hover than was assumed.
    fn command(&mut self, command: f32) {
        self.process.step(f64::from(command) - 0.01);
    }
}
