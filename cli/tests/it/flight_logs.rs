//! `onecycle log`, and `onecycle identify` on flight logs.

use crate::common::{Scratch, UNREADABLE, run, run_once};

fn example(name: &str) -> String {
    format!("{}/../examples/logs/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn a_log_is_listed_as_text_and_json() {
    let text = run(&["log", &example("ap_sysid_roll.bin")]).stdout;
    for fact in [
        "ArduCopter V4.7.0-dev",
        "SYSTEMID on roll, 66.65 to 92.67 s",
        "ATC_RAT_RLL_P 0.135",
    ] {
        assert!(text.contains(fact), "{fact}: {text}");
    }
    let json = run(&["log", &example("betaflight_two_flights.bbl"), "--json"]).stdout;
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(report["schema"], "onecycle.log/1");
    assert_eq!(report["flights"].as_array().unwrap().len(), 2);
    assert_eq!(
        report["flights"][1]["loops"][0]["gains"][0]["name"],
        "rollPID[0]"
    );
}

// A log without marks of its firmware may be excited all the same: what its set-points did decides.
#[test]
fn excitation_is_advised_to_calm_flights_only() {
    let advice = |name: &str, flight: usize| {
        let json = run(&["log", &example(name), "--json"]).stdout;
        let report: serde_json::Value = serde_json::from_str(&json).unwrap();
        report["flights"][flight]["advice"].to_string()
    };
    let chirps = advice("px4_chirps.ulg", 0);
    assert!(!chirps.contains("Fly"), "{chirps}");
    let calm = advice("betaflight_two_flights.bbl", 1);
    assert!(
        calm.contains("The flight is calm") && calm.contains("Fly the chirp mode"),
        "{calm}"
    );
}

// The signals agree with five terms, and show too little of the sixth.
#[test]
fn a_read_back_does_not_confirm_what_it_cannot_tell() {
    let text = run(&["log", &example("betaflight_acro.bfl"), "--check"]).stdout;
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let part = "and show too little of feedforward_weight[0] to compare.";
    assert!(words.contains(part), "{text}");
}

// The roll rate of this flight is refused, whatever can be designed for the fit that was refused.
#[test]
fn a_refused_flight_has_no_valid_model() {
    let log = example("px4_motor_failure.ulg");
    let text = run(&[
        "identify",
        &log,
        "--axis",
        "roll",
        "--controller",
        "pd",
        "--details",
    ])
    .stdout;
    assert!(text.contains("No process identified"), "{text}");
    assert!(!text.contains("intervals are valid"), "{text}");
}

// Whatever the verdict, the report names loop, input and output.
#[test]
fn identify_takes_the_loop_asked_for() {
    let outcome = run(&[
        "identify",
        &example("px4_chirps.ulg"),
        "--axis",
        "pitch",
        "--from",
        "203",
        "--to",
        "207",
        "--details",
    ]);
    let expected = "pitch rate loop of flight 1: input is vehicle_torque_setpoint.xyz[1]";
    assert!(outcome.stdout.contains(expected), "{outcome:?}");
}

// The second that the test data hold is too short to identify from, which identify says of each loop.
#[test]
fn a_bag_of_ros_2_is_a_flight_log_of_px4() {
    let bag = format!(
        "{}/../link/tests/data/px4_zstd.mcap",
        env!("CARGO_MANIFEST_DIR")
    );
    let listed = run(&["log", &bag]).stdout;
    for fact in ["MCAP", "roll rate     245 Hz", "246 Hz", "parameters  0"] {
        assert!(listed.contains(fact), "{fact}: {listed}");
    }
    let found = run(&["identify", &bag, "--details"]).stdout;
    assert!(found.contains("pitch rate      0 of"), "{found}");
}

#[test]
fn what_does_not_fit_is_refused_with_advice() {
    let log = example("px4_chirps.ulg");
    run(&["identify", &log, "--input", "u"]).misused(&["--input", "--axis and --loop"]);
    run(&["identify", &log, "--loop", "altitude"])
        .refused(UNREADABLE, &["altitude loop", "vehicle_local_position.vz"]);
    run(&["identify", &log, "--flight", "2"]).refused(UNREADABLE, &["no flight 2", "--flight"]);
    let folder = Scratch::new();
    let table = folder.write("table.csv", b"t,u,y\n0,1,2\n1,2,3\n");
    run(&["identify", &table, "--axis", "roll"]).misused(&["--axis", "flight logs"]);
    run(&["log", &table]).refused(UNREADABLE, &["not a ULog, DataFlash, blackbox or MCAP log"]);
    let noise = folder.write("noise.ulg", b"\x00\x9a\x01\x00\xfe\x00\x12\x00");
    run(&["identify", &noise]).refused(UNREADABLE, &["expected a PX4 ULog"]);
    let nothing = folder.name("nothing.csv");
    for option in [&["--axis", "roll"][..], &["--write", "x.params"], &[]] {
        let arguments = [&["identify", &nothing], option].concat();
        run(&arguments).refused(UNREADABLE, &["nothing.csv", "No such file"]);
    }
}

fn loops(log: &str) -> Vec<serde_json::Value> {
    let json = run_once(&["identify", &example(log), "--json"]).stdout;
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(report["schema"], "onecycle.flight/1");
    report["loops"].as_array().unwrap().clone()
}

fn gain_of(loops: &[serde_json::Value], name: &str) -> Option<[f64; 3]> {
    let own = loops.iter().find(|own| own["name"] == name).unwrap();
    let ends = own["gain"].as_array()?;
    Some([0, 1, 2].map(|at: usize| ends[at].as_f64().unwrap()))
}

// The simulators' own gains: 113.1 rad/s^2 for roll and pitch in
// PX4's SIH (examples/logs/README.md), and 290 to 305 rad/s^2 for roll in ArduPilot's SITL, by least squares on its noise-free rates.
#[test]
fn the_rate_loops_of_simulated_flights_have_the_gains_of_the_simulators() {
    let all = loops("px4_chirps.ulg");
    for name in ["roll rate", "pitch rate"] {
        let [low, gain, high] = gain_of(&all, name).unwrap();
        assert!((gain / 113.1 - 1.0).abs() < 0.05, "{name} {gain}");
        assert!(low < 113.1 && high > 113.1, "{name} {low} {high}");
    }
    let all = loops("ap_sysid_roll.bin");
    let [_, gain, _] = gain_of(&all, "roll rate").unwrap();
    assert!((gain / 297.5 - 1.0).abs() < 0.05, "{gain}");
    // SYSTEMID excited roll only.
    assert_eq!(gain_of(&all, "pitch rate"), None);
    assert_eq!(gain_of(&all, "yaw rate"), None);
}

// The sensitivity of the loop measured in the log itself, from the added test signal to ROut, is that of AC_PID in steps of 2.5 ms
// (numpy): 1.03 at 14 Hz (measured 1.08), with a peak of 2.42 at 21 Hz, beyond the chirp. With the gyro's filter as a mere
// delay the peak was 4.8.
#[test]
fn the_margins_of_the_gains_in_force_are_those_of_the_firmware() {
    let all = loops("ap_sysid_roll.bin");
    let roll = all.iter().find(|own| own["name"] == "roll rate").unwrap();
    let ms = roll["in_force"]["ms"].as_f64().unwrap();
    assert!((ms - 2.42).abs() < 0.1, "{ms}");
}

// One loop is identified from the part of the flight that the table of all loops takes, with the same process.
#[test]
fn one_loop_has_the_process_of_the_table() {
    for (name, axis) in [
        ("ap_sysid_roll.bin", "roll"),
        ("px4_chirps.ulg", "yaw"),
        ("px4_motor_failure.ulg", "yaw"),
    ] {
        let all = loops(name);
        let [low, gain, high] = gain_of(&all, &format!("{axis} rate")).unwrap();
        let json = run(&["identify", &example(name), "--axis", axis, "--json"]).stdout;
        let one: serde_json::Value = serde_json::from_str(&json).unwrap();
        let own = &one["process"]["k_over_t_body"];
        for (which, expected) in [("low", low), ("estimate", gain), ("high", high)] {
            let value = own[which].as_f64().unwrap();
            assert!((value / expected - 1.0).abs() < 1e-12, "{name} {which}");
        }
    }
}

#[test]
fn every_loop_of_a_flight_is_listed_with_its_parts() {
    let text = run(&["identify", &example("px4_chirps.ulg"), "--details"]).stdout;
    for fact in [
        "Flight 1         parts  gain (90 %)",
        "pitch rate      1 of 1",
        "rad/s^2",
        "Pitch rate",
    ] {
        assert!(text.contains(fact), "{fact}: {text}");
    }
    let on_one_line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(on_one_line.contains("--axis AXIS --loop LOOP"), "{text}");
    // A vehicle in the air that nobody moves tells nothing about roll and pitch; its noisy gyro moves the yaw.
    let calm = loops("px4_motor_failure.ulg");
    for name in ["roll rate", "pitch rate"] {
        assert_eq!(gain_of(&calm, name), None, "{name}");
    }
}

/// The report of an axis of the long flight.
fn acro(axis: &str) -> serde_json::Value {
    let log = example("betaflight_acro_long.bbl");
    serde_json::from_str(&run_once(&["identify", &log, "--axis", axis, "--json"]).stdout).unwrap()
}

/// Angular acceleration of full torque with its interval.
fn acceleration(report: &serde_json::Value) -> [f64; 3] {
    ["low", "estimate", "high"].map(|which| report["process"]["k"][which].as_f64().unwrap())
}

// Noise of the motors hides the process from a fit to the input: the response to the sticks shows it. Oracle: the same data by
// SciPy's least squares with other segments (2 s, Hann) gives 1,720 with a deviation of 80.
#[test]
fn an_acro_flight_tells_the_roll_rate_loop() {
    let found = acro("roll");
    assert_eq!(found["structure"], "integrator_lag");
    let kinds = found["remark_kinds"].as_array().unwrap();
    assert!(kinds.contains(&"by_set_point".into()), "{kinds:?}");
    let [low, estimate, high] = acceleration(&found);
    assert!((1560.0..1880.0).contains(&estimate), "{estimate}");
    assert!(low < 1720.0 + 80.0 && high > 1720.0 - 80.0, "{low} {high}");
    assert!((high - low) / estimate < 0.3, "{low} {high}");
    let response = &found["fit"]["response"];
    let measured = response["measured"].as_array().unwrap().len();
    assert_eq!(measured, response["fitted"].as_array().unwrap().len());
    assert!(measured > 50, "{measured}");
}

// Pitch has the propellers and nearly the inertia of roll: its interval reaches into that of roll.
#[test]
fn an_acro_flight_tells_all_rate_loops() {
    let [roll, pitch] = ["roll", "pitch"].map(|axis| acceleration(&acro(axis)));
    assert!(
        pitch[2] > roll[0] && pitch[0] < roll[2],
        "{roll:?} {pitch:?}"
    );
    assert!(pitch[2] < 2.0 * pitch[0], "{pitch:?}");
    assert_eq!(acro("yaw")["verdict"]["kind"], "identified");
}
