//! Command line arguments. `--help`, the manual and the completions are generated from these definitions.

mod bench;
mod campaign;
mod certify;
mod completions;
mod dataset;
mod design;
mod fly;
mod identify;
#[cfg(not(target_family = "wasm"))]
mod live;
mod log;
mod man;
mod oscillation;
mod pack;
mod reproduce;
mod simulate;
mod structure;
mod studio;
mod train;

use std::ops::RangeBounds;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand};
use onecycle_design::soiptd_pd::criterion::Criterion;
use onecycle_link::{SAMPLE_RATES_HZ, TimeUnit};
use onecycle_onboard::{Soiptd, SoiptdError};

pub(crate) use self::bench::{Answers, Bench, BenchAction, Format, MakeBench, RunBench};
pub(crate) use self::campaign::Campaign;
pub(crate) use self::certify::Certify;
pub(crate) use self::completions::Completions;
pub(crate) use self::dataset::Dataset;
pub(crate) use self::design::{DesignArguments, NoiseArguments, PAPER_HAS_NO_NOISE};
pub(crate) use self::fly::Fly;
pub(crate) use self::identify::{Between, Estimator, Identify, Method};
#[cfg(not(target_family = "wasm"))]
pub(crate) use self::live::{
    ConnectionArguments, Live, LiveAction, LiveLog, LiveRelay, LiveState, LiveWrite, LogId,
    identify_of,
};
pub(crate) use self::log::{HALF_STEP, Log, LogArguments, WriteArguments};
pub(crate) use self::man::Man;
pub(crate) use self::oscillation::OscillationArguments;
pub(crate) use self::reproduce::{Name, Reproduce};
pub(crate) use self::simulate::{BETA, Excitation, Inject, NamedDisturbance, Simulate};
pub(crate) use self::structure::StructureArguments;
pub(crate) use self::studio::Studio;
pub(crate) use self::train::Train;
use crate::failure::Failure;

pub(crate) use self::pack::{
    ExportPack, ImportPack, MarginPack, Pack, PackAction, PackSource, ShowPack, VerifyPack,
};

const AFTER_HELP: &str = "\
First steps:
  onecycle simulate --k 1 --t-prop 0.03 --t-body 1.7 --tau 0.02 --noise 1% --bias 30% --out test.csv
  onecycle identify test.csv
  onecycle fly altitude
  onecycle completions bash > ~/.local/share/bash-completion/completions/onecycle

onecycle COMMAND --help explains each command and has examples. A SHARE is written as 5% or 0.05.

Exit codes:
  0  done (identify: a process was identified)
  2  bad arguments
  3  an input file cannot be read, or a vehicle is not heard; the message says where and what to do
  4  finished, with a negative result: no process could be identified (the verdict says why and what
     to do), a space is not certified, a grid leaves holes, a mission ended early, a pack fails
     its self-test, a trained pack is of little use, or a vehicle keeps its old parameters
  5  the output cannot be written, or parameters of a vehicle are left uncertain
  6  identify: the time stamps can be read in more than one way; --time-unit settles it";

/// Identify a process from a recording and design its optimal controller.
#[derive(Debug, Parser)]
#[command(name = "onecycle", version, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Commands in the order in which a new user needs them: recordings, simulated vehicles, spaces of processes, benchmarks,
/// training, the page.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Identify(Identify),
    Log(Log),
    #[cfg(not(target_family = "wasm"))]
    Live(Box<Live>),
    Simulate(Box<Simulate>),
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
    Studio(Studio),
    Completions(Completions),
    Man(Man),
}

/// Parameters of a process `K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))`.
#[derive(Clone, Copy, Debug)]
struct ProcessArguments {
    k: Option<f64>,
    k_over_t_body: Option<f64>,
    t_prop: f64,
    t_body: f64,
    tau: f64,
}

impl ProcessArguments {
    fn process(&self) -> Result<Soiptd, Failure> {
        let made = match (self.k, self.k_over_t_body) {
            (_, Some(_)) if self.t_body.is_nan() || self.t_body <= 0.0 => {
                Err(SoiptdError::TBody(self.t_body))
            }
            (_, Some(gain)) => {
                Soiptd::from_acceleration_gain(gain, self.t_prop, 1.0 / self.t_body, self.tau)
            }
            (Some(_), None) if self.t_body.is_infinite() => {
                return Err(Failure::usage(
                    "--t-body inf makes the velocity gain infinite: use --k-over-t-body instead of --k",
                ));
            }
            (k, None) => Soiptd::new(k.unwrap_or(0.0), self.t_prop, self.t_body, self.tau),
        };
        made.map_err(Failure::usage)
    }
}

/// A value, or a percentage of a quantity that the help names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Share {
    Value(f64),
    Percent(f64),
}

