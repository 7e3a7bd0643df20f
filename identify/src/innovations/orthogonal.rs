//! Least squares by orthogonal columns: Gram-Schmidt, each column twice.
//!
//! Columns are scaled to unit length first. Reference: L. Giraud, J. Langou, M. Rozloznik, "The loss of orthogonality in
//! the Gram-Schmidt orthogonalization process", Comput. Math. Appl. 50 (2005): twice is enough.

/// Least length of what a scaled column adds to those before it.
const LEAST: f64 = 1e-13;

/// Orthonormal columns `Q` and triangular `R` of a matrix, `X = Q R diag(scale)`.
pub(crate) struct Orthogonal {
    q: Vec<Vec<f64>>,
    /// `r[j][i]`, `i <= j`: component of column `j` along `q[i]`.
    r: Vec<Vec<f64>>,
    scale: Vec<f64>,
}

impl Orthogonal {
    /// Decomposes columns of equal length. `None` if one is zero, not finite, or a combination of those before it.
    pub(crate) fn new(columns: &[Vec<f64>]) -> Option<Self> {
        let found = Self::independent(columns);
        (found.q.len() == columns.len()).then_some(found)
    }

    /// Decomposes those of the columns that are not zero, not finite, or a combination of those before them.
    pub(crate) fn independent(columns: &[Vec<f64>]) -> Self {
        let mut found = Self {
            q: Vec::with_capacity(columns.len()),
            r: Vec::with_capacity(columns.len()),
            scale: Vec::with_capacity(columns.len()),
        };
        found.extend(columns);
        found
    }

    /// Adds further columns, those that are no combination of the ones before.
    pub(crate) fn extend(&mut self, columns: &[Vec<f64>]) {
        for column in columns {
            let length = dot(column, column).sqrt();
            if !(length.is_finite() && length > 0.0) {
                continue;
            }
            let mut rest: Vec<f64> = column.iter().map(|v| v / length).collect();
            let mut r = self.project(&mut rest);
            let left = dot(&rest, &rest).sqrt();
            if left < LEAST {
                continue;
            }
            rest.iter_mut().for_each(|v| *v /= left);
            r.push(left);
            self.q.push(rest);
            self.r.push(r);
            self.scale.push(length);
        }
    }

    /// Number of columns of which at least a share `least` of the length is no combination of those before them.
    pub(crate) fn rank(&self, least: f64) -> usize {
        let own = self.r.iter().filter_map(|r| r.last());
        own.filter(|own| **own >= least).count()
    }

    /// Number of columns.
    pub(crate) fn len(&self) -> usize {
        self.q.len()
    }

    /// Sum of squares of the part of `y` that no combination of the columns explains.
    pub(crate) fn left(&self, y: &[f64]) -> f64 {
        let mut rest = y.to_vec();
        self.project(&mut rest);
        dot(&rest, &rest)
    }

    /// Takes the components along the columns found so far out of `rest`, and returns them.
    fn project(&self, rest: &mut [f64]) -> Vec<f64> {
        let mut components = vec![0.0; self.q.len()];
        for _ in 0..2 {
            for (component, q) in components.iter_mut().zip(&self.q) {
                let along = dot(q, rest);
                *component += along;
                rest.iter_mut().zip(q).for_each(|(v, q)| *v -= along * q);
            }
        }
        components
    }

    /// Residual and coefficients of the least-squares fit to `y`.
    pub(crate) fn solve(&self, y: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut residual = y.to_vec();
        let mut x = self.project(&mut residual);
        for j in (0..x.len()).rev() {
            x[j] /= self.r[j][j];
            for i in 0..j {
                x[i] -= self.r[j][i] * x[j];
            }
        }
        (
            residual,
            x.iter().zip(&self.scale).map(|(x, s)| x / s).collect(),
        )
    }

    /// Standard deviation of a linear function of the coefficients, `gradient' x`, per unit of that of the noise of `y`: the length
    /// of `R^-T gradient`. Only if no column was left out.
    pub(super) fn deviation(&self, gradient: &[f64]) -> f64 {
        let mut z: Vec<f64> = Vec::with_capacity(gradient.len());
        for ((r, g), scale) in self.r.iter().zip(gradient).zip(&self.scale) {
            let (above, diagonal) = r.split_at(z.len());
            z.push((g / scale - dot(above, &z)) / diagonal[0]);
        }
        dot(&z, &z).sqrt()
    }

    /// `ln|X'X| / 2`.
    pub(super) fn log_determinant(&self) -> f64 {
        let diagonal = (self.r.iter().zip(&self.scale)).map(|(r, s)| (r[r.len() - 1] * s).ln());
        diagonal.sum()
    }

    /// The rows and columns `which` of `(X'X)^-1`.
    pub(super) fn covariance<const M: usize>(&self, which: &[usize; M]) -> [[f64; M]; M] {
        // Row i of R^-1 is found backwards from the unit vector; (X'X)^-1 = R^-1 R^-T.
        let rows = which.map(|i| {
            let mut row = vec![0.0; self.r.len()];
            row[i] = 1.0 / self.r[i][i];
            for j in i + 1..row.len() {
                let sum: f64 = (i..j).map(|k| row[k] * self.r[j][k]).sum();
                row[j] = -sum / self.r[j][j];
            }
            row.iter_mut().for_each(|v| *v /= self.scale[i]);
            row
        });
        std::array::from_fn(|i| std::array::from_fn(|j| dot(&rows[i], &rows[j])))
    }
}

/// Sum of the products of two columns.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums side by side, so that the compiler uses vector registers.
    let mut sums = [0.0; 8];
    let (wide_a, rest_a) = a.as_chunks::<8>();
    let (wide_b, rest_b) = b.as_chunks::<8>();
    for (a, b) in wide_a.iter().zip(wide_b) {
        for i in 0..8 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}
