//! The step test as spreadsheets and loggers of other countries write it.

use crate::step::{ROWS, assert_names, assert_rows, clock, comma, read, read_with, refusal, rows};
use onecycle_link::{CsvOptions, TimeUnit};

/// A table with one second between the rows, 1000 of `unit`.
fn table(header: &str, row: impl Fn(u32, f64, f64) -> String) -> Vec<u8> {
    format!("{header}\n{}", rows(row)).into_bytes()
}

fn latin1(text: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(text);
    text.chars().map(|c| c as u8).collect()
}

#[test]
fn names_in_other_languages() {
    for (header, input, output) in [
        (
            "Zeit [s];Stellgröße [%];Temperatur [°C]",
            "Stellgröße [%]",
            "Temperatur [°C]",
        ),
        (
            "Temps (s);Commande (%);Température (°C)",
            "Commande (%)",
            "Température (°C)",
        ),
        (
            "Tiempo (s);Válvula (%);Temperatura (°C)",
            "Válvula (%)",
            "Temperatura (°C)",
        ),
    ] {
        let text = table(header, |i, u, y| format!("{i},5;{u};{}", comma(y)));
        for bytes in [text.clone(), latin1(&text)] {
            let recording = read(&bytes);
            assert_rows(&recording, 1.0, 1.0);
            assert_names(&recording, input, output);
            assert_eq!(recording.columns().output.unit.as_deref(), Some("°C"));
        }
    }
    let switches = table("Zeit [s];Heizung;Temperatur", |i, u, y| {
        format!("{i};{};{}", if u > 20.0 { "Ein" } else { "Aus" }, comma(y))
    });
    let recording = read(&switches);
    assert_eq!([recording.input()[0], recording.input()[59]], [0.0, 1.0]);
}

#[test]
fn utf16_without_a_mark() {
    let text = String::from_utf8(table("t [s],u,y", |i, u, y| format!("{i},{u},{y}"))).unwrap();
    for bytes in [u16::to_le_bytes, u16::to_be_bytes] {
        let bytes: Vec<u8> = text.encode_utf16().flat_map(bytes).collect();
        assert_rows(&read(&bytes), 1.0, 1.0);
    }
}

#[test]
fn stamps_of_other_programs() {
    for stamp in [
        |i| format!("{}:000", clock(i)),
        |i| format!("12 Mar 2024 {}", clock(i)),
        |i| format!("Tue Mar 12 {} 2024", clock(i)),
        |i| (133_000_000_000_000_000 + 10_000_000 * u64::from(i)).to_string(),
        |i| format!("{i} s"),
    ] {
        let text = table("time;u;y", |i, u, y| format!("{};{u} %;{y} °C", stamp(i)));
        assert_rows(&read(&text), 1.0, 1.0);
    }
    let mixed = table("time;u;y", |i, u, y| match i {
        0..30 => format!("{i} s;{u};{y}"),
        _ => format!("{} min;{u};{y}", f64::from(i) / 60.0),
    });
    assert!(refusal(&mixed).contains("line 32"), "{}", refusal(&mixed));
}

// 1 s in minutes is 60 Hz in seconds: every time constant would be wrong by 60.
#[test]
fn minutes_are_not_taken_for_seconds() {
    for (length_s, unit) in [(60.0, TimeUnit::Minutes), (3600.0, TimeUnit::Hours)] {
        let text = table("time,u,y", |i, u, y| {
            format!("{:.7},{u},{y}", f64::from(i) / length_s)
        });
        let error = refusal(&text);
        assert!(
            error.contains(unit.symbol()) && error.contains(" s"),
            "{error}"
        );
        let mut options = CsvOptions::default();
        options.time_unit = Some(unit);
        assert_eq!(read_with(&text, &options).len(), ROWS as usize);
    }
}

// `motor.output` is what the motor does; `pid.output` acts on the process.
#[test]
fn input_and_output_of_a_block() {
    let of = |block: &str, more: &str| {
        table(
            &format!("t [s],{block}.input,{block}.output{more}"),
            |i, u, y| format!("{i},{y},{u}{}", if more.is_empty() { "" } else { ",60" }),
        )
    };
    assert_names(&read(&of("pid", "")), "pid.output", "pid.input");
    let siemens = of("PID_Compact_1", ",PID_Compact_1.Setpoint");
    assert_names(
        &read(&siemens),
        "PID_Compact_1.output",
        "PID_Compact_1.input",
    );
    assert_names(
        &read(&of("motor", ",motor.setpoint")),
        "motor.output",
        "motor.input",
    );
    let error = refusal(&of("motor", ""));
    assert!(
        error.contains("motor.input") && error.contains("or of the controller"),
        "{error}"
    );
    let json = rows(|i, u, y| format!("{{\"t\":{i},\"motor\":{{\"input\":{u},\"output\":{y}}}}}"));
    assert!(refusal(json.as_bytes()).contains("of the controller"));
}

