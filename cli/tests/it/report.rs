//! `--report`: complete pages with the numbers of `--json`, written whole or not at all.

use std::fs;

use crate::common::{
    NOT_IDENTIFIED, NOT_WRITTEN, Scratch, figures, identify, identify_as_text, notes, reported,
    run, simulate,
};
use serde_json::Value;

const HOVER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../examples/simulated_hover.csv"
);
const UNSTEADY: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../examples/unsteady_ardupilot_alt.csv"
);

// Every section is there, the margins in both plots and the overshoot equal those of --json, and every coordinate is a
// number.
#[test]
fn an_identification_as_a_page() {
    let (ran, page) = reported(&["identify", HOVER, "--json"]);
    assert_eq!(ran.code, Some(0));
    let report: Value = serde_json::from_str(&ran.stdout).unwrap();
    for section in [
        "recording",
        "fit",
        "process",
        "styles",
        "trade-off",
        "stability",
        "step",
        "controller",
    ] {
        let tag = format!("<section id=\"{section}\" class=\"{section}\">");
        assert!(page.contains(&tag), "{section}");
    }
    // What can be copied are names, values and units of the card; all else is folded.
    assert!(page.contains("data-text=\"Kp 45.2\nKi 85.1\nKd 13.5\nfilter Tf 0.00201 s"));
    let groups = ["evidence", "alternatives", "details"];
    for group in groups {
        assert!(page.contains(&format!("<details id=\"{group}\" class=\"group\">")));
    }
    let figures = figures(&page);
    // Both responses on the first screen, step, load, trade-off, Nyquist, Bode, gang of four, recording, fit, correlogram, seven marginals, contours,
    // correlations.
    assert_eq!(figures.len(), 22);
    let notes = notes(&figures);
    let margins = &report["margins"];
    let phase = format!(
        "phase margin {:.1} deg (",
        margins["phase_margin_deg"].as_f64().unwrap()
    );
    let gain = format!(
        "gain margin {:.2} (",
        margins["gain_margin"].as_f64().unwrap()
    );
    for margin in [&phase, &gain] {
        let found = notes
            .iter()
            .filter(|note| note.starts_with(margin.as_str()));
        assert_eq!(found.count(), 2, "{margin}: {notes:?}");
    }
    let missed = report["limits_not_kept"][0]["message"].as_str().unwrap();
    let overshoot = 100.0 * report["step"]["overshoot"].as_f64().unwrap();
    assert!(
        missed.starts_with(&format!("The overshoot of {overshoot:.1} %")) && page.contains(missed),
        "{missed}"
    );
    assert!(notes.contains(&format!("overshoot {overshoot:.0} %")));
    for trace in figures
        .iter()
        .flat_map(|figure| figure["data"].as_array().unwrap())
    {
        for axis in ["x", "y"] {
            let values = trace[axis].as_array().unwrap();
            assert!(!values.is_empty() && values.iter().all(|value| !value.is_null()));
        }
    }
}

// A flight log without a choice of the loop is one page: the card of all loops, and a tab for each, whose sections have
// identifiers of their own.
#[test]
fn a_flight_is_one_page_with_tabs() {
    let log = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/logs/betaflight_acro.bfl"
    );
    let (ran, page) = reported(&["identify", log, "--json"]);
    assert_eq!(ran.code, Some(0));
    let report: Value = serde_json::from_str(&ran.stdout).unwrap();
    let loops = report["loops"].as_array().unwrap();
    assert_eq!(page.matches("role=\"tab\" id=").count(), 1 + loops.len());
    for (one, has_process) in [
        ("roll-rate", false),
        ("pitch-rate", false),
        ("yaw-rate", true),
    ] {
        assert!(page.contains(&format!("<section id=\"{one}\" class=\"panel\"")));
        assert!(page.contains(&format!("<a href=\"#{one}\">")));
        assert!(
            page.contains(&format!("<section id=\"{one}-recording\"")),
            "{one}"
        );
        let stability = format!("<section id=\"{one}-stability\"");
        assert_eq!(page.contains(&stability), has_process, "{one}");
    }
    // All gains to type in, once for the flight and once for its loop.
    let gains = loops[2]["answer"]["gains"].as_array().unwrap();
    let half = gains[0]["half"].as_f64().unwrap();
    assert_eq!(
        page.matches(&format!("data-text=\"p_yaw {half:.0}\n"))
            .count(),
        2
    );
    // Every identifier is there once.
    let ids: Vec<&str> = page.split(" id=\"").skip(1).collect();
    let ids: Vec<&str> = ids.iter().filter_map(|id| id.split('"').next()).collect();
    let mut once = ids.clone();
    once.sort_unstable();
    once.dedup();
    assert_eq!(once.len(), ids.len(), "{ids:?}");
}

