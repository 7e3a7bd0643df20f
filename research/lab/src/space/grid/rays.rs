//! The paper's layout: rows of constant `theta`, rays in each row, a ladder of radii on each ray.
//!
//! The distance of two rays is the same at every radius (the paper's property 1), so rows and rays are
//! placed on the sphere of radius one, and a ladder is geometric:
//!
//! - rows: `J*` apart in the root mean square over the row, at the same `phi` and radius;
//! - rays of a row: `J*` apart at the same radius, over the angles `phi` that the row has in the space;
//! - rungs of a ray: radii `alpha^k` with `alpha` the step of that ray, over its radii in the space.
//!
//! Rows are farthest apart at their end with the shortest dead time, where the lags alone determine the
//! time scale, and near each other everywhere else. Rows `J*` apart at that end would need more than
//! twice as many members without any benefit, because a process in that corner is near members of the
//! next rays.
//!
//! Rows have constant `theta` and rays constant `phi`, because the other way round takes more members:
//! 280 instead of 182 for the paper's space at 10 %.

use super::chain::{Line, beyond, cover};
use super::{GridSettings, Member, Place};
use crate::space::Range;
use crate::space::candidate::{Candidate, CandidateError};
use crate::space::surface::Direction;
use crate::workers::Workers;
use onecycle_design::roots::root;

/// Number of places at which two rows are compared, from end to end of the first: the distance changes
/// little from one to the next.
const PLACES_PER_ROW: usize = 9;

/// The angles `theta` (rad) of the rows.
///
/// # Errors
/// [`CandidateError`]: a process has no controller or no oscillation.
pub fn rows(settings: &GridSettings, workers: &dyn Workers) -> Result<Vec<f64>, CandidateError> {
    cover(
        &Rows { settings, workers },
        settings.space.theta_range_rad(),
        settings.deterioration,
    )
}

/// A ray with its ladder, from which its members follow.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ray {
    /// Angle `theta` (rad).
    pub theta_rad: f64,
    /// Angle `phi` (rad).
    pub phi_rad: f64,
    /// Geometric mean of the radii (s).
    pub middle_s: f64,
    /// Ratio of neighbouring radii.
    pub alpha: f64,
    /// Number of radii.
    pub rungs: usize,
}

/// The rays of the row at this `theta`, by rising `phi`.
///
/// # Errors
/// [`CandidateError`]: a process has no controller or no oscillation.
pub fn row(settings: &GridSettings, theta_rad: f64) -> Result<Vec<Ray>, CandidateError> {
    let Some(range_rad) = settings.space.phi_range_rad(theta_rad) else {
        return Ok(Vec::new());
    };
    let line = Row {
        settings,
        theta_rad,
    };
    cover(&line, range_rad, settings.deterioration)?
        .into_iter()
        .filter_map(|phi_rad| {
            let direction = Direction { theta_rad, phi_rad };
            let radii_s = settings.space.radius_range_s(direction)?;
            Some(ladder(settings, direction, radii_s))
        })
        .collect()
}

/// First step of the search along a ladder, in natural logarithms; no step is shorter.
const LEAST_STEP: f64 = 1e-4;

/// The factor `alpha > 1` for which a candidate scaled by it is `deterioration` away.
#[must_use]
pub fn step(candidate: &Candidate, deterioration: f64) -> f64 {
    let beyond = |ln_alpha: f64| {
        let scaled = candidate.scaled(ln_alpha.exp());
        beyond(
            scaled.map_or(f64::INFINITY, |scaled| candidate.distance(&scaled)),
            deterioration,
        )
    };
    let (mut near, mut far) = (0.0, LEAST_STEP);
    // Ends at the latest when the times overflow.
    while beyond(far) <= 0.0 {
        (near, far) = (far, 2.0 * far);
    }
    root(beyond, near, far, 0.0).exp()
}

/// The fewest radii that cover the ray, each half a step to either side, centred.
fn ladder(
    settings: &GridSettings,
    direction: Direction,
    (low_s, high_s): Range,
) -> Result<Ray, CandidateError> {
    let middle_s = low_s.sqrt() * high_s.sqrt();
    let middle = settings.candidate(direction.at(middle_s))?;
    let alpha = step(&middle, settings.deterioration);
    Ok(Ray {
        theta_rad: direction.theta_rad,
        phi_rad: direction.phi_rad,
        middle_s,
        alpha,
        rungs: ((high_s / low_s).ln() / alpha.ln()).ceil().max(1.0) as usize,
    })
}

impl Ray {
    /// Members of the ray by rising radius; `ray` and `row` are its numbers.
    ///
    /// # Errors
    /// [`CandidateError`]: a process has no controller or no oscillation.
    pub fn members(
        &self,
        settings: &GridSettings,
        row: usize,
        ray: usize,
    ) -> Result<Vec<Member>, CandidateError> {
        let Self {
            middle_s, alpha, ..
        } = *self;
        let direction = Direction {
            theta_rad: self.theta_rad,
            phi_rad: self.phi_rad,
        };
        let middle = settings.candidate(direction.at(middle_s))?;
        (0..self.rungs)
            .map(|rung| {
                let scale = alpha.powf(rung as f64 - 0.5 * (self.rungs - 1) as f64);
                Ok(Member {
                    candidate: middle.scaled(scale)?,
                    direction,
                    radius_s: middle_s * scale,
                    place: Some(Place {
                        row,
                        ray,
                        rung,
                        alpha,
                    }),
                })
            })
            .collect()
    }
}

/// A row as a line of `phi`, at radius one.
struct Row<'a> {
    settings: &'a GridSettings,
    theta_rad: f64,
}

impl Line for Row<'_> {
    type Place = Candidate;

    fn place(&self, phi_rad: f64) -> Result<Candidate, CandidateError> {
        let theta_rad = self.theta_rad;
        self.settings
            .candidate(Direction { theta_rad, phi_rad }.at(1.0))
    }

    fn distance(&self, from: &Candidate, phi_rad: f64) -> Result<f64, CandidateError> {
        Ok(from.distance(&self.place(phi_rad)?))
    }
}

/// The space as a line of `theta`; a place on it is a row.
struct Rows<'a> {
    settings: &'a GridSettings,
    workers: &'a dyn Workers,
}

impl Rows<'_> {
    fn row(&self, theta_rad: f64) -> Row<'_> {
        Row {
            settings: self.settings,
            theta_rad,
        }
    }
}

impl Line for Rows<'_> {
    type Place = Vec<(f64, Candidate)>;

    fn place(&self, theta_rad: f64) -> Result<Self::Place, CandidateError> {
        let Some((low, high)) = self.settings.space.phi_range_rad(theta_rad) else {
            return Ok(Vec::new());
        };
        let row = self.row(theta_rad);
        let count = if high > low { PLACES_PER_ROW } else { 1 };
        let places = self.workers.map(count, |k| {
            let phi_rad = high - (high - low) * k as f64 / (PLACES_PER_ROW - 1) as f64;
            Ok((phi_rad, row.place(phi_rad)?))
        });
        places.into_iter().collect()
    }

    fn distance(&self, from: &Self::Place, theta_rad: f64) -> Result<f64, CandidateError> {
        let row = self.row(theta_rad);
        let distances = self.workers.map(from.len(), |k| {
            let (phi_rad, candidate) = &from[k];
            row.distance(candidate, *phi_rad)
        });
        let mut sum = 0.0;
        for distance in distances {
            sum += distance?.powi(2);
        }
        Ok((sum / from.len().max(1) as f64).sqrt())
    }
}
