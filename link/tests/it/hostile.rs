//! For any bytes, the reader does not panic and returns either a valid recording or an error. A
//! written recording reads back to the same bits.

use onecycle_link::{
    Column, ColumnRef, Columns, CsvOptions, Position, Recording, RecordingBuilder, TimeUnit,
    read_from, write_csv,
};
use proptest::prelude::*;

/// A valid file with many features of the dialects.
const SEED: &str = "\u{feff}# run 7\r\nnoted by hand\r\n\"time (ms)\";pv [rad];u_N;mode\r\n\
    ms;rad;N;\r\n0;0,00;1;A\r\n10;0,02;1;A\r\n20;0,05;-1;B\r\n% pause\r\n30;4,;-1;B\r\n40;+4e-2;-1;B\r\n50;\"0,01\";1;\r\n60;-,5;1;A\r\n";

/// Options that are tried with each file.
fn all_options() -> Vec<CsvOptions> {
    let short = || CsvOptions::default().max_points(8);
    vec![
        CsvOptions::default(),
        short(),
        short().sample_rate_hz(1e3),
        short().sample_rate_hz(1e-6).input_column("u"),
        short().time_unit(TimeUnit::Hours),
        short()
            .time_column(ColumnRef::Number(1))
            .input_column(ColumnRef::Number(2))
            .output_column(ColumnRef::Number(3)),
    ]
}

/// Reads with all options; returns whether any of them gave a recording.
fn survives(bytes: &[u8]) -> bool {
    let mut any = false;
    for options in all_options() {
        match read_from(bytes, &options) {
            Ok(recording) => {
                any = true;
                assert_sound(&recording, options.max_points);
            }
            Err(error) => {
                let text = error.to_string();
                assert!(text.len() < 2000 && !text.contains(['\n', '\r', '\0']));
            }
        }
    }
    any
}

