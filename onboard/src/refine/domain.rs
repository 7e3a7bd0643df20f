//! Where the estimator searches: shapes in periods of the oscillation, and their limits.

use libm::log;

use crate::process::Soiptd;

/// Unknowns of the search: `ln(pole sum * period)`, pole ratio, `tau / period`.
pub type Shape = [f64; SHAPE];
/// Number of unknowns of the search.
pub(super) const SHAPE: usize = 3;

/// The domain, in periods: lags from 1/1000 of a period to one, delays to half a period. Wider
/// than any relay oscillation of this process: its actuator and delay are at most its half period.
pub(super) const LOWEST: Shape = [0.0, 0.0, 0.0];
pub(super) const HIGHEST: Shape = [6.9, 0.25, 0.5];

/// A limit of the domain that the best fit lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DomainEdge {
    /// Both lags as slow as the oscillation allows.
    SlowLags,
    /// The actuator's lag too fast to be seen.
    FastLag,
    /// The delay as long as the oscillation allows.
    LongDelay,
}

/// The shape of a process under an oscillation of this period (s).
pub(crate) fn shape_of(process: &Soiptd, period_s: f64) -> Shape {
    let (sum_per_s, ratio) = process.pole_sum();
    [log(sum_per_s * period_s), ratio, process.tau_s() / period_s]
}

/// The shape nearest to this one that is in the domain.
pub(super) fn clamp(shape: &Shape) -> Shape {
    let mut inside = *shape;
    for (value, (low, high)) in inside.iter_mut().zip(LOWEST.iter().zip(&HIGHEST)) {
        *value = value.clamp(*low, *high);
    }
    inside
}

/// The limit of the domain that a shape lies on.
pub(super) fn domain_edge(shape: &Shape) -> Option<DomainEdge> {
    // The search stops short of a limit that it creeps up to.
    let near = |index: usize, limit: f64| {
        (shape[index] - limit).abs() < 1e-2 * (HIGHEST[index] - LOWEST[index])
    };
    if near(2, HIGHEST[2]) {
        Some(DomainEdge::LongDelay)
    } else if near(0, LOWEST[0]) {
        Some(DomainEdge::SlowLags)
    } else if near(0, HIGHEST[0]) {
        Some(DomainEdge::FastLag)
    } else {
        None
    }
}
