//! Even part of the actuator's force: the effect of a quadratic actuator.
//!
//! ```text
//! force = b h (x + c x^2),   T_prop dx/dt = u/h - x
//! ```
//!
//! The thrust of a propeller is quadratic in its speed, and it is the speed that lags. `x` is the lagged input
//! in units of the relay's amplitude `h`, +1 and -1 at its levels; `b` is the acceleration gain. A relay of a
//! tenth of hover has `c = 0.025`. Under a symmetric relay the second term appears at even harmonics only and
//! does no harm. Under a biased relay it would be mistaken for lag and gain.
//!
//! Between edges `x` is an exponential, so the average of `x^2` over a bin is exact. It is then taken as
//! constant over the bin, with an error of a thousandth of a term that is small itself.
//!
//! Which of the two lags belongs to the actuator is not a smooth choice where they are equal. The poles used
//! here are a series of the true ones in the pole ratio: accurate to 1 % if one lag is at least four times the
//! other, and smooth everywhere.

use libm::exp;

use crate::process::Soiptd;
use crate::response::Grid;
use crate::transition::Transition;
use crate::window::Edge;

/// Poles of actuator and body (1/s): `sum (1 +- sqrt(1 - 4 ratio)) / 2` as a series to third order.
fn smooth_poles(process: &Soiptd) -> (f64, f64) {
    let (sum, ratio) = process.pole_sum();
    let body = ratio + ratio * ratio + 2.0 * ratio * ratio * ratio;
    (sum * (1.0 - body), sum * body)
}

