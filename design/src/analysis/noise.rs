//! Noise at the actuator from white noise of the measurement.
//!
//! ```text
//! kappa^2 = h/pi int_0^(pi/h) |C F S|^2 dw,       std(u) = kappa std(measurement noise)
//! ```
//!
//! `h` is the sample period of the noise. Simpson's rule in `ln w`; relative error about 1e-5.

use std::f64::consts::PI;

use super::law::Law;
use super::open_loop::OpenLoop;
use super::process::Process;

/// Intervals of Simpson's rule.
const INTERVALS: usize = 400;

/// Lowest frequency of the rule, as a fraction of `pi/h`.
const LOWEST: f64 = 1e-7;

/// Standard deviation of `u` per standard deviation of the noise, in the unit of the gain of the process. `period` is the
/// sample period of the noise in the unit of time of the process.
pub(crate) fn amplification(process: &Process, law: &Law, period: f64) -> f64 {
    let open_loop = OpenLoop::new(process, law);
    let (numerator, denominator) = law.transfer();
    let highest = PI / period;
    let step = -LOWEST.ln() / INTERVALS as f64;
    let mut omega = highest * LOWEST;
    let ratio = step.exp();
    let mut sum = 0.0;
    for i in 0..=INTERVALS {
        let path = numerator.at(omega) / denominator.at(omega);
        let filters = process.sensors.iter().flatten();
        let sensor: f64 =
            (filters.map(|filter| filter.frequency_response(omega).norm_sqr())).product();
        let noise = path.norm_sqr() * sensor / (1.0 + open_loop.at(omega)).norm_sqr();
        let weight = match i {
            0 | INTERVALS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        };
        sum += weight * noise * omega;
        omega *= ratio;
    }
    (period / PI * sum * step / 3.0).sqrt()
}
