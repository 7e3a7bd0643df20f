//! `simulate` with processes, test signals, loops and disturbances beyond the relay test of `commands`.

use crate::common::{Scratch, identify, run, simulate, tune};

const TANK: [&str; 8] = [
    "--process",
    "foptd",
    "--k",
    "2",
    "--t-body",
    "30",
    "--tau",
    "5",
];
const ROLL: [&str; 8] = [
    "--k-over-t-body",
    "40",
    "--t-prop",
    "0.05",
    "--t-body",
    "1",
    "--tau",
    "0.015",
];

/// A recording: comments, names of the columns, rows.
struct Simulated {
    head: Vec<String>,
    names: String,
    rows: Vec<Vec<f64>>,
}

impl Simulated {
    fn parse(text: &str) -> Self {
        let is_comment = |line: &&str| line.starts_with('#');
        let mut lines = text.lines().skip_while(is_comment);
        let names = lines.next().unwrap().to_owned();
        let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
        Self {
            head: text
                .lines()
                .take_while(is_comment)
                .map(str::to_owned)
                .collect(),
            names,
            rows: lines.map(row).collect(),
        }
    }

    fn of(process: &[&str], arguments: &[&str]) -> Self {
        Self::parse(&simulate(process, arguments))
    }

    /// A number of the head by its name.
    fn truth(&self, name: &str) -> f64 {
        let words: Vec<&str> = self
            .head
            .iter()
            .flat_map(|line| line.split([' ', ',']))
            .collect();
        let at = words.iter().position(|word| *word == name);
        let value = words[at.unwrap_or_else(|| panic!("no {name} in {:?}", self.head)) + 1];
        value.parse().unwrap()
    }

    fn column(&self, index: usize) -> Vec<f64> {
        self.rows.iter().map(|row| row[index]).collect()
    }
}

// A step of 3 after 10 s: 2 * 3 (1 - e^(-(t - 15) / 30)) after the dead time.
#[test]
fn a_step_of_a_first_order_process() {
    let arguments = [
        "--excitation",
        "step",
        "--amplitude",
        "3",
        "--preroll",
        "10",
    ];
    let size = ["--duration", "100", "--sample-rate", "2"];
    let step = Simulated::of(&TANK, &[&arguments[..], &size].concat());
    assert_eq!(step.names, "time_s,output,input");
    assert_eq!(step.rows.len(), 200);
    for row in &step.rows {
        let since_s = (row[0] - 15.0).max(0.0);
        let expected = 6.0 * (1.0 - (-since_s / 30.0).exp());
        assert!((row[1] - expected).abs() < 1e-12, "{row:?} {expected}");
        assert_eq!(row[2], if row[0] >= 10.0 { 3.0 } else { 0.0 });
    }
}

/// Parameters of every structure, as options and as names in the head.
const STRUCTURES: [(&str, &str, &str); 9] = [
    (
        "soiptd",
        "--k 2 --t-prop 0.1 --t-body 3 --tau 0.05",
        "k 2,k_over_t_body 0.6666666666666666,t_prop_s 0.1,t_body_s 3,tau_s 0.05",
    ),
    (
        "toiptd",
        "--k 2 --t-prop 0.1 --t-prop2 0.02 --t-body 3 --tau 0.05",
        "k 2,t_prop_s 0.1,t_prop2_s 0.02,t_body_s 3,tau_s 0.05",
    ),
    ("iptd", "--k 2 --tau 0.05", "k 2,tau_s 0.05"),
    (
        "integrator-lag",
        "--k 2 --t-prop 0.1 --tau 0.05",
        "k 2,t_prop_s 0.1,tau_s 0.05",
    ),
    (
        "double_integrator_lag",
        "--k-over-t-body 2 --t-prop 0.1 --tau 0.05",
        "k_over_t_body 2,t_prop_s 0.1,tau_s 0.05",
    ),
    (
        "foptd",
        "--k 2 --t-body 4 --tau 0",
        "k 2,k_over_t_body 0.5,t_body_s 4,tau_s 0",
    ),
    (
        "soptd",
        "--k-over-t-body 2 --t-prop 0.1 --t-body 4 --tau 0",
        "k 8,k_over_t_body 2,t_prop_s 0.1,t_body_s 4,tau_s 0",
    ),
    (
        "resonant",
        "--k 2 --natural-frequency 4 --zeta 0.25 --tau 0",
        "k 2,natural_frequency_rad_per_s 4,zeta 0.25,tau_s 0",
    ),
    (
        "resonant_lag",
        "--k 2 --natural-frequency 4 --zeta 0.25 --t-prop 0.1 --tau 0",
        "k 2,natural_frequency_rad_per_s 4,zeta 0.25,t_prop_s 0.1,tau_s 0",
    ),
];