fn assert_sound(recording: &Recording, max_points: usize) {
    let (time_s, input, output) = (recording.time_s(), recording.input(), recording.output());
    assert!(time_s.len() >= 2 && time_s.len() <= max_points);
    assert!(input.len() == time_s.len() && output.len() == time_s.len());
    assert!(
        time_s
            .iter()
            .chain(input)
            .chain(output)
            .all(|value| value.is_finite())
    );
    assert!(time_s.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(recording.sample_period_s().is_finite() && recording.sample_period_s() > 0.0);
    assert!(recording.jitter().is_finite() && recording.jitter() >= 0.0);
    for gap in recording.gaps() {
        assert!(gap.index > 0 && gap.index < time_s.len() && gap.start_s < gap.end_s);
    }
    for note in recording.notes() {
        assert!(!note.to_string().contains(['\n', '\r', '\0']));
    }
}

#[test]
fn every_cut_and_every_byte_of_a_good_file() {
    assert!(survives(SEED.as_bytes()));
    let mut recordings = 0;
    for end in 0..SEED.len() {
        recordings += u32::from(survives(&SEED.as_bytes()[..end]));
    }
    let replacements = *b"\0\n\r\"';,.|\t #%/-+eE019nx\xff\x1a";
    for at in 0..SEED.len() {
        for byte in replacements {
            let mut bytes = SEED.as_bytes().to_vec();
            bytes[at] = byte;
            recordings += u32::from(survives(&bytes));
        }
    }
    assert!(
        recordings > 1000,
        "only {recordings} recordings: most mutations fail before the rows"
    );
}

#[test]
fn many_mutations_at_once() {
    // Linear congruential generator with Knuth's MMIX constants, so that a failure can be repeated.
    let mut state: u64 = 1;
    let mut random = move |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut recordings = 0;
    for _ in 0..10_000 {
        let mut bytes = SEED.as_bytes().to_vec();
        for _ in 0..1 + random(6) {
            let at = random(bytes.len());
            match random(4) {
                0 => bytes[at] = random(256) as u8,
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, b"0123456789.,;\n\"e-+"[random(18)]),
                _ => {
                    let end = (at + random(40)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    let to = random(bytes.len());
                    bytes.splice(to..to, piece);
                }
            }
        }
        recordings += u32::from(survives(&bytes));
    }
    assert!(
        recordings > 1000,
        "only {recordings} recordings: most mutations fail before the rows"
    );
}

/// A cell: mostly a number of any size, sometimes text.
fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        8 => (-1000..1000_i32).prop_map(|value| value.to_string()),
        8 => any::<f64>().prop_map(|value| format!("{value:?}")),
        4 => any::<i64>().prop_map(|value| value.to_string()),
        4 => (0.0..1.0_f64).prop_map(|value| value.to_string()),
        1 => "[-+0-9.,eEnaif\"' ]{0,12}",
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn arbitrary_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        survives(&bytes);
    }

    #[test]
    fn arbitrary_tables(text in "[-+0-9.,;|\t \n\r\"#%/enaituvpyms()\\[\\]]{0,200}") {
        survives(text.as_bytes());
    }

    #[test]
    fn arbitrary_numbers(
        rows in prop::collection::vec((cell(), cell(), cell()), 1..40),
        sorted: bool,
        header: bool,
    ) {
        let mut text = String::from(if header { "t,pv,u\n" } else { "" });
        let mut rows = rows;
        if sorted {
            let key = |row: &(String, String, String)| row.0.parse::<f64>().unwrap_or(0.0);
            rows.sort_by(|a, b| key(a).total_cmp(&key(b)));
        }
        for (t, y, u) in rows {
            text += &format!("{t},{y},{u}\n");
        }
        survives(text.as_bytes());
    }

    // Relays with spikes, third levels and gaps, with and without averaging.
    #[test]
    fn corrupt_cells_leave_a_sound_recording(
        rows in prop::collection::vec((0..300_usize, 0..600_usize, 0..200_usize), 100..400),
        half_period in 5..60_usize,
        max_points in prop_oneof![Just(64_usize), Just(1 << 20)],
    ) {
        let columns = Columns::new(Column::named("t"), Column::named("u"), Column::named("y"));
        let mut builder = RecordingBuilder::new(columns).with_max_points(max_points);
        let mut time_s = 0.0;
        for (row, (output, input, gap)) in rows.into_iter().enumerate() {
            time_s += if gap == 0 { 1.0 } else { 0.01 };
            let level = if row / half_period % 2 == 0 { 1.0 } else { -1.0 };
            let input = match input { 0 => -9.0, 1 => 1e300, 2 => 0.1, _ => level };
            let output = if output == 0 { -1e300 } else { level * (row % half_period) as f64 };
            builder.push(Position::Sample(row as u64), time_s, input, output).unwrap();
        }
        if let Ok(recording) = builder.finish() {
            assert_sound(&recording, max_points);
        }
    }

    #[test]
    fn written_and_read_back(
        start_s in -1e6..1e6_f64,
        rows in prop::collection::vec((1e-6..10.0_f64, any::<f64>(), any::<f64>()), 2..50),
    ) {
        let mut now_s = start_s;
        let mut columns = (Vec::new(), Vec::new(), Vec::new());
        for (step_s, input, output) in rows {
            columns.0.push(now_s);
            columns.1.push(if input.abs() < 1e300 { input } else { -0.0 });
            columns.2.push(if output.abs() < 1e300 { output } else { 5e-324 });
            now_s += step_s;
        }
        let written = Recording::from_samples(&columns.0, &columns.1, &columns.2);
        prop_assume!(written.is_ok());
        let written = written.unwrap();
        let mut file = Vec::new();
        write_csv(&mut file, &written, &["a\nb", "t,pv,u"]).unwrap();
        let read = read_from(file.as_slice(), &CsvOptions::default()).unwrap();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(read.time_s()), bits(&columns.0));
        prop_assert_eq!(bits(read.input()), bits(&columns.1));
        prop_assert_eq!(bits(read.output()), bits(&columns.2));
        prop_assert_eq!(read.gaps(), written.gaps());
        prop_assert_eq!(read.sample_period_s(), written.sample_period_s());
    }
}
