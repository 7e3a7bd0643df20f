//! Arguments of `grid`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use onecycle_cli::args::{MOST_THREADS, share_within};
use onecycle_design::soiptd_pd::criterion::Criterion;

/// Choose processes that represent a space: every process of the space has one of them nearby.
///
/// The distance of two processes is the deterioration J: the extra cost of using the optimal controller
/// of one on the other. Members are placed J apart along rows, rays and radii. With --fewest, the number
/// of members is the smallest that leaves no process farther than J from a member.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab grid --check 10000\n",
    "  onecycle-lab grid space.toml --deterioration 5% --out grid.json --report grid.html\n",
    "  onecycle-lab grid --from grid.json --check 100000 --seed 2\n\n",
    "With --out, finished rows are kept in the folder GRID.json.part until the grid is written: the same\n",
    "command resumes an interrupted run, --restart starts over.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable file, 4 the check found a process farther ",
    "than J from every member, 5 output not written"
))]
pub(crate) struct Grid {
    /// Space of processes, a TOML file (see experiments/) [default: the paper's multirotors]
    #[arg(value_name = "FILE")]
    pub(crate) space: Option<PathBuf>,
    /// Distance J of neighbours, 0.1 % to 100 %, such as 10% or 0.1
    #[arg(long, value_name = "J", default_value = "10%", allow_hyphen_values = true,
          value_parser = deterioration)]
    pub(crate) deterioration: f64,
    /// Use as few members as possible
    #[arg(long)]
    pub(crate) fewest: bool,
    /// Place the members by the rules of the published code of the paper's authors, which leave gaps; gains are matched at the
    /// phase of the relay
    #[arg(long, conflicts_with_all = ["fewest", "equal_gains"])]
    pub(crate) lattice: bool,
    /// Cost that the controllers minimise: ise (squared error), iae (absolute error), itae (absolute error times time);
    /// iae and itae take some minutes
    #[arg(long, value_name = "COST", default_value = "ise")]
    pub(crate) cost: Cost,
    /// Compare processes at equal velocity gains instead of equal oscillation amplitudes
    #[arg(long)]
    pub(crate) equal_gains: bool,
    /// Write the grid to this JSON file
    #[arg(long, short, value_name = "GRID.json")]
    pub(crate) out: Option<PathBuf>,
    /// Write the matrix of costs for any number of members; by default only up to 2000
    #[arg(long, requires = "out")]
    pub(crate) matrix: bool,
    /// Discard the work of an interrupted run and start over
    #[arg(long, requires = "out")]
    pub(crate) restart: bool,
    /// Without effect: interrupted runs are always resumed
    #[arg(long = "resume", hide = true)]
    _resume: bool,
    /// Check the distance of N random processes to the nearest member (1 to 10,000,000)
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_CHECKED))]
    pub(crate) check: Option<u64>,
    /// Seed of the random processes of the check
    #[arg(long, value_name = "S", default_value_t = 1, requires = "check")]
    pub(crate) seed: u64,
    /// Read the grid from this file instead of computing it
    #[arg(long, value_name = "GRID.json",
          conflicts_with_all = ["space", "deterioration", "fewest", "lattice", "equal_gains", "cost", "out"])]
    pub(crate) from: Option<PathBuf>,
    /// Write a report with figures to this file: one HTML page that works offline
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Number of threads [default: one for each core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Largest number of random processes of a check; all of them are kept in memory.
const MOST_CHECKED: u64 = 10_000_000;

/// A criterion of controllers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost(pub(crate) Criterion);

impl FromStr for Cost {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Criterion::ALL.into_iter().find(|one| one.name() == text);
        found.map(Self).ok_or_else(|| {
            let names = Criterion::ALL.map(Criterion::name).join(", ");
            format!("there is no cost '{text}': choose from {names}")
        })
    }
}

/// A deterioration as a fraction, in the range of grids.
fn deterioration(text: &str) -> Result<f64, String> {
    let otherwise = "a deterioration lies between 0.1 % and 100 %, such as 10% or 0.1";
    share_within(text, 0.001..=1.0, otherwise)
}
