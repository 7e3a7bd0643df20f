//! One small file for each defect that the reader refuses, with the facts that its error states.

use onecycle_link::{CsvOptions, read_from};

#[track_caller]
fn assert_refused(text: &[u8], options: &CsvOptions, parts: &[&str]) {
    let fact = match read_from(text, options) {
        Err(error) => error.to_string(),
        Ok(recording) => format!("a recording of {} points", recording.len()),
    };
    for part in parts {
        assert!(fact.contains(part), "\"{part}\" is not in \"{fact}\"");
    }
    assert!(fact.len() < 400 && !fact.contains('\n'), "{fact}");
    // Flags and advice belong to the caller.
    assert!(!fact.contains("--"), "{fact}");
}

#[track_caller]
fn assert_plainly_refused(text: &str, parts: &[&str]) {
    assert_refused(text.as_bytes(), &CsvOptions::default(), parts);
}

/// A table of 100 good rows, one of which is replaced.
fn table_with(row: usize, text: &str) -> String {
    let good = |i: usize| format!("{},{i}.5,1\n", i as f64 / 10.0);
    let rows = (0..100).map(|i| {
        if i == row {
            format!("{text}\n")
        } else {
            good(i)
        }
    });
    std::iter::once("t,pv,u\n".to_owned()).chain(rows).collect()
}

#[test]
fn nothing_to_read() {
    assert_plainly_refused("", &["the file is empty"]);
    assert_plainly_refused("\n\n\n", &["no row of numbers", "3 lines"]);
    assert_plainly_refused("t,pv,u\n", &["no row of numbers", "1 line"]);
    assert_plainly_refused("# t,pv,u\n# a\n", &["no row of numbers"]);
    assert_plainly_refused("t,pv,u\n0,1,2\n", &["only 1 row", "at least 2"]);
    assert_plainly_refused("fn main() {\n    run();\n}\n", &["no row of numbers"]);
    assert_plainly_refused("t\n1\n2\n", &["line 2", "single column"]);
}

