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
mod tests {
    use super::*;
    use crate::transition::{State, Transition};

    /// Nodes and weights of Gauss and Legendre's rule of five points on -1..1.
    const RULE: [(f64, f64); 5] = [
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.906_179_845_938_664, 0.236_926_885_056_189_1),
        (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    ];

    /// The periodic response in the time domain, period one and `K/T_body` one.
    struct Wave {
        body: f64,
        prop: f64,
        cuts: [f64; 2],
        start: State,
    }

    impl Wave {
        fn new(body: f64, prop: f64, delay: f64, duty: f64) -> Self {
            let mut wave = Self {
                body,
                prop,
                cuts: [delay, delay + duty],
                start: State::default(),
            };
            let forced = wave.at(1.0);
            let whole = Transition::of_poles(body, prop, 1.0);
            let f = forced.f / -libm::expm1(-prop);
            let v = -(whole.y_f * f + forced.y) / whole.y_v;
            wave.start = State { y: 0.0, v, f };
            wave
        }

        /// From the start: low, high behind the delay, low again; the mean input is zero.
        fn at(&self, time: f64) -> State {
            let [rise, fall] = self.cuts;
            let mean = 2.0 * (fall - rise) - 1.0;
            let pieces = [(0.0, rise, -1.0), (rise, fall, 1.0), (fall, 1.0, -1.0)];
            pieces.iter().fold(self.start, |state, &(from, to, input)| {
                let length = (time.min(to) - from).max(0.0);
                Transition::of_poles(self.body, self.prop, length).apply(&state, input - mean)
            })
        }

        fn parts(&self) -> [f64; PARTS] {
            core::array::from_fn(|part| {
                let [low, high] = [part, part + 1].map(|edge| edge as f64 / PARTS as f64);
                let mut edges = [low, self.cuts[0], self.cuts[1], high];
                edges
                    .iter_mut()
                    .for_each(|edge| *edge = edge.clamp(low, high));
                let integral: f64 = edges
                    .windows(2)
                    .map(|pair| {
                        let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
                        let sum: f64 = (RULE.iter())
                            .map(|(node, weight)| weight * self.at(middle + half * node).y)
                            .sum();
                        half * sum
                    })
                    .sum();
                integral * PARTS as f64
            })
        }
    }

    /// Damping, actuator's pole, delay, duty: two multirotors, equal poles, no damping.
    const SHAPES: [[f64; 4]; 4] = [
        [0.25, 13.0, 0.056, 0.5],
        [2.9, 38.0, 0.006, 0.47],
        [5.0, 5.0, 0.1, 0.55],
        [0.0, 8.0, 0.05, 0.5],
    ];

    fn values([body, prop, delay, _]: [f64; 4]) -> [f64; VALUES] {
        let sum = body + prop;
        // K/(T_body T_prop) = prop.
        [
            libm::log(sum),
            body * prop / (sum * sum),
            delay,
            -libm::log(prop),
        ]
    }

    fn size(rows: &Rows) -> f64 {
        sqrt(dot(rows, rows))
    }

    const NO_DOUBT: [[f64; VALUES]; VALUES] = [[0.0; VALUES]; VALUES];

    /// What this response, without a second one, leaves.
    fn left(
        response: &Response,
        observed: &Rows,
        root: &[[f64; VALUES]; VALUES],
        jump: f64,
        sigma: f64,
    ) -> f64 {
        let doubt = Doubt { root, jump, sigma };
        response.fit(observed, &[0.0; VALUES], &doubt).statistic
    }