#[test]
fn marks_around_numbers() {
    let blanks = table("t [s];u;y", |i, u, y| {
        format!("{i};\u{a0}{u};{}\u{a0}", comma(y))
    });
    assert_rows(&read(&blanks), 1.0, 1.0);
    let below = table("t [s];u;y", |i, u, y| {
        format!("{i};{u};\u{2212}{}", comma(y))
    });
    assert_eq!(read(&below).output()[0], -25.0);
    let quoted = table(
        "\"t [s]\";\"\"\"DB1\"\".Heater\";\"\"\"DB1\"\".Temperature\"",
        |i, u, y| format!("{i};{u};{}", comma(y)),
    );
    assert_eq!(read(&quoted).columns().input.name, "\"DB1\".Heater");
    let empty = table("t [s],u,y", |i, u, _| format!("{i},{u},"));
    assert!(refusal(&empty).contains("\"y\" (column 3) holds no number"));
}

// Columns in pairs, each with its time, below titles.
#[test]
fn titles_above_pairs_of_columns() {
    let row = |i: u32, u, y| format!("{i},{u},{i},{y}");
    for header in [
        "heater,,temp,\nTime [s],Value,Time [s],Value",
        ",heater,,temp\nX [s],Y,X [s],Y",
    ] {
        let recording = read(&table(header, row));
        assert_rows(&recording, 1.0, 1.0);
        assert_names(&recording, "heater", "temp");
    }
    let none = table("Time [s],Value,Time [s],Value", row);
    assert!(refusal(&none).contains("no tag is known to be the input"));
}

// Names longer than a message quotes, with units: those of the signals, not of the first column.
#[test]
fn signals_of_groups_have_their_units() {
    let header = "Time [s],Application.Oven.rHeaterPowerOfZone1 [%],Time [s],Application.Oven.rHeaterZone1Temperature [degC]";
    let recording = read(&table(header, |i, u, y| format!("{i},{u},{i},{y}")));
    assert_rows(&recording, 1.0, 1.0);
    let columns = recording.columns();
    assert_eq!(columns.input.name, "Application.Oven.rHeaterPowerOfZone1");
    let units = [&columns.input, &columns.output].map(|column| column.unit.as_deref());
    assert_eq!(units, [Some("%"), Some("degC")]);
    let named = CsvOptions::default().output_column("Application.Oven.rHeaterZone1Temperature");
    assert_rows(
        &read_with(&table(header, |i, u, y| format!("{i},{u},{i},{y}")), &named),
        1.0,
        1.0,
    );
}

#[test]
fn traces_of_plcs() {
    // CODESYS 2: the first column counts cycles of the task.
    let cycles = table(
        "CODESYS Trace\nC:\\OVEN.PRO\nCycle PLC_PRG.fHeater PLC_PRG.fTemp",
        |i, u, y| format!("{i} {u} {y}"),
    );
    assert!(refusal(&cycles).contains("\"Cycle\" (column 1) gives no unit of time"));
    assert_rows(
        &read_with(&cycles, &CsvOptions::default().sample_rate_hz(10.0)),
        0.1,
        1.0,
    );
    // A number of each sample beside a time.
    let tia = table(
        "\"Trace\";\"Oven\"\n\n\"Sample\";\"Time [ms]\";\"\"\"Data\"\".Heater\";\"\"\"Data\"\".Temperature\"",
        |i, u, y| format!("{i};{};{u};{}", 1000 * i, comma(y)),
    );
    assert_rows(&read(&tia), 1.0, 1.0);
    let twincat = table(
        "Name;fHeater;Name;fTemp\nSampleTime[ms];1000;SampleTime[ms];1000",
        |i, u, y| format!("{};{u};{};{}", 1000 * i, 1000 * i, comma(y)),
    );
    assert_rows(&read(&[&twincat[..], b"EOF;;;\n"].concat()), 1.0, 1.0);
}

#[test]
fn letters_of_channels_are_no_units() {
    let text = table("Time,Channel A,Channel B\n(ms),(mV),(V)\n", |i, u, y| {
        format!("{}.5,{u},{y}", 1000 * i)
    });
    let recording = read(&text);
    assert_rows(&recording, 1.0, 1.0);
    assert_eq!(recording.columns().input.unit.as_deref(), Some("mV"));
    assert_eq!(recording.columns().output.name, "Channel B");
}

// A unit that begins a line is no comment.
#[test]
fn units_in_json() {
    let rows = rows(|i, u, y| {
        format!(
            "{{\"time_s\":{i}.5,\"heater\":{{\"unit\":\"%\",\"value\":{u}}},\"temperature\":{{\"value\":{y}}}}}"
        )
    });
    assert_rows(&read(rows.as_bytes()), 1.0, 1.0);
}
