//! Files of grids: they read back, and every kind of damage is refused with an error that names it.

use std::io;
use std::sync::OnceLock;

use onecycle_lab::space::Space;
use onecycle_lab::space::grid::{Grid, GridFile, GridSettings, check, rounded, row, rows, write};
use onecycle_lab::workers::OneThread;

use super::{same, ten_percent};
use crate::common::Threads;

fn small() -> &'static Grid {
    static GRID: OnceLock<Grid> = OnceLock::new();
    GRID.get_or_init(|| {
        let space = Space {
            t_body_s: (0.5, 1.0),
            ..Space::MULTIROTOR
        };
        let settings = GridSettings {
            space,
            deterioration: 0.5,
            ..GridSettings::default()
        };
        Grid::build(&settings, &Threads(2)).unwrap()
    })
}

fn file(grid: &Grid, checked: bool) -> String {
    let found = checked.then(|| check(grid, 50, 1, &OneThread).unwrap());
    let mut bytes = Vec::new();
    let mut costs = (0..grid.members.len()).map(|i| {
        let costs = grid.costs(i).into_iter();
        io::Result::Ok(costs.map(|cost| cost.map(rounded)).collect())
    });
    write(&mut bytes, grid, found.as_ref(), Some(&mut costs)).unwrap();
    String::from_utf8(bytes).unwrap()
}

// Settings, angles and gains read back exactly, the matrix to its precision of 1e-6.
#[test]
fn a_file_reads_back() {
    let grid = small();
    let text = file(grid, true);
    let read = GridFile::read(&text).unwrap();
    assert_eq!(read.settings, grid.settings);
    assert!(
        read.check
            .is_some_and(|check| check.processes == 50 && check.beyond == 0)
    );
    let matrix = read.matrix.as_ref().unwrap();
    let again = read.grid(&Threads(2)).unwrap();
    for (i, (a, b)) in grid.members.iter().zip(&again.members).enumerate() {
        assert_eq!(
            (a.direction, a.radius_s, a.place),
            (b.direction, b.radius_s, b.place)
        );
        assert!(same(a.candidate.optimum.pd.kp, b.candidate.optimum.pd.kp));
        for (cost, written) in grid.costs(i).into_iter().zip(&matrix[i]) {
            match (cost, written) {
                (Some(cost), Some(written)) => assert!((cost - written).abs() <= 0.51e-6),
                (cost, written) => assert_eq!((cost, *written), (None, None)),
            }
        }
    }
    // Unstable pairs are null, such as the slowest member's controller on the fastest process.
    assert!(matrix.iter().flatten().any(Option::is_none));
    // A grid that is written again after reading is the same, also without a matrix.
    let mut bytes = Vec::new();
    write(&mut bytes, grid, None, None).unwrap();
    let text = String::from_utf8(bytes).unwrap();
    assert!(text.contains("\"check\":null") && text.ends_with("\"matrix\":null}\n"));
    assert_eq!(GridFile::read(&text).unwrap().members, read.members);
}

/// The file with the value of the first `key` after `after` replaced.
fn with(text: &str, after: &str, key: &str, value: &str) -> String {
    let from = text.find(after).unwrap();
    let key = format!("\"{key}\":");
    let begin = from + text[from..].find(&key).unwrap() + key.len();
    let length = text[begin..].find([',', '}']).unwrap();
    format!("{}{value}{}", &text[..begin], &text[begin + length..])
}

/// Asserts that every damaged file is refused with an error that contains the given words.
fn refused(text: &str, damages: &[(String, &str)]) {
    for (number, (damaged, words)) in damages.iter().enumerate() {
        assert_ne!(damaged, text, "damage {number} is none");
        let error = GridFile::read(damaged)
            .map(|_| ())
            .expect_err(words)
            .to_string();
        assert!(
            error.contains(words),
            "{number}: {words} is not in: {error}"
        );
        assert!(!error.contains('\n') && error.len() < 300, "{error}");
    }
}

