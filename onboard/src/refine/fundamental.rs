//! Starting values from the fundamental of input and output.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use libm::{atan, atan2, cos, floor, hypot, log, sin, sqrt, tan};

use super::domain::{Shape, clamp};
use crate::window::{Bin, Edge, Window};

/// Number of starts.
pub(super) const STARTS: usize = 12;
/// Damping rates of the starts (1/period): from negligible to a body faster than the relay.
const DAMPINGS: [f64; 4] = [0.05, 0.5, 2.0, 5.0];
/// Shares of the actuator in the phase lag that the body leaves; the rest is delay.
const SHARES: [f64; 3] = [0.15, 0.5, 0.85];

/// Largest phase lag of the actuator in the starts (rad).
const MOST_ACTUATOR_RAD: f64 = 1.4;

/// The oscillation at its fundamental frequency.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fundamental {
    period_s: f64,
    /// Phase lag of the process (rad).
    lag_rad: f64,
    /// Upper bound of the acceleration that the input produces (output unit / s^2).
    pub(super) acceleration: f64,
    /// Lower bound of the acceleration produced by half the range of the input (output unit / s^2).
    pub(super) relay_acceleration: f64,
    /// Root mean square of the output minus its first value (output unit).
    pub(super) rms: f64,
}

/// Bins or edges per slice, counting an edge twice: two sines per bin, four per edge.
pub(super) const SLICE: usize = 16;
const EDGE: usize = 2;

/// Sums over the part of the window that has been processed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    bins: usize,
    edges: usize,
    y_cos: f64,
    y_sin: f64,
    y_square: f64,
    samples: f64,
    u_cos: f64,
    u_sin: f64,
}

impl Sums {
    /// Does one slice; returns the fundamental after the last.
    #[inline(never)]
    pub(super) fn advance<const BINS: usize, const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        period_s: f64,
    ) -> Option<Fundamental> {
        let omega = TAU / period_s;
        let mut left = SLICE;
        for bin in window.bins().iter().skip(self.bins).take(left) {
            (self.bins, left) = (self.bins + 1, left - 1);
            if bin.count > 0 {
                self.add_bin(bin, omega, window.bin_s());
            }
        }
        while self.edges < window.edges().len() && left >= EDGE {
            self.add_edge(window, omega);
            (self.edges, left) = (self.edges + 1, left - EDGE);
        }
        let is_complete =
            self.bins == window.bins().len() && self.edges == window.edges().len() && left > 0;
        is_complete.then(|| self.fundamental(window.edges(), period_s))
    }

    fn add_bin(&mut self, bin: &Bin, omega: f64, bin_s: f64) {
        let count = f64::from(bin.count);
        let mean = bin.output_sum / count;
        let angle = omega * bin.time_sum_s / count;
        self.y_cos += mean * cos(angle) * bin_s;
        self.y_sin += mean * sin(angle) * bin_s;
        self.y_square += bin.output_sum * mean;
        self.samples += count;
    }

    /// Adds the integrals of `u cos` and `u sin` over the part of the window after the next edge.
    fn add_edge<const BINS: usize, const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        omega: f64,
    ) {
        let end_s = window.bins().len() as f64 * window.bin_s();
        let inside = |time_s: f64| (time_s - window.start_s()).clamp(0.0, end_s);
        let edges = window.edges();
        let edge = &edges[self.edges];
        let from = inside(edge.time_s);
        let to = (edges.get(self.edges + 1)).map_or(end_s, |next| inside(next.time_s));
        self.u_cos += edge.input * (sin(omega * to) - sin(omega * from)) / omega;
        self.u_sin += edge.input * (cos(omega * from) - cos(omega * to)) / omega;
    }

    fn fundamental(&self, edges: &[Edge], period_s: f64) -> Fundamental {
        let omega = TAU / period_s;
        let inputs = edges.iter().map(|edge| edge.input);
        let (low, high) = inputs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), input| {
            (low.min(input), high.max(input))
        });
        let lag = atan2(self.y_sin, self.y_cos) - atan2(self.u_sin, self.u_cos);
        let lag = lag - TAU * floor(lag / TAU);
        // |G| is below b / w^2 by less than a factor of two; b times the largest input is the bound.
        let magnitude =
            hypot(self.y_cos, self.y_sin) / hypot(self.u_cos, self.u_sin).max(f64::MIN_POSITIVE);
        Fundamental {
            period_s,
            // A process under a relay lags by pi - asin(beta), between a quarter and three quarters of a turn.
            // Any other value belongs to a negative gain.
            lag_rad: if lag < FRAC_PI_2 {
                lag + PI
            } else if lag > 3.0 * FRAC_PI_2 {
                lag - PI
            } else {
                lag
            },
            acceleration: 2.0 * magnitude * omega * omega * high.abs().max(low.abs()),
            relay_acceleration: magnitude * omega * omega * 0.5 * (high - low),
            rms: sqrt(self.y_square / f64::max(self.samples, 1.0)),
        }
    }
}

impl Fundamental {
    /// All zeros: memory before the first use.
    pub(super) const NONE: Self = Self {
        period_s: 0.0,
        lag_rad: 0.0,
        acceleration: 0.0,
        relay_acceleration: 0.0,
        rms: 0.0,
    };

    /// Start number `n`; the first [`STARTS`] are different. All have the phase lag of the fundamental.
    pub(super) fn start(&self, n: usize) -> Shape {
        let omega = TAU / self.period_s;
        let body_per_s = DAMPINGS[n / SHARES.len() % DAMPINGS.len()] / self.period_s;
        let share = SHARES[n % SHARES.len()];
        // Lag of actuator and delay after that of the body is subtracted; the actuator alone lags by less than a
        // quarter turn.
        let rest = (self.lag_rad - FRAC_PI_2 - atan(omega / body_per_s)).clamp(0.1, FRAC_PI_2);
        let actuator = (share * rest).min(MOST_ACTUATOR_RAD);
        let prop_per_s = omega / tan(actuator);
        let sum_per_s = prop_per_s + body_per_s;
        clamp(&[
            log(sum_per_s * self.period_s),
            prop_per_s * body_per_s / (sum_per_s * sum_per_s),
            (rest - actuator) / TAU,
        ])
    }
}
