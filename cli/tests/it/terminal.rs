//! Output on a terminal: colours, widths, completions, manual.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::colours::{ESCAPE, coloured, only_colours_differ, stripped};
use crate::common::{Scratch, Table, names_in, run};

/// A recording with an identifiable process, and one with a clipped output.
fn recordings(folder: &Scratch) -> [String; 2] {
    let clipped = Table::noisy().map(|_, sample| sample.output = sample.output.clamp(-2e-3, 2e-3));
    [
        folder.write("noisy.csv", Table::noisy().csv().as_bytes()),
        folder.write("clipped.csv", clipped.csv().as_bytes()),
    ]
}

/// The path of a program, if it is installed.
#[expect(clippy::print_stderr, reason = "a test that cannot run says so")]
fn program(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let found = std::env::split_paths(&path)
        .map(|folder| folder.join(name))
        .find(|file| file.is_file());
    if found.is_none() {
        eprintln!("skipped: {name} is not installed");
    }
    found
}

// ---------------------------------------------------------------- colours

#[test]
fn colours_change_nothing_but_the_colours() {
    let folder = Scratch::new();
    let [good, clipped] = recordings(&folder);
    let commands: [&[&str]; 5] = [
        &["identify", &good],
        &["identify", &good, "--details"],
        &["identify", &clipped],
        &[
            "tune", "--k", "1", "--t-prop", "0.3", "--t-body", "2", "--tau", "0.1",
        ],
        &["fly", "altitude"],
    ];
    for command in commands {
        only_colours_differ(command);
    }
}

// A known cycle is green (32), a note yellow (33), a refusal bold red (1 and 31).
#[test]
fn verdicts_have_their_colours() {
    let folder = Scratch::new();
    let [good, clipped] = recordings(&folder);
    let [text, _] = coloured(
        &["identify", &good, "--cycles", "8", "--details"],
        Some("CLICOLOR_FORCE"),
    );
    assert!(text.contains("\x1b[32min the pack"), "{text}");
    assert!(text.contains("\x1b[33m  note:"), "{text}");
    assert!(text.contains("\x1b[1mController\x1b[0m"), "{text}");
    let [text, _] = coloured(&["identify", &clipped], Some("CLICOLOR_FORCE"));
    assert!(
        text.contains("\x1b[1m\x1b[31mNOT YET\x1b[0m: saturated"),
        "{text}"
    );
}

#[test]
fn only_the_word_before_a_complaint_is_coloured() {
    let command = ["identify", "missing.csv"];
    let [_, plain] = coloured(&command, None);
    let [_, forced] = coloured(&command, Some("CLICOLOR_FORCE"));
    assert!(
        plain.starts_with("onecycle: cannot open missing.csv"),
        "{plain}"
    );
    assert!(
        forced.starts_with("\x1b[1m\x1b[31monecycle:\x1b[0m cannot open missing.csv"),
        "{forced}"
    );
    assert_eq!(stripped(&forced), plain);
}

// JSON, completion scripts and manual pages never have colours.
#[test]
fn data_have_no_colours() {
    let folder = Scratch::new();
    let [good, _] = recordings(&folder);
    for command in [
        &["identify", good.as_str(), "--json"][..],
        &["completions", "zsh"],
        &["man"],
    ] {
        let [text, _] = coloured(command, Some("CLICOLOR_FORCE"));
        assert!(!text.contains(ESCAPE), "{command:?}");
    }
}

// ---------------------------------------------------------------- a terminal

/// Output of `onecycle identify` on a terminal of this width, in the folder of the file, whose name stands first in `arguments`;
/// `None` if the program `script` is not installed.
fn on_a_terminal(
    folder: &Path,
    arguments: &str,
    columns: usize,
    variable: Option<&str>,
) -> Option<String> {
    let script = program("script")?;
    // Without the progress indicator.
    let program = env!("CARGO_BIN_EXE_onecycle");
    let call = format!("stty rows 40 cols {columns}; '{program}' identify {arguments} 2>/dev/null");
    let mut command = Command::new(script);
    for other in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
        command.env_remove(other);
    }
    let output = command
        .args(["-qec", &call, "/dev/null"])
        .current_dir(folder)
        .env("TERM", "xterm-256color")
        .envs(variable.map(|variable| (variable, "1")))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Some(String::from_utf8(output.stdout).unwrap())
}

// The card is as wide as the terminal, from 60 to 100 columns, and has its colours where the terminal has some: of a recording, of a
// flight, and of one loop of it, whose gains have three columns.
#[cfg(target_os = "linux")]
#[test]
fn a_card_fits_its_terminal() {
    let folder = Scratch::new();
    recordings(&folder);
    let here = folder.path("");
    let logs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/logs");
    let (loop_lines, flight_lines) = ([30, 24], [40, 40]);
    for (folder, arguments, all_columns, lines) in [
        (&here, "noisy.csv", &[60, 80, 120, 200][..], loop_lines),
        (
            &logs,
            "ap_sysid_roll.bin --axis roll",
            &[60, 80][..],
            loop_lines,
        ),
        (&logs, "ap_sysid_roll.bin", &[60, 80][..], flight_lines),
    ] {
        for &columns in all_columns {
            let Some(text) = on_a_terminal(folder, arguments, columns, None) else {
                return;
            };
            assert!(text.contains("\x1b[32m"), "{text}");
            let text = stripped(&text);
            let all: Vec<&str> = text.lines().collect();
            let longest = all.iter().map(|line| line.trim_end().chars().count()).max();
            let widest = columns.min(100);
            assert!(
                longest <= Some(widest) && longest > Some(widest - 20),
                "{columns}: {text}"
            );
            assert!(all.len() <= lines[usize::from(columns > 60)], "{text}");
        }
    }
    let text = on_a_terminal(&here, "noisy.csv", 200, Some("NO_COLOR")).unwrap();
    assert!(!text.contains(ESCAPE), "{text}");
}

