//! What people feed a program by mistake: each gets an exit code and one sentence, or works.

// Helpers of tests are tests too, which the lint does not see.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::Stdio;

use onecycle_onboard::{Relay, RelaySettings};

use common::{
    HOVER, HOVER_K_OVER_T_BODY, Outcome, Report, Sample, Scratch, Table, identify,
    identify_as_text, is_hover, names_in, onecycle, run, run_with_input, simulate,
};

/// Exit codes.
const UNREADABLE: i32 = 3;
const NOT_WRITTEN: i32 = 5;

// ---------------------------------------------------------------- files that are no recording

#[test]
fn a_missing_file() {
    let folder = Scratch::new();
    let path = folder.name("nosuch.csv");
    run(&["identify", &path]).refused(UNREADABLE, &["nosuch.csv", "cannot open", "No such file"]);
}

#[test]
fn a_file_is_named_once() {
    let folder = Scratch::new();
    for path in [folder.name("nosuch.csv"), folder.name("")] {
        let outcome = run(&["identify", &path]);
        assert_eq!(outcome.stderr.matches(&path).count(), 1, "{outcome:?}");
    }
}

#[test]
fn a_directory() {
    let folder = Scratch::new();
    run(&["identify", &folder.name("")]).refused(UNREADABLE, &["cannot open", "directory"]);
}

#[test]
fn an_empty_file() {
    let wanted = ["the file is empty", "time, output and input"];
    identify("", &[]).refused(UNREADABLE, &wanted);
    run_with_input(&["identify", "-"], b"").refused(UNREADABLE, &wanted);
    for blank in ["\u{feff}", "\n", "\r\n\r\n  \n"] {
        identify(blank, &[]).refused(UNREADABLE, &[]);
    }
}

#[test]
fn a_header_only() {
    for text in ["time_s,pv,u\n", "time_s,pv,u", "# a comment\ntime_s,pv,u\n"] {
        identify(text, &[]).refused(UNREADABLE, &["no row of numbers", "expected rows of time"]);
    }
}

#[test]
fn a_single_row_and_a_single_column() {
    identify("time_s,pv,u\n0,1,2\n", &[]).refused(UNREADABLE, &["only 1 row", "at least 2"]);
    identify("1\n2\n3\n", &[]).refused(UNREADABLE, &["line 1", "single column", "separate"]);
}

#[test]
fn binary_files() {
    let mut seed = 1_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1);
        (seed >> 56) as u8
    };
    let noise: Vec<u8> = (0..50_000).map(|_| random()).collect();
    let with = |magic: &[u8]| [magic, &noise].concat();
    let files: [(Vec<u8>, &str); 6] = [
        (noise.clone(), "binary data"),
        (with(b"\x89PNG\r\n\x1a\n"), "a PNG image"),
        (with(b"\x1f\x8b\x08\x00"), "a gzip archive"),
        (with(b"\x7fELF\x02\x01\x01"), "a program"),
        (with(b"PK\x03\x04"), "a zip archive"),
        (b"{\"time\": [0, 1]}".to_vec(), "JSON"),
    ];
    for (bytes, looks_like) in files {
        identify(&bytes, &[]).refused(UNREADABLE, &[looks_like, "export the recording as CSV"]);
    }
}

#[test]
fn damage_in_the_middle() {
    let mut bytes = Table::clean().csv().into_bytes();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 4].copy_from_slice(&[0; 4]);
    identify(&bytes, &[]).refused(UNREADABLE, &["NUL"]);

    let mut lines: Vec<String> = Table::clean().csv().lines().map(str::to_owned).collect();
    lines[2000] = "2.0,l.5,1.0".to_owned();
    let wanted = ["line 2001", "\"pv\"", "l.5", "not a number", "correct it"];
    identify(lines.join("\n"), &[]).refused(UNREADABLE, &wanted);
}

// ---------------------------------------------------------------- cells and rows

/// The lines of a table, some of its outputs replaced by another cell.
fn with_cells(table: &Table, replace: impl Fn(usize) -> Option<&'static str>) -> String {
    let mut text = "time_s,pv,u\n".to_owned();
    for (index, sample) in table.0.iter().enumerate() {
        let output = replace(index).map_or(format!("{:?}", sample.output), str::to_owned);
        text += &format!("{:?},{output},{:?}\n", sample.time_s, sample.input);
    }
    text
}

#[test]
fn a_few_cells_without_a_number() {
    let text = with_cells(&Table::clean(), |index| match index {
        5000 => Some("NaN"),
        6000 => Some("inf"),
        6500 => Some("-Infinity"),
        7000 => Some(""),
        _ => None,
    });
    let report = identify(&text, &[]).identified();
    report.noted(&["dropped 4 rows", "output", "line 5002"]);
    is_hover(&report, 0.01);
    identify_as_text(&text, &[]).without_nan();
}

#[test]
fn many_cells_without_a_number() {
    let text = with_cells(&Table::clean(), |index| (index % 20 == 7).then_some("NaN"));
    let outcome = identify(text, &[]);
    let wanted = ["have no number", "line 9", "at most 1 %", "another column"];
    outcome.refused(UNREADABLE, &wanted);
}

// The reader calls it "the output" where every other sentence says "pv" (column 2).
#[test]
fn many_cells_without_a_number_name_the_column() {
    let text = with_cells(&Table::clean(), |index| (index % 20 == 7).then_some("NaN"));
    identify(text, &[]).refused(UNREADABLE, &["pv"]);
}

