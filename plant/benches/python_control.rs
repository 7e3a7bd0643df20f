//! The same simulations here and in python-control, in turn in one run.
//!
//! The environment variable `PYTHON` names the interpreter; the default is `python3`.

#![expect(clippy::print_stdout, reason = "a bench reports")]

use std::error::Error;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use onecycle_onboard::{Pd, Relay, RelaySettings, Soiptd};
use onecycle_plant::{Experiment, Noise, SampledPd};

/// Number of runs of each.
const ROUNDS: usize = 3;
const STEPS: usize = 3_000_000;
const SAMPLE_S: f64 = 1e-3;

/// Steps per second of the relay loop and of the PD loop; amplitude of the relay loop and output of the PD loop
/// at 0.3 s.
struct Measured {
    relay_steps_per_s: f64,
    pd_steps_per_s: f64,
    relay_amplitude: f64,
    pd_output: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !has_control(&python) {
        println!(
            "nothing to compare with: `{python} -m pip install control`, or name an interpreter \
             that has it in PYTHON"
        );
        return Ok(());
    }
    let (mut theirs, mut ours) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        theirs.push(python_control(&python)?);
        ours.push(onecycle()?);
    }
    println!("median of {ROUNDS} runs each, in turn; steps a second");
    println!(
        "{:>12} {:>15} {:>15} {:>8}",
        "loop", "python-control", "onecycle", "ratio"
    );
    report("relay", &theirs, &ours, |measured| {
        measured.relay_steps_per_s
    });
    report("PD", &theirs, &ours, |measured| measured.pd_steps_per_s);
    let apart = |of: fn(&Measured) -> f64| (of(&theirs[0]) / of(&ours[0]) - 1.0).abs();
    println!(
        "they agree: relay amplitude within {:.1e}, PD output at 0.3 s within {:.1e} of itself",
        apart(|measured| measured.relay_amplitude),
        apart(|measured| measured.pd_output)
    );
    Ok(())
}

fn report(name: &str, theirs: &[Measured], ours: &[Measured], of: fn(&Measured) -> f64) {
    let median = |all: &[Measured]| {
        let mut values: Vec<f64> = all.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let (theirs, ours) = (median(theirs), median(ours));
    println!(
        "{name:>12} {theirs:>15.3e} {ours:>15.3e} {:>8.0}",
        ours / theirs
    );
}

fn has_control(python: &str) -> bool {
    Command::new(python)
        .args(["-c", "import control"])
        .output()
        .is_ok_and(|output| output.status.success())
}

fn python_control(python: &str) -> Result<Measured, Box<dyn Error>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../experiments/python_control.py");
    let output = Command::new(python).arg(script).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    let line = String::from_utf8(output.stdout)?;
    Ok(Measured {
        relay_steps_per_s: number(&line, "relay_steps_per_s")?,
        pd_steps_per_s: number(&line, "pd_steps_per_s")?,
        relay_amplitude: number(&line, "relay_amplitude")?,
        pd_output: number(&line, "pd_output_at_300_ms")?,
    })
}

/// Number after `"key": ` in a flat line of JSON.
fn number(line: &str, key: &str) -> Result<f64, Box<dyn Error>> {
    let (_, rest) = line
        .split_once(&format!("\"{key}\": "))
        .ok_or(format!("no {key}: {line}"))?;
    let end = rest.find([',', '}']).unwrap_or(rest.len());
    Ok(rest[..end].parse()?)
}

/// The hover process and the loops of the script.
fn onecycle() -> Result<Measured, Box<dyn Error>> {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?;
    let experiment = Experiment::new(process, SAMPLE_S, STEPS as f64 * SAMPLE_S);
    let mut relay = Relay::new(RelaySettings::bare(1.0, RelaySettings::DISTINGUISHING_BETA))?;
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    let begin = Instant::now();
    experiment.observe(&mut relay, &mut Noise::from_seed(0), |row| {
        if (8.0..9.0).contains(&row.time_s) {
            lowest = lowest.min(row.true_output);
            highest = highest.max(row.true_output);
        }
        ControlFlow::Continue(())
    });
    let relay_steps_per_s = STEPS as f64 / begin.elapsed().as_secs_f64();

    let experiment = experiment.with_reference(1.0);
    let mut controller = SampledPd(Pd {
        kp: 192.918,
        kd: 29.523,
    });
    let mut sample = 0_usize;
    let (mut pd_output, mut sum) = (0.0, 0.0);
    let begin = Instant::now();
    experiment.observe(&mut controller, &mut Noise::from_seed(0), |row| {
        if sample == 300 {
            pd_output = row.true_output;
        }
        sample += 1;
        sum += row.true_output;
        ControlFlow::Continue(())
    });
    black_box(sum);
    Ok(Measured {
        relay_steps_per_s,
        pd_steps_per_s: STEPS as f64 / begin.elapsed().as_secs_f64(),
        relay_amplitude: 0.5 * (highest - lowest),
        pd_output,
    })
}
