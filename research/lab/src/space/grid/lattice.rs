//! The lattice by the rules of the published code of the paper's authors, as far as they are known.
//!
//! Two lines of directions cross at the corner of the space with the shortest lags and the longest dead time: one of `theta`, to
//! both sides, and one of `phi`, towards shorter dead times. Members are the radii of the product of both lists:
//!
//! ```text
//! r_k = r_0 c^(k (k + 1) / 2),   r_0 the least radius of the ray in the space,   c the step of J*
//! ```
//!
//! The ratio of radii grows from step to step, so that members are farther than `J*` apart and the space is not covered. A ray
//! that misses the space gives the point of the space nearest to it. The code accepts a neighbour on a line whose J is `J*` within
//! 0.03; here it is the nearest such one. With that the paper's space has 40 members, and 48, the authors' number, with dead times
//! up to 25 ms.

use super::chain::{Line, Walk};
use super::{GridSettings, Member, step};
use crate::space::Space;
use crate::space::candidate::{Candidate, CandidateError};
use crate::space::surface::Direction;
use onecycle_design::roots::root;

/// Half the width of the deteriorations that the search for a neighbour accepts.
const ACCEPTED: f64 = 0.03;

/// Part of a time by which a member may lie outside the space.
const OUTSIDE: f64 = 0.05;

/// A line of directions from the corner on; its coordinate is the change of an angle (rad).
struct FromCorner<'a> {
    settings: &'a GridSettings,
    corner: Direction,
    /// Changes of `theta` and `phi` for a coordinate of one.
    towards: [f64; 2],
}

impl FromCorner<'_> {
    fn direction(&self, at: f64) -> Direction {
        Direction {
            theta_rad: self.corner.theta_rad + at * self.towards[0],
            phi_rad: self.corner.phi_rad + at * self.towards[1],
        }
    }

    /// Coordinates of the neighbours up to the last one, without the corner.
    fn neighbours(&self, last: f64) -> Result<Vec<f64>, CandidateError> {
        let step = (self.settings.deterioration - ACCEPTED).max(0.5 * self.settings.deterioration);
        let walk = Walk {
            line: self,
            step,
            high: last,
        };
        Ok(walk.from(0.0)?.split_off(1))
    }
}

impl Line for FromCorner<'_> {
    type Place = Candidate;

    fn place(&self, at: f64) -> Result<Candidate, CandidateError> {
        self.settings.candidate(self.direction(at).at(1.0))
    }

    fn distance(&self, from: &Candidate, to: f64) -> Result<f64, CandidateError> {
        Ok(from.distance(&self.place(to)?))
    }
}

/// Members by rising `theta`, `phi` and radius.
pub(super) fn members(settings: &GridSettings) -> Result<Vec<Member>, CandidateError> {
    let space = &settings.space;
    let (corner, _) = Direction::of([space.t_prop_s.0, space.t_body_s.0, space.tau_s.1]);
    let line = |towards| FromCorner {
        settings,
        corner,
        towards,
    };
    let (low, high) = space.theta_range_rad();
    let below = line([-1.0, 0.0]).neighbours(corner.theta_rad - low)?;
    let above = line([1.0, 0.0]).neighbours(high - corner.theta_rad)?;
    let least_delay = Direction::of([space.t_prop_s.1, space.t_body_s.1, space.tau_s.0]).0;
    let phis = line([0.0, 1.0]).neighbours(least_delay.phi_rad - corner.phi_rad)?;
    let mut thetas: Vec<f64> = below.iter().rev().map(|at| -at).collect();
    thetas.extend([0.0].iter().chain(&above));

    let mut members = Vec::new();
    for theta in thetas {
        for phi in [0.0].iter().chain(&phis) {
            let direction = Direction {
                theta_rad: corner.theta_rad + theta,
                phi_rad: corner.phi_rad + phi,
            };
            ladder(settings, direction, &mut members)?;
        }
    }
    Ok(members)
}

fn ladder(
    settings: &GridSettings,
    direction: Direction,
    members: &mut Vec<Member>,
) -> Result<(), CandidateError> {
    let space = &settings.space;
    let Some((low_s, high_s)) = space.radius_range_s(direction) else {
        let nearest = settings.candidate(space.nearest_to(direction))?;
        members.push(Member::alone(nearest));
        return Ok(());
    };
    let first = settings.candidate(direction.at(low_s))?;
    let c = step(&first, settings.deterioration);
    let (mut scale, mut ratio) = (1.0, c);
    while low_s * scale <= high_s * (1.0 + OUTSIDE) {
        members.push(Member::alone(first.scaled(scale)?));
        scale *= ratio;
        ratio *= c;
    }
    Ok(())
}

impl Space {
    /// Times (s) of the process of the space that is nearest to the ray in this direction.
    fn nearest_to(&self, direction: Direction) -> [f64; 3] {
        let along = direction.at(1.0);
        let ranges_s = self.ranges_s();
        let nearest = |radius_s: f64| {
            [0, 1, 2].map(|k| (radius_s * along[k]).clamp(ranges_s[k].0, ranges_s[k].1))
        };
        // Half the derivative of the squared distance, which rises with the radius.
        let slope = |radius_s: f64| {
            let times_s = nearest(radius_s);
            let terms = (0..3).map(|k| (radius_s * along[k] - times_s[k]) * along[k]);
            terms.sum::<f64>()
        };
        let longest_s: f64 = ranges_s.iter().map(|range| range.1).sum();
        nearest(root(slope, 0.0, longest_s, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The ray of equal times from the origin passes the box 1..2, 3..4, 0..0.5 at r (1, 1, 1) / sqrt 3 with the least distance
    // where the sum of the differences vanishes: x = r / sqrt 3 is 2 < x < 3, x - 2 + x - 3 + x - 0.5 = 0, x = 11 / 6 < 2, so
    // that the first difference vanishes instead: x - 3 + x - 0.5 = 0, x = 1.75.
    #[test]
    fn nearest_process_by_hand() {
        let space = Space {
            t_prop_s: (1.0, 2.0),
            t_body_s: (3.0, 4.0),
            tau_s: (0.0, 0.5),
            ..Space::MULTIROTOR
        };
        let (direction, _) = Direction::of([1.0, 1.0, 1.0]);
        let found = space.nearest_to(direction);
        for (time_s, expected) in found.into_iter().zip([1.75, 3.0, 0.5]) {
            assert!((time_s - expected).abs() < 1e-12, "{found:?}");
        }
    }
}
