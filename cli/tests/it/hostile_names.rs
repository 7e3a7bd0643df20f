//! Names of files and columns that would command a page, a terminal or a parameter file.
#![cfg(unix)]

use crate::colours::{coloured, stripped};
use crate::common::{Scratch, Table, reported, run};
use crate::pages::root;

/// Markup, the end of a line, and the code that clears a terminal.
const NAME: &str = "<img src=x onerror=alert(1)>\n\"'&\u{1b}[2J";
const COLUMN: &str = "y <img src=x onerror=alert(1)></script><script>alert(2)</script>\u{1b}[2J";

fn recording(column: &str) -> String {
    let header = format!("time_s,\"{column}\",u");
    Table::clean().csv_of(&header, |sample| sample.time_s)
}

#[test]
fn a_page_shows_them_as_text() {
    let scratch = Scratch::new();
    let page = |name: &str, column: &str| {
        let path = scratch.write(name, recording(column).as_bytes());
        let (outcome, page) = reported(&["identify", &path, "--input", "3", "--output", "2"]);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        page
    };
    let hostile = page(&format!("{NAME}.csv"), COLUMN);
    assert!(hostile.contains("&lt;img src=x onerror"), "it is shown");
    assert!(!hostile.contains("<img src=x"), "it is markup");
    let scripts = |page: &str| page.matches("<script").count();
    assert_eq!(scripts(&hostile), scripts(&page("plain.csv", "y")));
}

#[test]
fn a_terminal_shows_them_as_text() {
    let scratch = Scratch::new();
    let path = scratch.write(&format!("{NAME}.csv"), recording(COLUMN).as_bytes());
    let missing = scratch.name(&format!("{NAME}.ulg"));
    for path in [&path, &missing] {
        let command = ["identify", path, "--input", "3", "--output", "2"];
        let [text, error] = coloured(&command, Some("CLICOLOR_FORCE"));
        // `stripped` panics at a code that does not set a colour.
        let told = stripped(&text) + &stripped(&error);
        let line = told.lines().find(|line| line.contains("onerror=alert(1)>"));
        assert!(line.is_some_and(|line| line.contains("\"'&")), "{told}");
    }
}

#[test]
fn a_parameter_file_takes_none_of_them() {
    let scratch = Scratch::new();
    let log = std::fs::read(root().join("examples/logs/px4_chirps.ulg")).unwrap();
    let written = |name: &str| {
        let path = scratch.write(name, &log);
        let out = Scratch::new();
        let ran = run(&["identify", &path, "--write", &out.name("new.params")]);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        ["new.params", "new.restore.params"]
            .map(|one| std::fs::read_to_string(out.path(one)).unwrap())
    };
    let hostile = written("x\n1\t1\tMC_PITCHRATE_P\t99\t9\nMC_ROLLRATE_P 9.ulg");
    assert_eq!(hostile, written("plain.ulg"));
}
