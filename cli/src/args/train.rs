//! Arguments of `train`.

use std::path::PathBuf;

use clap::Args;

use super::MOST_THREADS;

/// Train a network of a recipe: an identifier of your own processes, or the paper's classifier.
///
/// An identifier (network = "density") becomes a pack that the board and onecycle identify --pack
/// read. Of the paper's classifier (network = "classifier") each loss of the recipe trains a network of
/// its own; the table at the end compares them on processes that none has seen.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle train --recipe experiments/identifier.toml -o mine.pack\n",
    "  onecycle train --recipe cli/reproduction/paper_network_small.toml\n",
    "  onecycle train --recipe cli/reproduction/paper_network.toml -o paper.onnx --json table.json\n\n",
    "With --out, every epoch is kept in the folder OUT.part until the result is written: the same command\n",
    "resumes an interrupted run, to the same bits; --restart starts over.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable recipe or part, 5 output not written"
))]
pub(crate) struct Train {
    /// The recipe, in TOML (see experiments/)
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
    /// Folder for the experiments of an identifier, kept for other runs [default: OUT.dataset, which
    /// is removed in the end]
    #[arg(long, value_name = "DIR")]
    pub(crate) dataset: Option<PathBuf>,
    /// Write the report to this file, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Threads to work with [default: one a core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
}
