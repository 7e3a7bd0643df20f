//! README.md and the guide against the tables of docs/benchmarks/ and what commands print.
//!
//! Figures: a comment `<!-- figures: "TEXT" "TEXT" -->` in a block of a page (paragraph, item of a list, table), or alone before
//! it, names blocks of docs/benchmarks/ by a text that stands in one of them only. Every number of the page's block must stand
//! in these. A row of a table is a block there, and a text of a table's head names the whole table. In docs/benchmarks.md every
//! number of a paragraph or row must stand in a section that it links; a column `target` is left out.

use std::collections::BTreeSet;

use crate::links::{all_pages, section, targets};
use crate::pages::{misprints, pages, read};

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
            || (at > begin && matches!(characters.get(at), Some(',' | '.')) && is_digit(at + 1))
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

/// Texts by which the figures of docs/benchmarks/ are named, each with the numbers that it stands for.
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

/// A sentence for every figure of a page that the tables of docs/benchmarks/ do not have.
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
            let needs = measured.contains(&block.heading.as_str()) || text.contains("benchmarks/");
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
    let is_measured = |name: &String| {
        name.starts_with("docs/benchmarks/") && name != "docs/benchmarks/reproduction.md"
    };
    let tables: Vec<String> = all_pages().into_iter().filter(is_measured).collect();
    assert!(tables.len() > 5, "{tables:?}");
    let texts: Vec<String> = tables.iter().map(|name| read(name)).collect();
    let benchmarks = texts.join("\n");
    let mut found = vec![];
    for name in pages() {
        let measured: &[&str] = if name == "README.md" { &MEASURED } else { &[] };
        let of_page = offences(&read(&name), &benchmarks, measured);
        found.extend(of_page.iter().map(|offence| format!("{name}: {offence}")));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// A sentence for every number of the page of claims that the sections it links do not have.
fn unmeasured(page: &str, text_of: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let mut found = vec![];
    let mut check = |text: &str| {
        let links = targets(text);
        let sections = links.iter().filter_map(|link| text_of(link));
        let known: BTreeSet<String> = sections.flat_map(|text| numbers(&text)).collect();
        let unknown: Vec<String> = figures(text).difference(&known).cloned().collect();
        if !unknown.is_empty() {
            found.push(format!("{unknown:?}: {text}"));
        }
    };
    for block in blocks(page) {
        if !block.is_table() {
            check(&block.text());
            continue;
        }
        let cells = |row: &str| -> Vec<String> { row.split('|').map(str::to_owned).collect() };
        let head = cells(&block.lines[0]);
        let target = head.iter().position(|cell| cell.trim() == "target");
        for row in &block.lines[2..] {
            let cells = cells(row).into_iter().enumerate();
            let measured = cells.filter(|(at, _)| Some(*at) != target);
            check(&measured.map(|(_, cell)| cell).collect::<Vec<_>>().join("|"));
        }
    }
    found
}

#[test]
fn every_claim_has_its_table() {
    let page = read("docs/benchmarks.md");
    // The sections before the first table of claims say how to measure.
    let (_, claims) = page.split_once("\n## Accuracy\n").unwrap();
    let found = unmeasured(claims, |link| {
        let (file, anchor) = link.split_once('#')?;
        section(&read(&format!("docs/{file}")), anchor)
    });
    assert!(found.is_empty(), "{}", found.join("\n"));
}

// A number of the section linked passes, another one does not; a target is nobody's measurement.
#[test]
fn a_claim_without_its_table_is_named() {
    let of = |page: &str| {
        unmeasured(page, |link| {
            (link == "a.md#b").then(|| "0.24 and 7".to_owned())
        })
    };
    let table = "| claim | target | measured | |\n| --- | --- | --- | --- |\n";
    let row = |measured: &str| format!("{table}| x | 9 % | {measured} | [b](a.md#b) |");
    assert_eq!(of(&row("0.24 %")), [""; 0]);
    assert_eq!(
        of(&row("0.25 %")),
        ["[\"0.25\"]: | x | 0.25 % | [b](a.md#b) |"]
    );
    assert_eq!(of("7 of them, [b](a.md#b)"), [""; 0]);
    assert_eq!(of("7 of them"), ["[\"7\"]: 7 of them"]);
}

// The limits keep the documentation readable: who adds a page shortens another one. Words as `wc -w` counts them; in all, the bars of
// tables and what commands print (docs/benchmarks/) do not count.
#[test]
fn the_documentation_is_short() {
    let of = |name: &str| read(name).split_whitespace().count();
    for (name, most) in [
        ("ARCHITECTURE.md", 900),
        ("docs/benchmarks.md", 2000),
        ("docs/identify-json.md", 4000),
    ] {
        assert!(of(name) <= most, "{name}: {} words", of(name));
    }
    for name in pages() {
        let most = if name == "README.md" { 1500 } else { 900 };
        assert!(of(&name) <= most, "{name}: {} words", of(&name));
    }
    let changes = read("CHANGELOG.md");
    let unreleased = changes.split("\n## ").nth(1).unwrap();
    let lines = unreleased.lines().filter(|line| !line.is_empty()).count();
    assert!(lines <= 40, "the unreleased version has {lines} lines");
    let written = all_pages();
    let written = written
        .iter()
        .filter(|name| !name.starts_with("docs/benchmarks/"));
    let is_word = |word: &&str| word.contains(char::is_alphanumeric);
    let all: usize = written
        .map(|name| read(name).split_whitespace().filter(is_word).count())
        .sum();
    assert!(all <= 38_000, "{all} words without the bars of tables");
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
    let bare = of("## Limits\n\n3 % fail.\n\n## Other\n\n4 % do not.\n\n[5 %](benchmarks/a.md)");
    assert_eq!(
        bare,
        [
            "{\"3\"} without a source: 3 % fail.",
            "{\"5\"} without a source: [5 %](benchmarks/a.md)"
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

// The commands that take less than a second: those of the tables in examples, and designs.
#[test]
fn printed_lines_are_those_of_the_program() {
    let (commands, found) = misprints("onecycle", |words| {
        let is_table = |word: &&str| word.starts_with("examples/") && word.ends_with(".csv");
        words.iter().any(is_table) || words.starts_with(&["tune"])
    });
    assert!(commands >= 5, "{commands}");
    assert!(found.is_empty(), "{}", found.join("\n"));
}
