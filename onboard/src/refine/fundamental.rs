//! What the fundamentals of input and output tell before any fit: where to start.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use libm::{atan, atan2, cos, floor, hypot, log, sin, sqrt, tan};

use super::domain::{Shape, clamp};
use crate::window::Window;

/// Number of starts.
pub(super) const STARTS: usize = 12;
/// Damping rates of the starts, in 1/period: from next to none to a body faster than the relay.
const DAMPINGS: [f64; 4] = [0.05, 0.5, 2.0, 5.0];
/// Parts of the lag left beside the body's that the actuator takes; the delay takes the rest.
const SHARES: [f64; 3] = [0.15, 0.5, 0.85];

/// Largest lag of the actuator in the starts (rad).
const MOST_ACTUATOR_RAD: f64 = 1.4;

/// The oscillation at its fundamental frequency.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fundamental {
    period_s: f64,
    /// Lag of the process (rad).
    lag_rad: f64,
    /// Bound of the acceleration that the input can produce (output unit / s^2).
    pub(super) acceleration: f64,
    /// What half the range of the input accelerates the process by, from below (output unit / s^2).
    pub(super) relay_acceleration: f64,
    /// Root mean square of the output about its first value (output unit).
    pub(super) rms: f64,
}

impl Fundamental {
    pub(super) fn of<const BINS: usize, const EDGES: usize>(
        window: &Window<BINS, EDGES>,
        period_s: f64,
    ) -> Self {
        let omega = TAU / period_s;
        let (mut y_cos, mut y_sin, mut y_square, mut samples) = (0.0, 0.0, 0.0, 0.0);
        for bin in window.bins().iter().filter(|bin| bin.count > 0) {
            let count = f64::from(bin.count);
            let mean = bin.output_sum / count;
            let angle = omega * bin.time_sum_s / count;
            y_cos += mean * cos(angle) * window.bin_s();
            y_sin += mean * sin(angle) * window.bin_s();
            y_square += bin.output_sum * mean;
            samples += count;
        }
        let (u_cos, u_sin) = input_fundamental(window, omega);
        let inputs = window.edges().iter().map(|edge| edge.input);
        let (low, high) = inputs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), input| {
            (low.min(input), high.max(input))
        });
        let lag = atan2(y_sin, y_cos) - atan2(u_sin, u_cos);
        let lag = lag - TAU * floor(lag / TAU);
        // |G| is less than b / w^2, by less than two; the largest input takes b to the bound.
        let magnitude = hypot(y_cos, y_sin) / hypot(u_cos, u_sin).max(f64::MIN_POSITIVE);
        Self {
            period_s,
            // Under a relay a process lags by one to three quarters of a turn: `pi - asin(beta)`.
            // Anything else is the lag of one whose gain is negative.
            lag_rad: if lag < FRAC_PI_2 {
                lag + PI
            } else if lag > 3.0 * FRAC_PI_2 {
                lag - PI
            } else {
                lag
            },
            acceleration: 2.0 * magnitude * omega * omega * high.abs().max(low.abs()),
            relay_acceleration: magnitude * omega * omega * 0.5 * (high - low),
            rms: sqrt(y_square / f64::max(samples, 1.0)),
        }
    }

    /// Starts on the surface of processes that have the lag seen at the fundamental.
    pub(super) fn starts(&self) -> [Shape; STARTS] {
        let omega = TAU / self.period_s;
        core::array::from_fn(|n| {
            let body_per_s = DAMPINGS[n / SHARES.len()] / self.period_s;
            let share = SHARES[n % SHARES.len()];
            // What is left for actuator and delay once the body has taken its part; the actuator
            // alone lags by less than a quarter turn.
            let rest = (self.lag_rad - FRAC_PI_2 - atan(omega / body_per_s)).clamp(0.1, FRAC_PI_2);
            let actuator = (share * rest).min(MOST_ACTUATOR_RAD);
            let prop_per_s = omega / tan(actuator);
            let sum_per_s = prop_per_s + body_per_s;
            clamp(&[
                log(sum_per_s * self.period_s),
                prop_per_s * body_per_s / (sum_per_s * sum_per_s),
                (rest - actuator) / TAU,
            ])
        })
    }
}

/// Integrals of `u cos` and `u sin` over the window, piece by piece.
fn input_fundamental<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    omega: f64,
) -> (f64, f64) {
    let end_s = window.bins().len() as f64 * window.bin_s();
    let inside = |time_s: f64| (time_s - window.start_s()).clamp(0.0, end_s);
    let edges = window.edges();
    let (mut u_cos, mut u_sin) = (0.0, 0.0);
    for (k, edge) in edges.iter().enumerate() {
        let from = inside(edge.time_s);
        let to = edges.get(k + 1).map_or(end_s, |next| inside(next.time_s));
        u_cos += edge.input * (sin(omega * to) - sin(omega * from)) / omega;
        u_sin += edge.input * (cos(omega * from) - cos(omega * to)) / omega;
    }
    (u_cos, u_sin)
}
