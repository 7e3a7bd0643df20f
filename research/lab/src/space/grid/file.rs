//! The file of a grid: JSON, `"format": "onecycle.grid/1"`; unstable or infinite values are null.
//!
//! ```text
//! { "format", "program",           what wrote it
//!   "settings": { .. },            settings that the grid was made for
//!   "check": { .. } or null,       costs on random processes
//!   "members": [ { .. }, .. ],     one member per line
//!   "matrix": [ [ .. ], .. ] }     row i, column j: J_ij; or null without matrix
//! ```
//!
//! The reader trusts nothing: it checks sizes, ranges, the box and the angles, and computes a sample of
//! members and matrix again; [`GridFile::grid`] computes every member again. If the program is newer
//! than the file, gains must agree to [`AGREEMENT`] or the file is refused.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};

use super::{Check, Grid, GridSettings, Layout, Member, Place};
use crate::space::FieldError;
use crate::space::candidate::CandidateError;
use crate::space::surface::Direction;
use crate::workers::Workers;

/// Changes with every change that a reader could notice.
pub const FORMAT: &str = "onecycle.grid/1";

/// Relative difference between file and computation that counts as rounding, in either program; a gain
/// of a grid matters to some 1e-3.
const AGREEMENT: f64 = 1e-6;

/// Absolute precision of the elements of the matrix in the file: a ten-thousandth of a per cent, in a
/// third of the digits.
const MATRIX_PRECISION: f64 = 1e-6;

/// Number of members, and of elements of the matrix, that [`GridFile::read`] computes again.
const SAMPLE: usize = 16;

/// A file of a grid that has been read and checked.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridFile {
    /// [`FORMAT`].
    pub format: String,
    /// Program that wrote the file.
    pub program: String,
    /// Settings of the grid.
    pub settings: GridSettings,
    /// Check of the grid; `None` if there was none.
    pub check: Option<Check>,
    /// The members.
    pub members: Vec<MemberRecord>,
    /// `J_ij`, the cost of controller `i` on process `j`; `None` if unstable. `None` as a whole if it
    /// was left out.
    pub matrix: Option<Vec<Vec<Option<f64>>>>,
}

/// A member as stored in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberRecord {
    /// Lag of the actuator (s).
    pub t_prop_s: f64,
    /// Lag of the body (s).
    pub t_body_s: f64,
    /// Dead time (s).
    pub tau_s: f64,
    /// Angle `theta` of the shape (rad).
    pub theta_rad: f64,
    /// Angle `phi` of the shape (rad).
    pub phi_rad: f64,
    /// Radius (s).
    pub r_s: f64,
    /// `K/T_body` (output unit / (input unit s^2)): with this gain a relay of amplitude one gives an
    /// oscillation of amplitude one; with equal gains the one for `K = 1`.
    pub k_over_t_body: f64,
    /// Proportional gain for that process (input unit / output unit).
    pub kp: f64,
    /// Derivative gain for that process (input unit s / output unit).
    pub kd: f64,
    /// Squared error of a unit step (output unit^2 s).
    pub ise: f64,
    /// Lead of the controller at the gain crossover (rad).
    pub lead_rad: f64,
    /// Phase margin (rad).
    pub phase_margin_rad: f64,
    /// Gain margin as a factor; null if no gain is too high.
    pub gain_margin: Option<f64>,
    /// Number of the row; null without rows.
    pub row: Option<usize>,
    /// Number of the ray in the row.
    pub ray: Option<usize>,
    /// Number of the radius on the ray.
    pub rung: Option<usize>,
    /// Ratio of neighbouring radii of the ray.
    pub alpha: Option<f64>,
}

/// Why a file is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FileError {
    /// The file is not JSON, or has other fields.
    #[error("not a grid: {0}")]
    Json(String),
    /// The file has another format.
    #[error("the format is {0}, but this program reads {FORMAT:?}: make the grid again")]
    Format(String),
    /// A setting is out of its range.
    #[error("settings: {0}")]
    GridSettings(#[from] FieldError),
    /// The grid has no members.
    #[error("the grid has no members")]
    Empty,
    /// A member contradicts itself, the settings or the program.
    #[error("member {number}: {reason}")]
    Member {
        /// Number of the member, from zero.
        number: usize,
        /// What is wrong.
        reason: String,
    },
    /// The matrix contradicts the members.
    #[error("matrix: {0}")]
    Matrix(String),
}

