//! Identify a process from samples in memory: `cargo run -p onecycle --example identify_samples`.
//!
//! The samples come from a simulated relay test of a multirotor axis with sensor noise and input bias. The first 0.3 s
//! of the same recording are too short: the outcome is a verdict.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{
    Experiment, Identify, Noise, Parameter, Recording, Relay, RelaySettings, Sensor, Soiptd, Trace,
};

/// Sample period (s).
const SAMPLE_S: f64 = 0.001;
/// Amplitude of the relay (input unit).
const AMPLITUDE: f32 = 0.5;
/// Standard deviation of the noise of one sample (output unit): 2 % of the amplitude of the oscillation.
const NOISE_SIGMA: f64 = 3e-5;

fn main() -> Result<(), Box<dyn Error>> {
    let truth = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?;
    let trace = relay_test(&truth)?;

    let recording = Recording::from_samples(&trace.time_s, &trace.input, &trace.output)?;
    let found = Identify::new().run(&recording);
    let identified = found.outcome?;
    println!("                  truth      found   within its 90 %");
    for (parameter, truth) in [
        (Parameter::KOverTBody, truth.k_over_t_body()),
        (Parameter::TProp, truth.t_prop_s()),
        (Parameter::Tau, truth.tau_s()),
    ] {
        let name = parameter.key();
        let interval = identified.estimate.get(parameter).ok_or("not reported")?;
        let estimate = interval.estimate.ok_or("an estimate is unbounded")?;
        let is_within = if interval.holds(truth) { "yes" } else { "no" };
        println!("{name:<13} {truth:>9.5}  {estimate:>9.5}   {is_within}");
    }
    let controller = identified.design.ok_or("no controller")?.controller;
    println!(
        "Kp {:.3}, Ki {:.3}, Kd {:.3}",
        controller.kp(),
        controller.ki(),
        controller.kd()
    );
    for remark in &found.remarks {
        println!("- {remark:?}");
    }

    // The first 0.3 s: less than a cycle.
    let begin = 300;
    let short = Recording::from_samples(
        &trace.time_s[..begin],
        &trace.input[..begin],
        &trace.output[..begin],
    )?;
    match Identify::new().run(&short).outcome {
        Ok(_) => Err("a process was identified from less than a cycle".into()),
        Err(verdict) => {
            println!("the first 0.3 s: {verdict}");
            Ok(())
        }
    }
}

/// Eight seconds under the relay of the firmware.
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
