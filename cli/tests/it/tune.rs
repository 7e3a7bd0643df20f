//! `tune` and `campaign` with valid input, and `--help`.

use serde_json::Value;

use crate::common::{
    DOUBLE_INTEGRATOR, Outcome, RECORDINGS, Scratch, killed_when, onecycle, run, tune,
};

// ---------------------------------------------------------------- tune

#[test]
fn tune_gives_the_published_gains() {
    let process = [
        "--k", "1", "--t-prop", "0.3", "--t-body", "2", "--tau", "0.1",
    ];
    let report = tune(&process, &[]);
    let [kp, kd, angle_p] =
        ["kp", "kd", "angle_p"].map(|name| report.number(&format!("/controller/{name}")));
    assert!((kp - 8.5096).abs() < 1e-3, "{kp}");
    assert!((kd - 6.9966).abs() < 1e-3, "{kd}");
    assert!((angle_p - kp / kd).abs() < 1e-12);
    assert_eq!(report.0["schema"], "onecycle.tune/2");
    assert!((report.number("/margins/phase_margin_deg") - 20.0).abs() < 1e-6);
    // Twice the gain needs half the controller gains.
    let double = [
        "--k", "2", "--t-prop", "0.3", "--t-body", "2", "--tau", "0.1",
    ];
    assert!((tune(&double, &[]).number("/controller/kp") - 0.5 * kp).abs() < 1e-3);
    let text = run(&[&["tune"], &process[..]].concat());
    assert!(
        text.without_nan().stdout.contains("Kp 8.510   Kd 6.997"),
        "{}",
        text.stdout
    );
}

#[test]
fn tune_by_either_gain() {
    let by_k = tune(
        &[
            "--k", "1", "--t-prop", "0.3", "--t-body", "2", "--tau", "0.1",
        ],
        &[],
    );
    let by_acceleration = tune(
        &[
            "--k-over-t-body",
            "0.5",
            "--t-prop",
            "0.3",
            "--t-body",
            "2",
            "--tau",
            "0.1",
        ],
        &[],
    );
    assert_eq!(by_k.0, by_acceleration.0);
}

#[test]
fn tune_a_double_integrator() {
    let report = tune(&DOUBLE_INTEGRATOR, &["--phase-margin", "45"]);
    assert_eq!(report.0["process"]["k"], Value::Null);
    assert_eq!(report.0["process"]["t_body_s"], Value::Null);
    assert!((report.number("/margins/phase_margin_deg") - 45.0).abs() < 1e-3);
    run(&[&["tune"], &DOUBLE_INTEGRATOR[..]].concat()).without_nan();
}

#[test]
fn tune_a_negative_gain() {
    let report = tune(
        &[
            "--k", "-1", "--t-prop", "0.3", "--t-body", "2", "--tau", "0.1",
        ],
        &[],
    );
    assert!((report.number("/controller/kp") + 8.5096).abs() < 1e-3);
    assert!((report.number("/controller/kd") + 6.9966).abs() < 1e-3);
    assert!(report.number("/controller/angle_p") > 0.0);
}

// ---------------------------------------------------------------- campaign, help

#[test]
fn a_small_campaign() {
    let folder = Scratch::new();
    let text = "measure = \"relay\"\ncases = 4\nseed = 1\nbias = 0.3\nsigma = 0.01\ntrim = true\n";
    let path = folder.write("relay.toml", text.as_bytes());
    let table = run(&["campaign", &path]);
    assert_eq!(table.code, Some(0), "{table:?}");
    assert!(
        table.without_nan().stdout.contains("4 random processes"),
        "{}",
        table.stdout
    );
    assert!(
        table.stdout.contains("steady oscillation      4"),
        "{}",
        table.stdout
    );
    assert_eq!(run(&["campaign", &path]).stdout, table.stdout);
    let fewer = run(&["campaign", &path, "--cases", "2"]);
    assert!(
        fewer.stdout.contains("2 random processes"),
        "{}",
        fewer.stdout
    );
    let text = text.replace("relay", "identification");
    let path = folder.write("identification.toml", text.as_bytes());
    let table = run(&["campaign", &path]);
    assert_eq!(table.code, Some(0), "{table:?}");
    assert!(
        table
            .without_nan()
            .stdout
            .contains("refused                 0"),
        "{}",
        table.stdout
    );
}

