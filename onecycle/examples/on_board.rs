//! The tuner of the firmware in a control loop: `cargo run -p onecycle --example on_board`.
//!
//! The loop is what firmware runs at every tick. Only [`Axis`], the sensors and motors, is simulated.
//!
//! | time (s) | what happens |
//! |----------|--------------|
//! | 0 to 5 | a safe controller holds the axis |
//! | from 5 | the tuner runs the relay test, identifies the process and switches to the new controller |
//! | then | the tuner compares the response with its prediction |
//! | 15 | the reference steps by 0.1 m |

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{Pd, RelaySettings, Sensor, Soiptd};
use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::Limits;
use onecycle_onboard::tuner::{Tuner, TunerPhase, TunerSettings};
use onecycle_plant::{FixedStepProcess, Noise};

/// Tick of the control loop (s).
const TICK_S: f64 = 0.001;
/// Standard deviation of the noise of one sample (m): 1 % of the amplitude of the oscillation.
const NOISE_SIGMA: f64 = 3e-5;
/// Start of the relay test (ticks).
const START: u32 = 5_000;
/// Step of the reference (ticks).
const STEP: u32 = 15_000;
/// End of the simulation (ticks).
const END: u32 = 18_000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut axis = Axis::new()?;
    let mut tuner = Tuner::new(&settings())?;
    let mut phase = tuner.phase();
    for tick in 0..END {
        if tick == START {
            tuner.start();
        }
        // The next three statements are all that the firmware needs.
        let reference = if tick < STEP { 0.0 } else { 0.1 };
        let command = tuner.step(f64::from(tick) * TICK_S, &axis.measure(), reference);
        axis.command(command);

        if tuner.phase() != phase {
            phase = tuner.phase();
            println!("{:6.3} s  {}", f64::from(tick) * TICK_S, phase.name());
        }
        // A pilot would look at the result first. Until then the safe controller holds the axis.
        if phase == TunerPhase::Proposed {
            tuner.accept();
        }
        // From this tick on the output is that of the safe controller. The pilot lands and reads the reason.
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

/// Settings with the limits of the vehicle. For their choice see `docs/onboard.md`.
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
        // Slow and well damped, since the hover thrust is only roughly known.
        safe: PdLaw::new(Pd { kp: 0.3, kd: 0.3 }, 0.0),
        bias_filter_s: 1.0,
        ..new
    }
}

fn report(tuner: &Tuner<'_>) -> Result<(), Box<dyn Error>> {
    let found = tuner.identified().ok_or("no process was identified")?;
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
        Err("the response to the new controller differs from its prediction".into())
    }
}

/// Altitude of the paper's hexacopter (m), with the thrust as a fraction of the hover thrust.
fn truth() -> Result<Soiptd, onecycle::SoiptdError> {
    Soiptd::from_acceleration_gain(9.81, 0.0321, 1.0 / 1.6886, 0.0237)
}

/// Simulated axis: process and sensor.
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

    /// Position with noise and rate without noise.
    fn measure(&mut self) -> Measurement {
        let value = self.sensor.read(self.process.output(), &mut self.noise);
        Measurement::of(value as f32).with_rate(self.process.rate() as f32)
    }

    /// Holds the command until the next tick. Hovering needs 1 % more thrust than assumed.
    fn command(&mut self, command: f32) {
        self.process.step(f64::from(command) - 0.01);
    }
}
