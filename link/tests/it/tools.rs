//! Files of tools, in the layouts that their documentation and sources give: the same step test in each.

use onecycle_link::{CsvOptions, read_from};

use crate::step::{ROWS, assert_names, assert_rows, clock, read, read_with, refusal, rows, sample};

#[test]
fn klipper() {
    // `PID_CALIBRATE ... WRITE_FILE=1`: changes of the power, then temperatures; or time, temperature, power.
    let power = [(0, 0.1), (20, 0.5)]
        .map(|(i, power)| format!("pwm: {:.3} {power:.3}\n", 1000.0 + 0.3 * f64::from(i)));
    let heattest =
        power.concat() + &rows(|i, _, y| format!("{:.3} {y:.2}", 1000.0 + 0.3 * f64::from(i)));
    let recording = read(heattest.as_bytes());
    assert_rows(&recording, 0.3, 0.01);
    assert_names(&recording, "heater.pwm", "heater.temp");
    let columns =
        rows(|i, u, y| format!("{:.5} {y:.2} {:.3}", 1000.0 + 0.3 * f64::from(i), u / 100.0));
    assert_rows(&read(columns.as_bytes()), 0.3, 0.01);

    let log = |bed: &str| {
        let stats = rows(|i, u, y| {
            format!(
                "Stats {:.1}: gcodein=0  mcu: mcu_awake=0.001 freq=72000312 heater_bed: target=60 temp=59.9 {bed} sysload=0.3 \
                 extruder: target=60 temp={y:.2} pwm={:.3}",
                1000.5 + f64::from(i),
                u / 100.0
            )
        });
        format!(
            "Start printer at Tue\n[extruder]\ncontrol = pid\npid_kp = 22.2\n=====\n{stats}webhooks client 1: x\n"
        )
    };
    let recording = read(log("pwm=0.000").as_bytes());
    assert_rows(&recording, 1.0, 0.01);
    assert_names(&recording, "extruder.pwm", "extruder.temp");
    assert_eq!(recording.set_point().unwrap()[0], 60.0);
    // The bed does the same: which is meant?
    let both = log("pwm=0.000").replace("temp=59.9 pwm=0.000", "temp=59.9 pwm=0.1");
    let both = both.replacen("pwm=0.1", "pwm=0.2", 1);
    assert!(refusal(both.as_bytes()).contains("several control loops: heater_bed, extruder"));
    let bed = read_with(
        both.as_bytes(),
        &CsvOptions::default().control_loop("heater_bed"),
    );
    assert_names(&bed, "heater_bed.pwm", "heater_bed.temp");
    // Cut before the last power: the one before holds.
    let cut = log("pwm=0.000");
    let cut = &cut[..cut.rfind("pwm=").unwrap() + 1];
    assert_rows(&read(cut.as_bytes()), 1.0, 0.01);
}

