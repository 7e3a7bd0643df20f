//! `simulate` and `identify` with valid input.

use serde_json::Value;

use crate::common::{
    DOUBLE_INTEGRATOR, HOVER, HOVER_K, HOVER_K_OVER_T_BODY, HOVER_T_BODY_S, HOVER_T_PROP_S,
    HOVER_TAU_S, Scratch, Table, identify, identify_as_text, is_hover, run, run_with_input,
    simulate, tune,
};

// ---------------------------------------------------------------- simulate, then identify

#[test]
fn a_round_trip_without_noise() {
    let report = identify(simulate(&HOVER, &["--bias", "30%"]), &[]).identified();
    report
        .near("k", HOVER_K, 1e-3)
        .near("k_over_t_body", HOVER_K_OVER_T_BODY, 1e-4)
        .near("t_prop_s", HOVER_T_PROP_S, 1e-3)
        .near("t_body_s", HOVER_T_BODY_S, 1e-3)
        .near("tau_s", HOVER_TAU_S, 1e-3)
        .near("input_bias", 0.3, 1e-4);
    let noise = report.number("/oscillation/noise_sigma") / report.number("/oscillation/amplitude");
    assert!(noise < 1e-3, "{noise}");
    assert!((report.number("/oscillation/sample_s") - 1e-3).abs() < 1e-12);
}

// With an asymmetry of 0.2 and a positive bias the relay is high for 0.4 of a cycle, and the true process is identified
// from a known cycle. Five 90 % intervals hold at once with a probability below 0.9, and with 0.9^5 = 0.59 if they were
// independent.
#[test]
fn an_asymmetric_test_is_identified() {
    let arguments = ["--noise", "1%", "--bias", "30%", "--asymmetry", "0.2"];
    let recording = simulate(&HOVER, &arguments);
    let report = identify(&recording, &[]).identified();
    report
        .near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.01)
        .near("t_prop_s", HOVER_T_PROP_S, 0.05)
        .near("tau_s", HOVER_TAU_S, 0.05)
        .near("input_bias", 0.3, 0.02);
    assert!((report.number("/oscillation/duty") - 0.4).abs() < 0.02);
    assert!((0.55..0.9).contains(&report.number("/joint_probability")));
    let of_cycles = identify(&recording, &["--cycles", "8"]).identified();
    assert!(of_cycles.number("/last_cycle/score") < 1.0);
}

// Every method finds the process, each within its own accuracy.
#[test]
fn every_method_finds_the_process() {
    for (method, tolerance) in [("classify", 0.2), ("refine", 0.05), ("map", 0.05)] {
        let recording = simulate(&HOVER, &["--noise", "1%", "--bias", "30%"]);
        let report = identify(recording, &["--method", method, "--cycles", "8"]).identified();
        report
            .near("k_over_t_body", HOVER_K_OVER_T_BODY, tolerance)
            .near("t_prop_s", HOVER_T_PROP_S, tolerance)
            .near("tau_s", HOVER_TAU_S, tolerance);
        let reads = report.0["last_cycle"].is_object();
        assert_eq!(reads, method != "refine", "{}", report.0["last_cycle"]);
    }
}

#[test]
fn a_round_trip_with_noise() {
    let arguments = ["--noise", "1%", "--bias", "-20%", "--seed", "11"];
    let report = identify(simulate(&HOVER, &arguments), &[]).identified();
    report
        .near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.02)
        .near("t_prop_s", HOVER_T_PROP_S, 0.1)
        .near("t_body_s", HOVER_T_BODY_S, 0.5)
        .near("tau_s", HOVER_TAU_S, 0.1)
        .near("input_bias", -0.2, 0.02);
    for (name, truth) in [
        ("k", HOVER_K),
        ("k_over_t_body", HOVER_K_OVER_T_BODY),
        ("t_prop_s", HOVER_T_PROP_S),
        ("t_body_s", HOVER_T_BODY_S),
        ("tau_s", HOVER_TAU_S),
        ("input_bias", -0.2),
    ] {
        assert!(
            report.holds(name, truth),
            "{name} {truth}: {}",
            report.0["process"][name]
        );
    }
    let noise = report.number("/oscillation/noise_sigma") / report.number("/oscillation/amplitude");
    assert!((noise - 0.01).abs() < 0.002, "{noise}");
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let seeded = |seed| simulate(&HOVER, &["--noise", "1%", "--jitter", "2%", "--seed", seed]);
    let first = seeded("7");
    assert!(first == seeded("7"), "the same seed gave other bytes");
    assert!(first != seeded("8"), "another seed gave the same bytes");
    // A file has the same content as the standard output.
    let folder = Scratch::new();
    let path = folder.name("out.csv");
    let written = [
        "--noise", "1%", "--jitter", "2%", "--seed", "7", "--out", &path,
    ];
    assert_eq!(simulate(&HOVER, &written), "");
    assert!(
        std::fs::read(&path).unwrap() == first.as_bytes(),
        "the file differs"
    );
    assert_eq!(folder.files(), ["out.csv"]);
}

