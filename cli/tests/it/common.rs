//! Helpers to run the programs: arguments and files in; exit code, reports and messages out.
//!
//! Every run is checked for panics.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use serde_json::Value;
use tempfile::TempDir;

/// Exit codes: unreadable input, no process identified, unwritable output, time stamps in doubt.
pub(crate) const UNREADABLE: i32 = 3;
pub(crate) const NOT_IDENTIFIED: i32 = 4;
pub(crate) const NOT_WRITTEN: i32 = 5;
pub(crate) const AMBIGUOUS: i32 = 6;

/// A multirotor's attitude: oscillates with a period of 0.44 s and an amplitude of 3.3e-3.
pub(crate) const HOVER: [&str; 8] = [
    "--k", "1", "--t-prop", "0.0321", "--t-body", "1.6886", "--tau", "0.0237",
];
/// Its parameters.
pub(crate) const HOVER_K: f64 = 1.0;
pub(crate) const HOVER_K_OVER_T_BODY: f64 = 1.0 / 1.6886;
pub(crate) const HOVER_T_PROP_S: f64 = 0.0321;
pub(crate) const HOVER_T_BODY_S: f64 = 1.6886;
pub(crate) const HOVER_TAU_S: f64 = 0.0237;

/// A drone's roll without damping.
pub(crate) const DOUBLE_INTEGRATOR: [&str; 8] = [
    "--k-over-t-body",
    "40",
    "--t-prop",
    "0.05",
    "--t-body",
    "inf",
    "--tau",
    "0.015",
];

/// Names before messages.
const PROGRAMS: [&str; 2] = ["onecycle", "onecycle-lab"];

/// The outcome of a run.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// The exit code; `None` after a signal.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// The program that has this command.
pub(crate) fn program(command: &str) -> Command {
    let mut command = Command::new(crate::path_of(command));
    // The developer's settings of backtraces and colours must not change the output.
    command.env("RUST_BACKTRACE", "0");
    command.env_remove("CLICOLOR_FORCE");
    command
}

/// The program that has the command which the arguments begin with.
pub(crate) fn called(arguments: &[&str]) -> Command {
    let mut command = program(arguments.first().unwrap_or(&""));
    command.args(arguments);
    command
}

pub(crate) fn run(arguments: &[&str]) -> Outcome {
    let output = called(arguments)
        .stdin(Stdio::null())
        .output()
        .expect("the program starts");
    Outcome::of(&output)
}

