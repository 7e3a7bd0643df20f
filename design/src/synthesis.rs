//! The controller of least cost within limits: the gain of a shape is exact, only the shape is searched.
//!
//! A *shape* is a controller up to its gain `k`: integral, derivative and filter times. At each frequency the limits
//! forbid an interval of `k` in closed form; the largest `k` that no frequency forbids is the gain of the shape. So the
//! sensitivity limit holds to rounding, and no maximum over frequencies is ever solved for.
//!
//! | file | content |
//! |------|---------|
//! | `limits` | limits of the loop; the gains that they forbid at one frequency |
//! | `bands` | the gains that they allow over all frequencies |
//! | `shape` | shapes of each form |
//! | `objective` | cost of a shape |
//! | `simplex` | Nelder-Mead search |
//! | `optimum` | starts, search, check of the result |
//! | `polish` | optimum to six digits |
//! | `setpoint` | set-point weight |
//! | `robust` | optimum over draws |

pub(crate) mod bands;
pub(crate) mod limits;
pub(crate) mod objective;
pub(crate) mod optimum;
pub(crate) mod polish;
pub(crate) mod robust;
pub(crate) mod setpoint;
pub(crate) mod shape;
pub(crate) mod simplex;

#[cfg(test)]
mod tests;
