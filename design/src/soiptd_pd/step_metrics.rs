//! Overshoot, rise time, settling time and peak input of a step response.
//!
//! Output, rate and acceleration are known at the nodes of the time grid. Between nodes the output is the Hermite
//! quintic, the input the Hermite cubic. Level crossings and extrema are roots of the interpolant or of its slope.

use crate::roots::root;
use crate::soiptd_pd::feedback::Feedback;
use crate::soiptd_pd::propagation::{Cubic, State};

/// Half width of the settling band, as a fraction of the step: the common 2 %.
const SETTLING_BAND: f64 = 0.02;

/// Outputs at which the rise time starts and ends: the common 10 % and 90 %.
const RISE: (f64, f64) = (0.1, 0.9);

/// Tolerance of times, as a fraction of a simulation step.
const TOLERANCE: f64 = 1e-12;

/// Characteristics of a unit-step response. Times count from the step of the reference, so they include the dead time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StepMetrics {
    /// Largest output above the reference, as a fraction of the step. Zero if the output never exceeds the reference.
    pub overshoot: f64,
    /// Time of the largest output (s). `None` if the output never exceeds the reference.
    pub peak_time_s: Option<f64>,
    /// Rise time from 10 % to 90 % of the step (s).
    pub rise_time_s: f64,
    /// Time after which the output stays within 2 % of the reference (s).
    pub settling_time_s: f64,
    /// Largest magnitude of the controller output (input unit).
    pub peak_input: f64,
}

/// Characteristics of a response whose nodes start at `start_s` and lie `step_s` apart. `input_unit` (positive)
/// converts the output of `feedback` to input units.
pub(crate) fn metrics(
    states: &[State],
    feedback: &Feedback,
    start_s: f64,
    step_s: f64,
    input_unit: f64,
) -> StepMetrics {
    let cells: Vec<Quintic> = states
        .windows(2)
        .map(|ends| Quintic::between(&ends[0], &ends[1], feedback))
        .collect();
    let time_s = |n: usize, s: f64| start_s + step_s * (n as f64 + s);
    let crossing_s = |n: usize, excess: &dyn Fn(f64) -> f64| {
        time_s(n, root(|s| excess(cells[n].at(s)), 0.0, 1.0, TOLERANCE))
    };
    let rise_s = |level: f64| {
        let crossed = cells.iter().position(|cell| cell.end >= level);
        crossed.map_or(start_s, |n| crossing_s(n, &|y| y - level))
    };
    let beyond_band = |y: f64| (1.0 - y).abs() - SETTLING_BAND;
    let unsettled = cells.iter().rposition(|cell| beyond_band(cell.start) > 0.0);
    let (peak_cell, peak_s, peak) = peak(&cells);
    StepMetrics {
        overshoot: (peak - 1.0).max(0.0),
        peak_time_s: (peak > 1.0).then(|| time_s(peak_cell, peak_s)),
        rise_time_s: rise_s(RISE.1) - rise_s(RISE.0),
        settling_time_s: unsettled.map_or(start_s, |n| crossing_s(n, &beyond_band)),
        peak_input: input_unit * peak_input(states, feedback),
    }
}

/// Largest local maximum: index of its cell, position as a fraction of the cell, output. All zero if there is none.
fn peak(cells: &[Quintic]) -> (usize, f64, f64) {
    cells
        .iter()
        .enumerate()
        .filter(|(_, cell)| cell.slope_at(0.0) > 0.0 && cell.slope_at(1.0) <= 0.0)
        .map(|(n, cell)| {
            let s = root(|s| cell.slope_at(s), 0.0, 1.0, TOLERANCE);
            (n, s, cell.at(s))
        })
        .fold(
            (0, 0.0, 0.0),
            |best, new| if new.2 > best.2 { new } else { best },
        )
}

/// Largest magnitude of the output of `feedback`, in its unit.
fn peak_input(states: &[State], feedback: &Feedback) -> f64 {
    let rest = feedback.node(&[0.0; 3]).value.abs();
    states.windows(2).fold(rest, |largest, ends| {
        let (start, end) = (feedback.node(&ends[0]), feedback.node(&ends[1]));
        let turn = if start.slope * end.slope < 0.0 {
            let cubic = Cubic::hermite(start, end);
            cubic
                .at(root(|s| cubic.slope_at(s), 0.0, 1.0, TOLERANCE))
                .abs()
        } else {
            0.0
        };
        largest.max(end.value.abs()).max(turn)
    })
}

/// Output between two nodes: Hermite quintic, in units of the simulation step.
#[derive(Clone, Copy, Debug)]
struct Quintic {
    start: f64,
    end: f64,
    /// Coefficients of `s` to `s^5`.
    rise: [f64; 5],
}

impl Quintic {
    fn between(start: &State, end: &State, feedback: &Feedback) -> Self {
        let (y, v) = (end[0] - start[0], (start[1], end[1]));
        let a = (feedback.acceleration(start), feedback.acceleration(end));
        let rise = [
            v.0,
            0.5 * a.0,
            10.0 * y - 6.0 * v.0 - 4.0 * v.1 - 1.5 * a.0 + 0.5 * a.1,
            -15.0 * y + 8.0 * v.0 + 7.0 * v.1 + 1.5 * a.0 - a.1,
            6.0 * y - 3.0 * (v.0 + v.1) - 0.5 * (a.0 - a.1),
        ];
        Self {
            start: start[0],
            end: end[0],
            rise,
        }
    }

    fn at(&self, s: f64) -> f64 {
        self.start + s * self.rise.iter().rev().fold(0.0, |sum, c| sum * s + c)
    }

    fn slope_at(&self, s: f64) -> f64 {
        let [c1, c2, c3, c4, c5] = self.rise;
        c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // s^5 - s has the value 0.3^5 - 0.3 = -0.29757 and the slope 5 * 0.0081 - 1 = -0.9595 at 0.3. Without damping the
    // acceleration equals the force, so the states are (y, y', y'') at 0 and 1.
    #[test]
    fn quintic_is_exact_for_a_quintic() {
        let undamped = Feedback::new(1.0, 1.0, 0.0);
        let quintic = Quintic::between(&[0.0, -1.0, 0.0], &[0.0, 4.0, 20.0], &undamped);
        assert!(
            (quintic.at(0.3) + 0.297_57).abs() < 1e-14,
            "{}",
            quintic.at(0.3)
        );
        assert!(
            (quintic.slope_at(0.3) + 0.9595).abs() < 1e-14,
            "{}",
            quintic.slope_at(0.3)
        );
    }
}
