//! The closed loop as a state space with one delayed input.
//!
//! ```text
//! dx/dt = A x + B v(t),     v(t) = u(t - tau),     u = cu x,     e = ce x
//! ```
//!
//! States, in this order: the stages of the process, the filters of the measurement and the derivative, the integral of
//! `r - ym`, and the constant 1. The derivatives of the law are rows times `A`: exact, not filtered again.

use crate::controller::LowPass;

use super::law::Law;
use super::process::{Process, Stage};

/// What excites the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Excitation {
    /// Unit step of the reference; the error is `r - y`.
    Reference,
    /// Unit step at the input of the process; the error is `y`.
    Load,
}

/// Matrices with `N` states. States that the loop does not need stay zero.
#[derive(Clone, Debug)]
pub(crate) struct Realisation<const N: usize> {
    pub a: [[f64; N]; N],
    pub b: [f64; N],
    pub cu: [f64; N],
    /// Row of the output `y` of the process.
    pub cy: [f64; N],
    /// Index of the integral state, if there is one.
    pub integral: Option<usize>,
    used: usize,
}

/// Number of states that a loop needs.
pub(crate) fn states(process: &Process, law: &Law) -> usize {
    let order = |filter: Option<LowPass>| match filter {
        Some(LowPass::FirstOrder(_)) => 1,
        Some(LowPass::SecondOrder(_)) => 2,
        None => 0,
    };
    let stages = process.stages().iter().map(|stage| match stage {
        Stage::Pair(..) => 2,
        _ => 1,
    });
    let derivative = law
        .derivative_filter
        .filter(|_| law.uses_derivative_filter());
    stages.sum::<usize>()
        + process.sensors.map(order).iter().sum::<usize>()
        + order(filter(law))
        + order(derivative)
        + usize::from(law.ki != 0.0)
        + 1
}

/// The filter `F`, if it has a time.
fn filter(law: &Law) -> Option<LowPass> {
    (law.tf > 0.0).then_some(LowPass::SecondOrder(law.tf))
}

impl<const N: usize> Realisation<N> {
    /// `None` if a derivative of the law would contain the input itself, or if the states exceed `N`.
    pub(crate) fn new(process: &Process, law: &Law, excitation: Excitation) -> Option<Self> {
        if states(process, law) > N {
            return None;
        }
        let mut built = Self {
            a: [[0.0; N]; N],
            b: [0.0; N],
            cu: [0.0; N],
            cy: [0.0; N],
            integral: None,
            used: 0,
        };
        let mut row = None;
        for stage in process.stages() {
            row = Some(built.stage(row, *stage));
        }
        built.cy = row?;
        let one = unit(N - 1);
        if excitation == Excitation::Load {
            for i in 0..N {
                built.a[i][N - 1] += built.b[i];
            }
        }
        let measured = (process.sensors.into_iter())
            .chain([filter(law)])
            .fold(built.cy, |measured, low_pass| {
                built.filter(measured, low_pass)
            });
        let reference = if excitation == Excitation::Reference {
            1.0
        } else {
            0.0
        };
        let mut cu = [0.0; N];
        if law.ki != 0.0 {
            let state = built.next();
            built.integral = Some(state);
            built.a[state] = minus(&scaled(&one, reference), &measured);
            cu[state] = law.ki;
        }
        let mut subtract = |gain: f64, row: &[f64; N]| {
            if gain != 0.0 {
                cu = minus(&cu, &scaled(row, gain));
            }
        };
        subtract(law.kp, &measured);
        subtract(-law.kp * law.b * reference, &one);
        if law.kd != 0.0 {
            subtract(law.kd, &built.derivative(&measured)?);
        }
        if law.kf != 0.0 || law.k2 != 0.0 {
            let used = law
                .derivative_filter
                .filter(|_| law.uses_derivative_filter());
            let h = built.filter(measured, used);
            let slope = built.derivative(&h)?;
            subtract(law.kf, &slope);
            if law.k2 != 0.0 {
                subtract(law.k2, &built.derivative(&slope)?);
            }
        }
        built.cu = cu;
        Some(built)
    }

    fn next(&mut self) -> usize {
        self.used += 1;
        self.used - 1
    }

    /// Adds a stage of the process behind `source`, the input if `None`. Returns the row of its output.
    fn stage(&mut self, source: Option<[f64; N]>, stage: Stage) -> [f64; N] {
        match stage {
            Stage::Lag(lag) => self.first_order(source, 1.0 / lag, 1.0 / lag),
            Stage::Pole(pole) => self.first_order(source, pole, 1.0),
            Stage::Pair(c1, c0) => {
                let rate = c0.sqrt().max(c1).max(f64::MIN_POSITIVE);
                self.second_order(source, [c0 / rate, c1, rate], 1.0 / rate)
            }
        }
    }

    /// Adds a filter behind `source`. Returns the row of its output.
    fn filter(&mut self, source: [f64; N], filter: Option<LowPass>) -> [f64; N] {
        match filter {
            None => source,
            Some(LowPass::FirstOrder(time)) => {
                self.first_order(Some(source), 1.0 / time, 1.0 / time)
            }
            Some(LowPass::SecondOrder(time)) => {
                let rate = 1.0 / time;
                self.second_order(Some(source), [2.0 * rate, 2.0 * rate, rate], 2.0 * rate)
            }
        }
    }

    /// `dx/dt = -pole x + gain input`.
    fn first_order(&mut self, source: Option<[f64; N]>, pole: f64, gain: f64) -> [f64; N] {
        let x = self.next();
        self.a[x][x] = -pole;
        self.feed(x, source, gain);
        unit(x)
    }

    /// `dx/dt = rate z`, `dz/dt = gain input - back x - damping z`.
    fn second_order(
        &mut self,
        source: Option<[f64; N]>,
        [back, damping, rate]: [f64; 3],
        gain: f64,
    ) -> [f64; N] {
        let (x, z) = (self.next(), self.next());
        self.a[x][z] = rate;
        self.a[z][x] = -back;
        self.a[z][z] = -damping;
        self.feed(z, source, gain);
        unit(x)
    }

    fn feed(&mut self, state: usize, source: Option<[f64; N]>, gain: f64) {
        match source {
            Some(row) => {
                for i in 0..N {
                    self.a[state][i] += gain * row[i];
                }
            }
            None => self.b[state] = gain,
        }
    }

    /// Row of the time derivative of `row x`. `None` if it contains the input.
    fn derivative(&self, row: &[f64; N]) -> Option<[f64; N]> {
        let direct: f64 = (0..N).map(|i| row[i] * self.b[i]).sum();
        let mut slope = [0.0; N];
        for i in 0..N {
            for j in 0..N {
                slope[j] += row[i] * self.a[i][j];
            }
        }
        (direct == 0.0).then_some(slope)
    }
}

fn unit<const N: usize>(index: usize) -> [f64; N] {
    let mut row = [0.0; N];
    row[index] = 1.0;
    row
}

fn scaled<const N: usize>(row: &[f64; N], factor: f64) -> [f64; N] {
    row.map(|value| value * factor)
}

fn minus<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    let mut difference = *a;
    for i in 0..N {
        difference[i] -= b[i];
    }
    difference
}
