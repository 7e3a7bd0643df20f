//! Periodic response of a process to a rectangular wave, and its derivatives with respect to the values.

use core::f64::consts::{PI, TAU};

use libm::{exp, hypot, sin};

use super::{COLUMNS, Doubt, HARMONICS, JUMPS, ROWS, Rows, put};
use crate::complex::Complex;
use crate::pack::VALUES;
use crate::signature::PARTS;

/// Aliases that are summed. Harmonics fall as `n^-4`, with a fast actuator after a plateau of up to seven times,
/// and the means by another fifth: those beyond 32 + 15 add less than 7 * 49^-4 / 5 = 3e-7 of the fundamental.
const ALIASES: [i32; 3] = [-1, 0, 1];

/// Harmonics per slice.
const SLICE: usize = 3;

#[derive(Clone, Debug)]
pub(super) struct PeriodicResponse {
    /// Harmonics of the means over parts.
    pub(super) mean: Rows,
    /// Derivatives with respect to the values, then jumps of force, rate and output, each of size one at the
    /// fundamental. [`equations`](Self::equations) turns them into columns.
    pub(super) columns: [Rows; COLUMNS],
    terms: Terms,
    /// Number of harmonics computed.
    done: usize,
    /// Rotations by the delay and by the time of the fall, for the last harmonic.
    late: Complex,
    fall: Complex,
}

/// Values that all harmonics share.
#[derive(Clone, Copy, Debug)]
struct Terms {
    pole_sum: f64,
    product: f64,
    gain: f64,
    /// Rotations by the delay and by the time of the fall, for the fundamental and for harmonic 32.
    by_one: [Complex; 2],
    by_all: [Complex; 2],
}

impl PeriodicResponse {
    /// All zeros, which takes no space in the program: memory before the first use.
    pub(super) const NONE: Self = Self {
        mean: [0.0; ROWS],
        columns: [[0.0; ROWS]; COLUMNS],
        terms: Terms {
            pole_sum: 0.0,
            product: 0.0,
            gain: 0.0,
            by_one: [Complex::ZERO; 2],
            by_all: [Complex::ZERO; 2],
        },
        done: 0,
        late: Complex::ZERO,
        fall: Complex::ZERO,
    };

    /// Begins the response of the process with the values `ln S, r, tau/T, ln A` to a wave of this duty.
    pub(super) fn begin(&mut self, values: &[f64; VALUES], duty: f64) {
        let [ln_pole_sum, pole_ratio, delay, ln_amplitude] = *values;
        let pole_sum = exp(ln_pole_sum);
        let turns = |harmonic: f64| [delay, duty].map(|part| Complex::turn(-TAU * harmonic * part));
        self.terms = Terms {
            pole_sum,
            product: pole_ratio * pole_sum * pole_sum,
            gain: exp(-ln_amplitude),
            by_one: turns(1.0),
            by_all: turns(PARTS as f64),
        };
        self.done = 0;
        (self.late, self.fall) = (Complex::ONE, Complex::ONE);
    }

    /// Computes the next harmonics of a wave with this number of samples per period, each sample held around its
    /// time; true when all are complete.
    pub(super) fn advance(&mut self, samples: f64) -> bool {
        let end = HARMONICS.min(self.done + SLICE);
        for harmonic in self.done + 1..=end {
            let [late_by_one, fall_by_one] = self.terms.by_one;
            self.late = self.late * late_by_one;
            self.fall = self.fall * fall_by_one;
            let of_part = sin(PI * harmonic as f64 / PARTS as f64) * PARTS as f64;
            let mut sums = [Complex::default(); 1 + COLUMNS];
            for alias in ALIASES {
                let number = harmonic as f64 + f64::from(alias) * PARTS as f64;
                // Means over parts, of samples held around their times.
                let held = PI * number / samples;
                let mean = of_part / (PI * number) * sin(held) / held;
                for (sum, term) in sums.iter_mut().zip(self.at(alias, TAU * number, mean)) {
                    *sum = *sum + term;
                }
            }
            let columns = self.columns.iter_mut();
            for (rows, sum) in [&mut self.mean].into_iter().chain(columns).zip(sums) {
                put(rows, harmonic, sum);
            }
        }
        self.done = end;
        if end < HARMONICS {
            return false;
        }
        for jump in &mut self.columns[VALUES..] {
            let size = hypot(jump[0], jump[HARMONICS]);
            jump.iter_mut().for_each(|value| *value /= size);
        }
        true
    }

    /// Mean and columns at an angular frequency, for the harmonic of this alias.
    fn at(&self, alias: i32, omega: f64, mean: f64) -> [Complex; 1 + COLUMNS] {
        let Terms {
            pole_sum,
            product,
            gain,
            by_all: [late_by_all, fall_by_all],
            ..
        } = self.terms;
        let turned = |turn: Complex, all: Complex| match alias {
            0 => turn,
            1 => turn * all,
            _ => turn * all.conjugate(),
        };
        let quadratic = Complex {
            re: product - omega * omega,
            im: omega * pole_sum,
        };
        let inverse = quadratic.inverse();
        let integral = Complex {
            re: 0.0,
            im: -1.0 / omega,
        };
        let wave = (Complex::ONE + -turned(self.fall, fall_by_all)) * integral;
        let response = turned(self.late, late_by_all) * integral * inverse * wave;
        let response = response.scaled(2.0 * gain * mean);
        let of_pole_sum = Complex {
            re: 2.0 * product,
            im: omega * pole_sum,
        };
        let slope = Complex {
            re: 0.0,
            im: -omega,
        };
        [
            response,
            -(response * inverse * of_pole_sum),
            -(response * inverse).scaled(pole_sum * pole_sum),
            response * slope,
            -response,
            (integral * inverse).scaled(mean),
            inverse.scaled(mean),
            (inverse * Complex { re: 0.0, im: omega }).scaled(mean),
        ]
    }

    /// Right-hand side of the least squares: the difference of `observed` and the response, when the process is
    /// at these `deviations` from the mean. Turns derivatives and jumps into the columns that may explain it.
    pub(super) fn equations(
        &mut self,
        observed: &Rows,
        deviations: &[f64; VALUES],
        doubt: &Doubt,
    ) -> Rows {
        let mut left = [0.0; ROWS];
        for row in 0..ROWS {
            left[row] = (observed[row] - self.mean[row]) / doubt.sigma;
            let slopes: [f64; VALUES] = core::array::from_fn(|v| self.columns[v][row]);
            for k in 0..VALUES {
                let slope: f64 = (0..VALUES).map(|v| slopes[v] * doubt.root[v][k]).sum();
                self.columns[k][row] = slope / doubt.sigma;
                left[row] += self.columns[k][row] * deviations[k];
            }
            for jump in &mut self.columns[VALUES..VALUES + JUMPS] {
                jump[row] = doubt.jump * jump[row] / doubt.sigma;
            }
        }
        left
    }
}
