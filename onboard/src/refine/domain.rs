//! Domain of the search: shapes relative to the period of the oscillation, and their limits.

use libm::log;

use crate::process::Soiptd;

/// Unknowns of the search: `ln(pole sum * period)`, pole ratio, `tau / period`.
pub type Shape = [f64; SHAPE];
/// Number of unknowns of the search.
pub(super) const SHAPE: usize = 3;

/// Limits of the domain: lags from 1/1000 of a period to one period, delays up to half a period. Actuator and
/// delay of a process under a relay take half a period at most, so the domain contains all of them.
pub(super) const LOWEST: Shape = [0.0, 0.0, 0.0];
pub(super) const HIGHEST: Shape = [6.9, 0.25, 0.5];

/// Limit of the domain on which a best fit lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DomainEdge {
    /// Both lags are as slow as the oscillation permits.
    SlowLags,
    /// The lag of the actuator is too fast to be observed.
    FastLag,
    /// The delay is as long as the oscillation permits.
    LongDelay,
}

/// Shape of a process under an oscillation with period `period_s` (s).
pub(crate) fn shape_of(process: &Soiptd, period_s: f64) -> Shape {
    let (sum_per_s, ratio) = process.pole_sum();
    [log(sum_per_s * period_s), ratio, process.tau_s() / period_s]
}

/// Nearest shape in the domain.
pub(super) fn clamp(shape: &Shape) -> Shape {
    let mut inside = *shape;
    for (value, (low, high)) in inside.iter_mut().zip(LOWEST.iter().zip(&HIGHEST)) {
        *value = value.clamp(*low, *high);
    }
    inside
}

/// Limit of the domain on which a shape lies.
pub(super) fn domain_edge(shape: &Shape) -> Option<DomainEdge> {
    // The search stops a little before a limit that it approaches.
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
