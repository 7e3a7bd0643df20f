//! The response against the time domain, and the statistic against its expected distribution.

use libm::sqrt;

use super::fit::dot;
use super::*;
use crate::transition::{State, Transition};

/// Nodes and weights of the Gauss-Legendre rule of five points on -1..1.
const RULE: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// The periodic response in the time domain, with the period and `K/T_body` one.
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

    /// From the start: low, high after the delay, low again; the mean input is zero.
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

/// Damping, pole of the actuator, delay, duty: two multirotors, equal poles, no damping.
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

/// The statistic after a single pass at this response.
fn left(
    response: &PeriodicResponse,
    observed: &Rows,
    root: &[[f64; VALUES]; VALUES],
    jump: f64,
    sigma: f64,
) -> f64 {
    let doubt = Doubt {
        root: *root,
        jump,
        sigma,
    };
    let mut response = response.clone();
    let mut explained = Explained::NONE;
    explained.begin(response.equations(observed, &[0.0; VALUES], &doubt));
    loop {
        if let Some(statistic) = explained.advance(&response.columns) {
            return statistic;
        }
    }
}

fn harmonics(parts: &[f64; PARTS]) -> Rows {
    let mut rows = [0.0; ROWS];
    add_harmonics(parts, 1..=HARMONICS, &mut rows);
    rows
}

fn respond(values: &[f64; VALUES], duty: f64, samples: f64) -> PeriodicResponse {
    let mut response = PeriodicResponse::NONE;
    response.begin(values, duty);
    while !response.advance(samples) {}
    response
}

/// Parts of a cycle with these harmonics.
fn parts(harmonics: &Rows) -> [f64; PARTS] {
    core::array::from_fn(|part| {
        (1..=HARMONICS)
            .map(|n| {
                let turn = Complex::turn(PI * (n * (2 * part + 1)) as f64 / PARTS as f64);
                let (re, im) = (harmonics[n - 1], harmonics[HARMONICS + n - 1]);
                2.0 * (re * turn.re - im * turn.im)
            })
            .sum()
    })
}

fn statistic(
    parts: [f64; PARTS],
    mean: &[f64; VALUES],
    doubt: &Doubt,
    duty: f64,
    samples: f64,
) -> f64 {
    let mut statistic = Statistic::NONE;
    statistic.begin(ScoredCycle {
        parts,
        mean: *mean,
        doubt: *doubt,
        duty,
        samples,
    });
    loop {
        if let Some(found) = statistic.advance() {
            return found;
        }
    }
}

// Against the time domain: the aliases beyond 47 add less than 3e-7 of the fundamental, and to a statistic with
// a floor of 3e-4 of it less than 30 (3e-7 / 3e-4)^2 = 3e-5.
#[test]
fn a_perfect_cycle_leaves_nothing() {
    for shape in SHAPES {
        let [body, prop, delay, duty] = shape;
        let observed = harmonics(&Wave::new(body, prop, delay, duty).parts());
        // With so many samples a sample is held for no time.
        let response = respond(&values(shape), duty, 1e9);
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

// A cycle whose end differs from its start is the periodic one plus free motion of the state. In harmonics the
// free motion of a deviation (y, v, f) at the start is a jump of what decays over the cycle.
#[test]
fn jumps_are_free_motions() {
    let [body, prop, delay, duty] = SHAPES[1];
    let response = respond(&values(SHAPES[1]), duty, 1e9);
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
    // Without jumps a few per cent over 1e-5 are left. With them the cost is that of their size, of order one,
    // and of their aliases beyond 47, 1e-3 of the size of a jump of the output at most.
    assert!(stiff > 1e4, "{stiff}");
    assert!(free < 1e-3 * stiff, "{free} of {stiff}");
}

// Central differences with a step of 1e-5 are accurate to 1e-9 of the derivative, times some hundred for the
// curvature.
#[test]
fn slopes_are_derivatives() {
    for shape in SHAPES {
        let response = respond(&values(shape), shape[3], 200.0);
        for k in 0..VALUES {
            let at = |step: f64| {
                let mut moved = values(shape);
                moved[k] += step;
                respond(&moved, shape[3], 200.0).mean
            };
            let [above, below] = [at(1e-5), at(-1e-5)];
            for row in 0..ROWS {
                let difference = (above[row] - below[row]) / 2e-5;
                let slope = response.columns[k][row];
                assert!(
                    (difference - slope).abs() < 1e-7 * size(&response.columns[k]),
                    "value {k} row {row}: {difference} {slope}"
                );
            }
        }
    }
}

/// Normal numbers: the sum of twelve uniform numbers of a linear congruential generator (Knuth's MMIX) minus
/// six.
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

// Values, jumps and noise drawn from their assumed distributions: chi-squared with 30 degrees of freedom
// whatever the sizes of the columns, with mean 30 and variance 60. The mean of 4000 draws has the standard
// deviation sqrt(60/4000) = 0.12, the variance 60 sqrt(2.4/4000) = 1.5.
#[test]
fn noise_is_chi_squared() {
    let response = respond(&values(SHAPES[0]), 0.5, 200.0);
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
                observed[row] += response.columns[v][row] * off;
            }
            for k in 0..JUMPS {
                observed[row] += jumps * response.columns[VALUES + k][row] * jump[k];
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

// The statistic is a quadratic form of the difference: twice the difference costs four times.
#[test]
fn grows_with_the_square_of_a_defect() {
    let response = respond(&values(SHAPES[0]), 0.5, 200.0);
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

// A cycle two standard deviations off in three values costs at most |v|^2 = 12 with exact derivatives. The
// derivatives at the mean neglect terms of second order in 0.6; those at the minimum neglect terms of second
// order in the remainder.
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
    let observed = respond(&moved, 0.5, 200.0).mean;
    let sigma = 1e-4 * size(&observed);
    let doubt = Doubt {
        root,
        jump: 0.0,
        sigma,
    };
    let at_mean = respond(&mean, 0.5, 200.0);
    let first = left(&at_mean, &observed, &root, 0.0, sigma);
    let second = statistic(parts(&observed), &mean, &doubt, 0.5, 200.0);
    assert!(first > 24.0 && second < 12.6, "{first} {second}");

    let nothing = [f64::NAN; PARTS];
    let of_nothing = statistic(nothing, &mean, &doubt, 0.5, 200.0);
    assert_eq!(of_nothing, f64::INFINITY);
}

// Outside the valid values (beyond equal lags, negative delay) the nearest valid values are used, with their own
// deviations.
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
