//! Nodes of the lead table, and cubic interpolation between them.
//!
//! The coordinates `x` and `y` and the stretch `c` are those of the [table](super): ratios of times, from 0 to 1
//! at most.

use core::f64::consts::FRAC_PI_2;
use core::fmt;

use super::GainsError;
use crate::process::Soiptd;

/// Largest dead time of a table in shorter lags. Beyond it both lags become negligible, and the lead changes
/// faster than a small table can follow.
pub const LARGEST_DELAY_IN_LAGS: f64 = 20.0;

/// `tau / (T_1 + tau)` at the largest dead time.
const LARGEST_DELAY_SHARE: f64 = LARGEST_DELAY_IN_LAGS / (1.0 + LARGEST_DELAY_IN_LAGS);

/// Relative excess of the largest dead time that counts as rounding.
const ROUNDING: f64 = 1e-9;

/// Numbers of the [`Nodes`] before the angles: margin, two stretches, number of points.
pub const HEADER: usize = 4;

/// Angles per node: lead at the margin, free margin, lead at the free margin.
pub const FIELDS: usize = 3;

/// Number of nodes of a cubic.
pub(super) const STENCIL: usize = 4;

/// Maximum number of points along an axis; long before that the error of a table is rounding.
const MAX_POINTS: usize = 1000;

/// Positions of the nodes of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nodes {
    /// Phase margin that the table is made for (rad), between 0 and `pi/2`.
    pub phase_margin_rad: f32,
    /// Stretch `c` of the axis of the dead time, above 0.
    pub delay_stretch: f32,
    /// Stretch `c` of the axis of the lags, above 0.
    pub lag_stretch: f32,
    /// Number of points along either axis, 4 to 1000.
    pub points: usize,
}

/// Why numbers are not a lead table.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LeadTableError {
    /// Wrong number of numbers.
    Length {
        /// Number required by the header, or the length of the header.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// The length of the bytes is not a multiple of four: the length.
    Bytes(usize),
    /// A number of the header is out of its range.
    Header {
        /// Its index.
        index: usize,
        /// Its value.
        value: f32,
    },
    /// An angle is not between 0 and `pi/2`.
    Angle {
        /// Its index.
        index: usize,
        /// Its value (rad).
        value: f32,
    },
}

impl fmt::Display for LeadTableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { expected, found } => write!(
                f,
                "the lead table must have {expected} numbers, but has {found}"
            ),
            Self::Bytes(found) => write!(
                f,
                "the lead table must be numbers of four bytes each, but has {found} bytes"
            ),
            Self::Header { index, value } => write!(
                f,
                "number {index} of the lead table, one of its header, is out of range: {value}"
            ),
            Self::Angle { index, value } => write!(
                f,
                "number {index} of the lead table must be an angle between 0 and pi/2 rad, but is \
                 {value}"
            ),
        }
    }
}

impl core::error::Error for LeadTableError {}

impl Nodes {
    /// Header of a table with these nodes.
    #[must_use]
    pub fn header(&self) -> [f32; HEADER] {
        [
            self.phase_margin_rad,
            self.delay_stretch,
            self.lag_stretch,
            self.points as f32,
        ]
    }

    /// Number of numbers of a table with these nodes.
    #[must_use]
    pub fn length(&self) -> usize {
        HEADER + FIELDS * self.points * self.points
    }

    pub(super) fn from_header(header: [f32; HEADER]) -> Result<Self, LeadTableError> {
        let [phase_margin_rad, delay_stretch, lag_stretch, points] = header;
        let is_right = [
            is_acute(phase_margin_rad),
            delay_stretch > 0.0 && delay_stretch.is_finite(),
            lag_stretch > 0.0 && lag_stretch.is_finite(),
            points as usize as f32 == points && (STENCIL..=MAX_POINTS).contains(&(points as usize)),
        ];
        match is_right.iter().position(|is_right| !is_right) {
            Some(index) => Err(LeadTableError::Header {
                index,
                value: header[index],
            }),
            None => Ok(Self {
                phase_margin_rad,
                delay_stretch,
                lag_stretch,
                points: points as usize,
            }),
        }
    }

    /// Process at a node, with unit acceleration gain and `T_1 + tau` of one second; `None` outside the table.
    #[must_use]
    pub fn process(&self, delay_index: usize, lag_index: usize) -> Option<Soiptd> {
        let coordinate = |index: usize, stretch: f32| {
            let position = index as f64 / (self.points - 1) as f64;
            let stretched = f64::from(stretch) * position;
            stretched / (1.0 - position + stretched)
        };
        if delay_index >= self.points || lag_index >= self.points {
            return None;
        }
        let tau_s = LARGEST_DELAY_SHARE * coordinate(delay_index, self.delay_stretch);
        let lag_share = coordinate(lag_index, self.lag_stretch);
        let short_s = 1.0 - tau_s;
        let inv_long_per_s = lag_share / (1.0 + short_s - lag_share);
        Soiptd::from_acceleration_gain(1.0, short_s, inv_long_per_s, tau_s).ok()
    }