#[test]
fn the_head_states_the_truth_of_every_structure() {
    for (name, options, truths) in STRUCTURES {
        let words: Vec<&str> = options.split(' ').collect();
        let arguments = [
            "--process",
            name,
            "--excitation",
            "doublet",
            "--pulse",
            "0.5",
        ];
        let doublet = Simulated::of(&[&arguments, &words[..]].concat(), &["--duration", "3"]);
        for truth in truths.split(',') {
            let (key, value) = truth.split_once(' ').unwrap();
            assert_eq!(
                doublet.truth(key),
                value.parse::<f64>().unwrap(),
                "{name} {key}"
            );
        }
        let structure = format!("structure {},", name.replace('-', "_"));
        let stated = doublet.head[1].contains(&structure);
        assert_eq!(stated, name != "soiptd", "{:?}", doublet.head);
        // The process moved, and by less than K times amplitude times duration.
        let largest = doublet
            .column(1)
            .into_iter()
            .fold(0.0, |a: f64, y| a.max(y.abs()));
        assert!(largest > 1e-3 && largest < 24.0, "{name}: {largest}");
    }
}

// Levels of the input after the pre-roll of 0.1 s, at 1 kHz.
#[test]
fn test_signals_by_their_levels() {
    let input = |arguments: &[&str]| {
        let all = [arguments, &["--duration", "4.1", "--amplitude", "0.5"]].concat();
        let rows = Simulated::of(&ROLL, &all).rows;
        assert!(rows[..100].iter().all(|row| row[2] == 0.0), "{arguments:?}");
        rows[100..].iter().map(|row| row[2]).collect::<Vec<_>>()
    };
    let at =
        |input: &[f64], samples: &[usize]| samples.iter().map(|k| input[*k]).collect::<Vec<_>>();
    let doublet = input(&["--excitation", "doublet", "--pulse", "0.7"]);
    let edges = [0, 699, 700, 1399, 1400];
    assert_eq!(at(&doublet, &edges), [0.5, 0.5, -0.5, -0.5, 0.0]);
    let multistep = input(&["--excitation", "3-2-1-1", "--pulse", "0.5"]);
    let edges = [1499, 1500, 2499, 2500, 2999, 3000, 3499, 3500];
    let expected = [0.5, -0.5, -0.5, 0.5, 0.5, -0.5, -0.5, 0.0];
    assert_eq!(at(&multistep, &edges), expected);
    // 40 bits fit into a period of 63; every bit lasts 100 samples.
    let prbs = input(&["--excitation", "prbs", "--pulse", "0.1"]);
    for bit in prbs.chunks(100) {
        assert!(bit.iter().all(|u| *u == bit[0] && u.abs() == 0.5));
    }
    let runs = prbs.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!((12..28).contains(&runs), "{runs}");
    // From 1 to 8 Hz in 4 s: 4 * 7 / ln 8 = 13.5 cycles, 27 zero crossings with that at the start.
    let chirp = input(&["--excitation", "chirp", "--band", "1,8"]);
    let crossings = chirp
        .windows(2)
        .filter(|pair| (pair[0] >= 0.0) != (pair[1] >= 0.0))
        .count();
    assert!((26..=27).contains(&crossings), "{crossings}");
    assert!(chirp.iter().all(|u| u.abs() <= 0.5));
    // 1, 2 and 4 Hz over four periods: the power of one sine of amplitude 0.5.
    let multisine = input(&["--excitation", "multisine", "--band", "1,4", "--sines", "3"]);
    let power = multisine.iter().map(|u| u * u).sum::<f64>() / multisine.len() as f64;
    assert!((power - 0.125).abs() < 1e-9, "{power}");
}

