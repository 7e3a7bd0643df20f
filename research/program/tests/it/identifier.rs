//! `train` of an identifier: from a small recipe to a working pack, interruptions, refusals.

use crate::common::{
    HOVER_K_OVER_T_BODY, NOT_IDENTIFIED, NOT_WRITTEN, Scratch, Table, UNREADABLE, identify, run,
};
use crate::killed::killed_when;
use serde_json::Value;

/// A few seconds of work: few cycles with few samples, few weights, few epochs. Relay and spaces are those of the built-in
/// identifier.
const RECIPE: &str = "network = \"density\"
hidden = [8]
bytes = false
learning = 300
choosing = 60
scoring = 40
epochs = 6
patience = 6
batch = 32
[experiments]
seed = 1
bias = 0.5
sigma = 0.03
[[experiments.families]]
samples_per_period = [40, 500]
";

fn trained(arguments: &[&str]) -> String {
    let outcome = run(&[&["train"], arguments].concat());
    // A few seconds of training do not make a useful pack, and the program says so.
    assert_eq!(outcome.code, Some(NOT_IDENTIFIED), "{outcome:?}");
    assert!(outcome.stdout.contains("Of little use"), "{outcome:?}");
    outcome.without_nan();
    outcome.stdout
}

/// A report without its times.
fn timeless(path: &str) -> Value {
    let mut report: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let times = report["seconds"].take();
    assert!(times["training"].is_number());
    report
}

// 34 inputs, 8 hidden units, 14 outputs: 35 x 8 + 9 x 14 = 406 weights of four bytes. The pack passes its self-test, and
// refinement with its start values and prior identifies the hovering multirotor within 2 %. Killed after an epoch and
// resumed on three threads, the run gives the same pack to the byte and leaves no other file.
#[test]
fn from_recipe_to_pack_through_an_interruption() {
    let folder = Scratch::new();
    let recipe = folder.write("recipe.toml", RECIPE.as_bytes());
    let [pack, json, other, again] =
        ["whole.pack", "whole.json", "other.pack", "other.json"].map(|name| folder.name(name));
    let said = trained(&["--recipe", &recipe, "-o", &pack, "--json", &json]);
    for words in [
        "406 weights, 1624 bytes",
        "6 epochs",
        "unseen processes",
        "|J| (%)",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let report = timeless(&json);
    assert_eq!(report["schema"], "onecycle.identifier/1");
    assert_eq!(folder.files().len(), 3, "{:?}", folder.files());

    let verified = run(&["pack", "verify", &pack]);
    assert_eq!(verified.code, Some(0), "{verified:?}");
    assert!(verified.stdout.contains("Self-test passed: 2 signatures"));
    let found = identify(Table::noisy().csv(), &["--pack", &pack]).identified();
    found.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.02);
    assert!(found.0["last_cycle"]["score"].is_number());
    let default = identify(Table::noisy().csv(), &[]).identified();
    assert_ne!(found.0["last_cycle"], default.0["last_cycle"]);

    let resumed = [
        "train",
        "--recipe",
        &recipe,
        "-o",
        &other,
        "--json",
        &again,
        "--threads",
        "3",
    ];
    let part = folder.path("other.pack.part/network_1.part");
    killed_when(&resumed, || part.exists());
    assert!(!folder.path("other.pack").exists());
    trained(&resumed[1..]);
    assert!(
        std::fs::read(&pack).unwrap() == std::fs::read(&other).unwrap(),
        "other bytes"
    );
    assert_eq!(timeless(&json), timeless(&again));
    assert_eq!(folder.files().len(), 5, "{:?}", folder.files());
}

#[test]
fn wrong_recipes_are_refused_in_one_sentence() {
    let folder = Scratch::new();
    let out = folder.name("out.pack");
    for (from, to, words) in [
        (
            "hidden = [8]",
            "hidden = [0]",
            "hidden must be 1 to 5 widths",
        ),
        (
            "hidden = [8]",
            "hidden = [129]",
            "hidden must be 1 to 5 widths",
        ),
        (
            "choosing = 60",
            "choosing = 0",
            "choosing must be 1 to 1000000000",
        ),
        (
            "learning = 300",
            "learning = 9223372036854775807",
            "learning must be 1 to 1000000000",
        ),
        (
            "batch = 32",
            "batches = 32",
            "line 9: unknown field \"batches\"",
        ),
        ("epochs = 6", "epochs = \"x\"", "line 7, epochs"),
        ("bias = 0.5", "bias = -1.0", "bias must be"),
        ("[40, 500]", "[500, 40]", "samples_per_period must be"),
        (
            "[40, 500]",
            "[40, 500]\n[[experiments.families]]\nspace = { t_prop_s = [0.015, 0.3], t_body_s = [0.2, 2.0], tau_s = [0.0005, 0.1], beta = -0.5 }",
            "the same beta",
        ),
    ] {
        assert!(RECIPE.contains(from), "{from}");
        let spoilt = folder.write("bad.toml", RECIPE.replacen(from, to, 1).as_bytes());
        let refused = run(&["train", "--recipe", &spoilt, "-o", &out]);
        refused.refused(UNREADABLE, &["bad.toml", words]);
        assert_eq!(folder.files(), ["bad.toml"]);
    }
    let recipe = folder.write("bad.toml", RECIPE.as_bytes());
    run(&["train", "--recipe", &recipe]).misused(&["--out"]);
    let nowhere = folder.name("bad.toml/out.pack");
    let refused = run(&["train", "--recipe", &recipe, "-o", &nowhere]);
    refused.refused(NOT_WRITTEN, &["bad.toml/out.pack"]);
    // Missing folders are not created.
    let nowhere = folder.name("nosuch/out.pack");
    let refused = run(&["train", "--recipe", &recipe, "-o", &nowhere]);
    refused.refused(NOT_WRITTEN, &["nosuch/out.pack"]);
    assert_eq!(folder.files(), ["bad.toml"]);
}
