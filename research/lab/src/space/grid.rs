//! Grids: sets of processes such that every process of a space is near one of them (section III-B of
//! the paper; Ayyad, Chehadeh, Awad, Zweiri 2020).
//!
//! The distance of two processes is `J_(ij) = max(J_ij, J_ji)`, [`Candidate::distance`]: the cost of
//! either one's optimal controller on the other, as a fraction above that one's own optimum. A grid is
//! computed for a deterioration `J*`. [`Layout::Rays`] and [`Layout::Fewest`] guarantee the same: every process of the space has a
//! member within `J*`; [`check`] measures it.
//!
//! | layout             | members                                                             |
//! |--------------------|---------------------------------------------------------------------|
//! | [`Layout::Rays`]   | the paper's: `J*` apart along each of three coordinates, with the gaps filled; members are far enough apart for a classifier |
//! | [`Layout::Lattice`] | by the rules of the authors' published code, to compare; it leaves gaps |
//! | [`Layout::Fewest`] | as few as cover the space, for a bank of controllers; no least distance between members |
//!
//! Work is cut into independent parts that run on the caller's [`Workers`].
//!
//! ```
//! use onecycle_lab::space::Space;
//! use onecycle_lab::space::grid::{Grid, Layout, GridSettings, check};
//! use onecycle_lab::workers::OneThread;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let space = Space { tau_s: (0.02, 0.02), ..Space::MULTIROTOR };
//! let settings = GridSettings { space, deterioration: 0.3, ..GridSettings::default() };
//! let grid = Grid::build(&settings, &OneThread)?;
//! let found = check(&grid, 100, 1, &OneThread)?;
//! assert!(found.worst.is_some_and(|worst| worst <= 0.3));
//! # Ok(())
//! # }
//! ```

use crate::space::candidate::{Candidate, CandidateError, Comparison, Gains};
use crate::space::surface::Direction;
use crate::space::{FieldError, Space};
use crate::workers::Workers;
use onecycle_design::soiptd_pd::criterion::Criterion;

mod chain;
mod coverage;
mod draws;
mod fewest;
mod file;
mod holes;
mod index;
mod lattice;
mod rays;

pub use coverage::{Check, check};
pub use file::{FORMAT, FileError, GridFile, MemberRecord, rounded, write};
pub use index::Index;
pub use rays::{Ray, row, rows, step};

/// How the members of a grid are chosen. See the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Rows, rays and radii, `J*` apart.
    #[default]
    Rays,
    /// A small cover.
    Fewest,
    /// The product of two lines of directions, with radii whose ratio grows.
    Lattice,
}

/// Settings of a grid.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridSettings {
    /// Space of the processes.
    pub space: Space,
    /// `J*`, as a fraction.
    pub deterioration: f64,
    /// Choice of the members.
    pub layout: Layout,
    /// Gains at which processes are compared.
    pub gains: Gains,
    /// Cost of a controller; the ISE if left out.
    #[serde(default, with = "CriterionName", skip_serializing_if = "is_ise")]
    pub criterion: Criterion,
}

/// Names of [`Criterion`] in files.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(remote = "Criterion", rename_all = "snake_case")]
enum CriterionName {
    Ise,
    Iae,
    Itae,
}

/// Files of the default criterion do not name it, as those of older programs.
fn is_ise(criterion: &Criterion) -> bool {
    *criterion == Criterion::Ise
}

impl Default for GridSettings {
    /// The paper's space and its 10 %.
    fn default() -> Self {
        Self {
            space: Space::MULTIROTOR,
            deterioration: 0.1,
            layout: Layout::Rays,
            gains: Gains::SameAmplitude,
            criterion: Criterion::Ise,
        }
    }
}

