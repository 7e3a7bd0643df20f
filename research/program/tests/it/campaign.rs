//! `campaign` with valid input.

use crate::common::{Outcome, Scratch, program, run};
use crate::killed::killed_when;

/// A small campaign of recordings.
pub(crate) const RECORDINGS: &str = "\
measure = \"recording\"
cases = 4
seed = 1
sample_rate_hz = 100
durations_s = [6]
noise = 0.01
structure = \"soiptd\"
disturbances = [{ wy_rad_per_s = 2 }]
processes = [{ structure = \"soiptd\", k_over_t_body = [0.5, 2], tau_s = 0.02, t_prop_s = 0.05, t_body_s = 0.5 }]
excitations = [{ signal = \"chirp\", amplitude = 1, band_hz = [0.2, 5] }, { signal = \"prbs\", amplitude = 1, pulse_s = 0.1 }]
loops = [{ kp = 4, kd = 2.5, filter_s = 0.02, entry = \"setpoint\" }]
";

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
        let mut program = program("campaign");
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
    let text =
        "measure = \"relay\"\ncases = 1000\nseed = 1\nbias = 0.3\nsigma = 0.01\ntrim = true\n";
    let path = folder.write("campaign.toml", text.as_bytes());
    let expected = run(&["campaign", &path]);
    assert_eq!(expected.code, Some(0), "{expected:?}");
    let out = folder.name("table.txt");
    let arguments = ["campaign", &path, "-o", &out];
    let journal = folder.path("table.txt.part/journal.jsonl");
    killed_when(&arguments, || {
        let text = std::fs::read_to_string(&journal).unwrap_or_default();
        text.matches('\n').count() > 1
    });
    let other = run(&[&arguments[..], &["--sigma", "0.02"]].concat());
    other.refused(
        3,
        &["table.txt.part", "settings, sigma null instead of 0.02"],
    );
    let resumed = run(&arguments);
    assert_eq!(resumed.code, Some(0), "{resumed:?}");
    assert!(
        resumed.stderr.starts_with("onecycle-lab: resuming after ")
            && resumed.stderr.contains(" of 1000 cases of "),
        "{resumed:?}"
    );
    assert_eq!(resumed.stdout, expected.stdout);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), expected.stdout);
    assert_eq!(folder.files().len(), 2, "{:?}", folder.files());
}

#[test]
fn help_lists_commands_and_exit_codes() {
    let help = |arguments: &[&str]| -> String {
        let outcome = run(arguments);
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
        outcome.stdout
    };
    let all = help(&["--help"]);
    for command in [
        "certify",
        "phase",
        "grid",
        "campaign",
        "bench",
        "reproduce",
        "dataset",
        "train",
        "pack",
    ] {
        assert!(all.contains(command), "{command}: {all}");
        let own = help(&[command, "--help"]);
        assert!(own.contains("Usage: onecycle-lab"), "{own}");
    }
    let codes = all.split("Exit codes:").nth(1).unwrap_or_default();
    for code in ["0  ", "2  ", "3  ", "4  ", "5  "] {
        assert!(codes.contains(code), "{code}: {all}");
    }
    assert!(help(&["--version"]).starts_with("onecycle-lab "));
}