/// Mean square of the lagged input, bin by bin, from the beginning of the past.
#[derive(Clone, Copy, Debug)]
struct Squares {
    /// Next edge.
    edge: usize,
    /// Middle and half range of the input's levels (input unit).
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

impl Squares {
    /// `None` if the input has a single level.
    fn new(process: &Soiptd, grid: &Grid, edges: &[Edge]) -> Option<Self> {
        let first = edges.first()?;
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
            edge: 1,
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

    /// Integral of `x^2` over a stretch of constant input, times the rate of the lag; `x` advances.
    fn stretch(&mut self, duration_s: f64, decay: f64) -> f64 {
        let off = self.lagged - self.level;
        let square = self.level * self.level * duration_s * self.rate_per_s
            + 2.0 * self.level * off * (1.0 - decay)
            + 0.5 * off * off * (1.0 - decay * decay);
        self.lagged = self.level + off * decay;
        square
    }

    /// Mean of `x^2` over the next bin.
    fn next_mean(&mut self, edges: &[Edge]) -> f64 {
        let (mut from_s, mut sum) = (0.0, 0.0);
        while let Some(edge) = edges.get(self.edge) {
            let at_s = (edge.time_s + self.tau_s - self.begin_s).max(0.0);
            if at_s >= self.bin_s {
                break;
            }
            sum += self.stretch(at_s - from_s, exp(-self.rate_per_s * (at_s - from_s)));
            (self.level, from_s) = ((edge.input - self.middle) / self.half, at_s);
            self.edge += 1;
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

/// Bins per slice: 45 operations each. See the table in `refine`.
pub(crate) const SLICE_BINS: usize = 32;
/// Cost of an edge in bins: two exponentials.
const EDGE_BINS: usize = 3;

/// Mean outputs over the bins of the window when the force is `x^2` minus its mean there, some bins per slice:
/// first the response to `x^2`, then the response to its mean is subtracted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DistortionCourse {
    /// `None` if the input has a single level.
    squares: Option<Squares>,
    body: Body,
    past_bins: usize,
    /// Next bin, from the beginning of the past.
    index: usize,
    /// Sum of `x^2` over the bins of the window.
    total: f64,
    /// Its mean, once known.
    mean: Option<f64>,
}

/// The body under a force that is constant over each bin.
#[derive(Clone, Copy, Debug)]
struct Body {
    step: Transition,
    /// Position of the mean sample time within its bin: before the middle, because samples begin with the bin.
    centre: f64,
    y: f64,
    v: f64,
}

impl Body {
    /// Mean output over the next bin.
    #[inline]
    fn next_mean(&mut self, force: f64) -> f64 {
        let next_y = self.y + self.step.y_v * self.v + self.step.y_f * force;
        let mean = self.y + self.centre * (next_y - self.y);
        self.v = self.step.v_v * self.v + self.step.v_f * force;
        self.y = next_y;
        mean
    }
}

impl DistortionCourse {
    /// Progress at the beginning of the past.
    pub(crate) fn new(process: &Soiptd, grid: &Grid, edges: &[Edge]) -> Self {
        let (_, damping_per_s) = smooth_poles(process);
        let instants = f64::from(grid.per_bin);
        Self {
            squares: Squares::new(process, grid, edges),
            body: Body {
                // Without decay of the force the transition of a bin is that under a constant force.
                step: Transition::of_poles(damping_per_s, 0.0, instants * grid.sample_s),
                centre: 0.5 * (instants - 1.0) / instants,
                y: 0.0,
                v: 0.0,
            },
            past_bins: grid.past_bins,
            index: 0,
            total: 0.0,
            mean: None,
        }
    }

    /// Computes the next [`SLICE_BINS`] bins. True when the means are complete; they are zero for an input with
    /// a single level.
    pub(crate) fn follow(&mut self, edges: &[Edge], means: &mut [f64]) -> bool {
        let bins = self.past_bins + means.len();
        match (self.squares, self.mean) {
            (None, _) => {
                means.fill(0.0);
                true
            }
            (Some(squares), None) => {
                self.follow_squares(squares, edges, means);
                if self.index == bins {
                    self.mean = Some(self.total / f64::max(means.len() as f64, 1.0));
                    (self.index, self.body.y, self.body.v) = (0, 0.0, 0.0);
                }
                false
            }
            (_, Some(mean)) => {
                let mut body = self.body;
                let end = bins.min(self.index + SLICE_BINS);
                for index in self.index..end {
                    let even = body.next_mean(mean);
                    if let Some(k) = index.checked_sub(self.past_bins) {
                        means[k] -= even;
                    }
                }
                (self.body, self.index) = (body, end);
                end == bins
            }
        }
    }

    fn follow_squares(&mut self, mut squares: Squares, edges: &[Edge], means: &mut [f64]) {
        let (mut body, mut index, mut total) = (self.body, self.index, self.total);
        let (past_bins, mut left) = (self.past_bins, SLICE_BINS);
        while index < past_bins + means.len() && left > 0 {
            let edge = squares.edge;
            let square = squares.next_mean(edges);
            left = left.saturating_sub(1 + EDGE_BINS * (squares.edge - edge));
            let even = body.next_mean(square);
            if let Some(k) = index.checked_sub(past_bins) {
                means[k] = even;
                total += square;
            }
            index += 1;
        }
        (self.body, self.index, self.total) = (body, index, total);
        self.squares = Some(squares);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1e-5;

    fn follow(process: &Soiptd, edges: &[Edge], means: &mut [f64]) {
        let mut course = DistortionCourse::new(process, &grid(), edges);
        let (mut calls, mut before) = (1, 0);
        while !course.follow(edges, means) {
            let bins = course.index.saturating_sub(before);
            assert!(bins <= SLICE_BINS, "{bins}");
            (calls, before) = (calls + 1, course.index);
        }
        // Twice the number of bins, and three more for each edge in the first pass.
        let bins = grid().past_bins + means.len();
        let most = 2 * bins.div_ceil(SLICE_BINS) + EDGE_BINS * edges.len() / SLICE_BINS + 1;
        assert!(calls <= most, "{calls} of {most}");
    }

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

    // By brute force: steps of 10 us for lag, square and body; then the mean over the window is removed from the
    // force by superposition. The averages over bins are off by a thousandth.
    #[test]
    fn agrees_with_small_steps() {
        let process = Soiptd::from_acceleration_gain(1.0, 0.05, 0.5, 0.02).unwrap();
        let edges = edges();
        let mut found = [0.0; 100];
        follow(&process, &edges, &mut found);

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
            // Samples are at whole milliseconds.
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
        let process = Soiptd::from_acceleration_gain(1.0, 0.05, 0.5, 0.02).unwrap();
        let mut found = [1.0; 10];
        follow(&process, &edges()[..1], &mut found);
        assert_eq!(found, [0.0; 10]);
    }

    // Equal lags: 1 - (1/4 + 1/16 + 1/32) of the sum; lags far apart: their own poles.
    #[test]
    fn poles_are_those_of_the_lags_far_apart() {
        let process = Soiptd::from_acceleration_gain(1.0, 0.05, 0.5, 0.0).unwrap();
        let (fast, slow) = smooth_poles(&process);
        // The next term of the series is 5 ratio^4 = 1.6e-6 of the sum.
        assert!(
            (fast - 20.0).abs() < 4e-5 && (slow - 0.5).abs() < 4e-5,
            "{fast} {slow}"
        );
        let equal = Soiptd::from_acceleration_gain(1.0, 0.1, 10.0, 0.0).unwrap();
        assert!((smooth_poles(&equal).0 - 20.0 * 0.65625).abs() < 1e-12);
    }
}
