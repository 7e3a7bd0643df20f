//! The studio: what its page asks of the library is what the program says, and the program writes the page.

use std::path::Path;

use onecycle_cli::embed::Studio;
use serde_json::{Value, json};

use crate::common::{Scratch, run};

fn of_repository(name: &str) -> String {
    format!("{}/../{name}", env!("CARGO_MANIFEST_DIR"))
}

fn ask(studio: &mut Studio, message: &Value) -> Value {
    serde_json::from_str(&studio.ask(&message.to_string())).unwrap()
}

fn refused(studio: &mut Studio, message: &Value, words: &[&str]) {
    let answer = ask(studio, message);
    let sentence = answer["error"]
        .as_str()
        .unwrap_or_else(|| panic!("{answer}"));
    for word in words {
        assert!(sentence.contains(word), "{sentence}");
    }
}

/// A studio that has identified, and its report.
fn identified(file: &str, options: &[&str]) -> (Studio, Value) {
    let mut studio = Studio::default();
    let opened = ask(&mut studio, &json!({ "do": "open", "file": file }));
    assert!(opened.get("error").is_none(), "{opened}");
    let report = ask(
        &mut studio,
        &json!({ "do": "identify", "options": options }),
    );
    (studio, report)
}

// The same code on the same machine; in a browser only the elementary functions differ.
#[test]
fn its_report_is_that_of_the_program_to_the_bit() {
    for (name, options) in [
        ("examples/simulated_hover.csv", &[][..]),
        ("examples/logs/ap_sysid_roll.bin", &["--axis", "roll"]),
        ("link/tests/data/px4_zstd.mcap", &["--axis", "roll"]),
    ] {
        let file = of_repository(name);
        let (_, report) = identified(&file, options);
        let program = run(&[&["identify", &file, "--json"], options].concat());
        let theirs: Value = serde_json::from_str(&program.stdout).unwrap();
        assert_eq!(report, theirs, "{name}");
    }
}

#[test]
fn proposed_gains_are_judged_as_in_the_report() {
    let (mut studio, report) = identified(
        &of_repository("examples/logs/px4_chirps.ulg"),
        &["--axis", "roll"],
    );
    let rows = ask(&mut studio, &json!({ "do": "trade_off" }));
    let rows = rows.as_array().unwrap();
    assert!(rows.len() > 5);
    let gains = rows
        .iter()
        .map(|row| row["controller"]["kp"].as_f64().unwrap());
    let gains: Vec<f64> = gains.collect();
    let rises = |pair: &[f64]| pair[1] > (1.0 - 1e-6) * pair[0];
    assert!(
        gains.windows(2).all(rises) && gains[3] > 1.5 * gains[0],
        "{gains:?}"
    );
    let proposed = &report["controller"];
    let gains = json!({
        "kp": proposed["kp"], "ki": proposed["ki"], "kd": proposed["kd"], "filter_s": proposed["filter_s"],
    });
    let judged = ask(
        &mut studio,
        &json!({ "do": "judge", "gains": gains, "bands": true }),
    );
    assert_eq!(judged["is_stable"], true, "{judged}");
    for name in ["phase_margin_deg", "ms"] {
        let (ours, theirs) = (
            &judged["figures"]["margins"][name],
            &report["margins"][name],
        );
        assert!(
            ours.is_number() && ours == theirs,
            "{name}: {ours} and {theirs}"
        );
    }
    let rows = |name: &str| judged[name].as_array().unwrap().clone();
    for (row, band) in rows("step").iter().zip(rows("step_band")).skip(1) {
        let [y, low, high] = [&row[1], &band[0], &band[1]]
            .map(|number| number.as_f64().unwrap_or_else(|| panic!("{row} {band}")));
        assert!(
            low <= high && (low - 0.1..high + 0.1).contains(&y),
            "{row} {band}"
        );
    }
    let files = ask(&mut studio, &json!({ "do": "parameters", "gains": gains }));
    let apply = files["apply"].as_str().unwrap_or_else(|| panic!("{files}"));
    assert!(apply.contains("MC_ROLLRATE_D"), "{apply}");
}

#[test]
fn gains_that_would_not_hold_the_vehicle_are_not_saved() {
    let file = of_repository("examples/logs/px4_chirps.ulg");
    let (mut studio, _) = identified(&file, &["--axis", "roll"]);
    let mut with = |[kp, ki, kd]: [f64; 3], words: &[&str]| {
        let gains = json!({ "kp": kp, "ki": ki, "kd": kd, "filter_s": 0.0 });
        let judged = ask(&mut studio, &json!({ "do": "judge", "gains": gains }));
        assert_eq!(judged["is_stable"], false, "{judged}");
        refused(
            &mut studio,
            &json!({ "do": "parameters", "gains": gains }),
            words,
        );
    };
    with([50.0, 0.0, 0.0], &["MC_ROLLRATE_P", "0.5"]);
    with([0.01, 9.0, 0.0], &["unstable"]);
}

#[test]
fn a_message_that_makes_no_sense_gets_a_sentence() {
    let mut studio = Studio::default();
    assert!(studio.ask("{").contains("not JSON"));
    refused(&mut studio, &json!({ "do": "fly" }), &["fly"]);
    refused(
        &mut studio,
        &json!({ "do": "page" }),
        &["Nothing is identified"],
    );
    refused(&mut studio, &json!({ "do": "view" }), &["No signals"]);
    let nowhere = json!({ "do": "identify", "options": ["--structure", "magic"] });
    refused(&mut studio, &nowhere, &["magic"]);
    let simulated = json!({ "do": "simulate", "options": ["--k", "1"] });
    refused(&mut studio, &simulated, &["--t-prop"]);
}

#[cfg(not(feature = "studio"))]
#[test]
fn a_program_without_the_page_says_where_it_is() {
    let folder = Scratch::new();
    let out = folder.name("studio.html");
    run(&["studio", "--no-open", "--out", &out]).misused(&["web/build.sh"]);
    assert!(!Path::new(&out).exists());
}

#[cfg(feature = "studio")]
#[test]
fn the_page_is_written_and_nothing_where_it_cannot_be() {
    let folder = Scratch::new();
    let out = folder.name("studio.html");
    let outcome = run(&["studio", "--no-open", "--out", &out]);
    assert_eq!((outcome.code, outcome.stdout.trim()), (Some(0), &*out));
    let page = std::fs::read_to_string(&out).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    let nowhere = folder.name("missing/studio.html");
    let outcome = run(&["studio", "--no-open", "--out", &nowhere]);
    assert_eq!(
        outcome.code,
        Some(crate::common::NOT_WRITTEN),
        "{}",
        outcome.stderr
    );
}