// ---------------------------------------------------------------- completions and the manual

#[test]
fn every_shell_has_a_script() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let outcome = run(&["completions", shell]);
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
        assert!(outcome.stdout.contains("identify"), "{shell}");
    }
    run(&["completions", "cmd"]).misused(&["cmd"]);
}

#[test]
fn bash_completes_a_command_an_option_and_a_value() {
    let Some(bash) = program("bash") else {
        return;
    };
    let folder = Scratch::new();
    let path = folder.write(
        "onecycle.bash",
        run(&["completions", "bash"]).stdout.as_bytes(),
    );
    let checked = Command::new(&bash).args(["-n", &path]).output().unwrap();
    assert!(checked.status.success(), "{checked:?}");
    // The completion of bash after these words.
    for (words, expected) in [
        ("onecycle ide", "identify"),
        ("onecycle identify --deta", "--details"),
        ("onecycle identify --hold he", "held"),
        ("onecycle live rel", "relay"),
    ] {
        let [.., before, current] = words.split(' ').collect::<Vec<_>>()[..] else {
            unreachable!("there are two words");
        };
        let script = format!(
            "source '{path}'; COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); \
             _onecycle onecycle '{current}' '{before}'; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        );
        let output = Command::new(&bash).args(["-c", &script]).output().unwrap();
        let completed = String::from_utf8_lossy(&output.stdout);
        assert_eq!(completed.trim_end(), expected, "{words}: {output:?}");
    }
}

/// The commands in a help text.
fn listed(help: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let lines = lines.take_while(|line| !line.is_empty());
    let names = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = names.filter_map(|line| line.split_whitespace().next());
    names
        .filter(|name| *name != "help")
        .map(str::to_owned)
        .collect()
}

// One page for the program, for each command and for each of their subcommands.
#[test]
fn every_command_has_a_page() {
    let folder = Scratch::new();
    let out = folder.name("man1");
    let outcome = run(&["man", "-o", &out]);
    assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(0), ""));
    let mut expected = vec!["onecycle.1".to_owned()];
    for command in listed(&run(&["--help"]).stdout) {
        expected.push(format!("onecycle-{command}.1"));
        let inside = listed(&run(&[&command, "--help"]).stdout);
        expected.extend(
            inside
                .iter()
                .map(|inside| format!("onecycle-{command}-{inside}.1")),
        );
    }
    for known in [
        "onecycle-identify.1",
        "onecycle-live-relay.1",
        "onecycle-simulate.1",
    ] {
        assert!(expected.iter().any(|name| name == known), "{expected:?}");
    }
    let mut pages = names_in(Path::new(&out));
    pages.sort();
    expected.sort();
    assert_eq!(pages, expected);
    for page in pages {
        let text = std::fs::read_to_string(Path::new(&out).join(&page)).unwrap();
        let name = page.trim_end_matches(".1").replace('-', "\\-");
        assert!(
            text.contains(&format!(".SH NAME\n{name} \\- ")),
            "{page}: {text}"
        );
        let examples = if page == "onecycle.1" {
            "\"FIRST STEPS\""
        } else {
            "EXAMPLES"
        };
        assert!(
            text.contains(&format!(".SH {examples}\n.nf\nonecycle ")),
            "{page}: {text}"
        );
        assert!(text.contains(".SH OPTIONS"), "{page}");
    }
    // Without -o, the page of the program is printed.
    let main = std::fs::read_to_string(Path::new(&out).join("onecycle.1")).unwrap();
    assert_eq!(run(&["man"]).stdout, main);
}

// A file in place of the folder: one sentence, and the exit code for outputs.
#[test]
fn pages_that_cannot_be_written_are_refused() {
    let folder = Scratch::new();
    let path = folder.write("file", b"");
    run(&["man", "-o", &path]).refused(crate::common::NOT_WRITTEN, &["file"]);
}

// Structure, part and hold that were asked for are those of the report.
#[test]
fn the_options_of_the_general_estimator_are_passed_on() {
    let folder = Scratch::new();
    let [noisy, _] = recordings(&folder);
    let asked = [
        "identify",
        &noisy,
        "--json",
        "--structure",
        "toiptd",
        "--from",
        "1",
        "--to",
        "5.5",
        "--hold",
        "interpolated",
    ];
    let report: serde_json::Value = serde_json::from_str(&run(&asked).stdout).unwrap();
    let structures = report["alternatives"].as_array().unwrap();
    assert_eq!(structures.len(), 1);
    assert_eq!(report["process"]["structure"], "toiptd");
    assert_eq!(report["record"]["hold"], "interpolated");
    assert_eq!(report["record"]["start_s"], 1.0);
    assert_eq!(report["record"]["end_s"], 5.5);
}