#[test]
fn a_ragged_row() {
    for row in ["4.0,0.001", "4.0,0.001,1.0,7.0"] {
        let mut lines: Vec<String> = Table::clean().csv().lines().map(str::to_owned).collect();
        lines[4000] = row.to_owned();
        let wanted = ["line 4001", "where 3 are expected", "correct the line"];
        identify(lines.join("\n"), &[]).refused(UNREADABLE, &wanted);
    }
}

#[test]
fn an_incomplete_last_line() {
    let text = Table::clean().csv();
    let lines = text.lines().count();
    let last_comma = text.rfind(',').unwrap();
    for cut in [last_comma, last_comma - 4, last_comma + 2] {
        let report = identify(&text[..cut], &[]).identified();
        report.noted(&["last line", "incomplete", &lines.to_string()]);
        is_hover(&report, 0.01);
    }
}

// ---------------------------------------------------------------- time

#[test]
fn time_that_goes_back() {
    let table = Table::clean().map(|index, sample| {
        if index >= 3000 {
            sample.time_s -= 1.0;
        }
    });
    let wanted = ["line 3002", "goes back", "keep one run and cut the rest"];
    identify(table.csv(), &[]).refused(UNREADABLE, &wanted);

    // Two runs in one file.
    let mut twice = Table::clean();
    twice.0.extend(Table::clean().0);
    let line = (twice.0.len() / 2 + 2).to_string();
    identify(twice.csv(), &[]).refused(UNREADABLE, &[&line, "keep one run"]);
}

#[test]
fn a_few_duplicate_stamps() {
    let table = Table::clean().map(|index, sample| {
        if index % 50 == 49 {
            sample.time_s = Table::clean().0[index - 1].time_s;
        }
    });
    let report = identify(table.csv(), &[]).identified();
    report.noted(&["repeated a stamp", "line 51"]);
    is_hover(&report, 0.02);
}

#[test]
fn many_duplicate_stamps() {
    let text = Table::clean().csv_of("time_s,pv,u", |sample| {
        (sample.time_s * 100.0).floor() / 100.0
    });
    let outcome = identify(&text, &[]);
    let wanted = ["repeat the stamp", "line 3", "at most 5 %", "sample rate"];
    outcome.refused(UNREADABLE, &wanted);
    // The advice works.
    let report = identify(&text, &["--sample-rate", "1000"]).identified();
    report.noted(&["did not read", "time_s", "1000 Hz"]);
    is_hover(&report, 0.01);
}

// Options are to be named as the program calls them.
#[test]
fn advice_names_options_of_the_program() {
    let coarse = Table::clean().csv_of("time_s,pv,u", |sample| sample.time_s.floor());
    identify(coarse, &[]).refused(UNREADABLE, &["--sample-rate"]);
    let unnamed = Table::clean().csv().replace("time_s,pv,u", "a,b,c");
    let outcome = identify(&unnamed, &[]);
    assert!(
        !outcome.stderr.contains("time_column"),
        "{}",
        outcome.stderr
    );
    outcome.refused(UNREADABLE, &["--time", "--sample-rate"]);
    let unknown_input = unnamed
        .replace("a,b,c", "t,b,c,d")
        .replace(".0\n", ".0,3.0\n");
    let outcome = identify(unknown_input, &[]);
    assert!(!outcome.stderr.contains("_column"), "{}", outcome.stderr);
}

#[test]
fn all_stamps_the_same() {
    let text = Table::clean().csv_of("time_s,pv,u", |_| 1.0);
    identify(text, &[]).refused(UNREADABLE, &["time does not change", "sample rate"]);
}

#[test]
fn a_time_of_day() {
    let text = Table::clean().csv_of("time,pv,u", |sample| {
        format!("12:30:{:06.3}", sample.time_s)
    });
    let text = text.replace('"', "");
    identify(text, &[]).refused(UNREADABLE, &["line 2", "time of day", "export seconds"]);
}

#[test]
fn a_hole_in_the_middle() {
    let mut table = Table::clean();
    table
        .0
        .retain(|sample| !(4.5..4.8).contains(&sample.time_s));
    let outcome = identify(table.csv(), &[]);
    let report = outcome.identified();
    report.noted(&["1 gap", "0.3"]);
    let start_s = report.number("/oscillation/start_s");
    let end_s = report.number("/oscillation/end_s");
    assert!(end_s <= 4.5 || start_s >= 4.79, "{start_s} .. {end_s}");
    is_hover(&report, 0.01);
}

#[test]
fn holes_in_every_cycle() {
    let mut table = Table::clean();
    table.0.retain(|sample| sample.time_s % 0.4 > 0.03);
    identify(table.csv(), &[]).no_process("too_short");
}

#[test]
fn sample_jitter() {
    for seed in ["1", "2", "3"] {
        let text = simulate(&HOVER, &["--jitter", "2%", "--seed", seed]);
        let report = identify(text, &[]).identified();
        report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.02);
    }
    let text = simulate(&HOVER, &["--jitter", "25%", "--seed", "1"]);
    let report = identify(text, &[]).identified();
    report.noted(&["increments of time vary"]);
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.02);
}

// ---------------------------------------------------------------- inputs that are no relay

#[test]
fn a_constant_input() {
    let table = Table::clean().map(|_, sample| sample.input = 0.5);
    let report = identify(table.csv(), &[]).no_process("no_relay");
    assert!(report.advice().contains("--input"));
}

#[test]
fn a_continuous_input() {
    let table = Table::clean().map(|_, sample| sample.input = (14.2 * sample.time_s).sin());
    let report = identify(table.csv(), &[]).no_process("no_relay");
    assert!(report.advice().contains("relay"));
}

