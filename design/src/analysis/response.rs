//! Integrals and samples of the response to a unit step of reference or load.
//!
//! | symbol | meaning |
//! |--------|---------|
//! | IAE | integral of the absolute error; zero crossings of the interpolating polynomial split it |
//! | IE | integral of the error, known in advance |
//! | ISE | integral of the squared error |
//!
//! With an integral term `u` settles at `1/P(0)` after a step of the reference and the error of a step of the load has the
//! IE `1/ki`. So the reference has `ki (IE + T) = 1/P(0) + kp (1 - b)`, where `T` is the sum of the filter times, which
//! delay the measurement. Without integral term, on an integrating process, `kp (IE + T) = kd + lim 1/(s P)`.
//!
//! A response ends when the error has stayed small, or when the rest of the IE is that of an exponential with the present
//! slope: then only the slowest mode is left, and the rest is known.

use super::law::Law;
use super::process::Process;
use super::propagator::{MONOMIALS, NODES};
use super::realisation::{Excitation, states};
use super::simulation::{Nodes, Simulation};

/// Longest step, as the angle of the fastest frequency of interest (rad): the search's relative error is about 1e-5.
pub(crate) const STEP_RAD: f64 = 0.7;

/// When a response ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ending {
    /// The error has stayed below this share of its peak for six radians of the frequency of interest.
    pub small: f64,
    /// The error has had one sign for twelve radians, and the rest of the IE is that of an exponential within this share.
    pub rest: f64,
    /// Most steps.
    pub steps: usize,
    /// Whether the ISE is wanted; zero otherwise.
    pub squares: bool,
}

impl Ending {
    /// For a search: relative error of the IAE about 1e-5, no ISE.
    pub(crate) const COARSE: Self = Self {
        small: 1e-5,
        rest: 3e-3,
        steps: 20_000,
        squares: false,
    };
    /// Relative error about 1e-9.
    pub(crate) const FINE: Self = Self {
        small: 1e-11,
        rest: 1e-7,
        steps: 2_000_000,
        squares: true,
    };
}

/// Integrals of the error, in the units of the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Integrals {
    pub iae: f64,
    pub ise: f64,
    /// Largest value of the output.
    pub peak_output: f64,
    /// Largest magnitude of the output of the controller.
    pub peak_input: f64,
}

/// Integrals of the response. `None` if the loop diverges, needs more steps than `ending` allows, or has no state space.
pub(crate) fn integrals(
    process: &Process,
    law: &Law,
    excitation: Excitation,
    omega: f64,
    (longest, ending): (f64, Ending),
) -> Option<Integrals> {
    let mut found = Accumulator::new(excitation, known_integral(process, law, excitation), ending);
    run(
        process,
        law,
        excitation,
        longest,
        |simulation_h, start, out| found.add(simulation_h, start, omega, process.tau, out),
    )?;
    let iae = found.iae + found.added;
    (iae.is_finite() && found.ended).then_some(Integrals {
        iae,
        ise: found.ise + found.added_square,
        peak_output: found.peak_output,
        peak_input: found.peak_input,
    })
}

/// Runs the simulation until `take(h, start, nodes)` returns `false`. `None` if there is no state space.
pub(crate) fn run(
    process: &Process,
    law: &Law,
    excitation: Excitation,
    longest: f64,
    take: impl FnMut(f64, f64, &[f64; 2 * NODES]) -> bool,
) -> Option<()> {
    fn of<const N: usize>(
        process: &Process,
        law: &Law,
        excitation: Excitation,
        longest: f64,
        mut take: impl FnMut(f64, f64, &[f64; 2 * NODES]) -> bool,
    ) -> Option<()> {
        let mut simulation = Simulation::<N>::new(process, law, excitation, longest)?;
        while take(simulation.h, simulation.start, &simulation.step()) {}
        Some(())
    }
    match states(process, law) {
        0..=4 => of::<4>(process, law, excitation, longest, take),
        5..=6 => of::<6>(process, law, excitation, longest, take),
        7..=8 => of::<8>(process, law, excitation, longest, take),
        _ => of::<14>(process, law, excitation, longest, take),
    }
}