// In the loop the input is the controller's; the fourth column is its set-point.
#[test]
fn a_loop_has_a_setpoint() {
    let chirp = [
        "--excitation",
        "chirp",
        "--band",
        "0.5,5",
        "--amplitude",
        "0.2",
        "--duration",
        "10",
        "--loop",
        "0.5,0.1",
        "--reference",
        "1",
    ];
    let inside = Simulated::of(&ROLL, &chirp);
    assert_eq!(inside.names, "time_s,process_output,process_input,setpoint");
    assert!(inside.column(3).iter().all(|setpoint| *setpoint == 1.0));
    assert_eq!(inside.truth("filter_s"), 0.1 * 0.1 / 0.5);
    let at_setpoint = Simulated::of(&ROLL, &[&chirp[..], &["--inject", "setpoint"]].concat());
    let setpoint = at_setpoint.column(3);
    let (low, high) = (setpoint.iter()).fold((1.0, 1.0), |(low, high): (f64, f64), r| {
        (low.min(*r), high.max(*r))
    });
    assert!(
        (0.79..0.81).contains(&low) && (1.19..1.21).contains(&high),
        "{low} {high}"
    );
    // The loop holds the output near the reference.
    for simulated in [&inside, &at_setpoint] {
        assert!(simulated.column(1).iter().all(|y| (y - 1.0).abs() < 0.6));
    }
    // Without a test signal at the input, u = KP (r - y) at the first sample, where the derivative is zero.
    assert_eq!(inside.rows[0][2], 0.0);
}

// `input` and `output` beside a set-point may be those of a controller: the file says that they are the process's.
#[test]
fn a_closed_loop_is_identified_from_its_own_file() {
    let process = [
        "--k", "1", "--t-body", "2", "--t-prop", "0.2", "--tau", "0.1",
    ];
    let test = [
        "--excitation",
        "prbs",
        "--pulse",
        "1",
        "--amplitude",
        "0.2",
        "--duration",
        "60",
        "--sample-rate",
        "50",
        "--loop",
        "0.5,0.1",
        "--inject",
        "setpoint",
    ];
    let report = identify(simulate(&process, &test), &[]).identified();
    assert_eq!(report.0["columns"]["input"]["name"], "process_input");
    let gain = report.0["process"]["k"]["estimate"].as_f64().unwrap();
    assert!((gain - 1.0).abs() < 0.05, "{gain}");
}

// A relay beside a controller, on a process without integrator.
#[test]
fn a_relay_on_other_structures_and_in_a_loop() {
    let open = Simulated::of(
        &TANK,
        &[
            "--duration",
            "300",
            "--sample-rate",
            "10",
            "--bare",
            "--no-trim",
        ],
    );
    let switches = |simulated: &Simulated| {
        simulated
            .column(2)
            .windows(2)
            .filter(|pair| pair[0] * pair[1] < 0.0)
            .count()
    };
    assert!(switches(&open) > 10, "{}", switches(&open));
    assert!(open.column(1).iter().all(|y| y.abs() < 2.0));
    let looped = ["--duration", "3", "--loop", "0.5,0.1", "--amplitude", "0.2"];
    let closed = Simulated::of(&ROLL, &looped);
    assert!(switches(&closed) > 5, "{}", switches(&closed));
}

