//! One small file for each dialect and each defect that the reader accepts.

use onecycle_link::{ColumnRef, CsvOptions, Note, ReadError, Recording, TimeUnit, read, read_from};

fn try_read(text: &[u8]) -> Result<Recording, ReadError> {
    read_from(text, &CsvOptions::default())
}

/// Asserts that the file holds the recording of most tests here.
#[track_caller]
fn assert_plain(text: &[u8]) -> Recording {
    let recording = try_read(text).expect("a recording");
    assert_eq!(recording.time_s(), [0.0, 0.5, 1.0]);
    assert_eq!(recording.output(), [0.25, -1.5, 2.0]);
    assert_eq!(recording.input(), [1.0, 1.0, -1.0]);
    assert_eq!(recording.samples_per_point(), 1);
    recording
}

fn notes(recording: &Recording) -> String {
    recording
        .notes()
        .iter()
        .map(|note| format!("{note}\n"))
        .collect()
}

#[test]
fn separators() {
    assert_plain(b"t,pv,u\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n");
    assert_plain(b"t;pv;u\n0;0.25;1\n0.5;-1.5;1\n1;2;-1\n");
    assert_plain(b"t\tpv\tu\n0\t0.25\t1\n0.5\t-1.5\t1\n1\t2\t-1\n");
    assert_plain(b"t|pv|u\n0|0.25|1\n0.5|-1.5|1\n1|2|-1\n");
    assert_plain(b"  t   pv  u\n  0.0  0.25   1\n  0.5 -1.50   1\n  1.0  2.00  -1\n");
    assert_plain(b"t,  pv,  u \n 0, 0.25, 1\n 0.5, -1.5, 1\n 1,\t2,\t-1\n");
}

#[test]
fn decimal_commas() {
    assert_plain(b"t;pv;u\n0;0,25;1\n0,5;-1,5;1\n1;2,0;-1\n");
    assert_plain(b"t\tpv\tu\n0\t0,25\t1\n0,5\t-1,5\t1\n1\t2,0\t-1\n");
    assert_plain(b"t,pv,u\n\"0\",\"0,25\",\"1\"\n\"0,5\",\"-1,5\",\"1\"\n\"1\",\"2,0\",\"-1\"\n");
}

#[test]
fn comments_and_blank_lines_anywhere() {
    assert_plain(
        b"# a, \"b\n\n% c\n// d\n; e\nt,pv,u\n\n0,0.25,1\n# f\n0.5,-1.5,1\n  # g\n1,2,-1\n\n\n",
    );
    assert_plain(b"# a; b\nt;pv;u\n0;0.25;1\n% c\n0.5;-1.5;1\n// d\n1;2;-1\n");
}

#[test]
fn line_endings_and_byte_order_marks() {
    let text = "t,pv,u\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n";
    assert_plain(text.replace('\n', "\r\n").as_bytes());
    assert_plain(text.replace('\n', "\r").as_bytes());
    assert_plain(text.trim_end().as_bytes());
    assert_plain(format!("\u{feff}{text}").as_bytes());
    assert_plain(format!("{text}\u{1a}").as_bytes());
    for (mark, bytes) in [
        ([0xff, 0xfe], u16::to_le_bytes as fn(u16) -> _),
        ([0xfe, 0xff], u16::to_be_bytes),
    ] {
        let wide: Vec<u8> = mark
            .into_iter()
            .chain(text.encode_utf16().flat_map(bytes))
            .collect();
        let recording = assert_plain(&wide);
        assert!(recording.notes().contains(&Note::Utf16));
    }
}

#[test]
fn numbers_in_any_form() {
    assert_plain(b"t,pv,u\n+0.0,2.5e-1,+1\n5E-1,-.15D+01,1.\n\"1\", 2e0 ,-1e0\n");
}

#[test]
fn separators_at_the_end_of_a_row() {
    assert_plain(b"t,pv,u,\n0,0.25,1,\n0.5,-1.5,1,\n1,2,-1,\n");
    assert_plain(b"t,pv,u\n0,0.25,1,\n0.5,-1.5,1,\n1,2,-1\n");
    assert_plain(b"t,pv,u,,\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n");
}

#[test]
fn columns_by_name_in_any_order() {
    let recording = assert_plain(b"Relay,mode,Time [s],setpoint,Measurement [rad]\n1,AUTO,0,0,0.25\n1,AUTO,0.5,0,-1.5\n-1,AUTO,1,0,2\n");
    assert_eq!(recording.columns().output.name, "Measurement");
    assert_eq!(recording.columns().output.unit.as_deref(), Some("rad"));
    assert!(notes(&recording).contains("input is \"Relay\" (column 1)"));
    // One signal and one column are left.
    assert_plain(b"t,roll,u\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n");
}

