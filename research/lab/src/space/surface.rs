//! The shapes of processes: directions in the space of times (the paper's equation 10; Ayyad,
//! Chehadeh, Awad, Zweiri 2020).
//!
//! ```text
//! T_prop = r sin(phi) cos(theta),   T_body = r sin(phi) sin(theta),   tau = r cos(phi)
//! ```
//!
//! Scaling all three times scales time itself, so every dimensionless property depends on the direction
//! `(theta, phi)` alone: a point of a surface. A box of processes is a patch of that surface and, on
//! every ray through the patch, an interval of radii.

use crate::space::{Range, Space};

/// A direction in the space of times: the shape of a process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// `atan(T_body / T_prop)` (rad).
    pub theta_rad: f64,
    /// `acos(tau / r)` (rad).
    pub phi_rad: f64,
}

impl Direction {
    /// Direction and radius (s) of `T_prop`, `T_body`, `tau` (s).
    #[must_use]
    pub fn of([t_prop_s, t_body_s, tau_s]: [f64; 3]) -> (Self, f64) {
        let lags_s = t_prop_s.hypot(t_body_s);
        let direction = Self {
            theta_rad: t_body_s.atan2(t_prop_s),
            phi_rad: lags_s.atan2(tau_s),
        };
        (direction, lags_s.hypot(tau_s))
    }

    /// `T_prop`, `T_body`, `tau` (s) at a radius (s).
    #[must_use]
    pub fn at(&self, radius_s: f64) -> [f64; 3] {
        let lags_s = radius_s * self.phi_rad.sin();
        [
            lags_s * self.theta_rad.cos(),
            lags_s * self.theta_rad.sin(),
            radius_s * self.phi_rad.cos(),
        ]
    }
}

/// Tolerance for a ray that only touches a box.
const TOUCH: f64 = 1e-12;

impl Space {
    /// The angles `theta` (rad) of the processes.
    #[must_use]
    pub fn theta_range_rad(&self) -> Range {
        (
            self.t_body_s.0.atan2(self.t_prop_s.1),
            self.t_body_s.1.atan2(self.t_prop_s.0),
        )
    }

    /// The angles `phi` (rad) of the processes with this `theta`; `None` if there are none.
    #[must_use]
    pub fn phi_range_rad(&self, theta_rad: f64) -> Option<Range> {
        let (low, high) = self.lags_range_s(theta_rad)?;
        Some((low.atan2(self.tau_s.1), high.atan2(self.tau_s.0)))
    }

    /// The radii (s) of the processes in this direction; `None` if there are none.
    #[must_use]
    pub fn radius_range_s(&self, direction: Direction) -> Option<Range> {
        let (sin, cos) = direction.phi_rad.sin_cos();
        let lags = self
            .lags_range_s(direction.theta_rad)
            .map(|(low, high)| (low / sin, high / sin))?;
        let delay = if cos <= 0.0 || self.tau_s.0 == 0.0 && cos < TOUCH {
            (0.0, f64::INFINITY)
        } else {
            (self.tau_s.0 / cos, self.tau_s.1 / cos)
        };
        intersection(lags, delay)
    }

    /// `hypot(T_prop, T_body)` (s) of the processes with this `theta`.
    fn lags_range_s(&self, theta_rad: f64) -> Option<Range> {
        let (sin, cos) = theta_rad.sin_cos();
        intersection(
            (self.t_prop_s.0 / cos, self.t_prop_s.1 / cos),
            (self.t_body_s.0 / sin, self.t_body_s.1 / sin),
        )
    }

    /// The shape at a point of the unit square; corners and edges of the square map onto those of the
    /// patch. `theta` is uniform in `ln(T_body/T_prop)`, then `phi` uniform in `ln(1 + tau/T_prop)`,
    /// the longest dead time first.
    #[must_use]
    pub fn shape(&self, across: f64, along: f64) -> Option<Direction> {
        let (low, high) = self.theta_range_rad();
        let ln_ratio = between((low.tan().ln(), high.tan().ln()), across);
        let theta_rad = ln_ratio.exp().atan().clamp(low, high);
        let (low, high) = self.phi_range_rad(theta_rad)?;
        // tau / T_prop = cot(phi) / cos(theta)
        let ln_delay = |phi: f64| (phi.tan() * theta_rad.cos()).recip().ln_1p();
        let cot = between((ln_delay(low), ln_delay(high)), along).exp_m1() * theta_rad.cos();
        Some(Direction {
            theta_rad,
            phi_rad: 1.0_f64.atan2(cot).clamp(low, high),
        })
    }