// A process that is faster than its samples of 50 ms: its lag was one of half a sample, with an interval of no width, and its
// dead time "0 (0 .. 0.047)".
#[test]
fn what_is_faster_than_a_sample_reads_below() {
    let process = "--process foptd --k 2 --t-body 0.001 --tau 0";
    let test = "--excitation prbs --pulse 2 --duration 200 --sample-rate 20 --noise 0.02";
    let words = |text: &'static str| text.split(' ').collect::<Vec<_>>();
    let recording = simulate(&words(process), &words(test));
    let held = ["--hold", "held"];
    let report = identify(&recording, &held).report().0;
    assert_eq!(report["below"], serde_json::json!(["t_body_s", "tau_s"]));
    let lines = identify_as_text(&recording, &held).stdout;
    let folder = Scratch::new();
    let path = folder.write("fast.csv", recording.as_bytes());
    let (_, page) = reported(&["identify", &path, held[0], held[1]]);
    for (name, key) in [("T", "t_body_s"), ("tau", "tau_s")] {
        let high = report["process"][key]["high"].as_f64().unwrap();
        assert!((0.04..0.05).contains(&high), "{high}");
        let below = format!("below {high:.5}");
        let line = lines
            .lines()
            .rfind(|line| line.split_whitespace().next() == Some(name))
            .unwrap();
        let shown: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(shown.join(" "), format!("{name} {below} s"));
        assert!(page.contains(&format!("<td data-column=\"estimate\">{below}</td>")));
    }
    // A time that the samples show has its interval.
    let slow = simulate(
        &words("--process foptd --k 2 --t-body 1 --tau 0.28"),
        &words(test),
    );
    assert_eq!(
        identify(slow, &[]).report().0["below"],
        serde_json::json!([])
    );
}

// The measured point at the oscillation lies on the curve of the identified process within 1 %: the noise of 2 % leaves
// 0.02 % over eight cycles.
#[test]
fn the_measured_point_lies_on_the_locus() {
    let figures = figures(&reported(&["identify", HOVER]).1);
    let named = |figure: &Value, name: &str| -> Option<(Vec<f64>, Vec<f64>)> {
        let traces = figure["data"].as_array()?;
        let trace = traces.iter().find(|trace| trace["name"] == name)?;
        let values = |axis: &str| {
            let values = trace[axis].as_array()?.iter();
            Some(values.filter_map(Value::as_f64).collect())
        };
        Some((values("x")?, values("y")?))
    };
    let nyquist = figures
        .iter()
        .find(|figure| figure["layout"]["yaxis"]["scaleanchor"] == "x");
    let (re, im) = named(nyquist.unwrap(), "measured under the relay").unwrap();
    let (x, y) = named(nyquist.unwrap(), "open loop").unwrap();
    // From the first harmonic to the nearest segment of the locus.
    let distance = (1..x.len())
        .map(|k| {
            let (ux, uy) = (x[k] - x[k - 1], y[k] - y[k - 1]);
            let part = ((re[0] - x[k - 1]) * ux + (im[0] - y[k - 1]) * uy) / (ux * ux + uy * uy);
            let part = part.clamp(0.0, 1.0);
            (re[0] - x[k - 1] - part * ux).hypot(im[0] - y[k - 1] - part * uy)
        })
        .fold(f64::INFINITY, f64::min);
    assert!(distance < 0.01 * re[0].hypot(im[0]), "{distance}");
}

