//! `onecycle log`, and `onecycle identify` on flight logs.

use crate::common::{Scratch, UNREADABLE, run};

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
    ]);
    let expected = "pitch rate loop of flight 1: input is vehicle_torque_setpoint.xyz[1]";
    assert!(outcome.stdout.contains(expected), "{outcome:?}");
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
    run(&["log", &table]).refused(UNREADABLE, &["not a ULog, DataFlash or blackbox log"]);
}
