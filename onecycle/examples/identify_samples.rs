//! From samples in memory to the process: `cargo run -p onecycle --example identify_samples`.
//!
//! A multirotor's attitude under a relay, its sensor noisy, its thrust not quite balanced; then the same recording cut
//! so short that it tells nothing, which is a value to handle like any other.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{Experiment, Noise, Recording, Relay, RelaySettings, Sensor, Soiptd, Trace};

/// Time between samples (s).
const SAMPLE_S: f64 = 0.001;
/// Half the jump of the relay (input unit).
const AMPLITUDE: f32 = 0.5;
/// Of a sample (output unit): 2 % of the oscillation's amplitude.
const NOISE_SIGMA: f64 = 3e-5;

fn main() -> Result<(), Box<dyn Error>> {
    let truth = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?;
    let trace = relay_test(&truth)?;

    let recording = Recording::from_samples(&trace.time_s, &trace.input, &trace.output)?;
    let found = onecycle::identify(&recording);
    let identified = found.outcome?;
    let process = &identified.process;
    println!("                 truth      found   within its 90 %");
    for (name, truth, interval) in [
        ("K/T_body", truth.k_over_t_body(), &process.k_over_t_body),
        ("T_prop (s)", truth.t_prop_s(), &process.t_prop_s),
        ("delay (s)", truth.tau_s(), &process.tau_s),
    ] {
        let estimate = interval.estimate.ok_or("an estimate is unbounded")?;
        let is_within = if interval.holds(truth) { "yes" } else { "no" };
        println!("{name:<12} {truth:>9.5}  {estimate:>9.5}   {is_within}");
    }
    let pd = identified.controller.pd;
    println!("Kp {:.3}, Kd {:.3}", pd.kp, pd.kd);
    for remark in &found.remarks {
        println!("- {remark}");
    }

    // The first 0.3 s: less than a cycle.
    let begin = 300;
    let short = Recording::from_samples(
        &trace.time_s[..begin],
        &trace.input[..begin],
        &trace.output[..begin],
    )?;
    match onecycle::identify(&short).outcome {
        Ok(_) => Err("0.3 s cannot tell the process".into()),
        Err(verdict) => {
            println!("of 0.3 s: {verdict}. {}", verdict.advice());
            Ok(())
        }
    }
}

/// Eight seconds under the relay that also flies.
fn relay_test(process: &Soiptd) -> Result<Trace, Box<dyn Error>> {
    let experiment = Experiment::new(*process, SAMPLE_S, 8.0)
        .with_input_bias(0.2 * f64::from(AMPLITUDE))
        .with_sensor(Sensor::noisy(NOISE_SIGMA));
    let mut relay = Relay::new(RelaySettings {
        noise_sigma: NOISE_SIGMA as f32,
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(AMPLITUDE, RelaySettings::DISTINGUISHING_BETA)
    })?;
    Ok(experiment.run(&mut relay, &mut Noise::from_seed(1)))
}
