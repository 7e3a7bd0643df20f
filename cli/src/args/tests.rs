//! Tests of the help texts: every command has examples, the examples parse, and the files they name exist.

use std::path::Path;

use clap::{Command, CommandFactory, Parser};

use super::Arguments;

/// The program's name. Both programs have these tests.
fn name() -> String {
    Arguments::command().get_name().to_owned()
}

/// Every command with the words that call it; the program itself first.
fn commands() -> Vec<(String, Command)> {
    fn of(words: &str, command: &Command, all: &mut Vec<(String, Command)>) {
        all.push((words.to_owned(), command.clone()));
        for inside in command.get_subcommands() {
            of(&format!("{words} {}", inside.get_name()), inside, all);
        }
    }
    let mut all = vec![];
    of(&name(), &Arguments::command(), &mut all);
    all
}

/// The text after the options.
fn after_help(command: &Command) -> String {
    let text = command.get_after_help();
    text.map(ToString::to_string).unwrap_or_default()
}

/// Calls of the program in a help text. Lines that end in a backslash are joined, pipes are split, redirections are cut
/// off.
fn calls(help: &str) -> Vec<Vec<String>> {
    let joined = help.replace("\\\n", " ");
    let pieces =
        (joined.lines().filter(|line| line.starts_with(' '))).flat_map(|line| line.split('|'));
    let words = pieces.map(|piece| {
        let call = piece.split('>').next().unwrap_or_default();
        call.split_whitespace()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    });
    let program = name();
    let is_call = |words: &Vec<String>| words.first() == Some(&program);
    words.filter(is_call).collect()
}

// At least two examples for each command, by its own name.
#[test]
fn every_command_has_examples_of_itself() {
    for (words, command) in &commands()[1..] {
        let help = after_help(command);
        assert!(help.contains("Examples:\n"), "{words}: {help}");
        let is_own =
            |call: &&Vec<String>| format!("{} ", call.join(" ")).starts_with(&format!("{words} "));
        let own = calls(&help).iter().filter(is_own).count();
        assert!(own >= 2, "{words}: {help}");
    }
}

// Split at blanks as a shell does; no example may need quotes.
#[test]
fn every_example_parses() {
    let mut count = 0;
    for (words, command) in commands() {
        for call in calls(&after_help(&command)) {
            let quoted = call.iter().any(|word| word.contains(['\'', '"', '\\']));
            assert!(!quoted, "{call:?} needs a shell");
            let parsed = Arguments::try_parse_from(&call);
            assert!(parsed.is_ok(), "{words}: {call:?}: {:?}", parsed.err());
            count += 1;
        }
    }
    let least = 2 * (commands().len() - 1);
    assert!(count >= least, "{count} of {least}");
}

// Files of this repository that an example names exist.
#[test]
fn files_of_examples_are_there() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let is_root = |folder: &&Path| folder.join("ARCHITECTURE.md").exists();
    let root = package.ancestors().find(is_root).unwrap();
    let mut count = 0;
    for (words, command) in commands() {
        let help = after_help(&command);
        let lines = help.lines().filter(|line| line.starts_with(' '));
        let files = lines.flat_map(str::split_whitespace);
        for file in files.filter(|word| {
            ["examples/", "experiments/", "research/"]
                .iter()
                .any(|folder| word.starts_with(folder))
        }) {
            assert!(root.join(file).exists(), "{words}: {file}");
            count += 1;
        }
    }
    assert!(count > 2, "{count}");
}

// Names, conflicts and defaults that clap checks at run time.
#[test]
fn clap_finds_nothing_amiss() {
    Arguments::command().debug_assert();
}
