//! README.md, the guide and docs/reproduction.md against what commands print.
//!
//! Figures: a comment `<!-- figures: "TEXT" "TEXT" -->` in a block of a page (paragraph, item of a list, table), or alone before
//! it, names blocks of docs/benchmarks.md by a text that stands in one of them only. Every number of the page's block must stand
//! in these. A row of a table is a block of docs/benchmarks.md, and a text of a table's head names the whole table.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use crate::common::onecycle;

fn root() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn read(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap()
}

/// README.md and the pages of the guide.
fn pages() -> Vec<String> {
    let guide = fs::read_dir(root().join("docs/guide")).unwrap();
    let names = guide.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<String> = names.map(|name| format!("docs/guide/{name}")).collect();
    pages.sort_unstable();
    pages.insert(0, "README.md".to_owned());
    pages
}

/// A paragraph, an item of a list or a table, on one line each.
#[derive(Debug)]
struct Block {
    heading: String,
    lines: Vec<String>,
}

impl Block {
    fn text(&self) -> String {
        self.lines.join(" ")
    }

    fn is_table(&self) -> bool {
        self.lines.iter().all(|line| line.starts_with('|'))
    }
}

/// The blocks of a page; code blocks are left out.
fn blocks(page: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = vec![];
    let (mut heading, mut is_code, mut is_open) = (String::new(), false, false);
    for line in page.lines().map(str::trim) {
        if line.starts_with("```") {
            (is_code, is_open) = (!is_code, false);
        } else if is_code || line.is_empty() {
            is_open = false;
        } else if line.starts_with('#') {
            (heading, is_open) = (line.trim_matches(['#', ' ']).to_owned(), false);
        } else {
            let is_item = line.starts_with("- ")
                || (line.split_once(". ")).is_some_and(|(number, _)| number.parse::<u8>().is_ok());
            let is_row = line.starts_with('|');
            let is_same = |block: &Block| is_row == block.is_table();
            match blocks.last_mut() {
                Some(block) if is_open && !is_item && is_same(block) => {
                    block.lines.push(line.to_owned());
                }
                _ => blocks.push(Block {
                    heading: heading.clone(),
                    lines: vec![line.to_owned()],
                }),
            }
            is_open = true;
        }
    }
    blocks
}

/// What stands between `open` and `close`, each time, and the text without it.
fn cut<'a>(text: &'a str, open: &str, close: &str) -> (Vec<&'a str>, String) {
    let (mut inside, mut outside, mut rest) = (vec![], String::new(), text);
    while let Some((before, after)) = rest.split_once(open) {
        let Some((within, behind)) = after.split_once(close) else {
            break;
        };
        outside += before;
        inside.push(within);
        rest = behind;
    }
    (inside, outside + rest)
}

/// The numbers of a text without their thousands separators; digits in names and exponents do not count.
fn numbers(text: &str) -> BTreeSet<String> {
    let characters: Vec<char> = text.chars().collect();
    let is_digit = |at: usize| characters.get(at).is_some_and(char::is_ascii_digit);
    let mut numbers = BTreeSet::new();
    let mut at = 0;
    while at < characters.len() {
        let begin = at;
        while is_digit(at)
            || (at > begin && matches!(characters[at], ',' | '.') && is_digit(at + 1))
        {
            at += 1;
        }
        let is_name = begin > 0
            && (characters[begin - 1].is_alphanumeric()
                || matches!(characters[begin - 1], '_' | '^'));
        if at > begin && !is_name {
            let number = characters[begin..at].iter().filter(|c| **c != ',');
            numbers.insert(number.collect());
        }
        at = at.max(begin + 1);
    }
    numbers
}

/// The numbers that a reader of a page sees, without those of code, formulas, addresses and items of a list.
fn figures(text: &str) -> BTreeSet<String> {
    let text = (text.split_once(". "))
        .filter(|(number, _)| number.parse::<u8>().is_ok())
        .map_or(text, |(_, item)| item);
    let pairs = [("<!--", "-->"), ("`", "`"), ("$", "$"), ("](", ")")];
    let shown = pairs.iter().fold(text.to_owned(), |text, (open, close)| {
        cut(&text, open, close).1
    });
    numbers(&shown)
}