// A relay holds 2/(s - 1) behind 0.1 s. Only who knows that it is unstable gets a model; it and its controller are one beside tune's.
#[test]
fn an_unstable_process_is_identified_by_those_who_know_it() {
    let process = ["--process", "foptd,K=-2,T=-1,tau=0.1"];
    let test = ["--duration", "20", "--sample-rate", "50", "--noise", "1%"];
    let csv = simulate(&process, &test);
    let refused = identify(&csv, &[]).no_process("not_this_process");
    let message = refused.0["verdict"]["message"].as_str().unwrap();
    assert!(
        message.contains("unstable without its controller"),
        "{message}"
    );
    assert!(
        refused.advice().contains("--unstable"),
        "{}",
        refused.advice()
    );
    let found = identify(&csv, &["--unstable"]).report();
    assert_eq!(found.kind(), "identified");
    found
        .near("k", -2.0, 0.05)
        .near("t_body_s", -1.0, 0.05)
        .near("tau_s", 0.1, 0.1);
    assert_eq!(found.0["structure"], "foptd");
    found.remarked(&["grows by itself", "1.0"]);
    let known = tune(&process, &[]);
    let gain = found.number("/controller/kp");
    assert!(
        (gain / known.number("/controller/kp") - 1.0).abs() < 0.5,
        "{gain}"
    );
    // Nothing grows in a relay test of a stable one.
    let stable = simulate(&["--process", "foptd,K=2,T=1,tau=0.1"], &test);
    identify(&stable, &["--unstable"]).no_process("not_this_process");
    identify(&csv, &["--unstable", "--structure", "soiptd"]).misused(&[
        "--unstable",
        "foptd",
        "soptd",
    ]);
    identify(&csv, &["--unstable", "--cycles", "4"]).misused(&["--unstable", "--cycles"]);
}

// 3,000 rows, of which 5 % are dropped (150, standard deviation 12) and 10 % of the others have an outlier of exactly 0.3
// (285, standard deviation 16).
#[test]
fn drop_outs_and_outliers_have_their_shares() {
    let chirp = [
        "--excitation",
        "chirp",
        "--band",
        "0.5,5",
        "--duration",
        "3",
    ];
    let clean = Simulated::of(&ROLL, &chirp).rows;
    let spoilt = [&chirp[..], &["--drop-outs", "5%", "--outliers", "10%,0.3"]].concat();
    let spoilt = Simulated::of(&ROLL, &spoilt);
    assert_eq!(spoilt.truth("drop_out_share"), 0.05);
    let dropped = clean.len() - spoilt.rows.len();
    assert!((114..=186).contains(&dropped), "{dropped}");
    let mut outliers = 0;
    for row in &spoilt.rows {
        let k = (row[0] * 1000.0).round() as usize;
        assert_eq!((row[0], row[2]), (clean[k][0], clean[k][2]));
        let error = (row[1] - clean[k][1]).abs();
        assert!(error < 1e-12 || (error - 0.3).abs() < 1e-9, "{error}");
        outliers += usize::from(error > 0.1);
    }
    assert!((237..=333).contains(&outliers), "{outliers}");
}

// Noise 0.01 at 100 Hz, w1 = 3, w0 = 2, wy = 5, gain 40, two states behind the lag: 0.001 * 27 / 40, 0.001 * 4 / 40 and
// 0.001 * 5.
#[test]
fn disturbances_relative_to_the_noise() {
    let arguments = [
        "--excitation",
        "step",
        "--duration",
        "2",
        "--sample-rate",
        "100",
        "--noise",
        "0.01",
        "--disturbance",
        "w1=3,w0=2,wy=5",
    ];
    let simulated = Simulated::of(&ROLL, &arguments);
    for (name, expected) in [
        ("input_walk", 0.001 * 27.0 / 40.0),
        ("input_white", 0.001 * 4.0 / 40.0),
        ("output_walk", 0.005),
        ("w1_rad_per_s", 3.0),
        ("w0_rad_per_s", 2.0),
        ("wy_rad_per_s", 5.0),
    ] {
        assert!(
            (simulated.truth(name) / expected - 1.0).abs() < 1e-12,
            "{name}"
        );
    }
}