    // Against the time domain: what the aliases beyond 47 add is below 3e-7 of the fundamental, and a
    // statistic with a floor of 3e-4 of it below 30 (3e-7 / 3e-4)^2 = 3e-5.
    #[test]
    fn a_perfect_cycle_leaves_nothing() {
        for shape in SHAPES {
            let [body, prop, delay, duty] = shape;
            let observed = harmonics(&Wave::new(body, prop, delay, duty).parts());
            // Held for no time.
            let response = Response::new(&values(shape), duty, 1e9);
            let fundamental = libm::hypot(observed[0], observed[HARMONICS]);
            for (row, (a, b)) in observed.iter().zip(response.mean).enumerate() {
                assert!(
                    (a - b).abs() < 3e-7 * fundamental,
                    "{shape:?} {row} {a} {b}"
                );
            }
            let statistic = left(&response, &observed, &NO_DOUBT, 0.0, 3e-4 * fundamental);
            assert!(statistic < 3e-5, "{statistic}");
        }
    }

    // A cycle that ends elsewhere than it began is the periodic one and free motion of the state. That
    // of a deviation (y, v, f) at the start is, in harmonics, jumps of what is lost over the cycle.
    #[test]
    fn jumps_are_free_motions() {
        let [body, prop, delay, duty] = SHAPES[1];
        let response = Response::new(&values(SHAPES[1]), duty, 1e9);
        let amplitude = size(&response.mean);
        let mut wave = Wave::new(body, prop, delay, duty);
        wave.start.v += 0.05 * wave.start.v;
        wave.start.f += 0.1;
        let moved = harmonics(&wave.parts());
        let [stiff, free] = [0.0, 1.0].map(|jumps| {
            left(
                &response,
                &moved,
                &NO_DOUBT,
                jumps * amplitude,
                1e-5 * amplitude,
            )
        });
        // Without jumps some per cent over 1e-5 are left; with them the cost of their size, of order one,
        // and their aliases beyond 47, 1e-3 of a jump of the output's size at most.
        assert!(stiff > 1e4, "{stiff}");
        assert!(free < 1e-3 * stiff, "{free} of {stiff}");
    }

    // Central differences of 1e-5 are good to 1e-9 of the slope, times some hundred for the curvature.
    #[test]
    fn slopes_are_derivatives() {
        for shape in SHAPES {
            let response = Response::new(&values(shape), shape[3], 200.0);
            for k in 0..VALUES {
                let at = |step: f64| {
                    let mut moved = values(shape);
                    moved[k] += step;
                    Response::new(&moved, shape[3], 200.0).mean
                };
                let [above, below] = [at(1e-5), at(-1e-5)];
                for row in 0..ROWS {
                    let difference = (above[row] - below[row]) / 2e-5;
                    let slope = response.slopes[k][row];
                    assert!(
                        (difference - slope).abs() < 1e-7 * size(&response.slopes[k]),
                        "value {k} row {row}: {difference} {slope}"
                    );
                }
            }
        }
    }

    /// Normal numbers: twelve uniform ones of a linear congruential generator (Knuth's MMIX), less six.
    struct Normal(u64);