// A refusal has a page too, with the recording and the advice; the exit code is that of a refusal.
#[test]
fn a_refusal_as_a_page() {
    let (ran, page) = reported(&["identify", UNSTEADY, "--cycles", "8"]);
    assert_eq!(ran.code, Some(NOT_IDENTIFIED));
    assert!(page.contains("class=\"verdict bad\">NOT YET: "));
    assert!(page.contains("Let the oscillation settle"));
    assert_eq!(figures(&page).len(), 1);
}

// A refusal after a fit shows it: recording, fit with residuals, correlogram. A relay of beta -0.3 did not make this one.
#[test]
fn a_refused_fit_is_on_the_page() {
    let (ran, page) = reported(&["identify", HOVER, "--beta", "-0.3"]);
    assert_eq!(ran.code, Some(NOT_IDENTIFIED));
    assert!(page.contains("not on one clock"));
    assert!(page.contains("Fit that was refused"));
    assert_eq!(figures(&page).len(), 3);
}

// A recording of any kind: the same sections and one for the structures; no figure holds a null, although samples are
// absent, and the page is below 2 MB.
#[test]
fn a_recording_of_any_kind_as_a_page() {
    let (ran, page) = reported(&["identify", UNSTEADY, "--json"]);
    assert_eq!(ran.code, Some(0));
    for section in [
        "recording",
        "fit",
        "process",
        "structures",
        "stability",
        "step",
    ] {
        assert!(
            page.contains(&format!("<section id=\"{section}\"")),
            "{section}"
        );
    }
    let report: Value = serde_json::from_str(&ran.stdout).unwrap();
    let structures = report["alternatives"].as_array().unwrap();
    assert!(structures.len() > 1);
    for structure in structures {
        let name = structure["structure"].as_str().unwrap();
        assert!(
            page.contains(&format!("<th scope=\"row\">{name}")),
            "{name}"
        );
    }
    let figures = figures(&page);
    // Both responses on the first screen, step, load, trade-off, Nyquist, Bode, gang of four, recording, fit, correlogram, seven marginals, contours,
    // correlations.
    assert_eq!(figures.len(), 22);
    for trace in figures
        .iter()
        .flat_map(|figure| figure["data"].as_array().unwrap())
    {
        for axis in ["x", "y"] {
            let values = trace[axis].as_array().unwrap();
            assert!(!values.is_empty() && values.iter().all(|value| !value.is_null()));
        }
    }
    assert!(page.len() < 2_000_000, "{}", page.len());
}

// A design has nine figures, with the requested margin in both stability plots.
#[test]
fn designs_as_pages() {
    let tune = [
        "tune", "--k", "1", "--t-prop", "0.3", "--t-body", "2", "--tau", "0.1", "--style", "paper",
    ];
    let (ran, page) = reported(&tune);
    assert_eq!(ran.code, Some(0));
    let tuned = figures(&page);
    // Both responses on the first screen, step, load, trade-off, Nyquist, Bode, gang of four.
    assert_eq!(tuned.len(), 9);
    let found = notes(&tuned);
    let margins = found.iter().filter(|note| *note == "phase margin 20.0 deg");
    assert_eq!(margins.count(), 2);
}

// The same recording gives the same bytes. If the page cannot be written, there is one sentence and no report.
#[test]
fn whole_or_not_at_all() {
    let again = || reported(&["identify", HOVER]).1;
    assert!(again() == again());
    let folder = Scratch::new();
    let nowhere = folder.name("no/such/folder/out.html");
    let ran = run(&["identify", HOVER, "--report", &nowhere]);
    ran.refused(
        NOT_WRITTEN,
        &["cannot write", "out.html", "there is no folder"],
    );
    assert_eq!(ran.stdout, "");
    assert!(folder.files().is_empty());
    let copy = folder.write("log.csv", &fs::read(HOVER).unwrap());
    let ran = run(&["identify", &copy, "--report", &copy]);
    ran.misused(&["would overwrite the recording"]);
    let (folder_name, _) = copy.rsplit_once('/').unwrap();
    let other_spelling = format!("{folder_name}/./log.csv");
    let ran = run(&["identify", &copy, "--report", &other_spelling]);
    ran.misused(&["would overwrite the recording"]);
    run(&["identify", &copy, "--report", "-"]).misused(&["needs the name of a file"]);
    assert!(fs::read(&copy).unwrap() == fs::read(HOVER).unwrap());
}