/// IE of a response that settles. `None` if the error stays.
fn known_integral(process: &Process, law: &Law, excitation: Excitation) -> Option<f64> {
    let denominator = process.stage_denominator();
    let of_power = |i: usize| denominator.coefficients().get(i).copied().unwrap_or(0.0);
    let filters = process.sensors.iter().flatten();
    let lags = law.tf + filters.map(|filter| filter.time_s()).sum::<f64>();
    match excitation {
        Excitation::Load => (law.ki != 0.0).then(|| 1.0 / law.ki),
        Excitation::Reference if law.ki != 0.0 => {
            Some((of_power(0) + law.kp * (1.0 - law.b)) / law.ki - lags)
        }
        Excitation::Reference if of_power(0) == 0.0 && law.b == 1.0 => {
            Some((of_power(1) + law.kd + law.kf) / law.kp - lags)
        }
        Excitation::Reference => None,
    }
}

struct Accumulator {
    excitation: Excitation,
    ending: Ending,
    /// The known IE.
    total: Option<f64>,
    iae: f64,
    ie: f64,
    ise: f64,
    /// The rest of the IAE and of the ISE at the end.
    added: f64,
    added_square: f64,
    peak: f64,
    peak_output: f64,
    peak_input: f64,
    steps: usize,
    quiet: usize,
    one_sign: usize,
    /// Steps for which the rest has been that of an exponential.
    exponential: usize,
    ended: bool,
}

impl Accumulator {
    fn new(excitation: Excitation, total: Option<f64>, ending: Ending) -> Self {
        Self {
            excitation,
            ending,
            total,
            iae: 0.0,
            ie: 0.0,
            ise: 0.0,
            added: 0.0,
            added_square: 0.0,
            peak: 0.0,
            peak_output: 0.0,
            peak_input: 0.0,
            steps: 0,
            quiet: 0,
            one_sign: 0,
            exponential: 0,
            ended: false,
        }
    }

    /// Adds a step of length `h`. Returns whether the response goes on.
    #[inline]
    fn add(&mut self, h: f64, start: f64, omega: f64, tau: f64, out: &[f64; 2 * NODES]) -> bool {
        if self.steps == 0 {
            // Until the first node the error of the reference is 1.
            (self.iae, self.ie, self.ise) = (start, start, start);
        }
        self.steps += 1;
        let mut error = [0.0; NODES];
        for i in 0..NODES {
            let (u, y) = (out[i], out[NODES + i]);
            error[i] = match self.excitation {
                Excitation::Load => y,
                Excitation::Reference => 1.0 - y,
            };
            self.peak_output = self.peak_output.max(y);
            self.peak_input = self.peak_input.max(u.abs());
        }
        let top = error.iter().fold(0.0, |top: f64, e| top.max(e.abs()));
        self.peak = self.peak.max(top);
        let (part, signed) = absolute_integral(&error);
        self.iae += h * part;
        self.ie += h * signed;
        if self.ending.squares {
            self.ise += h * squared_integral(&error);
        }
        let steps_of = |radians: f64| (radians / (omega * h)).ceil() + (tau / h).ceil();
        self.one_sign = if part == signed.abs() {
            self.one_sign + 1
        } else {
            0
        };
        self.quiet = if top <= self.ending.small * self.peak {
            self.quiet + 1
        } else {
            0
        };
        if let Some(total) = self.total
            && self.one_sign as f64 > steps_of(12.0)
        {
            let (first, last) = (error[0], error[NODES - 1]);
            let time = -h / (last / first).ln();
            let rest = total - self.ie;
            let is_one = time > 0.0 && (last * time - rest).abs() <= self.ending.rest * rest.abs();
            self.exponential = if is_one { self.exponential + 1 } else { 0 };
            // Two exponentials together look like one for a moment. The rest of the IAE is known even so, that of the ISE is not.
            let radian = (1.0 / (omega * h)).ceil();
            let enough = if self.ending.squares { radian } else { 0.0 };
            if is_one && self.exponential as f64 > enough {
                self.added = rest.abs();
                self.added_square = 0.5 * last * rest;
                self.ended = true;
            }
        }
        self.ended |= self.quiet as f64 >= steps_of(6.0);
        !self.ended && self.steps < self.ending.steps && top.is_finite() && top < 1e12
    }
}

