//! From a recording to a process model with 90 % intervals and a controller, or the reason why no process was
//! identified.
//!
//! [`identify`] takes the columns of a recording ([`Signals`]) and returns an [`Identification`]: the excitation of the
//! process ([`Excitation`]), the process and its controller ([`Identified`]) or the reason why no process was
//! identified ([`Verdict`]), and what limits the result ([`Remark`]). The results are facts without advice: the program
//! that shows them adds it.
//!
//! | to obtain | call |
//! |-----------|------|
//! | process, intervals and controller, or a verdict | [`identify`], [`identify_by`] |
//! | period, amplitude and noise of a steady oscillation | [`find_oscillation`] |
//! | the phase margin of a controller over all likely processes | [`Posterior::phase_margin_rad`] |
//! | the frequency response at the harmonics of the oscillation, without a model | [`harmonics`](fn@harmonics) |
//! | a test of the residuals for whiteness | [`whiteness`](fn@whiteness) |
//! | the intervals to expect from a planned test | [`expected`] |
//! | the last cycles of a run, each identified alone | [`cycles::Cycles`] |
//! | contours of the posterior | [`density`](fn@density) |

mod amplitude;
mod assumed;
mod checks;
mod conclusion;
pub mod cycles;
mod descent;
pub mod diagnose;
mod excitation;
mod innovations;
mod instrument;
mod judge;
mod nonlinear;
mod outcome;
mod posterior;
pub mod progress;
mod reading;
mod relay;
mod remark;
mod remarks;
mod sampling;
mod settings;
mod signals;
mod thresholds;
mod two_amplitudes;
mod two_stage;
mod verdict;

use onecycle_onboard::pack::Pack;

pub use diagnose::density::{Density, density};
pub use diagnose::harmonics::{Harmonic, harmonics};
pub use diagnose::whiteness::{Whiteness, whiteness};
pub use excitation::{Excitation, Oscillation, Recorded, Switching};
pub use innovations::{Hold, expected};
pub use instrument::{contradicts_set_point, identify_by_set_point};
pub use nonlinear::Nonlinear;
pub use outcome::{
    Alternative, Evidence, Fit, FitPoint, Identification, Identified, InnovationRow,
    InnovationTests, Innovations, Noise, Prediction, Refused, ResponsePoint, SetPointResponse,
};
pub use posterior::{Draw, Estimate, Interval, Posterior, StepIntervals};
pub use reading::Reading;
pub use relay::find_oscillation;
pub use remark::{About, Remark};
pub use settings::{MOST_CYCLES, Method, Options, USUAL_CYCLES};
pub use signals::Signals;
pub use two_amplitudes::TwoAmplitudes;
pub use two_stage::{Caused, caused_by_set_point};
pub use verdict::Verdict;

/// Identifies the process from a recording, with the built-in pack.
///
/// One objective judges every recording: the likelihood of all samples under each [`Structure`] with disturbances, of which
/// the simplest that explains the recording is chosen.
///
/// With [`Options::cycles`] the estimator of the board takes the last cycles of a steady relay oscillation instead, and one
/// structure:
///
/// 1. Find the relay in the input, and the runs of steady cycles.
/// 2. Average the last cycles of the longest run into bins.
/// 3. Read the last cycle with the network of the pack: start of the fit, prior, known or unknown process.
/// 4. Fit the process by variable projection.
/// 5. Refuse the fit if the output is clipped, or if residual or model error are too large. Then repeat from step 2
///    with fewer cycles, or with the last run.
/// 6. Draw from the posterior; choose the controller of least expected cost.
///
/// [`Structure`]: onecycle_design::Structure
#[must_use]
pub fn identify(signals: &Signals<'_>, options: &Options) -> Identification {
    identify_by(signals, options, Pack::embedded().ok().as_ref())
}

/// As [`identify`], with another pack or without one.
///
/// Without a pack [`Method::Map`] fits without a prior, and [`Method::Classify`] returns [`Verdict::Unknown`].
#[must_use]
pub fn identify_by(
    signals: &Signals<'_>,
    options: &Options,
    pack: Option<&Pack<'_>>,
) -> Identification {
    judge::identify(signals, options, pack)
}

// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
