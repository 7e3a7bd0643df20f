//! Exports of historians and control systems.

use onecycle_link::{CsvOptions, Note, ReadError, Recording, read_from};

const ROWS: u32 = 200;

/// Output and input of row `i`: a slow sine with odd digits, a relay.
fn sample(i: u32) -> (f64, f64) {
    let output = 50.0 + 10.0 * (f64::from(i) / 20.0).sin();
    (
        (output * 1000.0).round() / 1000.0,
        if (i / 40).is_multiple_of(2) {
            60.0
        } else {
            40.0
        },
    )
}

fn read(text: &str) -> Recording {
    read_with(text, &CsvOptions::default()).expect("a recording")
}

fn read_with(text: &str, options: &CsvOptions) -> Result<Recording, ReadError> {
    read_from(text.as_bytes(), options)
}

/// A table of all rows, each made by `row` from its number, output and input.
fn table(header: &str, row: impl Fn(u32, f64, f64) -> String) -> String {
    let rows = (0..ROWS).map(|i| {
        let (output, input) = sample(i);
        row(i, output, input) + "\n"
    });
    std::iter::once(header.to_owned()).chain(rows).collect()
}

#[track_caller]
fn assert_all_rows(recording: &Recording, period_s: f64) {
    assert_eq!(recording.len(), ROWS as usize);
    for i in 0..ROWS {
        let (output, input) = sample(i);
        let at = i as usize;
        assert_eq!(
            (recording.output()[at], recording.input()[at]),
            (output, input),
            "row {i}"
        );
        assert!(
            (recording.time_s()[at] - period_s * f64::from(i)).abs() < 1e-6,
            "row {i}"
        );
    }
}

fn comma(value: f64) -> String {
    value.to_string().replace('.', ",")
}

/// `12:00:00` and `i` seconds.
fn clock(i: u32) -> String {
    format!("12:{:02}:{:02}", i / 60, i % 60)
}

#[test]
fn dates_decimal_commas_and_tags() {
    let text = table("Zeitstempel;LIC101.PV;LIC101.SP;LIC101.OP\n", |i, y, u| {
        format!("31.01.2024 {};{};50,0;{}", clock(i), comma(y), comma(u))
    });
    let recording = read(&text);
    assert_all_rows(&recording, 1.0);
    assert_eq!(recording.set_point().unwrap(), [50.0; ROWS as usize]);
    assert_eq!(recording.columns().input.name, "LIC101.OP");
}

#[test]
fn stamps_of_historians() {
    type OfDay = fn(u32) -> String;
    let stamps: [(&str, OfDay); 6] = [
        ("2024-01-31T", |i| format!("{}+01:00", clock(i))),
        ("31-Jan-24 ", |i| format!("{}.5", clock(i))),
        ("31-Jan-2024 ", clock),
        ("1/31/2024 ", |i| format!("{} PM", clock(i))),
        ("1/31/24 ", clock),
        ("31/01/2024 ", clock),
    ];
    for (day, of_day) in stamps {
        let text = table("Timestamp,TIC_101_PV,TIC_101_OUT\n", |i, y, u| {
            format!("{day}{},{y},{u}", of_day(i))
        });
        assert_all_rows(&read(&text), 1.0);
    }
    let two = table("Date;Time;PV;OP\n", |i, y, u| {
        format!("31.01.2024;{};{y};{u}", clock(i))
    });
    assert_all_rows(&read(&two), 1.0);
}

// Titles hold numbers and dates; units stand above or below the names, and names have descriptions.
#[test]
fn titles_units_and_descriptions() {
    let row = |i: u32, y: f64, u: f64| format!("2024-01-31 {},{y},{u}", clock(i));
    for header in [
        "Trend report,,\nCreated,31.01.2024 12:00,\nInterval,1,s\n\nTime,FIC-12/PV,FIC-12/OP\n,m3/h,%\n",
        ",m3/h,%\nTime,FIC-12/PV,FIC-12/OP\n",
        "Time,FIC-12/PV,FIC-12/OP\n,Flow to column,Valve\n,m3/h,%\n",
    ] {
        let recording = read(&table(header, row));
        assert_all_rows(&recording, 1.0);
        let columns = recording.columns();
        assert_eq!(columns.output.name, "FIC-12/PV", "{header}");
        assert_eq!(columns.output.unit.as_deref(), Some("m3/h"), "{header}");
        assert_eq!(columns.input.unit.as_deref(), Some("%"), "{header}");
    }
}

