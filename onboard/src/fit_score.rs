//! How well a process explains the cycle that it was read off: the test behind "unknown".
//!
//! A cycle of a process of the family is, in parts of the period `T = 1` and divided by its
//! amplitude, with `s = j 2 pi n`, `S = (p1 + p2) T`, `r = p1 p2 / (p1 + p2)^2`, duty `d`,
//!
//! ```text
//!          e^(-s tau/T)     2 (1 - e^(-s d))      1
//! y_n =  ---------------- . ---------------- . -------,    Q = s^2 + s S + r S^2,    A = a / (K/(T_body T_prop) T^3)
//!             s Q                  s              A
//!
//! x_k = 32/pi sin(pi k/32) sum_m y_n / n,    n = k + 32 m      means over 32 parts, k = 1..15
//! ```
//!
//! The bias of the input is in harmonic zero alone and plays no part. What is left of the measured
//! `x_k` is weighed against all that a cycle of the family may leave:
//!
//! - noise, equal on all harmonics: a part is the mean of `N/32` samples;
//! - the doubt about the process: the posterior of its values, through the slopes of `x_k`;
//! - the state at the end of the cycle that is not quite that at its start, since noise moves the
//!   switches: jumps of force, rate and output, whose responses are `1/(s Q)`, `1/Q`, `s/Q`;
//! - a floor, for what a window of samples and a network leave in any case.
//!
//! ```text
//! statistic = min over values v and jumps c of   |x - x(v, c)|^2 / variance + |v|^2 + |c|^2
//! ```
//!
//! with `v` and `c` counted in their standard deviations. `x` is linear in `c` and not in `v`: the
//! minimum is found with the slopes at the process read, then with those where that minimum lies. If
//! all were Gaussian and linear and the floor zero, it would be chi-squared with 30 degrees of freedom,
//! for each of these only adds to the covariance.

use core::f64::consts::{PI, TAU};

use libm::{exp, sin, sqrt};

use crate::complex::Complex;
use crate::pack::VALUES;
use crate::signature::PARTS;

/// Harmonics of the parts: those below the one that alternates.
pub(crate) const HARMONICS: usize = PARTS / 2 - 1;

/// Real parts of the harmonics, then imaginary parts.
pub(crate) const ROWS: usize = 2 * HARMONICS;

/// Jumps between a cycle's end and its start.
pub(crate) const JUMPS: usize = 3;

/// What may be left is a combination of so many.
const COLUMNS: usize = VALUES + JUMPS;

/// Harmonics fall as `n^-4`, where the actuator is fast after a plateau of up to seven times, and their means by
/// another fifth: those beyond 32 + 15 add less than 7 * 49^-4 / 5 = 3e-7 of the fundamental to any.
const ALIASES: [i32; 3] = [-1, 0, 1];

pub(crate) type Rows = [f64; ROWS];

/// The harmonics of the means over equal parts.
pub(crate) fn harmonics(parts: &[f64; PARTS]) -> Rows {
    // Turns by half a part.
    let mut turns = [Complex::ONE; 2 * PARTS];
    let step = Complex::turn(-PI / PARTS as f64);
    for index in 1..turns.len() {
        turns[index] = turns[index - 1] * step;
    }
    let mut rows = [0.0; ROWS];
    for harmonic in 1..=HARMONICS {
        let sum = (parts.iter().enumerate()).fold(Complex::default(), |sum, (part, mean)| {
            sum + turns[harmonic * (2 * part + 1) % turns.len()].scaled(*mean)
        });
        put(&mut rows, harmonic, sum.scaled(1.0 / PARTS as f64));
    }
    rows
}

fn put(rows: &mut Rows, harmonic: usize, value: Complex) {
    rows[harmonic - 1] = value.re;
    rows[HARMONICS + harmonic - 1] = value.im;
}

/// What a process makes of a rectangular wave, and how that moves with its values.
#[derive(Clone, Debug)]
pub(crate) struct Response {
    /// Harmonics of the parts.
    pub(crate) mean: Rows,
    /// Derivatives with respect to the values.
    slopes: [Rows; VALUES],
    /// Of jumps of force, rate and output, each of size one at the fundamental.
    jumps: [Rows; JUMPS],
}

