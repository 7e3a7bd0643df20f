//! Arguments of `campaign`.

use std::path::PathBuf;

use clap::Args;
use onecycle_identify::MOST_CYCLES;
use onecycle_lab::experiments::MOST_CASES;

use super::Method;

/// Run a campaign of random experiments that a TOML file describes (see experiments/).
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle campaign experiments/refine_1pct.toml --cases 1000\n",
    "  onecycle campaign experiments/d_test.toml --cycles 1 --method refine\n",
    "  onecycle campaign experiments/relay.toml --cases 10000 --sigma 0.02\n\n",
    "With --out, finished cases are kept in the folder FILE.part until the table is written: the same\n",
    "command resumes an interrupted run, --restart starts over.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable file, 5 output not written"
))]
pub(crate) struct Campaign {
    /// The campaign
    pub(crate) file: PathBuf,
    /// Run this many cases instead of the file's number, up to ten million
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_CASES))]
    pub(crate) cases: Option<u64>,
    /// Fit this many cycles instead of the file's number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_CYCLES as u64))]
    pub(crate) cycles: Option<u64>,
    /// Find processes in this way instead of the file's
    #[arg(long, value_enum)]
    pub(crate) method: Option<Method>,
    /// Noise of exactly this part of the amplitude instead of the file's
    #[arg(long, value_name = "PART")]
    pub(crate) sigma: Option<f64>,
    /// Scale all times by this factor, those of the sampling too
    #[arg(long, value_name = "FACTOR")]
    pub(crate) time_scale: Option<f64>,
    /// Write the table to this file as well
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Discard the work of an interrupted run and start over
    #[arg(long, requires = "out")]
    pub(crate) restart: bool,
    /// Without effect: interrupted runs are always resumed
    #[arg(long = "resume", hide = true)]
    _resume: bool,
}