#[test]
fn excel_writes_utf16() {
    let text = table("Time\tLIC101.PV\tLIC101.MV\n", |i, y, u| {
        format!("31.01.2024 {}\t\"{}\"\t{u}", clock(i), comma(y))
    });
    let bytes: Vec<u8> = format!("\u{feff}{text}")
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let recording = read_from(bytes.as_slice(), &CsvOptions::default()).unwrap();
    assert_all_rows(&recording, 1.0);
    assert!(recording.notes().contains(&Note::Utf16));
}

#[test]
fn thousands() {
    // Twenty times the sine: 800.0 to 1,200.0.
    let big = |y: f64| {
        format!(
            "\"{}\"",
            format!("{:.2}", 20.0 * y)
                .split_once('.')
                .map(|(whole, part)| match whole.len() {
                    4 => format!("{},{}.{part}", &whole[..1], &whole[1..]),
                    _ => format!("{whole}.{part}"),
                })
                .unwrap()
        )
    };
    let text = table("t [s],PV,OP\n", |i, y, u| format!("{i}.5,{},{u}", big(y)));
    let recording = read(&text);
    assert_eq!(recording.len(), ROWS as usize);
    for i in 0..ROWS {
        assert!((recording.output()[i as usize] - 20.0 * sample(i).0).abs() < 0.006);
    }
}

// Rows 50 to 69 are bad: 20 of 200, and the time between 49 and 70 is a gap.
#[test]
fn bad_samples_are_gaps() {
    let is_bad = |i| (50..70).contains(&i);
    let word = table("Time,LIC101.PV,LIC101.OP\n", |i, y, u| match is_bad(i) {
        true => format!("2024-01-31 {},I/O Timeout,{u}", clock(i)),
        false => format!("2024-01-31 {},{y},{u}", clock(i)),
    });
    let status = table(
        "Time,LIC101.PV,Status,LIC101.OP,LIC101.OP.Status\n",
        |i, y, u| {
            let good = if is_bad(i) { "No Data" } else { "Good" };
            format!("2024-01-31 {},{y},{good},{u},Good", clock(i))
        },
    );
    let opc = table("Time,LIC101.PV,LIC101.PV.Quality,LIC101.OP\n", |i, y, u| {
        format!(
            "2024-01-31 {},{y},{},{u}",
            clock(i),
            if is_bad(i) { 24 } else { 192 }
        )
    });
    for (text, fault) in [(word, "I/O Timeout"), (status, "No Data"), (opc, "24")] {
        let recording = read(&text);
        assert_eq!(recording.len(), 180);
        let gaps: Vec<_> = recording
            .gaps()
            .iter()
            .map(|gap| (gap.start_s, gap.end_s))
            .collect();
        assert_eq!(gaps, [(49.0, 70.0)]);
        let found = recording.notes().iter().any(|note| {
            matches!(
                note, Note::BadLeftOut { count: 20, fault: found, .. } if found == fault
            )
        });
        assert!(found, "{:?}", recording.notes());
    }
    let none = table("Time,LIC101.PV,LIC101.OP\n", |i, y, u| match i < 80 {
        true => format!("2024-01-31 {},{y},{u}", clock(i)),
        false => format!("2024-01-31 {},Bad,{u}", clock(i)),
    });
    let error = read_with(&none, &CsvOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("120 of 200 samples are bad by their status"),
        "{error}"
    );
}

#[test]
fn several_loops() {
    let text = table(
        "Time,LIC101.PV,LIC101.OP,FIC12.PV,FIC12.OP,TI7.PV\n",
        |i, y, u| format!("2024-01-31 {},{},{},{y},{u},20", clock(i), y + 1.0, u + 1.0),
    );
    let error = read_with(&text, &CsvOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the file holds several control loops: LIC101, FIC12"
    );
    let of = |name: &str| read_with(&text, &CsvOptions::default().control_loop(name));
    assert_all_rows(&of("fic12").unwrap(), 1.0);
    let error = of("XIC1").unwrap_err().to_string();
    assert_eq!(
        error,
        "there is no control loop XIC1; the loops are LIC101, FIC12, TI7"
    );
    assert_eq!(
        of("TI7").unwrap_err().to_string().split(';').next(),
        Some("no column is known to be the input")
    );
    // One column settles it too.
    let input = read_with(&text, &CsvOptions::default().input_column("FIC12.OP")).unwrap();
    assert_all_rows(&input, 1.0);
}

