//! Ground: a level plane at height zero, with ground effect on the rotors and contact forces.
//!
//! Ground effect at hover with radius `R` and height `z` of the rotor (m):
//!
//! ```text
//! thrust / thrust far from the ground = 1 / (1 - (R / 4 z)^2),   for z >= R / 2
//! ```
//!
//! Reference: I. C. Cheeseman and W. E. Bennett, "The effect of the ground on a helicopter rotor in forward
//! flight", ARC R&M 3021, 1955.
//!
//! Contact at eight points, a foot and a guard at each hub. Each is a spring with a damper that only pushes,
//! with the same damping sideways up to the friction:
//!
//! ```text
//! normal N = max(0, k depth - c rate of rise),   sideways min(c |v|, mu N) against v
//! ```
//!
//! Sideways damping instead of static friction means that a standing vehicle creeps under a side force `F` at
//! `F / 4 c`: 2 mm/s for half a newton with the quadrotor here.

use super::frames::Vec3;

/// Height in radii below which the formula is not valid and the factor stays at 1/(1 - 1/4).
const LOWEST_RADII: f64 = 0.5;

/// Factor of the ground effect on a rotor's thrust (1), at the height of its hub (m).
#[must_use]
#[inline]
pub fn ground_effect(radius_m: f64, height_m: f64) -> f64 {
    let ratio = radius_m / (4.0 * height_m.max(LOWEST_RADII * radius_m));
    1.0 / (1.0 - ratio * ratio)
}

/// Legs and guards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Legs {
    /// Height of the hubs above the feet, unloaded (m).
    pub height_m: f64,
    /// Height of the guards above the hubs, on which the vehicle lies upside down (m).
    pub guard_m: f64,
    /// Stiffness of each point (N/m).
    pub stiffness_n_per_m: f64,
    /// Damping of each point (N s/m).
    pub damping_n_s_per_m: f64,
    /// Coefficient of friction (1).
    pub friction: f64,
}

impl Legs {
    /// Force of the ground on a point (N, world) at a height (m) and velocity (m/s, world).
    #[must_use]
    #[inline]
    pub fn force_n(&self, height_m: f64, velocity_m_per_s: Vec3) -> Vec3 {
        if height_m >= 0.0 {
            return Vec3::ZERO;
        }
        let push = -self.stiffness_n_per_m * height_m - self.damping_n_s_per_m * velocity_m_per_s.z;
        let normal_n = push.max(0.0);
        let sideways = Vec3::new(velocity_m_per_s.x, velocity_m_per_s.y, 0.0);
        let slide_n = self.damping_n_s_per_m * sideways.norm();
        let grip_n = self.friction * normal_n;
        let share = if slide_n > grip_n {
            grip_n / slide_n
        } else {
            1.0
        };
        sideways * (-self.damping_n_s_per_m * share) + Vec3::new(0.0, 0.0, normal_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // At one radius: 1/(1 - 1/16) = 16/15; at two: 64/63; from half a radius down: 4/3; far: 1.
    #[test]
    fn ground_effect_is_cheeseman_and_bennetts() {
        assert!((ground_effect(0.1, 0.1) - 16.0 / 15.0).abs() < 1e-15);
        assert!((ground_effect(0.1, 0.2) - 64.0 / 63.0).abs() < 1e-15);
        for height_m in [0.05, 0.01, -1.0] {
            assert!((ground_effect(0.1, height_m) - 4.0 / 3.0).abs() < 1e-15);
        }
        assert!(ground_effect(0.1, 100.0) - 1.0 < 1e-7);
    }

    // k = 1000, c = 10, mu = 0.5, depth 1 cm: 10 N at rest; no force, and no pull, when rising at 2 m/s. Sliding
    // at 0.3 m/s gives 3 N, at 3 m/s 5 N at most.
    #[test]
    fn a_point_pushes_and_rubs() {
        let legs = Legs {
            height_m: 0.1,
            guard_m: 0.05,
            stiffness_n_per_m: 1000.0,
            damping_n_s_per_m: 10.0,
            friction: 0.5,
        };
        let force = |x, z| legs.force_n(-0.01, Vec3::new(x, 0.0, z));
        assert_eq!(force(0.0, 0.0), Vec3::new(0.0, 0.0, 10.0));
        assert_eq!(force(0.0, 2.0).z, 0.0);
        assert!((force(0.3, 0.0) - Vec3::new(-3.0, 0.0, 10.0)).norm() < 1e-14);
        assert!((force(3.0, 0.0) - Vec3::new(-5.0, 0.0, 10.0)).norm() < 1e-14);
        assert_eq!(legs.force_n(0.01, Vec3::new(1.0, 0.0, -1.0)), Vec3::ZERO);
    }
}
