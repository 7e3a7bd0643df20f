//! Arguments of `campaign`.

use std::path::PathBuf;

use clap::Args;
use onecycle_cli::args::{METHODS, named, share};
use onecycle_identify::MOST_CYCLES;
use onecycle_identify::Method;
use onecycle_lab::experiments::MOST_CASES;

/// Run many random experiments as a TOML file describes, and print a table of the outcomes.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab campaign experiments/refine_1pct.toml --cases 1000\n",
    "  onecycle-lab campaign experiments/d_test.toml --cycles 1 --method refine\n",
    "  onecycle-lab campaign experiments/relay.toml --cases 10000 --sigma 0.02\n\n",
    "With --out, finished cases are kept in the folder OUT.part until the table is written: the same\n",
    "command resumes an interrupted run, --restart starts over.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable file, 5 output not written"
))]
pub(crate) struct Campaign {
    /// Description of the campaign, a TOML file (see experiments/)
    pub(crate) file: PathBuf,
    /// Number of cases, up to ten million [default: from the file]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_CASES))]
    pub(crate) cases: Option<u64>,
    /// Number of cycles to fit [default: from the file]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_CYCLES as u64))]
    pub(crate) cycles: Option<u64>,
    /// Identification method [default: from the file]
    #[arg(long, value_parser = named(&METHODS))]
    pub(crate) method: Option<Method>,
    /// Standard deviation of the noise, as a share of the amplitude, such as 2% or 0.02 [default: from the file]
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true, value_parser = share)]
    pub(crate) sigma: Option<f64>,
    /// Multiply all times by this factor, the sample period included [default: from the file]
    #[arg(long, value_name = "FACTOR")]
    pub(crate) time_scale: Option<f64>,
    /// Print the outcome of every case as JSON instead of the table
    #[arg(long)]
    pub(crate) json: bool,
    /// Also write what is printed to this file
    #[arg(long, short, value_name = "OUT")]
    pub(crate) out: Option<PathBuf>,
    /// Discard the work of an interrupted run and start over
    #[arg(long, requires = "out")]
    pub(crate) restart: bool,
    /// Without effect: interrupted runs are always resumed
    #[arg(long = "resume", hide = true)]
    _resume: bool,
}
