//! Arguments, typed and documented; `--help` is generated from here.

mod bench;
mod campaign;
mod certify;
mod completions;
mod dataset;
mod fly;
mod identify;
mod man;
mod pack;
mod reproduce;
mod simulate;
mod train;

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand};
use onecycle_link::{SAMPLE_RATES_HZ, TimeUnit};
use onecycle_onboard::{Soiptd, SoiptdError};

pub(crate) use self::bench::{Answers, Bench, BenchAction, Format, MakeBench, RunBench};
pub(crate) use self::campaign::Campaign;
pub(crate) use self::certify::Certify;
pub(crate) use self::completions::Completions;
pub(crate) use self::dataset::Dataset;
pub(crate) use self::fly::Fly;
pub(crate) use self::identify::{Identify, Method, When};
pub(crate) use self::man::Man;
pub(crate) use self::reproduce::{Name, Reproduce};
pub(crate) use self::simulate::Simulate;
pub(crate) use self::train::Train;
use crate::failure::Failure;

pub(crate) use self::pack::{
    ExportPack, ImportPack, Pack, PackAction, PackSource, ShowPack, VerifyPack,
};

const AFTER_HELP: &str = "\
First steps:
  onecycle simulate --k 1 --t-prop 0.03 --t-body 1.7 --tau 0.02 --noise 1% --bias 30% --out test.csv
  onecycle identify test.csv
  onecycle fly altitude
  onecycle completions bash > ~/.local/share/bash-completion/completions/onecycle

onecycle COMMAND --help explains each command and has examples.

Exit codes:
  0  done (identify: a process was identified)
  2  bad arguments
  3  the input file cannot be read; the message says where and what to do
  4  the answer is no: the recording tells no process (the verdict says why and what to do), a space
     is not certified, a grid leaves holes, a pack does not give the outputs it must
  5  the output cannot be written";

/// From one cycle of a relay test to the process and its optimal controller.
#[derive(Debug, Parser)]
#[command(name = "onecycle", version, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// In the order in which a newcomer needs them: a recording, a vehicle, a space of processes, how good it all is,
/// an identifier of one's own.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Identify(Identify),
    Simulate(Simulate),
    Tune(Tune),
    Fly(Fly),
    Certify(Certify),
    Phase(Phase),
    Grid(Grid),
    Campaign(Campaign),
    Bench(Bench),
    Reproduce(Reproduce),
    Dataset(Dataset),
    Train(Train),
    Pack(Pack),
    Completions(Completions),
    Man(Man),
}

/// Parameters of a process `K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ProcessArguments {
    /// Velocity gain K: output unit / (input unit s)
    #[arg(
        long,
        value_name = "GAIN",
        allow_negative_numbers = true,
        required_unless_present = "k_over_t_body",
        conflicts_with = "k_over_t_body"
    )]
    k: Option<f64>,
    /// Acceleration gain K/T_body, instead of K: output unit / (input unit s^2)
    #[arg(long, value_name = "GAIN", allow_negative_numbers = true)]
    k_over_t_body: Option<f64>,
    /// Lag of the actuator, in seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    t_prop: f64,
    /// Lag of the body, in seconds; inf for no damping (then give --k-over-t-body)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    t_body: f64,
    /// Dead time, in seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    tau: f64,
}

impl ProcessArguments {
    pub(crate) fn process(&self) -> Result<Soiptd, Failure> {
        let made = match (self.k, self.k_over_t_body) {
            (_, Some(_)) if self.t_body.is_nan() || self.t_body <= 0.0 => {
                Err(SoiptdError::TBody(self.t_body))
            }
            (_, Some(gain)) => {
                Soiptd::from_acceleration_gain(gain, self.t_prop, 1.0 / self.t_body, self.tau)
            }
            (Some(_), None) if self.t_body.is_infinite() => {
                return Err(Failure::usage(
                    "with --t-body inf the velocity gain is infinite: give --k-over-t-body \
                     instead of --k",
                ));
            }
            (k, None) => Soiptd::new(k.unwrap_or(0.0), self.t_prop, self.t_body, self.tau),
        };
        made.map_err(Failure::usage)
    }
}

/// A value, or a percentage of something the help names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Share {
    Value(f64),
    Percent(f64),
}

impl Share {
    /// The value, percentages being of `whole`.
    pub(crate) fn of(self, whole: f64) -> f64 {
        match self {
            Self::Value(value) => value,
            Self::Percent(percent) => 0.01 * percent * whole,
        }
    }
}

impl FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, share): (_, fn(f64) -> Self) = match text.strip_suffix('%') {
            Some(number) => (number.trim_end(), Self::Percent),
            None => (text, Self::Value),
        };
        number
            .parse()
            .ok()
            .filter(|value: &f64| value.is_finite())
            .map(share)
            .ok_or_else(|| format!("'{text}' is neither a number nor a percentage such as 30%"))
    }
}

