//! Files of plants, laboratories and robots, in the layouts that their documentation and sources give: the same step test in each.

use onecycle_link::{CsvOptions, read_from};

use crate::step::{
    ROWS, assert_names, assert_rows, clock, comma, read, read_with, refusal, rows, sample,
};

fn by_numbers() -> CsvOptions {
    CsvOptions::default().input_column("2").output_column("3")
}

#[test]
fn twincat_scope() {
    let keys = |rows: &[(&str, &str, &str)]| {
        let row = |(key, a, b): &(&str, &str, &str)| format!("{key}\t{a}\t{key}\t{b}\n");
        rows.iter().map(row).collect::<String>()
    };
    let head = "Name\tScope YT\nFile\tC:\\a.svdx\nStarttime of export\t133547040000000000\t12.03.2024 08:00:00.000\n\n";
    let names = keys(&[
        ("Name", "Oven.fOut", "Oven.fTemp"),
        ("SymbolComment", "", ""),
        ("Data-Type", "REAL64", "REAL64"),
        ("SampleTime[ms]", "100", "100"),
        ("SymbolBased", "True", "True"),
        ("Port", "851", "851"),
        ("SymbolName", "MAIN.fOut", "MAIN.fTemp"),
        ("Unit", "(None)", "\u{b0}C"),
    ]);
    let values = rows(|i, u, y| format!("{}\t{u}\t{}\t{}", 100 * i, 100 * i, comma(y)));
    let recording = read(format!("{head}{names}\n{values}EOF\n").as_bytes());
    assert_rows(&recording, 0.1, 1.0);
    assert_names(&recording, "Oven.fOut", "Oven.fTemp");
    // One time for all channels, and a header of names only, as other presets of the export have it.
    let shared = "Name\tOven.fOut\tOven.fTemp\nSampleTime[ms]\t100\t100\n";
    let values = rows(|i, u, y| format!("{}\t{u}\t{y}", 100 * i));
    assert_rows(
        &read(format!("{head}{shared}\n{values}").as_bytes()),
        0.1,
        1.0,
    );
    let plain = format!("Name,Oven.fOut,Oven.fTemp\n{}", values.replace('\t', ","));
    assert_rows(&read(plain.as_bytes()), 0.1, 1.0);
    // Channels with sample times of their own: the slow one ends early.
    let slow = rows(|i, u, y| match i {
        0..30 => format!("{}\t{u}\t{}\t{y}", 200 * i, 100 * i),
        _ => format!("\t\t{}\t{y}", 100 * i),
    });
    let recording = read(format!("{head}{names}\n{slow}").as_bytes());
    assert_eq!(recording.len(), ROWS as usize);
    // The input steps at the sample of its own clock, at 4 s.
    assert_eq!(recording.input()[39..42], [10.0, 50.0, 50.0]);
}