/// A run with `bytes` on its standard input.
pub(crate) fn run_with_input(arguments: &[&str], bytes: &[u8]) -> Outcome {
    let mut child = called(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // A program that has refused its input stops reading; this is no error.
    let _ = child.stdin.take().expect("stdin is piped").write_all(bytes);
    Outcome::of(&child.wait_with_output().expect("the program ends"))
}

/// A run that only reads, of files that do not change: what asks for it again gets the outcome of the first one. Most tests of
/// words and of exit codes identify the same few recordings.
pub(crate) fn run_once(arguments: &[&str]) -> Outcome {
    remembered(b"", arguments, || run(arguments))
}

/// The outcome for this content and these arguments, made by the first who asks; the others wait for it.
fn remembered(bytes: &[u8], arguments: &[&str], make: impl FnOnce() -> Outcome) -> Outcome {
    type Outcomes = HashMap<(usize, u64), Arc<OnceLock<Outcome>>>;
    static OUTCOMES: Mutex<Option<Outcomes>> = Mutex::new(None);
    let mut hasher = DefaultHasher::new();
    (bytes, arguments).hash(&mut hasher);
    let own = {
        let mut all = OUTCOMES.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (bytes.len(), hasher.finish());
        Arc::clone(all.get_or_insert_default().entry(key).or_default())
    };
    own.get_or_init(make).clone()
}

/// Runs `identify FILE --json ARGUMENTS` on a file with these bytes, once.
pub(crate) fn identify(bytes: impl AsRef<[u8]>, arguments: &[&str]) -> Outcome {
    identify_as(bytes.as_ref(), &[&["--json"], arguments].concat())
}

/// Runs `identify FILE --details ARGUMENTS` on a file with these bytes, once.
pub(crate) fn identify_as_text(bytes: impl AsRef<[u8]>, arguments: &[&str]) -> Outcome {
    identify_as(bytes.as_ref(), &[&["--details"], arguments].concat())
}

fn identify_as(bytes: &[u8], arguments: &[&str]) -> Outcome {
    remembered(bytes, arguments, || {
        let file = Scratch::new();
        let path = file.write("recording.csv", bytes);
        run(&[&["identify", path.as_str()], arguments].concat())
    })
}

/// Runs `simulate ARGUMENTS`; returns the standard output.
pub(crate) fn simulate(process: &[&str], arguments: &[&str]) -> String {
    let mut all = vec!["simulate"];
    all.extend(process);
    all.extend(arguments);
    let outcome = run(&all);
    assert_eq!(outcome.code, Some(0), "{all:?}: {}", outcome.stderr);
    assert_eq!(outcome.stderr, "");
    outcome.stdout
}

impl Outcome {
    pub(crate) fn of(output: &Output) -> Self {
        let outcome = Self {
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        };
        for text in [&outcome.stdout, &outcome.stderr] {
            for sign in [
                "panicked",
                "RUST_BACKTRACE",
                "stack backtrace",
                "memory allocation",
            ] {
                assert!(!text.contains(sign), "a crash: {text}");
            }
        }
        assert!(outcome.code.is_some(), "ended by a signal: {outcome:?}");
        outcome
    }

    /// Asserts that the output has no NaN and no infinity.
    pub(crate) fn without_nan(&self) -> &Self {
        for text in [&self.stdout, &self.stderr] {
            let words = text.split(|letter: char| !letter.is_ascii_alphanumeric());
            let bad = words.filter(|word| ["nan", "inf"].contains(&&*word.to_lowercase()));
            assert_eq!(bad.count(), 0, "{text}");
        }
        self
    }

    /// Asserts a refusal: this exit code, no standard output, and one sentence with each of `words` on the error output.
    pub(crate) fn refused(&self, code: i32, words: &[&str]) {
        let sentence = self.stderr.strip_suffix('\n').unwrap_or_default();
        assert_eq!(self.code, Some(code), "{self:?}");
        assert_eq!(self.stdout, "");
        assert!(!sentence.contains('\n'), "more than one line: {sentence}");
        let (program, sentence) = sentence.split_once(": ").unwrap_or_default();
        assert!(PROGRAMS.contains(&program), "{}", self.stderr);
        assert!(sentence.len() > 20, "no sentence: {}", self.stderr);
        assert!(sentence.len() < 500, "no clear sentence: {sentence}");
        for word in words {
            assert!(sentence.contains(word), "{word} is not in: {sentence}");
        }
    }

    /// Asserts that the arguments are refused; the first line of the error output has each of `words`.
    pub(crate) fn misused(&self, words: &[&str]) {
        assert_eq!(self.code, Some(2), "{self:?}");
        assert_eq!(self.stdout, "");
        let first = self.stderr.lines().next().unwrap_or_default();
        let (speaker, _) = first.split_once(": ").unwrap_or_default();
        let is_sentence = speaker == "error" || PROGRAMS.contains(&speaker);
        assert!(is_sentence, "{}", self.stderr);
        for word in words {
            assert!(first.contains(word), "{word} is not in: {first}");
        }
    }

    /// The JSON report, with any verdict.
    pub(crate) fn report(&self) -> Report {
        self.without_nan();
        assert_eq!(self.stderr, "");
        let report = serde_json::from_str(&self.stdout).expect("the report is JSON");
        Report(report)
    }

    /// The report of an identified process.
    pub(crate) fn identified(&self) -> Report {
        assert_eq!(self.code, Some(0), "{}{}", self.stdout, self.stderr);
        let report = self.report();
        assert_eq!(report.kind(), "identified");
        // NaN would be null in JSON; these values must be numbers.
        let own: &[&str] = match report.0["excitation"].as_str() {
            Some("relay") => &[
                "/oscillation/period_s",
                "/oscillation/amplitude",
                "/oscillation/noise_sigma",
                "/fit/residual_sigma",
            ],
            _ => &[
                "/record/end_s",
                "/record/informative_to_rad_per_s",
                "/noise/sigma",
                "/innovations/autocorrelation",
            ],
        };
        let common = [
            "/process/k_over_t_body/estimate",
            "/process/t_prop_s/estimate",
            "/process/tau_s/estimate",
            "/process/input_bias/estimate",
            "/fit/misfit",
            "/controller/kp",
            "/controller/kd",
            "/controller/ki",
            "/controller/filter_s",
            "/margins/ms",
            "/margins/phase_margin_deg",
            "/margins/delay_margin_s",
        ];
        for pointer in own.iter().chain(&common) {
            report.number(pointer);
        }
        report
    }

    /// The report of a recording without an identified process, for this reason. It has no numbers of a process; message
    /// and advice are one sentence each.
    pub(crate) fn no_process(&self, kind: &str) -> Report {
        assert_eq!(self.code, Some(4), "{}{}", self.stdout, self.stderr);
        let report = self.report();
        assert_eq!(report.kind(), kind, "{}", self.stdout);
        for part in ["process", "fit", "controller", "margins", "step"] {
            assert_eq!(report.0[part], Value::Null, "{part}");
        }
        for part in ["message", "advice"] {
            let sentence = report.0["verdict"][part].as_str().unwrap_or_default();
            assert!(
                sentence.len() > 20 && !sentence.contains('\n'),
                "{sentence}"
            );
        }
        report
    }
}

/// A JSON report.
#[derive(Debug)]
pub(crate) struct Report(pub(crate) Value);

impl Report {
    pub(crate) fn kind(&self) -> &str {
        self.0["verdict"]["kind"].as_str().unwrap_or_default()
    }

    pub(crate) fn advice(&self) -> &str {
        self.0["verdict"]["advice"].as_str().unwrap_or_default()
    }

    /// The number at a path.
    pub(crate) fn number(&self, pointer: &str) -> f64 {
        let found = self.0.pointer(pointer).and_then(Value::as_f64);
        assert!(found.is_some(), "{pointer} is no number: {}", self.0);
        found.unwrap_or_default()
    }

    pub(crate) fn estimate(&self, name: &str) -> f64 {
        self.number(&format!("/process/{name}/estimate"))
    }

    /// Asserts that an estimate is within a fraction of the truth.
    pub(crate) fn near(&self, name: &str, truth: f64, part: f64) -> &Self {
        let found = self.estimate(name);
        let error = (found - truth).abs();
        assert!(error <= part * truth.abs(), "{name}: {found}, not {truth}");
        self
    }

    /// Whether the 90 % interval holds a value; null is unbounded.
    pub(crate) fn holds(&self, name: &str, truth: f64) -> bool {
        let bound = |side: &str| self.0["process"][name][side].as_f64();
        bound("low").is_none_or(|low| low <= truth)
            && bound("high").is_none_or(|high| truth <= high)
    }

    fn sentences(&self, of: &str) -> Vec<&str> {
        let list = self.0[of].as_array().expect("a list of sentences");
        list.iter().filter_map(Value::as_str).collect()
    }

    /// Asserts a note of the reader with each of `words`.
    pub(crate) fn noted(&self, words: &[&str]) -> &Self {
        let notes = self.sentences("notes");
        let has_all = |note: &&str| words.iter().all(|word| note.contains(word));
        assert!(notes.iter().any(has_all), "{words:?} not in {notes:?}");
        self
    }

    /// Asserts a remark on the result with each of `words`.
    pub(crate) fn remarked(&self, words: &[&str]) -> &Self {
        self.told("remarks", words)
    }

    /// Asserts a sentence with each of `words` under a key.
    pub(crate) fn told(&self, key: &str, words: &[&str]) -> &Self {
        let remarks = self.sentences(key);
        let has_all = |remark: &&str| words.iter().all(|word| remark.contains(word));
        assert!(remarks.iter().any(has_all), "{words:?} not in {remarks:?}");
        self
    }
}

/// A temporary folder.
pub(crate) struct Scratch(TempDir);

impl Scratch {
    pub(crate) fn new() -> Self {
        Self(TempDir::new().expect("a temporary folder"))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A path in the folder as text, for arguments.
    pub(crate) fn name(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> String {
        std::fs::write(self.path(name), bytes).expect("a temporary file");
        self.name(name)
    }

    /// Names of all files and folders in it.
    pub(crate) fn files(&self) -> Vec<String> {
        names_in(self.0.path())
    }
}

pub(crate) fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder reads");
    let names = entries.map(|entry| entry.expect("an entry").file_name());
    names
        .map(|name| name.to_string_lossy().into_owned())
        .collect()
}

/// One sample of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub(crate) time_s: f64,
    pub(crate) output: f64,
    pub(crate) input: f64,
}

/// A recording that tests can change.
#[derive(Clone, Debug)]
pub(crate) struct Table(pub(crate) Vec<Sample>);

impl Table {
    /// Reads the output of `simulate`.
    pub(crate) fn parse(csv: &str) -> Self {
        let number = |cell: Option<&str>| cell.and_then(|cell| cell.parse().ok());
        let row = |line: &str| {
            let mut cells = line.split(',');
            Some(Sample {
                time_s: number(cells.next())?,
                output: number(cells.next())?,
                input: number(cells.next())?,
            })
        };
        Self(csv.lines().filter_map(row).collect())
    }

    /// Twenty cycles of the hovering multirotor, without noise.
    pub(crate) fn clean() -> Self {
        static CLEAN: OnceLock<Table> = OnceLock::new();
        CLEAN
            .get_or_init(|| Self::parse(&simulate(&HOVER, &[])))
            .clone()
    }

    /// Twenty cycles with 1 % noise and a bias of 20 %.
    pub(crate) fn noisy() -> Self {
        static NOISY: OnceLock<Table> = OnceLock::new();
        let arguments = ["--noise", "1%", "--bias", "20%", "--seed", "5"];
        NOISY
            .get_or_init(|| Self::parse(&simulate(&HOVER, &arguments)))
            .clone()
    }

    pub(crate) fn map(mut self, change: impl Fn(usize, &mut Sample)) -> Self {
        for (index, sample) in self.0.iter_mut().enumerate() {
            change(index, sample);
        }
        self
    }

    pub(crate) fn between(mut self, from_s: f64, to_s: f64) -> Self {
        self.0
            .retain(|sample| (from_s..to_s).contains(&sample.time_s));
        self
    }

    /// Indices at which the input rises.
    pub(crate) fn rises(&self) -> Vec<usize> {
        let rises = |&index: &usize| self.0[index].input > self.0[index - 1].input;
        let samples = 1..self.0.len();
        let is_from_low = |index: &usize| self.0[*index - 1].input < 0.0;
        samples.filter(rises).filter(is_from_low).collect()
    }

    /// As lines of `time_s,pv,u`; the first sample is on line 2.
    pub(crate) fn csv(&self) -> String {
        self.csv_of("time_s,pv,u", |sample| sample.time_s)
    }

    /// As lines with another header and other stamps.
    pub(crate) fn csv_of<T: std::fmt::Debug>(
        &self,
        header: &str,
        stamp: impl Fn(&Sample) -> T,
    ) -> String {
        let mut text = format!("{header}\n");
        for sample in &self.0 {
            let Sample { output, input, .. } = sample;
            let _ = writeln!(text, "{:?},{output:?},{input:?}", stamp(sample));
        }
        text
    }
}

/// Asserts that the report is of the hovering multirotor.
pub(crate) fn is_hover(report: &Report, part: f64) {
    report
        .near("k_over_t_body", HOVER_K_OVER_T_BODY, part)
        .near("t_prop_s", HOVER_T_PROP_S, 5.0 * part)
        .near("tau_s", HOVER_TAU_S, 5.0 * part);
}

/// The report of `tune` for a process.
pub(crate) fn tune(process: &[&str], arguments: &[&str]) -> Report {
    let outcome = run(&[&["tune", "--json"], process, arguments].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome.report()
}

/// The outcome of a run with `--report`, and its page.
pub(crate) fn reported(arguments: &[&str]) -> (Outcome, String) {
    let folder = Scratch::new();
    let path = folder.name("out.html");
    let ran = run(&[arguments, &["--report", &path]].concat());
    let page = std::fs::read_to_string(&path).expect("there is a page");
    (ran, page)
}

/// The figures of a page as JSON.
pub(crate) fn figures(page: &str) -> Vec<Value> {
    let parts = page.split("<script type=\"application/json\">").skip(1);
    let texts = parts.map(|part| part.split("</script>").next().unwrap_or_default());
    texts
        .map(|text| serde_json::from_str(text).expect("a figure is JSON"))
        .collect()
}

/// The texts of all notes in figures.
pub(crate) fn notes(figures: &[Value]) -> Vec<String> {
    let annotations = figures
        .iter()
        .filter_map(|figure| figure["layout"]["annotations"].as_array());
    annotations
        .flatten()
        .filter_map(|note| note["text"].as_str())
        .map(str::to_owned)
        .collect()
}