impl GridSettings {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        self.space.validate()?;
        if !(0.001..=1.0).contains(&self.deterioration) {
            return Err(FieldError {
                field: "deterioration",
                range: "0.001 to 1, that is 0.1 % to 100 %",
                value: self.deterioration,
            });
        }
        Ok(())
    }

    /// The process with these times, `T_prop`, `T_body`, `tau` (s), with its optimal controller.
    ///
    /// # Errors
    /// [`CandidateError`]: the process has no controller or no oscillation.
    pub fn candidate(&self, times_s: [f64; 3]) -> Result<Candidate, CandidateError> {
        let comparison = Comparison {
            gains: self.gains,
            criterion: self.criterion,
        };
        Candidate::new(&self.space, comparison, times_s)
    }
}

/// Place of a member in [`Layout::Rays`], all numbers from zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Number of the row, by rising `theta`.
    pub row: usize,
    /// Number of the ray in the row, by rising `phi`.
    pub ray: usize,
    /// Number of the radius on the ray, by rising radius.
    pub rung: usize,
    /// Ratio of neighbouring radii on the ray.
    pub alpha: f64,
}

/// A process of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member {
    /// The process and its controller.
    pub candidate: Candidate,
    /// The shape of the process.
    pub direction: Direction,
    /// The radius of the process (s).
    pub radius_s: f64,
    /// Place in [`Layout::Rays`]; `None` in the others and for a member that closes a hole.
    pub place: Option<Place>,
}

impl Member {
    /// A member without a place on a ray.
    fn alone(candidate: Candidate) -> Self {
        let (direction, radius_s) = Direction::of(candidate.times_s());
        Self {
            candidate,
            direction,
            radius_s,
            place: None,
        }
    }
}

/// Why a grid cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GridError {
    /// A setting is out of its range.
    #[error("{0}")]
    GridSettings(#[from] FieldError),
    /// A process of the space has no controller or no oscillation.
    #[error("{0}")]
    Candidate(#[from] CandidateError),
}

/// A grid. See the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Settings that the grid was computed for.
    pub settings: GridSettings,
    /// Members, at least one: by row, ray and radius, or by rising `Kd`.
    pub members: Vec<Member>,
}

impl Grid {
    /// Computes a grid.
    ///
    /// # Errors
    /// [`GridError`]: a setting is out of its range, or a process has no controller or no oscillation.
    pub fn build(settings: &GridSettings, workers: &dyn Workers) -> Result<Self, GridError> {
        settings.validate()?;
        let members = match settings.layout {
            Layout::Fewest => fewest::members(settings, workers)?,
            Layout::Lattice => lattice::members(settings)?,
            Layout::Rays => {
                let thetas_rad = rows(settings, workers)?;
                let rows = workers.map(thetas_rad.len(), |k| row(settings, thetas_rad[k]));
                let rows: Vec<Vec<Ray>> = rows.into_iter().collect::<Result<_, _>>()?;
                return Self::of_rays(settings, &rows, workers);
            }
        };
        Ok(Self {
            settings: *settings,
            members,
        })
    }

    /// The grid of these rays, row by row, and of the members that close its holes.
    ///
    /// # Errors
    /// [`GridError`]: a setting is out of its range, or a process has no controller or no oscillation.
    pub fn of_rays(
        settings: &GridSettings,
        rows: &[Vec<Ray>],
        workers: &dyn Workers,
    ) -> Result<Self, GridError> {
        settings.validate()?;
        let rows = workers.map(rows.len(), |row| {
            let rays = rows[row].iter().enumerate();
            let members = rays.map(|(number, ray)| ray.members(settings, row, number));
            members
                .collect::<Result<Vec<_>, _>>()
                .map(|rays| rays.concat())
        });
        let rows: Vec<Vec<Member>> = rows.into_iter().collect::<Result<_, _>>()?;
        let mut members = rows.concat();
        holes::close(settings, &mut members, workers)?;
        Ok(Self {
            settings: *settings,
            members,
        })
    }

    /// `J_ij` of the controller of member `i` on every process `j`; `None` if unstable.
    #[must_use]
    pub fn costs(&self, i: usize) -> Vec<Option<f64>> {
        let made = &self.members[i].candidate;
        self.members
            .iter()
            .map(|member| made.cost_on(&member.candidate))
            .map(|cost| cost.is_finite().then_some(cost))
            .collect()
    }
}
