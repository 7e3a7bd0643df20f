//! Arguments of `onecycle-lab bench`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Subcommand, ValueEnum};
use onecycle_cli::args::{MOST_THREADS, share};
use onecycle_lab::experiments::{Benchmark, RelayTest};
use onecycle_lab::judge::evaluate::Contender;

use crate::results::bench::RecordingFormat;

/// Make a benchmark of relay experiments, and score identification methods on it.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab bench make -o relay-benchmark\n",
    "  onecycle-lab bench run relay-benchmark -o results\n",
    "  onecycle-lab bench run relay-benchmark --methods onecycle-2,pem-fair --answers mine=answers.csv\n\n",
    "Exit codes: 0 done, 2 bad arguments, 3 unreadable folder or answers, 5 output not written"
))]
pub(crate) struct Bench {
    #[command(subcommand)]
    pub(crate) action: BenchAction,
}

#[derive(Debug, Subcommand)]
pub(crate) enum BenchAction {
    Make(MakeBench),
    Run(RunBench),
}

/// File format of the recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// One file for each experiment
    Csv,
    /// One file for all experiments
    Parquet,
}

impl From<Format> for RecordingFormat {
    fn from(format: Format) -> Self {
        match format {
            Format::Csv => Self::Csv,
            Format::Parquet => Self::Parquet,
        }
    }
}

/// Largest number of experiments: file names have four digits.
const MOST_EXPERIMENTS: u64 = 9999;

/// Make a folder of experiments: recordings, the true processes and the rules.
///
/// 1000 experiments take about 200 MB, 60 MB when compressed.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab bench make -o relay-benchmark\n",
    "  onecycle-lab bench make -o small-benchmark --cases 50 --seed 2\n"
))]
pub(crate) struct MakeBench {
    /// Folder to write; it must be new or empty
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of experiments (1 to 9999)
    #[arg(long, value_name = "N", default_value_t = Benchmark::default().experiments,
          allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_EXPERIMENTS))]
    pub(crate) cases: u64,
    /// Seed of the experiments (up to 2^32 - 1); the same seed gives the same bytes
    #[arg(long, value_name = "SEED", default_value_t = Benchmark::default().seed,
          allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(0..=u64::from(u32::MAX)))]
    pub(crate) seed: u64,
    /// Largest standard deviation of the noise, as a share of the amplitude, up to 20 %, such as 2% or 0.02
    #[arg(long, value_name = "SHARE", default_value_t = Benchmark::default().sigma, allow_negative_numbers = true,
          value_parser = share)]
    pub(crate) sigma: f64,
    /// File format of the recordings
    #[arg(long, value_enum, default_value = "csv")]
    pub(crate) format: Format,
    /// Number of threads [default: one for each core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
}

/// Run methods on a benchmark, score their answers and print the leaderboard.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle-lab bench run relay-benchmark -o results\n",
    "  onecycle-lab bench run relay-benchmark --methods none --answers mine=answers.csv\n",
    "  onecycle-lab bench run relay-benchmark --methods onecycle-2,pem-fair -o results\n\n",
    "Methods on the recordings, all run by default: onecycle-1, onecycle-2, onecycle-4 (cycles),\n",
    "onecycle-1-point (controller of the most probable process), onecycle-1-refine (no prior),\n",
    "onecycle-whole (everything, by the likelihood), network, pem, pem-offset, pem-fair, rules,\n",
    "rules-exact, rules-harmonic, arx, arx-scaled, arx-gmvc. The methods pem-sweep, pem-sweep-offset and\n",
    "asymmetric use a relay test of their own, simulated on the true process with the same bias, noise and\n",
    "seed. With 'none', only --answers are scored. Times are processor times.\n\n",
    "With --out, finished experiments are kept in the folder OUT.part until the results are written: the\n",
    "same command resumes an interrupted run, --restart starts over."
))]
pub(crate) struct RunBench {
    /// Folder written by `bench make`
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// Methods to run, separated by commas [default: all that read the recordings]
    #[arg(long, value_name = "NAME,...")]
    pub(crate) methods: Option<Methods>,
    /// Run the paper's classifier of this ONNX file too (made by onecycle-lab train), as the method "classifier"
    #[arg(long, value_name = "FILE")]
    pub(crate) network: Option<PathBuf>,
    /// Answers of another program, may be repeated: a CSV file with the columns
    /// experiment,K,T_prop_s,T_body_s,tau_s or experiment,kp,kd; the column seconds is optional
    #[arg(long, value_name = "NAME=FILE")]
    pub(crate) answers: Vec<Answers>,
    /// Write OUT.csv (one row for each method and experiment), OUT.json (rows and leaderboard) and OUT.md
    #[arg(long, short, value_name = "OUT")]
    pub(crate) out: Option<PathBuf>,
    /// Write the relay tests that methods make for themselves to this folder, new or empty: CSV files that
    /// `identify` can read, in one folder for each method
    #[arg(long, value_name = "DIR")]
    pub(crate) traces: Option<PathBuf>,
    /// Discard the work of an interrupted run and start over
    #[arg(long, requires = "out")]
    pub(crate) restart: bool,
    /// Without effect: interrupted runs are always resumed
    #[arg(long = "resume", hide = true)]
    _resume: bool,
    /// Number of threads [default: one for each core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
    /// Print the leaderboard and all results as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Name of the paper's classifier among the methods.
pub(crate) const CLASSIFIER: &str = "classifier";

/// A list of different methods.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Methods(pub(crate) Vec<Contender>);

impl Default for Methods {
    /// All methods that read the recordings.
    fn default() -> Self {
        let reads = |one: &Contender| one.relay_test() == RelayTest::Recorded;
        Self(Contender::ALL.into_iter().filter(reads).collect())
    }
}

impl FromStr for Methods {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut methods = Vec::new();
        for name in text.split(',').map(str::trim) {
            let Some(method) = Contender::from_name(name) else {
                if text.trim() == "none" {
                    break;
                }
                let names = Contender::ALL.map(Contender::name).join(", ");
                return Err(format!("there is no method '{name}': choose from {names}"));
            };
            if methods.contains(&method) {
                return Err(format!("'{name}' is named twice"));
            }
            methods.push(method);
        }
        Ok(Self(methods))
    }
}

/// A file of answers and the name of their method.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Answers {
    pub(crate) name: String,
    pub(crate) file: PathBuf,
}

impl FromStr for Answers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, file) = text.split_once('=').unwrap_or_default();
        let (name, file) = (name.trim().to_owned(), PathBuf::from(file));
        if name.is_empty() || file.as_os_str().is_empty() {
            return Err(format!(
                "'{text}' is not a name and a file such as mine=answers.csv"
            ));
        }
        let is_method = name == CLASSIFIER || Contender::from_name(&name).is_some();
        if is_method || name.contains(['|', '\n', '\r']) {
            return Err(format!(
                "answers cannot be named '{name}': choose another name"
            ));
        }
        Ok(Self { name, file })
    }
}