/// Abscissas (in -1..1, the positive half) and weights of the Gauss-Legendre rule of 8 points: exact for degree 15.
const GAUSS: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_3],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_47],
    [0.960_289_856_497_536_2, 0.101_228_536_290_376_26],
];

/// Lagrange polynomials at a point `s` of the step.
const fn at_point(s: f64) -> Nodes {
    let mut values = [1.0; NODES];
    let mut i = 0;
    while i < NODES {
        let mut j = 0;
        while j < NODES {
            if i != j {
                values[i] *= (s * (NODES - 1) as f64 - j as f64) / (i as f64 - j as f64);
            }
            j += 1;
        }
        i += 1;
    }
    values
}

/// Weights of the integrals of the interpolating polynomial and of its square, by the Gauss rule.
const INTEGRALS: (Nodes, [Nodes; NODES]) = {
    let (mut weights, mut squares) = ([0.0; NODES], [[0.0; NODES]; NODES]);
    let mut point = 0;
    while point < NODES {
        let [x, weight] = GAUSS[point / 2];
        let side = if point % 2 == 0 { 1.0 } else { -1.0 };
        let values = at_point(0.5 + 0.5 * side * x);
        let mut i = 0;
        while i < NODES {
            weights[i] += 0.5 * weight * values[i];
            let mut j = 0;
            while j < NODES {
                squares[i][j] += 0.5 * weight * values[i] * values[j];
                j += 1;
            }
            i += 1;
        }
        point += 1;
    }
    (weights, squares)
};
const WEIGHTS: Nodes = INTEGRALS.0;
const SQUARES: [Nodes; NODES] = INTEGRALS.1;

fn squared_integral(error: &Nodes) -> f64 {
    let mut sum = 0.0;
    for i in 0..NODES {
        let row: f64 = (0..NODES).map(|j| SQUARES[i][j] * error[j]).sum();
        sum += error[i] * row;
    }
    sum
}

/// Integrals of `|e|` and of `e` over a step of length 1.
#[inline]
fn absolute_integral(error: &Nodes) -> (f64, f64) {
    let signed: f64 = (0..NODES).map(|i| WEIGHTS[i] * error[i]).sum();
    if error.windows(2).all(|pair| pair[0] * pair[1] >= 0.0) {
        return (signed.abs(), signed);
    }
    let mut monomials = [0.0; NODES];
    for p in 0..NODES {
        monomials[p] = (0..NODES).map(|i| MONOMIALS[p][i] * error[i]).sum();
    }
    let value = |s: f64| monomials.iter().rev().fold(0.0, |sum, c| sum * s + c);
    let antiderivative = |s: f64| {
        (0..NODES)
            .rev()
            .fold(0.0, |sum, p| (sum + monomials[p] / (p + 1) as f64) * s)
    };
    let (mut sum, mut before) = (0.0, 0.0);
    for i in 1..NODES {
        if error[i - 1] * error[i] < 0.0 {
            let ends = [i - 1, i].map(|node| node as f64 / (NODES - 1) as f64);
            let crossing = crate::roots::root(value, ends[0], ends[1], 1e-15);
            let here = antiderivative(crossing);
            sum += (here - before).abs();
            before = here;
        }
    }
    let last = antiderivative(1.0);
    // A step with a crossing is never of one sign, also if the crossing is at its end.
    (
        f64::max(
            sum + (last - before).abs(),
            signed.abs() * (1.0 + f64::EPSILON),
        ),
        signed,
    )
}
