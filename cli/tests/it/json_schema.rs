//! docs/identify-json.md against the program: the same keys, no more and no less.

use std::collections::BTreeSet;
use std::path::Path;

use onecycle::Structure;
use serde_json::Value;

use crate::common::{Scratch, Table, identify, run, run_once, simulate};

fn document() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/identify-json.md");
    std::fs::read_to_string(path).unwrap()
}

/// Keys in the first column of the tables, without those of an interval.
fn documented() -> BTreeSet<String> {
    let text = document();
    let key = |line: &str| Some(line.strip_prefix("| `")?.split('`').next()?.to_owned());
    text.lines().filter_map(key).collect()
}

/// Dotted paths of all keys of an object; an interval is one key.
fn keys(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    let Value::Object(object) = value else { return };
    if object.contains_key("estimate") {
        return;
    }
    for (key, value) in object {
        let path = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        keys(value, &path, found);
        found.insert(path);
    }
}

// The identifications from cycles and from the whole recording together have every documented key. `columns` and its three columns, and
// `verdict`, are documented by their parts alone.
#[test]
fn the_documented_keys_are_those_of_the_report() {
    let mut found = BTreeSet::new();
    let cascade = [
        "--cycles",
        "8",
        "--controller",
        "cascade-pid",
        "--against",
        "20,0,9",
    ];
    for arguments in [&cascade[..], &["--rows"]] {
        let report = identify(Table::noisy().csv(), arguments).identified();
        keys(&report.0, "", &mut found);
    }
    let process = [
        "--k", "1", "--t-prop", "0.0321", "--t-body", "1.6886", "--tau", "0.0237",
    ];
    let two = simulate(
        &process,
        &[
            "--second-amplitude",
            "0.6",
            "--noise",
            "1%",
            "--duration",
            "8",
        ],
    );
    keys(&identify(two, &[]).identified().0, "", &mut found);
    let refused = identify(Table::noisy().csv(), &["--beta", "-0.3"]).no_process("clock_offset");
    keys(&refused.0["refused"], "refused", &mut found);
    // Those of a structure and of a fit are documented once.
    let again = ["refused.process.", "refused.fit."];
    found.retain(|key| !again.iter().any(|part| key.starts_with(part)));
    let folder = Scratch::new();
    let log = format!(
        "{}/../examples/logs/px4_chirps.ulg",
        env!("CARGO_MANIFEST_DIR")
    );
    let file = folder.name("x.params");
    let outcome = run(&[
        "identify", &log, "--axis", "pitch", "--json", "--write", &file,
    ]);
    keys(
        &serde_json::from_str(&outcome.stdout).unwrap(),
        "",
        &mut found,
    );
    let acro = log.replace("px4_chirps.ulg", "betaflight_acro_long.bbl");
    let by_response = run_once(&["identify", &acro, "--axis", "yaw", "--json"]).stdout;
    let by_response: Value = serde_json::from_str(&by_response).unwrap();
    keys(&by_response["fit"], "fit", &mut found);
    // Those of the three columns of the answer are documented once.
    let of_columns = ["answer.figures.now.", "answer.figures.half."];
    found.retain(|key| !of_columns.iter().any(|part| key.starts_with(part)));
    // Those of a controller, its margins and its step are documented once.
    let of_against = |key: &String| {
        let parts = ["controller", "margins", "step"];
        let is_part = |part: &&str| key.starts_with(&format!("against.{part}."));
        parts.iter().any(is_part)
    };
    found.retain(|key| !of_against(key));
    for part in [
        "columns",
        "columns.time",
        "columns.input",
        "columns.output",
        "verdict",
    ] {
        assert!(found.remove(part), "{part}");
    }
    assert_eq!(found, documented());
}

// A refusal has the same keys at the top, null where there is no answer.
#[test]
fn a_refusal_has_the_same_keys() {
    let whole = identify(Table::noisy().csv(), &[]).identified();
    let report = identify("t_s,u,y\n0,1,0\n1,1,0\n2,1,0\n", &[]).no_process("no_relay");
    let top = |value: &Value| {
        value
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!(top(&report.0), top(&whole.0));
    for key in [
        "excitation",
        "structure",
        "process",
        "controller",
        "margins",
    ] {
        assert_eq!(report.0[key], Value::Null, "{key}");
    }
}

// Each structure has a row with its formula and the keys of its parameters.
#[test]
fn every_structure_is_documented() {
    let text = document();
    for structure in Structure::ALL {
        let keys: Vec<String> = (structure.parameters().iter())
            .map(|parameter| format!("`{}`", parameter.key()))
            .collect();
        let row = format!(
            "| {} | `{}` | {} |\n",
            structure.name(),
            structure.transfer_function(),
            keys.join(", ")
        );
        assert!(text.contains(&row), "{row}");
    }
}