#[test]
fn columns_by_option() {
    let text = b"t,a,b\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n";
    let mut options = CsvOptions::default().input_column("B");
    assert_eq!(
        read_from(&text[..], &options).unwrap().input(),
        [1.0, 1.0, -1.0]
    );
    options.input_column = Some(ColumnRef::Number(2));
    assert_eq!(
        read_from(&text[..], &options).unwrap().input(),
        [0.25, -1.5, 2.0]
    );
    // An option chooses between two candidates.
    let text = b"t,y,pv,u\n0,0,0.25,1\n0.5,0,-1.5,1\n1,0,2,-1\n";
    let options = CsvOptions::default().output_column("pv");
    assert_eq!(
        read_from(&text[..], &options).unwrap().output(),
        [0.25, -1.5, 2.0]
    );
}

#[test]
fn without_header_the_relay_is_the_column_of_few_values() {
    let row = |i: u32| {
        let (y, u) = (
            f64::from(i * i % 97) / 10.0,
            if i % 10 < 5 { 0.5 } else { -0.5 },
        );
        (y, u)
    };
    for input_first in [false, true] {
        let text: String = (0..40)
            .map(|i| {
                let (y, u) = row(i);
                let (a, b) = if input_first { (u, y) } else { (y, u) };
                format!("{},{a},{b}\n", f64::from(i) / 100.0)
            })
            .collect();
        let recording = try_read(text.as_bytes()).unwrap();
        let (output, input): (Vec<f64>, Vec<f64>) = (0..40).map(row).unzip();
        assert_eq!(recording.input(), input);
        assert_eq!(recording.output(), output);
        assert!(notes(&recording).contains("found by how few values the input takes"));
        assert!(notes(&recording).contains("its time stamps were read in s"));
    }
}

#[test]
fn header_in_a_comment() {
    let recording = assert_plain(b"# run 7\n# t, pv [m], u\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n");
    assert_eq!(recording.columns().output.unit.as_deref(), Some("m"));
    assert!(
        recording
            .notes()
            .contains(&Note::HeaderInComment { line: 2 })
    );
    assert_plain(b"%time pv u\n0 0.25 1\n0.5 -1.5 1\n1 2 -1\n");
}

#[test]
fn lines_of_words_before_the_header() {
    let recording = assert_plain(b"sep=;\nDevice: rig 2\nt;pv;u\n0;0.25;1\n0.5;-1.5;1\n1;2;-1\n");
    assert!(recording.notes().contains(&Note::LinesSkipped { count: 2 }));
}

#[test]
fn a_line_of_dashes_under_the_header() {
    assert_plain(b"t|pv|u\n---\n0|0.25|1\n0.5|-1.5|1\n1|2|-1\n");
    // A header of names that could all be units is still a header.
    let text = b"s,v,a\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n";
    let options = CsvOptions::default()
        .time_column("s")
        .input_column("a")
        .output_column("v");
    assert_eq!(
        read_from(&text[..], &options).unwrap().output(),
        [0.25, -1.5, 2.0]
    );
}

#[test]
fn row_of_units() {
    let recording = assert_plain(b"time,pv,u\nms,rad,N\n0,0.25,1\n500,-1.5,1\n1000,2,-1\n");
    assert_eq!(recording.columns().time.unit.as_deref(), Some("ms"));
    assert_eq!(recording.columns().input.unit.as_deref(), Some("N"));
    assert_plain(b"time;pv;u\n(ms);(rad);()\n0;0.25;1\n500;-1.5;1\n1000;2;-1\n");
}

#[test]
fn units_of_time() {
    for header in [
        "time (ms)",
        "t[ms]",
        "time_ms",
        "t / ms",
        "TimeMS",
        "millis",
        "timestamp_ms",
    ] {
        let text = format!("{header},pv,u\n0,0.25,1\n500,-1.5,1\n1000,2,-1\n");
        let recording = assert_plain(text.as_bytes());
        assert!(
            recording.notes().contains(&Note::TimeUnit {
                unit: TimeUnit::Milliseconds
            }),
            "{header}"
        );
    }
    for header in ["time (\u{b5}s)", "TimeUS", "timestamp_us"] {
        let text = format!("{header},pv,u\n0,0.25,1\n500000,-1.5,1\n1000000,2,-1\n");
        assert_plain(text.as_bytes());
    }
    // Micro sign in Latin-1.
    assert_plain(b"time (\xb5s),pv,u\n0,0.25,1\n500000,-1.5,1\n1000000,2,-1\n");
    assert_plain(b"time [ns],pv,u\n0,0.25,1\n500000000,-1.5,1\n1000000000,2,-1\n");
    let text = b"t,pv,u\n0,0.25,1\n70,-1.5,1\n140,2,-1\n";
    assert!(notes(&try_read(text).unwrap()).contains("its time stamps were read in ms"));
    let text = b"t,pv,u\n0,0.25,1\n500,-1.5,1\n1000,2,-1\n";
    let options = CsvOptions::default().time_unit(TimeUnit::Minutes);
    assert_eq!(
        read_from(&text[..], &options).unwrap().time_s()[1],
        30_000.0
    );
}

