//! Fit of the process to a window of one or more cycles by variable projection.
//!
//! For given lags and delay the output is linear in all other unknowns:
//!
//! ```text
//! y(t) = b g(t) + b u0 s(t) + y0 + v0 r(t) + w0 q(t) + c d(t)
//! ```
//!
//! | symbol       | meaning                                                         | unit              |
//! |--------------|-----------------------------------------------------------------|-------------------|
//! | `b`          | acceleration gain                                               | output unit / (input unit s^2) |
//! | `g`, `s`     | responses to the recorded input and to a constant input of one  | input unit s^2, s^2 |
//! | `u0`         | input bias, not recorded                                        | input unit        |
//! | `y0, v0, w0` | output, rate and acceleration at the beginning of the past      | output unit / s^k |
//! | `r`, `q`     | responses to the initial rate and acceleration                  | s, s^2            |
//! | `c`, `d`     | even part of the actuator's acceleration, and the response to it (`distortion.rs`) | output unit / s^2, s^2 |
//!
//! Hence a search over three unknowns (Levenberg-Marquardt with box constraints) with the six linear unknowns
//! eliminated. The three are the logarithm of the sum of the two poles, their product over the squared sum, and
//! the delay. They are regular where the lags are equal (1/4) and where damping vanishes (0), so the double
//! integrator is an ordinary point on the boundary of the domain.
//!
//! Prior knowledge adds rows to the equations. The initial acceleration cannot exceed what the relay produces;
//! without that row an acceleration that has decayed before the window begins would be undetermined. The even
//! part of the force is small. If the distribution of the shapes is known (`prior.rs`), three more rows make the
//! estimate the most probable process instead of the least-squares one.
//!
//! References: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973), variable projection; L. Kaufman, BIT 15
//! (1975), the Jacobian.
//!
//! # Slices
//!
//! A [`Refiner`] does the fit in slices, each short enough for a control tick; [`refine`] and [`refine_with`]
//! loop over them. The table counts double-precision operations, with a sine, an exponential or a logarithm as
//! 45, for a window of 64 bins of up to 32 samples. A processor without double precision in hardware
//! (Cortex-M4F) takes 60 to 100 cycles per operation, so the longest slice takes 130,000 to 220,000 cycles.
//!
//! | slice                                                          | operations | per fit | per step |
//! |----------------------------------------------------------------|------------|---------|----------|
//! | fundamental: 16 bins (95 each) or 8 edges (190 each)           | 1,600      |         |          |
//! | process, transition, sums of a bin                             | 1,500      | 1       | 4        |
//! | response: 56 bins (32 each); an edge (1,200) counts as 40      | 1,800      | 5 p + e | 4 (p + e) |
//! | distortion, first part                                         | 900        | 1       | 4        |
//! | distortion: 32 bins (45 each); an edge (110) counts as 3       | 1,600      | 4 p     | 16 p     |
//! | 5 components removed from a column (4 per row), length, weight | 1,900      | 6       | 4        |
//! | 5 components removed from the outputs                          | 1,600      | 2       |          |
//! | normal equations and step                                      | 1,800      |         | 1        |
//! | wave: 32 bins (54 each)                                        | 1,750      |         |          |
//! | 5 components removed from a wave, its remainder                | 1,800      |         |          |
//! | a model error                                                  | 1,050      |         |          |
//! | 8 lags of the residual's autocorrelation                       | 1,000      |         |          |
//! | 5 squares of the covariance (250 each)                         | 1,250      |         |          |
//! | covariance in its coordinates, process                         | 2,200      |         |          |
//!
//! `p` is the number of bins of window and past divided by 56, `e` the number of edges. An edge takes 1,500
//! operations if a lag is shorter than a sample. A refinement makes one fit per start, then searches from the
//! best three until one search ends at the noise. It takes some 2,100 slices, and 9,200 at most on 120 typical windows;
//! [`Refiner::most_slices`] gives the upper bound.

mod descent;
mod domain;
mod fundamental;
mod linear_fit;
mod model;
mod model_error;
mod prior;
mod problem;
mod refiner;
mod search;
mod tried;
mod uncertainty;

use self::domain::SHAPE;
pub(crate) use self::domain::shape_of;
pub use self::domain::{DomainEdge, Shape};
pub use self::prior::ShapePrior;
use self::problem::KNOWN;
pub use self::refiner::Refiner;
use crate::process::Soiptd;
use crate::window::Window;

