//! Invalid arguments and outputs: the exit code, and one sentence.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::Stdio;

use crate::common::{
    HOVER, NOT_WRITTEN, Outcome, Scratch, Table, UNREADABLE, names_in, program, run,
};

// ---------------------------------------------------------------- arguments

#[test]
fn unusable_options_of_identify() {
    let file = Scratch::new();
    let path = file.write("clean.csv", Table::clean().csv().as_bytes());
    let with = |arguments: &[&str]| run(&[&["identify", path.as_str()], arguments].concat());
    with(&["--time", "nosuch"]).refused(UNREADABLE, &["nosuch", "time", "pv", "u"]);
    with(&["--input", "9"]).refused(UNREADABLE, &["number 9", "input", "pv"]);
    with(&["--output", "0"]).refused(UNREADABLE, &["number 0", "output", "pv"]);
    with(&["--cycles", "0"]).misused(&["--cycles", "0", "1..=50"]);
    with(&["--cycles", "51"]).misused(&["--cycles", "51", "1..=50"]);
    with(&["--cycles", "two"]).misused(&["--cycles", "two"]);
    with(&["--phase-margin", "95"]).misused(&["--phase-margin", "95", "between 0 and 90"]);
    with(&["--phase-margin", "nan"]).misused(&["--phase-margin", "between 0 and 90"]);
    with(&["--time-unit", "parsec"]).misused(&["--time-unit", "parsec", "ms, us or ns"]);
    with(&["--sample-rate", "fast"]).misused(&["--sample-rate", "fast"]);
    with(&["--sample-rate", "1000", "--time", "1"]).misused(&["--sample-rate", "--time"]);
    with(&["--structure", "pt1"]).misused(&["--structure", "pt1"]);
    with(&["--hold", "cubic"]).misused(&["--hold", "cubic"]);
    with(&["--from", "noon"]).misused(&["--from", "noon", "number of seconds"]);
    with(&["--to", "nan"]).misused(&["--to", "number of seconds"]);
    // The recording has 8 s, from zero.
    with(&["--from", "8.5"]).misused(&["--from 8.5", "runs from 0.000 to 7.9"]);
    with(&["--to", "-1"]).misused(&["--to -1", "runs from 0.000 to 7.9"]);
    with(&["--from", "3", "--to", "3"]).misused(&["--from 3 --to 3", "leaves nothing"]);
    for whole in [
        ["--structure", "foptd"],
        ["--from", "1"],
        ["--to", "5"],
        ["--hold", "interpolated"],
    ] {
        let both = [&whole[..], &["--cycles", "4"]].concat();
        with(&both).misused(&[whole[0], "--cycles", "leave it out"]);
    }
    with(&["--noise", "0"]).misused(&["--noise", "share of noise"]);
    with(&["--noise", "much"]).misused(&["--noise", "neither a number nor a percentage"]);
    with(&["--noise", "20%", "--style", "paper"]).misused(&["--style paper", "--noise"]);
    with(&["--nosuch"]).misused(&["--nosuch"]);
    run(&["identify"]).misused(&["required"]);
}

// A bare number above 1 may be a percentage or a factor, so no share takes one; both spellings of the same share are one.
#[test]
fn a_share_is_a_percentage_or_a_part_of_one() {
    let hover = [
        "--k", "1", "--t-prop", "0.03", "--t-body", "1", "--tau", "0.02",
    ];
    let simulate = |option: &'static str| [&["simulate"], &hover[..], &[option, "10"]].concat();
    let all: [Vec<&str>; 8] = [
        vec!["identify", "x.csv", "--noise", "10"],
        vec!["identify", "x.csv", "--overshoot", "10"],
        vec!["identify", "x.ulg", "--write", "x.params", "--step", "10"],
        [&["tune"], &hover[..], &["--overshoot", "10"]].concat(),
        simulate("--asymmetry"),
        simulate("--drop-outs"),
        simulate("--outliers"),
        vec![
            "live",
            "relay",
            "udp:14550",
            "--axis",
            "altitude",
            "-o",
            "x.csv",
            "--amplitude",
            "10",
        ],
    ];
    for arguments in all {
        run(&arguments).misused(&["written as 5% or 0.05: write 10% or 0.1"]);
    }
    let tuned = |share| {
        let asked = [
            "--process",
            "FOPTD,K=2,T=10,tau=1",
            "--controller",
            "pi",
            "--overshoot",
            share,
        ];
        run(&[&["tune"], &asked[..]].concat()).stdout
    };
    assert_eq!(tuned("2%"), tuned("0.02"));
}

