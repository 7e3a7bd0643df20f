//! Heaters from their logs to gains in their configuration.

use std::fmt::Write as _;

use crate::common::{Scratch, UNREADABLE, run};

const CONFIGURATION: &str = "[extruder]\ncontrol = pid\npid_kp = 22.2\npid_ki = 1.08\npid_kd = 114\n[heater_bed]\npid_kp = 60\n\
                             pid_ki = 1\npid_kd = 500\n";

/// A heater with K 250 per full power, T 90 s and tau 6 s under a relay of 0 and 1 between 145 and 150 degrees: time,
/// power and temperature every 0.5 s.
fn relay_test() -> Vec<(f64, f64, f64)> {
    let (mut temperature, mut power) = (140.0, 1.0);
    let mut delayed = std::collections::VecDeque::from(vec![0.4; 12]);
    let mut rows = Vec::new();
    for i in 0..1600_u32 {
        // Noise of the converter: the digits of a multiplicative sequence.
        let noise = f64::from(i.wrapping_mul(2_654_435_761) >> 16) / 65_536.0 - 0.5;
        let measured = ((temperature + 0.2 * noise) * 100.0_f64).round() / 100.0;
        if measured >= 150.0 {
            power = 0.0;
        } else if measured <= 145.0 {
            power = 1.0;
        }
        rows.push((1000.0 + 0.5 * f64::from(i), power, measured));
        delayed.push_back(power);
        let acts: f64 = delayed.pop_front().unwrap();
        temperature += (250.0 * acts + 22.0 - temperature) * (1.0 - (-0.5_f64 / 90.0).exp());
    }
    rows
}

fn klippy_log() -> String {
    let mut log = format!("Starting Klippy...\n===== Config file =====\n{CONFIGURATION}=====\n");
    for (time_s, power, temperature) in relay_test() {
        let _ = writeln!(
            log,
            "Stats {time_s:.1}: gcodein=0 mcu: freq=72000312 heater_bed: target=0 temp=22.1 pwm=0.000 extruder: target=150 \
             temp={temperature} pwm={power:.3}"
        );
    }
    log
}