/// Rows of these time stamps; the relay switches every ten rows.
fn table_of(stamps: impl Iterator<Item = String>) -> String {
    let row = |(i, stamp): (u32, String)| {
        let (y, u) = (
            f64::from(i * i % 97) / 10.0,
            if i % 20 < 10 { 1 } else { -1 },
        );
        format!("{stamp};{y};{u}\n")
    };
    std::iter::once("t;pv;u\n".to_owned())
        .chain((0..).zip(stamps).map(row))
        .collect()
}

// Neither 0, 1, 2 ... nor 0, 20, 40 ... nor 0, 1000, 2000 ... shows its unit. The caller settles it.
#[test]
fn a_unit_in_doubt_is_settled_by_the_caller() {
    for (step, units, usual) in [
        (
            1,
            [TimeUnit::Milliseconds, TimeUnit::Seconds],
            TimeUnit::Seconds,
        ),
        (
            20,
            [TimeUnit::Milliseconds, TimeUnit::Seconds],
            TimeUnit::Milliseconds,
        ),
        (
            1000,
            [TimeUnit::Microseconds, TimeUnit::Milliseconds],
            TimeUnit::Microseconds,
        ),
    ] {
        let text = table_of((0..100).map(|i| format!("{}", i * step)));
        match try_read(text.as_bytes()) {
            Err(ReadError::AmbiguousTime {
                possible,
                usual: found,
                ..
            }) => {
                assert_eq!((possible.as_slice(), found), (&units[..], Some(usual)));
            }
            other => panic!("{step}: {other:?}"),
        }
        for unit in units {
            let options = CsvOptions::default().time_unit(unit);
            let recording = read_from(text.as_bytes(), &options).unwrap();
            assert_eq!(recording.time_s()[3], unit.seconds(f64::from(3 * step)));
        }
    }
    // Any other fault is reported first.
    let text = table_of((0..100).map(|i| format!("{}", i / 2)));
    assert!(
        try_read(text.as_bytes())
            .unwrap_err()
            .to_string()
            .contains("repeat the time stamp")
    );
}

#[test]
fn days_of_a_spreadsheet() {
    // 2024-01-31 12:00:00 and every second from there, with the ten digits that Excel exports.
    let text = table_of((0..100).map(|i| format!("{:.10}", 45_322.5 + f64::from(i) / 86_400.0)));
    let recording = try_read(text.as_bytes()).unwrap();
    assert!(notes(&recording).contains("its time stamps were read in d"));
    assert!((recording.time_s()[99] - recording.time_s()[0] - 99.0).abs() < 1e-4);
    assert!((recording.sample_period_s() - 1.0).abs() < 1e-6);
}

// All forms of ten dates, 0.2 s apart, across midnight.
#[test]
fn dates() {
    type Form = fn(u32, u32, &str) -> String;
    let forms: [Form; 7] = [
        |_, day, time| format!("2024-02-{day:02}T{time}Z"),
        |_, day, time| format!("2024-02-{day:02} {time}+01:00"),
        |_, day, time| format!("{day}.2.2024 {}", time.replace('.', ",")),
        |_, day, time| format!("{day:02}/02/2024 {time}"),
        |_, day, time| format!("2/{day}/2024 {time}"),
        |_, day, time| format!("{day:02}-02-2024 {time}"),
        |i, _, time| {
            format!(
                "2024-03-01 {}:{}",
                if i < 5 { "11:59" } else { "12:00" },
                &time[6..]
            )
        },
    ];
    for (number, form) in forms.iter().enumerate() {
        let stamp = |i: u32| match i {
            0..5 => form(i, 8, &format!("23:59:59.{}", 2 * i)),
            _ => form(i, 9, &format!("00:00:00.{}", 2 * (i - 5))),
        };
        let text = table_of((0..10).map(stamp));
        let recording = try_read(text.as_bytes()).unwrap_or_else(|error| panic!("{text}{error}"));
        for (i, &time_s) in recording.time_s().iter().enumerate() {
            assert!(
                (time_s - 0.2 * i as f64).abs() < 1e-12,
                "form {number}, row {i}: {time_s}"
            );
        }
        assert!(notes(&recording).contains("time is counted from the first time stamp, "));
    }
    // A column of dates is the time, whatever its name.
    let text = "pv,when,u\n0,2024-01-31 12:00:00.0,1\n1,2024-01-31 12:00:00.5,1\n2,2024-01-31 12:00:01.0,1\n";
    assert_eq!(try_read(text.as_bytes()).unwrap().time_s(), [0.0, 0.5, 1.0]);
}

