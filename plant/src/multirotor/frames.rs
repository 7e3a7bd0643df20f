//! Vectors, attitudes and frames.
//!
//! The world frame is east, north, up (x, y, z), the body frame forward, left, up; both are right-handed. Roll
//! is a positive rotation about x (left side up), pitch about y (nose down), yaw about z (anticlockwise seen
//! from above). The angles rotate the world into the body in the order yaw, pitch, roll. `world_from_body`
//! converts the components of a vector from the body to the world.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Vector of three components; names of variables give unit and frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vec3 {
    /// East in the world, forward in the body.
    pub x: f64,
    /// North in the world, left in the body.
    pub y: f64,
    /// Up in both.
    pub z: f64,
}

impl Vec3 {
    /// Zero.
    pub const ZERO: Self = Self::new(0.0, 0.0, 0.0);

    /// From its components.
    #[must_use]
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }

    /// Scalar product.
    #[must_use]
    #[inline]
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[must_use]
    #[inline]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Product component by component.
    #[must_use]
    #[inline]
    pub fn scaled_by(self, other: Self) -> Self {
        Self::new(self.x * other.x, self.y * other.y, self.z * other.z)
    }

    /// Length.
    #[must_use]
    #[inline]
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Whether all components are finite.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

impl Add for Vec3 {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl AddAssign for Vec3 {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Vec3 {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Neg for Vec3 {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

impl Mul<f64> for Vec3 {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}

/// Attitude as a quaternion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Scalar part, cosine of half the angle.
    pub scalar: f64,
    /// Vector part, the axis times the sine of half the angle.
    pub vector: Vec3,
}

impl Attitude {
    /// Level, facing east.
    pub const LEVEL: Self = Self {
        scalar: 1.0,
        vector: Vec3::ZERO,
    };

    /// Attitude of these angles (rad).
    #[must_use]
    pub fn from_angles(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> Self {
        let (sr, cr) = (0.5 * roll_rad).sin_cos();
        let (sp, cp) = (0.5 * pitch_rad).sin_cos();
        let (sy, cy) = (0.5 * yaw_rad).sin_cos();
        Self {
            scalar: cr * cp * cy + sr * sp * sy,
            vector: Vec3::new(
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
            ),
        }
    }

    /// Roll, pitch and yaw (rad): roll and yaw in -pi..pi, pitch in -pi/2..pi/2.
    #[must_use]
    pub fn angles_rad(&self) -> Vec3 {
        let (w, Vec3 { x, y, z }) = (self.scalar, self.vector);
        Vec3::new(
            f64::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            // Rounding can make the sine exceed one.
            (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
            f64::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )
    }

    /// The axes of the body in the world, for an attitude of norm one.
    #[must_use]
    #[inline]
    pub fn axes(&self) -> Axes {
        let (w, Vec3 { x, y, z }) = (self.scalar, self.vector);
        Axes {
            forward: Vec3::new(
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y + w * z),
                2.0 * (x * z - w * y),
            ),
            left: Vec3::new(
                2.0 * (x * y - w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z + w * x),
            ),
            up: Vec3::new(
                2.0 * (x * z + w * y),
                2.0 * (y * z - w * x),
                1.0 - 2.0 * (x * x + y * y),
            ),
        }
    }

    /// Derivative under rates of the body (rad/s, about its own axes): half the product with the rates.
    #[must_use]
    #[inline]
    pub fn derivative(&self, rates_rad_per_s: Vec3) -> Self {
        let half = rates_rad_per_s * 0.5;
        Self {
            scalar: -self.vector.dot(half),
            vector: half * self.scalar + self.vector.cross(half),
        }
    }

    /// `self + other * factor`, component by component: a step of an integrator, not an attitude.
    #[must_use]
    #[inline]
    pub fn plus(&self, other: &Self, factor: f64) -> Self {
        Self {
            scalar: self.scalar + other.scalar * factor,
            vector: self.vector + other.vector * factor,
        }
    }

    /// Norm; one for an attitude.
    #[must_use]
    #[inline]
    pub fn norm(&self) -> f64 {
        (self.scalar * self.scalar + self.vector.dot(self.vector)).sqrt()
    }

    /// The same attitude with norm one; level if the norm is zero.
    #[must_use]
    #[inline]
    pub fn normalised(&self) -> Self {
        let norm = self.norm();
        if !(norm > 0.0 && norm.is_finite()) {
            return Self::LEVEL;
        }
        Self {
            scalar: self.scalar / norm,
            vector: self.vector * (1.0 / norm),
        }
    }
}

/// Axes of the body in the world: the columns of the matrix `world_from_body`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Direction of forward.
    pub forward: Vec3,
    /// Direction of left.
    pub left: Vec3,
    /// Direction of up.
    pub up: Vec3,
}

impl Axes {
    /// World components of a vector given in the body.
    #[must_use]
    #[inline]
    pub fn world_from_body(&self, in_body: Vec3) -> Vec3 {
        self.forward * in_body.x + self.left * in_body.y + self.up * in_body.z
    }

    /// Body components of a vector given in the world.
    #[must_use]
    #[inline]
    pub fn body_from_world(&self, in_world: Vec3) -> Vec3 {
        Vec3::new(
            self.forward.dot(in_world),
            self.left.dot(in_world),
            self.up.dot(in_world),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(actual: Vec3, expected: Vec3) {
        assert!((actual - expected).norm() < 1e-15, "{actual:?}");
    }

    // A quarter turn about each axis by hand: roll takes left to up, pitch takes forward to down (nose down),
    // yaw takes forward to left.
    #[test]
    fn quarter_turns_follow_the_right_hand() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let level = Attitude::LEVEL.axes();
        let (x, y, z) = (level.forward, level.left, level.up);
        let roll = Attitude::from_angles(quarter, 0.0, 0.0).axes();
        assert_close(roll.world_from_body(y), z);
        let pitch = Attitude::from_angles(0.0, quarter, 0.0).axes();
        assert_close(pitch.world_from_body(x), -z);
        let yaw = Attitude::from_angles(0.0, 0.0, quarter).axes();
        assert_close(yaw.world_from_body(x), y);
        assert_close(yaw.body_from_world(y), x);
    }

    // Angles to quaternion and back, to rounding error; the axes are those of the three turns.
    #[test]
    fn angles_are_a_round_trip() {
        for (roll, pitch, yaw) in [(0.3, -0.7, 2.9), (-2.0, 1.2, -3.0), (0.0, 0.0, 0.0)] {
            let attitude = Attitude::from_angles(roll, pitch, yaw);
            assert!((attitude.angles_rad() - Vec3::new(roll, pitch, yaw)).norm() < 1e-14);
            assert!((attitude.norm() - 1.0).abs() < 1e-15);
            let turned = Vec3::new(0.2, -0.5, 0.9);
            let axes = attitude.axes();
            let back = axes.body_from_world(axes.world_from_body(turned));
            assert!((back - turned).norm() < 1e-15);
        }
    }

    // dq/dt by central difference of a turn at constant body rates about one axis: error h^2 / 24.
    #[test]
    fn the_derivative_is_that_of_a_steady_turn() {
        let (rate, h) = (0.8, 1e-4);
        let at = |t: f64| Attitude::from_angles(0.0, rate * t, 0.0);
        let difference = at(1.0 + h).plus(&at(1.0 - h), -1.0);
        let derivative = at(1.0).derivative(Vec3::new(0.0, rate, 0.0));
        assert!((difference.vector * (0.5 / h) - derivative.vector).norm() < 1e-9);
        assert!((difference.scalar * (0.5 / h) - derivative.scalar).abs() < 1e-9);
    }
}
