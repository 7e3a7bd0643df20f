//! One step test, for files in many layouts.

use onecycle_link::{CsvOptions, Recording, read_from};

/// Rows of the step test.
pub(super) const ROWS: u32 = 60;

/// Input and output at row `i`: a heater whose power steps at row 20, with odd digits.
pub(super) fn sample(i: u32) -> (f64, f64) {
    let since = f64::from(i.saturating_sub(20));
    let output = 25.0 + 40.0 * (1.0 - (-since / 15.0).exp());
    (
        if i < 20 { 10.0 } else { 50.0 },
        (output * 100.0).round() / 100.0,
    )
}

pub(super) fn rows(row: impl Fn(u32, f64, f64) -> String) -> String {
    let one = |i| {
        let (u, y) = sample(i);
        row(i, u, y) + "\n"
    };
    (0..ROWS).map(one).collect()
}

/// 08:00:00 and `i` seconds.
pub(super) fn clock(i: u32) -> String {
    format!("08:{:02}:{:02}", i / 60, i % 60)
}

pub(super) fn comma(value: f64) -> String {
    value.to_string().replace('.', ",")
}

pub(super) fn read(file: &[u8]) -> Recording {
    read_with(file, &CsvOptions::default())
}

#[track_caller]
pub(super) fn read_with(file: &[u8], options: &CsvOptions) -> Recording {
    read_from(file, options).expect("a recording")
}

#[track_caller]
pub(super) fn refusal(file: &[u8]) -> String {
    let error = read_from(file, &CsvOptions::default()).expect_err("a refusal");
    error.to_string()
}

/// Asserts that all rows are there, `period_s` apart; the input times `scale`.
#[track_caller]
pub(super) fn assert_rows(recording: &Recording, period_s: f64, scale: f64) {
    assert_eq!(recording.len(), ROWS as usize, "{:?}", recording.notes());
    let start_s = recording.time_s()[0];
    for i in 0..ROWS {
        let (input, output) = sample(i);
        let at = i as usize;
        assert_eq!(
            recording.output()[at],
            output,
            "row {i}: {:?}",
            recording.notes()
        );
        assert!(
            (recording.input()[at] - scale * input).abs() < 1e-9,
            "row {i}"
        );
        let time_s = recording.time_s()[at] - start_s;
        assert!(
            (time_s - period_s * f64::from(i)).abs() < 1e-6 * period_s,
            "row {i}: {time_s}"
        );
    }
}

#[track_caller]
pub(super) fn assert_names(recording: &Recording, input: &str, output: &str) {
    let notes = format!("{:?}", recording.notes());
    assert!(
        notes.contains(&format!("{input:?}")) && notes.contains(&format!("{output:?}")),
        "{notes}"
    );
}