// The exit code is 2, and the sentence names the argument.
#[test]
fn a_sample_rate_out_of_range() {
    let file = Scratch::new();
    let path = file.write("clean.csv", Table::clean().csv().as_bytes());
    for rate in ["--sample-rate=-5", "--sample-rate=0", "--sample-rate=nan"] {
        run(&["identify", &path, rate]).misused(&["sample", "rate"]);
    }
}

#[test]
fn negative_numbers_are_values_of_their_options() {
    let file = Scratch::new();
    let path = file.write("clean.csv", Table::clean().csv().as_bytes());
    run(&["identify", &path, "--sample-rate", "-5"]).misused(&["sample", "rate"]);
    let process = ["--k", "1", "--t-prop", "0.1", "--tau", "0.1"];
    run(&[&["tune"], &process[..], &["--t-body", "-1"]].concat()).misused(&["T_body", "-1"]);
    let body = ["--t-body", "1", "--duration", "-1"];
    run(&[&["simulate"], &process[..], &body].concat()).misused(&["--duration", "-1"]);
    let body = ["--t-body", "1", "--noise", "-1%"];
    run(&[&["simulate"], &process[..], &body].concat()).misused(&["--noise"]);
}

#[test]
fn impossible_simulations() {
    let with = |changes: &[(&str, &str)]| {
        let mut arguments = vec!["simulate".to_owned()];
        let process = [
            ("--k", "1"),
            ("--t-prop", "0.1"),
            ("--t-body", "1"),
            ("--tau", "0.05"),
        ];
        let is_changed = |name: &str| changes.iter().any(|(changed, _)| *changed == name);
        let kept = process.into_iter().filter(|(name, _)| !is_changed(name));
        arguments.extend(
            kept.chain(changes.iter().copied())
                .map(|(a, b)| format!("{a}={b}")),
        );
        run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    };
    with(&[("--t-prop", "0")]).misused(&["T_prop", "positive", "0"]);
    with(&[("--t-prop", "-1")]).misused(&["T_prop", "positive", "-1"]);
    with(&[("--t-body", "0")]).misused(&["T_body", "positive", "0"]);
    with(&[("--t-body", "-1")]).misused(&["T_body", "positive", "-1"]);
    with(&[("--t-body", "nan")]).misused(&["T_body", "positive"]);
    with(&[("--t-body", "inf")]).misused(&["--t-body", "--k-over-t-body"]);
    with(&[("--tau", "-0.1")]).misused(&["tau", "zero or", "-0.1"]);
    with(&[("--k", "0")]).misused(&["gain", "not zero"]);
    with(&[("--k", "one")]).misused(&["--k", "one"]);
    with(&[("--beta", "1.5")]).misused(&["beta", "between -1 and 1", "1.5"]);
    with(&[("--beta", "nan")]).misused(&["beta"]);
    with(&[("--amplitude", "0")]).misused(&["amplitude", "positive"]);
    with(&[("--duration", "0")]).misused(&["--duration", "positive", "0"]);
    with(&[("--duration", "1e300")]).misused(&["--duration", "--sample-rate"]);
    with(&[("--sample-rate", "0")]).misused(&["--sample-rate", "positive"]);
    with(&[("--sample-rate", "-5")]).misused(&["--sample-rate", "positive", "-5"]);
    with(&[("--noise", "-1%")]).misused(&["--noise", "zero or positive"]);
    with(&[("--noise", "loud")]).misused(&["--noise", "loud", "percentage"]);
    with(&[("--jitter", "inf")]).misused(&["--jitter", "inf"]);
    with(&[("--preroll", "nan")]).misused(&["pre-roll"]);
    with(&[("--seed", "-1")]).misused(&["--seed"]);
}

// The reference is refused as an argument, not as a row of a recording.
#[test]
fn a_reference_that_is_no_number() {
    let reference = [&["simulate"], &HOVER[..], &["--reference", "nan"]].concat();
    run(&reference).misused(&["--reference"]);
}

#[test]
fn extreme_simulations_do_not_crash() {
    let process = |t_prop: &str, tau: &str, more: &[&str]| {
        let arguments = [
            "simulate", "--k", "1", "--t-body", "1", "--t-prop", t_prop, "--tau", tau,
        ];
        run(&[&arguments, more].concat())
    };
    // A dead time of 1e10 samples.
    process("0.1", "1e7", &["--duration", "1"]).misused(&[]);
    // A period too short to be divided by 1000.
    process("1e-300", "0", &[]).misused(&[]);
}

