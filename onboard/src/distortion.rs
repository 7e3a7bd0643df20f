//! The even part of an actuator's force: what a quadratic actuator adds.
//!
//! A propeller's thrust is quadratic in its speed, and it is the speed that lags. Around hover, with
//! the lagged input `x` scaled to the relay's levels at +1 and -1, the force is `b h (x + c x^2)`;
//! a relay of a tenth of hover has `c = 0.025`. Under a symmetric relay the second term shows at
//! even harmonics only and does no harm; under a biased one it would be taken for lag and gain.
//!
//! Between edges `x` is an exponential, so `x^2` is averaged over each bin exactly; that average is
//! taken as constant over the bin, which is off by a thousandth of a term that is itself small.
//!
//! Which of the two lags is the actuator's, and gets squared, has no smooth answer where they meet:
//! the poles used here are the series of the true ones in the pole ratio, good to 1 % until one lag
//! is less than four times the other, and smooth all the way.

use libm::exp;

use crate::process::Process;
use crate::response::Grid;
use crate::transition::Transition;
use crate::window::Edge;

/// Poles of actuator and body (1/s): of `sum (1 +- sqrt(1 - 4 ratio)) / 2`, the terms to the third.
fn smooth_poles(process: &Process) -> (f64, f64) {
    let (sum, ratio) = process.pole_sum();
    let body = ratio + ratio * ratio + 2.0 * ratio * ratio * ratio;
    (sum * (1.0 - body), sum * body)
}

/// The mean square of the lagged input, bin by bin, from the beginning of the past on.
struct Squares<'a> {
    later: &'a [Edge],
    /// Middle and half range of the input's levels.
    middle: f64,
    half: f64,
    rate_per_s: f64,
    tau_s: f64,
    bin_s: f64,
    bin_decay: f64,
    begin_s: f64,
    level: f64,
    lagged: f64,
}

impl<'a> Squares<'a> {
    /// `None` for an input of a single level.
    fn new(process: &Process, grid: &Grid, edges: &'a [Edge]) -> Option<Self> {
        let (first, later) = edges.split_first()?;
        let (low, high) = edges
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), e| {
                (low.min(e.input), high.max(e.input))
            });
        let half = 0.5 * (high - low);
        if half <= 0.0 {
            return None;
        }
        let middle = 0.5 * (high + low);
        let bin_s = f64::from(grid.per_bin) * grid.sample_s;
        let (rate_per_s, _) = smooth_poles(process);
        let level = (first.input - middle) / half;
        Some(Self {
            later,
            middle,
            half,
            rate_per_s,
            tau_s: process.tau_s(),
            bin_s,
            bin_decay: exp(-rate_per_s * bin_s),
            begin_s: grid.start_s - grid.past_bins as f64 * bin_s,
            level,
            lagged: level,
        })
    }

    /// Integral of `x^2` over a stretch of constant input, in units of the lag; `x` moves on.
    fn stretch(&mut self, duration_s: f64, decay: f64) -> f64 {
        let off = self.lagged - self.level;
        let square = self.level * self.level * duration_s * self.rate_per_s
            + 2.0 * self.level * off * (1.0 - decay)
            + 0.5 * off * off * (1.0 - decay * decay);
        self.lagged = self.level + off * decay;
        square
    }

    /// Mean of `x^2` over the next bin.
    fn next_mean(&mut self) -> f64 {
        let (mut from_s, mut sum) = (0.0, 0.0);
        while let Some((edge, later)) = self.later.split_first() {
            let at_s = (edge.time_s + self.tau_s - self.begin_s).max(0.0);
            if at_s >= self.bin_s {
                break;
            }
            sum += self.stretch(at_s - from_s, exp(-self.rate_per_s * (at_s - from_s)));
            (self.level, from_s) = ((edge.input - self.middle) / self.half, at_s);
            self.later = later;
        }
        let rest_s = self.bin_s - from_s;
        let decay = if from_s > 0.0 {
            exp(-self.rate_per_s * rest_s)
        } else {
            self.bin_decay
        };
        sum += self.stretch(rest_s, decay);
        self.begin_s += self.bin_s;
        sum / (self.rate_per_s * self.bin_s)
    }
}

/// Mean outputs over the bins of the window when the force is `x^2` less its mean there; zero for an
/// input of a single level.
pub(crate) fn means(process: &Process, grid: &Grid, edges: &[Edge], means: &mut [f64]) {
    means.fill(0.0);
    let Some(mut squares) = Squares::new(process, grid, edges) else {
        return;
    };
    for _ in 0..grid.past_bins {
        squares.next_mean();
    }
    let total: f64 = means.iter().map(|_| squares.next_mean()).sum();
    let mean_square = total / means.len() as f64;

    let Some(mut squares) = Squares::new(process, grid, edges) else {
        return;
    };
    // Without decay of the force a bin's transition is that under a constant force.
    let (_, damping_per_s) = smooth_poles(process);
    let body = Transition::of_poles(damping_per_s, 0.0, squares.bin_s);
    // The samples of a bin begin with it: their mean time lies before its middle.
    let instants = f64::from(grid.per_bin);
    let centre = 0.5 * (instants - 1.0) / instants;
    let (mut y, mut v) = (0.0, 0.0);
    for index in 0..grid.past_bins + means.len() {
        let force = squares.next_mean() - mean_square;
        let next_y = y + body.y_v * v + body.y_f * force;
        if let Some(k) = index.checked_sub(grid.past_bins) {
            means[k] = y + centre * (next_y - y);
        }
        (y, v) = (next_y, body.v_v * v + body.v_f * force);
    }
}
