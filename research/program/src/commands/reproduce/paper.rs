//! Our network of the paper's size for the parts that compare it: read from a file, or trained once and kept beside the parts.

use std::path::Path;

use onecycle_cli::failure::Failure;
use onecycle_lab::paper::classifier::ClassifierRecipe;
use onecycle_lab::paper::network::PaperNetwork;

use super::network::RecipeName;
use crate::args::Reproduce;
use crate::commands::train::classifier::make;
use crate::output::tell;
use crate::reading::{MOST_OF_A_TABLE, bytes_at_most};
use crate::workers::Workers;

/// The network that `--network` names, or the one that an earlier run has trained, or a new one.
pub(super) fn network(
    arguments: &Reproduce,
    folder: &Path,
    workers: &Workers,
) -> Result<PaperNetwork, Failure> {
    if let Some(path) = &arguments.network {
        return read(path);
    }
    let (recipe, name) = if arguments.quick {
        (RecipeName::Small, "paper_network_quick.onnx")
    } else {
        (RecipeName::Untrimmed, "paper_network.onnx")
    };
    let path = folder.join(name);
    if !path.exists() {
        let recipe: ClassifierRecipe = recipe.table()?.try_into().map_err(Failure::usage)?;
        tell(&format!(
            "  training a network of the paper's size into {}",
            path.display()
        ));
        make(&recipe, &path, false, workers, Failure::usage)?;
    }
    read(&path)
}

fn read(path: &Path) -> Result<PaperNetwork, Failure> {
    let bytes = bytes_at_most(path, MOST_OF_A_TABLE)?;
    PaperNetwork::read(&bytes).map_err(|error| Failure::unreadable(path, error))
}