impl MemberRecord {
    fn of(member: &Member) -> Self {
        let Member {
            candidate,
            direction,
            radius_s,
            place,
        } = member;
        let [t_prop_s, t_body_s, tau_s] = candidate.times_s();
        let optimum = &candidate.optimum;
        Self {
            t_prop_s,
            t_body_s,
            tau_s,
            theta_rad: direction.theta_rad,
            phi_rad: direction.phi_rad,
            r_s: *radius_s,
            k_over_t_body: candidate.process.k_over_t_body(),
            kp: optimum.pd.kp,
            kd: optimum.pd.kd,
            ise: optimum.ise,
            lead_rad: optimum.lead_rad,
            phase_margin_rad: optimum.margins.phase_margin_rad,
            gain_margin: optimum.margins.gain_margin,
            row: place.map(|place| place.row),
            ray: place.map(|place| place.ray),
            rung: place.map(|place| place.rung),
            alpha: place.map(|place| place.alpha),
        }
    }

    fn times_s(&self) -> [f64; 3] {
        [self.t_prop_s, self.t_body_s, self.tau_s]
    }

    fn place(&self) -> Option<Place> {
        Some(Place {
            row: self.row?,
            ray: self.ray?,
            rung: self.rung?,
            alpha: self.alpha?,
        })
    }

    /// The member computed again, or the contradiction.
    fn member(&self, settings: &GridSettings) -> Result<Member, String> {
        let candidate = settings
            .candidate(self.times_s())
            .map_err(|error: CandidateError| error.to_string())?;
        let member = Member {
            candidate,
            direction: Direction {
                theta_rad: self.theta_rad,
                phi_rad: self.phi_rad,
            },
            radius_s: self.r_s,
            place: self.place(),
        };
        let fresh = Self::of(&member);
        for (name, found, expected) in [
            ("k_over_t_body", self.k_over_t_body, fresh.k_over_t_body),
            ("kp", self.kp, fresh.kp),
            ("kd", self.kd, fresh.kd),
            ("ise", self.ise, fresh.ise),
            ("lead_rad", self.lead_rad, fresh.lead_rad),
            (
                "phase_margin_rad",
                self.phase_margin_rad,
                fresh.phase_margin_rad,
            ),
        ] {
            if !agree(found, expected) {
                return Err(format!(
                    "{name} is {found}, but these times give {expected}: make the grid again"
                ));
            }
        }
        Ok(member)
    }

    /// Faults that are found without computing the member.
    fn fault(&self, settings: &GridSettings) -> Option<String> {
        for (time_s, (low, high)) in self.times_s().into_iter().zip(settings.space.ranges_s()) {
            let slack = AGREEMENT * high;
            if !(low - slack..=high + slack).contains(&time_s) {
                return Some(format!(
                    "{time_s} s is outside the space, {low} to {high} s"
                ));
            }
        }
        let (direction, radius_s) = Direction::of(self.times_s());
        if !agree(self.r_s, radius_s)
            || !agree(self.theta_rad, direction.theta_rad)
            || !agree(self.phi_rad, direction.phi_rad)
        {
            return Some("its angles and radius do not match its times".to_owned());
        }
        let has_place = self.place().is_some_and(|place| place.alpha > 1.0);
        let has_none = [self.row, self.ray, self.rung] == [None; 3] && self.alpha.is_none();
        match settings.layout {
            Layout::Rays if !has_place && !has_none => Some(
                "row, ray, rung and an alpha above 1 must be given together or not at all"
                    .to_owned(),
            ),
            Layout::Fewest if !has_none => {
                Some("a grid of this layout must not name row, ray, rung or alpha".to_owned())
            }
            _ => None,
        }
    }
}

fn agree(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= AGREEMENT * expected.abs()
}

