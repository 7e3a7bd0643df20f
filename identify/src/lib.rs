//! From a recording to a process model with intervals, or to the reason why there is none.
//!
//! Every way of not knowing is a [`Verdict`], never a number.

pub mod cholesky;
pub mod diagnose;
pub mod outcome;
pub mod posterior;
pub mod relay;
pub mod remark;
pub mod signals;
pub mod verdict;

pub use diagnose::density::{Density, density};
pub use diagnose::harmonics::{Harmonic, harmonics};
pub use diagnose::whiteness::{Whiteness, whiteness};
pub use outcome::{FitPoint, Identification, Identified, OscillationFound};
pub use posterior::{Draw, Interval, Posterior, ProcessEstimate};
pub use relay::reading::Reading;
pub use relay::{MOST_CYCLES, Method, Options, find_oscillation, identify, identify_by};
pub use remark::Remark;
pub use signals::Signals;
pub use verdict::Verdict;