#[test]
fn one_switch() {
    let table = Table::clean().map(|index, sample| {
        sample.input = if index < 3000 { 1.0 } else { -1.0 };
    });
    let report = identify(table.csv(), &[]).no_process("too_short");
    assert!(report.advice().contains("four cycles"));
}

#[test]
fn ten_samples() {
    let table = Table::clean();
    let rise = table.rises()[5];
    let short = Table(table.0[rise - 5..rise + 5].to_vec());
    identify(short.csv(), &[]).no_process("too_short");
    // A relay that switches at every other sample.
    let coarse = Table(table.0[..10].to_vec()).map(|index, sample| {
        sample.input = [1.0, 1.0, -1.0, -1.0][index % 4];
        sample.output = [0.0, 1.0, 0.0, -1.0][index % 4];
    });
    identify(coarse.csv(), &[]).no_process("too_short");
}

#[test]
fn swapped_columns() {
    let swapped = |header: &str| {
        Table::clean()
            .map(|_, sample| std::mem::swap(&mut sample.output, &mut sample.input))
            .csv_of(header, |sample| sample.time_s)
    };
    // Named wrongly: the advice, and it works.
    let report = identify(swapped("time_s,pv,u"), &[]).no_process("no_relay");
    assert!(report.advice().contains("Swap the columns"));
    let fixed = ["--input", "pv", "--output", "u"];
    is_hover(&identify(swapped("time_s,pv,u"), &fixed).identified(), 0.01);
    // Named rightly.
    is_hover(&identify(swapped("time_s,u,pv"), &[]).identified(), 0.01);
    // Options that name one column twice.
    let twice = ["--input", "u", "--output", "u"];
    identify(Table::clean().csv(), &twice).refused(UNREADABLE, &["\"u\"", "both"]);
}

#[test]
fn columns_without_names() {
    let bare = Table::parse(&simulate(&HOVER, &["--no-trim"]));
    let text = bare.csv_of("", |sample| sample.time_s);
    let other = bare
        .map(|_, sample| std::mem::swap(&mut sample.output, &mut sample.input))
        .csv_of("", |sample| sample.time_s);
    for text in [text, other] {
        let report = identify(text.trim_start(), &[]).identified();
        report.noted(&["by how few values the input takes"]);
        is_hover(&report, 0.01);
    }
    // A trim gives the input more values than its two levels: the columns must be chosen.
    let trimmed = Table::clean().csv_of("", |sample| sample.time_s);
    identify(trimmed.trim_start(), &[]).refused(UNREADABLE, &["column 2 and column 3", "choose"]);
    let report = identify(trimmed.trim_start(), &["--input", "3", "--output", "2"]).identified();
    is_hover(&report, 0.01);
}

// ---------------------------------------------------------------- recordings of something else

#[test]
fn a_clipped_output() {
    let most = Table::clean()
        .0
        .iter()
        .map(|sample| sample.output)
        .fold(0.0, f64::max);
    let limit = 0.6 * most;
    let both = Table::clean().map(|_, sample| sample.output = sample.output.clamp(-limit, limit));
    let report = identify(both.csv(), &[]).no_process("saturated");
    assert!(report.advice().contains("amplitude"));
    let one = Table::clean().map(|_, sample| sample.output = sample.output.min(limit));
    identify(one.csv(), &[]).no_process("saturated");
}

#[test]
fn two_cycles_only() {
    let table = Table::clean();
    let rises = table.rises();
    let cycles = |count: usize| {
        let [from, to] = [rises[8], rises[8 + count] + 80].map(|index| table.0[index].time_s);
        // From the last of the low level, so that the first rise is in.
        table.clone().between(from - 0.05, to)
    };
    let report = identify(cycles(2).csv(), &[]).identified();
    assert_eq!(report.number("/oscillation/cycles_used"), 2.0);
    report.remarked(&["Only 2 steady cycles"]);
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.05);
    let report = identify(cycles(1).csv(), &[]).no_process("too_short");
    let message = report.0["verdict"]["message"].as_str().unwrap();
    assert!(message.contains("1 complete cycle"), "{message}");
}

// Two cycles are enough for a process, so the sentence must not ask for three.
#[test]
fn too_short_tells_the_number_that_is_enough() {
    let table = Table::clean();
    let rises = table.rises();
    let one = Table(table.0[rises[8] - 50..rises[9] + 80].to_vec());
    let report = identify(one.csv(), &[]).no_process("too_short");
    let message = report.0["verdict"]["message"].as_str().unwrap();
    assert!(!message.contains("at least 3"), "{message}");
    assert!(!message.contains("1 complete cycles"), "{message}");
}

