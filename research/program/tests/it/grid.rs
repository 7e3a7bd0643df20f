//! `grid`: reports, files, interruptions, refusals.

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::common::{NOT_WRITTEN, Outcome, Scratch, UNREADABLE, figures, program, reported, run};
use serde_json::Value;

/// A small part of the paper's space.
const SPACE: &str = "t_prop_s = [0.03, 0.1]\nt_body_s = [0.5, 1.0]\ntau_s = [0.005, 0.05]\n";

/// A folder with [`SPACE`], and the path of the space.
fn space() -> (Scratch, String) {
    let folder = Scratch::new();
    let path = folder.write("space.toml", SPACE.as_bytes());
    (folder, path)
}

fn grid(arguments: &[&str]) -> Outcome {
    let outcome = run(&[&["grid"], arguments].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    outcome
}

fn read(path: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

// ---------------------------------------------------------------- reports and files

// A grid is made, checked, written and drawn; then read and checked again.
#[test]
fn from_space_to_file_and_back() {
    let (folder, space) = space();
    let [out, page] = ["grid.json", "grid.html"].map(|name| folder.name(name));
    let files = ["--out", &out, "--report", &page];
    let made = grid(&[&[space.as_str(), "--check", "500"], &files[..]].concat());
    assert_eq!(made.stderr, "");
    made.without_nan();
    for words in [
        "T_prop 0.03 .. 0.1 s",
        "neighbours 10.00 % apart, gains by the amplitude",
        "Members  ",
        "500 random processes, seed 1",
        "Every process of the check is within 10.00 % of a member.",
    ] {
        assert!(made.stdout.contains(words), "{words}: {}", made.stdout);
    }
    assert_eq!(folder.files().len(), 3, "{:?}", folder.files());
    let page = std::fs::read_to_string(page).unwrap();
    assert_eq!(figures(&page).len(), 5);

    let file = read(&out);
    assert_eq!(file["format"], "onecycle.grid/1");
    assert_eq!(file["settings"]["deterioration"], 0.1);
    assert_eq!(file["settings"]["layout"], "rays");
    assert_eq!(file["settings"]["gains"], "same_amplitude");
    assert_eq!(file["settings"]["space"]["beta"], -0.73);
    assert_eq!(file["check"]["processes"], 500);
    let members = file["members"].as_array().unwrap();
    assert!((10..100).contains(&members.len()), "{}", members.len());
    let matrix = file["matrix"].as_array().unwrap();
    assert_eq!(matrix.len(), members.len());
    assert!((0..members.len()).all(|i| matrix[i][i] == 0.0));

    let again = grid(&["--from", &out, "--check", "500", "--json"]).report();
    assert_eq!(again.0["schema"], "onecycle.grid.summary/1");
    assert_eq!(again.0["members"], members.len());
    assert_eq!(
        (&again.0["holds"], &again.0["has_matrix"]),
        (&true.into(), &true.into())
    );
    let rows = again.0["members_per_row"].as_array().unwrap();
    let total: u64 = rows.iter().filter_map(Value::as_u64).sum();
    assert_eq!(total, members.len() as u64);
    // Members computed again agree to about 1e-9.
    let worst = file["check"]["worst"].as_f64().unwrap();
    assert!((again.number("/check/worst") - worst).abs() < 1e-9);
    assert!(again.number("/alpha/least") > 1.1);
    assert!(again.number("/alpha/most") >= again.number("/alpha/least"));
    // Another seed gives another check; without --check, that of the file is reported.
    let other = grid(&["--from", &out, "--check", "500", "--seed", "9", "--json"]).report();
    assert_ne!(other.0["check"], again.0["check"]);
    assert_eq!(
        grid(&["--from", &out, "--json"]).report().0["check"],
        file["check"]
    );
}

#[test]
fn the_fewest_and_equal_gains() {
    let (folder, space) = space();
    let count = |arguments: &[&str]| -> u64 {
        let outcome = grid(&[&[space.as_str(), "--json", "--check", "300"], arguments].concat());
        let report = outcome.report();
        assert_eq!(report.0["holds"], true);
        report.0["members"].as_u64().unwrap()
    };
    let out = folder.name("grid.json");
    let (rays, fewest) = (count(&[]), count(&["--fewest", "--out", &out]));
    assert!(4 * fewest < rays, "{fewest} {rays}");
    assert!(rays < count(&["--equal-gains"]));
    assert!(rays < count(&["--deterioration", "0.05"]));
    let file = read(&out);
    assert_eq!(file["settings"]["layout"], "fewest");
    assert_eq!(file["members"][0]["row"], Value::Null);
    assert_eq!(file["matrix"].as_array().unwrap().len() as u64, fewest);
    let (again, page) = reported(&["grid", "--from", &out]);
    assert!(
        again.stdout.contains("the fewest within 10.00 %"),
        "{}",
        again.stdout
    );
    assert_eq!(figures(&page).len(), 5);
}

// The same bytes on one and on three threads, and with both spellings of the deterioration.
#[test]
fn the_same_bytes_at_any_number_of_threads() {
    let (folder, space) = space();
    let [one, three] = ["one.json", "three.json"].map(|name| folder.name(name));
    let check = ["--check", "200", "--seed", "4"];
    grid(
        &[
            &[
                &space,
                "--deterioration",
                "15 %",
                "--threads",
                "1",
                "--out",
                &one,
            ],
            &check[..],
        ]
        .concat(),
    );
    grid(
        &[
            &[
                &space,
                "--deterioration",
                "0.15",
                "--threads",
                "3",
                "--out",
                &three,
            ],
            &check[..],
        ]
        .concat(),
    );
    assert!(
        std::fs::read(one).unwrap() == std::fs::read(three).unwrap(),
        "other bytes"
    );
}

// A grid with a single member: the check fails, with its exit code.
#[test]
fn a_grid_that_does_not_hold() {
    let (folder, space) = space();
    let out = folder.name("grid.json");
    grid(&[&space, "--fewest", "--deterioration", "20%", "--out", &out]);
    let mut file = read(&out);
    assert_eq!(file["check"], Value::Null);
    file["members"].as_array_mut().unwrap().truncate(1);
    file["matrix"] = Value::Null;
    std::fs::write(&out, file.to_string()).unwrap();
    let checked = run(&["grid", "--from", &out, "--check", "200"]);
    assert_eq!(checked.code, Some(4), "{checked:?}");
    assert!(
        checked
            .stdout
            .contains("are farther than 20.00 % from every member")
    );
}

// ---------------------------------------------------------------- stopped and gone on with

/// Kills a run once its journal has this number of lines; returns the journal.
fn killed(arguments: &[&str], part: &std::path::Path, lines: usize) -> Vec<u8> {
    let mut child = program("grid")
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begin = Instant::now();
    loop {
        let bytes = std::fs::read(part).unwrap_or_default();
        let ended = child.try_wait().unwrap();
        assert!(ended.is_none(), "it was done before it was stopped");
        if bytes.iter().filter(|&&byte| byte == b'\n').count() >= lines {
            break;
        }
        assert!(
            begin.elapsed() < Duration::from_secs(60),
            "no {lines} lines"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    std::fs::read(part).unwrap()
}

// Killed among the rows and in the check, then with the journal cut at several places: the grid has the same bytes, and
// the work folder is gone.
#[test]
fn an_interrupted_run_is_gone_on_with() {
    let (folder, space) = space();
    let [whole, out] = ["whole.json", "grid.json"].map(|name| folder.name(name));
    let to = |out| {
        [
            "grid",
            &space,
            "--deterioration",
            "7%",
            "--check",
            "2000",
            "--out",
            out,
        ]
    };
    run(&to(&whole));
    let expected = std::fs::read(&whole).unwrap();
    let work = folder.path("grid.json.part");
    let part = work.join("journal.jsonl");
    let resumes = |left: &[u8]| {
        std::fs::create_dir_all(&work).unwrap();
        std::fs::write(&part, left).unwrap();
        assert!(!folder.path("grid.json").exists());
        let resumed = run(&to(&out));
        assert_eq!(resumed.code, Some(0), "{resumed:?}");
        assert!(std::fs::read(&out).unwrap() == expected, "other bytes");
        assert!(!work.exists());
        std::fs::remove_file(&out).unwrap();
        resumed.stderr
    };
    // Head, angles, and one or two rows.
    let said = resumes(&killed(&to(&out), &part, 3));
    assert!(said.starts_with("onecycle-lab: resuming after "), "{said}");
    assert!(
        said.contains(" rows of ") && said.lines().count() == 1,
        "{said}"
    );

    let members = read(&whole)["members"].as_array().unwrap().clone();
    let rows = members.last().unwrap()["row"].as_u64().unwrap() as usize + 1;
    let left = killed(&to(&out), &part, 2 + rows + members.len());
    let ends: Vec<usize> = (0..left.len())
        .filter(|&k| left[k] == b'\n')
        .map(|k| k + 1)
        .collect();
    for (length, words) in [
        (
            left.len(),
            format!("the costs of {} members", members.len()),
        ),
        (
            left.len() - 1,
            format!("the costs of {} members", members.len() - 1),
        ),
        (ends[2 + rows + 4] + 9, "the costs of 5 members".to_owned()),
        (ends[1 + rows], format!("{rows} of {rows} rows")),
        (ends[3] + 30, format!("2 of {rows} rows")),
    ] {
        let said = resumes(&left[..length]);
        assert!(said.contains(&words), "{words}: {said}");
    }
    // Cut in the angles, in the head, and empty.
    for length in [ends[0] + 9, 17, 0] {
        assert_eq!(resumes(&left[..length]), "");
    }
}

#[test]
fn a_part_of_something_else() {
    let (folder, space) = space();
    let out = folder.name("grid.json");
    let part = folder.path("grid.json.part").join("journal.jsonl");
    let make = |more: &[&str]| run(&[&["grid", &space, "--out", &out], more].concat());
    let quick = ["--deterioration", "30%"];
    // A journal with other settings is refused and kept.
    let left = killed(
        &["grid", &space, "--out", &out, "--deterioration", "4%"],
        &part,
        3,
    );
    let refused = make(&quick);
    refused.refused(
        UNREADABLE,
        &[
            "grid.json.part",
            "other settings, deterioration 0.04 instead of 0.3",
            "--restart",
        ],
    );
    assert_eq!(std::fs::read(&part).unwrap(), left);
    // A damaged journal, or one in another order, is refused too.
    let text = String::from_utf8(left).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let four = ["--deterioration", "4%"];
    for (damaged, words) in [
        (
            [lines[0], "{\"thetas_rad\":[1.0,", lines[2], ""].join("\n"),
            "line 2 is damaged",
        ),
        (
            [lines[0], lines[2], lines[1], ""].join("\n"),
            "line 2 is out of order",
        ),
        (
            [lines[0], lines[1], "{\"costs\":[0.0]}", ""].join("\n"),
            "line 3 is out of order",
        ),
    ] {
        std::fs::write(&part, damaged).unwrap();
        make(&four).refused(UNREADABLE, &["grid.json.part", words, "--restart"]);
    }
    let restarted = make(&["--deterioration", "30%", "--restart"]);
    assert_eq!((restarted.code, restarted.stderr.as_str()), (Some(0), ""));
    assert!(!folder.path("grid.json.part").exists());
}

// ---------------------------------------------------------------- refusals

#[test]
fn bad_arguments() {
    for (arguments, words) in [
        (&["--deterioration", "0"][..], "0.1 % and 100 %"),
        (&["--deterioration", "0.05%"], "0.1 % and 100 %"),
        (&["--deterioration", "101%"], "0.1 % and 100 %"),
        (&["--deterioration", "-5%"], "0.1 % and 100 %"),
        (&["--deterioration", "nan"], "percentage"),
        (&["--deterioration", "ten"], "percentage"),
        (&["--check", "0"], "1..=10000000"),
        (&["--check", "-1"], "-1"),
        (&["--threads", "0"], "1..=1024"),
        (&["--seed", "1"], "required arguments"),
        (&["--matrix"], "required arguments"),
        (&["--restart"], "required arguments"),
        (&["--from", "g.json", "space.toml"], "cannot be used with"),
        (
            &["--from", "g.json", "--out", "h.json"],
            "cannot be used with",
        ),
        (&["--from", "g.json", "--fewest"], "cannot be used with"),
        (
            &["--from", "g.json", "--deterioration", "5%"],
            "cannot be used with",
        ),
    ] {
        run(&[&["grid"], arguments].concat()).misused(&[]);
        let outcome = run(&[&["grid"], arguments].concat());
        assert!(
            outcome.stderr.contains(words),
            "{words}: {}",
            outcome.stderr
        );
    }
}

#[test]
fn bad_files() {
    let (folder, space) = space();
    let out = folder.name("grid.json");
    let missing = folder.name("nosuch.json");
    run(&["grid", "--from", &missing]).refused(UNREADABLE, &["nosuch.json", "No such file"]);
    run(&["grid", &missing]).refused(UNREADABLE, &["nosuch.json", "No such file"]);
    run(&["grid", "--from", &space]).refused(UNREADABLE, &["space.toml", "not a grid"]);
    grid(&[&space, "--deterioration", "50%", "--out", &out]);
    let text = std::fs::read_to_string(&out).unwrap();
    for (damaged, words) in [
        (text[..text.len() / 2].to_owned(), "not a grid"),
        (text.replace("grid/1", "grid/9"), "make the grid again"),
        (
            text.replacen("\"kp\":0", "\"kp\":1", 1),
            "member 0: kp is 1",
        ),
        (text.replace("0.5,1.0", "0.9,1.0"), "is outside the space"),
    ] {
        assert_ne!(damaged, text, "{words}");
        let path = folder.write("damaged.json", damaged.as_bytes());
        run(&["grid", "--from", &path]).refused(UNREADABLE, &["damaged.json", words]);
    }
    // Outputs that cannot be written are refused before and after the work.
    let nowhere = folder.name("nosuch/grid.json");
    run(&["grid", &space, "--out", &nowhere]).refused(NOT_WRITTEN, &["cannot write", "nosuch"]);
    let nowhere = folder.name("nosuch/grid.html");
    run(&["grid", "--from", &out, "--report", &nowhere]).refused(NOT_WRITTEN, &["grid.html"]);
    run(&["grid", "--picture", "grid.svg"]).misused(&["--picture"]);
    // An invalid space.
    let backwards = SPACE.replace("[0.03, 0.1]", "[0.1, 0.03]");
    let path = folder.write("backwards.toml", backwards.as_bytes());
    run(&["grid", &path]).refused(UNREADABLE, &["t_prop_s", "the lower time first"]);
}

#[test]
fn a_grid_as_a_page() {
    let (ran, page) = reported(&["grid", "--deterioration", "50%"]);
    assert_eq!(ran.code, Some(0));
    assert_eq!(figures(&page).len(), 5);
    assert!(page.contains("neighbours 50.00 % apart"));
}
