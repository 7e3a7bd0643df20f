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
    // Without decay of the force a bin's transition is that under a constant force.
    let (_, damping_per_s) = smooth_poles(process);
    let body = Transition::of_poles(damping_per_s, 0.0, squares.bin_s);
    // The samples of a bin begin with it: their mean time lies before its middle.
    let instants = f64::from(grid.per_bin);
    let centre = 0.5 * (instants - 1.0) / instants;
    let mut respond = |force: &mut dyn FnMut(bool) -> f64, sign: f64| {
        let (mut y, mut v) = (0.0, 0.0);
        for index in 0..grid.past_bins + means.len() {
            let in_window = index >= grid.past_bins;
            let force = force(in_window);
            let next_y = y + body.y_v * v + body.y_f * force;
            if in_window {
                means[index - grid.past_bins] += sign * (y + centre * (next_y - y));
            }
            (y, v) = (next_y, body.v_v * v + body.v_f * force);
        }
    };
    let (mut total, mut bins) = (0.0, 0.0);
    let mut square = |in_window: bool| {
        let mean = squares.next_mean();
        if in_window {
            (total, bins) = (total + mean, bins + 1.0);
        }
        mean
    };
    respond(&mut square, 1.0);
    let mean_square = total / f64::max(bins, 1.0);
    respond(&mut |_| mean_square, -1.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1e-5;

    fn grid() -> Grid {
        Grid {
            sample_s: 1e-3,
            per_bin: 10,
            past_bins: 20,
            start_s: 0.2,
        }
    }

    /// A wave of 0.3 s high and 0.2 s low, about 1 with half a range of 2.
    fn edges() -> [Edge; 8] {
        core::array::from_fn(|k| Edge {
            time_s: 0.25 * k as f64 + 0.025 * (k % 2) as f64,
            input: if k % 2 == 0 { 3.0 } else { -1.0 },
        })
    }

    // By brute force: steps of 10 us of the lag, the square and the body; then the mean over the
    // window taken from the force by superposition. The bins' averages are off by a thousandth.
    #[test]
    fn agrees_with_small_steps() {
        let process = Process::from_acceleration_gain(1.0, 0.05, 0.5, 0.02).unwrap();
        let (grid, edges) = (grid(), edges());
        let mut found = [0.0; 100];
        means(&process, &grid, &edges, &mut found);

        let level = |time_s: f64| {
            let past = edges.iter().rfind(|edge| edge.time_s + 0.02 <= time_s);
            (past.unwrap_or(&edges[0]).input - 1.0) / 2.0
        };
        let steps = |bins: usize| (bins as f64 * 0.01 / STEP_S) as usize;
        let (mut x, mut total) = (level(0.0), 0.0);
        let mut squares = [0.0; 120_000];
        for (n, square) in squares[..steps(120)].iter_mut().enumerate() {
            *square = x * x;
            if n >= steps(20) {
                total += x * x;
            }
            x += (level(n as f64 * STEP_S) - x) / 0.05 * STEP_S;
        }
        let mean_square = total / steps(100) as f64;
        let (mut y, mut v) = (0.0, 0.0);
        let mut expected = [0.0; 100];
        for (n, square) in squares[..steps(120)].iter().enumerate() {
            // Samples stand at whole milliseconds.
            if n >= steps(20) && n % 100 == 0 {
                expected[(n - steps(20)) / 1000] += 0.1 * y;
            }
            y += v * STEP_S;
            v += (square - mean_square - 0.5 * v) * STEP_S;
        }
        let size = expected.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 2e-3 * size, "{found} {expected}");
        }
    }

    #[test]
    fn a_single_level_has_none() {
        let process = Process::from_acceleration_gain(1.0, 0.05, 0.5, 0.02).unwrap();
        let mut found = [1.0; 10];
        means(&process, &grid(), &edges()[..1], &mut found);
        assert_eq!(found, [0.0; 10]);
    }

    // Equal lags: 1 - (1/4 + 1/16 + 1/32) of the sum; far apart: the lags' own poles.
    #[test]
    fn poles_are_those_of_the_lags_far_apart() {
        let process = Process::from_acceleration_gain(1.0, 0.05, 0.5, 0.0).unwrap();
        let (fast, slow) = smooth_poles(&process);
        // The next term of the series is 5 ratio^4 = 1.6e-6 of the sum.
        assert!(
            (fast - 20.0).abs() < 4e-5 && (slow - 0.5).abs() < 4e-5,
            "{fast} {slow}"
        );
        let equal = Process::from_acceleration_gain(1.0, 0.1, 10.0, 0.0).unwrap();
        assert!((smooth_poles(&equal).0 - 20.0 * 0.65625).abs() < 1e-12);
    }
}