#[test]
fn the_truth_stands_in_the_head() {
    let text = simulate(
        &HOVER,
        &["--bias", "30%", "--seed", "9", "--sample-rate", "500"],
    );
    let head: String = text
        .lines()
        .take_while(|line| line.starts_with('#'))
        .collect();
    for truth in [
        "k 1,",
        "t_prop_s 0.0321",
        "t_body_s 1.6886",
        "tau_s 0.0237",
        "seed 9",
    ] {
        assert!(head.contains(truth), "{truth}: {head}");
    }
    assert!(head.contains("input_bias 0.3"), "{head}");
    let table = Table::parse(&text);
    assert_eq!(table.0[1].time_s, 0.002);
}

// A long simulation must not be written as means of samples: their delay of 1.5 samples would be identified as dead time.
#[test]
fn a_long_simulation_reads_back_unbiased() {
    let process = [
        "--k", "1", "--t-prop", "0.0321", "--t-body", "1.6886", "--tau", "0.0237",
    ];
    let duration = ["--sample-rate", "1000", "--duration", "4200"];
    let report = identify(simulate(&process, &duration), &["--cycles", "20"]).identified();
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 1e-3);
    report.near("tau_s", HOVER_TAU_S, 0.01);
}

#[test]
fn a_negative_gain() {
    let recording = Table::clean()
        .map(|_, sample| sample.input = -sample.input)
        .csv();
    let report = identify(&recording, &[]).identified();
    report.near("k_over_t_body", -HOVER_K_OVER_T_BODY, 0.01);
    report.near("k", -HOVER_K, 0.02);
    report.remarked(&["gain is negative"]);
    let [kp, ki, kd] =
        ["/controller/kp", "/controller/ki", "/controller/kd"].map(|name| report.number(name));
    assert!(kp < 0.0 && ki < 0.0 && kd < 0.0, "{kp} {ki} {kd}");
    let ordered = |name: &str| {
        let side = |side: &str| report.number(&format!("/process/{name}/{side}"));
        side("low") <= side("estimate") && side("estimate") <= side("high")
    };
    assert!(
        ordered("k_over_t_body") && ordered("k"),
        "{}",
        report.0["process"]
    );
}

// A process with negative gain oscillates with a reversed relay, or is refused.
#[test]
fn a_negative_gain_is_simulated_or_refused() {
    let process = [&["simulate", "--k", "-1"], &HOVER[2..]].concat();
    let simulated = run(&process);
    if simulated.code == Some(0) {
        let report = identify(&simulated.stdout, &[]).identified();
        report.near("k_over_t_body", -HOVER_K_OVER_T_BODY, 0.01);
    } else {
        simulated.misused(&["gain"]);
    }
}

#[test]
fn a_double_integrator() {
    let recording = simulate(
        &DOUBLE_INTEGRATOR,
        &["--noise", "1%", "--bias", "30%", "--seed", "7"],
    );
    let report = identify(&recording, &[]).identified();
    report.near("k_over_t_body", 40.0, 0.03);
    assert_eq!(report.0["structure"], "double_integrator_lag");
    let text = identify_as_text(&recording, &[]);
    let text = &text.without_nan().stdout;
    assert!(text.contains("e^(-tau s) / (s^2 (T_prop s + 1))"), "{text}");
    // The board's estimator knows one structure, in which the damping is not seen.
    let report = identify(&recording, &["--cycles", "8"]).identified();
    for name in ["k", "t_body_s"] {
        assert_eq!(report.0["process"][name]["high"], Value::Null, "{name}");
    }
    report.told("details", &["T_body"]);
}

#[test]
fn a_slow_thermal_process() {
    let process = [
        "--k", "0.02", "--t-prop", "60", "--t-body", "300", "--tau", "20",
    ];
    let arguments = [
        "--sample-rate",
        "1",
        "--amplitude",
        "50",
        "--noise",
        "1%",
        "--seed",
        "2",
    ];
    let report = identify(simulate(&process, &arguments), &[]).identified();
    report
        .near("k_over_t_body", 0.02 / 300.0, 0.05)
        .near("t_prop_s", 60.0, 0.1)
        .near("t_body_s", 300.0, 0.2)
        .near("tau_s", 20.0, 0.1);
    assert!(report.number("/oscillation/period_s") > 300.0);
}

