//! Invalid arguments and campaigns: the exit code, and one sentence.

use crate::campaign::RECORDINGS;
use crate::common::{Outcome, Scratch, UNREADABLE, run};

// ---------------------------------------------------------------- arguments

// A share is a percentage or a part of one.
#[test]
fn a_share_is_a_percentage_or_a_part_of_one() {
    let margin = [
        "pack",
        "margin",
        "default",
        "--phase-margin",
        "27",
        "--extra-ise",
        "10",
        "-o",
        "x.pack",
    ];
    for arguments in [
        &["certify", "--bias", "10"][..],
        &["grid", "--deterioration", "10"],
        &["bench", "make", "-o", "x", "--sigma", "10"],
        &margin,
    ] {
        run(arguments).misused(&["written as 5% or 0.05: write 10% or 0.1"]);
    }
}

// ---------------------------------------------------------------- campaigns

fn campaign(text: &str) -> Outcome {
    let folder = Scratch::new();
    run(&["campaign", &folder.write("campaign.toml", text.as_bytes())])
}

/// A campaign of one case, with these lines added.
fn campaign_with(lines: &str) -> Outcome {
    let head = "measure = \"identification\"\ncases = 1\nseed = 1\ntrim = true\n";
    campaign(&format!("{head}{lines}\n"))
}

#[test]
fn unreadable_campaigns() {
    let folder = Scratch::new();
    let missing = run(&["campaign", &folder.name("nosuch.toml")]);
    missing.refused(UNREADABLE, &["nosuch.toml", "No such file"]);
    run(&["campaign", &folder.name("")]).refused(UNREADABLE, &["directory"]);

    let names = |outcome: &Outcome, words: &[&str]| {
        assert_eq!(outcome.code, Some(UNREADABLE), "{outcome:?}");
        assert_eq!(outcome.stdout, "");
        for word in words {
            assert!(outcome.stderr.contains(word), "{word}: {}", outcome.stderr);
        }
    };
    names(&campaign("measure = \"relay\ncases = 1\n"), &["line 1"]);
    names(
        &campaign("measure = \"relay\"\n"),
        &["missing field \"cases\""],
    );
    names(
        &campaign_with("bias = 0\nsigma = 0\nbogus = 3"),
        &["line 7", "unknown field \"bogus\""],
    );
    names(
        &campaign_with("bias = \"much\"\nsigma = 0"),
        &["line 5", "much"],
    );
    names(
        &campaign("measure = \"luck\"\n"),
        &["line 1", "luck", "relay"],
    );
    names(
        &campaign_with("bias = 0\nsigma = 0\ncycles = -1"),
        &["line 7", "-1"],
    );
    names(&campaign("\u{0}\u{1}\u{2}"), &["line 1"]);
}

// The refusal is one sentence, as for recordings.
#[test]
fn a_malformed_campaign_is_one_sentence() {
    campaign_with("bias = 0\nsigma = 0\nbogus = 3").refused(UNREADABLE, &["line 7", "\"bogus\""]);
}

#[test]
fn a_campaign_without_cases() {
    let text = "measure = \"relay\"\ncases = 0\nseed = 1\nbias = 0\nsigma = 0\ntrim = true\n";
    campaign(text).refused(UNREADABLE, &["cases", "1 to"]);
}

// Numbers out of their range are refused, also those that TOML allows.
#[test]
fn campaigns_of_impossible_numbers() {
    for (line, field) in [
        ("bias = nan\nsigma = 0", "bias"),
        ("bias = inf\nsigma = 0", "bias"),
        ("bias = 0\nsigma = -1", "sigma"),
        ("bias = 0\nsigma = nan", "sigma"),
        ("bias = 0\nsigma = 0\noffset = nan", "offset"),
        ("bias = 0\nsigma = 0\ncycles = 0", "cycles"),
        ("bias = 0\nsigma = 0\ncycles = 100000", "cycles"),
    ] {
        let outcome = campaign_with(line);
        let is_refusal = [Some(2), Some(UNREADABLE)].contains(&outcome.code);
        assert!(
            is_refusal && outcome.stderr.contains(field),
            "{line}: {outcome:?}"
        );
    }
}