/// Texts by which the figures of docs/benchmarks.md are named, each with the numbers that it stands for.
fn named(benchmarks: &str) -> Vec<(String, BTreeSet<String>)> {
    let mut named = vec![];
    for block in blocks(benchmarks) {
        let all = numbers(&block.text());
        if block.is_table() {
            let rows = block.lines.iter().skip(1);
            named.extend(rows.map(|row| (row.clone(), numbers(row))));
            named.push((block.lines[0].clone(), all));
        } else {
            named.push((block.text(), all));
        }
    }
    named
}

/// Sections of README.md in which every number needs its source.
const MEASURED: [&str; 2] = ["How accurate it is", "Limits"];

/// A sentence for every figure of a page that docs/benchmarks.md does not have.
fn offences(page: &str, benchmarks: &str, measured: &[&str]) -> Vec<String> {
    let named = named(benchmarks);
    let mut offences = vec![];
    let mut waiting = String::new();
    for block in blocks(page) {
        let text = std::mem::take(&mut waiting) + &block.text();
        let (comments, shown) = cut(&text, "<!-- figures:", "-->");
        if shown.trim().is_empty() {
            waiting = text;
            continue;
        }
        let found = figures(&text);
        let begin: String = shown.chars().take(60).collect();
        if comments.is_empty() {
            let needs =
                measured.contains(&block.heading.as_str()) || text.contains("benchmarks.md#");
            if needs && !found.is_empty() {
                offences.push(format!("{found:?} without a source: {begin}"));
            }
            continue;
        }
        let mut known = BTreeSet::new();
        for text in comments
            .iter()
            .flat_map(|comment| cut(comment, "\"", "\"").0)
        {
            let of: Vec<_> = named
                .iter()
                .filter(|(name, _)| name.contains(text))
                .collect();
            match &of[..] {
                [(_, numbers)] => known.extend(numbers),
                _ => offences.push(format!("'{text}' stands in {} blocks: {begin}", of.len())),
            }
        }
        let unknown: Vec<&String> = found.iter().filter(|one| !known.contains(one)).collect();
        if !unknown.is_empty() {
            offences.push(format!("{unknown:?} not in the benchmarks: {begin}"));
        }
    }
    offences
}

