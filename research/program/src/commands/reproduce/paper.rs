//! Our network of the paper's size for the parts that compare it: read from a file, or trained once and kept beside the parts.

use std::path::Path;

use onecycle_cli::failure::Failure;
use onecycle_lab::paper::classifier::ClassifierRecipe;
use onecycle_lab::paper::network::PaperNetwork;

use super::network::RecipeName;
use crate::args::Reproduce;
use crate::commands::classify;
use crate::commands::train::classifier::make;
use crate::output::tell;
use crate::workers::Workers;

/// The network that `--network` names, or the one that an earlier run has trained, or a new one.
pub(super) fn network(
    arguments: &Reproduce,
    folder: &Path,
    workers: &Workers,
) -> Result<PaperNetwork, Failure> {
    if let Some(path) = &arguments.network {
        return classify::network(path);
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
    classify::network(&path)
}
