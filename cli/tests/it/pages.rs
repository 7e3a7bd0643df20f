//! README.md and the pages of the guide, and what they say that commands print.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::program;

/// The folder of the repository.
pub(crate) fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let is_root = |folder: &&Path| folder.join("ARCHITECTURE.md").exists();
    package.ancestors().find(is_root).unwrap().to_owned()
}

/// A file below it.
pub(crate) fn read(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap()
}

/// README.md and the pages of the guide.
pub(crate) fn pages() -> Vec<String> {
    let guide = fs::read_dir(root().join("docs/guide")).unwrap();
    let names = guide.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<String> = names.map(|name| format!("docs/guide/{name}")).collect();
    pages.sort_unstable();
    pages.insert(0, "README.md".to_owned());
    pages
}

/// Printed lines of a page, each run with its command.
fn printed(page: &str) -> Vec<(String, Vec<String>)> {
    let mut printed = vec![];
    let mut rest = page;
    while let Some((before, after)) = rest.split_once("```text\n") {
        let (block, behind) = after.split_once("```").unwrap();
        rest = behind;
        // A block in an item of a list is indented as its fence is.
        let indent = &before[before.trim_end_matches(' ').len()..];
        let block = block.replace("\\\n", " ");
        let lines = block
            .lines()
            .map(|line| line.strip_prefix(indent).unwrap_or(line));
        let mut lines = lines.map(str::to_owned).peekable();
        let command = if lines.peek().is_some_and(|line| line.starts_with("$ ")) {
            lines.next().unwrap()
        } else {
            continue;
        };
        printed.push((
            command,
            lines.take_while(|line| !line.starts_with("$ ")).collect(),
        ));
    }
    printed
}

/// Runs the commands of a program that the pages show and that are quick; returns their number, and a sentence for every line
/// that is shown and not printed.
pub(crate) fn misprints(name: &str, is_quick: impl Fn(&[&str]) -> bool) -> (usize, Vec<String>) {
    let (mut commands, mut found) = (0, vec![]);
    for page in pages() {
        for (command, lines) in printed(&read(&page)) {
            let words: Vec<&str> = command.split_whitespace().skip(1).collect();
            let Some((_, words)) = words.split_first().filter(|(first, _)| **first == name) else {
                continue;
            };
            if !is_quick(words) {
                continue;
            }
            let mut called = program(words[0]);
            let output = called.current_dir(root()).args(words).output().unwrap();
            let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
            let printed: BTreeSet<&str> = text.lines().map(str::trim_end).collect();
            let shown = lines.iter().map(|line| line.trim_end());
            let missing =
                shown.filter(|line| !line.is_empty() && *line != "..." && !printed.contains(line));
            found.extend(missing.map(|line| format!("{page}: {command}: {line}")));
            commands += 1;
        }
    }
    (commands, found)
}