    /// Position of a process, in cells from the first node.
    pub(super) fn position(&self, process: &Soiptd) -> Result<[f64; 2], GainsError> {
        let prop_s = process.t_prop_s();
        let body_s = process.t_body_s().unwrap_or(f64::MAX);
        let (short_s, long_s) = (prop_s.min(body_s), prop_s.max(body_s));
        let tau_s = process.tau_s();
        if tau_s > LARGEST_DELAY_IN_LAGS * (1.0 + ROUNDING) * short_s {
            return Err(GainsError::DeadTime(tau_s / short_s));
        }
        let delay_share = tau_s / (short_s + tau_s) / LARGEST_DELAY_SHARE;
        let lag_share = (2.0 * short_s + tau_s) / (short_s + tau_s + long_s);
        let cells = |coordinate: f64, stretch: f32| {
            let stretched = f64::from(stretch) * (1.0 - coordinate);
            coordinate / (coordinate + stretched) * (self.points - 1) as f64
        };
        Ok([
            cells(delay_share, self.delay_stretch),
            cells(lag_share, self.lag_stretch),
        ])
    }
}

pub(super) fn is_acute(angle_rad: f32) -> bool {
    angle_rad > 0.0 && f64::from(angle_rad) < FRAC_PI_2
}

/// Lagrange's cubic at a position among equally spaced points: index of its first node and the four weights. In
/// the first and last cell it is that of the neighbouring cell.
pub(super) fn cubic(position: f64, points: usize) -> (usize, [f64; STENCIL]) {
    let first = (position as usize)
        .saturating_sub(1)
        .min(points.saturating_sub(STENCIL));
    let t = position - first as f64;
    let weights = [
        -(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0,
        t * (t - 2.0) * (t - 3.0) / 2.0,
        -t * (t - 1.0) * (t - 3.0) / 2.0,
        t * (t - 1.0) * (t - 2.0) / 6.0,
    ];
    (first, weights)
}

#[cfg(test)]
mod tests {
    use libm::fabs;

    use super::*;

    const NODES: Nodes = Nodes {
        phase_margin_rad: 0.25,
        delay_stretch: 0.5,
        lag_stretch: 2.0,
        points: 5,
    };

    // The weights sum to one and reproduce t, t^2 and t^3, also in the first and the last cell, where the cubic
    // is that of the neighbour: t^3 at 0.3 is 0.027.
    #[test]
    fn cubics_are_exact() {
        for (position, expected_first) in [
            (0.0, 0),
            (0.3, 0),
            (1.5, 0),
            (2.25, 1),
            (3.9, 2),
            (5.0, 3),
            (6.0, 3),
        ] {
            let (first, weights) = cubic(position, 7);
            assert_eq!(first, expected_first, "{position}");
            for power in 0..4 {
                let monomial = |x: f64| libm::pow(x, f64::from(power));
                let points = (first..).map(|i| monomial(i as f64));
                let sum: f64 = points.zip(weights).map(|(y, weight)| y * weight).sum();
                assert!(fabs(sum - monomial(position)) < 1e-12, "{position} {power}");
            }
        }
    }

    // u = 3/4 with c = 2 and 1/2: of 4 cells, 4 u / (u + c (1 - u)) = 12/5 and 24/7.
    #[test]
    fn nodes_lie_where_they_are_looked_for() {
        for i in 0..NODES.points {
            for j in 0..NODES.points {
                let process = NODES.process(i, j).unwrap();
                let [delay, lag] = NODES.position(&process).unwrap();
                assert!(fabs(delay - i as f64) < 1e-12, "{i} {j} {delay}");
                assert!(fabs(lag - j as f64) < 1e-12, "{i} {j} {lag}");
            }
        }
        assert_eq!(NODES.process(0, 5), None);
        // x = 5/7 = 3/4 of 20/21: tau = 5, T_1 = 2. y = (4 + 5) / (2 + 5 + T_2) = 3/4: T_2 = 5.
        for (t_prop_s, t_body_s) in [(2.0, 5.0), (5.0, 2.0)] {
            let process = Soiptd::new(1.0, t_prop_s, t_body_s, 5.0).unwrap();
            let [delay, lag] = NODES.position(&process).unwrap();
            assert!(fabs(delay - 24.0 / 7.0) < 1e-14, "{delay}");
            assert!(fabs(lag - 12.0 / 5.0) < 1e-14, "{lag}");
        }
    }
}