#[test]
fn moonraker() {
    let list = |of: fn(u32) -> f64| {
        (0..ROWS)
            .map(|i| of(i).to_string())
            .collect::<Vec<_>>()
            .join(",")
    };
    let store = format!(
        "{{\"result\": {{\"heater_bed\": {{\"temperatures\": [22.5, 22.5], \"targets\": [0, 0], \"powers\": [0, 0]}}, \
         \"extruder\": {{\"temperatures\": [{}], \"targets\": [{}], \"powers\": [{}]}}, \
         \"temperature_sensor mcu\": {{\"temperatures\": [40.5]}}}}}}",
        list(|i| sample(i).1),
        list(|_| 60.0),
        list(|i| sample(i).0)
    );
    let recording = read(store.as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_names(&recording, "extruder.power", "extruder.temperature");
    let error = refusal(&store.as_bytes()[..store.len() / 2]);
    assert!(
        error.contains("line 1") && error.contains("cut off"),
        "{error}"
    );
}

#[test]
fn marlin_and_octoprint() {
    let log = rows(|i, u, y| {
        format!(
            "2024-03-12 {},250 - Recv:  T:{y:.2} /60.00 (244.6) B:22.5 /0.00 (3646.7) @:{u} B@:0\n\
             2024-03-12 {},300 - Send: N1 G1 X1:2",
            clock(i),
            clock(i)
        )
    });
    let recording = read(format!("2024-03-12 07:59:59,000 - Recv: start\n{log}").as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_names(&recording, "T.power", "T.temp");
    // Without stamps the log tells no time.
    let plain = rows(|_, u, y| format!("ok T:{y:.2} /60.00 @:{u}"));
    assert!(refusal(plain.as_bytes()).contains("no column is known to be the time"));
    assert_rows(
        &read_with(plain.as_bytes(), &CsvOptions::default().sample_rate_hz(0.5)),
        2.0,
        1.0,
    );
    // RepRapFirmware reports no power.
    let no_power = rows(|i, _, y| format!("{} ok T:{y:.2} /60.00 B:22.5 /0.0", clock(i)));
    assert!(refusal(no_power.as_bytes()).contains("not the power of the heaters"));
}

#[test]
fn arduino() {
    let plotter = rows(|i, u, y| {
        format!(
            "{}.500 -> Setpoint:60.00,Input:{y:.2},Output:{u:.2}",
            clock(i)
        )
    });
    let recording = read(plotter.as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_eq!(recording.columns().output.name, "Input");
    assert_eq!(recording.set_point().unwrap()[5], 60.0);
    // Tabs, a rate instead of stamps, garbage while the port opens.
    let plain = rows(|_, u, y| format!("Setpoint:60.00\tInput:{y:.2}\tOutput:{u:.2}"));
    assert_rows(
        &read_with(
            format!("\u{1}x\n{plain}").as_bytes(),
            &CsvOptions::default().sample_rate_hz(4.0),
        ),
        0.25,
        1.0,
    );
    // Without a set-point, and with one near the other column, nothing tells.
    let unknown = rows(|i, u, y| format!("ms:{},Input:{y:.2},Output:{u:.2}", 1000 * i));
    let contrary =
        rows(|i, u, y| format!("ms:{},Setpoint:{u},Input:{y:.2},Output:{u:.2}", 1000 * i));
    let table = format!(
        "ms,Setpoint,Input,Output\n{}",
        rows(|i, u, y| format!("{},60,{y:.2},{u:.2}", 1000 * i))
    );
    for text in [unknown, contrary, table] {
        let error = refusal(text.as_bytes());
        assert!(
            error.contains("or of the controller, as Arduino's PID libraries name them"),
            "{error}"
        );
        let options = CsvOptions::default()
            .input_column("Output")
            .output_column("Input");
        assert_rows(&read_with(text.as_bytes(), &options), 1.0, 1.0);
    }
    // sTune counts down until its test begins.
    let stune = rows(|i, u, y| {
        let (sec, end) = match i {
            0..10 => (10 - i, "  settling"),
            _ => (i - 10, "  inst: 1.5"),
        };
        format!(" sec: {sec}.0000  out: {u:.2}  pv: {y:.3}{end}")
    });
    assert_rows(&read(stune.as_bytes()), 1.0, 1.0);
    // A table of numbers is not taken for lines of labels.
    assert!(refusal(b"a:b\nc:d\ne:f\n").contains("no row of numbers"));
}

// Words in a column are no tags where the names of others tell input and output, even if the input stands still.
#[test]
fn a_mode_is_no_tag() {
    let mode = |i: u32| ["heat", "hold", "cool"][(i / 5 % 3) as usize];
    let table = rows(|i, _, y| {
        format!(
            "2024-03-12 {},{},30,{}",
            clock(i),
            mode(i),
            if i == 50 { y - 9.0 } else { y }
        )
    });
    let recording = read(format!("Date,Mode,Heater power,Temperature\n{table}").as_bytes());
    assert_eq!(recording.input(), [30.0; ROWS as usize]);
}

#[test]
fn esphome() {
    let log = rows(|i, u, y| {
        format!(
            "[{}][D][sensor:094]: 'Heater power': Sending state {u:.5} % with 0 decimals of accuracy\n\
             [{}][D][sensor:094]: 'Boiler temperature': Sending state {y:.5} \u{b0}C with 1 decimals of accuracy",
            clock(i),
            clock(i)
        )
    });
    let recording =
        read(format!("[07:59:58][I][app:102]: ESPHome version 2024.6\n{log}").as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_names(&recording, "Heater power", "Boiler temperature");
    // Over midnight.
    let night = log.replace("[08:00:", "[23:59:");
    let night = night
        .replace("[23:59:3", "[00:00:0")
        .replace("[23:59:4", "[00:00:1")
        .replace("[23:59:5", "[00:00:2");
    let recording = read(night.as_bytes());
    assert_eq!(recording.time_s()[30] - recording.time_s()[29], 31.0);
}

#[test]
fn home_assistant() {
    let stamp = |i: u32| format!("2024-03-12T{}.000Z", clock(i));
    let temperatures = rows(|i, _, y| format!("sensor.boiler_temperature,{y},{}", stamp(i)));
    let powers = rows(|i, u, _| match i % 20 {
        0 => format!("number.boiler_power,{u},{}", stamp(i)),
        _ => format!("sensor.outdoor,unavailable,{}", stamp(i)),
    });
    let csv = format!("entity_id,state,last_changed\n{temperatures}{powers}");
    let recording = read(csv.as_bytes());
    assert_rows(&recording, 1.0, 1.0);
    assert_names(
        &recording,
        "number.boiler_power",
        "sensor.boiler_temperature",
    );
    // A switch.
    let on_off = csv
        .replace("number.boiler_power,10", "switch.heater,off")
        .replace("number.boiler_power,50", "switch.heater,on");
    assert_eq!(read(on_off.as_bytes()).input()[19..21], [0.0, 1.0]);
    // Two temperatures: which one?
    let two = csv.replace(
        "sensor.outdoor,unavailable",
        "sensor.outdoor_temperature,12.5",
    );
    assert!(refusal(two.as_bytes()).contains("no tag is known to be the output"));

    let states = |name: &str, of: fn(u32) -> f64| {
        let one = |i: u32| {
            let id = if i == 0 {
                format!("\"entity_id\": {name:?}, ")
            } else {
                String::new()
            };
            format!(
                "{{{id}\"state\": \"{}\", \"last_changed\": \"{}\", \"attributes\": {{\"a\": [1]}}}}",
                of(i),
                stamp(i)
            )
        };
        format!("[{}]", (0..ROWS).map(one).collect::<Vec<_>>().join(", "))
    };
    let json = format!(
        "[{}, {}]",
        states("number.boiler_power", |i| sample(i).0),
        states("sensor.boiler_temperature", |i| sample(i).1)
    );
    assert_rows(&read(json.as_bytes()), 1.0, 1.0);
    let compressed = |of: fn(u32) -> f64| {
        (0..ROWS)
            .map(|i| format!("{{\"s\": \"{}\", \"lu\": {}.5}}", of(i), 1_710_230_400 + i))
            .collect::<Vec<_>>()
            .join(",")
    };
    let json = format!(
        "{{\"sensor.heater_power\": [{}], \"sensor.bath_temperature\": [{}]}}",
        compressed(|i| sample(i).0),
        compressed(|i| sample(i).1)
    );
    assert_rows(&read(json.as_bytes()), 1.0, 1.0);
}

const DBC: &str = "BO_ 257 Command: 2 ECU\n SG_ Duty : 0|16@1+ (0.1,0) [0|100] \"%\" ECU\n\n\
    BO_ 258 Status: 4 ECU\n SG_ Temperature : 7|16@0- (0.01,0) [0|0] \"degC\" ECU\n SG_ Alive : 16|4@1+ (1,0) [0|0] \"\" ECU\n";

#[test]
fn candump_with_a_dbc() {
    let frames = |format: &dyn Fn(u32, u32, &[u8]) -> String| {
        rows(|i, u, y| {
            let [low, high] = ((10.0 * u) as u16).to_le_bytes();
            let [first, second] = ((100.0 * y).round() as i16).to_be_bytes();
            let command = format(1000 * i, 0x101, &[low, high]);
            let status = format(1000 * i + 1, 0x102, &[first, second, (i % 16) as u8, 0]);
            format!(
                "{command}\n{}\n{status}",
                format(1000 * i, 0x7ff, &[1, 2, 3])
            )
        })
    };
    let hex = |data: &[u8], between: &str| {
        let bytes: Vec<String> = data.iter().map(|byte| format!("{byte:02X}")).collect();
        bytes.join(between)
    };
    let time = |ms: u32| format!("({}.{:03}000)", 1_710_230_400 + ms / 1000, ms % 1000);
    let log = frames(&|ms, id, data| format!("{} can0 {id:03X}#{}", time(ms), hex(data, "")));
    let screen = frames(&|ms, id, data| {
        format!(
            " {}  can0  {id:03X}   [{}]  {}",
            time(ms),
            data.len(),
            hex(data, " ")
        )
    });
    let mut options = CsvOptions::default();
    options.dbc = Some(DBC.to_owned());
    for text in [&log, &screen] {
        let recording = read_with(text.as_bytes(), &options);
        let measured = |i| (100.0 * sample(i).1).round() * 0.01;
        assert_eq!(
            recording.output(),
            (0..ROWS).map(measured).collect::<Vec<_>>()
        );
        assert_eq!(recording.input()[..19], [10.0; 19]);
        assert_names(&recording, "Command.Duty [%]", "Status.Temperature [degC]");
        let named = options.clone().output_column("Status.Alive");
        assert_eq!(read_with(text.as_bytes(), &named).output()[17], 1.0);
    }
    assert!(refusal(log.as_bytes()).contains("no DBC file says what they are"));
    let since = frames(&|ms, id, data| {
        format!(
            "({}) can0 {id:03X}#{}",
            if ms % 1000 == 1 { "0.999" } else { "0.001" },
            hex(data, "")
        )
    });
    assert!(refusal(since.as_bytes()).contains("no times that count from one start"));
    let without = screen.replace("(17", "(x17");
    assert!(read_from(without.as_bytes(), &options).is_err());
    options.dbc = Some(DBC.replace("257", "1").replace("258", "2"));
    let error = read_from(log.as_bytes(), &options)
        .expect_err("other frames")
        .to_string();
    assert!(error.contains("describes no frame"), "{error}");
}
