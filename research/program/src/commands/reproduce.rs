//! `onecycle-lab reproduce`: compute the parts of the paper, keep their numbers, write the page.

mod comparison;
mod cycles;
mod figures;
mod grid;
mod grid_variants;
mod literal;
mod modes;
mod network;
mod paper;
mod phase;
mod rules;
mod sheet;
mod single;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::paper::classifier::ClassifierRecipe;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use self::sheet::{Sheet, typed};
use crate::args::{Name, Reproduce};
use crate::journal::Journal;
use crate::output::{Waiting, print, tell, write_text};
use crate::report::reproduction as report;
use crate::results::reproduction::{Numbers, ReproducedPart, Row};
use crate::workers::Workers;

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
#[derive(Deserialize)]
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

/// What belongs to a journal: the settings of a part, and the recipe of the network that it compares.
#[derive(Serialize)]
struct Settings<'a> {
    #[serde(flatten)]
    of_sheet: &'a toml::Table,
    #[serde(skip_serializing_if = "Option::is_none")]
    network: Option<&'a ClassifierRecipe>,
}

/// Work that is kept in a folder once it is done.
struct Kept<'a> {
    folder: PathBuf,
    name: &'a str,
    restart: bool,
}

impl Kept<'_> {
    /// The result of an earlier run with these settings, or a new one.
    fn result<T: Serialize + DeserializeOwned>(
        &self,
        settings: &impl Serialize,
        compute: impl FnOnce(&Journal) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let begin = Instant::now();
        let mut kept = None;
        let command = format!("reproduce {}", self.name);
        let take = |found: T| match kept.replace(found) {
            None => Ok(()),
            Some(_) => Err("is out of order".to_owned()),
        };
        let mut journal = Journal::open(&self.folder, &command, settings, self.restart, take)?;
        if let Some(found) = kept {
            tell("  as an earlier run has found it (use --restart to start over)");
            return Ok(found);
        }
        let found = compute(&journal)?;
        journal.add(&found)?;
        tell(&format!("  {:.0} s", begin.elapsed().as_secs_f64()));
        Ok(found)
    }

    /// A step of the work, kept by itself.
    fn step(&self, number: usize) -> Kept<'_> {
        let mut folder = self.folder.clone().into_os_string();
        folder.push(format!("_{number}"));
        Kept {
            folder: folder.into(),
            ..*self
        }
    }
}

/// A part, computed now or by an earlier run.
fn made(arguments: &Reproduce, folder: &Path, name: Name) -> Result<ReproducedPart, Failure> {
    let sheet = Sheet::of(name)?;
    let settings = sheet.settings(arguments.quick);
    let size = if arguments.quick { "_quick" } else { "" };
    let workers = Workers::new(arguments.threads)?;
    let network = name
        .reads_network()
        .then(|| paper::network(arguments, folder, &workers));
    let network = network.transpose()?;
    let kept = Kept {
        folder: folder.join(format!("{}{size}", name.as_str())),
        name: name.as_str(),
        restart: arguments.restart,
    };
    let keys = Settings {
        of_sheet: &settings,
        network: network.as_ref().map(|network| &network.card.recipe),
    };
    let numbers = kept.result(&keys, |journal| {
        // The other parts have a progress bar.
        let waiting = matches!(name, Name::Phase | Name::Figures | Name::Table7)
            .then(|| Waiting::on("computing"));
        let numbers = match (name, &network) {
            (Name::Phase, _) => phase::find(&typed(&settings)?)?,
            (Name::Grid, _) => grid::find(&typed(&settings)?, &workers)?,
            (Name::GridVariants, _) => grid_variants::find(&typed(&settings)?, &workers)?,
            (Name::Figures, _) => figures::find(&typed(&settings)?)?,
            (Name::Table2And3, _) => literal::find(&typed(&settings)?, &kept, &workers)?,
            (Name::Ablation, _) => literal::ablation(&typed(&settings)?, &kept, &workers)?,
            (Name::OurNetwork, _) => network::find(&typed(&settings)?, journal, &workers)?,
            (Name::TuningRules, _) => comparison::find(&typed(&settings)?, None, &workers)?,
            (Name::RuleVariants, _) => rules::find(&typed(&settings)?, &workers)?,
            (Name::Table5, _) => single::starts(&typed(&settings)?, &workers)?,
            (Name::Modes, _) => modes::find(&typed(&settings)?, &workers)?,
            (Name::Claims, _) => claims(&typed(&settings)?),
            (Name::Table4, network) => {
                comparison::find(&typed(&settings)?, network.as_ref(), &workers)?
            }
            (Name::Table6, Some(network)) => single::biases(&typed(&settings)?, network, &workers)?,
            (Name::Table7, Some(network)) => cycles::find(&typed(&settings)?, network)?,
            (Name::Table6 | Name::Table7, None) => Numbers::default(),
        };
        drop(waiting);
        workers.finish();
        Ok(numbers)
    })?;
    Ok(sheet.part(name, numbers))
}
