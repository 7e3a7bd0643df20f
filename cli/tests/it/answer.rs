//! The card with which every report begins: what to do, what to type in, how sure it is, what comes next.

use serde_json::Value;

use crate::common::{Scratch, Table, identify, run};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

fn log(name: &str) -> String {
    format!("{ROOT}/examples/logs/{name}")
}

/// The card of a command, which has to fit in this many lines of 80 columns.
fn card(arguments: &[&str], lines: usize) -> String {
    let text = run(arguments).stdout;
    assert!(text.lines().count() <= lines, "{text}");
    // The name of a file may be longer than a line.
    let words = text.lines().filter(|line| !line.contains('/'));
    for line in words {
        assert!(line.chars().count() <= 80, "{line}: {text}");
    }
    text
}

fn answer(text: &str) -> Value {
    let report: Value = serde_json::from_str(text).unwrap();
    report["answer"].clone()
}

#[test]
fn a_recording_is_answered_in_24_lines() {
    let hover = format!("{ROOT}/examples/simulated_hover.csv");
    let first = card(&["identify", &hover], 24);
    let second = first.lines().nth(1).unwrap();
    assert!(second.starts_with("FIRST GAINS: "), "{first}");
    for named in [
        "  Kp ",
        "  Ki ",
        "  Kd ",
        "Process  K e^(-tau s)",
        "tau 0.0237 (",
        "Sure?",
        "Next",
        "--details",
    ] {
        assert!(first.contains(named), "{named}: {first}");
    }
    for plant in ["lic101_export.csv", "tec_relay_run2.csv"] {
        card(&["identify", &format!("{ROOT}/examples/plant/{plant}")], 24);
    }
    // What else there is follows the card.
    let all = run(&["identify", &hover, "--details"]).stdout;
    assert!(
        all.contains("\nControllers\n") && all.lines().count() > 60,
        "{all}"
    );
}

// Gains that are nearly those proposed are kept; a tenth of them is not, and both say so in the first line and in JSON.
#[test]
fn gains_are_kept_where_nobody_would_feel_the_difference() {
    let proposed = answer(&identify(Table::clean().csv(), &["--controller", "pd"]).stdout);
    assert_eq!(proposed["verdict"], "first_gains");
    let full = |name: &str| {
        let gains = proposed["gains"].as_array().unwrap();
        let gain = gains.iter().find(|gain| gain["name"] == name).unwrap();
        gain["full"].as_f64().unwrap()
    };
    let (kp, kd, filter_s) = (full("Kp"), full("Kd"), full("filter Tf"));
    let against = |scale: f64| {
        let gains = format!("{},0,{},{filter_s}", scale * kp, scale * kd);
        let options = ["--controller", "pd", "--against", &gains];
        answer(&identify(Table::clean().csv(), &options).stdout)
    };
    let near = against(0.97);
    assert_eq!(near["verdict"], "keep", "{near}");
    assert!(near["next"].as_str().unwrap().contains("Leave"));
    let far = against(0.1);
    assert_eq!(far["verdict"], "change", "{far}");
    let gains = far["gains"].as_array().unwrap();
    for gain in gains.iter().filter(|gain| gain["name"] != "filter Tf") {
        let of = |which: &str| gain[which].as_f64().unwrap();
        assert!(of("now") < of("half") && of("half") < of("full"), "{gain}");
    }
}

#[test]
fn a_refusal_says_what_to_do() {
    let clipped = Table::clean().map(|_, sample| sample.output = sample.output.clamp(-2e-3, 2e-3));
    let file = Scratch::new();
    let path = file.write("clipped.csv", clipped.csv().as_bytes());
    let text = card(&["identify", &path], 24);
    assert!(text.contains("\nNOT YET: saturated: "), "{text}");
    assert!(
        text.contains("\nNext     Lower the relay's amplitude"),
        "{text}"
    );
    let report = run(&["identify", &path, "--json"]).stdout;
    let answer = answer(&report);
    assert_eq!(answer["verdict"], "not_yet");
    assert!(answer["gains"].as_array().unwrap().is_empty() && answer["figures"].is_null());
}

