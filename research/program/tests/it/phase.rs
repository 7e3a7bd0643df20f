//! `phase`: reports, files, refusals.

use crate::common::{
    NOT_WRITTEN, Outcome, Report, Scratch, UNREADABLE, figures, notes, reported, run,
};
use serde_json::Value;

/// Spaces of this repository.
const MULTIROTOR: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../experiments/multirotor.toml"
);
const DOUBLE_INTEGRATORS: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../experiments/double_integrators.toml"
);

fn phase(arguments: &[&str]) -> Outcome {
    let outcome = run(&[&["phase"], arguments].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome
}

fn report(arguments: &[&str]) -> Report {
    phase(&[&["--json"], arguments].concat()).report()
}

// ---------------------------------------------------------------- reports

// -47.66 deg, beta -0.739, worst 3.8 %, mean 1.1 %.
#[test]
fn the_paper_s_space_is_the_default() {
    let found = report(&[]);
    assert_eq!(found.0["schema"], "onecycle.phase/1");
    for rule in ["distinguishing", "minimax"] {
        let number = |name: &str| found.number(&format!("/{rule}/{name}"));
        assert!((number("phase_deg") + 47.66).abs() < 0.02);
        assert!((number("lead_deg") + number("phase_deg") - 20.0).abs() < 1e-9);
        assert!((number("beta") + 0.7392).abs() < 2e-4);
        assert!((number("c1") - 0.380).abs() < 1e-3);
        assert!((number("c3") - 0.387).abs() < 1e-3);
        assert!((number("worst") - 0.0381).abs() < 1e-4);
        assert!((number("mean") - 0.0110).abs() < 1e-4);
        assert!(number("worst_on/t_prop_s") > 0.0);
    }
    let rules = found.0["rules"].as_array().unwrap();
    assert_eq!(rules.len(), 576);
    for time in ["t_prop_s", "t_body_s", "tau_s"] {
        assert!(rules.iter().all(|rule| rule["process"][time].is_f64()));
        assert!(found.number(&format!("/distinguishing/process/{time}")) > 0.0);
    }
    assert_eq!(report(&[MULTIROTOR]).0, found.0);
}

// Little damping and little dead time: one rule costs at most 0.5 % everywhere, at -49.9 deg.
#[test]
fn a_space_of_one_s_own() {
    let found = report(&[DOUBLE_INTEGRATORS, "--rows", "12", "--columns", "10"]);
    assert_eq!(found.0["rules"].as_array().map(Vec::len), Some(120));
    assert_eq!(found.0["space"]["t_body_s"][1], 60.0);
    assert!((found.number("/minimax/phase_deg") + 49.91).abs() < 0.05);
    assert!((found.number("/minimax/worst") - 0.0052).abs() < 2e-4);
}

#[test]
fn the_report_for_people_fits_a_terminal() {
    for file in [MULTIROTOR, DOUBLE_INTEGRATORS] {
        let outcome = phase(&[file]);
        let text = &outcome.without_nan().stdout;
        assert!(text.lines().all(|line| line.len() <= 100), "{text}");
        assert!(text.lines().count() < 40, "{text}");
        for words in ["576 shapes", "margin of 20 deg", "Best rule of all"] {
            assert!(text.contains(words), "{words}: {text}");
        }
    }
    let text = phase(&[]).stdout;
    assert!(text.contains("-47.66   -0.7392"), "{text}");
    let near_it = |line: &&str| line.starts_with('-');
    let count = |line: &str| line.split_whitespace().nth(1)?.parse::<usize>().ok();
    let counted: usize = text.lines().filter(near_it).filter_map(count).sum();
    assert_eq!(counted, 576, "{text}");
}

#[test]
fn a_single_process_is_a_space() {
    let folder = Scratch::new();
    let text = "t_prop_s = [0.3, 0.3]\nt_body_s = [2, 2]\ntau_s = [0.1, 0.1]\n";
    let file = folder.write("one.toml", text.as_bytes());
    let (outcome, page) = reported(&["phase", &file]);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let text = &outcome.without_nan().stdout;
    assert!(
        text.contains("one shape") && text.contains("-46.88"),
        "{text}"
    );
    assert_eq!(figures(&page).len(), 2);
    assert!(report(&[&file]).number("/minimax/mean").abs() < 1e-12);
}

// ---------------------------------------------------------------- files

#[test]
fn the_table_has_a_row_for_every_rule() {
    let folder = Scratch::new();
    let path = folder.name("rules.csv");
    let json = report(&["--rows", "5", "--columns", "7", "--csv", &path]);
    let table = std::fs::read_to_string(&path).unwrap();
    let mut lines = table.lines();
    let header: Vec<_> = lines.next().unwrap().split(',').collect();
    assert_eq!(header.len(), 12);
    assert_eq!(
        header[..5],
        ["t_prop_s", "t_body_s", "tau_s", "phase_deg", "beta"]
    );
    let rules = json.0["rules"].as_array().unwrap();
    assert_eq!(rules.len(), 35);
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 35);
    for (row, rule) in rows.iter().zip(rules) {
        assert_eq!(row.len(), 12);
        assert_eq!(Value::from(row[1]), rule["process"]["t_body_s"]);
        assert_eq!(Value::from(row[3]), rule["phase_deg"]);
        assert_eq!(Value::from(row[7]), rule["worst"]);
        assert_eq!(Value::from(row[11]), rule["worst_on"]["tau_s"]);
    }
    assert_eq!(folder.files(), ["rules.csv"]);
}