impl Response {
    /// Of the process of these values `ln S, r, tau/T, ln A` to a wave of this duty, sampled so many
    /// times in a period and each sample held around its time.
    pub(crate) fn new(values: &[f64; VALUES], duty: f64, samples: f64) -> Self {
        let [ln_pole_sum, pole_ratio, delay, ln_amplitude] = *values;
        let pole_sum = exp(ln_pole_sum);
        let gain = exp(-ln_amplitude);
        let product = pole_ratio * pole_sum * pole_sum;
        let (mut late, mut fall) = (Complex::ONE, Complex::ONE);
        let [late_by_one, fall_by_one] = [delay, duty].map(|part| Complex::turn(-TAU * part));
        let far = |part: f64| Complex::turn(-TAU * PARTS as f64 * part);
        let [late_by_all, fall_by_all] = [far(delay), far(duty)];

        let mut response = Self {
            mean: [0.0; ROWS],
            slopes: [[0.0; ROWS]; VALUES],
            jumps: [[0.0; ROWS]; JUMPS],
        };
        for harmonic in 1..=HARMONICS {
            late = late * late_by_one;
            fall = fall * fall_by_one;
            let of_part = sin(PI * harmonic as f64 / PARTS as f64) * PARTS as f64;
            let mut sums = [Complex::default(); 1 + COLUMNS];
            for alias in ALIASES {
                let turned = |turn: Complex, all: Complex| match alias {
                    0 => turn,
                    1 => turn * all,
                    _ => turn * all.conjugate(),
                };
                let number = harmonic as f64 + f64::from(alias) * PARTS as f64;
                let omega = TAU * number;
                // Means over parts, of samples held around their times.
                let held = PI * number / samples;
                let mean = of_part / (PI * number) * sin(held) / held;
                let quadratic = Complex {
                    re: product - omega * omega,
                    im: omega * pole_sum,
                };
                let inverse = quadratic.inverse();
                let integral = Complex {
                    re: 0.0,
                    im: -1.0 / omega,
                };
                let wave = (Complex::ONE + -turned(fall, fall_by_all)) * integral;
                let response = turned(late, late_by_all) * integral * inverse * wave;
                let response = response.scaled(2.0 * gain * mean);
                let of_pole_sum = Complex {
                    re: 2.0 * product,
                    im: omega * pole_sum,
                };
                let terms = [
                    response,
                    -(response * inverse * of_pole_sum),
                    -(response * inverse).scaled(pole_sum * pole_sum),
                    response
                        * Complex {
                            re: 0.0,
                            im: -omega,
                        },
                    -response,
                    (integral * inverse).scaled(mean),
                    inverse.scaled(mean),
                    (inverse * Complex { re: 0.0, im: omega }).scaled(mean),
                ];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    *sum = *sum + term;
                }
            }
            response.put(harmonic, &sums);
        }
        response.normalise();
        response
    }

    fn put(&mut self, harmonic: usize, sums: &[Complex; 1 + COLUMNS]) {
        put(&mut self.mean, harmonic, sums[0]);
        for (rows, sum) in self
            .slopes
            .iter_mut()
            .chain(&mut self.jumps)
            .zip(&sums[1..])
        {
            put(rows, harmonic, *sum);
        }
    }

    fn normalise(&mut self) {
        for jump in &mut self.jumps {
            let size = libm::hypot(jump[0], jump[HARMONICS]);
            jump.iter_mut().for_each(|value| *value /= size);
        }
    }

    /// How `observed` harmonics are explained within this doubt, with the slopes of this response,
    /// whose process is `values` (counted like the [`Fit`]'s) off the mean.
    fn fit(&self, observed: &Rows, values: &[f64; VALUES], doubt: &Doubt<'_>) -> Fit {
        let mut left = [0.0; ROWS];
        let mut columns = [[0.0; ROWS]; COLUMNS];
        for row in 0..ROWS {
            left[row] = (observed[row] - self.mean[row]) / doubt.sigma;
            for k in 0..VALUES {
                let slope: f64 = (0..VALUES)
                    .map(|v| self.slopes[v][row] * doubt.root[v][k])
                    .sum();
                columns[k][row] = slope / doubt.sigma;
                left[row] += columns[k][row] * values[k];
            }
            for k in 0..JUMPS {
                columns[VALUES + k][row] = doubt.jump * self.jumps[k][row] / doubt.sigma;
            }
        }
        explained(&columns, &left)
    }
}

