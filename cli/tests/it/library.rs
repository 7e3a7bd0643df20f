//! The library and the program give the same numbers for the same recording.

use std::path::PathBuf;

use onecycle::{
    CsvOptions, Identification, Method, Options, Pack, Recording, Signals, Verdict, identify,
    identify_by, identify_with, with_signals,
};
use serde_json::{Value, json};

use crate::common::{Table, run};

fn example(name: &str) -> PathBuf {
    let examples = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples"));
    examples.join(name)
}

fn of_samples(table: &Table) -> Recording {
    let column =
        |of: fn(&crate::common::Sample) -> f64| table.0.iter().map(of).collect::<Vec<f64>>();
    let (time_s, input) = (column(|s| s.time_s), column(|s| s.input));
    Recording::from_samples(&time_s, &input, &column(|s| s.output)).unwrap()
}

fn interval(of: &onecycle::Interval) -> Value {
    json!({"estimate": of.estimate, "low": of.low, "high": of.high})
}

// Numbers in the report read back to the same bits, so they equal the library's numbers exactly; sentences are equal too.
#[test]
fn the_program_says_what_the_library_finds() {
    for name in ["simulated_hover.csv", "jsbsim_f450_roll_clean.csv"] {
        let path = example(name);
        let recording = onecycle::read(&path, &CsvOptions::default()).unwrap();
        let found = identify(&recording);
        let identified = found.outcome.as_ref().unwrap();
        let report = run(&["identify", path.to_str().unwrap(), "--json"]).identified();

        let process = &identified.process;
        for (key, ours) in [
            ("k", &process.k),
            ("k_over_t_body", &process.k_over_t_body),
            ("t_prop_s", &process.t_prop_s),
            ("t_body_s", &process.t_body_s),
            ("tau_s", &process.tau_s),
            ("input_bias", &process.input_bias),
        ] {
            assert_eq!(report.0["process"][key], interval(ours), "{name}: {key}");
        }
        let (controller, step) = (&identified.controller, identified.step.unwrap());
        for (pointer, ours) in [
            ("/controller/kp", controller.pd.kp),
            ("/controller/kd", controller.pd.kd),
            ("/margins/delay_margin_s", controller.margins.delay_margin_s),
            ("/step/overshoot", step.overshoot),
            ("/step/settling_time_s", step.settling_time_s),
            ("/fit/misfit", identified.misfit),
        ] {
            assert_eq!(report.number(pointer), ours, "{name}: {pointer}");
        }
        let remarks: Vec<String> = found.remarks.iter().map(ToString::to_string).collect();
        assert_eq!(report.0["remarks"], json!(remarks), "{name}");
    }
}

// The altitude of ArduPilot is not steady, for the library and for the program.
#[test]
fn the_program_refuses_what_the_library_refuses() {
    let path = example("unsteady_ardupilot_alt.csv");
    let recording = onecycle::read(&path, &CsvOptions::default()).unwrap();
    let verdict = identify(&recording).outcome.unwrap_err();
    assert!(matches!(verdict, Verdict::NotSteady { .. }), "{verdict}");

    let report = run(&["identify", path.to_str().unwrap(), "--json"]).no_process(verdict.kind());
    assert_eq!(report.0["verdict"]["message"], verdict.to_string());
    assert_eq!(report.advice(), verdict.advice());
}

// A verdict can be returned as an error with `?`, with the same message.
#[test]
fn a_refusal_is_a_value_and_an_error() {
    let time_s: Vec<f64> = (0..1000).map(|tick| 1e-3 * f64::from(tick)).collect();
    let recording = Recording::from_samples(&time_s, &[0.2; 1000], &[0.0; 1000]).unwrap();
    let found = identify(&recording);
    assert_eq!(found.outcome, Err(Verdict::ConstantInput));
    assert_eq!((found.oscillation, found.remarks.len()), (None, 0));

    let gains = |found: Identification| -> Result<f64, Box<dyn std::error::Error>> {
        Ok(found.outcome?.controller.pd.kp)
    };
    let error = gains(found).unwrap_err();
    assert_eq!(error.to_string(), Verdict::ConstantInput.to_string());
}

// Numbers in a CSV file read back to the same bits.
#[test]
fn samples_in_memory_are_what_they_are_in_a_file() {
    let table = Table::noisy();
    let recording = of_samples(&table);
    let mut file = Vec::new();
    onecycle::write_csv(&mut file, &recording, &["a relay test"]).unwrap();
    let read = onecycle::read_from(file.as_slice(), &CsvOptions::default()).unwrap();
    let found = identify(&recording);
    assert!(found.outcome.is_ok(), "{:?}", found.outcome);
    assert_eq!(found, identify(&read));
}

// Of twenty cycles of 0.44 s, 20 ms without a switch are missing in the fifth last. The eight cycles fitted by default must
// then be on one side of the gap. If the gap is ignored, the cycle looks like the others, and the eight are on both sides.
#[test]
fn no_cycle_reaches_across_a_gap() {
    let mut table = Table::noisy();
    let rises = table.rises();
    let lost_s = table.0[rises[rises.len() - 5]].time_s + 0.1;
    table
        .0
        .retain(|sample| !(lost_s..lost_s + 0.02).contains(&sample.time_s));
    let recording = of_samples(&table);
    let gap = recording.gaps()[0];
    assert_eq!(recording.gaps().len(), 1);
    let breaks = with_signals(&recording, |signals| signals.breaks.to_vec());
    assert_eq!(breaks, [gap.index]);

    let is_across = |found: &Identification| {
        let used = found.oscillation.unwrap();
        used.start_s < gap.start_s && used.end_s > gap.end_s
    };
    let found = identify(&recording);
    assert!(found.outcome.is_ok() && !is_across(&found));
    let unbroken = with_signals(&recording, |signals| {
        let signals = Signals {
            breaks: &[],
            ..*signals
        };
        onecycle_identify::identify(&signals, &Options::default())
    });
    assert!(is_across(&unbroken));
}

#[test]
fn options_and_packs_are_passed_on() {
    let recording = of_samples(&Table::noisy());
    let options = Options {
        cycles: 2,
        phase_margin_rad: 45_f64.to_radians(),
        ..Options::default()
    };
    let found = identify_with(&recording, &options);
    assert_eq!(found.oscillation.unwrap().cycles_used, 2);
    // The interval of the phase margin, a few degrees wide, holds the requested margin and not the default one.
    let asked_and_usual = [45_f64, 20.0].map(|margin_deg| {
        let margin_rad = found.outcome.as_ref().unwrap().phase_margin_rad;
        margin_rad.holds(margin_deg.to_radians())
    });
    assert_eq!(asked_and_usual, [true, false]);

    // The built-in pack as an argument makes no difference; without a pack no cycle is read.
    let pack = Pack::embedded().unwrap();
    assert_eq!(identify_by(&recording, &options, Some(&pack)), found);
    assert!(found.reading.is_some());
    assert_eq!(identify_by(&recording, &options, None).reading, None);
    let by_network = Options {
        method: Method::Classify,
        ..options
    };
    let refused = identify_by(&recording, &by_network, None).outcome;
    assert_eq!(refused, Err(Verdict::Unknown { score: None }));
}