impl GridFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`FileError`]: the first fault.
    pub fn read(text: &str) -> Result<Self, FileError> {
        #[derive(Deserialize)]
        struct Head {
            format: serde_json::Value,
        }
        let json = |error: serde_json::Error| FileError::Json(error.to_string());
        let head: Head = serde_json::from_str(text).map_err(json)?;
        if head.format != FORMAT {
            return Err(FileError::Format(head.format.to_string()));
        }
        let file: Self = serde_json::from_str(text).map_err(json)?;
        file.settings.validate()?;
        file.check_members()?;
        file.check_matrix()?;
        Ok(file)
    }

    /// The grid, with every member computed again.
    ///
    /// # Errors
    /// [`FileError::Member`]: a member that differs.
    pub fn grid(&self, workers: &dyn Workers) -> Result<Grid, FileError> {
        let members = workers.map(self.members.len(), |number| self.member(number));
        Ok(Grid {
            settings: self.settings,
            members: members.into_iter().collect::<Result<_, _>>()?,
        })
    }

    fn member(&self, number: usize) -> Result<Member, FileError> {
        self.members[number]
            .member(&self.settings)
            .map_err(|reason| FileError::Member { number, reason })
    }

    fn check_members(&self) -> Result<(), FileError> {
        let last = self.members.len().checked_sub(1).ok_or(FileError::Empty)?;
        let mut before = None;
        for (number, record) in self.members.iter().enumerate() {
            if let Some(reason) = record.fault(&self.settings) {
                return Err(FileError::Member { number, reason });
            }
            // Members without a place on a ray come last.
            let place = record.place().map_or((usize::MAX, 0, 0), |place| {
                (place.row, place.ray, place.rung)
            });
            let is_later = before.is_none_or(|before| place > before);
            if record.place().is_some() && !is_later {
                return Err(FileError::Member {
                    number,
                    reason: "it is out of the order of rows, rays and rungs".to_owned(),
                });
            }
            before = Some(place);
        }
        for k in 0..SAMPLE.min(self.members.len()) {
            self.member(k * last / SAMPLE.min(self.members.len()))?;
        }
        Ok(())
    }

    fn check_matrix(&self) -> Result<(), FileError> {
        let Some(matrix) = &self.matrix else {
            return Ok(());
        };
        let count = self.members.len();
        if matrix.len() != count || matrix.iter().any(|row| row.len() != count) {
            return Err(FileError::Matrix(format!(
                "it must have {count} rows of {count}, one for every member"
            )));
        }
        for k in 0..SAMPLE {
            // Two different strides, so that the sample is not on a line.
            let (i, j) = (k * count / SAMPLE, (5 * k + 3) % SAMPLE * count / SAMPLE);
            let (made, on) = (self.member(i)?.candidate, self.member(j)?.candidate);
            let expected = made.cost_on(&on);
            let found = matrix[i][j].unwrap_or(f64::INFINITY);
            let slack = MATRIX_PRECISION + AGREEMENT * (1.0 + expected.abs());
            if found != expected
                && (found - expected)
                    .abs()
                    .partial_cmp(&slack)
                    .is_none_or(|order| order.is_gt())
            {
                return Err(FileError::Matrix(format!(
                    "row {i}, column {j} is {found}, but these members give {expected}"
                )));
            }
        }
        Ok(())
    }
}

/// An element of the matrix as it is stored.
#[must_use]
pub fn rounded(cost: f64) -> f64 {
    // A quotient by a power of ten is the double nearest to few digits; adding zero turns -0 into 0.
    (cost / MATRIX_PRECISION).round() / MATRIX_PRECISION.recip() + 0.0
}

/// Writes the file of a grid, with these rows of the matrix if there are any, as they arrive.
///
/// # Errors
/// Errors of `out` and of `matrix`.
pub fn write(
    out: &mut dyn Write,
    grid: &Grid,
    check: Option<&Check>,
    matrix: Option<&mut dyn Iterator<Item = io::Result<Vec<Option<f64>>>>>,
) -> io::Result<()> {
    let settings = serde_json::to_string(&grid.settings)?;
    let check = serde_json::to_string(&check)?;
    let program = concat!("onecycle ", env!("CARGO_PKG_VERSION"));
    writeln!(
        out,
        "{{\"format\":\"{FORMAT}\",\n\"program\":\"{program}\",\n\"settings\":{settings},\n\
         \"check\":{check},\n\"members\":["
    )?;
    let members = grid
        .members
        .iter()
        .map(|member| Ok(MemberRecord::of(member)));
    write_lines(out, members)?;
    match matrix {
        Some(rows) => {
            write!(out, "],\n\"matrix\":[\n")?;
            write_lines(out, rows)?;
            out.write_all(b"]}\n")
        }
        None => out.write_all(b"],\n\"matrix\":null}\n"),
    }
}

/// Writes the elements of a list, one per line.
fn write_lines<T: Serialize>(
    out: &mut dyn Write,
    values: impl Iterator<Item = io::Result<T>>,
) -> io::Result<()> {
    for (number, value) in values.enumerate() {
        if number > 0 {
            out.write_all(b",\n")?;
        }
        serde_json::to_writer(&mut *out, &value?)?;
    }
    out.write_all(b"\n")
}