// The best phase is marked in the curve; the paper's phase too, if it is in the range. The map has six rows with phases of
// the local rules only.
#[test]
fn the_page_has_the_curve_and_the_map() {
    for (space, has_paper) in [(MULTIROTOR, true), (DOUBLE_INTEGRATORS, false)] {
        let arguments = ["phase", space, "--rows", "6", "--columns", "6", "--json"];
        let (outcome, page) = reported(&arguments);
        let report = outcome.report();
        let figures = figures(&page);
        let [curve, map] = &figures[..] else {
            panic!("{} figures", figures.len());
        };
        let best = format!("best {:.2} deg", report.number("/minimax/phase_deg"));
        let notes = notes(&figures);
        assert!(notes.contains(&best), "{best}: {notes:?}");
        assert_eq!(notes.contains(&"paper -46.89 deg".to_owned()), has_paper);
        let title = &curve["layout"]["yaxis"]["title"]["text"];
        assert_eq!(title, "deterioration (%)");
        let rows = map["data"][0]["z"].as_array().unwrap();
        assert_eq!(rows.len(), 6);
        let shown = rows.iter().flat_map(|row| row.as_array().unwrap());
        let shown: Vec<f64> = shown.filter_map(Value::as_f64).collect();
        let rules = report.0["rules"].as_array().unwrap();
        let phases: Vec<f64> = rules
            .iter()
            .filter_map(|rule| rule["phase_deg"].as_f64())
            .collect();
        assert!(shown.len() > 36 && shown.iter().all(|phase| phases.contains(phase)));
    }
}

#[test]
fn files_that_cannot_be_written() {
    let folder = Scratch::new();
    let path = folder.name("nosuch/file");
    for option in ["--csv", "--report"] {
        let outcome = run(&["phase", "--rows", "2", "--columns", "2", option, &path]);
        outcome.refused(NOT_WRITTEN, &["cannot write", "nosuch"]);
    }
    assert!(folder.files().is_empty());
}

// ---------------------------------------------------------------- refusals

fn space(text: &str) -> Outcome {
    let folder = Scratch::new();
    let outcome = run(&["phase", &folder.write("space.toml", text.as_bytes())]);
    assert_eq!(folder.files(), ["space.toml"]);
    outcome
}

const TIMES: &str = "t_prop_s = [0.015, 0.3]\nt_body_s = [0.2, 2.0]\ntau_s = [0.0005, 0.1]\n";

#[test]
fn spaces_that_are_none() {
    let folder = Scratch::new();
    let missing = run(&["phase", &folder.name("nosuch.toml")]);
    missing.refused(UNREADABLE, &["nosuch.toml", "No such file"]);

    let spoilt = |from: &str, to: &str| space(&TIMES.replace(from, to));
    for (outcome, words) in [
        (space(""), ["space.toml", "t_prop_s"]),
        (space("\0"), ["space.toml", "line 1"]),
        (spoilt("tau_s", "tau"), ["line 3", "tau"]),
        (spoilt("[0.2, 2.0]", "2.0"), ["line 2", "t_body_s"]),
        (spoilt("2.0", "\"two\""), ["line 2", "t_body_s"]),
        (spoilt("0.0005, 0.1", "0.0005"), ["line 3", "tau_s"]),
        (spoilt("0.3", "0.3, 0.4"), ["line 1", "t_prop_s"]),
        (
            spoilt("0.2, 2.0", "2.0, 0.2"),
            ["t_body_s", "lower time first"],
        ),
        (spoilt("0.015", "-0.015"), ["t_prop_s", "-0.015"]),
        (spoilt("0.015", "nan"), ["t_prop_s", "1e-9 to 1e9"]),
        (spoilt("0.1]", "inf]"), ["tau_s", "1e-9 to 1e9"]),
        (spoilt("0.3", "1e300"), ["t_prop_s", "but is 1e300"]),
    ] {
        outcome.refused(UNREADABLE, &words);
    }
    for (line, words) in [
        ("phase_margin_deg = 95", ["phase_margin_deg", "1 to 80"]),
        ("phase_margin_deg = \"20\"", ["line 4", "phase_margin_deg"]),
        ("beta = -1.5", ["beta", "-0.95 to 0.95"]),
        ("bogus = 1", ["line 4", "bogus"]),
        ("tau_s = [0.1, 0.2]", ["line 4", "duplicate key"]),
    ] {
        space(&format!("{TIMES}{line}\n")).refused(UNREADABLE, &words);
    }
}

#[test]
fn arguments_that_are_none() {
    for option in ["--rows", "--columns"] {
        for value in ["0", "49", "-1", "1.5", "many"] {
            run(&["phase", option, value]).misused(&[option]);
        }
    }
    run(&["phase", "--nosuch"]).misused(&["--nosuch"]);
    run(&["phase", "--picture", "phase.svg"]).misused(&["--picture"]);
}
