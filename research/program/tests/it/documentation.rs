//! The guide and docs/benchmarks/reproduction.md against what commands print.

use std::fs;

use crate::pages::{misprints, read, root};

// The one command that takes less than a second.
#[test]
fn printed_lines_are_those_of_the_program() {
    let (commands, found) = misprints("onecycle-lab", |words| {
        words.starts_with(&["certify", "--process"])
    });
    assert!(commands > 0, "{commands}");
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// A cell as `onecycle-lab reproduce` writes it.
fn cell(text: &toml::Value) -> String {
    text.as_str().unwrap().replace('|', "\\|")
}

fn texts<'a>(table: &'a toml::Table, key: &str) -> impl Iterator<Item = &'a toml::Value> {
    let values = table.get(key).and_then(toml::Value::as_array);
    values.into_iter().flatten()
}

// docs/benchmarks/reproduction.md is made by hours of work: titles, captions, remarks and claims must be those of the sheets all the same.
#[test]
fn the_reproduction_has_the_words_of_the_sheets() {
    let page = read("docs/benchmarks/reproduction.md");
    let mut expected = vec![];
    let mut sheets = 0;
    for entry in fs::read_dir(root().join("research/program/reproduction")).unwrap() {
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
    assert_eq!(sheets, 15);
    let missing: Vec<&String> = expected
        .iter()
        .filter(|text| !page.contains(*text))
        .collect();
    assert!(missing.is_empty(), "{missing:#?}");
}
