//! Arguments of `dataset`.

use std::path::PathBuf;

use clap::Args;
use onecycle_cli::args::MOST_THREADS;
use onecycle_lab::learn::dataset::shards::MOST_EXAMPLES;

/// Simulate relay experiments to train on, as files for NumPy, PyTorch and JAX.
///
/// Each example is one steady cycle of a random process: the cycle as a signature of 34 numbers, the
/// process as the four target values of the network, and the cost of errors in these values. The recipe of the paper's classifier
/// gives its sets: training, verification and tests, with the network's inputs, the true class and the cost of every class.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab dataset --examples 40000 --into multirotors\n",
    "  onecycle-lab dataset experiments/identifier.toml --examples 1000000 --into examples_to_learn\n",
    "  python examples/train_pytorch.py multirotors network.onnx\n",
    "  onecycle-lab dataset research/program/reproduction/literal.toml --into sets\n",
    "  python experiments/train_classifier.py sets\n\n",
    "The same command resumes an interrupted run. With a larger --examples it adds what is missing, and\n",
    "damaged files are made again; --restart starts over.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable recipe or a folder of something else, ",
    "5 output not written"
))]
pub(crate) struct Dataset {
    /// Recipe, a TOML file (see experiments/identifier.toml) [default: the paper's multirotors]
    #[arg(value_name = "RECIPE")]
    pub(crate) recipe: Option<PathBuf>,
    /// Number of experiments (1 to 10,000,000); those of a classifier are in its recipe
    #[arg(long, short = 'n', value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_EXAMPLES))]
    pub(crate) examples: Option<u64>,
    /// Folder to write: a new one, or one of the same recipe
    #[arg(long, value_name = "DIR")]
    pub(crate) into: PathBuf,
    /// Discard the files of an earlier run and start over
    #[arg(long)]
    pub(crate) restart: bool,
    /// Without effect: interrupted runs are always resumed
    #[arg(long = "resume", hide = true)]
    _resume: bool,
    /// Also write all examples to this Parquet file
    #[arg(long, value_name = "FILE")]
    pub(crate) parquet: Option<PathBuf>,
    /// Number of threads [default: one for each core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
