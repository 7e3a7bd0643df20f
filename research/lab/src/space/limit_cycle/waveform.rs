//! The exact periodic response of a process to a rectangular wave.
//!
//! The relay's output is high from `0` to `high_s` and low from there to the period; its edges reach
//! the process `tau` later. Between edges and window ends the input is constant, so there are at most
//! four pieces, each with a start state and a [`Transition`]. With the acceleration gain one,
//!
//! ```text
//! f(t) = w + (f0 - w) e^(-p t)                       w the input, p = 1/T_prop, a = 1/T_body
//! v(t) = v0 e^(-a t) + w E(a, 0) + (f0 - w) E(a, p),   E(x, y) = (e^(-y t) - e^(-x t)) / (x - y)
//! ```
//!
//! One division makes the force periodic. The rate follows from the output returning to its value,
//! which works for a double integrator too. The output itself is free by a constant, here zero at the
//! start.

use onecycle_onboard::Soiptd;
use onecycle_onboard::transition::{State, Transition};

use onecycle_design::roots::root;

/// Precision of a turning point, over the length of its piece: the output is flat there, so its error
/// is the square of this.
const TURN_TOLERANCE: f64 = 1e-9;

/// Precision of the extremum of the rate, which only has to lie between two turning points.
const BEND_TOLERANCE: f64 = 1e-3;

/// A rectangular wave and the process's periodic response to it.
#[derive(Clone, Debug)]
pub(super) struct Waveform {
    /// `1/T_body` and `1/T_prop` (1/s).
    pub(super) body: f64,
    pub(super) prop: f64,
    pub(super) high_s: f64,
    pub(super) period_s: f64,
    pieces: [Piece; 4],
}

/// A stretch of constant input.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    start_s: f64,
    length_s: f64,
    input: f64,
    start: State,
}

/// A point of the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    pub(super) time_s: f64,
    pub(super) y: f64,
}

impl Waveform {
    /// The response to a wave of plus and minus one on top of `bias`. Its mean must be zero and the
    /// dead time shorter than the period.
    pub(super) fn new(process: &Soiptd, high_s: f64, period_s: f64, bias: f64) -> Self {
        let (body, prop) = (process.inv_t_body_per_s(), 1.0 / process.t_prop_s());
        let rise_s = process.tau_s();
        let fall_s = (rise_s + high_s) % period_s;
        let mut cuts = [0.0, high_s, rise_s, fall_s];
        cuts.sort_unstable_by(f64::total_cmp);

        let mut pieces = [Piece::default(); 4];
        for (k, piece) in pieces.iter_mut().enumerate() {
            let end_s = cuts.get(k + 1).copied().unwrap_or(period_s);
            let since_rise_s = (cuts[k] - rise_s).rem_euclid(period_s);
            // At the fall itself rounding must not decide.
            let is_high = cuts[k] != fall_s && since_rise_s < high_s;
            *piece = Piece {
                start_s: cuts[k],
                length_s: end_s - cuts[k],
                input: bias + if is_high { 1.0 } else { -1.0 },
                start: State::default(),
            };
        }
        let steps = pieces.map(|piece| Transition::of_poles(body, prop, piece.length_s));
        let propagate = |start: State, pieces: &mut [Piece; 4]| {
            pieces
                .iter_mut()
                .zip(&steps)
                .fold(start, |state, (piece, step)| {
                    piece.start = state;
                    step.apply(&state, piece.input)
                })
        };
        let forced = propagate(State::default(), &mut pieces);
        let whole = Transition::of_poles(body, prop, period_s);
        let f = forced.f / -(-prop * period_s).exp_m1();
        let v = -(whole.y_f * f + forced.y) / whole.y_v;
        propagate(State { y: 0.0, v, f }, &mut pieces);
        Self {
            body,
            prop,
            high_s,
            period_s,
            pieces,
        }
    }

    /// State at a time from zero to the period, and the input there; at an edge the input before it.
    pub(super) fn at(&self, time_s: f64) -> (State, f64) {
        let piece = self
            .pieces
            .iter()
            .rev()
            .find(|piece| piece.start_s < time_s && piece.length_s > 0.0)
            .unwrap_or(&self.pieces[0]);
        (self.state(piece, time_s - piece.start_s), piece.input)
    }

    fn state(&self, piece: &Piece, elapsed_s: f64) -> State {
        Transition::of_poles(self.body, self.prop, elapsed_s).apply(&piece.start, piece.input)
    }

    /// The output while the relay's output is high or low: its first value, its turning points, its
    /// last value. Between two of them it is monotone.
    pub(super) fn course(&self, high: bool) -> Vec<Moment> {
        let inside = |piece: &&Piece| (piece.start_s < self.high_s) == high && piece.length_s > 0.0;
        let mut course = Vec::with_capacity(6);
        let mut end = (0.0, State::default());
        for piece in self.pieces.iter().filter(inside) {
            if course.is_empty() {
                course.push(Moment {
                    time_s: piece.start_s,
                    y: piece.start.y,
                });
            }
            for elapsed_s in self.turns(piece) {
                course.push(Moment {
                    time_s: piece.start_s + elapsed_s,
                    y: self.state(piece, elapsed_s).y,
                });
            }
            end = (
                piece.start_s + piece.length_s,
                self.state(piece, piece.length_s),
            );
        }
        course.push(Moment {
            time_s: end.0,
            y: end.1.y,
        });
        course
    }

