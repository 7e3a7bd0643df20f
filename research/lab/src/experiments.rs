//! Random experiments: draw a process, run the relay or another test, cut the cycles.
//!
//! ```text
//! Recipe, Campaign, Benchmark   draw     -> RelayExperiment   run   -> Trace   cut   -> cycles, signature
//! ```
//!
//! | module          | what it holds                                                             |
//! |-----------------|---------------------------------------------------------------------------|
//! | [`recipe`]      | which processes, how often, with which bias and noise: for learning       |
//! | [`draw`]        | random draws of a recipe's experiments                                    |
//! | [`defect`]      | defects that take a process out of the family                             |
//! | [`campaign`]    | experiments on the paper's multirotors, described by a TOML file          |
//! | [`recording`]   | campaigns of recordings of any process and test signal                    |
//! | [`honesty`]     | campaigns of wrong data, with the plant that they were recorded on        |
//! | [`actuator`]    | actuators that do not do what they are told                               |
//! | [`benchmark`]   | the public benchmark: truths and recordings                               |
//! | [`experiment`]  | one experiment: relay, pre-roll, noise, plant                             |
//! | [`relays`]      | relays of other relay tests                                               |
//! | [`oscillation`] | period and amplitude without bias, noise and defect                       |
//! | [`cut`]         | cycles, signatures and samples of a recording                             |

pub mod actuator;
pub mod benchmark;
pub mod campaign;
pub mod cut;
pub mod defect;
pub mod draw;
pub mod experiment;
pub mod honesty;
mod instruments;
pub mod oscillation;
pub mod recipe;
pub mod recording;
pub mod relays;

pub use benchmark::{Benchmark, CYCLES_KEPT, IDENTIFICATION_PERIODS, Recorded, RelayTest, Truth};
pub use campaign::{Campaign, MOST_CASES, Measure, SAMPLE_S};
pub use cut::{SampledCycle, SteadyCycle, cycles, last_steady_cycle, last_whole_cycle, signals_of};
pub use defect::{Defect, DefectKind};
pub use draw::Drawn;
pub use experiment::{ExperimentError, RelayExperiment, RelaySetup, Simulation};
pub use honesty::{HonestyCampaign, HonestyError};
pub use instruments::Instruments;
pub use oscillation::Oscillation;
pub use recipe::{Family, Recipe, RecipeError};
pub use recording::{RecordingCampaign, RecordingError};
pub use relays::PlainRelay;
