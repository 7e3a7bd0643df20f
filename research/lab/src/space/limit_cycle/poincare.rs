//! The linearised Poincare map of a limit cycle: the deviation at one rise of the relay's output as a
//! function of the deviation at the previous rise.
//!
//! At a switch the future depends on the state `x = (y, v, f)` and, if the dead time is longer than the
//! time since the previous switch, on how early that switch was, `d`: its edge is still in the delay.
//! Over a window with the transition `Phi` and the input column `B`,
//!
//! ```text
//! dx(t) = Phi(t) dx + Phi(t - arrival) B jump d        once the edge that is `d` early has arrived
//! ds    = (b dy(extremum) - dy(end)) / v(end)          how much later the relay switches
//! dx'   = dx(end) + dx/dt(end) ds,   d' = ds           the deviation as seen from that switch
//! ```
//!
//! Two windows make a cycle. Time shifts are eliminated, so no multiplier is one by itself. Reference:
//! Astrom (1995), whose formula this is for `beta = 0` without dead time.
//!
//! With a trim there are two more states: its deviation in the process, `p`, and at the relay, `q`. Its
//! edges are the rises.

use onecycle_onboard::transition::{State, Transition};

use super::waveform::Waveform;

/// `y, v, f, d, p, q`.
type Deviation = [f64; ORDER];
const ORDER: usize = 6;

/// The limit cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Orbit<'a> {
    pub(super) waveform: &'a Waveform,
    pub(super) tau_s: f64,
    /// `-beta` of the switch that ends the high output, and of the other.
    pub(super) b: [f64; 2],
    /// Times of the lowest output while the relay's output is high, and of the highest while it is low
    /// (s).
    pub(super) extremes_s: [f64; 2],
}

impl Orbit<'_> {
    /// Spectral radius of the map from rise to rise.
    pub(super) fn spectral_radius(&self) -> f64 {
        spectral_radius(&matrix(|deviation| {
            let [y, v, f, early_s, ..] = deviation;
            let (at_fall, _) = self.high(&[y, v, f, early_s, 0.0, 0.0]);
            self.low(&at_fall).0
        }))
    }

    /// The same with a trim that each rise moves by `trim_gain` times the mean of the relay's output
    /// about it over the cycle. The dead time must be shorter than the time for which the output is
    /// high.
    pub(super) fn trimmed_spectral_radius(&self, trim_gain: f64) -> f64 {
        let period_s = self.waveform.period_s;
        let high_share = self.waveform.high_s / period_s;
        spectral_radius(&matrix(|deviation| {
            let (mut at_fall, high_later_s) = self.high(&deviation);
            let [.., p, q] = &mut at_fall;
            *p = *q;
            let (mut at_rise, low_later_s) = self.low(&at_fall);
            // Derivative of (high - low) / (high + low).
            let mean = 2.0 * ((1.0 - high_share) * high_later_s - high_share * low_later_s);
            at_rise[5] += trim_gain * mean / period_s;
            at_rise
        }))
    }

    fn high(&self, deviation: &Deviation) -> (Deviation, f64) {
        let low_s = self.waveform.period_s - self.waveform.high_s;
        self.cross(
            deviation,
            Window {
                start_s: 0.0,
                end_s: self.waveform.high_s,
                b: self.b[0],
                extreme_s: self.extremes_s[0],
                edge_s: self.tau_s - low_s,
                jump: -2.0,
            },
        )
    }

    fn low(&self, deviation: &Deviation) -> (Deviation, f64) {
        self.cross(
            deviation,
            Window {
                start_s: self.waveform.high_s,
                end_s: self.waveform.period_s,
                b: self.b[1],
                extreme_s: self.extremes_s[1],
                edge_s: self.tau_s - self.waveform.high_s,
                jump: 2.0,
            },
        )
    }

    /// The deviation at the end of a window, and the delay of that end (s).
    fn cross(&self, deviation: &Deviation, window: Window) -> (Deviation, f64) {
        let length_s = window.end_s - window.start_s;
        let at_extreme = self.after(deviation, &window, window.extreme_s - window.start_s);
        let at_end = self.after(deviation, &window, length_s);
        let (state, input) = self.waveform.at(window.end_s);
        let later_s = (window.b * at_extreme.y - at_end.y) / state.v;
        let next = [
            at_end.y + state.v * later_s,
            at_end.v + (state.f - self.waveform.body * state.v) * later_s,
            at_end.f + self.waveform.prop * (input - state.f) * later_s,
            later_s,
            deviation[4],
            deviation[5],
        ];
        (next, later_s)
    }

    /// Deviation of the state `t` after the start of a window.
    fn after(&self, deviation: &Deviation, window: &Window, t: f64) -> State {
        let [y, v, f, early_s, p, q] = *deviation;
        let transition = |t| Transition::of_poles(self.waveform.body, self.waveform.prop, t);
        let mut state = transition(t).apply(&State { y, v, f }, p);
        if window.edge_s >= 0.0 && t > window.edge_s {
            let pulse = State {
                f: self.waveform.prop * window.jump * early_s,
                ..State::default()
            };
            state = sum(state, transition(t - window.edge_s).apply(&pulse, 0.0));
        }
        if t > self.tau_s && q != p {
            let step = transition(t - self.tau_s).apply(&State::default(), q - p);
            state = sum(state, step);
        }
        state
    }
}

/// An interval from switch to switch.
#[derive(Clone, Copy, Debug)]
struct Window {
    start_s: f64,
    end_s: f64,
    b: f64,
    extreme_s: f64,
    /// Time after the start at which the edge of the previous switch arrives; negative if it arrived
    /// earlier.
    edge_s: f64,
    /// Jump of the input at that edge.
    jump: f64,
}

fn sum(a: State, b: State) -> State {
    State {
        y: a.y + b.y,
        v: a.v + b.v,
        f: a.f + b.f,
    }
}

type Matrix = [Deviation; ORDER];

/// The transposed matrix of a linear map; its spectral radius is the same.
fn matrix(map: impl Fn(Deviation) -> Deviation) -> Matrix {
    let mut rows = [[0.0; ORDER]; ORDER];
    for (k, row) in rows.iter_mut().enumerate() {
        let mut unit = [0.0; ORDER];
        unit[k] = 1.0;
        *row = map(unit);
    }
    rows
}

/// Number of squarings after which the constant of Gelfand's formula is below rounding.
const SQUARINGS: i32 = 60;

/// `lim |M^n|^(1/n)`, Gelfand's formula, `n` a power of two.
fn spectral_radius(matrix: &Matrix) -> f64 {
    let mut power = *matrix;
    let mut ln_radius = 0.0;
    for k in 0..SQUARINGS {
        let norm = power.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        if norm == 0.0 {
            return 0.0;
        }
        ln_radius += norm.ln() * 0.5_f64.powi(k);
        power.iter_mut().flatten().for_each(|x| *x /= norm);
        power = product(&power, &power);
    }
    ln_radius.exp()
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut c = [[0.0; ORDER]; ORDER];
    for row in 0..ORDER {
        for column in 0..ORDER {
            c[row][column] = (0..ORDER).map(|k| a[row][k] * b[k][column]).sum();
        }
    }
    c
}
