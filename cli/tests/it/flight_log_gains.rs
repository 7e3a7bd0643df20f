//! Gains of flight logs: read back, laid over the log, written to parameter files.

use crate::common::{NOT_IDENTIFIED, Scratch, reported, run};

fn example(name: &str) -> String {
    format!("{}/../examples/logs/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn gains_are_read_back() {
    let text = run(&["log", &example("ap_sysid_roll.bin"), "--check"]).stdout;
    assert_eq!(
        text.matches("The signals agree with the parameters")
            .count(),
        3,
        "{text}"
    );
    let json = run(&["log", &example("px4_chirps.ulg"), "--check", "--json"]).stdout;
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    let read = &report["flights"][0]["read_back"];
    assert_eq!(read.as_array().unwrap().len(), 3);
    assert_eq!(read[0]["agreement"], "agrees");
    let ratio = read[0]["terms"][0]["ratio"].as_f64().unwrap();
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

// Half-way parameters, a restore file, figures of the loop as written; nothing is replaced without --force.
#[test]
fn parameters_are_written_with_their_restore_file() {
    let folder = Scratch::new();
    let path = folder.name("pitch.params");
    let log = example("px4_chirps.ulg");
    let ask = [
        "identify", &log, "--axis", "pitch", "--json", "--write", &path,
    ];
    let report: serde_json::Value = serde_json::from_str(&run(&ask).stdout).unwrap();
    let of_log = &report["log"];
    assert_eq!(of_log["read_back"]["agreement"], "agrees");
    assert!(
        of_log["overlay_explained"].as_f64().unwrap() > 0.95,
        "{of_log}"
    );
    assert!(of_log["written"]["ms"].as_f64().unwrap() < 1.7, "{of_log}");
    // The firmware has P on the error. Gains for a set-point weight of zero overshot by 21 %.
    let overshoot = of_log["written"]["overshoot"].as_f64().unwrap();
    assert!((0.0..0.1).contains(&overshoot), "{of_log}");
    assert_eq!(report["controller"]["setpoint_weight"], 1.0);
    assert!(report["against"]["is_stable"].as_bool().unwrap());
    let values = |name: &str| -> Vec<(String, f64)> {
        let text = std::fs::read_to_string(folder.path(name)).unwrap();
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        lines
            .map(|line| {
                let cells: Vec<&str> = line.split('\t').collect();
                assert_eq!(
                    (cells.len(), cells[0], cells[1], cells[4]),
                    (5, "1", "1", "9"),
                    "{line}"
                );
                (cells[2].to_owned(), cells[3].parse().unwrap())
            })
            .collect()
    };
    let (new, old) = (values("pitch.params"), values("pitch.restore.params"));
    assert_eq!(new.len(), old.len());
    assert!(
        old.contains(&("MC_PITCHRATE_P".to_owned(), 0.15)),
        "{old:?}"
    );
    assert!(
        new.iter()
            .zip(&old)
            .all(|(new, old)| new.0 == old.0 && new.1 != old.1)
    );
    run(&ask).misused(&["pitch.params exists", "--force"]);
}

// The gains in force have Ms 2.40: half of the way to 1.6 is nearer, and its limit is named. A step that is too long, or to
// gains that break the limits, would need --below-limits.
#[test]
fn half_of_the_way_to_the_limits_is_written_and_named() {
    let folder = Scratch::new();
    let path = folder.name("roll.param");
    let log = example("ap_sysid_roll.bin");
    let outcome = run(&["identify", &log, "--axis", "roll", "--write", &path]);
    let text = words(&outcome.stdout);
    assert!(
        text.contains("style balanced: Ms 1.84 (at most 1.60)."),
        "{text}"
    );
    assert_eq!(folder.files().len(), 2);
}

/// A text on one line.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// `px4_chirps.ulg` with `new` over the bytes that follow `name`.
fn chirps_with(folder: &Scratch, name: &[u8], new: &[u8]) -> String {
    log_with(folder, &example("px4_chirps.ulg"), name, new)
}

fn log_with(folder: &Scratch, log: &str, name: &[u8], new: &[u8]) -> String {
    let mut bytes = std::fs::read(log).unwrap();
    let found = bytes.windows(name.len()).position(|part| part == name);
    let at = found.unwrap() + name.len();
    bytes[at..at + new.len()].copy_from_slice(new);
    folder.write("flight.ulg", &bytes)
}

// With 0.6 for the P of 0.15 in the log, the signals contradict it: the headline of the page says so and is that of a refusal.
#[test]
fn a_contradicted_log_has_no_good_headline() {
    let folder = Scratch::new();
    let headline = |log: &str| {
        let page = reported(&["identify", log, "--axis", "roll"]).1;
        let start = page.find("class=\"verdict").unwrap();
        page[start..start + 200].to_owned()
    };
    let good = headline(&example("px4_chirps.ulg"));
    let log = chirps_with(&folder, b"float MC_ROLLRATE_P", &0.6_f32.to_le_bytes());
    let contradicted = headline(&log);
    assert!(
        contradicted.contains("contradict") && !good.contains("contradict"),
        "{contradicted}"
    );
    let class = |headline: &str| headline.split('>').next().unwrap().to_owned();
    assert_ne!(class(&good), class(&contradicted));
    // The card of the whole flight says the same, and what to do about it where nothing else is to be done.
    let log = log_with(
        &folder,
        &log,
        b"float MC_PITCHRATE_P",
        &0.6_f32.to_le_bytes(),
    );
    let flight = words(&run(&["identify", &log]).stdout);
    let card = "roll rate NOT YET: the gains read back from the signals contradict the parameters of the log.";
    assert!(flight.contains(card), "{flight}");
    assert!(
        flight.contains("Next roll rate: Check that no gain was moved in flight"),
        "{flight}"
    );
}

// Twelve times the gain that flew, of which the gain margin is 6: the model calls the loop unstable. Either the model is wrong or
// the gains are others; the set-point tells which, and in a log without it nothing does.
#[test]
fn a_model_that_calls_unstable_what_flew_is_refused() {
    let folder = Scratch::new();
    let log = chirps_with(&folder, b"float MC_ROLLRATE_K", &12_f32.to_le_bytes());
    let table = |log: &str| {
        let json = run(&["identify", log, "--json"]).stdout;
        let report: serde_json::Value = serde_json::from_str(&json).unwrap();
        report["loops"][0].clone()
    };
    let roll = table(&log);
    assert_eq!(roll["parts"][0]["verdict"], "identified");
    assert_eq!(roll["in_force"]["ms"], serde_json::Value::Null);
    run(&["identify", &log, "--axis", "roll", "--json"]).identified();
    let mut bytes = std::fs::read(&log).unwrap();
    let topic = b"vehicle_rates_setpoint";
    for at in 0..bytes.len() - topic.len() {
        if bytes[at..].starts_with(topic) {
            bytes[at] = b'x';
        }
    }
    let log = folder.write("without.ulg", &bytes);
    let roll = table(&log);
    assert_eq!(roll["name"], "roll rate");
    assert_eq!(roll["parts"][0]["verdict"], "not_this_process");
    assert_eq!(roll["proposed"], serde_json::Value::Null);
    let path = folder.name("roll.params");
    let one = run(&[
        "identify", &log, "--axis", "roll", "--json", "--write", &path,
    ]);
    let message = one.no_process("not_this_process").0["verdict"]["message"].clone();
    assert!(
        message
            .as_str()
            .unwrap()
            .ends_with("would have been unstable"),
        "{message}"
    );
    assert!(!folder.files().contains(&"roll.params".to_owned()));
}

// A log without the filter of the derivative: nothing is written, and no option is blamed that was not given.
#[test]
fn a_filter_that_the_log_does_not_show_is_not_written() {
    let folder = Scratch::new();
    let log = chirps_with(&folder, b"IMU_DGYRO_CUTO", b"XX");
    let path = folder.name("roll.params");
    let text = run(&["identify", &log, "--axis", "roll", "--write", &path]).stdout;
    assert!(
        words(&text).contains("Nothing is written: the proposed controller needs a filter"),
        "{text}"
    );
    assert!(!text.contains("--controller"), "{text}");
}

// Without a process there is nothing to write, and no file is left.
#[test]
fn a_refused_flight_writes_nothing() {
    let folder = Scratch::new();
    let path = folder.name("roll.txt");
    let log = example("betaflight_acro.bfl");
    let outcome = run(&[
        "identify", &log, "--axis", "roll", "--write", &path, "--step", "1",
    ]);
    assert!(outcome.stdout.contains("NOT YET: "), "{outcome:?}");
    assert_eq!(outcome.code, Some(NOT_IDENTIFIED));
    assert_eq!(folder.files(), Vec::<String>::new());
}

#[test]
fn wrong_uses_of_write() {
    let folder = Scratch::new();
    let table = folder.write("table.csv", b"t,u,y\n0,1,2\n1,2,3\n");
    let path = folder.name("x.params");
    run(&["identify", &table, "--write", &path]).misused(&["--write", "not a flight log"]);
    let log = example("px4_chirps.ulg");
    run(&["identify", &log, "--write", &path, "--step", "0"]).misused(&["above 0 %"]);
    run(&["identify", &log, "--write", "-"]).misused(&["--write needs the name of a file"]);
}
