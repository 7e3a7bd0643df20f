//! `onecycle simulate`: simulate a relay test and write its recording.

use std::f64::consts::TAU;
use std::io::Write;
use std::process::ExitCode;

use onecycle_link::{Column, Columns, Position, Recording, RecordingBuilder, write_csv};
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Controller, Experiment, Noise, Sensed, Trace};

use crate::args::Simulate;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print_data, write_file};

/// Periods of the oscillation in a recording: some to settle, eight or more to fit.
const PERIODS: f64 = 20.0;
/// Largest number of samples of a simulation and of its dead time: half a day at 1 kHz.
const MOST_SAMPLES: f64 = 5e7;
/// Smallest number of samples in a period of the oscillation.
const FEWEST_SAMPLES_A_PERIOD: f64 = 4.0;

/// Samples in a period of the simulation that measures the amplitude, independent of the rate of the recording.
const SAMPLES_A_PERIOD: usize = 1000;

pub(crate) fn run(arguments: &Simulate) -> Result<ExitCode, Failure> {
    let process = arguments.process.process()?;
    positive("--sample-rate", arguments.sample_rate)?;
    positive("--amplitude", arguments.amplitude)?;
    not_negative("the pre-roll", arguments.preroll)?;
    let amplitude = noise_free_amplitude(arguments, &process)?;
    let experiment = experiment(arguments, &process, amplitude)?;
    let noise = experiment.sensor.noise_sigma.max(experiment.sensor.quantum);
    let waiting = Waiting::on("simulating");
    let trace = run_relay(&experiment, relay(arguments, noise)?, arguments.seed);
    let recording = recording(&trace)?;
    waiting.goes_on("writing");
    let head = head(arguments, &experiment);
    let comments: Vec<&str> = head.lines().collect();
    match arguments
        .out
        .as_ref()
        .filter(|path| path.as_os_str() != "-")
    {
        Some(path) => write_file(path, |file| write_csv(file, &recording, &comments))?,
        None => {
            let mut table = Vec::new();
            // Writing to memory cannot fail.
            let _ = write_csv(&mut table, &recording, &comments);
            drop(waiting);
            print_data(&table)?;
        }
    }
    Ok(ExitCode::from(exit::DONE))
}

/// A relay with reversed output, for a process with negative gain.
struct Reversed(Relay);

impl Controller for Reversed {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        -Controller::step(&mut self.0, dt_s, reference, sensed)
    }
}

fn run_relay(experiment: &Experiment, mut relay: Relay, seed: u64) -> Trace {
    let mut noise = Noise::from_seed(seed);
    if experiment.process.k_over_t_body() > 0.0 {
        experiment.run(&mut relay, &mut noise)
    } else {
        experiment.run(&mut Reversed(relay), &mut noise)
    }
}

/// The trace as a recording with all its samples.
fn recording(trace: &Trace) -> Result<Recording, Failure> {
    let columns = Columns::new(
        Column::named("time"),
        Column::named("input"),
        Column::named("output"),
    );
    let mut builder = RecordingBuilder::new(columns).with_max_points(trace.len() + 2);
    for (index, time_s) in (0..).zip(&trace.time_s) {
        let (input, output) = (trace.input[index as usize], trace.output[index as usize]);
        builder
            .push(Position::Sample(index), *time_s, input, output)
            .map_err(Failure::usage)?;
    }
    builder.finish().map_err(Failure::usage)
}

fn relay(arguments: &Simulate, noise_sigma: f64) -> Result<Relay, Failure> {
    let (amplitude, beta) = (arguments.amplitude as f32, arguments.beta as f32);
    let settings = RelaySettings {
        preroll_s: arguments.preroll as f32,
        noise_sigma: noise_sigma as f32,
        asymmetry: arguments.asymmetry as f32,
        trim_gain: if arguments.no_trim {
            0.0
        } else {
            RelaySettings::TRIM_GAIN
        },
        ..if arguments.bare {
            RelaySettings::bare(amplitude, beta)
        } else {
            RelaySettings::new(amplitude, beta)
        }
    };
    Relay::new(settings).map_err(Failure::usage)
}

fn positive(name: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Failure::usage(format!(
        "{name} must be positive, but is {value}"
    )))
}

fn not_negative(name: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value >= 0.0 {
        return Ok(value);
    }
    Err(Failure::usage(format!(
        "{name} must be zero or positive, but is {value}"
    )))
}

