//! Arguments of `onecycle fly`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use onecycle_plant::multirotor::Mission;

use super::MOST_THREADS;

/// Largest number of flights of a mission: hours of work.
const MOST_SEEDS: u64 = 100_000;

/// Fly the paper's missions on a simulated quadrotor that the on-board tuner identifies and tunes in flight.
///
/// The vehicle has six degrees of freedom, motor lag, drag, ground effect, battery, wind, and delayed, noisy
/// sensors. With -o, DIR/flights.html (one page that works offline) and one CSV file for each mission are written.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle fly\n",
    "  onecycle fly altitude payload -o flights\n",
    "  onecycle fly vehicle --seeds 100\n\n",
    "Missions:\n",
    "  altitude            take-off without a controller, identification, tuning, a step\n",
    "  payload             altitude with 30 % more mass\n",
    "  cycles              five cycles, each identified alone; cost of each controller on the others\n",
    "  roll                roll with an input bias; the relay switches about the bias\n",
    "  roll-uncompensated  roll with an input bias; the relay switches about zero\n",
    "  disturbed           the tuned vehicle with an added weight, an impact and wind\n",
    "  disturbed-untuned   the same on a vehicle that is not tuned\n",
    "  vehicle             take-off and tuning of all four axes\n\n",
    "Exit codes: 0 all missions flown, 2 bad arguments, 4 a mission ended early, 5 output not written"
))]
pub(crate) struct Fly {
    /// Missions to fly [default: all]
    #[arg(value_name = "MISSION")]
    pub(crate) missions: Vec<Named>,
    /// Seed of noise and gusts; with --seeds, the first seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Number of flights of each mission, each with its own seed
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    pub(crate) seeds: u64,
    /// Folder to write the page and the CSV files of the first seed to
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Number of threads [default: one for each core]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u64>,
}

/// A mission by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Named(pub(crate) Mission);

impl FromStr for Named {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Mission::ALL.into_iter().find(|one| one.name() == text);
        found.map(Self).ok_or_else(|| {
            let names = Mission::ALL.map(Mission::name).join(", ");
            format!("there is no mission '{text}': choose from {names}")
        })
    }
}
