//! `onecycle reproduce`: the paper's simulated results, each part worked out, kept and rendered.

mod comparison;
mod cycles;
mod figures;
mod grid;
mod network;
mod part;
mod phase;
mod single;

use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use self::part::Sheet;
use super::train::classifier::Keep;
use super::workers::Workers;
use crate::args::{Name, Reproduce};
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, tell, write_text};
use crate::report::reproduction as report;
use crate::results::reproduction::ReproducedPart;

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

/// A part, worked out or as an earlier run has kept it.
fn made(arguments: &Reproduce, folder: &Path, name: Name) -> Result<ReproducedPart, Failure> {
    let begin = Instant::now();
    let sheet = Sheet::of(name)?;
    let settings = sheet.settings(arguments.quick);
    let path = part::path(folder, name);
    if arguments.resume
        && let Some(found) = part::kept(&path, &settings)?
    {
        tell("  as an earlier run has found it");
        return Ok(sheet.part(name, found));
    }
    let workers = Workers::new(arguments.threads)?;
    // The others have a bar.
    let waiting = matches!(name, Name::Phase | Name::Figures | Name::Table7)
        .then(|| Waiting::on("working it out"));
    let found = match name {
        Name::Phase => phase::find(&part::typed(&settings)?)?,
        Name::Grid => grid::find(&part::typed(&settings)?, &workers)?,
        Name::Figures => figures::find(&part::typed(&settings)?)?,
        Name::Table2And3 => {
            let keep = Keep {
                beside: Some(&path),
                resume: arguments.resume,
            };
            network::find(&part::typed(&settings)?, keep, &workers)?
        }
        Name::Table4 | Name::TuningRules => comparison::find(&part::typed(&settings)?, &workers)?,
        Name::Table5 => single::starts(&part::typed(&settings)?, &workers)?,
        Name::Table6 => single::biases(&part::typed(&settings)?, &workers)?,
        Name::Table7 => cycles::find(&part::typed(&settings)?)?,
    };
    drop(waiting);
    workers.finish();
    part::keep(&path, &settings, &found)?;
    tell(&format!("  {:.0} s", begin.elapsed().as_secs_f64()));
    Ok(sheet.part(name, found))
}