#[test]
fn wincc() {
    // One value a row; `Time_ms` counts days times 1e6.
    let row = |name: &str, i: u32, value: f64, valid: u32| {
        format!(
            "\"{name}\";\"12.03.2024 {}\";{};{valid};{}\n",
            clock(i),
            comma(value),
            comma(45_363_333_333.0 + f64::from(i) * 11.574)
        )
    };
    let long: String = (0..ROWS)
        .map(|i| row("Line1_PID_OUT", i, sample(i).0, 1) + &row("Line1_TEMP_PV", i, sample(i).1, 1))
        .collect();
    let header = "\"VarName\";\"TimeString\";\"VarValue\";\"Validity\";\"Time_ms\"\n";
    let recording = read(format!("{header}{long}").as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_names(&recording, "Line1_PID_OUT", "Line1_TEMP_PV");
    // Samples that are not valid are left out.
    let invalid = long.replacen(";1;", ";0;", 4);
    assert_eq!(
        read(format!("{header}{invalid}").as_bytes()).len(),
        ROWS as usize - 2
    );
    let wide = rows(|i, u, y| {
        format!(
            "12.03.2024 {};{};{};{}",
            clock(i),
            comma(45_363_333_333.25 + f64::from(i) * 11.574),
            comma(u),
            comma(y)
        )
    });
    let recording = read(format!("TimeString;Time_ms;OP;PV\n{wide}").as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert!(format!("{:?}", recording.notes()).contains("TimeDisagrees"));
    // Milliseconds that agree with the dates are finer than these.
    let finer = rows(|i, u, y| format!("12.03.2024 {};{};{u};{y}", clock(i / 2), 500 * i));
    assert_rows(
        &read(format!("TimeString;Time_ms;OP;PV\n{finer}").as_bytes()),
        0.5,
        1.0,
    );
}

#[test]
fn grafana_and_influx() {
    let joined = rows(|i, u, y| format!("2024-03-12 {},{y} \u{b0}C,{u}%", clock(i)));
    let recording =
        read(format!("\"Time\",\"Oven temperature\",\"Oven power\"\n{joined}").as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_eq!(recording.columns().output.unit.as_deref(), Some("\u{b0}C"));
    let long: String = ["Oven power", "Oven temperature"]
        .iter()
        .map(|name| {
            rows(|i, u, y| {
                format!(
                    "{name};2024-03-12T{}Z;{}",
                    clock(i),
                    if name.ends_with('r') { u } else { y }
                )
            })
        })
        .collect();
    assert_rows(
        &read(format!("Series;Time;Value\n{long}").as_bytes()),
        1.0,
        1.0,
    );
    // A dashboard that changes the unit of a column has scaled it.
    let scaled = joined
        .replacen("10%", "980 W", 1)
        .replace("10%", "1 kW")
        .replace("50%", "1.2 kW");
    assert!(
        refusal(format!("Time,temperature,power\n{scaled}").as_bytes())
            .contains("has another unit than the cells before it")
    );

    let annotated: String = ["power", "temperature"]
        .iter()
        .map(|name| {
            rows(|i, u, y| {
                let value = if *name == "power" { u } else { y };
                format!(",,0,2024-03-12T00:00:00Z,2024-03-13T00:00:00Z,2024-03-12T{}Z,{value},{name},oven,host1", clock(i))
            })
        })
        .collect();
    let header = "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string,string\n\
                  #default,_result,,,,,,,,\n,result,table,_start,_stop,_time,_value,_field,_measurement,host\n";
    let recording = read(format!("{header}{annotated}").as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_names(&recording, "power", "temperature");

    let lines = rows(|i, u, y| {
        format!(
            "oven,site=a power={u},temp={y} {}000000000",
            1_710_230_400 + i
        )
    });
    let recording = read(lines.as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_names(&recording, "oven.a.power", "oven.a.temp");
    // Series one after the other.
    let series = rows(|i, u, _| format!("power,site=a value={u} {}", 1_710_230_400 + i))
        + &rows(|i, _, y| format!("temperature,site=a value={y} {}", 1_710_230_400 + i));
    assert_rows(&read(series.as_bytes()), 1.0, 1.0);
}

#[test]
fn labview() {
    let file = |separator: &str, columns: &str, step: &str, values: &str, names: &str| {
        let head = format!(
            "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\t{separator}\nMulti_Headings\tNo\nX_Columns\t{columns}\n\
             Date\t2024/03/12\nTime\t08:00:00.5\n***End_of_Header***\t\n\t\nChannels\t2\nSamples\t60\t60\nTime\t08:00:00\t08:00:00\n\
             Y_Unit_Label\t%\tdegC\nX_Dimension\tTime\tTime\nX0\t0.5\t0.5\nDelta_X\t{step}\t{step}\n***End_of_Header***\t\t\n{names}\n"
        );
        let text = format!("{head}{values}");
        if separator == "Comma" {
            text.replace('\t', ",")
        } else {
            text
        }
    };
    let one = rows(|i, u, y| format!("{}\t{u:.6}\t{y:.6}\t", 0.5 + 0.25 * f64::from(i)));
    let names = "X_Value\tHeater power\tTemperature\tComment";
    for separator in ["Tab", "Comma"] {
        let recording = read(file(separator, "One", "0.25", &one, names).as_bytes());
        assert_rows(&recording, 0.25, 1.0);
        assert_eq!(recording.time_s()[0], 0.5);
        assert_eq!(recording.columns().output.unit.as_deref(), Some("degC"));
    }
    let none = rows(|_, u, y| format!("\t{u:.6}\t{y:.6}"));
    assert_rows(
        &read(file("Tab", "No", "0.25", &none, names).as_bytes()),
        0.25,
        1.0,
    );
    let multi = rows(|i, u, y| {
        format!(
            "{}\t{u:.6}\t{}\t{y:.6}",
            0.25 * f64::from(i),
            0.25 * f64::from(i)
        )
    });
    let names = "X_Value\tHeater power\tX_Value\tTemperature\tComment";
    assert_rows(
        &read(file("Tab", "Multi", "0.25", &multi, names).as_bytes()),
        0.25,
        1.0,
    );
    // A header without rows.
    assert!(
        refusal(file("Tab", "One", "0.25", "", names).as_bytes()).contains("no row of numbers")
    );
}

#[test]
fn oscilloscopes() {
    let scientific =
        |i: u32, u: f64, y: f64| format!("{:.6e},{u:.4},{y:.4}", 1e-3 * f64::from(i) - 0.01);
    let tektronix = format!(
        "Model,MSO24\nFirmware Version,1.28\n\nPoint Format,Y,Y,\nHorizontal Units,s,s\nSample Interval,1e-03,1e-03\n\
         Record Length,60,60\nGating,0.0% to 100.0%,0.0% to 100.0%\nVertical Units,V,V\n,,\nLabel,,\nTIME,CH1,CH2\n{}",
        rows(scientific)
    );
    let keysight = format!("x-axis,1,2\nsecond,Volt,Volt\n{}", rows(scientific));
    let siglent = format!(
        "Record Length,60\nSample Interval,0.001\nVertical Units,V\nSource,CH1,CH2\nSecond,Volt,Volt\n{}",
        rows(scientific)
    );
    let saleae = format!("Time [s],Channel 0,Channel 1\n{}", rows(scientific));
    let rigol = format!(
        "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e-02,1.0e-03\n{}",
        rows(|i, u, y| format!("{i},{u},{y},"))
    );
    let pico = format!(
        "Time,Channel A,Channel B\n(ms),(V),(V)\n\n{}",
        rows(|i, u, y| format!("{:.5},{u:.5},{y:.5}", f64::from(i) - 10.0))
    );
    for text in [&tektronix, &keysight, &siglent, &saleae, &rigol, &pico] {
        let recording = read_with(text.as_bytes(), &by_numbers());
        assert_rows(&recording, 1e-3, 1.0);
        assert!((recording.time_s()[0] + 0.01).abs() < 1e-9, "{text}");
    }
    // Two channels of a noisy record do not tell which is which.
    let noisy = keysight
        .replace("50.0000", "49.9731")
        .replacen("10.0000", "10.01", 1)
        .replacen("10.0000", "10.02", 1);
    let noisy = (0..9).fold(noisy, |text, i| {
        text.replacen("49.9731", &format!("49.9{i}"), 1)
    });
    assert!(refusal(noisy.as_bytes()).contains("do not show which is the input"));
    // A channel beyond its range.
    let beyond = pico.replacen("25.00000\n", "\u{221e}\n", 1);
    let error = read_from(beyond.as_bytes(), &by_numbers())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("1 of 60 rows have no number in the output (Channel B)"),
        "{error}"
    );
}

#[test]
fn json_tables() {
    let list = |of: fn(u32) -> f64| {
        (0..ROWS)
            .map(|i| of(i).to_string())
            .collect::<Vec<_>>()
            .join(",")
    };
    let lists = format!(
        "{{\"t\": [{}], \"u\": [{}], \"y\": [{}], \"gains\": [1, 2]}}",
        list(|i| f64::from(i) * 0.25),
        list(|i| sample(i).0),
        list(|i| sample(i).1)
    );
    let objects = rows(|i, u, y| {
        format!(
            "{{\"time_s\": {}, \"cmd\": {u}, \"pv\": {y}, \"mode\": \"auto\"}}",
            0.25 * f64::from(i)
        )
    });
    let array = format!("[{}]", objects.trim_end().replace('\n', ","));
    let influx = format!(
        "{{\"results\": [{{\"series\": [{{\"name\": \"oven\", \"columns\": [\"time\", \"power\", \"temp\"], \"values\": [{}]}}]}}]}}",
        rows(|i, u, y| format!(
            "[{}, {u}, {y}],",
            1_710_230_400_000_u64 + 250 * u64::from(i)
        ))
        .trim_end()
        .trim_end_matches(',')
    );
    for text in [&lists, &objects, &array] {
        assert_rows(&read(text.as_bytes()), 0.25, 1.0);
    }
    let in_ms = CsvOptions::default().time_unit(onecycle_link::TimeUnit::Milliseconds);
    assert_rows(&read_with(influx.as_bytes(), &in_ms), 0.25, 1.0);
    // Cut off: lines lose the last, a document everything.
    let cut = objects.rfind("\"pv\"").unwrap();
    assert_eq!(read(&objects.as_bytes()[..cut]).len(), ROWS as usize - 1);
    assert!(refusal(&array.as_bytes()[..cut]).contains("cut off"));
    assert!(refusal(b"{\"a\": 1}").contains("no table"));
    assert!(refusal(b"{a: 1}").contains("line 1 is no JSON"));
}

#[test]
fn sys_id() {
    let rows_of = |from: u32, to: u32| {
        let row = |i| {
            format!(
                "[{}, {}, 0.5, {}]",
                10.0 + 0.005 * f64::from(i),
                sample(i).0,
                sample(i).1
            )
        };
        (from..to).map(row).collect::<Vec<_>>().join(", ")
    };
    let text = format!(
        "{{\"sysid\": true, \"test\": \"Simple\", \"units\": \"Rotations\", \"unitsPerRotation\": 1.0, \"fast-forward\": [{}], \
         \"slow-backward\": [], \"slow-forward\": [{}]}}",
        rows_of(30, ROWS),
        rows_of(0, 30)
    );
    let options = CsvOptions::default().output_column("velocity");
    let recording = read_with(text.as_bytes(), &options);
    assert_rows(&recording, 0.005, 1.0);
    assert_eq!(recording.columns().input.name, "voltage");
}

/// A log of WPILib with these doubles.
pub(super) fn wpilog(values: &[(u64, u8, f64)], names: &[&str]) -> Vec<u8> {
    let mut file = b"WPILOG\x00\x01\x03\x00\x00\x00abc".to_vec();
    let record = |entry: u8, time_us: u64, payload: &[u8]| {
        let mut record = vec![0b0111_0000, entry, payload.len() as u8];
        record.extend(time_us.to_le_bytes());
        record.extend(payload);
        record
    };
    for (at, name) in names.iter().enumerate() {
        let mut start = vec![0];
        start.extend((at as u32 + 1).to_le_bytes());
        for text in [*name, "double", ""] {
            start.extend((text.len() as u32).to_le_bytes());
            start.extend(text.as_bytes());
        }
        file.extend(record(0, 0, &start));
    }
    for (time_us, entry, value) in values {
        file.extend(record(*entry, *time_us, &value.to_le_bytes()));
    }
    file
}

#[test]
fn wpilib_logs() {
    let values: Vec<(u64, u8, f64)> = (0..ROWS)
        .flat_map(|i| {
            let time_us = 1_000_000 + 20_000 * u64::from(i);
            [
                (time_us, 1, sample(i).0),
                (time_us, 2, sample(i).1),
                (time_us, 3, 7.5),
            ]
        })
        .collect();
    let names = ["/drive/appliedVolts", "/drive/velocity", "/gyro"];
    let file = wpilog(&values, &names);
    let recording = read(&file);
    assert_rows(&recording, 0.02, 1.0);
    assert_names(&recording, "/drive/appliedVolts", "/drive/velocity");
    let options = CsvOptions::default()
        .input_column("/drive/appliedVolts")
        .output_column("/gyro");
    assert_eq!(read_with(&file, &options).output()[0], 7.5);
    // Cut within a record, and in the header.
    assert_eq!(read(&file[..file.len() - 20]).len(), ROWS as usize - 1);
    assert!(refusal(&file[..14]).contains("no channel of numbers"));
    let positions = wpilog(&values, &["voltage-a", "velocity-a", "position-a"]);
    assert!(refusal(&positions).contains(
        "no tag is known to be the output; the tags are voltage-a, velocity-a, position-a"
    ));
}

/// A segment of a TDMS file: channels with unit, step and values, interleaved or not.
pub(super) fn tdms(
    channels: &[(&str, &str, Vec<f64>)],
    step_s: f64,
    is_interleaved: bool,
) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let mut metadata = (channels.len() as u32 + 1).to_le_bytes().to_vec();
    metadata.extend(text("/"));
    metadata.extend(u32::MAX.to_le_bytes());
    metadata.extend(0_u32.to_le_bytes());
    for (name, unit, values) in channels {
        metadata.extend(text(&format!("/'run'/'{name}'")));
        for number in [20_u32, 10, 1] {
            metadata.extend(number.to_le_bytes());
        }
        metadata.extend((values.len() as u64).to_le_bytes());
        metadata.extend(2_u32.to_le_bytes());
        metadata.extend(text("unit_string"));
        metadata.extend(0x20_u32.to_le_bytes());
        metadata.extend(text(unit));
        metadata.extend(text("wf_increment"));
        metadata.extend(10_u32.to_le_bytes());
        metadata.extend(step_s.to_le_bytes());
    }
    let mut values: Vec<u8> = Vec::new();
    if is_interleaved {
        for row in 0..channels[0].2.len() {
            values.extend(channels.iter().flat_map(|of| of.2[row].to_le_bytes()));
        }
    } else {
        values.extend(
            channels
                .iter()
                .flat_map(|of| of.2.iter().flat_map(|value| value.to_le_bytes())),
        );
    }
    let contents: u32 = 0b1110 | if is_interleaved { 1 << 5 } else { 0 };
    let mut file = b"TDSm".to_vec();
    file.extend(contents.to_le_bytes());
    file.extend(4713_u32.to_le_bytes());
    file.extend(((metadata.len() + values.len()) as u64).to_le_bytes());
    file.extend((metadata.len() as u64).to_le_bytes());
    [file, metadata, values].concat()
}

#[test]
fn tdms_files() {
    let all = |of: fn(u32) -> f64, from: u32, to: u32| (from..to).map(of).collect::<Vec<f64>>();
    let part = |from, to, is_interleaved| {
        let channels = [
            ("Heater power", "%", all(|i| sample(i).0, from, to)),
            ("Oven temperature", "degC", all(|i| sample(i).1, from, to)),
        ];
        tdms(&channels, 0.25, is_interleaved)
    };
    // Two segments, the second interleaved.
    let file = [part(0, 40, false), part(40, ROWS, true)].concat();
    let recording = read(&file);
    assert_rows(&recording, 0.25, 1.0);
    assert_eq!(recording.columns().output.unit.as_deref(), Some("degC"));
    // The second segment is cut off within its values.
    assert_eq!(read(&file[..file.len() - 160]).len(), ROWS as usize - 10);
    assert!(refusal(&file[..40]).contains("no channel of numbers"));
    // Without a step, a channel of times.
    let times = [
        ("Time", "s", all(|i| 0.25 * f64::from(i), 0, ROWS)),
        ("OP", "%", all(|i| sample(i).0, 0, ROWS)),
        ("PV", "degC", all(|i| sample(i).1, 0, ROWS)),
    ];
    assert_rows(&read(&tdms(&times, 0.0, false)), 0.25, 1.0);
}