/// How far off a process that was read may be, and a cycle from that of any process.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubt<'a> {
    /// Upper triangular root of the values' covariance.
    pub(crate) root: &'a [[f64; VALUES]; VALUES],
    /// Standard deviation of the jumps.
    pub(crate) jump: f64,
    /// Standard deviation of noise and floor together on a row.
    pub(crate) sigma: f64,
}

/// The least sum of squares.
#[derive(Clone, Copy, Debug)]
struct Fit {
    /// It.
    statistic: f64,
    /// Where: deviations of the values from their mean, in columns of the root.
    values: [f64; VALUES],
}

/// The statistic of the [module](self) of a cycle of this duty and so many samples, the process of these
/// values read off it.
pub(crate) fn statistic(
    observed: &Rows,
    mean: &[f64; VALUES],
    doubt: &Doubt<'_>,
    duty: f64,
    samples: f64,
) -> f64 {
    let here = [0.0; VALUES];
    let first = Response::new(mean, duty, samples).fit(observed, &here, doubt);
    let (there, values) = nearest(mean, &first.values, doubt.root);
    let second = Response::new(&there, duty, samples).fit(observed, &values, doubt);
    // Great doubt leads to where a response overflows.
    let found = [second.statistic, first.statistic]
        .into_iter()
        .find(|one| one.is_finite());
    found.map_or(f64::INFINITY, |statistic| statistic.max(0.0))
}

/// The process these deviations off the mean, or the nearest that there is, and its own deviations.
fn nearest(
    mean: &[f64; VALUES],
    deviations: &[f64; VALUES],
    root: &[[f64; VALUES]; VALUES],
) -> ([f64; VALUES], [f64; VALUES]) {
    let moved = |row: usize, deviations: &[f64; VALUES]| -> f64 {
        (row..VALUES).map(|k| root[row][k] * deviations[k]).sum()
    };
    let mut there: [f64; VALUES] = core::array::from_fn(|k| mean[k] + moved(k, deviations));
    let [_, pole_ratio, delay, _] = &mut there;
    *pole_ratio = pole_ratio.clamp(0.0, MOST_POLE_RATIO);
    *delay = delay.max(0.0);
    let mut own = [0.0; VALUES];
    for k in (0..VALUES).rev() {
        own[k] = (there[k] - mean[k] - moved(k, &own)) / root[k][k];
    }
    (there, own)
}

/// Of equal lags.
pub(crate) const MOST_POLE_RATIO: f64 = 0.25;

fn dot(a: &Rows, b: &Rows) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The least `|y - A x|^2 + |x|^2`, which is `|y|^2 - b^T (A^T A + 1)^-1 b` with `b = A^T y`, by Cholesky's
/// factor; and the first of `x`.
fn explained(columns: &[Rows; COLUMNS], y: &Rows) -> Fit {
    let mut factor = [[0.0; COLUMNS]; COLUMNS];
    let mut forward = [0.0; COLUMNS];
    for i in 0..COLUMNS {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = dot(&columns[i], &columns[j]) - known;
            factor[i][j] = if i == j {
                sqrt(rest + 1.0)
            } else {
                rest / factor[j][j]
            };
        }
        let known: f64 = (0..i).map(|k| factor[i][k] * forward[k]).sum();
        forward[i] = (dot(&columns[i], y) - known) / factor[i][i];
    }
    let explained: f64 = forward.iter().map(|value| value * value).sum();
    let mut x = forward;
    for i in (0..COLUMNS).rev() {
        let known: f64 = (i + 1..COLUMNS).map(|k| factor[k][i] * x[k]).sum();
        x[i] = (forward[i] - known) / factor[i][i];
    }
    Fit {
        statistic: dot(y, y) - explained,
        values: core::array::from_fn(|k| x[k]),
    }
}

#[cfg(test)]
mod tests;