#[test]
fn stamps_since_1970() {
    let us = b"timestamp,pv,u\n1700000000123456,0.25,1\n1700000000623456,-1.5,1\n1700000001123456,2,-1\n";
    assert!(notes(&assert_plain(us)).contains("1700000000123456 us"));
    assert_plain(b"timestamp_ns,pv,u\n1700000000123456789,0.25,1\n1700000000623456789,-1.5,1\n1700000001123456789,2,-1\n");
    // 1.7e9 s resolves 2.4e-7 s; halves are exact.
    assert_plain(b"time,pv,u\n1700000000.5,0.25,1\n1700000001.0,-1.5,1\n1700000001.5,2,-1\n");
}

#[test]
fn sample_rate_instead_of_time() {
    let options = CsvOptions::default().sample_rate_hz(2.0);
    let without = read_from(&b"pv,u\n0.25,1\n-1.5,1\n2,-1\n"[..], &options).unwrap();
    assert_eq!(without.time_s(), [0.0, 0.5, 1.0]);
    assert_eq!(without.columns().time.name, "row");
    let with = read_from(&b"t,pv,u\n9,0.25,1\n9,-1.5,1\n9,2,-1\n"[..], &options).unwrap();
    assert_eq!(with.time_s(), [0.0, 0.5, 1.0]);
    assert!(notes(&with).contains("did not read \"t\" (column 1)"));
    let bare: String = (0..30)
        .map(|i| format!("{},{i},{}\n", 2 * i, i / 15))
        .collect();
    let bare = read_from(bare.as_bytes(), &options).unwrap();
    assert_eq!(
        (bare.time_s()[29], bare.output()[29], bare.input()[29]),
        (14.5, 29.0, 1.0)
    );
    assert!(notes(&bare).contains("did not read column 1"));
    // A dropped row still counts as a sample period.
    let rows: String = (0..200)
        .map(|i| {
            if i == 7 {
                "nan,1\n".into()
            } else {
                format!("{i},1\n")
            }
        })
        .collect();
    let dropped = read_from(format!("pv,u\n{rows}").as_bytes(), &options).unwrap();
    assert_eq!(dropped.len(), 199);
    assert_eq!(dropped.time_s()[7], 4.0);
}

#[test]
fn an_incomplete_last_line() {
    for end in [
        "1.5",
        "1.5,",
        "1.5,3",
        "1.5,3,-1e",
        "1.5,\"3",
        "-- end --\n",
    ] {
        let text = format!("t,pv,u\n0,0.25,1\n0.5,-1.5,1\n1,2,-1\n{end}");
        let recording = assert_plain(text.as_bytes());
        assert!(
            recording
                .notes()
                .contains(&Note::LastLineIncomplete { line: 5 }),
            "{end}"
        );
    }
}

#[test]
fn a_few_rows_without_numbers() {
    for missing in [
        "nan", "NaN", "NA", "null", "", "inf", "-inf", "1e999", "#N/A", "---", "****",
    ] {
        let mut text = String::from("t,pv,u\n");
        for i in 0..100 {
            let y = if i == 41 {
                missing.to_owned()
            } else {
                format!("{i}.5")
            };
            text += &format!("{},{y},1\n", f64::from(i) / 10.0);
        }
        let recording = try_read(text.as_bytes()).unwrap();
        assert_eq!(recording.len(), 99, "{missing}");
        let expected = "dropped 1 row whose output is not a number, the first at line 43";
        assert!(notes(&recording).contains(expected), "{missing}");
    }
}

#[test]
fn a_few_repeated_stamps() {
    let mut text = String::from("t,pv,u\n");
    for i in 0..100 {
        let t = f64::from(i - i32::from(i == 41)) / 10.0;
        text += &format!("{t},{i},1\n");
    }
    let recording = try_read(text.as_bytes()).unwrap();
    assert_eq!(recording.len(), 99);
    assert_eq!(recording.output()[40..42], [40.0, 42.0]);
    assert!(
        notes(&recording)
            .contains("dropped 1 row that repeated a time stamp, the first at line 43")
    );
}

#[test]
fn a_file_on_disk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    std::fs::write(&path, "t,pv,u\n0,0.25,1\n0.5,-1.5,1\n").unwrap();
    assert_eq!(read(&path, &CsvOptions::default()).unwrap().len(), 2);
    let folder_error = read(folder.path(), &CsvOptions::default())
        .unwrap_err()
        .to_string();
    assert!(folder_error.starts_with("cannot open"), "{folder_error}");
    let missing = read(folder.path().join("no.csv"), &CsvOptions::default()).unwrap_err();
    assert!(missing.to_string().contains("no.csv"), "{missing}");
}
