//! Files that are not recordings, damaged files, and CSV dialects that work.

use std::io::Write;
use std::process::Stdio;

use crate::common::{
    AMBIGUOUS, HOVER, HOVER_K_OVER_T_BODY, Report, Sample, Scratch, Table, UNREADABLE, identify,
    identify_as_text, is_hover, program, run, run_with_input, simulate,
};

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
    let files: [(Vec<u8>, &str); 5] = [
        (noise.clone(), "binary data"),
        (with(b"\x89PNG\r\n\x1a\n"), "a PNG image"),
        (with(b"\x1f\x8b\x08\x00"), "a gzip archive"),
        (with(b"\x7fELF\x02\x01\x01"), "a program"),
        (with(b"PK\x03\x04"), "a zip archive"),
    ];
    for (bytes, looks_like) in files {
        identify(&bytes, &[]).refused(UNREADABLE, &[looks_like, "export the recording as CSV"]);
    }
    identify(b"{\"time\": 0}", &[])
        .refused(UNREADABLE, &["the JSON has no table", "one on each line"]);
    identify(b"{\"time\": [0,", &[])
        .refused(UNREADABLE, &["line 1 is no JSON: the file is cut off"]);
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

/// The lines of a table with some outputs replaced by another cell.
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

// The message contains the name of the column.
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
    report.noted(&["repeated a time stamp", "line 51"]);
    is_hover(&report, 0.02);
}

#[test]
fn many_duplicate_stamps() {
    let text = Table::clean().csv_of("time_s,pv,u", |sample| {
        (sample.time_s * 100.0).floor() / 100.0
    });
    let outcome = identify(&text, &[]);
    let wanted = [
        "repeat the time stamp",
        "line 3",
        "at most 5 %",
        "sample rate",
    ];
    outcome.refused(UNREADABLE, &wanted);
    // Following the advice works.
    let report = identify(&text, &["--sample-rate", "1000"]).identified();
    report.noted(&["did not read", "time_s", "1000 Hz"]);
    is_hover(&report, 0.01);
}

// Messages name options as the program spells them.
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
    let text = Table::clean().csv_of("time,pv,u", |sample| format!("12:{:02.0}", sample.time_s));
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
    let relay = ["--cycles", "8"];
    let report = identify(table.csv(), &relay).no_process("too_short");
    let message = report.0["verdict"]["message"].as_str().unwrap();
    assert!(message.contains("gaps"), "{message}");
    // One part without a gap is enough for the likelihood, and the remarks say which.
    let report = identify(table.csv(), &[]).identified();
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.01);
    let kinds = report.0["remark_kinds"].as_array().unwrap();
    assert!(kinds.contains(&"part_used".into()), "{kinds:?}");
}

#[test]
fn sample_jitter() {
    let text = simulate(&HOVER, &["--jitter", "2%", "--seed", "2"]);
    let report = identify(text, &[]).identified();
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.02);
    let text = simulate(&HOVER, &["--jitter", "25%", "--seed", "1"]);
    let report = identify(text, &[]).identified();
    report.noted(&["sample period varies"]);
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.02);
}

// ---------------------------------------------------------------- dialects that work

/// Asserts the same process, to the precision of the time stamps.
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
        // A step of 1 is 1 ms or 1 s, one of 1000 is 1 ms or 1 s: neither is taken, and the advice works.
        let text = table.csv_of("time,pv,u", whole(factor));
        let advice = format!("--time-unit {unit}");
        identify(&text, &[]).refused(AMBIGUOUS, &["gives no unit of time", &advice]);
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

// Slow, 5 to 30 s: ten million rows, 300 MB, through the standard input; steady cycles with increasing stamps. The whole
// recording in memory would take 240 MB, and each copy 80 MB.
#[test]
fn ten_million_samples_in_bounded_memory() {
    const ROWS: usize = 10_000_000;
    const MOST_KIB: &str = "524288";
    let table = Table::clean();
    let rises = table.rises();
    let cycles = &table.0[rises[10]..rises[16]];
    let tails: Vec<String> = cycles
        .iter()
        .map(|sample| format!(",{:?},{:?}\n", sample.output, sample.input))
        .collect();

    let mut command = if cfg!(target_os = "linux") {
        let mut limited = std::process::Command::new("sh");
        let script = format!("ulimit -v {MOST_KIB} && exec \"$0\" identify - --cycles 8 --json");
        limited.args(["-c", &script, env!("CARGO_BIN_EXE_onecycle")]);
        limited
    } else {
        let mut plain = program("identify");
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
    report.near("tau_s", crate::common::HOVER_TAU_S, 0.05);
    report.near("t_prop_s", crate::common::HOVER_T_PROP_S, 0.05);
}
