//! The reproduced results of the paper, as Markdown and as a page.

use std::fmt::Write;

use onecycle_cli::pages::page::{self, Section, page};

use crate::results::reproduction::{ComparedCell, ComparedTable, ReproducedPart};

const TITLE: &str = "The paper's simulated results, reproduced";
const LEAD: &str = "A. Ayyad, M. Chehadeh, M. I. Awad, Y. Zweiri, \"Real-time system identification using deep \
    learning for linear processes with application to unmanned aerial vehicles\", IEEE Access 8 (2020). \
    J is the relative increase of the cost of a controller (integral of the squared error) over the optimum of the \
    true process. The paper's numbers are given beside those that the command has computed.";
const QUICK: &str = "A quick run with small sizes, to test that everything runs. Do not compare its numbers with the \
    paper's; for that, leave out --quick.";

/// The command that makes the report.
fn command(is_quick: bool) -> &'static str {
    if is_quick {
        "onecycle-lab reproduce --quick"
    } else {
        "onecycle-lab reproduce"
    }
}

/// Tables and remarks as Markdown.
pub(crate) fn markdown(parts: &[ReproducedPart], is_quick: bool) -> String {
    let mut text = format!(
        "# {TITLE}\n\n{LEAD}\n\nMade by `{}`, onecycle {}; do not edit. The plots are on the page that \
         the command writes beside this file.\n",
        command(is_quick),
        env!("CARGO_PKG_VERSION")
    );
    if is_quick {
        let _ = writeln!(text, "\n**{QUICK}**");
    }
    for part in parts {
        let _ = writeln!(
            text,
            "\n## {}\n\n{}. `{} {}`",
            part.title,
            part.source,
            command(is_quick),
            part.name
        );
        for table in &part.tables {
            let cells: Vec<String> = table.columns.iter().map(|cell| in_cell(cell)).collect();
            let _ = writeln!(
                text,
                "\n{}\n\n| {} |\n|---|{}",
                table.caption,
                cells.join(" | "),
                alignment(table).repeat(cells.len().saturating_sub(1))
            );
            for (name, cells) in &table.rows {
                let cells: Vec<String> = cells.iter().map(cell).collect();
                let _ = writeln!(text, "| {} | {} |", in_cell(name), cells.join(" | "));
            }
        }
        text.push('\n');
        for remark in &part.remarks {
            let _ = writeln!(text, "- {remark}");
        }
    }
    text
}

/// Numbers to the right, sentences to the left.
fn alignment(table: &ComparedTable) -> &'static str {
    const LONGEST_NUMBER: usize = 40;
    let mut cells = table.rows.iter().flat_map(|(_, cells)| cells);
    if cells.any(|cell| cell.ours.len() > LONGEST_NUMBER) {
        "---|"
    } else {
        "--:|"
    }
}

fn cell(cell: &ComparedCell) -> String {
    match &cell.paper {
        Some(paper) => in_cell(&format!("**{}** (paper: {paper})", cell.ours)),
        None => in_cell(&cell.ours),
    }
}

/// Text for a cell of Markdown, with bars escaped.
fn in_cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// Tables, plots and remarks as a page.
pub(crate) fn html(parts: &[ReproducedPart], is_quick: bool) -> String {
    let mut lead = page::paragraph("lead", LEAD);
    if is_quick {
        lead += &page::paragraph("note", QUICK);
    }
    let version = env!("CARGO_PKG_VERSION");
    let made = format!("Made by {}, onecycle {version}.", command(is_quick));
    lead += &page::paragraph("source", &made);
    let sections: Vec<Section> = parts.iter().map(section).collect();
    page(TITLE, &lead, &sections)
}

fn section(part: &ReproducedPart) -> Section {
    let mut body = page::paragraph("source", &part.source);
    for table in &part.tables {
        let rows: Vec<_> = (table.rows.iter())
            .map(|(name, cells)| (name.as_str(), cells.iter().map(beside).collect()))
            .collect();
        body += &page::table(&table.caption, &table.columns, &rows);
    }
    body.extend(part.figures.iter().map(page::figure));
    body += &page::list(&part.remarks);
    Section {
        id: part.name.to_owned(),
        title: part.title.clone(),
        body,
    }
}

/// The computed value, with the paper's below it.
fn beside(cell: &ComparedCell) -> page::Cell<'_> {
    page::Cell {
        value: &cell.ours,
        below: cell.paper.as_ref().map(|paper| format!("paper: {paper}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part() -> ReproducedPart {
        let cell = |ours: &str, paper: Option<&str>| ComparedCell {
            ours: ours.to_owned(),
            paper: paper.map(str::to_owned),
        };
        ReproducedPart {
            name: "table_9",
            title: "Nine".to_owned(),
            source: "Table IX".to_owned(),
            tables: vec![ComparedTable {
                caption: "of nothing".to_owned(),
                columns: vec![String::new(), "mean |J|".to_owned(), "n".to_owned()],
                rows: vec![(
                    "one".to_owned(),
                    vec![cell("0.31 %", Some("0.52 %")), cell("3", None)],
                )],
            }],
            figures: vec![],
            remarks: vec!["Because.".to_owned()],
        }
    }

    // The paper's number is beside the computed one if there is one, bars in names are escaped, and a quick run says that
    // it is quick.
    #[test]
    fn both_numbers_in_a_row() {
        let text = markdown(&[part()], false);
        assert!(
            text.contains("|  | mean \\|J\\| | n |\n|---|--:|--:|\n"),
            "{text}"
        );
        assert!(
            text.contains("| one | **0.31 %** (paper: 0.52 %) | 3 |\n"),
            "{text}"
        );
        assert!(text.contains("- Because.\n") && !text.contains(QUICK));
        assert!(markdown(&[part()], true).contains(QUICK));
        let html = html(&[part()], false);
        let cells = "<td data-column=\"mean |J|\">0.31 %<small>paper: 0.52 %</small></td><td data-column=\"n\">3</td>";
        assert!(html.contains(cells), "{html}");
        assert!(html.contains("<li>Because.</li>"));
    }
}