const FAST: [&str; 8] = [
    "--k", "1", "--t-prop", "0.0004", "--t-body", "0.025", "--tau", "0.00025",
];

#[test]
fn a_fast_process() {
    let report = identify(simulate(&FAST, &["--sample-rate", "100000"]), &[]).identified();
    let period_s = report.number("/oscillation/period_s");
    assert!((0.004..0.006).contains(&period_s), "{period_s}");
    report
        .near("k_over_t_body", 40.0, 0.01)
        .near("t_prop_s", 0.0004, 0.02)
        .near("tau_s", 0.00025, 0.02);
}

// The noise is a fraction of the amplitude, also for a period much shorter than the pre-roll.
#[test]
fn a_fast_process_with_noise() {
    let arguments = ["--sample-rate", "100000", "--noise", "1%", "--seed", "3"];
    let report = identify(simulate(&FAST, &arguments), &[]).identified();
    let noise = report.number("/oscillation/noise_sigma") / report.number("/oscillation/amplitude");
    assert!((noise - 0.01).abs() < 0.003, "{noise}");
    report.near("k_over_t_body", 40.0, 0.05);
}

// ---------------------------------------------------------------- identify

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value
        .as_object()
        .map(|object| object.keys().map(String::as_str).collect())
        .unwrap_or_default();
    keys.sort_unstable();
    keys
}

/// The parts of the report and their keys, in order.
const PARTS: [(&str, &str); 9] = [
    (
        "",
        "assumed columns controller controllers file fit margins notes oscillation process remarks robustness schema step verdict",
    ),
    ("/columns", "input output time"),
    ("/verdict", "advice kind message"),
    (
        "/process",
        "input_bias k k_over_t_body t_body_s t_prop_s tau_s",
    ),
    (
        "/controller",
        "filter_s form kd ki kp setpoint_weight style",
    ),
    ("/fit", "misfit noise_sigma residual_sigma"),
    (
        "/oscillation",
        "amplitude cycles_steady cycles_used duty end_s noise_sigma period_s relay_amplitude \
         relay_centre sample_s start_s",
    ),
    (
        "/margins",
        "delay_margin_s gain_crossover_rad_per_s gain_margin ms mt phase_crossover_rad_per_s \
         phase_margin_deg phase_margin_deg_interval",
    ),
    (
        "/step",
        "overshoot peak_input peak_time_s rise_time_s settling_time_s",
    ),
];

#[test]
fn the_json_report_has_every_key() {
    let report = identify(Table::noisy().csv(), &[]).identified().0;
    assert_eq!(report["schema"], "onecycle.identify/2");
    for (part, expected) in PARTS {
        let found = report.pointer(part).map(keys).unwrap_or_default();
        // Keys may be added, but not removed.
        for key in expected.split(' ') {
            assert!(found.contains(&key), "{key} is not in {part}: {found:?}");
        }
    }
    for name in keys(&report["process"]) {
        if name == "structure" {
            continue;
        }
        let range = &report["process"][name];
        assert_eq!(keys(range), ["estimate", "high", "low", "symbol"], "{name}");
        let [low, estimate, high] = ["low", "estimate", "high"].map(|side| range[side].as_f64());
        assert!(
            low <= estimate && estimate <= high && low.is_some(),
            "{name}: {range}"
        );
    }
    assert_eq!(report["verdict"]["advice"], Value::Null);
    assert_eq!(report["columns"]["time"]["name"], "time");
    assert_eq!(report["columns"]["time"]["unit"], "s");
    assert_eq!(report["columns"]["output"]["name"], "pv");
    assert!(
        report["notes"]
            .as_array()
            .is_some_and(|notes| !notes.is_empty())
    );
}

#[test]
fn the_controller_is_consistent() {
    let paper = ["--style", "paper"];
    let report = identify(Table::clean().csv(), &paper).identified();
    let [kp, kd, angle_p, rate_p] =
        ["kp", "kd", "angle_p", "rate_p"].map(|name| report.number(&format!("/controller/{name}")));
    assert!((angle_p - kp / kd).abs() < 1e-9 * angle_p);
    assert!((rate_p - kd).abs() < 1e-9 * kd);
    assert!((report.number("/margins/phase_margin_deg") - 20.0).abs() < 0.1);
    // As `tune` for the true process.
    let tuned = tune(&HOVER, &paper);
    assert!((kp / tuned.number("/controller/kp") - 1.0).abs() < 0.01);
    let calm = identify(
        Table::clean().csv(),
        &["--style", "paper", "--phase-margin", "45"],
    )
    .identified();
    assert!((calm.number("/margins/phase_margin_deg") - 45.0).abs() < 0.1);
    assert!(calm.number("/controller/kp") < kp);
}