fn experiment(
    arguments: &Simulate,
    process: &Soiptd,
    amplitude: f64,
) -> Result<Experiment, Failure> {
    let sample_s = 1.0 / arguments.sample_rate;
    let duration_s = match arguments.duration {
        Some(duration_s) => positive("--duration", duration_s)?,
        None => arguments.preroll + PERIODS * period_s(arguments, process)?,
    };
    let samples = duration_s / sample_s;
    if !(2.0..=MOST_SAMPLES).contains(&samples) {
        return Err(Failure::usage(format!(
            "the simulation has {samples:.0} samples, but 2 to {MOST_SAMPLES:.0} are possible: change --duration or \
             --sample-rate"
        )));
    }
    if process.tau_s() / sample_s > MOST_SAMPLES {
        return Err(Failure::usage(format!(
            "--tau is longer than {MOST_SAMPLES:.0} samples: lower --sample-rate"
        )));
    }
    if !arguments.reference.is_finite() {
        return Err(Failure::usage(format!(
            "--reference must be a number, but is {}",
            arguments.reference
        )));
    }
    let mut experiment = Experiment::new(*process, sample_s, duration_s);
    experiment.reference = arguments.reference;
    experiment.input_bias = arguments.bias.of(arguments.amplitude);
    experiment.sensor.noise_sigma = not_negative("--noise", arguments.noise.of(amplitude))?;
    experiment.sensor.quantum = not_negative("--quantum", arguments.quantum.of(amplitude))?;
    experiment.jitter = not_negative("--jitter", arguments.jitter.of(sample_s) / sample_s)?;
    experiment.initial_output = arguments.reference + arguments.offset.of(amplitude);
    Ok(experiment)
}

fn period_s(arguments: &Simulate, process: &Soiptd) -> Result<f64, Failure> {
    let oscillation = process.describing_function_oscillation(arguments.amplitude, arguments.beta);
    let (omega, _) = oscillation.ok_or_else(|| {
        Failure::usage("the process does not oscillate at this phase: choose a smaller --beta")
    })?;
    let period_s = TAU / omega;
    if period_s * arguments.sample_rate < FEWEST_SAMPLES_A_PERIOD {
        return Err(Failure::usage(format!(
            "the oscillation has a period of {period_s:.3e} s, less than {FEWEST_SAMPLES_A_PERIOD} \
             samples: raise --sample-rate"
        )));
    }
    Ok(period_s)
}

/// Half the peak-to-peak output of the last two periods without bias, noise and jitter.
fn noise_free_amplitude(arguments: &Simulate, process: &Soiptd) -> Result<f64, Failure> {
    let period_s = period_s(arguments, process)?;
    let sample_s = period_s / SAMPLES_A_PERIOD as f64;
    let experiment = Experiment::new(*process, sample_s, PERIODS * period_s);
    let undisturbed = Simulate {
        preroll: 0.0,
        ..arguments.clone()
    };
    let trace = run_relay(&experiment, relay(&undisturbed, 0.0)?, 0);
    Ok(trace.amplitude_of_last(2 * SAMPLES_A_PERIOD))
}

/// The true process, relay and disturbances, as comment lines.
fn head(arguments: &Simulate, experiment: &Experiment) -> String {
    let mut text = Vec::new();
    let process = &experiment.process;
    let number =
        |value: Option<f64>| value.map_or("infinite".to_owned(), |value| value.to_string());
    // Writing to memory cannot fail.
    let _ = writeln!(
        text,
        "simulated relay test: onecycle {}",
        env!("CARGO_PKG_VERSION")
    );
    let _ = writeln!(
        text,
        "process: k {}, k_over_t_body {}, t_prop_s {}, t_body_s {}, tau_s {}",
        number(process.k()),
        process.k_over_t_body(),
        process.t_prop_s(),
        number(process.t_body_s()),
        process.tau_s()
    );
    let _ = writeln!(
        text,
        "relay: amplitude {}, beta {}, trim {}",
        arguments.amplitude,
        arguments.beta,
        if arguments.no_trim { "off" } else { "on" }
    );
    let _ = writeln!(
        text,
        "input_bias {}, noise_sigma {}, quantum {}, jitter {}, seed {}",
        experiment.input_bias,
        experiment.sensor.noise_sigma,
        experiment.sensor.quantum,
        experiment.jitter,
        arguments.seed
    );
    String::from_utf8_lossy(&text).into_owned()
}
