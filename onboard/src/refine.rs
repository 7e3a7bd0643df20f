//! The estimator: from a window of one or more cycles to the process, by variable projection.
//!
//! Given the two lags and the delay, the output is linear in everything else:
//!
//! ```text
//! y(t) = b g(t) + b u0 s(t) + y0 + v0 r(t) + w0 q(t) + c d(t)
//! ```
//!
//! with `b` the gain, `g` the response to the recorded input, `s` to a constant one (the unknown
//! input bias `u0`), `r`, `q` to the unknown initial rate and acceleration, and `d` to the even part
//! of the actuator's force (`distortion.rs`). So a search over three unknowns (Levenberg-Marquardt,
//! box-constrained) with the six linear ones solved inside it: Golub and Pereyra (1973), with
//! Kaufman's (1975) Jacobian.
//!
//! Two things are known beforehand and stand as rows of the equations. The acceleration at the
//! beginning of the past cannot exceed what the relay can produce: without that, one that has died
//! away before the window begins would be undetermined. And the even part of the force is small.
//! Where the family of the process is known, so is how likely its shapes are (`prior.rs`): three rows
//! more, and the estimate is the most probable process instead of that of least squares.
//!
//! The three unknowns are the sum of the two poles (its logarithm), their product over the square
//! of the sum, and the delay: regular where the lags are equal (1/4) and where damping vanishes
//! (0), so the double integrator is an ordinary point of the domain's boundary.
//!
//! # In slices
//!
//! A [`Refiner`] does all of it a slice at a time, of which none takes longer than a controller's tick has
//! to spare; [`refine`] and [`refine_with`] are the loop over them.
//! Operations on numbers of eight bytes, a sine, an exponential or a logarithm counted as 45, of a window of
//! 64 bins of up to 32 samples. A processor without such numbers in hardware (Cortex-M4F) takes 60 to 100
//! cycles for each: the longest slice 130,000 to 220,000.
//!
//! | slice                                                          | operations | a fit | a step |
//! |----------------------------------------------------------------|------------|-------|--------|
//! | fundamental: 16 bins (95 each), or 8 edges (190 each)          | 1,600      |       |        |
//! | a process, transition and sums of its bin                      | 1,500      | 1     | 4      |
//! | response: 56 bins (32 each), an edge (1,200) for 40 of them    | 1,800      | 5 p + e | 4 (p + e) |
//! | distortion, begun                                              | 900        | 1     | 4      |
//! | distortion: 32 bins (45 each), an edge (110) for 3             | 1,600      | 4 p   | 16 p   |
//! | 5 parts out of a column (4 a row and part), its length, weight | 1,900      | 6     | 4      |
//! | 5 parts out of the outputs                                     | 1,600      | 2     |        |
//! | normal equations, a step                                       | 1,800      |       | 1      |
//! | a wave: 32 bins (54 each)                                      | 1,750      |       |        |
//! | 5 parts out of a wave, what is left of it                      | 1,800      |       |        |
//! | an error of the model                                          | 1,050      |       |        |
//! | 8 lags of the residual                                         | 1,000      |       |        |
//! | 5 squares of the covariance (250 each)                         | 1,250      |       |        |
//! | the covariance in its coordinates, the process                 | 2,200      |       |        |
//!
//! with `p` the bins of window and past over 56 and `e` the edges. An edge takes 1,500 where a lag is shorter
//! than a sample. A refinement makes a fit at each start, and from the best three steps of the search, each
//! with a fit or more, until one ends at the noise: some 2,100 slices, of 120 such windows 9,200 at most.
//! [`Refiner::most_slices`] is the bound.

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

/// Number of linear unknowns: y0, v0, w0, the distortion, the bias times the gain, the gain.
const LINEAR: usize = 6;
/// All unknowns.
const ALL: usize = LINEAR + SHAPE;

/// Index of each coordinate in [`Refined::covariance`].
pub mod coordinate {
    /// Logarithm of the sum of the two poles.
    pub const LN_POLE_SUM: usize = 0;
    /// Product of the poles over the square of their sum.
    pub const POLE_RATIO: usize = 1;
    /// Delay (s).
    pub const TAU_S: usize = 2;
    /// Logarithm of the size of `K/(T_body T_prop)`: unlike `K/T_body`, the same whichever lag comes
    /// first, so regular where they meet.
    pub const LN_JERK_GAIN: usize = 3;
    /// Input bias (input unit).
    pub const INPUT_BIAS: usize = 4;
}

/// The best process and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// The process of least squares.
    pub process: Soiptd,
    /// Constant input that the recording does not show (input unit).
    pub input_bias: f64,
    /// Covariance over the coordinates of [`coordinate`], from the noise and from the error of the
    /// model that the residual betrays; `None` where a coordinate has no influence at all.
    pub covariance: Option<[[f64; 5]; 5]>,
    /// Relative error of the response at the harmonics of the oscillation that the residual betrays;
    /// zero where noise explains it.
    pub response_error: f64,
    /// Standard deviation of the residual, for one sample (output unit).
    pub residual_sigma: f64,
    /// Standard deviation of white noise seen in the samples themselves (output unit).
    pub noise_sigma: f64,
    /// Root mean square of the residual bins (output unit).
    pub residual_rms: f64,
    /// The limit of the domain that the fit lies on, if any.
    pub edge: Option<DomainEdge>,
    /// Steps of the search, over all starts.
    pub steps: u32,
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RefineError {
    /// Fewer usable bins than unknowns ask for.
    TooFewBins(usize),
    /// The window's input never changes.
    NoInput,
    /// No start led to a process: the output does not follow the input.
    NoFit,
}

/// Most starts that may be given: the five candidates of a classification, and a few.
pub const GIVEN: usize = 8;

/// Fits the process to the window of an oscillation with the given period.
///
/// # Errors
/// A [`RefineError`] where the window does not hold what a fit needs.
pub fn refine<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
) -> Result<Refined, RefineError> {
    refine_with(window, period_s, &PriorKnowledge::default())
}

/// What is known before the fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PriorKnowledge<'a> {
    /// Shapes to start from, beside those that the oscillation itself suggests: the first [`GIVEN`].
    pub starts: &'a [Shape],
    /// How likely shapes are.
    pub prior: Option<ShapePrior>,
}

/// As [`refine`], with what is known beforehand.
///
/// # Errors
/// As [`refine`].
pub fn refine_with<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
    beforehand: &PriorKnowledge<'_>,
) -> Result<Refined, RefineError> {
    let mut refiner = Refiner::new();
    refiner.begin(window, period_s, beforehand)?;
    loop {
        if let Some(outcome) = refiner.advance(window) {
            return outcome;
        }
    }
}

/// What the best linear fit at a given process leaves of each bin (output unit): measured less
/// fitted; zero in a bin that is not fitted. Returns the number of bins.
///
/// # Errors
/// As [`refine`].
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