/// Deterministic numbers between -1 and 1.
fn chance() -> impl FnMut() -> f64 {
    let mut seed = 12345_u64;
    move || {
        seed = seed
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[test]
fn an_unsteady_oscillation() {
    let mut chance = chance();
    let mut samples = Vec::new();
    let (mut period_s, mut amplitude, mut time_s) = (0.4, 1.0, 0.0);
    for _ in 0..25 {
        let start_s: f64 = time_s;
        while time_s < start_s + period_s {
            let phase = TAU * (time_s - start_s) / period_s;
            samples.push(Sample {
                time_s,
                output: -amplitude * (phase - 0.8).sin(),
                input: if phase < 0.5 * TAU { 1.0 } else { -1.0 },
            });
            time_s = samples.len() as f64 * 1e-3;
        }
        period_s = (period_s * (1.0 + 0.5 * chance())).clamp(0.1, 2.0);
        amplitude = (amplitude * (1.0 + 0.5 * chance())).clamp(0.1, 10.0);
    }
    let report = identify(Table(samples).csv(), &[]).no_process("not_steady");
    assert!(report.advice().contains("settle"));
}

/// A relay test on any plant: the recorded output is `recorded` of the plant's.
fn relay_test(
    mut plant: impl FnMut(f64) -> (f64, f64),
    controlled: fn((f64, f64)) -> f64,
) -> Table {
    let settings = RelaySettings {
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
    };
    let mut relay = Relay::new(settings).expect("the settings are usual");
    let mut state = (0.0, 0.0);
    let sample = |index: i32| {
        let input = f64::from(relay.step(-controlled(state) as f32, 1e-3));
        let output = state.1;
        state = plant(input);
        Sample {
            time_s: f64::from(index) * 1e-3,
            output,
            input,
        }
    };
    Table((0..12_000).map(sample).collect())
}

/// Two masses on a spring, behind an actuator and a delay: positions of the driven mass (0) and of
/// the other (1), as the plant of [`relay_test`], or as the mass that is measured.
struct TwoMasses {
    /// Force of the actuator, then position and velocity of each mass.
    state: [f64; 5],
    masses: [f64; 2],
    stiffness: f64,
    damping: f64,
    delay: VecDeque<f64>,
}

impl TwoMasses {
    const T_PROP_S: f64 = 0.032;
    const TAU_S: f64 = 0.024;
    const DRAG_PER_S: f64 = 0.6;
    const STEPS: usize = 10;

    fn new(ratio: f64, resonance_hz: f64, damping: f64) -> Self {
        let masses = [1.0 / (1.0 + ratio), ratio / (1.0 + ratio)];
        let omega = TAU * resonance_hz;
        let reduced = masses[0] * masses[1];
        Self {
            state: [0.0; 5],
            masses,
            stiffness: omega * omega * reduced,
            damping: 2.0 * damping * omega * reduced,
            delay: vec![0.0; (Self::TAU_S * 1e3) as usize * Self::STEPS].into(),
        }
    }

    fn rate(&self, state: &[f64; 5], input: f64) -> [f64; 5] {
        let [force, x1, v1, x2, v2] = *state;
        let [m1, m2] = self.masses;
        let spring = self.stiffness * (x1 - x2) + self.damping * (v1 - v2);
        [
            (input - force) / Self::T_PROP_S,
            v1,
            (force - spring) / m1 - Self::DRAG_PER_S * v1,
            v2,
            spring / m2 - Self::DRAG_PER_S * v2,
        ]
    }

    /// One sample of 1 ms by Runge-Kutta; the positions of the two masses.
    fn step(&mut self, input: f64) -> (f64, f64) {
        let h = 1e-3 / Self::STEPS as f64;
        let along = |s: &[f64; 5], k: &[f64; 5], h: f64| std::array::from_fn(|i| s[i] + h * k[i]);
        for _ in 0..Self::STEPS {
            self.delay.push_back(input);
            let arrived = self.delay.pop_front().unwrap_or(0.0);
            let s = self.state;
            let k1 = self.rate(&s, arrived);
            let k2 = self.rate(&along(&s, &k1, 0.5 * h), arrived);
            let k3 = self.rate(&along(&s, &k2, 0.5 * h), arrived);
            let k4 = self.rate(&along(&s, &k3, h), arrived);
            let mean: [f64; 5] =
                std::array::from_fn(|i| (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0);
            self.state = along(&s, &mean, h);
        }
        (self.state[1], self.state[3])
    }
}

fn driven_mass(mut plant: TwoMasses) -> Table {
    relay_test(
        move |input| {
            let (x1, _) = plant.step(input);
            (x1, x1)
        },
        |state| state.0,
    )
}

fn far_mass(mut plant: TwoMasses) -> Table {
    relay_test(move |input| plant.step(input), |state| state.1)
}

// A spring so stiff that it might as well be none checks the integration itself.
#[test]
fn a_stiff_spring_is_a_single_mass() {
    let report = identify(driven_mass(TwoMasses::new(0.1, 200.0, 0.1)).csv(), &[]).identified();
    report
        .near("k_over_t_body", 1.0, 0.02)
        .near("t_prop_s", TwoMasses::T_PROP_S, 0.05)
        .near("tau_s", TwoMasses::TAU_S, 0.05);
}

#[test]
fn a_resonance_near_the_oscillation() {
    for plant in [
        TwoMasses::new(1.0, 2.5, 0.02),
        TwoMasses::new(1.0, 2.5, 0.1),
        TwoMasses::new(0.3, 7.0, 0.02),
    ] {
        let report = identify(driven_mass(plant).csv(), &[]).no_process("not_this_process");
        assert!(report.advice().contains("resonance"));
    }
    identify(far_mass(TwoMasses::new(0.3, 1.0, 0.02)).csv(), &[]).no_process("not_this_process");
}

/// A resonance is refused, or the estimate still is that of the whole mass.
fn is_not_fooled(outcome: &Outcome) {
    let report = outcome.report();
    if report.kind() == "identified" {
        report.near("k_over_t_body", 1.0, 0.25);
    }
}

#[test]
fn a_resonance_of_the_driven_mass_does_not_fool() {
    is_not_fooled(&identify(
        driven_mass(TwoMasses::new(1.0, 10.0, 0.02)).csv(),
        &[],
    ));
}

#[test]
fn a_resonance_of_the_far_mass_does_not_fool() {
    is_not_fooled(&identify(
        far_mass(TwoMasses::new(0.3, 5.0, 0.02)).csv(),
        &[],
    ));
}

/// A recording of the velocity of a simulated process, by central differences.
fn velocity(table: &Table) -> Table {
    let samples = table.0.windows(3).map(|of| Sample {
        output: (of[2].output - of[0].output) / (of[2].time_s - of[0].time_s),
        ..of[1]
    });
    Table(samples.collect())
}

#[test]
fn a_velocity_instead_of_a_position() {
    let report = identify(velocity(&Table::clean()).csv(), &[]).report();
    let kinds = ["edge_of_domain", "not_this_process"];
    assert!(kinds.contains(&report.kind()), "{}", report.0);
    let advice = report.advice();
    assert!(
        advice.contains("rate") || advice.contains("process"),
        "{advice}"
    );
}

// What a report says of an angle is an angle, however little is known.
#[test]
fn a_phase_margin_is_an_angle() {
    let table = driven_mass(TwoMasses::new(1.0, 10.0, 0.02));
    let report = identify(table.csv(), &[]).report();
    let low = report.0.pointer("/margins/phase_margin_deg_interval/low");
    assert!(
        low.and_then(serde_json::Value::as_f64)
            .is_none_or(|low| low > -720.0),
        "{low:?}"
    );
    let text = identify_as_text(table.csv(), &[]).stdout;
    assert!(
        text.lines().all(|line| line.chars().count() < 130),
        "{text}"
    );
}

// ---------------------------------------------------------------- numbers of any size

/// The clean recording in other units.
fn scaled(time: f64, output: f64, input: f64) -> Outcome {
    let table = Table::clean().map(|_, sample| {
        sample.time_s *= time;
        sample.output *= output;
        sample.input *= input;
    });
    identify(table.csv(), &[])
}

#[test]
fn units_of_any_size() {
    for factor in [1e-6, 1e-3, 1e3, 1e6] {
        scaled(1.0, factor, 1.0).identified().near(
            "k_over_t_body",
            HOVER_K_OVER_T_BODY * factor,
            0.01,
        );
        scaled(1.0, 1.0, factor).identified().near(
            "k_over_t_body",
            HOVER_K_OVER_T_BODY / factor,
            0.01,
        );
        let slow = scaled(factor, 1.0, 1.0).identified();
        slow.near("k_over_t_body", HOVER_K_OVER_T_BODY / factor / factor, 0.01);
        slow.near("tau_s", common::HOVER_TAU_S * factor, 0.02);
    }
}

// Squares of these leave the range of numbers: a number, null for unbounded, or a refusal.
#[test]
fn units_beyond_reason() {
    for factor in [1e-300, 1e-150, 1e-30, 1e30, 1e150, 1e299] {
        for (output, input) in [(factor, 1.0), (1.0, factor), (factor, factor)] {
            ends_well(&scaled(1.0, output, input));
        }
    }
}

/// A process, a verdict or a refusal: nothing else.
fn ends_well(outcome: &Outcome) {
    match outcome.code {
        Some(0) => drop(outcome.identified()),
        Some(4) => drop(outcome.report()),
        _ => outcome.refused(UNREADABLE, &[]),
    }
}

#[test]
fn damaged_bytes_never_crash() {
    let table = Table::clean().between(1.0, 5.0);
    let text = table.csv().into_bytes();
    let mut chance = chance();
    for _ in 0..60 {
        let mut bytes = text.clone();
        for _ in 0..3 {
            let place = ((chance() + 1.0) / 2.0 * (bytes.len() - 1) as f64) as usize;
            let letters = b"0123456789.,;-+eE\n\r\t \"#naif\xff";
            let letter = ((chance() + 1.0) / 2.0 * (letters.len() - 1) as f64) as usize;
            bytes[place] = letters[letter];
        }
        ends_well(&identify(&bytes, &[]));
    }
}

// ---------------------------------------------------------------- arguments

#[test]
fn unusable_options_of_identify() {
    let file = Scratch::new();
    let path = file.write("clean.csv", Table::clean().csv().as_bytes());
    let with = |arguments: &[&str]| run(&[&["identify", path.as_str()], arguments].concat());
    with(&["--time", "nosuch"]).refused(UNREADABLE, &["nosuch", "time", "pv", "u"]);
    with(&["--input", "9"]).refused(UNREADABLE, &["number 9", "input", "pv"]);
    with(&["--output", "0"]).refused(UNREADABLE, &["number 0", "output", "pv"]);
    with(&["--cycles", "0"]).misused(&["--cycles", "0", "1..=50"]);
    with(&["--cycles", "51"]).misused(&["--cycles", "51", "1..=50"]);
    with(&["--cycles", "two"]).misused(&["--cycles", "two"]);
    with(&["--phase-margin", "95"]).misused(&["--phase-margin", "95", "between 0 and 90"]);
    with(&["--phase-margin", "nan"]).misused(&["--phase-margin", "between 0 and 90"]);
    with(&["--time-unit", "parsec"]).misused(&["--time-unit", "parsec", "ms, us or ns"]);
    with(&["--sample-rate", "fast"]).misused(&["--sample-rate", "fast"]);
    with(&["--sample-rate", "1000", "--time", "1"]).misused(&["--sample-rate", "--time"]);
    with(&["--nosuch"]).misused(&["--nosuch"]);
    run(&["identify"]).misused(&["required"]);
}

// A bad argument is 2, and the sentence says which.
#[test]
fn a_sample_rate_out_of_range() {
    let file = Scratch::new();
    let path = file.write("clean.csv", Table::clean().csv().as_bytes());
    for rate in ["--sample-rate=-5", "--sample-rate=0", "--sample-rate=nan"] {
        run(&["identify", &path, rate]).misused(&["sample", "rate"]);
    }
}

#[test]
fn negative_numbers_are_values_of_their_options() {
    let file = Scratch::new();
    let path = file.write("clean.csv", Table::clean().csv().as_bytes());
    run(&["identify", &path, "--sample-rate", "-5"]).misused(&["sample", "rate"]);
    let process = ["--k", "1", "--t-prop", "0.1", "--tau", "0.1"];
    run(&[&["tune"], &process[..], &["--t-body", "-1"]].concat()).misused(&["T_body", "-1"]);
    let body = ["--t-body", "1", "--duration", "-1"];
    run(&[&["simulate"], &process[..], &body].concat()).misused(&["--duration", "-1"]);
    let body = ["--t-body", "1", "--noise", "-1%"];
    run(&[&["simulate"], &process[..], &body].concat()).misused(&["--noise"]);
}

#[test]
fn impossible_simulations() {
    let with = |changes: &[(&str, &str)]| {
        let mut arguments = vec!["simulate".to_owned()];
        let process = [
            ("--k", "1"),
            ("--t-prop", "0.1"),
            ("--t-body", "1"),
            ("--tau", "0.05"),
        ];
        let is_changed = |name: &str| changes.iter().any(|(changed, _)| *changed == name);
        let kept = process.into_iter().filter(|(name, _)| !is_changed(name));
        arguments.extend(
            kept.chain(changes.iter().copied())
                .map(|(a, b)| format!("{a}={b}")),
        );
        run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    };
    with(&[("--t-prop", "0")]).misused(&["T_prop", "positive", "0"]);
    with(&[("--t-prop", "-1")]).misused(&["T_prop", "positive", "-1"]);
    with(&[("--t-body", "0")]).misused(&["T_body", "positive", "0"]);
    with(&[("--t-body", "-1")]).misused(&["T_body", "positive", "-1"]);
    with(&[("--t-body", "nan")]).misused(&["T_body", "positive"]);
    with(&[("--t-body", "inf")]).misused(&["--t-body", "--k-over-t-body"]);
    with(&[("--tau", "-0.1")]).misused(&["tau", "zero or", "-0.1"]);
    with(&[("--k", "0")]).misused(&["gain", "not zero"]);
    with(&[("--k", "one")]).misused(&["--k", "one"]);
    with(&[("--beta", "1.5")]).misused(&["beta", "between -1 and 1", "1.5"]);
    with(&[("--beta", "nan")]).misused(&["beta"]);
    with(&[("--amplitude", "0")]).misused(&["amplitude", "positive"]);
    with(&[("--duration", "0")]).misused(&["--duration", "positive", "0"]);
    with(&[("--duration", "1e300")]).misused(&["--duration", "--sample-rate"]);
    with(&[("--sample-rate", "0")]).misused(&["--sample-rate", "positive"]);
    with(&[("--sample-rate", "-5")]).misused(&["--sample-rate", "positive", "-5"]);
    with(&[("--noise", "-1%")]).misused(&["--noise", "zero or positive"]);
    with(&[("--noise", "loud")]).misused(&["--noise", "loud", "percentage"]);
    with(&[("--jitter", "inf")]).misused(&["--jitter", "inf"]);
    with(&[("--preroll", "nan")]).misused(&["pre-roll"]);
    with(&[("--seed", "-1")]).misused(&["--seed"]);
}

// The reference is an argument, and neither a recording nor a row.
#[test]
fn a_reference_that_is_no_number() {
    let reference = [&["simulate"], &HOVER[..], &["--reference", "nan"]].concat();
    run(&reference).misused(&["--reference"]);
}

#[test]
fn extreme_simulations_do_not_crash() {
    let process = |t_prop: &str, tau: &str, more: &[&str]| {
        let arguments = [
            "simulate", "--k", "1", "--t-body", "1", "--t-prop", t_prop, "--tau", tau,
        ];
        run(&[&arguments, more].concat())
    };
    // A delay of 1e10 samples.
    process("0.1", "1e7", &["--duration", "1"]).misused(&[]);
    // A period too short for a thousandth of it.
    process("1e-300", "0", &[]).misused(&[]);
}

#[test]
fn impossible_processes_for_tune() {
    let tune = |k: &str, t_prop: &str, t_body: &str, tau: &str| {
        let [k, t_prop] = [format!("--k={k}"), format!("--t-prop={t_prop}")];
        let [t_body, tau] = [format!("--t-body={t_body}"), format!("--tau={tau}")];
        run(&["tune", "--json", &k, &t_prop, &t_body, &tau])
    };
    tune("0", "0.3", "2", "0.1").misused(&["gain", "not zero"]);
    tune("nan", "0.3", "2", "0.1").misused(&["gain", "finite"]);
    tune("inf", "0.3", "2", "0.1").misused(&["gain", "finite"]);
    tune("1", "0", "2", "0.1").misused(&["T_prop", "positive"]);
    tune("1", "inf", "2", "0.1").misused(&["T_prop", "positive"]);
    tune("1", "0.3", "-2", "0.1").misused(&["T_body", "positive"]);
    tune("1", "0.3", "inf", "0.1").misused(&["--k-over-t-body"]);
    tune("1", "0.3", "2", "-0.1").misused(&["tau", "positive"]);
    tune("1", "0.3", "2", "nan").misused(&["tau", "positive"]);
    tune("1", "1e-300", "2", "1e-300").misused(&["too extreme"]);
    tune("1", "0.3", "1e300", "0.1").without_nan();
    tune("1", "1e9", "1e9", "1e9").without_nan();
    let both = [
        "tune",
        "--k",
        "1",
        "--k-over-t-body",
        "1",
        "--t-prop",
        "1",
        "--tau",
        "1",
    ];
    run(&both).misused(&["--k", "--k-over-t-body"]);
    run(&["tune", "--k", "1"]).misused(&["required"]);
    run(&[]).misused_without_command();
}

impl Outcome {
    /// Without a command the help is the answer, on the error output.
    fn misused_without_command(&self) {
        assert_eq!(self.code, Some(2));
        assert_eq!(self.stdout, "");
        assert!(self.stderr.contains("Usage: onecycle"), "{}", self.stderr);
    }
}

// ---------------------------------------------------------------- campaigns

fn campaign(text: &str) -> Outcome {
    let folder = Scratch::new();
    run(&["campaign", &folder.write("campaign.toml", text.as_bytes())])
}

/// A campaign of one case of no noise, and more lines.
fn campaign_with(lines: &str) -> Outcome {
    let head = "measure = \"identification\"\ncases = 1\nseed = 1\ntrim = true\n";
    campaign(&format!("{head}{lines}\n"))
}

#[test]
fn unreadable_campaigns() {
    let folder = Scratch::new();
    let missing = run(&["campaign", &folder.name("nosuch.toml")]);
    missing.refused(UNREADABLE, &["nosuch.toml", "No such file"]);
    run(&["campaign", &folder.name("")]).refused(UNREADABLE, &["directory"]);

    let names = |outcome: &Outcome, words: &[&str]| {
        assert_eq!(outcome.code, Some(UNREADABLE), "{outcome:?}");
        assert_eq!(outcome.stdout, "");
        for word in words {
            assert!(outcome.stderr.contains(word), "{word}: {}", outcome.stderr);
        }
    };
    names(&campaign("measure = \"relay\ncases = 1\n"), &["line 1"]);
    names(
        &campaign("measure = \"relay\"\n"),
        &["missing field `cases`"],
    );
    names(
        &campaign_with("bias = 0\nsigma = 0\nbogus = 3"),
        &["line 7", "unknown field `bogus`"],
    );
    names(
        &campaign_with("bias = \"much\"\nsigma = 0"),
        &["line 5", "much"],
    );
    names(
        &campaign("measure = \"luck\"\n"),
        &["line 1", "luck", "relay"],
    );
    names(
        &campaign_with("bias = 0\nsigma = 0\ncycles = -1"),
        &["line 7", "-1"],
    );
    names(&campaign("\u{0}\u{1}\u{2}"), &["line 1"]);
}

// Everything that goes wrong is one sentence, as for recordings.
#[test]
fn a_malformed_campaign_is_one_sentence() {
    campaign_with("bias = 0\nsigma = 0\nbogus = 3").refused(UNREADABLE, &["line 7", "`bogus`"]);
}

#[test]
fn a_campaign_without_cases() {
    let text = "measure = \"relay\"\ncases = 0\nseed = 1\nbias = 0\nsigma = 0\ntrim = true\n";
    campaign(text).refused(UNREADABLE, &["cases", "1 to"]);
}

// Numbers out of their range are refused, whatever TOML allows.
#[test]
fn campaigns_of_impossible_numbers() {
    for (line, field) in [
        ("bias = nan\nsigma = 0", "bias"),
        ("bias = inf\nsigma = 0", "bias"),
        ("bias = 0\nsigma = -1", "sigma"),
        ("bias = 0\nsigma = nan", "sigma"),
        ("bias = 0\nsigma = 0\noffset = nan", "offset"),
        ("bias = 0\nsigma = 0\ncycles = 0", "cycles"),
        ("bias = 0\nsigma = 0\ncycles = 100000", "cycles"),
    ] {
        let outcome = campaign_with(line);
        let is_refusal = [Some(2), Some(UNREADABLE)].contains(&outcome.code);
        assert!(
            is_refusal && outcome.stderr.contains(field),
            "{line}: {outcome:?}"
        );
    }
}

#[test]
fn a_campaign_that_identifies_nothing_has_no_nan() {
    let outcome = campaign_with("bias = 0.5\nsigma = 5");
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome.without_nan();
}

#[test]
fn a_campaign_without_a_steady_oscillation_has_no_nan() {
    let text = "measure = \"relay\"\ncases = 2\nseed = 1\nbias = 50\nsigma = 0.5\ntrim = true\n";
    let outcome = campaign(text);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome.without_nan();
}

// ---------------------------------------------------------------- outputs

#[test]
fn an_output_that_cannot_be_written() {
    let folder = Scratch::new();
    folder.write("file", b"kept");
    std::fs::create_dir(folder.path("folder")).unwrap();
    for target in ["nosuch/out.csv", "file/out.csv", "folder"] {
        let path = folder.name(target);
        let outcome = run(&[&["simulate"], &HOVER[..], &["--out", &path]].concat());
        outcome.refused(NOT_WRITTEN, &["cannot write", target]);
    }
    let mut left = folder.files();
    left.sort();
    assert_eq!(left, ["file", "folder"]);
    assert!(names_in(&folder.path("folder")).is_empty());
    assert_eq!(std::fs::read(folder.path("file")).unwrap(), b"kept");
}

#[test]
fn a_refused_simulation_leaves_the_file_as_it_was() {
    let folder = Scratch::new();
    let path = folder.write("out.csv", b"kept");
    run(&[
        &["simulate"],
        &HOVER[..],
        &["--out", &path, "--duration", "0"],
    ]
    .concat())
    .misused(&["--duration"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"kept");
    assert_eq!(folder.files(), ["out.csv"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk() {
    let full = || {
        std::fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap()
    };
    let output = onecycle()
        .arg("simulate")
        .args(HOVER)
        .stdout(full())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(NOT_WRITTEN));
    let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        sentence.contains("cannot write to the standard output"),
        "{sentence}"
    );
    assert_eq!(sentence.lines().count(), 1);
}

// As `onecycle simulate ... | head -1`.
#[test]
fn a_reader_that_stops_reading() {
    let mut command = onecycle();
    let simulate = command.arg("simulate").args(HOVER);
    let mut child = simulate
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut reader = BufReader::with_capacity(64, child.stdout.take().unwrap());
    reader.read_line(&mut line).unwrap();
    assert!(line.starts_with("# simulated relay test"), "{line}");
    drop(reader);
    let output = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}

// As `onecycle identify - | true`.
#[test]
fn a_reader_that_never_reads() {
    for arguments in [&["identify", "-"][..], &["identify", "-", "--json"]] {
        let mut command = onecycle();
        let identify = command.args(arguments).stdin(Stdio::piped());
        let mut child = identify
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let mut input = child.stdin.take().unwrap();
        input.write_all(Table::clean().csv().as_bytes()).unwrap();
        drop(input);
        let mut complaint = String::new();
        child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut complaint)
            .unwrap();
        assert_eq!(complaint, "");
        assert_eq!(child.wait().unwrap().code(), Some(0));
    }
}

// ---------------------------------------------------------------- dialects that work

/// Asserts the same process, to the last digit that the stamps allow.
fn same_process(report: &Report) {
    let plain = identify(Table::noisy().csv(), &[]).identified();
    for name in ["k_over_t_body", "t_prop_s", "tau_s"] {
        report.near(name, plain.estimate(name), 1e-6);
    }
}

#[test]
fn time_in_other_units() {
    let table = Table::noisy();
    let whole = |factor: f64| move |sample: &Sample| (sample.time_s * factor).round() as i64;
    for (header, factor, unit) in [
        ("time_ms,pv,u", 1e3, "ms"),
        ("time (ms),pv,u", 1e3, "ms"),
        ("t [us],pv,u", 1e6, "us"),
        ("TimeUS,pv,u", 1e6, "us"),
        ("timestamp_ns,pv,u", 1e9, "ns"),
    ] {
        let report = identify(table.csv_of(header, whole(factor)), &[]).identified();
        report.noted(&["time", &format!("in {unit}")]);
        same_process(&report);
    }
    for (factor, unit) in [(1e3, "ms"), (1e6, "us")] {
        // Guessed, and said so; and given.
        let text = table.csv_of("time,pv,u", whole(factor));
        let report = identify(&text, &[]).identified();
        report.noted(&["gives no unit", unit]);
        same_process(&report);
        same_process(&identify(&text, &["--time-unit", unit]).identified());
    }
}

#[test]
fn semicolons_and_decimal_commas() {
    let text = Table::noisy().csv().replace(',', ";").replace('.', ",");
    same_process(&identify(text, &[]).identified());
    let tabs = Table::noisy().csv().replace(',', "\t");
    same_process(&identify(tabs, &[]).identified());
    let blanks = Table::noisy().csv().replace(',', "   ");
    same_process(&identify(blanks, &[]).identified());
}

#[test]
fn marks_and_line_ends_of_windows() {
    let text = format!("\u{feff}{}", Table::noisy().csv()).replace('\n', "\r\n");
    same_process(&identify(&text, &[]).identified());
    for encode in [u16::to_le_bytes, u16::to_be_bytes] {
        let bytes: Vec<u8> = text.encode_utf16().flat_map(encode).collect();
        let report = identify(&bytes, &[]).identified();
        report.noted(&["UTF-16"]);
        same_process(&report);
    }
}

// ---------------------------------------------------------------- ten million samples

// SLOW, some 5 to 30 s: ten million rows, 300 MB, through the standard input; steady cycles with
// stamps that go on. Were the recording kept whole, it alone would take 240 MB and each copy 80.
#[test]
fn ten_million_samples_in_bounded_memory() {
    const ROWS: usize = 10_000_000;
    const MOST_KIB: &str = "524288";
    let table = Table::clean();
    let rises = table.rises();
    let cycles = &table.0[rises[6]..rises[16]];
    let tails: Vec<String> = cycles
        .iter()
        .map(|sample| format!(",{:?},{:?}\n", sample.output, sample.input))
        .collect();

    let mut command = if cfg!(target_os = "linux") {
        let mut limited = std::process::Command::new("sh");
        let script = format!("ulimit -v {MOST_KIB} && exec \"$0\" identify - --json");
        limited.args(["-c", &script, env!("CARGO_BIN_EXE_onecycle")]);
        limited
    } else {
        let mut plain = onecycle();
        plain.args(["identify", "-", "--json"]);
        plain
    };
    let piped = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = piped.spawn().unwrap();
    let mut rows = std::io::BufWriter::with_capacity(1 << 16, child.stdin.take().unwrap());
    rows.write_all(b"time_ms,pv,u\n").unwrap();
    for (row, tail) in tails.iter().cycle().take(ROWS).enumerate() {
        write!(rows, "{row}").unwrap();
        rows.write_all(tail.as_bytes()).unwrap();
    }
    rows.flush().unwrap();
    drop(rows);
    let output = child.wait_with_output().unwrap();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{complaint}");
    let report = Report(serde_json::from_slice(&output.stdout).unwrap());
    report.noted(&["averaged", "4 samples"]);
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.02);
    report.near("tau_s", common::HOVER_TAU_S, 0.05);
    report.near("t_prop_s", common::HOVER_T_PROP_S, 0.05);
}
