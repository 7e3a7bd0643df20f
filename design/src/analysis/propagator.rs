//! One exact step of `dx/dt = A x + B v(t)` where `v` is the polynomial of degree 7 through 8 evenly spaced nodes.
//!
//! With `s` the time in steps of length `h` and `v(s) = sum_p d_p s^p/p!`,
//!
//! ```text
//! x(s) = Phi(s) x(0) + Gamma(s) d,     d'(s) = S d,     exp(s [[A h, B h e_0'], [0, S]]) = [[Phi, Gamma], [0, exp(s S)]]
//! ```
//!
//! with the shift `S`. The exponential over one node distance comes from Taylor series on a step that is halved until the
//! series converges, and as many doublings. Its powers give the outputs at all nodes.

/// Nodes of a step.
pub(crate) const NODES: usize = 8;

/// Terms of the Taylor series. With a norm of 0.5 the first one left out is below 1e-16.
const TERMS: usize = 13;
const NORM: f64 = 0.5;

/// Most halvings: a longer step is beyond the range of the parameters.
const MOST_HALVINGS: i32 = 60;

type Square<const N: usize> = [[f64; N]; N];

/// By columns: `gamma[p]` belongs to the derivative `d_p`.
type Columns<const N: usize> = [[f64; N]; NODES];

/// `[[Phi, Gamma], [0, exp(length S)]]`, matrices by columns.
#[derive(Clone, Debug)]
pub(crate) struct Step<const N: usize> {
    pub phi: Square<N>,
    pub gamma: Columns<N>,
    length: f64,
}

/// `exp(length S)`: entry for row `i`, column `j >= i`: `length^(j-i)/(j-i)!`.
fn shift(length: f64) -> [f64; NODES] {
    let mut powers = [1.0; NODES];
    for k in 1..NODES {
        powers[k] = powers[k - 1] * length / k as f64;
    }
    powers
}

/// `matrix x`, the matrix by columns.
pub(crate) fn times<const R: usize, const C: usize>(
    matrix: &[[f64; R]; C],
    x: &[f64; C],
) -> [f64; R] {
    let mut out = [0.0; R];
    for (column, &value) in matrix.iter().zip(x) {
        for i in 0..R {
            out[i] += column[i] * value;
        }
    }
    out
}

impl<const N: usize> Step<N> {
    /// Step over one node distance, `h/7`, for `a` (by rows) and `b`.
    pub(crate) fn between_nodes(a: &Square<N>, b: &[f64; N], h: f64) -> Self {
        let length = 1.0 / (NODES - 1) as f64;
        let row = |row: &[f64; N]| row.iter().map(|v| v.abs()).sum::<f64>();
        let norm = a.iter().map(row).fold(0.0, f64::max) * h * length;
        let halvings = if norm > NORM {
            ((norm / NORM).log2().ceil() as i32).min(MOST_HALVINGS)
        } else {
            0
        };
        let mut step = Self::series(a, b, h, length * 0.5_f64.powi(halvings));
        for _ in 0..halvings {
            step = step.after(&step);
        }
        step
    }

    fn series(a: &Square<N>, b: &[f64; N], h: f64, length: f64) -> Self {
        // By columns, over this length.
        let mut scaled = [[0.0; N]; N];
        for i in 0..N {
            for j in 0..N {
                scaled[j][i] = a[i][j] * h * length;
            }
        }
        let mut phi = [[0.0; N]; N];
        for j in 0..N {
            let mut term = [0.0; N];
            term[j] = 1.0;
            phi[j][j] = 1.0;
            for k in 1..=TERMS {
                term = times(&scaled, &term).map(|v| v / k as f64);
                for i in 0..N {
                    phi[j][i] += term[i];
                }
            }
        }
        // Gamma_p = length^(p+1) sum_k (A h length)^k B h/(k + p + 1)!.
        let mut gamma = [[0.0; N]; NODES];
        let mut power = b.map(|v| v * h * length);
        for k in 0..=TERMS {
            let mut factor = 1.0 / (1..=k + 1).map(|i| i as f64).product::<f64>();
            for p in 0..NODES {
                for i in 0..N {
                    gamma[p][i] += power[i] * factor;
                }
                factor *= length / (k + p + 2) as f64;
            }
            power = times(&scaled, &power);
        }
        Self { phi, gamma, length }
    }

    /// `self` after `first`.
    pub(crate) fn after(&self, first: &Self) -> Self {
        let later = shift(first.length);
        let mut gamma = first.gamma.map(|column| times(&self.phi, &column));
        for j in 0..NODES {
            for i in 0..=j {
                for row in 0..N {
                    gamma[j][row] += self.gamma[i][row] * later[j - i];
                }
            }
        }
        Self {
            phi: first.phi.map(|column| times(&self.phi, &column)),
            gamma,
            length: self.length + first.length,
        }
    }