    /// Times of sign changes of the rate within a piece: at most two, because its derivative changes
    /// sign once.
    fn turns(&self, piece: &Piece) -> impl Iterator<Item = f64> {
        let rate = |t: f64| self.rate(piece, t);
        let end_s = piece.length_s;
        let turn = |from_s: f64, to_s: f64| Some(root(rate, from_s, to_s, TURN_TOLERANCE * end_s));
        let changes = |a: f64, b: f64| a * b < 0.0;
        let ends = [rate(0.0), rate(end_s)];
        let turns = if changes(ends[0], ends[1]) {
            [turn(0.0, end_s), None]
        } else {
            let acceleration = |t: f64| {
                let fade = (-self.prop * t).exp();
                piece.input + (piece.start.f - piece.input) * fade - self.body * rate(t)
            };
            let bend_s = changes(acceleration(0.0), acceleration(end_s))
                .then(|| root(acceleration, 0.0, end_s, BEND_TOLERANCE * end_s))
                .filter(|&bend_s| changes(ends[0], rate(bend_s)));
            bend_s.map_or([None; 2], |bend_s| [turn(0.0, bend_s), turn(bend_s, end_s)])
        };
        turns.into_iter().flatten()
    }

    /// Rate at time `t` of a piece.
    fn rate(&self, piece: &Piece, t: f64) -> f64 {
        let Piece { input, start, .. } = *piece;
        start.v * (-self.body * t).exp()
            + input * chained(self.body, 0.0, t)
            + (start.f - input) * chained(self.body, self.prop, t)
    }
}

/// `(e^(-y t) - e^(-x t)) / (x - y)`, regular for `x` equal to `y`.
fn chained(x: f64, y: f64, t: f64) -> f64 {
    let apart = (x - y).abs() * t;
    let ratio = if apart > 0.0 {
        -(-apart).exp_m1() / apart
    } else {
        1.0
    };
    t * (-x.min(y) * t).exp() * ratio
}

#[cfg(test)]
mod tests {
    use super::*;

    // A double integrator under a wave of period 4 without delay: acceleration +1 for 2 s, -1 for
    // 2 s. The rate is -1 at the rise, 1 at the fall; the output turns at 1 s, half a unit below its
    // start, and at 3 s, half a unit above it. The actuator's lag of 1e-6 s moves that by as much.
    #[test]
    fn parabolas_by_hand() {
        let process = Soiptd::from_acceleration_gain(1.0, 1e-6, 0.0, 0.0).unwrap();
        let waveform = Waveform::new(&process, 2.0, 4.0, 0.0);
        let (start, _) = waveform.at(0.0);
        assert!((start.v + 1.0).abs() < 4e-6, "{start:?}");
        for (high, time_s, y) in [(true, 1.0, -0.5), (false, 3.0, 0.5)] {
            let course = waveform.course(high);
            assert_eq!(course.len(), 3, "{course:?}");
            assert!((course[1].time_s - time_s).abs() < 4e-6);
            assert!((course[1].y - y).abs() < 4e-6);
            assert!((course[2].y - 0.0).abs() < 4e-6);
        }
    }

    // The same wave 0.5 s late turns 0.5 s later, whatever the window.
    #[test]
    fn dead_time_shifts_the_response() {
        let at = |tau_s| {
            let process = Soiptd::from_acceleration_gain(1.0, 0.3, 0.5, tau_s).unwrap();
            Waveform::new(&process, 1.2, 3.0, 0.2)
        };
        let (prompt, late) = (at(0.0), at(0.5));
        for time_s in [0.6, 1.1, 1.9, 2.9] {
            let (a, b) = (prompt.at(time_s - 0.5).0, late.at(time_s).0);
            assert!((a.v - b.v).abs() < 1e-14, "{a:?} {b:?}");
            assert!((a.f - b.f).abs() < 1e-14);
        }
    }

    // After a period the state returns, with and without damping, at equal lags, and with a bias
    // balanced by the duty: 0.2 high of (1 - 0.2)/2.
    #[test]
    fn response_is_periodic() {
        for (t_prop, damping, tau) in [(0.3, 0.5, 0.1), (0.05, 0.0, 0.7), (0.25, 4.0, 0.01)] {
            let process = Soiptd::from_acceleration_gain(1.0, t_prop, damping, tau).unwrap();
            let waveform = Waveform::new(&process, 0.4 * 2.0, 2.0, 0.2);
            let (start, end) = (waveform.at(0.0).0, waveform.at(2.0).0);
            for (a, b) in [(start.y, end.y), (start.v, end.v), (start.f, end.f)] {
                assert!((a - b).abs() < 1e-14, "{start:?} {end:?}");
            }
        }
    }

    // (e^(-2 t) - e^(-3 t)) / 1 at t = 0.5, and its limit t e^(-2 t) where both are 2.
    #[test]
    fn chained_is_regular() {
        let expected = (-1.0_f64).exp() - (-1.5_f64).exp();
        assert!((chained(3.0, 2.0, 0.5) - expected).abs() < 1e-16);
        assert!((chained(2.0, 2.0, 0.5) - 0.5 * (-1.0_f64).exp()).abs() < 1e-16);
        assert_eq!(chained(0.0, 0.0, 0.5), 0.5);
    }
}