    /// Shapes all over the patch, with its edges: [`Space::shape`] at `rows` by `columns` points, fewer
    /// if the patch has no extent.
    #[must_use]
    pub fn shapes(&self, rows: usize, columns: usize) -> Vec<Direction> {
        let (low, high) = self.theta_range_rad();
        let rows = if low < high { rows } else { 1 };
        let mut shapes: Vec<Direction> = points(rows)
            .flat_map(|across| points(columns).map(move |along| (across, along)))
            .filter_map(|(across, along)| self.shape(across, along))
            .collect();
        shapes.dedup();
        shapes
    }
}

fn between((low, high): Range, fraction: f64) -> f64 {
    low + (high - low) * fraction
}

/// `count` points from zero to one; one half if there is only one.
fn points(count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| match count {
        1 => 0.5,
        _ => k as f64 / (count - 1) as f64,
    })
}

fn intersection(a: Range, b: Range) -> Option<Range> {
    let (low, high) = (a.0.max(b.0), a.1.min(b.1));
    if low <= high {
        Some((low, high))
    } else if low <= high * (1.0 + TOUCH) {
        Some((high, high))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    // 3-4-5 and 5-12-13: T_prop 3, T_body 4, tau 12 has r = 13, tan theta = 4/3, cos phi = 12/13.
    #[test]
    fn direction_by_hand_and_back() {
        let (direction, radius_s) = Direction::of([3.0, 4.0, 12.0]);
        assert!((radius_s - 13.0).abs() < 1e-14);
        assert!((direction.theta_rad.tan() - 4.0 / 3.0).abs() < 1e-15);
        assert!((direction.phi_rad.cos() - 12.0 / 13.0).abs() < 1e-15);
        for (time_s, expected) in direction.at(radius_s).into_iter().zip([3.0, 4.0, 12.0]) {
            assert!((time_s - expected).abs() < 1e-14);
        }
    }

    // A process of the box lies in the ranges of its direction, and the ends of its ray are on
    // the faces of the box.
    #[test]
    fn ranges_hold_every_process() {
        let space = Space::MULTIROTOR;
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        for _ in 0..1000 {
            let (direction, radius_s) = Direction::of(space.random(&mut rng));
            let (low, high) = space.theta_range_rad();
            assert!((low..=high).contains(&direction.theta_rad));
            let (low, high) = space.phi_range_rad(direction.theta_rad).unwrap();
            assert!((low..=high).contains(&direction.phi_rad));
            let (low, high) = space.radius_range_s(direction).unwrap();
            assert!((low..=high).contains(&radius_s));
            for end_s in [low, high] {
                let on_a_face = direction.at(end_s).into_iter().zip(space.ranges_s());
                assert!(on_a_face.into_iter().any(|(time_s, range)| {
                    (time_s / range.0 - 1.0).abs() < 1e-12 || (time_s / range.1 - 1.0).abs() < 1e-12
                }));
            }
        }
    }

    #[test]
    fn shapes_are_of_the_space() {
        let no_delay = Space {
            tau_s: (0.0, 0.1),
            ..Space::MULTIROTOR
        };
        let one_lag = Space {
            t_prop_s: (0.05, 0.05),
            ..Space::MULTIROTOR
        };
        for space in [Space::MULTIROTOR, no_delay, one_lag] {
            let shapes = space.shapes(9, 7);
            assert_eq!(shapes.len(), 63);
            for shape in shapes {
                assert!(space.radius_range_s(shape).is_some(), "{shape:?}");
            }
        }
        let single = Space {
            t_prop_s: (0.05, 0.05),
            t_body_s: (1.0, 1.0),
            tau_s: (0.02, 0.02),
            ..Space::MULTIROTOR
        };
        let shapes = single.shapes(9, 7);
        assert_eq!(shapes.len(), 1);
        let fixed_lags = Space {
            tau_s: (0.0, 0.1),
            ..single
        };
        assert_eq!(fixed_lags.shapes(9, 7).len(), 7);
        let (low, high) = single.radius_range_s(shapes[0]).unwrap();
        assert!((high / low - 1.0).abs() < 1e-12);
    }
}