impl Share {
    /// The value; a percentage is taken of `whole`.
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

/// A share within a range; `otherwise` says which it is.
fn share_within(text: &str, range: impl RangeBounds<f64>, otherwise: &str) -> Result<f64, String> {
    let share = share(text)?;
    range
        .contains(&share)
        .then_some(share)
        .ok_or_else(|| otherwise.to_owned())
}

/// A share of a whole: `5%` or `0.05`. A larger number than 1 without a percent sign may mean either, so it is refused.
fn share(text: &str) -> Result<f64, String> {
    match text.trim().parse::<Share>()? {
        Share::Value(value) if value.abs() > 1.0 => Err(format!(
            "a share is written as 5% or 0.05: write {value}% or {}",
            value / 100.0
        )),
        share => Ok(share.of(1.0)),
    }
}

/// Design the controller of a known process: gains, margins and the predicted step response.
///
/// Instead of the process, its ultimate gain and period, its oscillation under a relay, or gains that a rule computed from
/// these are enough: the design then keeps its limits on all processes that agree with them.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle tune --k 1 --t-prop 0.3 --t-body 2 --tau 0.1\n",
    "  onecycle tune --process FOPTD,K=2,T=10,tau=1 --controller pi --style calm\n",
    "  onecycle tune --process FOPTD,K=2,T=10,tau=1 --against 2.5,0.3,1\n",
    "  onecycle tune --process FOPTD,K=2,T=10,tau=1 --noise 0.05 --sample-period 0.1\n",
    "  onecycle tune --k 1 --t-prop 0.3 --t-body 2 --tau 0.1 --style paper --phase-margin 45\n",
    "  onecycle tune --ultimate-gain 35 --ultimate-period 28\n",
    "  onecycle tune --relay 90 --amplitude 3.28 --ultimate-period 27.8\n",
    "  onecycle tune --rule marlin --against 20.95,1.51,72.77\n\n",
    "A process is a structure with its parameters: K or K/T_body, T_prop, T_prop2, T_body (or T), w0, zeta, ",
    "tau.\nStructures: iptd, integrator_lag, double_integrator_lag, soiptd, toiptd, foptd, soptd, toptd, resonant, ",
    "resonant_lag."
))]
pub(crate) struct Tune {
    #[command(flatten)]
    pub(crate) process: StructureArguments,
    #[command(flatten)]
    pub(crate) design: DesignArguments,
    #[command(flatten)]
    pub(crate) noise: NoiseArguments,
    /// Write a report with figures to this file: one HTML page that works offline
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) oscillation: OscillationArguments,
}

/// Find the distinguishing phase of a space of processes: the phase of the relay test whose tuning rule
/// is best for all of them.
///
/// The optimal PD controller of each shape of process is a tuning rule. Each rule is applied to every
/// other shape. The rule with the smallest worst-case deterioration gives the distinguishing phase.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle phase\n",
    "  onecycle phase experiments/double_integrators.toml --report phase.html --csv rules.csv\n"
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

/// Choose processes that represent a space: every process of the space has one of them nearby.
///
/// The distance of two processes is the deterioration J: the extra cost of using the optimal controller
/// of one on the other. Members are placed J apart along rows, rays and radii. With --fewest, the number
/// of members is the smallest that leaves no process farther than J from a member.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle grid --check 10000\n",
    "  onecycle grid space.toml --deterioration 5% --out grid.json --report grid.html\n",
    "  onecycle grid --from grid.json --check 100000 --seed 2\n\n",
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
          conflicts_with_all = ["space", "deterioration", "fewest", "equal_gains", "cost", "out"])]
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

/// Largest number of random processes of a check; all of them are kept in memory.
const MOST_CHECKED: u64 = 10_000_000;
/// More threads than any machine has cores.
const MOST_THREADS: u64 = 1024;

/// A deterioration as a fraction, in the range of grids.
fn deterioration(text: &str) -> Result<f64, String> {
    let otherwise = "a deterioration lies between 0.1 % and 100 %, such as 10% or 0.1";
    share_within(text, 0.001..=1.0, otherwise)
}

/// A phase margin in degrees, as radians.
fn phase_margin(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(degrees) if degrees > 0.0 && degrees < 90.0 => Ok(degrees.to_radians()),
        _ => Err("a phase margin lies between 0 and 90 degrees".to_owned()),
    }
}

/// How much more than the least a step may cost, a share.
fn extra_ise(text: &str) -> Result<f64, String> {
    let extra = share(text)?;
    if (0.0..=0.5).contains(&extra) {
        Ok(extra)
    } else {
        Err("the extra cost lies between 0 % and 50 %, such as 2% or 0.02".to_owned())
    }
}

/// A sample rate in hertz, in the range of recordings.
fn sample_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate_hz) if SAMPLE_RATES_HZ.contains(&rate_hz) => Ok(rate_hz),
        _ => Err("a sample rate lies between 1e-6 and 1e9 Hz".to_owned()),
    }
}

fn time_unit(text: &str) -> Result<TimeUnit, String> {
    TimeUnit::from_name(text)
        .ok_or_else(|| "a unit of time is d, h, min, s, ms, us or ns".to_owned())
}

#[cfg(test)]
mod tests;
