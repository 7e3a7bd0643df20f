//! MATLAB files of SciPy, GNU Octave and by hand, whole and damaged. The files: `link/tests/oracles/matlab.py`.

use onecycle_link::{CsvOptions, ReadError, Recording, read_from};

const FILES: [&str; 4] = [
    "scipy_plain.mat",
    "scipy_rows.mat",
    "scipy_loops.mat",
    "octave_struct.mat",
];

fn bytes(name: &str) -> Vec<u8> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/");
    std::fs::read(format!("{folder}{name}")).expect("a file of the tests")
}

fn recording(name: &str, options: &CsvOptions) -> Recording {
    read_from(&bytes(name)[..], options).expect("a table")
}

/// The square wave of the input: 1.5, then -1.5, for five rows each.
fn square(row: usize) -> f64 {
    if (row / 5).is_multiple_of(2) {
        1.5
    } else {
        -1.5
    }
}

/// Checks each row against the formulas of the script.
fn check(
    found: &Recording,
    input: impl Fn(usize) -> f64,
    output: impl Fn(usize) -> f64,
    rows: &[usize],
) {
    let [u, y] = [found.input(), found.output()];
    assert_eq!(u.len(), rows.len());
    for (at, &row) in rows.iter().enumerate() {
        assert!((u[at] - input(row)).abs() < 1e-12, "input {row}");
        assert!((y[at] - output(row)).abs() < 1e-12, "output {row}");
    }
}

// Columns in double precision, the output in single precision with a NaN in row 7; text, cells, a scalar and a matrix of
// other size are no columns.
#[test]
fn variables() {
    let found = recording("scipy_plain.mat", &CsvOptions::default());
    let rows: Vec<usize> = (0..400).filter(|row| *row != 7).collect();
    let output = |row: usize| f64::from((0.1 * row as f64).sin() as f32);
    check(&found, square, output, &rows);
    let text: Vec<String> = found.notes().iter().map(ToString::to_string).collect();
    let expected = "the MATLAB file has 3 columns of 400 rows; line 2 is the first row";
    assert!(text.iter().any(|note| note == expected), "{text:?}");
}

// Rows of whole numbers of 2, 1 and 8 bytes, compressed.
#[test]
fn whole_numbers_in_rows() {
    let found = recording(
        "scipy_rows.mat",
        &CsvOptions::default().sample_rate_hz(10.0),
    );
    let rows: Vec<usize> = (0..400).collect();
    let output = |row: usize| (1000.0 * (0.1 * row as f64).cos()).round();
    check(&found, |row| 2.0 * square(row), output, &rows);
}

// Fields of structures by the rules for tags.
#[test]
fn loops_by_tag() {
    let rows: Vec<usize> = (0..400).filter(|row| *row != 7).collect();
    let sine = |row: usize| f64::from((0.1 * row as f64).sin() as f32);
    let found = recording(
        "scipy_loops.mat",
        &CsvOptions::default().control_loop("LIC101"),
    );
    check(&found, square, sine, &rows);
    assert!(found.set_point().is_some());
    let found = recording(
        "scipy_loops.mat",
        &CsvOptions::default().control_loop("TIC205"),
    );
    check(
        &found,
        |row| square(row) + row as f64,
        |row| 2.0 * sine(row),
        &rows,
    );
}

// A structure of GNU Octave with a matrix of two outputs.
#[test]
fn structure_of_octave() {
    let found = recording(
        "octave_struct.mat",
        &CsvOptions::default().output_column("ydat_2"),
    );
    let rows: Vec<usize> = (0..400).collect();
    check(&found, square, |row| (0.1 * row as f64).cos(), &rows);
    let refused = read_from(&bytes("octave_struct.mat")[..], &CsvOptions::default());
    assert!(refused.unwrap_err().to_string().contains("ydat_1"));
}

