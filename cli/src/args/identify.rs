//! Arguments of `identify`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use onecycle_identify::MOST_CYCLES;
use onecycle_link::TimeUnit;

use super::{PackSource, phase_margin, sample_rate, time_unit};

/// Identify the process behind a recorded relay test, and design its controller.
///
/// The recording is a table of time, input (the relay's output) and output (the measurement):
/// comma, semicolon, tab or blanks, with or without a header, time in s, ms, us or ns.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle identify examples/simulated_hover.csv\n",
    "  onecycle identify examples/simulated_hover.csv --report report.html\n",
    "  onecycle identify log.csv --time t_ms --input 4 --output roll --cycles 4\n",
    "  onecycle identify log.csv --plot always > report.txt\n",
    "  onecycle identify samples.txt --sample-rate 500 --input 2 --output 1 --json\n\n",
    "Exit codes: 0 identified, 2 bad arguments, 3 unreadable file, 4 no process (see the ",
    "verdict), 5 output not written"
))]
pub(crate) struct Identify {
    /// The recording; - reads the standard input
    pub(crate) file: PathBuf,
    /// Print the report as JSON (schema: docs/identify-json.md)
    #[arg(long)]
    pub(crate) json: bool,
    /// Write a page with pictures to this file, as HTML that needs no network
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Draw the last cycles and the fit: where the standard output is a terminal (auto), always or never
    #[arg(long, value_name = "WHEN", value_enum, default_value_t = When::Auto, conflicts_with = "json",
          hide_possible_values = true)]
    pub(crate) plot: When,
    /// Fit the last N steady cycles (1 to 50)
    #[arg(long, value_name = "N", default_value_t = 8,
          value_parser = clap::value_parser!(u64).range(1..=MOST_CYCLES as u64))]
    pub(crate) cycles: u64,
    /// Least phase margin of the controller, in degrees
    #[arg(long, value_name = "DEG", default_value = "20", allow_negative_numbers = true,
          value_parser = phase_margin)]
    pub(crate) phase_margin: f64,
    /// How: by the pack's network alone (classify), by least squares alone (refine), or the most
    /// probable process (map)
    #[arg(long, value_enum, default_value_t = Method::Map)]
    pub(crate) method: Method,
    /// Read the oscillation by this pack, "default" being the one that is built in
    #[arg(long, value_name = "FILE", default_value = "default")]
    pub(crate) pack: PackSource,
    /// Column of time, by name or by number from 1
    #[arg(long, value_name = "COLUMN")]
    pub(crate) time: Option<String>,
    /// Column of the input, the relay's output
    #[arg(long, value_name = "COLUMN")]
    pub(crate) input: Option<String>,
    /// Column of the output, the measurement
    #[arg(long, value_name = "COLUMN")]
    pub(crate) output: Option<String>,
    /// Sample rate in hertz, for tables without time
    #[arg(long, value_name = "HZ", conflicts_with_all = ["time", "time_unit"],
          allow_negative_numbers = true, value_parser = sample_rate)]
    pub(crate) sample_rate: Option<f64>,
    /// Unit of the time column, whatever its header says: h, min, s, ms, us or ns
    #[arg(long, value_name = "UNIT", value_parser = time_unit)]
    pub(crate) time_unit: Option<TimeUnit>,
}

/// When a plot is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum When {
    Auto,
    Always,
    Never,
}

/// How a process is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Method {
    Classify,
    Refine,
    Map,
}

impl From<Method> for onecycle_identify::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::Classify => Self::Classify,
            Method::Refine => Self::Refine,
            Method::Map => Self::Map,
        }
    }
}
