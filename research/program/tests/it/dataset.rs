//! `dataset`: files, interruptions, damage, growth, refusals.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::{NOT_WRITTEN, Outcome, Scratch, UNREADABLE, names_in, run};
use crate::killed::killed_when;
use onecycle_lab::learn::npz::{self, Column, Numbers};
use serde_json::Value;

/// A recipe of this repository.
const IDENTIFIER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../experiments/identifier.toml"
);

/// Few samples per period, so that the tests are fast.
const RECIPE: &str = "seed = 3\n[[families]]\nsamples_per_period = [40, 45]\n";

/// More experiments than one file holds (4096).
const TWO_FILES: &str = "4200";

/// A folder with [`RECIPE`], and the path of the recipe.
fn recipe() -> (Scratch, String) {
    let folder = Scratch::new();
    let path = folder.write("recipe.toml", RECIPE.as_bytes());
    (folder, path)
}

fn dataset(arguments: &[&str]) -> Outcome {
    let outcome = run(&[&["dataset"], arguments].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome
}

/// All files of a folder.
fn bytes_in(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let names = names_in(folder).into_iter();
    names
        .map(|name| {
            let bytes = std::fs::read(folder.join(&name)).unwrap();
            (name, bytes)
        })
        .collect()
}

// ---------------------------------------------------------------- reports and files

// A recipe gives files; the same command again finds them complete.
#[test]
fn from_recipe_to_files() {
    let folder = Scratch::new();
    let into = folder.name("identifier");
    let arguments = [IDENTIFIER, "--examples", "30", "--into", &into];
    let made = dataset(&arguments);
    assert_eq!(made.stderr, "");
    made.without_nan();
    for words in [
        "Family 1   weight 2: T_prop 0.015 .. 0.3 s",
        "Family 2   weight 1: T_prop 0.005 .. 0.12 s, T_body 20 .. 2000 s",
        "of 30 experiments",
        "Made now   30 experiments in ",
    ] {
        assert!(made.stdout.contains(words), "{words}: {}", made.stdout);
    }
    assert!(made.stdout.lines().all(|line| line.len() <= 100));
    let files = bytes_in(&folder.path("identifier"));
    let names: Vec<&String> = files.keys().collect();
    assert_eq!(names, ["manifest.json", "shard-00000.npz"]);
    let manifest: Value = serde_json::from_slice(&files["manifest.json"]).unwrap();
    assert_eq!(manifest["format"], "onecycle.dataset/1");
    assert_eq!(manifest["examples"], 30);
    assert_eq!(manifest["recipe"]["families"][1]["draw"], "logarithmic");
    // At most 1 % of the experiments do not oscillate.
    let rows = manifest["shards"][0]["rows"].as_u64().unwrap();
    assert!((29..=30).contains(&rows), "{rows}");

    let again = dataset(&[&arguments[..], &["--json"]].concat()).report();
    assert_eq!(again.0["schema"], "onecycle.dataset.summary/1");
    assert_eq!(again.0["examples"], rows);
    assert_eq!(again.0["without_oscillation"], 30 - rows);
    assert_eq!(
        (&again.0["files"], &again.0["files_kept"]),
        (&1.into(), &1.into())
    );
    assert_eq!(again.0["experiments_made"], 0);
    assert_eq!(again.0["experiments_per_s"], Value::Null);
    assert_eq!(bytes_in(&folder.path("identifier")), files);
    let said = dataset(&arguments).stdout;
    assert!(said.contains("nothing: all files exist"), "{said}");
}

// The default recipe is the paper's multirotors.
#[test]
fn the_paper_s_space_is_the_default() {
    let folder = Scratch::new();
    let into = folder.name("multirotors");
    let report = dataset(&["-n", "2", "--into", &into, "--json"]).report();
    let family = &report.0["recipe"]["families"][0];
    assert_eq!(family["space"]["t_body_s"], serde_json::json!([0.2, 2.0]));
    assert_eq!(
        family["samples_per_period"],
        serde_json::json!([89.0, 2306.0])
    );
}

// ---------------------------------------------------------------- the same bytes

// Grown from a smaller dataset on one thread; killed after the first file and resumed on three; damaged and made again:
// every file has the same bytes.
#[test]
fn the_same_bytes_however_they_come_about() {
    let (folder, recipe) = recipe();
    let run_into = |examples, name: &str, more: &[&str]| {
        let into = folder.name(name);
        let all = ["dataset", &recipe, "--examples", examples, "--into", &into];
        let outcome = run(&[&all, more].concat());
        assert_eq!(outcome.code, Some(0), "{outcome:?}");
        (bytes_in(&folder.path(name)), outcome.stderr)
    };
    let (small, said) = run_into("4150", "one", &["--threads", "1"]);
    assert_eq!(said, "");
    let (expected, said) = run_into(TWO_FILES, "one", &["--threads", "1"]);
    assert!(is_resumed(&said) && said.lines().count() == 1, "{said}");
    assert_eq!(expected.len(), 3);
    assert!(
        small["shard-00000.npz"] == expected["shard-00000.npz"],
        "other bytes"
    );
    assert!(
        small["shard-00001.npz"] != expected["shard-00001.npz"],
        "not grown"
    );
    let same = |found: &BTreeMap<String, Vec<u8>>| {
        // Not assert_eq, which would print megabytes.
        assert!(*found == expected, "other bytes");
    };

    let (three, into) = (folder.path("three"), folder.name("three"));
    let all = ["dataset", &recipe, "--examples", TWO_FILES, "--into", &into];
    stopped(&all, &three);
    let (found, said) = run_into(TWO_FILES, "three", &["--threads", "3"]);
    same(&found);
    assert!(is_resumed(&said) && said.lines().count() == 1, "{said}");

    let second = three.join("shard-00001.npz");
    let mut bytes = expected["shard-00001.npz"].clone();
    bytes[10_000] ^= 4;
    let damages: [&dyn Fn(); 3] = [
        &|| std::fs::write(&second, &bytes).unwrap(),
        &|| std::fs::write(&second, &bytes[..5_000]).unwrap(),
        &|| std::fs::remove_file(&second).unwrap(),
    ];
    for damage in damages {
        damage();
        let (found, said) = run_into(TWO_FILES, "three", &[]);
        same(&found);
        let lines: Vec<&str> = said.lines().collect();
        assert!(
            lines[0].ends_with("missing or damaged: shard-00001.npz"),
            "{said}"
        );
        assert!(is_resumed(lines[1]) && lines.len() == 2, "{said}");
    }
    // --restart uses no file of an earlier run, also not one of another recipe.
    let (found, said) = run_into(TWO_FILES, "three", &["--restart"]);
    same(&found);
    assert_eq!(said, "");
    let other = folder.write("other.toml", RECIPE.replace('3', "4").as_bytes());
    let all = ["dataset", &other, "--examples", "9", "--into", &into];
    run(&all).refused(UNREADABLE, &["another recipe"]);
    let outcome = run(&[&all[..], &["--restart"]].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    assert_eq!(bytes_in(&three).len(), 2);
}

/// Whether a line says that the run is resumed after one of two files.
fn is_resumed(line: &str) -> bool {
    line.starts_with("onecycle-lab: resuming after 1 of 2 files of ")
}

/// Kills a run once the manifest lists a file.
fn stopped(arguments: &[&str], folder: &Path) {
    let lists_a_file = || {
        let text = std::fs::read_to_string(folder.join("manifest.json")).unwrap_or_default();
        text.contains("sha256")
    };
    killed_when(arguments, lists_a_file);
}

// ---------------------------------------------------------------- Parquet

// Two files with about 4200 rows: the records of the first, then of the second.
#[test]
fn one_parquet_file_of_all() {
    use onecycle_lab::learn::dataset::parquet::Writer;
    use onecycle_lab::learn::dataset::shards::{Manifest, file_name};

    let (folder, recipe) = recipe();
    let (into, table) = (folder.name("into"), folder.name("all.parquet"));
    let arguments = [&recipe, "-n", TWO_FILES, "--into", &into, "--parquet"];
    dataset(&[&arguments[..], &[&table]].concat());
    let found = std::fs::read(&table).unwrap();

    let files = bytes_in(&folder.path("into"));
    assert_eq!(files.len(), 3);
    let manifest = std::str::from_utf8(&files["manifest.json"]).unwrap();
    let manifest = Manifest::read(manifest).unwrap();
    let mut expected = Vec::new();
    let mut writer = Writer::new(&mut expected).unwrap();
    for shard in 0..2 {
        let records = manifest.records(shard, &files[&file_name(shard)]);
        writer.add(&records.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    // Not assert_eq, which would print megabytes.
    assert!(found == expected, "other bytes");
    // The same from an existing dataset; a file that cannot be written is refused.
    std::fs::remove_file(&table).unwrap();
    dataset(&[&arguments[..], &[&table]].concat());
    assert!(std::fs::read(&table).unwrap() == expected, "other bytes");
    let nowhere = folder.name("nowhere/all.parquet");
    let outcome = run(&[&["dataset"], &arguments[..], &[&nowhere]].concat());
    outcome.refused(NOT_WRITTEN, &["nowhere/all.parquet"]);
}

// ---------------------------------------------------------------- refusals

#[test]
fn bad_arguments() {
    let folder = Scratch::new();
    let into = folder.name("into");
    for (arguments, words) in [
        (vec!["--into", &into], "--examples"),
        (vec!["--examples", "5"], "--into"),
        (
            vec!["--examples", "0", "--into", &into],
            "0 is not in 1..=10000000",
        ),
        (vec!["--examples", "-1", "--into", &into], "-1"),
        (
            vec!["--examples", "10000001", "--into", &into],
            "10000001 is not in",
        ),
        (
            vec!["--examples", "5", "--into", &into, "--threads", "0"],
            "--threads",
        ),
    ] {
        run(&[&["dataset"], &arguments[..]].concat()).misused_about(words);
    }
    assert!(!folder.path("into").exists());
}

/// Checks of the messages of the argument parser, which have several lines.
trait Misused {
    fn misused_about(&self, words: &str);
}

impl Misused for Outcome {
    fn misused_about(&self, words: &str) {
        self.misused(&[]);
        assert!(self.stderr.contains(words), "{words}: {}", self.stderr);
    }
}

#[test]
fn recipes_that_cannot_be_read() {
    let folder = Scratch::new();
    let into = folder.name("into");
    for (text, words) in [
        (
            "bias = 1.5\n",
            ["recipe.toml", "bias must be 0 to 0.9, but is 1.5"],
        ),
        ("sead = 1\n", ["line 1", "unknown field \"sead\""]),
        ("families = []\n", ["families must be one or more", "0"]),
        (
            "[[families]]\n[[families]]\nweight = 0\n",
            ["family 2: weight must be positive", "but is 0.0"],
        ),
        (
            "[[families]]\ndraw = \"logarithmic\"\n\
             space = { t_prop_s = [0.1, 0.2], t_body_s = [1, 2], tau_s = [0, 0.1] }\n",
            ["family 1: tau_s must be positive", "logarithm of zero"],
        ),
        (
            "[[families]]\nsamples_per_period = [50, 60, 70]\n",
            ["line 2, samples_per_period", "two numbers"],
        ),
    ] {
        let file = folder.write("recipe.toml", text.as_bytes());
        let outcome = run(&["dataset", &file, "--examples", "5", "--into", &into]);
        outcome.refused(UNREADABLE, &words);
    }
    let missing = folder.name("nothing.toml");
    let outcome = run(&["dataset", &missing, "--examples", "5", "--into", &into]);
    outcome.refused(UNREADABLE, &["nothing.toml", "No such file"]);
    assert!(!folder.path("into").exists());
}

#[test]
fn folders_of_something_else() {
    let (folder, recipe) = recipe();
    let of = |more: &[&str]| run(&[&["dataset", &recipe, "--examples", "4"], more].concat());
    let full = folder.path("full");
    std::fs::create_dir(&full).unwrap();
    std::fs::write(full.join("thesis.tex"), "mine").unwrap();
    of(&["--into", &folder.name("full")]).refused(UNREADABLE, &["full", "not empty"]);
    assert_eq!(names_in(&full), ["thesis.tex"]);

    let into = folder.name("into");
    assert_eq!(of(&["--into", &into]).code, Some(0));
    let before = bytes_in(&folder.path("into"));
    let other = folder.write("other.toml", b"seed = 4\n");
    run(&["dataset", &other, "--examples", "4", "--into", &into]).refused(
        UNREADABLE,
        &["manifest.json", "another recipe", "another folder"],
    );
    run(&["dataset", &recipe, "--examples", "3", "--into", &into])
        .refused(UNREADABLE, &["already holds 4 examples", "more than 3"]);
    assert_eq!(bytes_in(&folder.path("into")), before);

    let manifest = folder.path("into").join("manifest.json");
    for (text, words) in [
        ("{", "not the manifest of a dataset"),
        ("{\"format\": \"onecycle.dataset/9\"}", "onecycle.dataset/9"),
        ("[1, 2]", "not the manifest of a dataset"),
    ] {
        std::fs::write(&manifest, text).unwrap();
        of(&["--into", &into]).refused(UNREADABLE, &["manifest.json", words]);
        assert_eq!(std::fs::read(&manifest).unwrap(), text.as_bytes());
    }
}

#[test]
fn folders_that_cannot_be() {
    let (folder, recipe) = recipe();
    let file = folder.write("file", b"");
    let nowhere = folder.name("nosuch/into");
    for into in [file.clone(), format!("{file}/below"), nowhere] {
        let outcome = run(&["dataset", &recipe, "--examples", "4", "--into", &into]);
        outcome.refused(NOT_WRITTEN, &[&into]);
    }
}

// ---------------------------------------------------------------- sets of the paper's classifier

// The recipe's 200 experiments are of its nine classes in turn; the label is the simulated class, whose own controller costs
// nothing with the gain matched; the inputs are less their mean. The number of experiments is the recipe's.
#[test]
fn sets_of_a_classifier() {
    let folder = Scratch::new();
    let text = include_bytes!("../../reproduction/literal_small.toml");
    let recipe = folder.write("recipe.toml", text);
    let into = folder.name("sets");
    let made = run(&["dataset", &recipe, "--into", &into]);
    assert_eq!(made.code, Some(0), "{made:?}");
    let (inputs, classes, rows) = (4520 / 20, 9, 200);
    let matrix = |name, width| Column {
        name,
        width: Some(width),
        numbers: Numbers::F32(vec![]),
    };
    let labels = Column {
        name: "labels",
        width: None,
        numbers: Numbers::U64(vec![]),
    };
    let like = [matrix("inputs", inputs), labels, matrix("costs", classes)];
    let bytes = std::fs::read(folder.path("sets/training.npz")).unwrap();
    let columns = npz::read(&bytes, &like, rows).unwrap();
    let [
        Numbers::F32(inputs_found),
        Numbers::U64(labels),
        Numbers::F32(costs),
    ] = [0, 1, 2].map(|k| columns[k].numbers.clone())
    else {
        panic!("{columns:?}")
    };
    assert!(
        labels
            .iter()
            .zip(0..)
            .all(|(label, n)| *label == n % classes as u64)
    );
    for (row, label) in labels.iter().enumerate() {
        let own = costs[row * classes + *label as usize];
        assert!(own.abs() < 1e-6, "{row} {own}");
    }
    for column in 0..inputs {
        let sum: f32 = (0..rows)
            .map(|row| inputs_found[row * inputs + column])
            .sum();
        assert!(sum.abs() < 1e-3, "{column} {sum}");
    }
    let refused = run(&["dataset", &recipe, "--into", &into, "--examples", "5"]);
    refused.refused(2, &["a classifier's recipe says how many"]);
}
