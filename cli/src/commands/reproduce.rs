//! `onecycle reproduce`: compute the parts of the paper, keep their numbers, write the page.

mod comparison;
mod cycles;
mod figures;
mod grid;
mod network;
mod phase;
mod sheet;
mod single;

use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use self::sheet::{Sheet, typed};
use super::workers::Workers;
use crate::args::{Name, Reproduce};
use crate::failure::{Failure, exit};
use crate::journal::Journal;
use crate::output::{Waiting, print, tell, write_text};
use crate::report::reproduction as report;
use crate::results::reproduction::{Numbers, ReproducedPart, Row};

pub(crate) fn run(arguments: &Reproduce) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    let folder = out.join("parts");
    fs::create_dir_all(&folder).map_err(|error| Failure::output(&folder, error))?;
    let wanted = |name: &Name| arguments.names.is_empty() || arguments.names.contains(name);
    let names: Vec<Name> = Name::ALL.into_iter().filter(wanted).collect();
    let mut parts = Vec::with_capacity(names.len());
    for (number, &name) in (1..).zip(&names) {
        tell(&format!(
            "part {number} of {}, {}",
            names.len(),
            name.as_str()
        ));
        parts.push(made(arguments, &folder, name)?);
    }
    let pages = [
        ("reproduction.md", report::markdown(&parts, arguments.quick)),
        ("reproduction.html", report::html(&parts, arguments.quick)),
    ];
    for (name, text) in pages {
        let path = out.join(name);
        write_text(&path, &text)?;
        print(&format!("{}\n", path.display()))?;
    }
    Ok(ExitCode::from(exit::DONE))
}

/// Rows that the sheet states: they sum up the other parts.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    /// Claim, and the cells of its row.
    rows: Vec<Vec<String>>,
}

fn claims(stated: &Stated) -> Numbers {
    let row = |cells: &Vec<String>| {
        let mut cells = cells.iter().cloned();
        Row::new(cells.next().unwrap_or_default(), cells)
    };
    Numbers {
        tables: vec![stated.rows.iter().map(row).collect()],
        figures: vec![],
    }
}

/// A part, computed now or by an earlier run.
fn made(arguments: &Reproduce, folder: &Path, name: Name) -> Result<ReproducedPart, Failure> {
    let begin = Instant::now();
    let sheet = Sheet::of(name)?;
    let settings = sheet.settings(arguments.quick);
    let size = if arguments.quick { "_quick" } else { "" };
    let mut kept = None;
    let mut journal = Journal::open(
        &folder.join(format!("{}{size}", name.as_str())),
        &format!("reproduce {}", name.as_str()),
        &settings,
        arguments.restart,
        |numbers: Numbers| match kept.replace(numbers) {
            None => Ok(()),
            Some(_) => Err("is out of order".to_owned()),
        },
    )?;
    if let Some(numbers) = kept {
        tell("  as an earlier run has found it (use --restart to start over)");
        return Ok(sheet.part(name, numbers));
    }
    let workers = Workers::new(arguments.threads)?;
    // The other parts have a progress bar.
    let waiting = matches!(name, Name::Phase | Name::Figures | Name::Table7)
        .then(|| Waiting::on("computing"));
    let numbers = match name {
        Name::Phase => phase::find(&typed(&settings)?)?,
        Name::Grid => grid::find(&typed(&settings)?, &workers)?,
        Name::Figures => figures::find(&typed(&settings)?)?,
        Name::Table2And3 => network::find(&typed(&settings)?, &journal, &workers)?,
        Name::Table4 | Name::TuningRules => comparison::find(&typed(&settings)?, &workers)?,
        Name::Table5 => single::starts(&typed(&settings)?, &workers)?,
        Name::Table6 => single::biases(&typed(&settings)?, &workers)?,
        Name::Table7 => cycles::find(&typed(&settings)?)?,
        Name::Claims => claims(&typed(&settings)?),
    };
    drop(waiting);
    workers.finish();
    journal.add(&numbers)?;
    tell(&format!("  {:.0} s", begin.elapsed().as_secs_f64()));
    Ok(sheet.part(name, numbers))
}
