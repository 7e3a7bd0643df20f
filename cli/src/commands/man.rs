//! `onecycle man`: manual pages from the help texts.

use std::fs;
use std::io;
use std::process::ExitCode;

use clap::{Command, CommandFactory};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};

use crate::args::{self, Arguments};
use crate::failure::{Failure, exit};
use crate::output::{print_data, write_file};

/// Largest number of words of a heading; more words before a colon are a sentence.
const WORDS_OF_A_HEADING: usize = 2;

pub(crate) fn run(arguments: &args::Man) -> Result<ExitCode, Failure> {
    let mut program = Arguments::command().disable_help_subcommand(true);
    program.build();
    match &arguments.out {
        None => print_data(&page(&program).map_err(Failure::usage)?)?,
        Some(folder) => {
            fs::create_dir_all(folder).map_err(|error| Failure::output(folder, error))?;
            for command in tree(&program) {
                let path = folder.join(Man::new(command.clone()).get_filename());
                let page = page(command).map_err(Failure::usage)?;
                write_file(&path, |file| file.write_all(&page))?;
            }
        }
    }
    Ok(ExitCode::from(exit::DONE))
}

/// A command and all its subcommands.
fn tree(command: &Command) -> Vec<&Command> {
    let inside = command.get_subcommands().flat_map(tree);
    std::iter::once(command).chain(inside).collect()
}

/// The manual page of a command.
fn page(command: &Command) -> io::Result<Vec<u8>> {
    let man = Man::new(command.clone()).source(concat!("onecycle ", env!("CARGO_PKG_VERSION")));
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    man.render_options_section(&mut page)?;
    if command.has_subcommands() {
        man.render_subcommands_section(&mut page)?;
    }
    if let Some(text) = command.get_after_help() {
        page.extend(sections(&text.to_string()).to_roff().into_bytes());
    }
    Ok(page)
}

/// The text after the options of `--help`: `Examples:` and similar headings begin a section, other paragraphs are notes.
/// Indented lines keep their line breaks.
fn sections(text: &str) -> Roff {
    let mut roff = Roff::new();
    let mut last = String::new();
    for paragraph in text.split("\n\n") {
        let (heading, body) = match paragraph.split_once(':') {
            Some((heading, body)) if heading.split_whitespace().count() <= WORDS_OF_A_HEADING => {
                (heading.to_uppercase(), body)
            }
            _ => ("NOTES".to_owned(), paragraph),
        };
        if heading == last {
            roff.control("PP", []);
        } else {
            roff.control("SH", [heading.as_str()]);
        }
        let is_as_it_stands = body.contains("\n  ");
        if is_as_it_stands {
            roff.control("nf", []);
        }
        for line in body.trim_matches([' ', '\n']).lines() {
            roff.text([roman(line.strip_prefix("  ").unwrap_or(line))]);
        }
        if is_as_it_stands {
            roff.control("fi", []);
        }
        last = heading;
    }
    roff
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two headings, and between them a note with a late colon; calls keep their lines.
    #[test]
    fn paragraphs_become_sections() {
        let text = "Examples:\n  onecycle fly\n\nWith --out it is kept in a file: go on there.\n\nExit codes: 0 done";
        let roff = sections(text).to_roff();
        let lines: Vec<&str> = roff.lines().collect();
        let expected = [
            ".SH EXAMPLES",
            ".nf",
            "onecycle fly",
            ".fi",
            ".SH NOTES",
            r"With \-\-out it is kept in a file: go on there.",
            r#".SH "EXIT CODES""#,
            "0 done",
        ];
        assert_eq!(lines, expected);
    }
}