// A percentage of the noise-free amplitude: half the span of the step response, 3 (1 - e^-2.85) / 2 = 1.41327 for
// 100 s - 0.5 s - 14.5 s. The input disturbances take percentages of the amplitude of 3.
#[test]
fn percentages_of_amplitudes() {
    let arguments = [
        "--excitation",
        "step",
        "--amplitude",
        "1.5",
        "--preroll",
        "9.5",
        "--duration",
        "100.5",
        "--sample-rate",
        "2",
        "--noise",
        "10%",
        "--outliers",
        "0%",
        "--gust",
        "20%,3",
        "--disturbance",
        "walk=10%,output-walk=1%",
    ];
    let simulated = Simulated::of(&TANK, &arguments);
    let amplitude = 1.5 * (1.0 - (-85.5_f64 / 30.0).exp());
    assert!((simulated.truth("noise_sigma") / (0.1 * amplitude) - 1.0).abs() < 1e-12);
    assert!((simulated.truth("output_walk") / (0.01 * amplitude) - 1.0).abs() < 1e-12);
    assert!((simulated.truth("gust_sigma") - 0.3).abs() < 1e-15);
    assert!((simulated.truth("input_walk") - 0.15).abs() < 1e-15);
    assert_eq!(simulated.truth("gust_correlation_s"), 3.0);
}

#[test]
fn the_same_seed_gives_the_same_bytes_with_everything() {
    let seeded = |seed| {
        let arguments = [
            "--excitation",
            "prbs",
            "--pulse",
            "0.1",
            "--duration",
            "3",
            "--loop",
            "0.5,0.1,0.02",
            "--noise",
            "1%",
            "--quantum",
            "0.1%",
            "--jitter",
            "2%",
            "--gust",
            "5%,0.5",
            "--disturbance",
            "walk=1%,white=1%,output-walk=1%",
            "--drop-outs",
            "1%",
            "--outliers",
            "1%",
            "--bias",
            "10%",
            "--offset",
            "10%",
            "--seed",
            seed,
        ];
        simulate(&ROLL, &arguments)
    };
    assert!(seeded("3") == seeded("3"), "the same seed gave other bytes");
    assert!(
        seeded("3") != seeded("4"),
        "another seed gave the same bytes"
    );
}

#[test]
fn processes_with_wrong_parameters() {
    let with = |arguments: &str| {
        let words: Vec<&str> = arguments.split(' ').collect();
        run(&[&["simulate", "--duration", "3"], &words[..]].concat())
    };
    with("--process nosuch --k 1").misused(&["--process", "nosuch", "foptd", "resonant_lag"]);
    with("--process foptd --k 2 --t-body 30").misused(&["foptd", "needs --tau"]);
    with("--process foptd --t-body 30 --tau 5")
        .misused(&["needs its gain", "--k or --k-over-t-body"]);
    with("--process foptd --k 2 --t-body 30 --tau 5 --t-prop 1").misused(&[
        "--t-prop",
        "not a parameter",
        "foptd",
    ]);
    with("--process iptd --k-over-t-body 2 --tau 5").misused(&[
        "--k-over-t-body",
        "not a parameter",
        "iptd",
    ]);
    with("--process foptd --k 2 --t-body 0 --tau 5").misused(&["T_body", "unstable", "0"]);
    with("--process toiptd --k 2 --t-body -30 --t-prop 1 --t-prop2 1 --tau 5")
        .misused(&["T_body", "positive", "-30"]);
    with("--process foptd --k 2 --t-body inf --tau 5").misused(&["K/T_body"]);
    with("--process resonant --k 2 --natural-frequency 0 --zeta 1 --tau 0")
        .misused(&["w0", "positive", "0"]);
    with("--k 2 --t-body 30 --tau 5").misused(&["soiptd", "needs --t-prop"]);
}