// A field of a campaign of recordings that is wrong, missing or one too many is named.
#[test]
fn a_malformed_campaign_of_recordings_is_one_sentence() {
    for (good, bad, words) in [
        ("noise = 0.01", "noise = -1", &["noise must be", "-1"][..]),
        ("noise = 0.01", "nois = 1", &["unknown field \"nois\""]),
        ("durations_s = [6]", "durations_s = []", &["durations_s"]),
        (
            "durations_s = [6]",
            "durations_s = [1e9]",
            &["durations_s", "samples"],
        ),
        (
            "\"prbs\"",
            "\"noise\"",
            &["unknown variant \"noise\"", "chirp"],
        ),
        (
            "band_hz = [0.2, 5]",
            "beta = 0",
            &["signal chirp", "band_hz must be given"],
        ),
        (
            "band_hz = [0.2, 5]",
            "band_hz = [0.2, 80]",
            &["band_hz", "half the sample rate"],
        ),
        (
            "band_hz = [0.2, 5]",
            "band_hz = [5, 5]",
            &["signal chirp", "frequency"],
        ),
        ("tau_s = 0.02", "tau_s = -1", &["process soiptd", "tau"]),
        (
            "tau_s = 0.02",
            "tau_s = [0.3, 0.2]",
            &["tau_s", "lower value first"],
        ),
        ("tau_s = 0.02", "tau_s = [1, 2, 3]", &["expected a number"]),
        ("tau_s = 0.02", "zeta = 0.02", &["process soiptd: zeta"]),
        (
            "tau_s = 0.02,",
            "",
            &["process soiptd: tau_s must be given"],
        ),
        (
            "structure = \"soiptd\", k",
            "structure = \"pid\", k",
            &["no structure \"pid\"", "foptd"],
        ),
        (
            "wy_rad_per_s = 2",
            "gust_sigma = 1",
            &["gust_correlation_s must be positive"],
        ),
        ("kp = 4", "kp = 1e10", &["kp", "1e9"]),
    ] {
        let text = RECORDINGS.replace(good, bad);
        assert_ne!(text, RECORDINGS, "{good}");
        campaign(&text).refused(UNREADABLE, words);
    }
    let folder = Scratch::new();
    let path = folder.write("campaign.toml", RECORDINGS.as_bytes());
    run(&["campaign", &path, "--sigma", "0.1"]).refused(2, &["--sigma has no effect"]);
}

// A wrong value is blamed on the argument, not on the file, which is right.
#[test]
fn wrong_values_beside_a_campaign_are_those_of_the_arguments() {
    let folder = Scratch::new();
    let text = "measure = \"relay\"\ncases = 2\nseed = 1\nbias = 0\nsigma = 0\ntrim = true\n";
    let path = folder.write("right.toml", text.as_bytes());
    for (option, name) in [("--sigma", "sigma"), ("--time-scale", "time_scale")] {
        let outcome = run(&["campaign", &path, option, "nan"]);
        assert!(!outcome.stderr.contains("right.toml"), "{outcome:?}");
        outcome.misused(&[name]);
    }
}

// Settings have a limit of size, and an endless file is refused at once.
#[cfg(unix)]
#[test]
fn an_endless_file_is_refused() {
    for arguments in [
        &["campaign", "/dev/zero"][..],
        &["phase", "/dev/zero"],
        &["train", "--recipe", "/dev/zero", "-o", "never.pack"],
        &["grid", "--from", "/dev/zero"],
    ] {
        run(arguments).refused(UNREADABLE, &["/dev/zero", "bytes", "check its name"]);
    }
}

#[test]
fn a_campaign_that_identifies_nothing_has_no_nan() {
    let outcome = campaign_with("bias = 0.5\nsigma = 5");
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome.without_nan();
}

#[test]
fn a_campaign_without_a_steady_oscillation_has_no_nan() {
    let text = "measure = \"relay\"\ncases = 2\nseed = 1\nbias = 50\nsigma = 0.5\ntrim = true\n";
    let outcome = campaign(text);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome.without_nan();
}