// Both commands have the same requirements; `tune` needs no file.
#[test]
fn unusable_requirements_on_a_controller() {
    let process = ["tune", "--process", "FOPTD,K=1,T=1,tau=0.2"];
    let with = |arguments: &[&str]| run(&[&process[..], arguments].concat());
    with(&["--style", "wild"]).misused(&["--style", "wild"]);
    with(&["--controller", "lqr"]).misused(&["--controller", "lqr"]);
    with(&["--ms", "1"]).misused(&["--ms", "between 1.05 and 10"]);
    with(&["--ms", "nan"]).misused(&["--ms", "between 1.05 and 10"]);
    with(&["--gain-margin", "0.5"]).misused(&["--gain-margin", "factor"]);
    with(&["--input-peak", "-3"]).misused(&["--input-peak", "positive"]);
    with(&["--overshoot", "120%"]).misused(&["--overshoot", "between 0 % and 100 %"]);
    with(&["--overshoot", "5%", "--style", "paper"]).misused(&["leave out --overshoot"]);
    with(&["--sample-period", "0"]).misused(&["--sample-period", "positive"]);
    with(&["--noise", "0.01"]).misused(&["--noise", "--sample-period 0.001"]);
    let sampled = ["--sample-period", "0.01", "--noise"];
    with(&[&sampled[..], &["1%"]].concat()).misused(&["--noise", "positive number"]);
    with(&[&sampled[..], &["1", "--style", "paper"]].concat()).misused(&["leave out --noise"]);
    with(&["--input-amplitude", "0"]).misused(&["--input-amplitude", "positive"]);
    with(&["--phase-margin", "0"]).misused(&["--phase-margin", "between 0 and 90"]);
    for gains in ["1", "1,2", "1,2,x", "1,2,3,4,5", ""] {
        with(&["--against", gains]).misused(&["--against", "Kp,Ki,Kd"]);
    }
    with(&["--against", "0,0,0"]).misused(&["--against", "not zero"]);
    with(&["--against", "1,2,3,-1"]).misused(&["--against", "filter"]);
    with(&["--style", "paper"]).misused(&["paper's method", "--style sharp, balanced or calm"]);
    with(&["--style", "paper", "--ms", "2"]).misused(&["--style paper", "leave out --ms"]);
    with(&["--style", "paper", "--controller", "pi"]).misused(&["a PD and no pi"]);
    with(&["--controller", "pd"]).misused(&["integral", "--controller pi"]);
    with(&["--controller", "cascade-pi"]).misused(&["integrator", "--controller pi"]);
    // No controller has a phase margin of 89 degrees and a gain margin of 90.
    with(&[
        "--controller",
        "pi",
        "--phase-margin",
        "89",
        "--gain-margin",
        "90",
    ]);
    // Two integrators and a lag: a PI cannot stabilise them.
    let double = [
        "--process",
        "double_integrator_lag,K/T_body=1,T_prop=0.1,tau=0.05",
    ];
    let refused = run(&[&["tune", "--controller", "pi"], &double[..]].concat());
    refused.misused(&["no controller of the form pi", "--controller"]);
    // Nothing delays the loop.
    let undelayed = ["tune", "--process", "iptd,K=1,tau=0"];
    run(&undelayed).misused(&["--sample-period"]);
    let sampled = run(&[&undelayed[..], &["--sample-period", "0.01"]].concat());
    assert_eq!(sampled.code, Some(0), "{sampled:?}");
}

#[test]
fn unusable_processes_in_one_word() {
    let tune = |process: &str| run(&["tune", "--process", process]);
    tune("pt1,K=1").misused(&["--process", "there is no structure 'pt1'"]);
    tune("foptd,K=1,T=1").misused(&["foptd needs --tau"]);
    tune("foptd,K=1,T=1,tau=0.1,zeta=2").misused(&["'zeta' is not a parameter of foptd"]);
    tune("foptd,K=1,K=2,T=1,tau=0.1").misused(&["K is given twice"]);
    tune("foptd,K=1,T_body=1,T=2,tau=0.1").misused(&["T is given twice"]);
    tune("foptd,K=x,T=1,tau=0.1").misused(&["'x' is not a number for K"]);
    tune("foptd,K,T=1,tau=0.1").misused(&["'K' is not a parameter: write K=2"]);
    tune("foptd,K=0,T=1,tau=0.1").misused(&["K must be finite and not zero"]);
    tune("foptd,K=1,K/T_body=1,T=1,tau=0.1").misused(&["either K or K/T"]);
    let twice = ["tune", "--process", "foptd,K=1,T=1,tau=0.1", "--k", "2"];
    run(&twice).misused(&["K is given by --k and by --process"]);
}