// The default: a PID with Ms and Mt of 1.6, which no limit of the paper's meets. Its row is the chosen one; the limits hold
// on 95 % of the posterior.
#[test]
fn the_default_is_a_balanced_pid() {
    let report = identify(Table::noisy().csv(), &[]).identified();
    assert_eq!(report.0["controller"]["form"], "pid");
    assert_eq!(report.0["controller"]["style"], "balanced");
    assert!(report.number("/margins/ms") < 1.6001 && report.number("/margins/mt") < 1.6001);
    assert!(report.number("/margins/phase_margin_deg") > 36.4);
    assert!(report.number("/robustness/coverage") >= 0.95);
    let rows = report.0["controllers"].as_array().unwrap();
    let of = |key: &str| rows.iter().map(|row| row[key].clone()).collect::<Vec<_>>();
    assert_eq!(of("style"), ["paper", "sharp", "balanced", "calm"]);
    assert_eq!(of("is_chosen"), [false, false, true, false]);
    assert_eq!(rows[2]["controller"], report.0["controller"]);
    let number = |row: usize, pointer: &str| rows[row].pointer(pointer).and_then(Value::as_f64);
    for (row, share) in [(1, 0.5), (2, 0.25), (3, 0.1)] {
        assert!(number(row, "/noise_share") < Some(1.02 * share), "{row}");
    }
    assert_eq!(number(0, "/load_iae"), None);
    for pair in [(1, 2), (2, 3)] {
        assert!(number(pair.0, "/load_iae") < number(pair.1, "/load_iae"));
        assert!(number(pair.0, "/margins/ms") > number(pair.1, "/margins/ms"));
    }
    assert_eq!(report.0["against"], Value::Null);
}

// The limits that the user sets hold beside those of the style, and the assumptions are those of the recording.
#[test]
fn limits_of_the_user_hold() {
    let csv = Table::noisy().csv();
    let with = |arguments: &[&str]| identify(&csv, arguments).identified();
    assert!(with(&["--ms", "1.3"]).number("/margins/ms") < 1.3001);
    let margin = with(&["--style", "sharp", "--phase-margin", "60"]);
    assert!(margin.number("/margins/phase_margin_deg") > 59.9);
    assert!(with(&["--gain-margin", "6"]).number("/margins/gain_margin") > 5.99);
    let quiet = with(&["--noise", "5%"]);
    let share = quiet.0["controllers"][2]["noise_share"].as_f64().unwrap();
    assert!(share < 0.051, "{share}");
    for overshoot in ["0.02", "20%"] {
        let process = [
            "tune",
            "--process",
            "FOPTD,K=1,T=1,tau=0.4",
            "--controller",
            "pi",
        ];
        let limits = ["--ms", "2", "--json", "--overshoot", overshoot];
        let found = run(&[&process[..], &limits].concat()).report();
        let promised = found.number("/step/overshoot");
        let limit = if overshoot == "0.02" { 0.02 } else { 0.2 };
        assert!((promised - limit).abs() < 1e-4, "{promised}");
    }
    let sampled = with(&["--sample-period", "0.005"]);
    assert_eq!(sampled.number("/assumed/sample_period_s"), 0.005);
    assert_eq!(sampled.number("/assumed/computation_delay_s"), 0.005);
    let own = with(&[]);
    let sample_s = own.number("/oscillation/sample_s");
    assert_eq!(own.number("/assumed/sample_period_s"), sample_s);
    assert_eq!(own.number("/assumed/computation_delay_s"), 0.0);
}

