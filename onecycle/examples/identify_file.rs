//! Identify a process from a CSV file and print its controller:
//! `cargo run -p onecycle --example identify_file [FILE]`.
//!
//! Without FILE the example reads `examples/simulated_hover.csv` of the repository.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{CsvOptions, Design, Identified, Identify, Interval};

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
    let found = Identify::new().run(&recording);
    if let Some(oscillation) = found.oscillation() {
        println!(
            "{} of {} steady cycles, period {:.4} s, amplitude {:.4e}, noise {:.1e}",
            oscillation.cycles_used,
            oscillation.cycles_steady,
            oscillation.period_s,
            oscillation.amplitude,
            oscillation.noise_sigma
        );
    }
    // A verdict is also an error, so `?` ends the program with its message.
    let identified = found.outcome?;
    report(&identified);
    for remark in &found.remarks {
        println!("- {remark:?}");
    }
    Ok(())
}

fn report(identified: &Identified) {
    println!("{}", identified.model.structure().transfer_function());
    for (parameter, interval) in identified.estimate.iter() {
        let known = match interval
            .high
            .filter(|_| identified.estimate.is_below(parameter))
        {
            Some(high) => format!("below {high:.5}"),
            None => with_ends(&interval),
        };
        println!("{:<11} {known}", parameter.symbol());
    }
    let Some(Design {
        controller,
        margins,
        ..
    }) = identified.design
    else {
        println!("no controller: see the remarks");
        return;
    };
    println!(
        "{}: Kp {:.4}, Ki {:.4}, Kd {:.4}",
        controller.form().law(),
        controller.kp(),
        controller.ki(),
        controller.kd()
    );
    println!(
        "phase margin {:.1} deg, delay margin {:.1} ms",
        margins.phase_margin_rad.to_degrees(),
        1e3 * margins.delay_margin_s
    );
    // There is no gain margin if no gain makes the loop unstable: a process without dead time and damping.
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

/// `None` stands for infinite: `T_body` and `K` are unbounded above if the recording does not show the damping.
fn with_ends(interval: &Interval) -> String {
    let number =
        |value: Option<f64>| value.map_or("infinite".to_owned(), |value| format!("{value:.5}"));
    let [estimate, low, high] = [interval.estimate, interval.low, interval.high].map(number);
    format!("{estimate:>9}   90 %: {low} .. {high}")
}
