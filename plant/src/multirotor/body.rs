//! Airframe: mass, inertia, drag.
//!
//! ```text
//! F = -(linear + quadratic |v|) v,   v is the velocity through the air, component by component
//! ```
//!
//! The linear part represents the momentum that the fuselage loses in the wake of its rotors; the quadratic part
//! is `rho C_D A / 2`. Both act at the centre of mass: the airframe alone does not damp rotations.

use super::frames::Vec3;

/// Acceleration of gravity (m/s^2), the conventional value of the CGPM of 1901.
pub const GRAVITY_M_PER_S2: f64 = 9.806_65;

/// An airframe. Its origin is the middle, the point half way between the four hubs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass (kg).
    pub mass_kg: f64,
    /// Moments of inertia about the axes of the body through the centre of mass (kg m^2); products of inertia
    /// are assumed to be zero.
    pub inertia_kg_m2: Vec3,
    /// Centre of mass (m, body). If it is off to the side, roll and pitch have a bias.
    pub centre_of_mass_m: Vec3,
    /// Linear drag (N s/m).
    pub linear_drag_n_s_per_m: Vec3,
    /// Quadratic drag (N s^2/m^2).
    pub quadratic_drag_n_s2_per_m2: Vec3,
}

impl Body {
    /// Weight (N).
    #[must_use]
    pub fn weight_n(&self) -> f64 {
        self.mass_kg * GRAVITY_M_PER_S2
    }

    /// Drag (N, body) at a velocity through the air (m/s, body).
    #[must_use]
    #[inline]
    pub fn drag_n(&self, air_m_per_s: Vec3) -> Vec3 {
        let coefficient =
            self.linear_drag_n_s_per_m + self.quadratic_drag_n_s2_per_m2 * air_m_per_s.norm();
        -coefficient.scaled_by(air_m_per_s)
    }

    /// The airframe with a point mass `mass_kg` fixed `below_m` below its centre of mass. The centre moves down
    /// in proportion; the inertia of roll and pitch grows by the reduced mass times the squared distance
    /// (Steiner).
    #[must_use]
    pub fn with_payload(&self, mass_kg: f64, below_m: f64) -> Self {
        let total_kg = self.mass_kg + mass_kg;
        let steiner = self.mass_kg * mass_kg / total_kg * below_m * below_m;
        Self {
            mass_kg: total_kg,
            inertia_kg_m2: self.inertia_kg_m2 + Vec3::new(steiner, steiner, 0.0),
            centre_of_mass_m: self.centre_of_mass_m
                - Vec3::new(0.0, 0.0, below_m * mass_kg / total_kg),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: Body = Body {
        mass_kg: 3.0,
        inertia_kg_m2: Vec3::new(0.01, 0.02, 0.03),
        centre_of_mass_m: Vec3::ZERO,
        linear_drag_n_s_per_m: Vec3::new(0.1, 0.2, 0.3),
        quadratic_drag_n_s2_per_m2: Vec3::new(0.01, 0.02, 0.04),
    };

    // At (3, 0, 4) m/s the speed is 5: coefficients 0.15, 0.3, 0.5, forces -0.45, 0, -2.
    #[test]
    fn drag_is_linear_plus_quadratic() {
        let drag = BODY.drag_n(Vec3::new(3.0, 0.0, 4.0));
        assert!((drag - Vec3::new(-0.45, 0.0, -2.0)).norm() < 1e-15);
    }

    // 3 kg and 1 kg, 0.2 m apart: the centre moves 0.05 m; about it 3 * 0.05^2 + 1 * 0.15^2 = 0.03.
    #[test]
    fn a_payload_moves_the_centre_and_adds_inertia() {
        let loaded = BODY.with_payload(1.0, 0.2);
        assert_eq!(loaded.mass_kg, 4.0);
        assert!((loaded.centre_of_mass_m.z + 0.05).abs() < 1e-15);
        let inertia = Vec3::new(0.04, 0.05, 0.03);
        assert!((loaded.inertia_kg_m2 - inertia).norm() < 1e-15);
    }
}
