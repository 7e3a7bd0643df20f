//! Chains: the fewest places on a line that cover an interval, each a given deterioration from the
//! next.

use std::cell::Cell;

use crate::space::Range;
use crate::space::candidate::CandidateError;
use onecycle_design::roots::root;

/// A line of processes: one coordinate of a layout varies.
pub(super) trait Line {
    /// What a coordinate of the line stands for.
    type Place;

    fn place(&self, at: f64) -> Result<Self::Place, CandidateError>;

    /// `J_(ij)` between a place and another coordinate. It grows with the distance of the coordinates
    /// and is infinite if a controller is unstable.
    fn distance(&self, from: &Self::Place, to: f64) -> Result<f64, CandidateError>;
}

/// Precision of the balance of slack between the ends of a chain, over its first step: too small to
/// affect the coverage.
const BALANCE: f64 = 1e-3;

/// First distance of the search for a step, over the remaining interval.
const FIRST_LOOK: f64 = 1.0 / 32.0;

/// A monotone measure of a distance relative to a step, from -1/2 through zero at the step to 1/2, so
/// that a root search can handle infinite distances.
pub(super) fn beyond(distance: f64, step: f64) -> f64 {
    if distance.is_finite() {
        distance / (distance + step) - 0.5
    } else {
        0.5
    }
}

/// Coordinates from low to high whose neighbours are `step` apart; each one covers half a step to
/// either side. One coordinate if there is nothing to cover, and never two if one is enough. The first
/// and the last have the same distance to the ends.
pub(super) fn cover<L: Line>(
    line: &L,
    (low, high): Range,
    step: f64,
) -> Result<Vec<f64>, CandidateError> {
    if high <= low {
        return Ok(vec![low]);
    }
    let walk = Walk { line, step, high };
    let from_low = walk.from(low)?;
    let count = from_low.len();
    let latest = from_low.get(1).copied().unwrap_or(high);
    let error = Cell::new(None);
    let imbalance = |first: f64| {
        walk.imbalance(low, first, count).unwrap_or_else(|reason| {
            error.set(Some(reason));
            // Zero ends the search.
            0.0
        })
    };
    let first = root(imbalance, low, latest, BALANCE * (latest - low));
    if let Some(reason) = error.get() {
        return Err(reason);
    }
    let balanced = walk.from(first)?;
    // Without slack, rounding may push the last one out.
    Ok(if balanced.len() == count {
        balanced
    } else {
        from_low
    })
}

/// A walk along a line from its first place on.
pub(super) struct Walk<'a, L> {
    pub(super) line: &'a L,
    pub(super) step: f64,
    /// The last coordinate.
    pub(super) high: f64,
}

impl<L: Line> Walk<'_, L> {
    /// Coordinates from `first` on, one step apart.
    pub(super) fn from(&self, first: f64) -> Result<Vec<f64>, CandidateError> {
        let mut places = vec![first];
        let mut at = first;
        while let Some(next) = self.next(at)? {
            places.push(next);
            at = next;
        }
        Ok(places)
    }

    /// The coordinate one step further; `None` beyond the end.
    fn next(&self, at: f64) -> Result<Option<f64>, CandidateError> {
        let from = self.line.place(at)?;
        let error = Cell::new(None);
        let beyond = |to: f64| match self.line.distance(&from, to) {
            Ok(distance) => beyond(distance, self.step),
            Err(reason) => {
                error.set(Some(reason));
                // Zero ends the search.
                0.0
            }
        };
        let (mut near, mut look) = (at, FIRST_LOOK * (self.high - at));
        let found = loop {
            let far = (at + look).min(self.high);
            if beyond(far) > 0.0 {
                break Some(root(beyond, near, far, 0.0));
            }
            if far >= self.high || error.get().is_some() {
                break None;
            }
            near = far;
            look *= 2.0;
        };
        error.get().map_or(Ok(found), Err)
    }

    /// Distance of the first of `count` places from the low end minus that of the last from the high
    /// end.
    fn imbalance(&self, low: f64, first: f64, count: usize) -> Result<f64, CandidateError> {
        let before = self.line.distance(&self.line.place(low)?, first)?;
        let places = self.from(first)?;
        let after = match places.last() {
            Some(&last) if places.len() >= count => {
                self.line.distance(&self.line.place(last)?, self.high)?
            }
            _ => -self.step,
        };
        Ok((before - after).clamp(-self.step, self.step))
    }
}
