//! Arguments of `onecycle fly`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use onecycle_plant::multirotor::Mission;

use super::MOST_THREADS;

/// Most seeds: as many flights as are worth waiting for.
const MOST_SEEDS: u64 = 100_000;

/// Fly the paper's missions on a simulated quadrotor: identified in the air by the on-board tuner, then flown by
/// what was found.
///
/// The vehicle has six degrees of freedom, motors with lag, drag, ground, battery, wind, and sensors that are late
/// and noisy. With -o writes DIR/flights.html, one page that needs no network, and a CSV of every mission.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle fly\n",
    "  onecycle fly altitude payload -o flights\n",
    "  onecycle fly vehicle --seeds 100\n\n",
    "Missions:\n",
    "  altitude            from the ground without a controller, identified, tuned, a step\n",
    "  payload             the same with 30 % more mass\n",
    "  cycles              five cycles identified one by one, and what each one's controller costs the others\n",
    "  roll                roll with a bias, the relay about what held it before\n",
    "  roll-uncompensated  the same with the relay about zero\n",
    "  disturbed           weight, a blow and wind on the tuned vehicle\n",
    "  disturbed-untuned   the same on the one that was not tuned\n",
    "  vehicle             from the ground to all four axes tuned\n\n",
    "Exit codes: 0 all flown, 2 bad arguments, 4 a mission ended early, 5 output not written"
))]
pub(crate) struct Fly {
    /// Missions to fly [default: all]
    #[arg(value_name = "MISSION")]
    pub(crate) missions: Vec<Named>,
    /// Seed of noise and gusts; with --seeds the first of them
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Flights of each mission, a seed each
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    pub(crate) seeds: u64,
    /// Folder to write the page and the CSV files of the first seed to
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Threads to work with [default: one a core]
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
            format!("there is no mission '{text}': name some of {names}")
        })
    }
}
