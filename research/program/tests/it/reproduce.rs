//! `reproduce`: the quick run of the fast parts, interruptions, refusals.

use std::fs;

use crate::common::{Scratch, UNREADABLE, run};

/// Parts that take seconds, with their sheets.
const PARTS: [(&str, &str); 5] = [
    ("phase", include_str!("../../reproduction/phase.toml")),
    ("figures", include_str!("../../reproduction/figures.toml")),
    (
        "table_2_and_3",
        include_str!("../../reproduction/table_2_and_3.toml"),
    ),
    ("ablation", include_str!("../../reproduction/ablation.toml")),
    ("table_7", include_str!("../../reproduction/table_7.toml")),
];

/// Number of cells of the paper in a sheet.
fn papers(sheet: &str) -> usize {
    let sheet: toml::Table = sheet.parse().unwrap();
    let tables = sheet.get("tables").and_then(|tables| tables.as_array());
    let papers = tables
        .into_iter()
        .flatten()
        .filter_map(|table| table.get("paper")?.as_table());
    papers
        .flat_map(|paper| paper.values())
        .filter_map(|cells| cells.as_array())
        .flatten()
        .filter(|cell| cell.as_str() != Some(""))
        .count()
}

// Every number of the paper is beside a computed one: 2 of the phase, 18 of Tables II and III, 6 of the ablation, 20 and 1 of
// Table VII. The same command again computes
// nothing and gives the same bytes; a part with other settings is refused.
#[test]
fn quick_run_of_the_fast_parts() {
    let folder = Scratch::new();
    let out = folder.name("out");
    let mut arguments = vec!["reproduce", "--quick", "-o", &out];
    arguments.extend(PARTS.iter().map(|(name, _)| *name));
    let made = run(&arguments);
    assert_eq!(made.code, Some(0), "{made:?}");
    let read = |name: &str| fs::read_to_string(format!("{out}/{name}")).unwrap();
    let text = read("reproduction.md");
    let expected: usize = PARTS.iter().map(|(_, sheet)| papers(sheet)).sum();
    assert_eq!(expected, 47);
    assert_eq!(text.matches("(paper: ").count(), expected, "{text}");
    assert!(!text.contains("NaN") && !text.contains("inf "), "{text}");
    let page = read("reproduction.html");
    assert_eq!(page.matches("<figure ").count(), 5);
    assert_eq!(page.matches("<small>paper: ").count(), expected);

    let part = read("parts/phase_quick/journal.jsonl");
    let again = run(&arguments);
    assert_eq!(again.code, Some(0), "{again:?}");
    assert_eq!(
        again
            .stderr
            .matches("as an earlier run has found it")
            .count(),
        PARTS.len(),
        "{again:?}"
    );
    assert_eq!(read("reproduction.md"), text);
    assert_eq!(read("reproduction.html"), page);

    let other = part.replacen('8', "9", 1);
    fs::write(format!("{out}/parts/phase_quick/journal.jsonl"), other).unwrap();
    let refused = run(&arguments);
    assert_eq!(refused.code, Some(UNREADABLE), "{refused:?}");
    let words = "unfinished work has other settings, shapes[0] 9 instead of 8: use --restart";
    assert!(refused.stderr.contains(words), "{refused:?}");
    let anew = run(&["reproduce", "phase", "--quick", "-o", &out, "--restart"]);
    assert_eq!(anew.code, Some(0), "{anew:?}");
    assert!(!anew.stderr.contains("earlier run"), "{anew:?}");
    assert_eq!(read("parts/phase_quick/journal.jsonl"), part);
}

// An unknown part is refused with the names of all parts; a damaged journal with advice.
#[test]
fn what_it_refuses() {
    let refused = run(&["reproduce", "table_8"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    let words = "there is no part 'table_8': choose from phase, grid, grid_variants, figures, table_2_and_3, \
                 ablation, our_network, table_4, tuning_rules, rule_variants, table_5, table_6, table_7, modes, claims";
    assert!(refused.stderr.contains(words), "{refused:?}");

    let folder = Scratch::new();
    let out = folder.name("out");
    let network = folder.write("paper.onnx", b"no network");
    let arguments = [
        "reproduce",
        "table_7",
        "--quick",
        "--network",
        &network,
        "-o",
        &out,
    ];
    let refused = run(&arguments);
    assert_eq!(refused.code, Some(UNREADABLE), "{refused:?}");
    assert!(refused.stderr.contains("paper.onnx"), "{refused:?}");

    fs::create_dir_all(format!("{out}/parts/phase_quick")).unwrap();
    fs::write(format!("{out}/parts/phase_quick/journal.jsonl"), "{\n{\n").unwrap();
    let refused = run(&["reproduce", "phase", "--quick", "--resume", "-o", &out]);
    assert_eq!(refused.code, Some(UNREADABLE), "{refused:?}");
    assert!(
        refused.stderr.contains("phase_quick")
            && refused
                .stderr
                .contains("line 1 is damaged: use --restart to start over"),
        "{refused:?}"
    );
}
