//! Links between pages, and the files and functions that pages name.

use std::fs;
use std::path::Path;

use crate::pages::{read, root};

/// All pages of the repository, by their paths from its folder.
pub(crate) fn all_pages() -> Vec<String> {
    fn add(folder: &Path, below: &str, pages: &mut Vec<String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            let is_made = name == "target" || name.starts_with('.');
            if entry.file_type().unwrap().is_dir() && !is_made {
                add(&entry.path(), &format!("{below}{name}/"), pages);
            } else if name.ends_with(".md") {
                pages.push(format!("{below}{name}"));
            }
        }
    }
    let mut pages = vec![];
    add(&root(), "", &mut pages);
    pages.sort_unstable();
    pages
}

/// A page without its blocks of code.
fn without_blocks(page: &str) -> String {
    let parts = page.split("```").step_by(2);
    parts.collect::<Vec<_>>().join("")
}

/// What stands between backticks.
fn spans(page: &str) -> Vec<String> {
    let text = without_blocks(page);
    let spans = text.split('`').skip(1).step_by(2);
    spans.map(str::to_owned).collect()
}

/// Where the links of a page go.
pub(crate) fn targets(page: &str) -> Vec<String> {
    let text = without_blocks(page);
    let prose: Vec<&str> = text.split('`').step_by(2).collect();
    let prose = prose.join("");
    let links = prose.split("](").skip(1);
    let targets = links.filter_map(|link| link.split_once(')'));
    targets.map(|(target, _)| target.to_owned()).collect()
}

/// The name by which a link calls a heading.
fn anchor(heading: &str) -> String {
    let kept = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    let lower = heading.to_lowercase();
    let name: String = lower.chars().filter(|c| kept(*c)).collect();
    name.replace(' ', "-")
}

/// A section of a page, up to the next heading of its level or above.
pub(crate) fn section(page: &str, name: &str) -> Option<String> {
    let level = |line: &str| line.find(|c| c != '#').filter(|level| *level > 0);
    let mut lines = page.lines().skip_while(|line| {
        let is_it = |level: usize| anchor(line[level..].trim()) == name;
        !level(line).is_some_and(is_it)
    });
    let own = level(lines.next()?)?;
    let text = lines.take_while(|line| level(line).is_none_or(|level| level > own));
    Some(text.collect::<Vec<_>>().join("\n"))
}

/// A sentence for every link of a page that leads nowhere.
fn dead(name: &str, page: &str) -> Vec<String> {
    let folder = root().join(name).parent().unwrap().to_owned();
    let is_ours = |target: &&String| !target.contains("://") && !target.starts_with("mailto:");
    let leads = |target: &String| {
        let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
        let path = folder.join(file);
        let text = if file.is_empty() {
            Some(page.to_owned())
        } else if anchor.is_empty() || !file.ends_with(".md") {
            return path.exists();
        } else {
            fs::read_to_string(path).ok()
        };
        text.is_some_and(|text| section(&text, anchor).is_some())
    };
    let targets = targets(page);
    let dead = targets
        .iter()
        .filter(is_ours)
        .filter(|target| !leads(target));
    dead.map(|target| format!("{name}: {target}")).collect()
}

#[test]
fn every_link_leads_somewhere() {
    let pages = all_pages();
    let found: Vec<String> = (pages.iter())
        .flat_map(|name| dead(name, &read(name)))
        .collect();
    assert!(pages.len() > 50, "{pages:?}");
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn a_dead_link_is_named() {
    let of = |text: &str| dead("docs/x.md", text);
    let right =
        "# A b, c\n[a](#a-b-c) [b](../README.md#limits) [c](guide/) [d](https://x.y/z) `[e](f)`";
    assert_eq!(of(right), [""; 0]);
    assert_eq!(of("[a](README.md)"), ["docs/x.md: README.md"]);
    assert_eq!(
        of("[a](../README.md#limit) [b](#c)"),
        ["docs/x.md: ../README.md#limit", "docs/x.md: #c"]
    );
}

/// A sentence for every file and function that a page names and that does not exist. A span with a slash, without spaces, is a
/// path from the folder of the repository. A span that ends with `()` is a function of a file that the same paragraph, item or row names.
fn absent(page: &str) -> Vec<String> {
    let mut found = vec![];
    let is_table = |line: &str| line.starts_with('|');
    let mut blocks: Vec<String> = vec![];
    for line in without_blocks(page).lines() {
        match blocks.last_mut() {
            Some(block)
                if !line.trim().is_empty() && !is_table(line) && !line.starts_with("- ") =>
            {
                *block += &format!("\n{line}");
            }
            _ => blocks.push(line.to_owned()),
        }
    }
    for block in blocks {
        let (mut files, mut functions) = (vec![], vec![]);
        for span in spans(&block) {
            let is_path = span.contains('/') || span.ends_with(".rs");
            if let Some(function) = span.strip_suffix("()") {
                functions.push(function.to_owned());
            } else if is_path && !span.contains([' ', '*', '=', '<']) {
                files.push(span);
            }
        }
        let is_there = |file: &&String| root().join(file).exists();
        found.extend(files.iter().filter(|file| !is_there(file)).cloned());
        let texts: Vec<String> = (files.iter().filter(|file| file.ends_with(".rs")))
            .filter_map(|file| fs::read_to_string(root().join(file)).ok())
            .collect();
        for function in functions {
            let name = function.rsplit("::").next().unwrap();
            let is_defined = |text: &String| {
                ["(", "<"]
                    .iter()
                    .any(|end| text.contains(&format!("fn {name}{end}")))
            };
            if !texts.iter().any(is_defined) {
                found.push(format!("{function}()"));
            }
        }
    }
    found
}

// ARCHITECTURE.md, the tour and the recipes send readers to files and functions.
#[test]
fn named_files_and_functions_exist() {
    for name in [
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "docs/glossary.md",
        "docs/tour.md",
    ] {
        let page = read(name);
        assert!(spans(&page).len() > 20, "{name}");
        assert_eq!(absent(&page), [""; 0], "{name}");
    }
}

#[test]
fn an_absent_file_is_named() {
    assert_eq!(
        absent("`cli/src/run.rs`: `nothing()`\n\n| `link/src/no.rs` | `link/` |"),
        ["nothing()", "link/src/no.rs"]
    );
    assert_eq!(
        absent("`cli/tests/it/links.rs` has\n`absent()`, `a b/c`"),
        [""; 0]
    );
    assert_eq!(
        absent("- `cli/tests/it/links.rs`\n- `absent()`"),
        ["absent()"]
    );
}
