//! Complex numbers: the operations that frequency responses need.

use core::ops::{Add, Mul, Neg};

use libm::{cos, sin};

/// `re + j im`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Complex {
    pub(crate) re: f64,
    pub(crate) im: f64,
}

impl Complex {
    pub(crate) const ZERO: Self = Self { re: 0.0, im: 0.0 };
    pub(crate) const ONE: Self = Self { re: 1.0, im: 0.0 };

    /// `e^(j angle)`.
    pub(crate) fn turn(angle_rad: f64) -> Self {
        Self {
            re: cos(angle_rad),
            im: sin(angle_rad),
        }
    }

    pub(crate) fn conjugate(self) -> Self {
        Self {
            re: self.re,
            im: -self.im,
        }
    }

    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self {
            re: factor * self.re,
            im: factor * self.im,
        }
    }

    pub(crate) fn square(self) -> f64 {
        self.re * self.re + self.im * self.im
    }

    pub(crate) fn inverse(self) -> Self {
        self.conjugate().scaled(1.0 / self.square())
    }
}

impl Add for Complex {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl Mul for Complex {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

impl Neg for Complex {
    type Output = Self;

    fn neg(self) -> Self {
        self.scaled(-1.0)
    }
}