#[test]
fn not_text() {
    for (bytes, name) in [
        (&b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"[..], "PNG image"),
        (b"PK\x03\x04\x14\0\x06\0", "zip archive"),
        (b"\x1f\x8b\x08\0", "gzip archive"),
        (b"ULog\x01\x12\x35\x01", "PX4 ULog"),
        (b"\xa3\x95\x80\x80\x59FMT", "DataFlash log"),
        (b"t,pv,u\n0,1,2\n\0\0\0\0", "NUL bytes"),
    ] {
        assert_refused(bytes, &CsvOptions::default(), &["not a text table", name]);
    }
    // After the head that is examined first.
    let mut long: String = "t,pv,u\n".to_owned();
    for i in 0..100_000 {
        long += &format!("{i}.25,0.5,1\n");
    }
    assert!(long.len() > 1 << 20);
    long += "\0\0\0\n";
    assert_plainly_refused(&long, &["line 100002", "NUL byte"]);
}

#[test]
fn cells_that_are_not_numbers() {
    assert_plainly_refused(
        &table_with(40, "4,abc,1"),
        &["line 42", "\"pv\" (column 2)", "\"abc\""],
    );
    assert_plainly_refused(
        &table_with(40, "4,4,on"),
        &["line 42", "\"u\" (column 3)", "\"on\""],
    );
    assert_plainly_refused(
        &table_with(40, "x,4,1"),
        &["line 42", "\"t\" (column 1)", "\"x\""],
    );
    assert_plainly_refused(
        &table_with(40, "4,\"1,23.4\",1"),
        &["line 42", "\"1,23.4\" is not a number"],
    );
    assert_plainly_refused(
        &table_with(40, "4,\"1,234\",1"),
        &["line 42", "\"pv\"", "1,234", "mix decimal"],
    );
    assert_plainly_refused(&table_with(40, "t,pv,u"), &["line 42", "not a number"]);
    let long = "y".repeat(1000);
    assert_plainly_refused(
        &table_with(40, &format!("4,{long},1")),
        &["line 42", "yyy...\""],
    );
    assert_plainly_refused(&table_with(99, "9.9,abc,1"), &["line 101", "\"abc\""]);
}

#[test]
fn ragged_rows() {
    assert_plainly_refused(
        &table_with(40, "4,4"),
        &["line 42", "2 cells", "3 are expected"],
    );
    assert_plainly_refused(
        &table_with(40, "4,4,1,7"),
        &["line 42", "4 cells", "3 are expected"],
    );
    assert_plainly_refused(&table_with(99, "9.9,4,1,7"), &["line 101", "4 cells"]);
    assert_plainly_refused(
        "t,pv,u\n0,1,2,3\n1,1,2,3\n",
        &["line 2", "4 cells", "3 are expected"],
    );
    assert_plainly_refused("t,pv,u\n0,1,0,5\n0,2,1,5\n", &["line 2", "4 cells"]);
}

#[test]
fn open_quotes_and_endless_lines() {
    assert_plainly_refused(&table_with(40, "4,\"4,1"), &["line 42", "quote"]);
    let long = "1,".repeat(1 << 20);
    assert_plainly_refused(&long, &["line 1", "longer than"]);
}

#[test]
fn time_that_does_not_increase() {
    assert_plainly_refused(&table_with(40, "3.85,4,1"), &["line 42", "3.85", "3.9"]);
    let us = "time_us,pv,u\n1700000000000002,1,1\n1700000000000004,1,1\n1700000000000003,1,1\n";
    assert_plainly_refused(us, &["line 4", "1700000000000003 follows 1700000000000004"]);
    assert_plainly_refused(
        "t,pv,u\n5,1,1\n5,2,1\n5,3,1\n",
        &["time does not change", "3 rows"],
    );
    let coarse: String = (0..100).map(|i| format!("{},{i},1\n", i / 2)).collect();
    let parts = ["50 of 100 rows", "line 3", "at most 5 %"];
    assert_plainly_refused(&format!("t,pv,u\n{coarse}"), &parts);
}

#[test]
fn clock_times() {
    // Hours and minutes, or minutes and seconds?
    let parts = ["line 2", "\"time\" (column 1)", "12:00", "time of day"];
    assert_plainly_refused("time,pv,u\n12:00,1,1\n12:01,2,1\n", &parts);
    assert_plainly_refused(
        "time,pv,u\n2024-01-31,1,1\n",
        &["line 2", "2024-01-31", "time of day"],
    );
    assert_plainly_refused("12:00,1,1\n12:01,2,1\n", &["12:00"]);
}

#[test]
fn dates_that_are_not_time_stamps() {
    let dates = |second: &str| format!("time,pv,u\n01/02/2024 12:00:00,1,1\n{second},2,1\n");
    // Two days later, or two months.
    let parts = [
        "line 3",
        "\"time\" (column 1)",
        "03/04/2024",
        "the day and which the month",
    ];
    assert_plainly_refused(&dates("03/04/2024 12:00:00"), &parts);
    for other in [
        "2024-02-01 12:00:01",
        "01/32/2024 12:00:01",
        "13",
        "01/02/2024 99:00:01",
    ] {
        assert_plainly_refused(&dates(other), &["line 3", other]);
    }
    let back = [
        "time goes back on line 3",
        "01/02/2024 11:59:59 follows 01/02/2024 12:00:00",
    ];
    assert_plainly_refused(&dates("01/02/2024 11:59:59"), &back);
}

#[test]
fn too_many_missing() {
    let mut text = table_with(40, "4,nan,1");
    text = text.replace("5,50.5,1", "5,,1");
    let parts = ["2 of 100 rows", "no number in the output", "line 42", "1 %"];
    assert_plainly_refused(&text, &parts);
}

#[test]
fn absurd_numbers() {
    assert_plainly_refused(
        &table_with(40, "4,1e305,1"),
        &["line 42", "output", "1e305"],
    );
    assert_plainly_refused(
        &table_with(40, "4,4,-1e305"),
        &["line 42", "input", "-1e305"],
    );
    assert_plainly_refused(&table_with(99, "1e302,4,1"), &["line 101", "time", "1e302"]);
    // Near 1e18 neighbouring doubles are 128 apart, an eighth of the increment.
    let coarse: String = (0..100)
        .map(|i| format!("{:e},{i},1\n", 1e18 + 1024.0 * f64::from(i)))
        .collect();
    assert_plainly_refused(
        &format!("time_us,pv,u\n{coarse}"),
        &["cannot resolve", "1.023e-3 s"],
    );
}

#[test]
fn columns_that_are_not_there() {
    let text = b"t,a,b\n0,0.5,1\n1,1.5,1\n2,2,-1\n";
    let option = |name: &str| CsvOptions::default().output_column(name);
    let listed = "\"t\" (column 1), \"a\" (column 2), \"b\" (column 3)";
    assert_refused(
        text,
        &option("roll"),
        &["no column \"roll\" for the output", listed],
    );
    assert_refused(
        text,
        &option("4"),
        &["no column number 4 for the output", listed],
    );
    assert_refused(text, &option("0"), &["no column number 0"]);
    let same = option("a").input_column("2");
    assert_refused(
        text,
        &same,
        &["\"a\" (column 2)", "both the input and the output"],
    );
    assert_plainly_refused("a,b,c\n0,0,0\n1,1,1\n", &["the time", "\"c\" (column 3)"]);
    assert_plainly_refused("t,a,b,u\n0,0,0,1\n1,1,1,1\n", &["the output"]);
    assert_plainly_refused("t,pv,a,b\n0,0,0,1\n1,1,1,1\n", &["the input"]);
    assert_plainly_refused("pv,u\n0,0\n1,1\n", &["the time", "\"pv\" (column 1)"]);
    assert_plainly_refused("0,1\n1,1\n2,-1\n", &["the time", "column 1, column 2"]);
}

#[test]
fn columns_that_may_be_either() {
    let parts = ["\"y\" (column 2), \"pv\" (column 3)", "the output"];
    assert_plainly_refused("t,y,pv,u\n0,0,0,1\n1,1,1,1\n", &parts);
    assert_plainly_refused("t,time,pv,u\n0,0,0,1\n1,1,1,1\n", &["the time"]);
    let parts = ["column 2 and column 3", "which is the input"];
    assert_plainly_refused("0,0,0\n0.1,1,1\n0.2,0,1\n", &parts);
}

#[test]
fn sample_rates_that_are_not() {
    for rate_hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        let options = CsvOptions::default().sample_rate_hz(rate_hz);
        assert_refused(b"pv,u\n0,1\n1,1\n", &options, &["sample rate", "Hz"]);
    }
}
