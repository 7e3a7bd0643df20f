//! `fly`: missions, page, CSV files, refusals.

use std::fs;

use crate::common::{Scratch, run};

// A short mission: the page has its figures, the CSV file one row for each millisecond. The same seed gives the same
// bytes, another seed gives others.
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
    assert!(text.contains("roll: on the true process"), "{text}");
    // 4 s with a poor controller, the test, 3 s with the new controller.
    let rows = csv.lines().count() - 1;
    assert!((8000..14_000).contains(&rows), "{rows}");
    let columns = csv.lines().next().unwrap().split(',').count();
    assert_eq!(columns, 8 + 4 * 3);
    assert!(csv.lines().all(|line| line.split(',').count() == columns));
    for phase in ["idle", "relay", "identify", "control"] {
        assert!(csv.contains(&format!(",{phase},")), "{phase}");
    }
    assert!(!csv.contains("NaN") && !csv.contains("inf"));
    // Roll angle, command, sideways drift, Nyquist plot.
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

// `identify` reads the CSV file of a flight: the command is the input, the measurement the output.
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
    // 20.7 m/s^2 at full thrust; one test of four cycles has an error of about 2 %.
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