/// A file by hand: `t` 0 to 0.75, `u` and `y` as given, most significant byte first or last.
fn by_hand(is_big_endian: bool) -> Vec<u8> {
    let word = |value: u32| match is_big_endian {
        true => value.to_be_bytes(),
        false => value.to_le_bytes(),
    };
    let number = |value: f64| match is_big_endian {
        true => value.to_be_bytes(),
        false => value.to_le_bytes(),
    };
    let element = |kind: u32, data: &[u8]| {
        let mut all = [word(kind), word(data.len() as u32)].concat();
        all.extend(data);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    };
    let matrix = |name: &str, values: &[f64]| {
        let flags = [word(6), word(0)].concat();
        let size = [word(values.len() as u32), word(1)].concat();
        let real: Vec<u8> = values.iter().flat_map(|value| number(*value)).collect();
        let parts = [
            element(6, &flags),
            element(5, &size),
            element(1, name.as_bytes()),
            element(9, &real),
        ];
        element(14, &parts.concat())
    };
    let mut file = b"MATLAB 5.0 MAT-file by hand".to_vec();
    file.resize(124, b' ');
    file.extend(if is_big_endian {
        *b"\x01\x00MI"
    } else {
        *b"\x00\x01IM"
    });
    for (name, values) in [
        ("t", [0.0, 0.25, 0.5, 0.75]),
        ("u", [1.0, -1.0, 1.0, -1.0]),
        ("y", [0.25, 0.5, -0.125, 1e-9]),
    ] {
        file.extend(matrix(name, &values));
    }
    file
}

#[test]
fn both_byte_orders() {
    for is_big_endian in [false, true] {
        let found = read_from(&by_hand(is_big_endian)[..], &CsvOptions::default()).unwrap();
        assert_eq!(found.output(), [0.25, 0.5, -0.125, 1e-9], "{is_big_endian}");
        assert_eq!(found.input(), [1.0, -1.0, 1.0, -1.0]);
    }
}

// Files without a table, of the next version, and with nothing behind the head.
#[test]
fn refusals() {
    let head = &by_hand(false)[..128];
    let error = read_from(head, &CsvOptions::default()).unwrap_err();
    assert!(matches!(error, ReadError::MatNoTable { .. }), "{error}");
    let newer = [
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".as_slice(),
        &[0; 200],
    ]
    .concat();
    let error = read_from(&newer[..], &CsvOptions::default()).unwrap_err();
    assert!(error.to_string().contains("save -v7"), "{error}");
    // The sizes of a matrix claim more numbers than there are.
    let mut long = by_hand(false);
    long[128 + 32..128 + 36].copy_from_slice(&0x7fff_ffff_u32.to_le_bytes());
    let error = read_from(&long[..], &CsvOptions::default()).unwrap_err();
    assert!(!matches!(error, ReadError::MatTooLarge), "{error}");
}

// 500 damaged files: no panic, and no number that is not finite.
#[test]
fn damaged_files_do_no_harm() {
    let mut state = 1_u64;
    let mut below = |end: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % end
    };
    let mut files: Vec<Vec<u8>> = FILES.iter().map(|name| bytes(name)).collect();
    files.extend([by_hand(false), by_hand(true)]);
    let mut read = 0;
    for at in 0..500 {
        let mut file = files[at % files.len()].clone();
        match below(3) {
            0 => file.truncate(20 + below(file.len() - 20)),
            1 => {
                let from = 20 + below(file.len() - 20);
                let to = (from + below(60)).min(file.len());
                file.drain(from..to);
            }
            _ => {
                for _ in 0..1 + below(6) {
                    let at = 20 + below(file.len() - 20);
                    file[at] = below(256) as u8;
                }
            }
        }
        match read_from(&file[..], &CsvOptions::default()) {
            Ok(found) => {
                read += 1;
                let values = found.input().iter().chain(found.output());
                assert!(values.chain(found.time_s()).all(|value| value.is_finite()));
            }
            Err(error) => assert!(error.to_string().len() < 2000),
        }
    }
    assert!(read > 20, "{read}");
}