    impl Normal {
        fn next(&mut self) -> f64 {
            let mut uniform = || {
                self.0 = (self.0)
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    // Values, jumps and noise drawn from what they are taken for: chi-squared with 30 degrees of freedom
    // whatever the sizes of the columns, mean 30, variance 60. Of 4000 the mean is known to
    // sqrt(60/4000) = 0.12, the variance to 60 sqrt(2.4/4000) = 1.5.
    #[test]
    fn noise_is_chi_squared() {
        let response = Response::new(&values(SHAPES[0]), 0.5, 200.0);
        let scale = size(&response.mean);
        let (jumps, sigma) = (0.01 * scale, 0.003 * scale);
        let mut root = NO_DOUBT;
        for i in 0..VALUES {
            for j in i..VALUES {
                root[i][j] = 0.02 / (1.0 + (i + j) as f64);
            }
        }
        let mut normal = Normal(1);
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..4000 {
            let mut observed = response.mean;
            let doubts: [f64; VALUES] = core::array::from_fn(|_| normal.next());
            let jump: [f64; JUMPS] = core::array::from_fn(|_| normal.next());
            for row in 0..ROWS {
                for v in 0..VALUES {
                    let off: f64 = (0..VALUES).map(|k| root[v][k] * doubts[k]).sum();
                    observed[row] += response.slopes[v][row] * off;
                }
                for k in 0..JUMPS {
                    observed[row] += jumps * response.jumps[k][row] * jump[k];
                }
                observed[row] += sigma * normal.next();
            }
            let statistic = left(&response, &observed, &root, jumps, sigma);
            sum += statistic;
            squares += statistic * statistic;
        }
        let mean = sum / 4000.0;
        let variance = squares / 4000.0 - mean * mean;
        assert!((mean - 30.0).abs() < 0.4, "{mean}");
        assert!((variance - 60.0).abs() < 5.0, "{variance}");
    }

    // Of what is left the statistic is a quadratic form: a defect twice as large counts four times.
    #[test]
    fn grows_with_the_square_of_a_defect() {
        let response = Response::new(&values(SHAPES[0]), 0.5, 200.0);
        let scale = size(&response.mean);
        let at = |size: f64| {
            let mut observed = response.mean;
            observed[4] += size * scale;
            observed[HARMONICS + 6] -= 0.5 * size * scale;
            left(&response, &observed, &NO_DOUBT, 0.01 * scale, 1e-3 * scale)
        };
        let (once, twice) = (at(0.02), at(0.04));
        assert!(
            once > 100.0 && (twice / once - 4.0).abs() < 1e-9,
            "{once} {twice}"
        );
        assert!(at(f64::NAN).is_nan());
    }

    // A cycle two standard deviations off in three values costs no more than |v|^2 = 12 where the slopes are
    // right. Those at the mean miss what is of second order in 0.6; those where they lead of that again.
    #[test]
    fn slopes_are_taken_where_they_lead() {
        let mean = values(SHAPES[0]);
        let mut root = NO_DOUBT;
        for (k, size) in [0.3, 0.003, 0.01, 0.3].into_iter().enumerate() {
            root[k][k] = size;
        }
        let off = [2.0, 0.0, 2.0, -2.0];
        let (moved, deviations) = nearest(&mean, &off, &root);
        for (found, expected) in deviations.iter().zip(off) {
            assert!((found - expected).abs() < 1e-12, "{deviations:?}");
        }
        let observed = Response::new(&moved, 0.5, 200.0).mean;
        let sigma = 1e-4 * size(&observed);
        let doubt = Doubt {
            root: &root,
            jump: 0.0,
            sigma,
        };
        let at_mean = Response::new(&mean, 0.5, 200.0);
        let first = left(&at_mean, &observed, &root, 0.0, sigma);
        let second = statistic(&observed, &mean, &doubt, 0.5, 200.0);
        assert!(first > 24.0 && second < 12.6, "{first} {second}");

        observed_nan_is_unknown(&mean, &doubt);
    }

    fn observed_nan_is_unknown(mean: &[f64; VALUES], doubt: &Doubt<'_>) {
        let nothing = [f64::NAN; ROWS];
        assert_eq!(statistic(&nothing, mean, doubt, 0.5, 200.0), f64::INFINITY);
    }

    // Beyond equal lags and before the input there is nothing: the nearest there is, and its deviations.
    #[test]
    fn the_nearest_is_a_process() {
        let mean = [2.0, 0.2, 0.01, 0.0];
        let root = [
            [0.1, 0.05, 0.0, 0.02],
            [0.0, 0.04, 0.01, 0.0],
            [0.0, 0.0, 0.02, 0.01],
            [0.0, 0.0, 0.0, 0.1],
        ];
        let (there, own) = nearest(&mean, &[1.0, 3.0, -2.0, 0.5], &root);
        assert_eq!([there[1], there[2]], [0.25, 0.0]);
        for k in 0..VALUES {
            let back: f64 = mean[k] + (k..VALUES).map(|j| root[k][j] * own[j]).sum::<f64>();
            assert!((back - there[k]).abs() < 1e-15, "{k} {back} {there:?}");
        }
    }
}
