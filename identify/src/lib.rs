//! From a recording to a process model with intervals, or to the reason why there is none.
//!
//! [`identify`] takes the columns of a recording ([`Signals`]) and returns an [`Identification`]: what excited the process
//! ([`Excitation`]), the identified [`Model`](onecycle_design::Model) with a 90 % interval for each parameter and a
//! controller, or a [`Verdict`] that says why there is none, and [`Remark`]s. All are values; sentences and advice are made
//! by the program that shows them.
//!
//! | file | what it does |
//! |------|--------------|
//! | `relay` | identification from a steady relay oscillation, with the estimator of the board |
//! | `posterior` | draws from the distribution of the parameters, intervals |
//! | `outcome`, `verdict`, `remark` | the result |
//! | `diagnose` | harmonics without a model, whiteness of residuals, densities of draws |

pub mod cholesky;
pub mod diagnose;
pub mod excitation;
pub mod outcome;
pub mod posterior;
pub mod relay;
pub mod remark;
pub mod settings;
pub mod signals;
pub mod verdict;

use onecycle_onboard::pack::Pack;

pub use diagnose::density::{Density, density};
pub use diagnose::harmonics::{Harmonic, harmonics};
pub use diagnose::whiteness::{Whiteness, whiteness};
pub use excitation::{Excitation, Oscillation};
pub use outcome::{Fit, FitPoint, Identification, Identified};
pub use posterior::{Draw, Estimate, Interval, Posterior};
pub use relay::find_oscillation;
pub use relay::reading::Reading;
pub use remark::Remark;
pub use settings::{MOST_CYCLES, Method, Options};
pub use signals::Signals;
pub use verdict::Verdict;

/// Identifies the process behind a recording, with the built-in pack.
#[must_use]
pub fn identify(signals: &Signals<'_>, options: &Options) -> Identification {
    identify_by(signals, options, Pack::embedded().ok().as_ref())
}

/// Identifies the process behind a recording, with a pack of one's own or without one.
///
/// Without a pack [`Method::Map`] fits without a prior, and [`Method::Classify`] refuses.
#[must_use]
pub fn identify_by(
    signals: &Signals<'_>,
    options: &Options,
    pack: Option<&Pack<'_>>,
) -> Identification {
    relay::identify(signals, options, pack)
}