// A loop of a flight: the names and the units of the firmware, the gains in force, half of the way and all of it.
#[test]
fn a_loop_is_answered_under_the_names_of_the_firmware() {
    let file = log("px4_chirps.ulg");
    let text = card(&["identify", &file, "--axis", "roll"], 24);
    assert!(text.contains("roll rate loop, PX4 1.17"), "{text}");
    let words = |name: &str| {
        let line = text
            .lines()
            .find(|line| line.trim_start().starts_with(name));
        let cells = line
            .unwrap_or_else(|| panic!("{name}: {text}"))
            .split_whitespace();
        cells
            .skip(1)
            .map(|cell| cell.parse::<f64>().unwrap())
            .collect::<Vec<_>>()
    };
    for name in ["MC_ROLLRATE_P", "MC_ROLLRATE_I", "MC_ROLLRATE_D"] {
        let [now, half, full] = words(name)[..] else {
            panic!("{text}")
        };
        assert!(now < half && half < full, "{name}: {text}");
    }
    let all = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(all.contains("--axis roll --write"), "{text}");
}

// The proposal for this flight had 6.4 times the load error of the gains in force and nothing better: it was "i_roll 75 -> 12".
#[test]
fn a_proposal_that_only_loses_is_no_change() {
    let report = run(&["identify", &log("betaflight_acro.bfl"), "--json"]).stdout;
    let report: Value = serde_json::from_str(&report).unwrap();
    for one in report["loops"].as_array().unwrap() {
        let answer = &one["answer"];
        let Some(figures) = answer["figures"].as_object() else {
            continue;
        };
        let of = |column: &str, name: &str| figures[column][name].as_f64();
        let pairs = of("now", "load_iae").zip(of("full", "load_iae"));
        let Some((now, full)) = pairs else { continue };
        let ms = (of("now", "ms").unwrap(), of("full", "ms").unwrap());
        let is_robust = ms.0 < 2.4;
        if is_robust && full / now > 2.0 * ms.0 / ms.1 {
            assert_eq!(answer["verdict"], "keep", "{answer}");
        }
    }
}

// All loops of a flight on one card, and their parameters in one file, with one that restores the old values.
#[test]
fn a_whole_flight_has_one_card_and_one_parameter_file() {
    let folder = Scratch::new();
    let file = log("px4_chirps.ulg");
    let named = |name: &str| folder.path(name).display().to_string();
    let path = named("tune.params");
    let text = card(&["identify", &file, "--write", &path], 40);
    for name in ["roll rate ", "pitch rate ", "yaw rate "] {
        assert!(
            text.lines().any(|line| line.starts_with(name)),
            "{name}: {text}"
        );
    }
    let values = |path: &str| {
        let all = std::fs::read_to_string(path).unwrap();
        let rows = all.lines().filter(|line| !line.starts_with('#'));
        let cells = rows.map(|row| row.split('\t').map(str::to_owned).collect::<Vec<_>>());
        cells
            .map(|row| (row[2].clone(), row[3].parse().unwrap()))
            .collect::<Vec<(String, f64)>>()
    };
    let (new, old) = (values(&path), values(&named("tune.restore.params")));
    let names = |of: &[(String, f64)]| of.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&new), names(&old));
    for name in ["MC_ROLLRATE_P", "MC_PITCHRATE_P"] {
        let of = |all: &[(String, f64)]| all.iter().find(|one| one.0 == name).unwrap().1;
        assert!(of(&new) > of(&old), "{name}");
    }
    assert!(
        text.contains("is written") && text.contains("tune.restore.params"),
        "{text}"
    );
    // Nothing is replaced without a word.
    let again = run(&["identify", &file, "--write", &path]);
    assert_eq!(again.code, Some(2), "{again:?}");
    // A flight that tells nothing writes nothing.
    let calm = named("calm.params");
    let outcome = run(&["identify", &log("px4_motor_failure.ulg"), "--write", &calm]);
    assert_eq!(outcome.code, Some(4), "{outcome:?}");
    assert!(!std::path::Path::new(&calm).exists());
}
