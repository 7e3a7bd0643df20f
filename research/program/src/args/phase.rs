//! Arguments of `phase`.

use std::path::PathBuf;

use clap::Args;

/// Find the distinguishing phase of a space of processes: the phase of the relay test whose tuning rule
/// is best for all of them.
///
/// The optimal PD controller of each shape of process is a tuning rule. Each rule is applied to every
/// other shape. The rule with the smallest worst-case deterioration gives the distinguishing phase.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab phase\n",
    "  onecycle-lab phase experiments/double_integrators.toml --report phase.html --csv rules.csv\n"
))]
pub(crate) struct Phase {
    /// Space of processes, a TOML file (see experiments/) [default: the paper's multirotors]
    pub(crate) file: Option<PathBuf>,
    /// Number of ratios of the time constants (1 to 48)
    #[arg(long, value_name = "N", default_value_t = 24, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=48))]
    pub(crate) rows: u64,
    /// Number of dead times for each ratio (1 to 48)
    #[arg(long, value_name = "N", default_value_t = 24, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=48))]
    pub(crate) columns: u64,
    /// Print the result with all rules as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Write all rules to this CSV file
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write a report with figures to this file: one HTML page that works offline
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
}
