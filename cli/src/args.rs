//! Command line arguments. `--help`, the manual and the completions are generated from these definitions.

mod completions;
mod design;
mod fly;
mod identify;
#[cfg(not(target_family = "wasm"))]
mod live;
mod log;
mod man;
mod oscillation;
mod simulate;
mod structure;
mod studio;

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap::{Args, Parser, Subcommand};
use onecycle_onboard::{Soiptd, SoiptdError};

pub(crate) use self::completions::Completions;
pub(crate) use self::design::{DesignArguments, NoiseArguments};
pub(crate) use self::fly::Fly;
pub(crate) use self::identify::Identify;
#[cfg(not(target_family = "wasm"))]
pub(crate) use self::live::{
    ConnectionArguments, Live, LiveAction, LiveLog, LiveRelay, LiveState, LiveWrite, LogId,
    identify_of,
};
pub(crate) use self::log::{Log, LogArguments, WriteArguments};
pub(crate) use self::man::Man;
pub(crate) use self::oscillation::OscillationArguments;
pub(crate) use self::simulate::{BETA, Excitation, Inject, NamedDisturbance, Simulate};
pub(crate) use self::structure::StructureArguments;
pub(crate) use self::studio::Studio;
use crate::failure::Failure;
pub(crate) use onecycle::request::values::Share;
pub use onecycle::request::values::{METHODS, phase_margin, sample_rate, share, share_within};

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
     to do), a mission ended early, or a vehicle keeps its old parameters
  5  the output cannot be written, or parameters of a vehicle are left uncertain
  6  identify: the time stamps can be read in more than one way; --time-unit settles it";

/// Identify a process from a recording and design its optimal controller.
#[derive(Debug, Parser)]
#[command(name = "onecycle", version, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Commands in the order in which a new user needs them: recordings, vehicles, simulations, the page.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Identify(Identify),
    Log(Log),
    #[cfg(not(target_family = "wasm"))]
    Live(Box<Live>),
    Simulate(Box<Simulate>),
    Tune(Tune),
    Fly(Fly),
    Studio(Studio),
    Completions(Completions),
    Man(Man),
}

/// Commands of the program `onecycle-lab`.
const OF_THE_LAB: [&str; 9] = [
    "bench",
    "campaign",
    "certify",
    "dataset",
    "grid",
    "pack",
    "phase",
    "reproduce",
    "train",
];

/// The refusal of a command of `onecycle-lab`; `None` for any other error of the parser.
pub(crate) fn refused_command(error: &clap::Error) -> Option<Failure> {
    let Some(ContextValue::String(name)) = error.get(ContextKind::InvalidSubcommand) else {
        return None;
    };
    let is_of_the_lab = OF_THE_LAB.contains(&name.as_str());
    is_of_the_lab.then(|| {
        Failure::usage(format!(
            "{name} is a command of onecycle-lab, the program of the research: \
             cargo install --locked --path research/program"
        ))
    })
}

/// Parses a command line without its program. The parser's error is its first paragraph, without usage and hints.
///
/// # Errors
/// One sentence: the options are not those of the command.
pub fn parsed<P: Parser>(command: &str, files: &[&str], options: &[String]) -> Result<P, String> {
    let options = options.iter().map(String::as_str);
    let words = ["onecycle", command].into_iter().chain(options);
    let words = words.chain(["--"]).chain(files.iter().copied());
    P::try_parse_from(words).map_err(|error| {
        let text = error.to_string();
        let first = text.split("\n\n").next().unwrap_or(&text);
        first.trim_start_matches("error: ").trim().to_owned()
    })
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

/// Values by their names.
pub fn named<T: Copy + Send + Sync>(
    all: &'static [(&'static str, T)],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.iter().map(|(name, _)| *name)).try_map(|name| {
        let found = all.iter().find(|(known, _)| *known == name);
        found
            .map(|(_, value)| *value)
            .ok_or("there is no such value")
    })
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
    "A process is a structure with its parameters: K or K/T_body, T or T1, T2, T3 from the longest lag, w0, zeta, ",
    "tau; T_prop and T_body of a body behind its actuator.\nStructures: iptd, integrator_lag, double_integrator_lag, soiptd, toiptd, foptd, soptd, toptd, resonant, ",
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

/// More threads than any machine has cores.
pub const MOST_THREADS: u64 = 1024;

#[cfg(test)]
mod tests;
