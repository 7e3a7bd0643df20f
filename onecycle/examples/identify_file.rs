//! From a file to the process and its controller: `cargo run -p onecycle --example identify_file [FILE]`.
//!
//! Without a file it reads the simulated hover that comes with the sources.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{CsvOptions, Identified, Interval, Verdict};

const HOVER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../examples/simulated_hover.csv"
);

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).unwrap_or(HOVER.to_owned());
    let recording = onecycle::read(&file, &CsvOptions::default())?;
    for note in recording.notes() {
        println!("the reader: {note}");
    }
    let found = onecycle::identify(&recording);
    if let Some(oscillation) = &found.oscillation {
        println!(
            "{} of {} steady cycles, period {:.4} s, amplitude {:.4e}, noise {:.1e}",
            oscillation.cycles_used,
            oscillation.cycles_steady,
            oscillation.period_s,
            oscillation.amplitude,
            oscillation.noise_sigma
        );
    }
    // A verdict is a value; here, where there is nothing to do without a process, it is also the error.
    let identified = found.outcome.inspect_err(advise)?;
    report(&identified);
    for remark in &found.remarks {
        println!("- {remark}");
    }
    Ok(())
}

fn advise(verdict: &Verdict) {
    println!("{}", verdict.advice());
}

fn report(identified: &Identified) {
    let process = &identified.process;
    for (name, interval) in [
        ("K", &process.k),
        ("K/T_body", &process.k_over_t_body),
        ("T_prop (s)", &process.t_prop_s),
        ("T_body (s)", &process.t_body_s),
        ("delay (s)", &process.tau_s),
        ("input bias", &process.input_bias),
    ] {
        println!("{name:<11} {}", with_ends(interval));
    }
    let (pd, margins) = (identified.controller.pd, identified.controller.margins);
    println!("u = {:.4} (r - y) - {:.4} dy/dt", pd.kp, pd.kd);
    println!(
        "phase margin {:.1} deg, delay margin {:.1} ms",
        margins.phase_margin_rad.to_degrees(),
        1e3 * margins.delay_margin_s
    );
    // An undamped body without delay has no gain margin: no gain makes it unstable.
    if let Some(gain_margin) = margins.gain_margin {
        println!("gain margin {gain_margin:.2}");
    }
    if let Some(step) = &identified.step {
        println!(
            "a step rises in {:.3} s, overshoots by {:.0} %, settles in {:.3} s",
            step.rise_time_s,
            100.0 * step.overshoot,
            step.settling_time_s
        );
    }
}

/// An end that is not there is unbounded: of a body whose damping was not seen.
fn with_ends(interval: &Interval) -> String {
    let number =
        |value: Option<f64>| value.map_or("infinite".to_owned(), |value| format!("{value:.5}"));
    let [estimate, low, high] = [interval.estimate, interval.low, interval.high].map(number);
    format!("{estimate:>9}   90 %: {low} .. {high}")
}
