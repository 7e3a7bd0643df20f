//! `bench`: the folder, the leaderboard, answers of other programs, interruptions, refusals.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::{NOT_IDENTIFIED, NOT_WRITTEN, Outcome, Scratch, UNREADABLE, names_in, run};
use crate::killed::killed_when;
use serde_json::Value;

/// Makes a benchmark of four experiments.
fn made(folder: &Scratch, name: &str) -> String {
    let path = folder.name(name);
    let arguments = [
        "bench", "make", "--out", &path, "--cases", "4", "--seed", "5",
    ];
    let outcome = run(&arguments);
    assert_eq!(
        (outcome.code, &*outcome.stderr),
        (Some(0), ""),
        "{outcome:?}"
    );
    path
}

/// All files below a folder.
fn bytes_below(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for name in names_in(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            let inside = bytes_below(&path).into_iter();
            files.extend(inside.map(|(file, bytes)| (format!("{name}/{file}"), bytes)));
        } else {
            files.insert(name, std::fs::read(path).unwrap());
        }
    }
    files
}

fn bench_run(folder: &str, arguments: &[&str]) -> Outcome {
    run(&[&["bench", "run", folder], arguments].concat())
}

/// The leaderboard of a successful run, by method.
fn leaderboard(folder: &str, arguments: &[&str]) -> BTreeMap<String, Value> {
    let outcome = bench_run(folder, &[arguments, &["--json"]].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let report: Value = serde_json::from_str(&outcome.stdout).unwrap();
    assert_eq!(report["schema"], "onecycle.benchmark.results/1");
    let rows = report["leaderboard"].as_array().unwrap().iter();
    rows.map(|row| (row["method"].as_str().unwrap().to_owned(), row.clone()))
        .collect()
}

/// Some rows of `truth.csv` as answers.
fn answers_from_truth(folder: &Scratch, bench: &str, keep: impl Fn(usize) -> bool) -> String {
    let text = std::fs::read_to_string(Path::new(bench).join("truth.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let kept = (1..lines.len())
        .filter(|&row| keep(row))
        .map(|row| lines[row]);
    let rows: Vec<&str> = std::iter::once(lines[0]).chain(kept).collect();
    folder.write("answers.csv", rows.join("\n").as_bytes())
}

// ---------------------------------------------------------------- the folder

// The same seed gives the same bytes on any number of threads; another seed gives others. The rules describe the folder.
#[test]
fn the_same_seed_makes_the_same_bytes() {
    let folder = Scratch::new();
    let one = made(&folder, "one");
    let two = folder.name("two");
    let same = ["--cases", "4", "--seed", "5", "--threads", "1"];
    let outcome = run(&[&["bench", "make", "-o", &two], &same[..]].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let files = bytes_below(Path::new(&one));
    assert_eq!(files, bytes_below(Path::new(&two)));
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "README.md",
            "benchmark.json",
            "recordings/0001.csv",
            "recordings/0002.csv",
            "recordings/0003.csv",
            "recordings/0004.csv",
            "truth.csv"
        ]
    );
    let rules = String::from_utf8(files["README.md"].clone()).unwrap();
    for words in [
        "4 recordings",
        "seed 5",
        "experiment,kp,kd",
        "min(|J|, 1)",
        "Licence",
    ] {
        assert!(rules.contains(words), "{words}: {rules}");
    }
    let other = folder.name("other");
    run(&["bench", "make", "-o", &other, "--cases", "4", "--seed", "6"]);
    let truth = |path: &str| std::fs::read(Path::new(path).join("truth.csv")).unwrap();
    assert_ne!(truth(&one), truth(&other));
    assert_eq!(folder.files().len(), 3, "no temporary folder is left");
}

// The same draw of the noise, ten times as large; its column is the sixth of the truth.
#[test]
fn the_largest_noise_can_be_set() {
    let folder = Scratch::new();
    let noise = |sigma: &str| -> Vec<f64> {
        let path = folder.name(sigma);
        let outcome = run(&[
            "bench", "make", "-o", &path, "--cases", "2", "--sigma", sigma,
        ]);
        assert_eq!(outcome.code, Some(0), "{outcome:?}");
        let rules = std::fs::read_to_string(Path::new(&path).join("README.md")).unwrap();
        let most = format!("up to {:.2} % of", 100.0 * sigma.parse::<f64>().unwrap());
        assert!(rules.contains(&most), "{rules}");
        let truth = std::fs::read_to_string(Path::new(&path).join("truth.csv")).unwrap();
        let mut lines = truth.lines();
        let at = lines
            .next()
            .unwrap()
            .split(',')
            .position(|name| name == "noise_sigma")
            .unwrap();
        lines
            .map(|line| line.split(',').nth(at).unwrap().parse().unwrap())
            .collect()
    };
    let (small, large) = (noise("0.01"), noise("0.1"));
    for (small, large) in small.iter().zip(&large) {
        assert!((large / small - 10.0).abs() < 1e-6, "{small} {large}");
    }
    let nothing = folder.name("nothing");
    for wrong in ["-0.1", "0.5"] {
        run(&["bench", "make", "-o", &nothing, "--sigma", wrong]).refused(2, &["--sigma", "0.2"]);
    }
    run(&["bench", "make", "-o", &nothing, "--sigma", "nan"]).misused(&["--sigma", "percentage"]);
    assert!(!Path::new(&nothing).exists());
}

// `identify` reads the recordings.
#[test]
fn a_recording_is_like_any_other() {
    let folder = Scratch::new();
    let path = made(&folder, "bench");
    let recording = format!("{path}/recordings/0001.csv");
    run(&["identify", &recording, "--json"]).identified();
}

#[test]
fn a_folder_that_cannot_be_made() {
    let folder = Scratch::new();
    folder.write("file", b"x");
    let full = folder.name("");
    run(&["bench", "make", "-o", &full]).refused(2, &["is not empty"]);
    let missing = folder.name("nosuch/bench");
    run(&["bench", "make", "-o", &missing, "--cases", "1"]).refused(NOT_WRITTEN, &["nosuch"]);
    let file = folder.name("file");
    run(&["bench", "make", "-o", &file]).refused(NOT_WRITTEN, &["file"]);
    run(&["bench", "make", "-o", &full, "--cases", "0"]).misused(&["0"]);
    run(&["bench", "make", "-o", &full, "--format", "xls"]).misused(&["xls"]);
    assert_eq!(folder.files(), ["file"]);
}

// ---------------------------------------------------------------- runs

// The truth as answers scores zero, up to rounding, and is first; without one of four rows it scores exactly 25 %.
// onecycle-4 scores less than 1 % here.
#[test]
fn answers_are_scored_beside_the_methods() {
    let folder = Scratch::new();
    let path = made(&folder, "bench");
    let all = format!("all={}", answers_from_truth(&folder, &path, |_| true));
    let board = leaderboard(
        &path,
        &["--methods", "onecycle-4, rules", "--answers", &all],
    );
    assert_eq!(board.len(), 3);
    let score = |method: &str| board[method]["score"].as_f64().unwrap();
    assert!(score("all") < 1e-9, "{}", score("all"));
    assert!(score("onecycle-4") < 0.01 && score("all") < score("onecycle-4"));
    assert!(board["onecycle-4"]["median_seconds"].as_f64().is_some());
    assert_eq!(board["all"]["median_seconds"], Value::Null);
    let three = format!(
        "three={}",
        answers_from_truth(&folder, &path, |row| row != 2)
    );
    let board = leaderboard(&path, &["--methods", "none", "--answers", &three]);
    assert_eq!(board["three"]["no_answer"], 1);
    assert!((board["three"]["score"].as_f64().unwrap() - 0.25).abs() < 1e-9);
    let gains = folder.write("gains.csv", b"experiment,kp,kd\n1,-1,-1\n2,0,0\n");
    let board = leaderboard(
        &path,
        &["--methods", "none", "--answers", &format!("bad={gains}")],
    );
    assert_eq!(
        (&board["bad"]["unstable"], &board["bad"]["no_answer"]),
        (&2.into(), &2.into())
    );
    assert_eq!(board["bad"]["score"], 1.0);
}

/// `results.csv` without its last column, the times.
fn without_time(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.lines().next().unwrap().ends_with(",reason,seconds"));
    let cut = |line: &str| line.rsplit_once(',').unwrap().0.to_owned();
    text.lines().map(cut).collect::<Vec<_>>().join("\n")
}

// The files are there, the work folder is not. Without the times, the files are the same on one thread and after an
// interruption that leaves the first two experiments and half a line.
#[test]
fn results_are_the_same_bits_after_an_interruption() {
    let folder = Scratch::new();
    let path = made(&folder, "bench");
    let out = folder.name("results");
    let methods = ["--methods", "onecycle-1,arx,asymmetric"];
    let outcome = bench_run(&path, &[&methods[..], &["-o", &out]].concat());
    assert_eq!(
        (outcome.code, &*outcome.stderr),
        (Some(0), ""),
        "{outcome:?}"
    );
    assert_eq!(
        outcome.stdout,
        std::fs::read_to_string(folder.path("results.md")).unwrap()
    );
    let mut files = folder.files();
    files.sort_unstable();
    assert_eq!(
        files,
        ["bench", "results.csv", "results.json", "results.md"]
    );
    let whole = without_time(&folder.path("results.csv"));
    assert_eq!(whole.lines().count(), 1 + 3 * 4);
    let report = std::fs::read_to_string(folder.path("results.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    // The journal of an interrupted run: the head, and one line for each experiment.
    let head = serde_json::json!({
        "program": env!("CARGO_PKG_VERSION"),
        "command": "bench run",
        "settings": {
            "benchmark": report["benchmark"],
            "methods": ["onecycle-1", "arx", "asymmetric"],
        },
    });
    let results = report["results"].as_array().unwrap();
    let part = format!(
        "{head}\n{}\n{}\n[{{\"exper",
        Value::from(&results[0..3]),
        Value::from(&results[3..6])
    );
    let leave = |part: &str| {
        std::fs::create_dir_all(folder.path("results.part")).unwrap();
        folder.write("results.part/journal.jsonl", part.as_bytes());
    };
    leave(&part);
    let resumed = [&methods[..], &["-o", &out, "--threads", "1"]].concat();
    let outcome = bench_run(&path, &resumed);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    assert!(
        (outcome.stderr).starts_with("onecycle-lab: resuming after 2 of 4 experiments of "),
        "{outcome:?}"
    );
    assert_eq!(outcome.stderr.lines().count(), 1);
    assert_eq!(without_time(&folder.path("results.csv")), whole);
    assert!(!folder.path("results.part").exists());
    // A journal with other methods is refused.
    leave(&part);
    let other = bench_run(&path, &["--methods", "rules", "-o", &out]);
    other.refused(
        UNREADABLE,
        &["results.part", "other settings, methods", "--restart"],
    );
    let damaged = part.replacen("\"experiment\":1", "\"experiment\":x", 1);
    leave(&damaged);
    bench_run(&path, &resumed).refused(UNREADABLE, &["line 2 is damaged"]);
    // --restart discards it; the flag --resume of earlier versions has no effect.
    let anew = [&resumed[..], &["--restart", "--resume"]].concat();
    let outcome = bench_run(&path, &anew);
    assert_eq!(
        (outcome.code, &*outcome.stderr),
        (Some(0), ""),
        "{outcome:?}"
    );
    assert_eq!(without_time(&folder.path("results.csv")), whole);
}

// One folder for each method that makes its own relay test, one file for each experiment, the same bytes when repeated,
// and `identify` reads every file. Methods that use the recordings write none.
#[test]
fn traces_are_recordings() {
    let folder = Scratch::new();
    let path = made(&folder, "bench");
    let written = |name: &str| {
        let traces = folder.name(name);
        let methods = [
            "--methods",
            "rules,pem-sweep,asymmetric",
            "--traces",
            &traces,
        ];
        let outcome = bench_run(&path, &methods);
        assert_eq!(outcome.code, Some(0), "{outcome:?}");
        bytes_below(&folder.path(name))
    };
    let files = written("traces");
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    let expected = ["asymmetric", "pem-sweep"]
        .map(|method| [1, 2, 3, 4].map(|number| format!("{method}/000{number}.csv")));
    assert_eq!(names, expected.concat());
    assert!(files == written("again"), "other bytes");
    for name in names {
        let outcome = run(&["identify", &folder.name(&format!("traces/{name}"))]);
        assert!(
            matches!(outcome.code, Some(0 | NOT_IDENTIFIED)),
            "{outcome:?}"
        );
    }
    // 0.1 s of noise measurement and 20 s of sweep at 1 kHz.
    let swept = String::from_utf8_lossy(&files["pem-sweep/0001.csv"]).into_owned();
    let rows = swept.lines().filter(|line| !line.starts_with('#')).count() - 1;
    assert!((20_050..=20_500).contains(&rows), "{rows}");
    let traces = folder.name("traces");
    let again = ["--methods", "pem-sweep", "--traces", &traces];
    bench_run(&path, &again).refused(2, &["is not empty"]);
    let none = ["--methods", "rules", "--traces", &traces];
    bench_run(&path, &none).refused(2, &["no method makes a relay test of its own"]);
}

// The same experiments in one Parquet file give the same results except for the times. A file that is not Parquet, or
// lacks an experiment, is refused.
#[test]
fn a_parquet_folder_gives_the_same_results() {
    let folder = Scratch::new();
    let csv = made(&folder, "csv");
    let table = folder.name("parquet");
    let make = [
        "bench", "make", "-o", &table, "--format", "parquet", "--seed", "5",
    ];
    let four = run(&[&make[..], &["--cases", "4"]].concat());
    assert_eq!(four.code, Some(0), "{four:?}");
    let mut names = names_in(&folder.path("parquet"));
    names.sort_unstable();
    assert_eq!(
        names,
        [
            "README.md",
            "benchmark.json",
            "recordings.parquet",
            "truth.csv"
        ]
    );
    let results = [csv.as_str(), &table].map(|path| {
        let out = folder.name("results");
        let methods = ["--methods", "onecycle-1,arx-gmvc,pem-sweep", "-o", &out];
        let outcome = bench_run(path, &methods);
        assert_eq!(outcome.code, Some(0), "{outcome:?}");
        without_time(&folder.path("results.csv"))
    });
    assert_eq!(results[0], results[1]);
    assert_eq!(results[0].lines().count(), 1 + 3 * 4);
    let refused = |words: &[&str]| {
        bench_run(&table, &["--methods", "rules"]).refused(UNREADABLE, words);
    };
    let other = folder.name("other");
    let make = [
        "bench", "make", "-o", &other, "--format", "parquet", "--cases", "3",
    ];
    assert_eq!(run(&make).code, Some(0));
    let recordings = folder.path("parquet/recordings.parquet");
    std::fs::copy(folder.path("other/recordings.parquet"), &recordings).unwrap();
    refused(&["recordings.parquet", "no experiment 4"]);
    std::fs::write(&recordings, "time_s,output,input\n").unwrap();
    refused(&["recordings.parquet"]);
    std::fs::remove_file(&recordings).unwrap();
    refused(&["recordings.parquet"]);
}

// ---------------------------------------------------------------- refusals

#[test]
fn wrong_arguments_are_refused() {
    let methods = ["bench", "run", "x", "--methods", "magic"];
    run(&methods).misused(&["no method 'magic'", "onecycle-1, onecycle-2"]);
    run(&["bench", "run", "x", "--methods", "arx,arx"]).misused(&["named twice"]);
    run(&["bench", "run", "x", "--answers", "file.csv"]).misused(&["mine=answers.csv"]);
    run(&["bench", "run", "x", "--answers", "arx=file.csv"]).misused(&["cannot be named 'arx'"]);
    run(&["bench", "run", "x", "--restart"]).misused(&["required arguments"]);
}

#[test]
fn wrong_folders_are_refused() {
    let folder = Scratch::new();
    let nothing = folder.name("");
    bench_run(&nothing, &[]).refused(UNREADABLE, &["benchmark.json", "bench make"]);
    let path = made(&folder, "bench");
    let file = |name: &str| format!("bench/{name}");
    let text = |name: &str| std::fs::read_to_string(folder.path(&file(name))).unwrap();
    let (manifest, truth) = (text("benchmark.json"), text("truth.csv"));
    let cases = [
        (
            "benchmark.json",
            manifest.replace("benchmark/1", "benchmark/9"),
            vec!["benchmark/9'", "version"],
        ),
        (
            "benchmark.json",
            "{".to_owned(),
            vec!["benchmark.json", "line 1"],
        ),
        (
            "benchmark.json",
            manifest.replace("\"csv\"", "\"parquet\""),
            vec!["recordings.parquet"],
        ),
        (
            "benchmark.json",
            manifest.replace(": 4", ": 5"),
            vec!["truth.csv", "4 experiments", "says 5"],
        ),
        (
            "truth.csv",
            truth.replacen("0.0", "NaN", 1),
            vec!["truth.csv", "line 2", "NaN"],
        ),
        (
            "truth.csv",
            truth.replacen("\n2,", "\n1,", 1),
            vec!["line 3", "line 2"],
        ),
    ];
    for (name, wrong, words) in cases {
        let right = text(name);
        folder.write(&file(name), wrong.as_bytes());
        bench_run(&path, &["--methods", "rules"]).refused(UNREADABLE, &words);
        folder.write(&file(name), right.as_bytes());
    }
    std::fs::remove_file(folder.path("bench/recordings/0003.csv")).unwrap();
    bench_run(&path, &["--methods", "rules"]).refused(UNREADABLE, &["0003.csv"]);
    std::fs::remove_file(folder.path("bench/truth.csv")).unwrap();
    bench_run(&path, &["--methods", "rules"]).refused(UNREADABLE, &["truth.csv"]);
}

// A run that is killed leaves a folder that says what to do; the next one replaces it and says so.
#[test]
fn an_interrupted_folder_is_replaced() {
    let folder = Scratch::new();
    let out = folder.name("bench");
    let make = ["bench", "make", "-o", &out, "--cases", "4", "--seed", "5"];
    let many = [
        "bench", "make", "-o", &out, "--cases", "5000", "--seed", "5",
    ];
    let mark = folder.path("bench.part/UNFINISHED");
    killed_when(&many, || mark.exists());
    assert!(
        std::fs::read_to_string(&mark)
            .unwrap()
            .contains("same command again")
    );
    let outcome = run(&make);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    assert!(outcome.stderr.contains("starting over: "), "{outcome:?}");
    assert_eq!(folder.files(), ["bench"]);
    assert!(!folder.path("bench/UNFINISHED").exists());
    // A folder of that name without the mark is not ours.
    let other = folder.name("other");
    std::fs::create_dir(folder.path("other.part")).unwrap();
    run(&["bench", "make", "-o", &other, "--cases", "4"]).refused(NOT_WRITTEN, &["other.part"]);
}

#[test]
fn wrong_answers_are_refused() {
    let folder = Scratch::new();
    let path = made(&folder, "bench");
    for (text, words) in [
        ("experiment,kp,kd\n1,2,NaN\n", ["line 2", "kd is 'NaN'"]),
        (
            "experiment,kp,kd\n1,2,3\n1,2,3\n",
            ["line 3", "already has a row"],
        ),
        (
            "experiment,kp,kd\n1,2,3\n5,2,3\n",
            ["line 3", "no experiment 5"],
        ),
        ("experiment,kp,kd\n1,2\n", ["line 2", "2 cells"]),
        ("experiment,gain\n1,2\n", ["line 1", "either K"]),
    ] {
        let file = folder.write("wrong.csv", text.as_bytes());
        let answers = format!("mine={file}");
        let outcome = bench_run(&path, &["--methods", "none", "--answers", &answers]);
        outcome.refused(UNREADABLE, &["wrong.csv", words[0], words[1]]);
    }
    let missing = format!("mine={}", folder.name("nosuch.csv"));
    bench_run(&path, &["--answers", &missing]).refused(UNREADABLE, &["nosuch.csv"]);
    #[cfg(unix)]
    bench_run(&path, &["--answers", "mine=/dev/zero"]).refused(UNREADABLE, &["/dev/zero", "bytes"]);
    let file = folder.write("right.csv", b"experiment,kp,kd\n1,2,3\n");
    let twice = format!("mine={file}");
    bench_run(&path, &["--answers", &twice, "--answers", &twice]).refused(2, &["'mine'"]);
}
