//! Arguments of `train`.

use std::path::PathBuf;

use clap::Args;
use onecycle_cli::args::MOST_THREADS;

/// Train an identifier for your own processes, or the paper's classifier, from a recipe.
///
/// An identifier (network = "density") is written as a pack for firmware and for onecycle identify
/// --pack. For the paper's classifier (network = "classifier"), one network is trained for each loss of
/// the recipe, and a table compares them on unseen processes.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab train --recipe experiments/identifier.toml -o mine.pack\n",
    "  onecycle-lab train --recipe research/program/reproduction/paper_network_small.toml\n",
    "  onecycle-lab train --recipe research/program/reproduction/paper_network.toml -o paper.onnx --json table.json\n\n",
    "With --out, the state is kept every 30 s in the folder OUT.part until the result is written: the same command\n",
    "resumes an interrupted run, to the same bits; --restart starts over.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable recipe or part, 4 the pack is written but of little \
     use (the report says why), 5 output not written"
))]
pub(crate) struct Train {
    /// Recipe, a TOML file (see experiments/)
    #[arg(long, value_name = "FILE")]
    pub(crate) recipe: PathBuf,
    /// Write the result to this file: the pack, or the best network as ONNX
    #[arg(long, short, value_name = "OUT")]
    pub(crate) out: Option<PathBuf>,
    /// Discard the work of an interrupted run and start over
    #[arg(long, requires = "out")]
    pub(crate) restart: bool,
    /// Without effect: interrupted runs are always resumed
    #[arg(long = "resume", hide = true)]
    _resume: bool,
    /// Folder for the simulated experiments of an identifier, kept for other runs [default: OUT.dataset,
    /// which is removed at the end]
    #[arg(long, value_name = "DIR")]
    pub(crate) dataset: Option<PathBuf>,
    /// Write the report to this JSON file
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Number of threads [default: one for each core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
}