// Two cases of each of two signals in a loop with a disturbance; the table is the same with one thread as with three.
#[test]
fn a_campaign_of_recordings() {
    let folder = Scratch::new();
    let path = folder.write("recordings.toml", RECORDINGS.as_bytes());
    let [table, other] = ["1", "3"].map(|threads| {
        let mut program = onecycle();
        program
            .args(["campaign", &path])
            .env("RAYON_NUM_THREADS", threads);
        Outcome::of(&program.output().unwrap())
    });
    assert_eq!(table.code, Some(0), "{table:?}");
    table.without_nan();
    for words in [
        "4 recordings",
        "chirp ",
        "prbs ",
        "90 % intervals hold",
        "T_body",
    ] {
        assert!(table.stdout.contains(words), "{words}: {}", table.stdout);
    }
    assert_eq!(table.stdout, other.stdout);
}

// Killed once the journal has some cases, the campaign is resumed and gives the same table to the byte, printed and in its
// file; the work folder is gone. Other settings are refused.
#[test]
fn a_campaign_is_resumed() {
    let folder = Scratch::new();
    let text = "measure = \"identification\"\ncases = 500\nseed = 1\nbias = 0.3\nsigma = 0.01\ntrim = true\n";
    let path = folder.write("campaign.toml", text.as_bytes());
    let expected = run(&["campaign", &path]);
    assert_eq!(expected.code, Some(0), "{expected:?}");
    let out = folder.name("table.txt");
    let arguments = ["campaign", &path, "-o", &out];
    let journal = folder.path("table.txt.part/journal.jsonl");
    killed_when(&arguments, || {
        let text = std::fs::read_to_string(&journal).unwrap_or_default();
        text.lines().count() > 1
    });
    let other = run(&[&arguments[..], &["--sigma", "0.02"]].concat());
    other.refused(
        3,
        &["table.txt.part", "settings, sigma null instead of 0.02"],
    );
    let resumed = run(&arguments);
    assert_eq!(resumed.code, Some(0), "{resumed:?}");
    assert!(
        resumed.stderr.starts_with("onecycle: resuming after ")
            && resumed.stderr.contains(" of 500 cases of "),
        "{resumed:?}"
    );
    assert_eq!(resumed.stdout, expected.stdout);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), expected.stdout);
    assert_eq!(folder.files().len(), 2, "{:?}", folder.files());
}

#[test]
fn help_lists_commands_and_exit_codes() {
    let help = |arguments: &[&str]| -> Outcome {
        let outcome = run(arguments);
        assert_eq!(outcome.code, Some(0), "{arguments:?}");
        assert_eq!(outcome.stderr, "");
        outcome
    };
    let all = help(&["--help"]).stdout;
    for command in [
        "identify", "simulate", "tune", "campaign", "phase", "grid", "certify", "dataset", "train",
        "pack",
    ] {
        assert!(all.contains(command), "{command}: {all}");
        let own = help(&[command, "--help"]).stdout;
        assert!(own.contains("Usage: onecycle"), "{own}");
    }
    let codes = all.split("Exit codes:").nth(1).unwrap_or_default();
    for code in ["0  ", "2  ", "3  ", "4  ", "5  "] {
        assert!(codes.contains(code), "{code}: {all}");
    }
    let identify = help(&["identify", "--help"]).stdout;
    assert!(identify.contains("Exit codes: 0"), "{identify}");
    assert!(help(&["--version"]).stdout.starts_with("onecycle "));
}