/// Design the optimal controller of a process: gains, margins and the step to expect.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle tune --k 1 --t-prop 0.3 --t-body 2 --tau 0.1\n",
    "  onecycle tune --k-over-t-body 40 --t-prop 0.05 --t-body inf --tau 0.015 --phase-margin 45\n"
))]
pub(crate) struct Tune {
    #[command(flatten)]
    pub(crate) process: ProcessArguments,
    /// Least phase margin of the controller, in degrees
    #[arg(long, value_name = "DEG", default_value = "20", allow_negative_numbers = true,
          value_parser = phase_margin)]
    pub(crate) phase_margin: f64,
    /// Write a page with pictures to this file, as HTML that needs no network
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Find the distinguishing phase of a space of processes: that of the relay whose tuning rule costs
/// them least.
///
/// The optimal PD of every shape of process is a tuning rule. Each rule is applied to every other
/// shape, and the rule whose worst deterioration is least distinguishes the space.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle phase\n",
    "  onecycle phase experiments/double_integrators.toml --report phase.html --csv rules.csv\n"
))]
pub(crate) struct Phase {
    /// The space, in TOML (see experiments/) [default: the paper's multirotors]
    pub(crate) file: Option<PathBuf>,
    /// Shapes by the ratio of the lags (1 to 48)
    #[arg(long, value_name = "N", default_value_t = 24, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=48))]
    pub(crate) rows: u64,
    /// Shapes by the dead time, for each of these (1 to 48)
    #[arg(long, value_name = "N", default_value_t = 24, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=48))]
    pub(crate) columns: u64,
    /// Print the result as JSON, all rules included
    #[arg(long)]
    pub(crate) json: bool,
    /// Write all rules to this file, whole or not at all
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write a page with figures to this file, as HTML that needs no network
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
}

/// Choose processes that stand for a space, so that one of them is near every process of it.
///
/// Processes are J apart when neither one's optimal controller costs more than J on the other above
/// that one's own. Neighbours are laid J apart along rows, rays and radii; with --fewest there are
/// only as many as leave no process farther than J from one of them.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle grid --check 10000\n",
    "  onecycle grid space.toml --deterioration 5% --out grid.json --report grid.html\n",
    "  onecycle grid --from grid.json --check 100000 --seed 2\n\n",
    "With --out, what is done is kept in GRID.json.part: the same command goes on from there.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable file, 4 the check found a process farther ",
    "than J from every member, 5 output not written"
))]
pub(crate) struct Grid {
    /// The space, in TOML (see experiments/) [default: the paper's multirotors]
    #[arg(value_name = "FILE")]
    pub(crate) space: Option<PathBuf>,
    /// How far apart neighbours are, 0.1 % to 100 %: such as 10% or 0.1
    #[arg(long, value_name = "J", default_value = "10%", allow_hyphen_values = true,
          value_parser = deterioration)]
    pub(crate) deterioration: f64,
    /// As few members as possible instead of neighbours J apart
    #[arg(long)]
    pub(crate) fewest: bool,
    /// Compare at equal velocity gains instead of the same amplitude, to see what it takes
    #[arg(long)]
    pub(crate) equal_gains: bool,
    /// Write the grid to this file, as JSON
    #[arg(long, short, value_name = "GRID.json")]
    pub(crate) out: Option<PathBuf>,
    /// Write the matrix of costs however large it is, not only up to 2000 members
    #[arg(long, requires = "out")]
    pub(crate) matrix: bool,
    /// Discard the work of an interrupted run and start over
    #[arg(long, requires = "out")]
    pub(crate) restart: bool,
    /// Without effect: interrupted runs are always resumed
    #[arg(long = "resume", hide = true)]
    _resume: bool,
    /// Check that this many random processes have a member near (1 to 10,000,000)
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_CHECKED))]
    pub(crate) check: Option<u64>,
    /// Seed of the random processes
    #[arg(long, value_name = "S", default_value_t = 1, requires = "check")]
    pub(crate) seed: u64,
    /// Read the grid from this file instead of making it
    #[arg(long, value_name = "GRID.json",
          conflicts_with_all = ["space", "deterioration", "fewest", "equal_gains", "out"])]
    pub(crate) from: Option<PathBuf>,
    /// Write a page with pictures to this file, as HTML that needs no network
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Threads to work with [default: one a core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Most random processes of a check, all of which are kept.
const MOST_CHECKED: u64 = 10_000_000;
/// More threads than any machine has cores.
const MOST_THREADS: u64 = 1024;

/// A deterioration as a fraction, within what a grid can be laid for.
fn deterioration(text: &str) -> Result<f64, String> {
    let deterioration = text.trim().parse::<Share>()?.of(1.0);
    if (0.001..=1.0).contains(&deterioration) {
        Ok(deterioration)
    } else {
        Err("a deterioration lies between 0.1 % and 100 %, such as 10% or 0.1".to_owned())
    }
}

/// A phase margin in degrees, as radians.
fn phase_margin(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(degrees) if degrees > 0.0 && degrees < 90.0 => Ok(degrees.to_radians()),
        _ => Err("a phase margin lies between 0 and 90 degrees".to_owned()),
    }
}

/// A sample rate in hertz, within what a recording can have.
fn sample_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate_hz) if SAMPLE_RATES_HZ.contains(&rate_hz) => Ok(rate_hz),
        _ => Err("a sample rate lies between 1e-6 and 1e9 Hz".to_owned()),
    }
}

fn time_unit(text: &str) -> Result<TimeUnit, String> {
    TimeUnit::from_name(text).ok_or_else(|| "a unit of time is h, min, s, ms, us or ns".to_owned())
}

#[cfg(test)]
mod tests;
