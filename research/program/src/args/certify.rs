//! Arguments of `certify`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use onecycle_cli::args::{sample_rate, share};
use onecycle_onboard::Soiptd;

/// Certify that every process of a space has exactly one stable limit cycle under the relay.
///
/// Limit cycles are computed exactly, and so is the spectral radius of their Poincare map: the fraction
/// of a small deviation that remains after one cycle. Scaling time changes nothing, so one process of
/// each shape is enough.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab certify\n",
    "  onecycle-lab certify experiments/double_integrators.toml --bias 0,0.3,0.6 --report out.html\n",
    "  onecycle-lab certify --process 0.3,2,0.1 --bias 0,30% --sample-rate 1000\n\n",
    "Exit codes: 0 certified, 2 bad arguments, 3 unreadable space, 4 not certified, 5 output not ",
    "written"
))]
pub(crate) struct Certify {
    /// Space of processes, a TOML file (see experiments/) [default: the paper's multirotors]
    pub(crate) space: Option<PathBuf>,
    /// Certify one process instead of a space, may be repeated: T_prop,T_body,tau in seconds
    #[arg(long, value_name = "T,T,T", conflicts_with_all = ["json", "report", "shapes"])]
    pub(crate) process: Vec<Times>,
    /// Input biases as shares of the relay's amplitude, such as 30% or 0.3 [default: 0, 0.1 .. 0.9; with --process 0]
    #[arg(long, value_name = "BIAS,...", value_delimiter = ',', allow_hyphen_values = true,
          value_parser = bias)]
    bias: Vec<f64>,
    /// With --process: also analyse a relay that is sampled at this rate, in hertz
    #[arg(long, value_name = "HZ", requires = "process", allow_negative_numbers = true,
          value_parser = sample_rate)]
    pub(crate) sample_rate: Option<f64>,
    /// Number of shapes along each of the two coordinates (2 to 100)
    #[arg(long, value_name = "N", default_value_t = 16,
          value_parser = clap::value_parser!(u64).range(2..=100))]
    pub(crate) shapes: u64,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Write a report with figures to this file: one HTML page that works offline
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
}

impl Certify {
    /// The biases of the arguments, or the default ones.
    pub(crate) fn biases(&self) -> Vec<f64> {
        if !self.bias.is_empty() {
            self.bias.clone()
        } else if self.process.is_empty() {
            (0..10).map(|tenth| f64::from(tenth) / 10.0).collect()
        } else {
            vec![0.0]
        }
    }
}

/// `T_prop`, `T_body`, `tau` (s), separated by commas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Times(pub(crate) [f64; 3]);

impl FromStr for Times {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let times: Vec<f64> = text
            .split(',')
            .map(|time| time.trim().parse().ok())
            .collect::<Option<_>>()
            .ok_or_else(|| format!("'{text}' is not three times such as 0.3,2,0.1"))?;
        let times = <[f64; 3]>::try_from(times).map_err(|times| {
            format!(
                "a process has three times, but '{text}' has {}",
                times.len()
            )
        })?;
        Soiptd::new(1.0, times[0], times[1], times[2])
            .map(|_| Self(times))
            .map_err(|error| error.to_string())
    }
}

/// A bias as a fraction of the relay's amplitude, between -1 and 1.
fn bias(text: &str) -> Result<f64, String> {
    let bias = share(text)?;
    if bias.abs() < 1.0 {
        Ok(bias)
    } else {
        Err(
            "a bias lies between -100 % and 100 % of the relay's amplitude, such as 30% or 0.3"
                .to_owned(),
        )
    }
}
