//! Polynomials in `s` with real coefficients, in ascending order.

use num_complex::Complex64;

/// Most coefficients: a process of five states, two filters of the measurement, one of the derivative, an integral.
const MOST: usize = 14;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Polynomial {
    coefficients: [f64; MOST],
    /// Number of coefficients without trailing zeros.
    count: usize,
}

impl Polynomial {
    /// Polynomial with these coefficients, in ascending order. Coefficients after the 14th are dropped.
    pub(crate) fn new(ascending: &[f64]) -> Self {
        let mut coefficients = [0.0; MOST];
        let mut count = 0;
        for (i, (to, &from)) in coefficients.iter_mut().zip(ascending).enumerate() {
            *to = from;
            if from != 0.0 {
                count = i + 1;
            }
        }
        Self {
            coefficients,
            count,
        }
    }

    pub(crate) fn times(&self, other: &Self) -> Self {
        let mut product = [0.0; MOST];
        for (i, a) in self.coefficients().iter().enumerate() {
            for (j, b) in other.coefficients().iter().enumerate() {
                if i + j < MOST {
                    product[i + j] += a * b;
                }
            }
        }
        Self::new(&product)
    }

    /// Sum of `self` and `factor` times `s^shift` times `other`.
    pub(crate) fn plus(&self, factor: f64, shift: usize, other: &Self) -> Self {
        let mut sum = self.coefficients;
        for (j, b) in other.coefficients().iter().enumerate() {
            if j + shift < MOST {
                sum[j + shift] += factor * b;
            }
        }
        Self::new(&sum)
    }

    /// Coefficients without trailing zeros. Empty for zero.
    pub(crate) fn coefficients(&self) -> &[f64] {
        &self.coefficients[..self.count]
    }

    /// Value at `s = 0`.
    pub(crate) fn constant(&self) -> f64 {
        self.coefficients[0]
    }

    pub(crate) fn degree(&self) -> usize {
        self.count.saturating_sub(1)
    }

    /// Value at `s = jw`: Horner's rule for even and odd powers in `-w^2`.
    #[inline]
    pub(crate) fn at(&self, omega: f64) -> Complex64 {
        let x = -omega * omega;
        let (mut even, mut odd) = (0.0, 0.0);
        for pair in self.coefficients[..self.count.next_multiple_of(2)]
            .chunks_exact(2)
            .rev()
        {
            even = even * x + pair[0];
            odd = odd * x + pair[1];
        }
        Complex64::new(even, odd * omega)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // (1 + 2 s)(3 + s^2) = 3 + 6 s + s^2 + 2 s^3; at s = 2j: 3 - 4 + j (12 - 16) = -1 - 4 j.
    #[test]
    fn products_and_values_by_hand() {
        let product = Polynomial::new(&[1.0, 2.0]).times(&Polynomial::new(&[3.0, 0.0, 1.0, 0.0]));
        assert_eq!(product.coefficients(), [3.0, 6.0, 1.0, 2.0]);
        assert_eq!(
            (product.degree(), product.at(2.0)),
            (3, Complex64::new(-1.0, -4.0))
        );
        let sum = product.plus(-2.0, 3, &Polynomial::new(&[1.0]));
        assert_eq!(sum.coefficients(), [3.0, 6.0, 1.0]);
    }
}