#[test]
fn a_log_of_klipper_is_judged_by_its_own_gains() {
    let folder = Scratch::new();
    let log = folder.write("klippy.log", klippy_log().as_bytes());
    let report = run(&["identify", &log, "--json"]).report();
    let tau_s = report.number("/process/tau_s/estimate");
    assert!((tau_s - 6.0).abs() < 0.3, "{tau_s}");
    // 22.2 of 255 in the log's power of 0 to 1.
    let kp = report.number("/against/controller/kp");
    assert!((kp - 22.2 / 255.0).abs() < 1e-12, "{kp}");
    let text = run(&["identify", &log]).stdout;
    for words in [
        "pid_kp",
        "pid_ki",
        "pid_kd",
        "22.2",
        "input is \"extruder.pwm\"",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let details = run(&["identify", &log, "--details"]).stdout;
    assert!(details.contains("klipper     pid_kp: "), "{details}");
    // Klipper's relay has thresholds 5 degrees apart: no clock explains switches that late.
    assert!(!details.contains("one with beta"), "{details}");
}

#[test]
fn gains_of_a_configuration_are_named() {
    let folder = Scratch::new();
    let mut table = "time_s,power,temperature\n".to_owned();
    for (time_s, power, temperature) in relay_test() {
        let _ = writeln!(table, "{time_s},{power},{temperature}");
    }
    let table = folder.write("oven.csv", table.as_bytes());
    let configuration = folder.write("printer.cfg", CONFIGURATION.as_bytes());
    run(&["identify", &table, "--against", &configuration]).refused(
        UNREADABLE,
        &[
            "gains of several loops, extruder, heater_bed",
            "--against FILE:extruder",
        ],
    );
    let bed = format!("{configuration}:heater_bed");
    let report = run(&["identify", &table, "--against", &bed, "--json"]).report();
    assert!((report.number("/against/controller/kp") - 60.0 / 255.0).abs() < 1e-12);
    let without = folder.write("other.cfg", b"[fan]\npin: PA1\n");
    run(&["identify", &table, "--against", &without]).refused(UNREADABLE, &["no gains of Klipper"]);
    run(&["identify", &table, "--against", "nosuch.cfg"]).refused(UNREADABLE, &["nosuch.cfg"]);
}

#[test]
fn a_device_needs_no_range_of_the_measurement() {
    let process = ["tune", "--process", "FOPTD,K=250,T=90,tau=6"];
    let with = |more: &[&str]| run(&[&process[..], more].concat());
    let marlin = with(&["--vendor", "marlin", "--input-range", "0..1"]).stdout;
    assert!(marlin.contains("marlin      M301 P"), "{marlin}");
    let yaml = with(&["--vendor", "esphome", "--input-range", "0..1"]).stdout;
    assert!(yaml.contains("control_parameters: kp: "), "{yaml}");
    with(&["--vendor", "deltav"]).misused(&["--vendor deltav counts in percent", "--output-range"]);
    let drive = with(&["--vendor", "odrive"]).stdout;
    assert!(
        drive.contains("it has no derivative; use --controller pi"),
        "{drive}"
    );
}

// Gains of an input in percent, taken for a power of 0 to 1, were a hundred times too large.
#[test]
fn a_percent_is_not_taken_for_a_power_of_one() {
    let folder = Scratch::new();
    let mut table = "time_s,power,temperature\n".to_owned();
    for (time_s, power, temperature) in relay_test() {
        let _ = writeln!(table, "{time_s},{},{temperature}", 100.0 * power);
    }
    let table = folder.write("oven.csv", table.as_bytes());
    let asked = ["identify", &table, "--vendor", "klipper", "--json"];
    run(&asked).misused(&["the input reaches 100", "--input-range 0..100"]);
    let given = run(&[&asked[..], &["--input-range", "0..100"]].concat()).report();
    assert!(given.number("/process/k/estimate") > 0.0);
}

// 250 degrees of full power and a lag of 90 s: 2.78 degrees per second, cooling 1.11 degrees per second at 100 degrees; 6 s.
#[test]
fn a_printer_with_a_model_gets_its_model() {
    let folder = Scratch::new();
    let mut table = "time_s,power,temperature\n".to_owned();
    for (time_s, power, temperature) in relay_test() {
        let _ = writeln!(table, "{time_s},{power},{temperature}");
    }
    let table = folder.write("oven.csv", table.as_bytes());
    let asked = [
        "identify",
        &table,
        "--details",
        "--structure",
        "foptd",
        "--input-range",
        "0..1",
        "--vendor",
    ];
    let text = run(&[&asked[..], &["marlin"]].concat()).stdout;
    let line = text
        .lines()
        .find(|line| line.contains("M307 H1 R"))
        .expect("a model");
    let value = |letter: char| -> f64 {
        let typed = line.split_once("M307").map_or("", |(_, typed)| typed);
        let word = typed
            .split_whitespace()
            .find_map(|word| word.strip_prefix(letter));
        word.and_then(|word| word.trim_end_matches(":0").parse().ok())
            .expect("a number")
    };
    for (letter, expected, most) in [
        ('R', 250.0 / 90.0, 0.03),
        ('K', 100.0 / 90.0, 0.1),
        ('D', 6.0, 0.3),
    ] {
        assert!((value(letter) - expected).abs() < most, "{line}");
    }
    // kV 1/250 and kA 90/250 per degree.
    let text = run(&[&asked[..5], &["--vendor", "wpilib"]].concat()).stdout;
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let typed = text.split_once("feedforward kS 0 (no dry friction seen), kV 0.00");
    let (_, typed) = typed.expect("a feed-forward");
    // Behind the interval of kV.
    let acceleration = typed.split_once("), ").map(|(_, rest)| rest);
    assert!(
        acceleration.is_some_and(|rest| rest.starts_with("kA 0.3")),
        "{text}"
    );
    // A power of 0 to 1 is not taken for one of 0 to 127.
    run(&["identify", &table, "--vendor", "marlin"])
        .misused(&["the input only reaches 1", "--input-range 0..1"]);
    let two = [
        "identify",
        &table,
        "--details",
        "--structure",
        "soptd",
        "--input-range",
        "0..1",
        "--vendor",
        "marlin",
    ];
    let two = run(&two).stdout;
    assert!(two.contains("takes one lag and a dead time"), "{two}");
}