#[test]
fn options_that_do_not_go_together() {
    let with = |arguments: &str| {
        let words: Vec<&str> = arguments.split(' ').collect();
        run(&[&["simulate"], &ROLL[..], &words[..]].concat())
    };
    with("--excitation step").misused(&["--duration"]);
    with("--excitation triangle").misused(&["--excitation", "triangle"]);
    with("--excitation chirp --duration 3").misused(&["chirp", "needs --band"]);
    with("--excitation chirp --duration 3 --band 5,1").misused(&["--band", "5,1", "rising"]);
    with("--excitation chirp --duration 3 --band 1,800").misused(&[
        "--band",
        "800",
        "--sample-rate",
    ]);
    with("--excitation prbs --duration 3").misused(&["prbs", "needs --pulse"]);
    with("--excitation prbs --duration 3 --pulse 1e-6").misused(&["--pulse", "--sample-rate"]);
    with("--excitation prbs --duration 3 --pulse -1").misused(&["pulse", "--sample-rate"]);
    with("--excitation step --duration 3 --pulse 1").misused(&["--pulse", "no effect", "step"]);
    with("--pulse 1").misused(&["--pulse", "no effect", "relay"]);
    with("--excitation chirp --duration 3 --band 1,8 --sines 5").misused(&["--sines", "no effect"]);
    with("--excitation step --duration 3 --bare").misused(&["--bare", "no effect"]);
    with("--excitation step --duration 3 --reference 1").misused(&["--reference", "--loop"]);
    with("--excitation step --duration 3 --preroll 3").misused(&["--duration", "--preroll"]);
    with("--excitation step --duration 3 --loop 1").misused(&["--loop", "KP,KD"]);
    with("--excitation step --duration 3 --loop 1,-1").misused(&["--loop", "same sign"]);
    with("--excitation step --duration 3 --gust 1").misused(&["--gust", "correlation time"]);
    with("--excitation step --duration 3 --gust 1,0").misused(&["--gust", "positive"]);
    with("--excitation step --duration 3 --disturbance w1=3").misused(&["w1", "--noise"]);
    with("--excitation step --duration 3 --disturbance wind=3").misused(&["wind", "output-walk"]);
    with("--excitation step --duration 3 --disturbance walk=-1")
        .misused(&["walk", "zero or positive"]);
    with("--excitation step --duration 3 --drop-outs 100%").misused(&["--drop-outs", "below 100%"]);
    with("--excitation step --duration 3 --outliers 200%").misused(&["--outliers", "below 100%"]);
    with("--excitation step --duration 3 --loop 1,1 --inject setpoint --bias 10%")
        .misused(&["--inject setpoint", "percentages"]);
    with("--excitation step --duration 3 --inject setpoint").misused(&["required"]);
    with("--excitation step --duration 1e6").misused(&["--duration", "samples"]);
}

// Twice as much as the loop tolerates; the file stays as it was and nothing is printed.
#[test]
fn an_unstable_loop_is_refused() {
    let folder = Scratch::new();
    let path = folder.write("out.csv", b"kept");
    let unstable = [
        &["simulate"],
        &ROLL[..],
        &[
            "--excitation",
            "step",
            "--duration",
            "60",
            "--loop",
            "50,10",
        ],
    ]
    .concat();
    run(&unstable).misused(&["unstable", "--loop"]);
    run(&[&unstable[..], &["--out", &path]].concat()).misused(&["unstable", "--loop"]);
    run(&[&unstable[..], &["--noise", "1%"]].concat()).misused(&["unstable", "--loop"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"kept");
    assert_eq!(folder.files(), ["out.csv"]);
}

// The Cramer-Rao bound holds the true values, and is half as wide in a test four times as long; without noise there is
// no answer.
#[test]
fn the_intervals_of_a_planned_test() {
    const TANK: &str = "simulate --process foptd --k 2 --t-body 30 --tau 5 --excitation prbs --pulse 15 \
                        --sample-rate 1 --expect";
    let plan = |more: &str| {
        run(&[TANK, more]
            .join(" ")
            .split_whitespace()
            .collect::<Vec<_>>())
    };
    let width = |duration: &str| {
        let text = plan(&format!("--noise 0.05 --duration {duration}")).stdout;
        let line = text
            .lines()
            .find(|line| line.trim_start().starts_with("tau"));
        let words = line.unwrap().split_whitespace();
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        let [tau, low, high] = numbers[..] else {
            panic!("{text}")
        };
        assert!(tau == 5.0 && low < 5.0 && high > 5.0, "{text}");
        high - low
    };
    let ratio = width("300") / width("1200");
    assert!((ratio - 2.0).abs() < 0.5, "{ratio}");
    plan("--duration 300").misused(&["--expect", "--noise"]);
    plan("--duration 300 --noise 0.05 --out x.csv").misused(&["--out"]);
}