/// Number of linear unknowns: y0, v0, w0, distortion, bias times gain, gain.
const LINEAR: usize = 6;
/// Number of all unknowns.
const ALL: usize = LINEAR + SHAPE;

/// Index of each coordinate in [`Refined::covariance`].
pub mod coordinate {
    /// Logarithm of the sum of the two poles.
    pub const LN_POLE_SUM: usize = 0;
    /// Product of the poles over the square of their sum.
    pub const POLE_RATIO: usize = 1;
    /// Delay (s).
    pub const TAU_S: usize = 2;
    /// Logarithm of `|K/(T_body T_prop)|`. Unlike `K/T_body` it does not change when the lags are exchanged, so
    /// it is regular where they are equal.
    pub const LN_JERK_GAIN: usize = 3;
    /// Input bias (input unit).
    pub const INPUT_BIAS: usize = 4;
}

/// Best process and its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Best process: least squares, or the most probable one with a prior.
    pub process: Soiptd,
    /// Constant input that is not recorded (input unit).
    pub input_bias: f64,
    /// Covariance over the coordinates of [`coordinate`], from the noise and from the model error found in the
    /// residual; `None` if a coordinate has no influence on the output.
    pub covariance: Option<[[f64; 5]; 5]>,
    /// Relative error of the model's response at the harmonics of the oscillation, found in the residual; zero
    /// if noise explains the residual.
    pub response_error: f64,
    /// Standard deviation of the residual for one sample (output unit).
    pub residual_sigma: f64,
    /// Standard deviation of the white noise in the samples (output unit).
    pub noise_sigma: f64,
    /// Root mean square of the residual in the bins (output unit).
    pub residual_rms: f64,
    /// Noise of the differences that were fitted because the noise is a random walk; `None` if the values themselves were. The
    /// residual is that of what was fitted.
    pub walk: Option<Walk>,
    /// The limit of the domain on which the fit lies, if any.
    pub edge: Option<DomainEdge>,
    /// Number of steps of the search from all starts.
    pub steps: u32,
}

/// Noise that is white in the differences of neighbouring bins only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Number of differences: one for an angle that an estimator integrates from a noisy rate, two for a height that it
    /// integrates twice from a noisy acceleration.
    pub differences: u8,
    /// Standard deviation of a difference (output unit).
    pub sigma: f64,
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RefineError {
    /// Too few usable bins: their number.
    TooFewBins(usize),
    /// The input in the window is constant.
    NoInput,
    /// No start led to a process: the output does not follow the input.
    NoFit,
}

/// Maximum number of additional starts: the five candidates of a classification and three more.
pub const GIVEN: usize = 8;

/// Fits the process to the window of an oscillation with period `period_s` (s).
///
/// # Errors
/// A [`RefineError`] if the window does not permit a fit.
pub fn refine<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
) -> Result<Refined, RefineError> {
    refine_with(window, period_s, &PriorKnowledge::default())
}

/// Prior knowledge for a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PriorKnowledge<'a> {
    /// Shapes to start from, in addition to those derived from the oscillation; the first [`GIVEN`] are used.
    pub starts: &'a [Shape],
    /// Distribution of the shapes.
    pub prior: Option<ShapePrior>,
    /// Whether the noise may be a random walk. Where the residual of the fit looks like a [`Walk`], differences are fitted.
    pub may_walk: bool,
}

/// Like [`refine`], with prior knowledge.
///
/// # Errors
/// Those of [`refine`].
pub fn refine_with<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
    prior_knowledge: &PriorKnowledge<'_>,
) -> Result<Refined, RefineError> {
    let mut refiner = Refiner::new();
    refiner.begin(window, period_s, prior_knowledge)?;
    loop {
        if let Some(outcome) = refiner.advance(window) {
            return outcome;
        }
    }
}

/// Residual of the best linear fit of a given process in each bin (output unit): measured minus fitted, zero in
/// bins that are not used. Returns the number of bins.
///
/// # Errors
/// Those of [`refine`].
pub fn residuals<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
    process: &Soiptd,
    residuals: &mut [f64; BINS],
) -> Result<usize, RefineError> {
    let mut refiner = Refiner::new();
    refiner.begin(window, period_s, &PriorKnowledge::default())?;
    refiner.residuals(window, &shape_of(process, period_s), residuals)?;
    Ok(window.bins().len())
}
