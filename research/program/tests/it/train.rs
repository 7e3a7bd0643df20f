//! `train` of the classifier: a small recipe, interruptions, refusals.

use crate::common::{NOT_WRITTEN, Scratch, UNREADABLE, run};
use crate::killed::killed_when;
use serde_json::Value;

/// A few seconds of work: 2 losses, 6 epochs each.
const RECIPE: &str = include_str!("../../reproduction/paper_network_small.toml");

fn recipe(folder: &Scratch) -> String {
    folder.write("recipe.toml", RECIPE.as_bytes())
}

/// A report without its times.
fn timeless(path: &str) -> Value {
    let mut report: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    report["seconds"].take();
    for network in report["networks"].as_array_mut().unwrap() {
        network["seconds"].take();
    }
    report
}

// The table has both losses, both rules and every set; the file has a network with 4520 inputs. Killed in the first and in
// the second loss and resumed on another number of threads, the run gives the same bytes and the same table.
#[test]
fn from_recipe_to_table_and_network_through_interruptions() {
    let folder = Scratch::new();
    let recipe = recipe(&folder);
    let [whole, json, out, again] =
        ["whole.onnx", "whole.json", "out.onnx", "again.json"].map(|n| folder.name(n));
    let made = run(&["train", "--recipe", &recipe, "-o", &whole, "--json", &json]);
    assert_eq!(made.code, Some(0), "{made:?}");
    made.without_nan();
    for words in [
        "Network   4520-64-32-",
        "conventional softmax         most likely",
        "modified softmax, shifted    least cost",
        "30 experiments of random processes, bias left in",
        "best possible class",
        "Best on the classes: ",
    ] {
        assert!(made.stdout.contains(words), "{words}: {}", made.stdout);
    }
    assert_eq!(folder.files().len(), 3, "{:?}", folder.files());

    let report = timeless(&json);
    assert_eq!(report["schema"], "onecycle.train.classifier/2");
    assert_eq!(report["networks"].as_array().unwrap().len(), 2);
    let classes = report["classes"].as_u64().unwrap();
    assert_eq!(report["weights"], 4521 * 64 + 65 * 32 + 33 * classes);
    let floor = report["sets"][1]["best"][0]["mean"].as_f64().unwrap();
    for network in report["networks"].as_array().unwrap() {
        let scores = &network["scores"][1][0];
        // No pick is better than the best class, and the network has learnt something: random picks cost about 40 %.
        let mean = scores["mean"].as_f64().unwrap();
        assert!((floor..0.15).contains(&mean), "{floor} {mean}");
    }

    let resumed: Vec<&str> = vec![
        "train",
        "--recipe",
        &recipe,
        "-o",
        &out,
        "--json",
        &again,
        "--threads",
        "3",
    ];
    let work = folder.path("out.onnx.part");
    for network in ["network_1.part", "network_2.part"] {
        killed_when(&resumed, || work.join(network).exists());
        assert!(!folder.path("out.onnx").exists());
    }
    let resumed = run(&resumed);
    assert_eq!(resumed.code, Some(0), "{resumed:?}");
    for words in [" of network 1 of ", " of network 2 of "] {
        let said = resumed
            .stderr
            .lines()
            .filter(|line| line.contains(words) && line.contains("resuming after epoch "));
        assert_eq!(said.count(), 1, "{words}: {}", resumed.stderr);
    }
    assert!(
        std::fs::read(&whole).unwrap() == std::fs::read(&out).unwrap(),
        "other bytes"
    );
    assert_eq!(timeless(&json), timeless(&again));
    assert_eq!(folder.files().len(), 5, "{:?}", folder.files());
}

#[test]
fn wrong_recipes_are_refused_in_one_sentence() {
    let folder = Scratch::new();
    for (from, to, words) in [
        (
            "network = \"classifier\"",
            "",
            &["missing field \"network\""][..],
        ),
        (
            "\"classifier\"",
            "\"frog\"",
            &["line 3, network", "\"frog\""],
        ),
        (
            "batch = 32",
            "batches = 32",
            &["line 21: unknown field \"batches\""],
        ),
        (
            "seed = 1\nspace",
            "seed = \"x\"\nspace",
            &["line 4, seed", "invalid type"],
        ),
        ("batch = 32", "batch = 0", &["batch must be 1 or more"]),
        (
            "dropout = 0.1",
            "dropout = 1.0",
            &["dropout must be 0 to 0.9, but is 1.0"],
        ),
        ("[64, 32]", "[64, 0]", &["hidden must be 1 to 100,000"]),
        ("bias = 0.5", "bias = -1.0", &["bias must be 0 to 0.9"]),
        ("systems = 30", "systems = 0", &["tests.systems must be"]),
        ("rate = 0.05", "rate = nan", &["rate must be positive"]),
        (
            "\"cross_entropy\"",
            "{ gaussian = { dimension = 3 } }",
            &["losses", "classes"],
        ),
        (
            "deterioration = 0.2",
            "deterioration = 2.0",
            &["deterioration must be"],
        ),
        (
            "tau_s = [0.005, 0.05]",
            "tau_s = [0.05, 0.005]",
            &["tau_s must be"],
        ),
    ] {
        assert!(RECIPE.contains(from), "{from}");
        let spoilt = folder.write("bad.toml", RECIPE.replacen(from, to, 1).as_bytes());
        let refused = run(&["train", "--recipe", &spoilt]);
        refused.refused(UNREADABLE, &[&["bad.toml"], words].concat());
    }
    run(&["train", "--recipe", &folder.name("none.toml")]).refused(UNREADABLE, &["none.toml"]);
    run(&["train", "--recipe", "x.toml", "--restart"]).misused(&["required"]);
    run(&["train"]).misused(&["required"]);
}

// Work of another recipe and damaged networks are refused and kept.
#[test]
fn a_part_of_something_else() {
    let folder = Scratch::new();
    let recipe = recipe(&folder);
    let out = folder.name("out.onnx");
    let part = folder.path("out.onnx.part/network_1.part");
    killed_when(&["train", "--recipe", &recipe, "-o", &out], || {
        part.exists()
    });
    let left = std::fs::read(&part).unwrap();
    let other = folder.write(
        "other.toml",
        RECIPE.replacen("seed = 1", "seed = 2", 1).as_bytes(),
    );
    for (recipe, bytes, words) in [
        (&other, left.clone(), "other settings, seed 1 instead of 2"),
        (&recipe, left[..left.len() / 2].to_vec(), "use --restart"),
        (&recipe, b"nothing of the kind".to_vec(), "use --restart"),
    ] {
        std::fs::write(&part, &bytes).unwrap();
        let refused = run(&["train", "--recipe", recipe, "-o", &out]);
        refused.refused(UNREADABLE, &["out.onnx.part", words]);
        assert!(std::fs::read(&part).unwrap() == bytes);
    }
    let nowhere = folder.name("no/such/folder/out.onnx");
    let refused = run(&["train", "--recipe", &recipe, "-o", &nowhere]);
    refused.refused(NOT_WRITTEN, &["no/such/folder"]);
}
