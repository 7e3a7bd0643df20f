//! Sensitivity peaks and margins of a given loop.
//!
//! ```text
//! Ms = max |S(jw)|,   S = 1/(1 + L),      Mt = max |T(jw)|,   T = L/(1 + L)
//! ```
//!
//! `1/Ms` is the distance of the Nyquist plot from -1. It follows that the phase margin is at least `2 asin(1/(2 Ms))` and
//! the gain margin at least `Ms/(Ms - 1)`.
//!
//! The peaks are local maxima on a grid of frequencies, refined to rounding.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use crate::roots::{minimum, root};
use crate::soiptd_pd::margins::Margins;

use super::open_loop::OpenLoop;

/// Peaks below this share of the highest one on the grid are not refined.
const WORTH_REFINING: f64 = 0.9;

/// Tolerance of the frequency of a peak, as a fraction: its value is then exact to rounding.
const PEAK_TOLERANCE: f64 = 1e-9;

/// The grid ends where `|L|` is below this for good. A gain margin above 1000 is not looked for, nor a peak below 1.001.
const LEAST: f64 = 1e-3;

/// Peaks of sensitivity and complementary sensitivity of a stable loop.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Sensitivity {
    /// Maximum sensitivity `Ms`: largest `|1/(1 + L)|`.
    pub ms: f64,
    /// Frequency of `Ms` (rad/s).
    pub ms_rad_per_s: f64,
    /// Maximum complementary sensitivity `Mt`: largest `|L/(1 + L)|`.
    pub mt: f64,
    /// Frequency of `Mt` (rad/s). Zero if the largest value is the one at frequency zero.
    pub mt_rad_per_s: f64,
}

/// Loop on its grid of frequencies.
pub(crate) struct Curve<'a> {
    open_loop: &'a OpenLoop,
    points: Vec<(f64, Complex64)>,
}

impl<'a> Curve<'a> {
    /// `None` if the loop has no finite frequencies of interest.
    pub(crate) fn new(open_loop: &'a OpenLoop) -> Option<Self> {
        let (first, last) = open_loop.range()?;
        let points = open_loop.walk(first, open_loop.end([first, last], LEAST))?;
        Some(Self { open_loop, points })
    }

    /// Largest value of `size(L)` and its frequency.
    fn peak(&self, size: impl Fn(Complex64) -> f64) -> (f64, f64) {
        let values: Vec<f64> = self.points.iter().map(|point| size(point.1)).collect();
        let coarse = values.iter().copied().fold(0.0, f64::max);
        let mut best = (0.0, 0.0);
        for i in 0..values.len() {
            let before = values[i.saturating_sub(1)];
            let after = values[(i + 1).min(values.len() - 1)];
            if values[i] < WORTH_REFINING * coarse || values[i] < before || values[i] < after {
                continue;
            }
            let ends = [i.saturating_sub(1), (i + 1).min(values.len() - 1)];
            let [low, high] = ends.map(|end| self.points[end].0.ln());
            let negative = |ln: f64| -size(self.open_loop.at(ln.exp()));
            let (ln, least) = minimum(negative, low, high, PEAK_TOLERANCE);
            let refined = if -least > values[i] {
                (-least, ln.exp())
            } else {
                (values[i], self.points[i].0)
            };
            if refined.0 > best.0 {
                best = refined;
            }
        }
        best
    }

    /// Peaks of the loop, which must be stable. `unit_s` is the unit of time of the loop.
    pub(crate) fn sensitivity(&self, unit_s: f64) -> Sensitivity {
        let (ms, ms_omega) = self.peak(|value| 1.0 / (1.0 + value).norm());
        let (mt, mt_omega) = self.peak(|value| (value / (1.0 + value)).norm());
        let n = self.open_loop.numerator.constant();
        let d = self.open_loop.denominator.constant();
        let at_zero = (n / (n + d)).abs();
        let is_zero = at_zero >= mt * (1.0 - 1e-9);
        Sensitivity {
            ms: ms.max((d / (n + d)).abs()),
            ms_rad_per_s: ms_omega / unit_s,
            mt: mt.max(at_zero),
            mt_rad_per_s: if is_zero { 0.0 } else { mt_omega / unit_s },
        }
    }

    /// Margins of the loop, which must be stable. `unit_s` is the unit of time of the loop.
    pub(crate) fn margins(&self, unit_s: f64) -> Margins {
        let mut found = Margins {
            phase_margin_rad: PI,
            gain_crossover_rad_per_s: 0.0,
            gain_margin: None,
            phase_crossover_rad_per_s: None,
            delay_margin_s: f64::INFINITY,
        };
        for pair in self.points.windows(2) {
            let ((low, before), (high, after)) = (pair[0], pair[1]);
            if (before.norm() > 1.0) != (after.norm() > 1.0) {
                let excess = |omega: f64| self.open_loop.at(omega).norm().ln();
                let omega = root(excess, low, high, 0.0);
                let above_rad = (self.open_loop.at(omega).arg() + PI).rem_euclid(TAU);
                found.delay_margin_s = found.delay_margin_s.min(above_rad / omega * unit_s);
                let margin_rad = above_rad.min(TAU - above_rad);
                if margin_rad < found.phase_margin_rad {
                    found.phase_margin_rad = margin_rad;
                    found.gain_crossover_rad_per_s = omega / unit_s;
                }
            }
            if before.im < 0.0 && after.im >= 0.0 && before.re.min(after.re) < 0.0 {
                let omega = root(|omega| self.open_loop.at(omega).im, low, high, 0.0);
                let gain_margin = 1.0 / self.open_loop.at(omega).norm();
                let is_real = self.open_loop.at(omega).re < 0.0;
                let least = found.gain_margin.unwrap_or(f64::INFINITY);
                if is_real && gain_margin > 1.0 && gain_margin < least {
                    found.gain_margin = Some(gain_margin);
                    found.phase_crossover_rad_per_s = Some(omega / unit_s);
                }
            }
        }
        found
    }
}