// The input is written when it changes only, in rows of any order of tags.
#[test]
fn one_value_a_row() {
    let mut text = String::from("Timestamp;TagName;Value;Quality\n");
    for i in 0..ROWS {
        let (output, input) = sample(i);
        if i == 0 || input != sample(i - 1).1 {
            text += &format!("2024-01-31 {};LIC101.OP;{};Good\n", clock(i), comma(input));
        }
        text += &format!("2024-01-31 {};LIC101.PV;{};Good\n", clock(i), comma(output));
        text += &format!("2024-01-31 {};FI12.PV;3,5;Good\n", clock(i));
    }
    let recording = read(&text);
    assert_all_rows(&recording, 1.0);
    let sorted: String = {
        let mut lines: Vec<&str> = text.lines().skip(1).collect();
        lines.sort_by_key(|line| line.split(';').nth(1).map(str::to_owned));
        lines.join("\n")
    };
    let by_tag = read(&format!("Timestamp;TagName;Value;Quality\n{sorted}"));
    assert_eq!(by_tag.output(), recording.output());
    assert_eq!(by_tag.input(), recording.input());
    let headless = read(&sorted.replace(";Good", ""));
    assert_eq!(headless.input(), recording.input());
    assert!(recording.notes().iter().any(|note| matches!(
        note,
        Note::Woven {
            inputs: 5,
            outputs: 200
        }
    )));
}

#[test]
fn cells_left_empty_between_samples() {
    let text = table("Time,LIC101.PV,LIC101.OP\n", |i, y, u| {
        let input = if i % 40 == 0 {
            u.to_string()
        } else {
            String::new()
        };
        format!("2024-01-31 {},{y},{input}", clock(i))
    });
    assert_all_rows(&read(&text), 1.0);
}

// A sample only when the output has moved by 1 since the last one.
#[test]
fn exception_reporting_is_named() {
    let mut text = String::from("time,tag,value\n");
    let mut last = f64::NAN;
    for i in 0..600 {
        let (output, input) = sample(i);
        if i % 40 == 0 {
            text += &format!("2024-01-31 {},LIC101.OP,{input}\n", clock(i));
        }
        if (output - last).abs() < 1.0 {
            continue;
        }
        last = output;
        text += &format!("2024-01-31 {},LIC101.PV,{output}\n", clock(i));
    }
    let recording = read(&text);
    let is_named = |note: &Note| matches!(note, Note::Compressed { .. });
    assert!(
        recording.notes().iter().any(is_named),
        "{:?}",
        recording.notes()
    );
}

// The same samples, drawn as straight lines once a second.
#[test]
fn interpolated_compression_is_named() {
    let knots: Vec<u32> = (0..60)
        .scan(0, |at, k| {
            Some(std::mem::replace(at, *at + 3 + 13 * (k % 4)))
        })
        .collect();
    let value = |i: u32| {
        let at = knots
            .partition_point(|&knot| knot <= i)
            .clamp(1, knots.len() - 1);
        let (a, b) = (knots[at - 1], knots[at]);
        let (ya, yb) = (sample(7 * a).0, sample(7 * b).0);
        ya + (yb - ya) * f64::from(i - a) / f64::from(b - a)
    };
    let text = table("t [s],PV,OP\n", |i, _, u| format!("{i}.5,{},{u}", value(i)));
    let is_named = |note: &Note| matches!(note, Note::Interpolated { .. });
    let notes = |text: &str| read(text).notes().iter().any(is_named);
    let longer: String = (ROWS..700)
        .map(|i| format!("{i}.5,{},{}\n", value(i), sample(i).1))
        .collect();
    assert!(notes(&(text + &longer)));
    let plain = table("t [s],PV,OP\n", |i, y, u| format!("{i}.5,{y},{u}"));
    assert!(!notes(&plain));
}