#[test]
fn damaged_settings_are_refused() {
    let text = file(small(), false);
    let head = |key, value| with(&text, "{", key, value);
    refused(
        &text,
        &[
            (String::new(), "not a grid"),
            ("[1, 2]".to_owned(), "not a grid"),
            (text[..text.len() / 2].to_owned(), "not a grid"),
            (
                text.replace("grid/1", "grid/2"),
                "format is \"onecycle.grid/2\"",
            ),
            (head("format", "3"), "format is 3"),
            (text.replace("\"settings\"", "\"setting\""), "setting"),
            (head("deterioration", "7"), "deterioration must be"),
            (head("phase_margin_deg", "170"), "phase_margin_deg must be"),
            (head("beta", "-0.5"), "member 0: k_over_t_body"),
            (
                head("layout", "\"fewest\""),
                "member 0: a grid of this layout must not name row",
            ),
        ],
    );
}

#[test]
fn damaged_members_are_refused() {
    let text = file(small(), false);
    let begin = text.find("\"members\":[").unwrap() + "\"members\":[\n".len();
    let first = &text[begin..begin + text[begin..].find('\n').unwrap() + 1];
    let before = &text[..text.find(",\n\"members\"").unwrap()];
    let member = |key, value| with(&text, "\"members\"", key, value);
    refused(
        &text,
        &[
            (text.replacen("\"rung\"", "\"rang\"", 1), "rang"),
            (member("kp", "1e999"), "not a grid"),
            (member("kp", "NaN"), "not a grid"),
            (member("kp", "null"), "not a grid"),
            (member("kp", "-1"), "member 0: kp is -1"),
            (member("kd", "0.5"), "member 0: kd is 0.5"),
            (member("ise", "0.5"), "member 0: ise is 0.5"),
            (member("k_over_t_body", "1"), "member 0: k_over_t_body is 1"),
            (member("theta_rad", "1.1"), "member 0: its angles"),
            (member("r_s", "1.1"), "member 0: its angles"),
            (member("tau_s", "0.2"), "member 0: 0.2 s is outside"),
            (member("t_prop_s", "-0.2"), "member 0: -0.2 s is outside"),
            (member("row", "null"), "member 0: row, ray, rung"),
            (member("alpha", "0.9"), "member 0: row, ray, rung"),
            (member("row", "999"), "member 1: it is out of the order"),
            (
                text.replacen(first, &format!("{first}{first}"), 1),
                "member 1: it is out of the order",
            ),
            (
                format!("{before},\"members\":[],\"matrix\":null}}"),
                "no members",
            ),
            (text.replacen(first, "", 1), "matrix: it must have"),
        ],
    );
}

#[test]
fn damaged_matrices_are_refused() {
    let text = file(small(), false);
    let begin = text.find("\"matrix\":[").unwrap() + "\"matrix\":[\n".len();
    let (before, matrix) = text.split_at(begin);
    let row = &matrix[..=matrix.find('\n').unwrap()];
    refused(
        &text,
        &[
            (text.replacen(row, "", 1), "matrix: it must have"),
            (
                text.replacen(row, &row.replacen("0.0,", "", 1), 1),
                "matrix: it must have",
            ),
            (
                format!("{before}{}", matrix.replace("0.", "1.")),
                "matrix: row",
            ),
        ],
    );
}

// Reading checks a sample of the members; making the grid of a file checks every member.
#[test]
fn every_member_is_computed_afresh() {
    let grid = ten_percent();
    let mut bytes = Vec::new();
    write(&mut bytes, grid, None, None).unwrap();
    let text = String::from_utf8(bytes).unwrap();
    let spoilt = (0..20).find_map(|number| {
        let kd = format!("\"kd\":{:?}", grid.members[number].candidate.optimum.pd.kd);
        let spoilt = text.replacen(&kd, "\"kd\":0.7", 1);
        GridFile::read(&spoilt).ok()
    });
    let error = spoilt.unwrap().grid(&Threads(2)).unwrap_err().to_string();
    assert!(error.contains("kd is 0.7"), "{error}");
}

// The pieces together are the whole grid.
#[test]
fn pieces_make_the_grid() {
    let grid = small();
    let settings = &grid.settings;
    let rays: Vec<_> = rows(settings, &OneThread)
        .unwrap()
        .iter()
        .map(|&theta| row(settings, theta).unwrap())
        .collect();
    assert_eq!(&Grid::of_rays(settings, &rays, &OneThread).unwrap(), grid);
}