#[test]
fn impossible_processes_for_tune() {
    let tune = |k: &str, t_prop: &str, t_body: &str, tau: &str| {
        let [k, t_prop] = [format!("--k={k}"), format!("--t-prop={t_prop}")];
        let [t_body, tau] = [format!("--t-body={t_body}"), format!("--tau={tau}")];
        run(&["tune", "--json", &k, &t_prop, &t_body, &tau])
    };
    tune("0", "0.3", "2", "0.1").misused(&["gain", "not zero"]);
    tune("nan", "0.3", "2", "0.1").misused(&["gain", "finite"]);
    tune("inf", "0.3", "2", "0.1").misused(&["gain", "finite"]);
    tune("1", "0", "2", "0.1").misused(&["T_prop", "positive"]);
    tune("1", "inf", "2", "0.1").misused(&["T_prop", "positive"]);
    tune("1", "0.3", "-2", "0.1").misused(&["T_body", "positive"]);
    tune("1", "0.3", "inf", "0.1").misused(&["--k-over-t-body"]);
    tune("1", "0.3", "2", "-0.1").misused(&["tau", "positive"]);
    tune("1", "0.3", "2", "nan").misused(&["tau", "positive"]);
    tune("1", "1e-300", "2", "1e-300").misused(&["too extreme"]);
    tune("1", "0.3", "1e300", "0.1").without_nan();
    tune("1", "1e9", "1e9", "1e9").without_nan();
    let both = [
        "tune",
        "--k",
        "1",
        "--k-over-t-body",
        "1",
        "--t-prop",
        "1",
        "--tau",
        "1",
    ];
    run(&both).misused(&["--k", "--k-over-t-body"]);
    run(&["tune", "--k", "1"]).misused(&["needs --t-prop"]);
    run(&[]).misused_without_command();
}

// What was a command of this program once, and is one of the other: one sentence, which says how it is built.
#[test]
fn a_command_of_the_lab_is_named() {
    for command in [
        "bench",
        "campaign",
        "certify",
        "dataset",
        "grid",
        "pack",
        "phase",
        "reproduce",
        "train",
    ] {
        run(&[command, "--json"]).refused(2, &[command, "onecycle-lab", "cargo install"]);
    }
    run(&["campain"]).misused(&["unrecognized subcommand"]);
}

impl Outcome {
    /// Asserts that the help is printed on the error output: a call without a command.
    fn misused_without_command(&self) {
        assert_eq!(self.code, Some(2));
        assert_eq!(self.stdout, "");
        assert!(self.stderr.contains("Usage: onecycle"), "{}", self.stderr);
    }
}

// ---------------------------------------------------------------- outputs

#[test]
fn an_output_that_cannot_be_written() {
    let folder = Scratch::new();
    folder.write("file", b"kept");
    std::fs::create_dir(folder.path("folder")).unwrap();
    for target in ["nosuch/out.csv", "file/out.csv", "folder"] {
        let path = folder.name(target);
        let outcome = run(&[&["simulate"], &HOVER[..], &["--out", &path]].concat());
        outcome.refused(NOT_WRITTEN, &["cannot write", target]);
    }
    let mut left = folder.files();
    left.sort();
    assert_eq!(left, ["file", "folder"]);
    assert!(names_in(&folder.path("folder")).is_empty());
    assert_eq!(std::fs::read(folder.path("file")).unwrap(), b"kept");
}

#[test]
fn a_refused_simulation_leaves_the_file_as_it_was() {
    let folder = Scratch::new();
    let path = folder.write("out.csv", b"kept");
    run(&[
        &["simulate"],
        &HOVER[..],
        &["--out", &path, "--duration", "0"],
    ]
    .concat())
    .misused(&["--duration"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"kept");
    assert_eq!(folder.files(), ["out.csv"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk() {
    let full = || {
        std::fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap()
    };
    let output = program("simulate")
        .arg("simulate")
        .args(HOVER)
        .stdout(full())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(NOT_WRITTEN));
    let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        sentence.contains("cannot write to the standard output"),
        "{sentence}"
    );
    assert_eq!(sentence.lines().count(), 1);
}

// As `onecycle simulate ... | head -1`.
#[test]
fn a_reader_that_stops_reading() {
    let mut command = program("");
    let simulate = command.arg("simulate").args(HOVER);
    let mut child = simulate
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut reader = BufReader::with_capacity(64, child.stdout.take().unwrap());
    reader.read_line(&mut line).unwrap();
    assert!(line.starts_with("# simulated relay test"), "{line}");
    drop(reader);
    let output = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}

// As `onecycle identify - | true`.
#[test]
fn a_reader_that_never_reads() {
    for arguments in [&["identify", "-"][..], &["identify", "-", "--json"]] {
        let mut command = program("");
        let identify = command.args(arguments).stdin(Stdio::piped());
        let mut child = identify
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let mut input = child.stdin.take().unwrap();
        input.write_all(Table::clean().csv().as_bytes()).unwrap();
        drop(input);
        let mut complaint = String::new();
        child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut complaint)
            .unwrap();
        assert_eq!(complaint, "");
        assert_eq!(child.wait().unwrap().code(), Some(0));
    }
}