    /// The step of length 1 from the step between nodes.
    pub(crate) fn whole(&self) -> Self {
        let two = self.after(self);
        let four = two.after(&two);
        let three = two.after(self);
        let mut whole = four.after(&three);
        whole.length = 1.0;
        whole
    }

    /// Rows `row Phi` and `row Gamma` at all nodes, from the step between nodes.
    pub(crate) fn rows_at_nodes(
        &self,
        row: &[f64; N],
    ) -> ([[f64; N]; NODES], [[f64; NODES]; NODES]) {
        let dot = |column: &[f64; N], row: &[f64; N]| -> f64 {
            column.iter().zip(row).map(|(a, b)| a * b).sum()
        };
        let later = shift(self.length);
        let mut of_state = [[0.0; N]; NODES];
        let mut of_input = [[0.0; NODES]; NODES];
        of_state[0] = *row;
        for node in 1..NODES {
            let (before, input) = (of_state[node - 1], of_input[node - 1]);
            for j in 0..N {
                of_state[node][j] = dot(&self.phi[j], &before);
            }
            for j in 0..NODES {
                let shifted: f64 = (0..=j).map(|i| input[i] * later[j - i]).sum();
                of_input[node][j] = dot(&self.gamma[j], &before) + shifted;
            }
        }
        (of_state, of_input)
    }
}

/// Coefficients of the Lagrange polynomials of the nodes: `MONOMIALS[p][i]` is the coefficient of `s^p` of the polynomial
/// that is 1 at node `i`.
pub(crate) const MONOMIALS: [[f64; NODES]; NODES] = lagrange();

const fn lagrange() -> [[f64; NODES]; NODES] {
    let mut table = [[0.0; NODES]; NODES];
    let mut node = 0;
    while node < NODES {
        // In t = 7 s the coefficients are integers over an integer.
        let mut product = [0.0; NODES];
        product[0] = 1.0;
        let mut denominator = 1.0;
        let mut other = 0;
        while other < NODES {
            if other != node {
                let mut p = NODES - 1;
                while p > 0 {
                    product[p] = product[p - 1] - other as f64 * product[p];
                    p -= 1;
                }
                product[0] *= -(other as f64);
                denominator *= node as f64 - other as f64;
            }
            other += 1;
        }
        let mut scale = 1.0;
        let mut p = 0;
        while p < NODES {
            table[p][node] = product[p] * scale / denominator;
            scale *= (NODES - 1) as f64;
            p += 1;
        }
        node += 1;
    }
    table
}

/// Columns of derivatives to columns of node values: `d_p = p! sum_i MONOMIALS[p][i] v_i`. Each entry of `rows` is a row.
pub(crate) fn of_node_values<const R: usize>(rows: &[[f64; NODES]; R]) -> [[f64; NODES]; R] {
    rows.map(|row| {
        let mut out = [0.0; NODES];
        let mut factorial = 1.0;
        for p in 0..NODES {
            if p > 0 {
                factorial *= p as f64;
            }
            for i in 0..NODES {
                out[i] += row[p] * factorial * MONOMIALS[p][i];
            }
        }
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // dx/dt = -50 x + v over h = 0.4 with v = s^7: halvings, doublings and powers against the quadrature of
    // int_0^1 e^(-20 (1-s)) s^7 ds h, by Simpson's rule with 20,000 intervals; Phi = e^-20.
    #[test]
    fn a_stiff_lag_by_quadrature() {
        let (a, b, h) = ([[-50.0]], [1.0], 0.4);
        let step = Step::between_nodes(&a, &b, h).whole();
        assert!((step.phi[0][0] / (-20.0_f64).exp() - 1.0).abs() < 1e-12);
        let n = 20_000;
        let at = |i: usize| {
            let s = i as f64 / n as f64;
            (-20.0 * (1.0 - s)).exp() * s.powi(7)
        };
        let sum: f64 = (0..n / 2)
            .map(|i| at(2 * i) + 4.0 * at(2 * i + 1) + at(2 * i + 2))
            .sum();
        let expected = sum / (3 * n) as f64 * h;
        let found = step.gamma[7][0] * 5040.0;
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }

    // The Lagrange polynomials reproduce s^5 at s = 0.3 from its node values: 0.00243.
    #[test]
    fn interpolation_is_exact_for_a_quintic() {
        let value = |i: usize| (i as f64 / 7.0).powi(5);
        let polynomial = |p: usize| (0..NODES).map(|i| MONOMIALS[p][i] * value(i)).sum::<f64>();
        let at: f64 = (0..NODES)
            .map(|p| polynomial(p) * 0.3_f64.powi(p as i32))
            .sum();
        assert!((at - 0.002_43).abs() < 1e-14, "{at}");
    }
}
