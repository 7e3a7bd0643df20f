//! The studio: what its page asks of the library is what the program says, and the program writes the page.

use std::path::{Path, PathBuf};

use onecycle_cli::studio::Studio;
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
fn identified(file: &str, settings: &Value) -> (Studio, Value) {
    let mut studio = Studio::default();
    studio.take(Box::new(PathBuf::from(file)));
    let opened = ask(&mut studio, &json!({ "do": "open" }));
    assert!(opened.get("error").is_none(), "{opened}");
    let report = ask(
        &mut studio,
        &json!({ "do": "identify", "settings": settings }),
    );
    (studio, report)
}

/// The proposed gains, the proportional one times a factor.
fn proposed(report: &Value, factor: f64) -> Value {
    let of = &report["controller"];
    let kp = factor * of["kp"].as_f64().unwrap();
    json!({ "kp": kp, "ki": of["ki"], "kd": of["kd"], "filter_s": of["filter_s"] })
}

// The same code on the same machine; in a browser only the elementary functions differ.
#[test]
fn its_numbers_are_those_of_the_program_to_the_bit() {
    let roll = (json!({ "axis": "roll" }), &["--axis", "roll"][..]);
    let flat = (
        json!({ "cycles": 4, "ms": 1.5 }),
        &["--cycles", "4", "--ms", "1.5"][..],
    );
    for (name, (settings, options)) in [
        ("examples/simulated_hover.csv", (json!({}), &[][..])),
        ("examples/simulated_hover.csv", flat),
        ("examples/logs/ap_sysid_roll.bin", roll.clone()),
        ("link/tests/data/px4_zstd.mcap", roll),
    ] {
        let file = of_repository(name);
        let (mut studio, report) = identified(&file, &settings);
        let program = run(&[&["identify", &file, "--json"], options].concat());
        let text = ask(&mut studio, &json!({ "do": "json" }));
        assert_eq!(text["text"], program.stdout, "{name}");
        // What the page shows names its own fields.
        let theirs: Value = serde_json::from_str(&program.stdout).unwrap();
        for part in ["process", "controller", "controllers", "margins", "against"] {
            assert_eq!(report[part], theirs[part], "{name}: {part}");
        }
        assert_eq!(report["answer"]["gains"], theirs["answer"]["gains"]);
        let shown = report.to_string();
        let of_fields = shown.replace("“Further options”: --", "");
        assert!(
            shown.contains("“Further options”: --") && !of_fields.contains("--"),
            "{shown}"
        );
        let formula = report["formula"].as_str().unwrap_or_default();
        assert_eq!(
            formula.contains("e^(-tau s)"),
            report["process"].is_object()
        );
    }
}

#[test]
fn proposed_gains_are_judged_as_in_the_report() {
    let (mut studio, report) = identified(
        &of_repository("examples/logs/px4_chirps.ulg"),
        &json!({ "axis": "roll" }),
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
    let gains = proposed(&report, 1.0);
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

// Half of the way from the gains in force unless the whole is asked for.
#[test]
fn saved_steps_are_those_of_the_program() {
    let folder = Scratch::new();
    let file = of_repository("examples/logs/ap_sysid_roll.bin");
    let (mut studio, report) = identified(&file, &json!({ "axis": "roll" }));
    let gains = proposed(&report, 1.0);
    let half = json!({ "do": "parameters", "gains": gains });
    let whole = json!({ "do": "parameters", "gains": gains, "whole": true });
    let saved = [&half, &whole].map(|message| ask(&mut studio, message));
    for (saved, step) in saved.iter().zip([&[][..], &["--step", "1"]]) {
        let path = folder.name(&format!("roll{}.param", step.len()));
        let asked = ["identify", &file, "--axis", "roll", "--write", &path];
        run(&[&asked, step].concat());
        let written = std::fs::read_to_string(&path).unwrap();
        assert_eq!(saved["apply"].as_str(), Some(&*written));
        let margins = saved["says"].as_str().unwrap();
        assert!(margins.contains("phase margin"), "{margins}");
    }
    assert_ne!(saved[0]["apply"], saved[1]["apply"]);
}

#[test]
fn gains_that_break_limits_are_saved_after_a_question() {
    let file = of_repository("examples/logs/ap_sysid_roll.bin");
    let (mut studio, report) = identified(&file, &json!({ "axis": "roll" }));
    let mut message = json!({ "do": "parameters", "gains": proposed(&report, 1.6), "whole": true });
    let asked = ask(&mut studio, &message);
    assert!(asked.get("apply").is_none(), "{asked}");
    let judge = json!({ "do": "judge", "gains": message["gains"] });
    let judged = ask(&mut studio, &judge);
    for question in [&asked["asks"], &judged["asks"]] {
        let question = question.as_str().unwrap();
        assert!(
            question.contains("balanced") && question.contains("(at most 1.60)"),
            "{question}"
        );
    }
    message["below_limits"] = json!(true);
    let files = ask(&mut studio, &message);
    assert!(files["apply"].as_str().is_some(), "{files}");
    let judge = json!({ "do": "judge", "gains": proposed(&report, 1.0) });
    assert_eq!(ask(&mut studio, &judge)["asks"], Value::Null);
}

// The settings of the page have changed: what was identified before is not saved.
#[test]
fn a_failed_identification_leaves_nothing_to_save() {
    let file = of_repository("examples/logs/px4_chirps.ulg");
    let (mut studio, report) = identified(&file, &json!({ "axis": "roll" }));
    let options = json!({ "do": "identify", "settings": { "axis": "roll", "style": "magic" } });
    refused(&mut studio, &options, &["“Style”", "no such style"]);
    let gains = json!({ "do": "parameters", "gains": proposed(&report, 1.0) });
    refused(&mut studio, &gains, &["Nothing is identified"]);
}

#[test]
fn gains_that_would_not_hold_the_vehicle_are_not_saved() {
    let file = of_repository("examples/logs/px4_chirps.ulg");
    let (mut studio, _) = identified(&file, &json!({ "axis": "roll" }));
    let mut with = |[kp, ki, kd]: [f64; 3], words: &[&str]| {
        let gains = json!({ "kp": kp, "ki": ki, "kd": kd, "filter_s": 0.0 });
        let judged = ask(&mut studio, &json!({ "do": "judge", "gains": gains }));
        assert_eq!(judged["is_stable"], false, "{judged}");
        refused(
            &mut studio,
            &json!({ "do": "parameters", "gains": gains, "whole": true, "below_limits": true }),
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
    let nowhere = json!({ "do": "identify", "settings": { "structure": "magic" } });
    refused(&mut studio, &nowhere, &["“Structure”", "no such structure"]);
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