// The paper's gains, judged as a user's: 20 degrees, no integral, and more noise than the balanced controller. Gains of
// the wrong sign are unstable, and the report says so.
#[test]
fn gains_in_force_are_judged() {
    let csv = Table::noisy().csv();
    let paper = identify(&csv, &["--style", "paper"]).identified();
    let [kp, kd] = ["/controller/kp", "/controller/kd"].map(|name| paper.number(name));
    let gains = format!("{kp},0,{kd}");
    let report = identify(&csv, &["--against", &gains]).identified();
    assert_eq!(report.0["against"]["is_stable"], true);
    assert_eq!(report.0["against"]["controller"]["form"], "pd");
    // The paper's PD is continuous; these gains run at the sample period of the recording.
    let margin_deg = report.number("/against/margins/phase_margin_deg");
    assert!((15.0..20.1).contains(&margin_deg), "{margin_deg}");
    assert!(report.number("/against/least/phase_margin_deg") < margin_deg);
    assert_eq!(report.number("/against/least/stable"), 1.0);
    let noise = report.0["controllers"][2]["noise_share"].as_f64().unwrap();
    assert!(report.number("/against/noise_share") > 2.0 * noise);
    let text = identify_as_text(&csv, &["--against", &gains]).stdout;
    for part in [
        "  yours ",
        "on all likely processes",
        "instead of",
        "> balanced",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let gains = format!("{},0,{kd}", -kp);
    let report = identify(&csv, &["--against", &gains]).identified();
    assert_eq!(report.0["against"]["is_stable"], false);
    assert_eq!(report.0["against"]["margins"], Value::Null);
    let text = identify_as_text(&csv, &["--against", &gains]).stdout;
    assert!(text.contains("Your gains are unstable"), "{text}");
}

#[test]
fn as_many_cycles_as_asked_for() {
    for cycles in [1, 2, 4] {
        let asked = cycles.to_string();
        let report = identify(Table::clean().csv(), &["--cycles", &asked]).identified();
        assert_eq!(report.number("/oscillation/cycles_used"), f64::from(cycles));
        let [start_s, end_s, period_s] = ["start_s", "end_s", "period_s"]
            .map(|name| report.number(&format!("/oscillation/{name}")));
        assert!((end_s - start_s - f64::from(cycles) * period_s).abs() < 1e-9);
        is_hover(&report, 0.01);
    }
    let all = identify(Table::clean().csv(), &["--cycles", "50"]).identified();
    assert_eq!(
        all.number("/oscillation/cycles_used"),
        all.number("/oscillation/cycles_steady")
    );
}

#[test]
fn columns_by_name_and_by_number() {
    let table = Table::clean();
    let text: String = std::iter::once("stamp,altitude,roll,battery,servo\n".to_owned())
        .chain(table.0.iter().map(|sample| {
            let crate::common::Sample {
                time_s,
                output,
                input,
            } = sample;
            format!("{time_s:?},12.5,{output:?},11.1,{input:?}\n")
        }))
        .collect();
    for chosen in [
        ["--time", "stamp", "--input", "servo", "--output", "roll"],
        ["--time", "1", "--input", "5", "--output", "3"],
        ["--time", "STAMP", "--input", "5", "--output", "Roll"],
    ] {
        let report = identify(&text, &chosen).identified();
        assert_eq!(report.0["columns"]["input"]["name"], "servo");
        assert_eq!(report.0["columns"]["output"]["name"], "roll");
        is_hover(&report, 0.01);
    }
    // Without options, the columns cannot be guessed; the refusal lists their names.
    identify(&text, &[]).refused(3, &["altitude", "roll", "battery", "servo"]);
}

#[test]
fn the_standard_input_is_a_file_too() {
    let bytes = Table::noisy().csv();
    let from_file = identify(&bytes, &[]).identified();
    let from_input = run_with_input(&["identify", "-", "--json"], bytes.as_bytes()).identified();
    for part in ["process", "controller", "oscillation", "verdict", "notes"] {
        assert_eq!(from_file.0[part], from_input.0[part], "{part}");
    }
    assert_eq!(from_input.0["file"], "-");
}

#[test]
fn the_report_for_people() {
    let outcome = identify_as_text(Table::noisy().csv(), &[]);
    assert_eq!(outcome.code, Some(0));
    assert_eq!(outcome.stderr, "");
    let text = &outcome.without_nan().stdout;
    for part in [
        "Recording",
        "Process",
        "K/T_body",
        "T_prop",
        "T_body",
        "tau",
        "input bias",
        "Controller",
        "Kp",
        "phase margin",
        "Predicted step",
        "90 % interval",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // The first line is the file name, of any length.
    let widest = text.lines().skip(1).map(|line| line.chars().count()).max();
    assert!(widest <= Some(100), "{text}");
    let refused = identify_as_text(
        Table::clean().map(|_, sample| sample.input = 1.0).csv(),
        &[],
    );
    assert_eq!(refused.code, Some(4));
    assert!(
        refused.stdout.contains("No process identified"),
        "{}",
        refused.stdout
    );
    assert!(refused.stdout.contains("--input"), "{}", refused.stdout);
}

// A number just below a power of ten is rounded to 1.000, not to 1.0000.
#[test]
fn four_digits_are_four_digits() {
    let text = identify_as_text(Table::clean().csv(), &[]).stdout;
    assert!(!text.contains("1.0000"), "{text}");
}
