//! Arguments of `classify`.

use std::path::PathBuf;

use clap::Args;

/// Identify relay tests by the paper's classifier: the class of the last steady cycle and its PD controller.
///
/// The network is one that `onecycle-lab train` has written as ONNX for a recipe with network = "classifier".
/// It takes every process for one of those that it was trained on; only a period that none of them has is
/// refused. Intervals, other structures and other controllers: onecycle identify.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab train --recipe research/program/reproduction/paper_network_small.toml -o small.onnx\n",
    "  onecycle-lab classify --network small.onnx examples/simulated_hover.csv\n",
    "  onecycle-lab classify --network small.onnx examples/jsbsim_f450_roll_clean.csv --json\n\n",
    "The paper's own recipe is research/program/reproduction/literal.toml; it trains for some 50 minutes.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable recording or network, 4 no class for a recording"
))]
pub(crate) struct Classify {
    /// Recordings of relay tests
    #[arg(required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// The network, an ONNX file of onecycle-lab train
    #[arg(long, value_name = "FILE")]
    pub(crate) network: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
