//! Open loop `L(jw) = N/D e^(-j w tau)` of a process under a law, and the frequencies at which to look at it.

use num_complex::Complex64;

use super::law::Law;
use super::polynomial::Polynomial;
use super::process::Process;

/// Step of the frequency grid, as a fraction of the frequency.
pub(crate) const GRID_STEP: f64 = 0.04;

/// Largest turn of the dead time between two frequencies of the grid (rad).
const GRID_TURN_RAD: f64 = 0.15;

/// Step of the grid at a resonance, as a fraction of the distance from its poles.
const RESONANCE_STEP: f64 = 0.25;

/// Most frequencies of a grid.
const MOST_FREQUENCIES: usize = 400_000;

#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenLoop {
    pub numerator: Polynomial,
    pub denominator: Polynomial,
    pub tau: f64,
    /// Poles right of the imaginary axis.
    pub unstable_poles: usize,
    resonance: Option<(f64, f64)>,
}

impl OpenLoop {
    pub(crate) fn new(process: &Process, law: &Law) -> Self {
        let (numerator, denominator) = law.transfer();
        Self {
            numerator,
            denominator: denominator.times(&process.denominator()),
            tau: process.tau,
            unstable_poles: process.unstable_poles(),
            resonance: process.resonance(),
        }
    }

    /// `L(jw)`.
    #[inline]
    pub(crate) fn at(&self, omega: f64) -> Complex64 {
        let ratio = self.numerator.at(omega) / self.denominator.at(omega);
        ratio * Complex64::cis(-omega * self.tau)
    }

    /// Whether `|L|` falls towards high frequencies. Otherwise the loop has no finite response, or none with a dead time.
    pub(crate) fn is_proper(&self) -> bool {
        self.numerator.degree() < self.denominator.degree()
    }

    /// Step of the grid from a frequency.
    pub(crate) fn step(&self, omega: f64) -> f64 {
        grid_step(omega, self.tau, self.resonance, GRID_STEP)
    }

    /// Frequency below which `D + N e^(-j w tau)` is its constant within a part of a thousand, and frequency above which
    /// numerator and denominator are their highest powers within a part of ten. `None` for a loop with a pole in the
    /// origin, or without numbers.
    pub(crate) fn range(&self) -> Option<(f64, f64)> {
        let (n, d) = (
            self.numerator.coefficients(),
            self.denominator.coefficients(),
        );
        let size = |i: usize| {
            let delayed = (0..=i).map(|j| {
                let power = self.tau.powi((i - j) as i32);
                n.get(j).map_or(0.0, |c| c.abs() * power)
            });
            d.get(i).map_or(0.0, |c| c.abs()) + delayed.sum::<f64>()
        };
        let constant = (d.first()? + n.first().copied().unwrap_or(0.0)).abs();
        let lowest = (1..d.len())
            .map(|i| (constant / size(i)).powf(1.0 / i as f64))
            .fold(1.0 / self.tau, f64::min);
        let corner = |c: &[f64]| {
            let highest = c.len().saturating_sub(1);
            (0..highest)
                .map(|i| (c[i] / c[highest]).abs().powf(1.0 / (highest - i) as f64))
                .fold(0.0, f64::max)
        };
        let ends = (1e-3 * lowest, 10.0 * corner(n).max(corner(d)));
        (ends.0.is_normal() && ends.1.is_finite()).then_some((ends.0, ends.1.max(10.0 * ends.0)))
    }

    /// Step from a frequency for the loop without its dead time.
    pub(crate) fn undelayed_step(&self, omega: f64) -> f64 {
        grid_step(omega, 0.0, self.resonance, GRID_STEP)
    }

    /// Frequency in a [range](Self::range) above which `|L|` stays below `least`. The dead time does not change `|L|`, so the
    /// grid has some hundred frequencies also where the dead time is long.
    pub(crate) fn end(&self, [first, last]: [f64; 2], least: f64) -> f64 {
        let magnitude =
            |omega: f64| self.numerator.at(omega).norm() / self.denominator.at(omega).norm();
        let (mut omega, mut end) = (first, first);
        while omega < last || magnitude(omega) >= least {
            let next = omega + self.undelayed_step(omega);
            if magnitude(omega) >= least || magnitude(next) >= least {
                end = next;
            }
            omega = next;
        }
        end
    }

    /// Grid of frequencies with the loop, from `first` to `end`. `None` if it needs too many.
    pub(crate) fn walk(&self, first: f64, end: f64) -> Option<Vec<(f64, Complex64)>> {
        let mut points = Vec::with_capacity(1024);
        let mut omega = first;
        while points.len() < MOST_FREQUENCIES {
            points.push((omega, self.at(omega)));
            if omega >= end {
                return Some(points);
            }
            omega += self.step(omega);
        }
        None
    }
}

/// Step of a frequency grid: a fraction of the frequency, a turn of the dead time, and fine enough for a resonance.
pub(crate) fn grid_step(omega: f64, tau: f64, resonance: Option<(f64, f64)>, fraction: f64) -> f64 {
    let step = (fraction * omega).min(GRID_TURN_RAD * fraction / GRID_STEP / tau);
    match resonance {
        // The pole lies at the distance `hypot` from jw. Above the resonance the step may reach beyond, below not past it.
        Some((peak, damping)) => {
            step.min(RESONANCE_STEP * (omega - peak).hypot(damping * peak).max(1e-7 * peak))
        }
        None => step,
    }
}