#[test]
fn every_figure_stands_in_the_benchmarks() {
    let benchmarks = read("docs/benchmarks.md");
    let mut found = vec![];
    for name in pages() {
        let measured: &[&str] = if name == "README.md" { &MEASURED } else { &[] };
        let of_page = offences(&read(&name), &benchmarks, measured);
        found.extend(of_page.iter().map(|offence| format!("{name}: {offence}")));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

const TABLE: &str = "\
Of 1,000 processes, noise up to 3 %:

| campaign | mean | median |
| --- | --- | --- |
| `a.toml` | 0.24 % | 0.14 % |
| `b.toml` | 0.25 % | 0.15 % |
";

// Right figures pass, by rows and by the head of the table. A figure of another row, a text that names nothing or two rows, and
// figures without a source are named.
#[test]
fn a_wrong_figure_is_named() {
    let of = |page: &str| offences(page, TABLE, &["Limits"]);
    assert_eq!(
        of("Of 1,000 it costs\n0.24 % <!-- figures: \"`a.toml`\" \"Of 1,000\" -->"),
        [""; 0]
    );
    assert_eq!(
        of("<!-- figures: \"| campaign\" -->\n\n| 0.24 | 0.15 |"),
        [""; 0]
    );
    assert_eq!(
        of("- one\n- costs 0.25 % (`x 7`, 1.5) <!-- figures: \"`a.toml`\" -->"),
        ["[\"0.25\", \"1.5\"] not in the benchmarks: - costs 0.25 % (`x 7`, 1.5) "]
    );
    let twice = of("none <!-- figures: \".toml\" \"c.toml\" -->");
    assert_eq!(
        twice,
        [
            "'.toml' stands in 2 blocks: none ",
            "'c.toml' stands in 0 blocks: none "
        ]
    );
    let bare = of("## Limits\n\n3 % fail.\n\n## Other\n\n4 % do not.\n\n[5 %](benchmarks.md#a)");
    assert_eq!(
        bare,
        [
            "{\"3\"} without a source: 3 % fail.",
            "{\"5\"} without a source: [5 %](benchmarks.md#a)"
        ]
    );
}

#[test]
fn readme_is_one_page() {
    let readme = read("README.md");
    let (lines, words) = (readme.lines().count(), readme.split_whitespace().count());
    assert!(
        lines <= 200 && words <= 1500,
        "{lines} lines, {words} words"
    );
}

/// Printed lines of a page, each run with its command. A block of the section about the whole output has no command.
fn printed(page: &str) -> Vec<(String, Vec<String>)> {
    let mut printed = vec![];
    let mut is_whole_output = false;
    let mut rest = page;
    while let Some((before, after)) = rest.split_once("```text\n") {
        for line in before.lines().filter(|line| line.starts_with("## ")) {
            is_whole_output = line == "## The output, line by line";
        }
        let (block, behind) = after.split_once("```").unwrap();
        rest = behind;
        let block = block.replace("\\\n", " ");
        let mut lines = block.lines().map(str::to_owned).peekable();
        let command = if lines.peek().is_some_and(|line| line.starts_with("$ ")) {
            lines.next().unwrap()
        } else if is_whole_output {
            "$ onecycle identify examples/simulated_hover.csv --details".to_owned()
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

// The commands that take less than a second: those of the tables in examples, of one process, and designs.
#[test]
fn printed_lines_are_those_of_the_program() {
    let mut commands = 0;
    let mut found = vec![];
    for name in pages() {
        for (command, lines) in printed(&read(&name)) {
            let words: Vec<&str> = command.split_whitespace().skip(2).collect();
            let is_quick = words
                .iter()
                .any(|word| word.starts_with("examples/") && word.ends_with(".csv"))
                || words.starts_with(&["certify", "--process"])
                || words.starts_with(&["tune"]);
            if !is_quick || !command.starts_with("$ onecycle ") {
                continue;
            }
            let output = onecycle()
                .current_dir(root())
                .args(&words)
                .output()
                .unwrap();
            let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
            let printed: BTreeSet<&str> = text.lines().map(str::trim_end).collect();
            let missing = lines
                .iter()
                .map(|line| line.trim_end())
                .filter(|line| !line.is_empty() && *line != "..." && !printed.contains(line));
            found.extend(missing.map(|line| format!("{name}: {command}: {line}")));
            commands += 1;
        }
    }
    assert!(commands > 10, "{commands}");
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// A cell as `onecycle reproduce` writes it.
fn cell(text: &toml::Value) -> String {
    text.as_str().unwrap().replace('|', "\\|")
}

fn texts<'a>(table: &'a toml::Table, key: &str) -> impl Iterator<Item = &'a toml::Value> {
    let values = table.get(key).and_then(toml::Value::as_array);
    values.into_iter().flatten()
}

// docs/reproduction.md is made by hours of work: titles, captions, remarks and claims must be those of the sheets all the same.
#[test]
fn the_reproduction_has_the_words_of_the_sheets() {
    let page = read("docs/reproduction.md");
    let mut expected = vec![];
    let mut sheets = 0;
    for entry in fs::read_dir(root().join("cli/reproduction")).unwrap() {
        let sheet: toml::Table = (fs::read_to_string(entry.unwrap().path()).unwrap())
            .parse()
            .unwrap();
        let Some(title) = sheet.get("title").and_then(toml::Value::as_str) else {
            continue;
        };
        sheets += 1;
        expected.push(format!("\n## {title}\n"));
        expected.extend(
            texts(&sheet, "remarks").map(|remark| format!("\n- {}\n", remark.as_str().unwrap())),
        );
        for table in texts(&sheet, "tables").map(|table| table.as_table().unwrap()) {
            expected.push(format!("\n{}\n\n", table["caption"].as_str().unwrap()));
            let columns: Vec<String> = texts(table, "columns").map(cell).collect();
            expected.push(format!("| {} |\n", columns.join(" | ")));
        }
        let settings = sheet.get("settings").and_then(toml::Value::as_table);
        for row in settings
            .into_iter()
            .flat_map(|settings| texts(settings, "rows"))
        {
            let cells: Vec<String> = row.as_array().unwrap().iter().map(cell).collect();
            expected.push(format!("\n| {} |\n", cells.join(" | ")));
        }
        for name in settings
            .into_iter()
            .flat_map(|settings| texts(settings, "variants"))
        {
            expected.push(format!("\n| {} | ", cell(&name["name"])));
        }
    }
    assert_eq!(sheets, 14);
    let missing: Vec<&String> = expected
        .iter()
        .filter(|text| !page.contains(*text))
        .collect();
    assert!(missing.is_empty(), "{missing:#?}");
}
