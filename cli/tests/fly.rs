//! `fly`: missions from the command line, their page and their CSV, and what is refused.

// Helpers of tests are tests too, which the lint does not see.
#![allow(clippy::unwrap_used)]

mod common;

use std::fs;

use common::{Scratch, run};

// A mission that takes seconds of flight: the page holds its pictures, the CSV a row for each millisecond, and
// the same seed gives the same bytes; another seed gives others.
#[test]
fn a_mission_with_its_page_and_its_ticks() {
    let folder = Scratch::new();
    let fly = |name: &str, seed: &str| {
        let out = folder.name(name);
        let ran = run(&["fly", "roll", "--seed", seed, "-o", &out]);
        assert_eq!(ran.code, Some(0), "{ran:?}");
        let csv = fs::read_to_string(format!("{out}/roll.csv")).unwrap();
        let page = fs::read_to_string(format!("{out}/flights.html")).unwrap();
        (ran.stdout, csv, page)
    };
    let (text, csv, page) = fly("one", "7");
    assert!(
        text.contains("flown                                    1 of 1"),
        "{text}"
    );
    assert!(text.contains("roll: on the vehicle"), "{text}");
    // 4 s under the poor controller, a test, 3 s of what came of it.
    let rows = csv.lines().count() - 1;
    assert!((8000..14_000).contains(&rows), "{rows}");
    let columns = csv.lines().next().unwrap().split(',').count();
    assert_eq!(columns, 8 + 4 * 3);
    assert!(csv.lines().all(|line| line.split(',').count() == columns));
    for phase in ["idle", "relay", "identify", "control"] {
        assert!(csv.contains(&format!(",{phase},")), "{phase}");
    }
    assert!(!csv.contains("NaN") && !csv.contains("inf"));
    // Roll, its command, where it drifted, and the loop that was tuned.
    assert_eq!(page.matches("<figure ").count(), 4);
    let main = page
        .split("<main>")
        .nth(1)
        .unwrap()
        .split("</main>")
        .next()
        .unwrap();
    assert!(!main.contains("NaN") && !main.contains("null") && !main.contains("http"));
    assert_eq!(fly("again", "7").1, csv);
    assert_ne!(fly("other", "8").1, csv);
}

// An identification made in flight can be read again from its CSV by `identify`: the command is the relay's
// input, the measured angle its output.
#[test]
fn a_flight_is_a_recording() {
    let folder = Scratch::new();
    let out = folder.name("out");
    assert_eq!(run(&["fly", "cycles", "-o", &out]).code, Some(0));
    let csv = fs::read_to_string(format!("{out}/cycles.csv")).unwrap();
    let relay: Vec<&str> = (csv.lines().enumerate())
        .filter(|(number, line)| *number == 0 || line.contains(",relay,"))
        .map(|(_, line)| line)
        .collect();
    let file = folder.name("relay.csv");
    fs::write(&file, relay.join("\n")).unwrap();
    let found = run(&[
        "identify",
        &file,
        "--time",
        "time_s",
        "--input",
        "altitude_command",
        "--output",
        "altitude_measured",
        "--json",
    ]);
    assert_eq!(found.code, Some(0), "{found:?}");
    let json: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    let gain = json["process"]["k_over_t_body"]["estimate"]
        .as_f64()
        .unwrap();
    // 20.7 m/s^2 for the whole thrust; what one test of four cycles leaves is some 2 %.
    assert!((gain / 20.7 - 1.0).abs() < 0.08, "{gain}");
}

#[test]
fn what_is_refused() {
    let unknown = run(&["fly", "moon"]);
    assert_eq!(unknown.code, Some(2));
    assert!(
        unknown.stderr.contains("there is no mission 'moon'"),
        "{unknown:?}"
    );
    assert_eq!(run(&["fly", "roll", "--seeds", "0"]).code, Some(2));
    let folder = Scratch::new();
    let file = folder.name("file");
    fs::write(&file, "in the way").unwrap();
    let blocked = run(&["fly", "roll", "-o", &file]);
    assert_eq!(blocked.code, Some(5), "{blocked:?}");
}
