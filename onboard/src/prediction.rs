//! Prediction of the closed loop with the new controller, to check that the vehicle is the process identified.
//!
//! From the switch to the new controller on, a model runs beside the vehicle, with the same law, reference and
//! limits:
//!
//! ```text
//! y' = v,   v' = A f - v/T_body,   T_prop f' = u(t - tau) + u0 - f,   u = law(r, y, v)
//! ```
//!
//! with `A = K/T_body` and the input bias `u0`; other symbols as in [`Soiptd`]. The model begins at the measured
//! output and rate, with the force that the relay's last switches give after the actuator's lag. The loop is
//! stable, so the error of the initial state decays; a remaining difference shows that the vehicle is another
//! process.
//!
//! Inputs before the switch are known as edges. Inputs of the model go into a delay line, in which one place
//! covers as many ticks as the dead time requires.

use libm::{ceil, exp};

use crate::control::Measurement;
use crate::pid::PidLaw;
use crate::process::Soiptd;
use crate::transition::{State, Transition};
use crate::window::Edge;

/// Places of the delay line. A place covers at most a hundredth of the dead time, or one tick.
const PLACES: usize = 104;
const MOST_PLACES: f64 = 100.0;

/// Initial state of the model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beginning<'a> {
    /// The last switches of the relay.
    pub(crate) edges: &'a [Edge],
    pub(crate) time_s: f64,
    pub(crate) value: f32,
    pub(crate) rate: f32,
    /// Reference (output unit), constant until the response has been checked.
    pub(crate) reference: f32,
    /// Constant input that is not recorded (input unit).
    pub(crate) input_bias: f64,
}

/// Model of the closed loop.
#[derive(Clone, Debug)]
pub(crate) struct Prediction {
    law: PidLaw,
    /// Time between inputs of the law (s).
    place_s: f32,
    reference: f32,
    gain: f64,
    input_bias: f64,
    transition: Transition,
    state: State,
    /// Inputs of the last places, the latest at `next - 1`.
    line: [f32; PLACES],
    next: usize,
    /// Dead time: whole places, and the fraction of a place.
    places: usize,
    part: f32,
    /// Ticks per place, and ticks since the last place.
    every: u32,
    ticks: u32,
}

impl Prediction {
    /// A model of a process under a law, stepped every `sample_s`.
    pub(crate) fn new(
        process: &Soiptd,
        law: PidLaw,
        sample_s: f64,
        beginning: &Beginning<'_>,
    ) -> Self {
        let every = ceil(process.tau_s() / (MOST_PLACES * sample_s)).max(1.0);
        let place_s = every * sample_s;
        let delay = process.tau_s() / place_s;
        let mut prediction = Self {
            law,
            place_s: place_s as f32,
            reference: beginning.reference,
            gain: process.k_over_t_body(),
            input_bias: beginning.input_bias,
            transition: Transition::over(process, place_s),
            state: State {
                y: f64::from(beginning.value) / process.k_over_t_body(),
                v: f64::from(beginning.rate) / process.k_over_t_body(),
                f: force(beginning, process),
            },
            line: [0.0; PLACES],
            next: 0,
            places: delay as usize,
            part: (delay - libm::floor(delay)) as f32,
            every: every as u32,
            ticks: 0,
        };
        // Fill the line as if the model had run before, oldest input first.
        for place in (1..=PLACES).rev() {
            let middle_s = beginning.time_s - (place as f64 - 0.5) * place_s;
            prediction.push(input_at(beginning.edges, middle_s) as f32);
        }
        prediction
    }

    fn push(&mut self, input: f32) {
        self.line[self.next] = input;
        self.next = (self.next + 1) % PLACES;
    }

    /// Input of the given number of places ago; zero is the latest.
    fn ago(&self, places: usize) -> f32 {
        self.line[(self.next + 2 * PLACES - 1 - places) % PLACES]
    }

    /// Output (output unit) at the next tick.
    #[inline]
    pub(crate) fn step(&mut self) -> f32 {
        if self.ticks == 0 {
            let (value, rate) = (self.gain * self.state.y, self.gain * self.state.v);
            let measurement = Measurement::of(value as f32).with_rate(rate as f32);
            let input = self.law.step(self.place_s, self.reference, &measurement);
            self.push(input);
            let late = self.ago(self.places)
                + self.part * (self.ago(self.places + 1) - self.ago(self.places));
            let input = f64::from(late) + self.input_bias;
            self.state = self.transition.apply(&self.state, input);
        }
        self.ticks = (self.ticks + 1) % self.every;
        // Between places the output of the next place is returned.
        (self.gain * self.state.y) as f32
    }
}

/// Recorded input at a time; before the first edge it is that of the first edge.
fn input_at(edges: &[Edge], time_s: f64) -> f64 {
    let held = edges.iter().rev().find(|edge| edge.time_s <= time_s);
    held.or(edges.first()).map_or(0.0, |edge| edge.input)
}

/// Force of the actuator at the beginning: the inputs that have arrived, after its lag.
fn force(beginning: &Beginning<'_>, process: &Soiptd) -> f64 {
    let now_s = beginning.time_s - process.tau_s();
    let edges = beginning.edges;
    let mut force = edges.first().map_or(0.0, |edge| edge.input);
    for (index, edge) in edges.iter().enumerate() {
        let until_s = edges.get(index + 1).map_or(now_s, |next| next.time_s);
        let held_s = until_s.min(now_s) - edge.time_s;
        if held_s > 0.0 {
            force = edge.input + (force - edge.input) * exp(-held_s / process.t_prop_s());
        }
    }
    force + beginning.input_bias
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec;

    use super::*;
    use crate::control::Pd;
    use crate::pid::PidSettings;

    const SAMPLE_S: f64 = 0.001;

    /// Largest distance between prediction and process in the two seconds after a switch, relative to the
    /// amplitude before. The dead time is `ticks` long; the relay switches every 0.2 s with a bias of 0.02.
    fn largest(ticks: usize, pd: Pd) -> f64 {
        let tau_s = ticks as f64 * SAMPLE_S;
        let process = Soiptd::from_acceleration_gain(4.0, 0.05, 0.5, tau_s).unwrap();
        let transition = Transition::over(&process, SAMPLE_S);
        let (mut state, mut line) = (State::default(), vec![0.0; ticks]);
        let mut edges = vec![];
        let mut tick = 0;
        let mut push = |input: f64| {
            let late = core::mem::replace(&mut line[tick % ticks], input);
            state = transition.apply(&state, late + 0.02);
            tick += 1;
            (4.0 * state.y, 4.0 * state.v)
        };
        let (mut value, mut rate, mut amplitude) = (0.0, 0.0, 0.0_f64);
        for tick in 0..1700 {
            let input = if tick / 200 % 2 == 0 { 0.1 } else { -0.1 };
            if tick % 200 == 0 {
                edges.push(Edge {
                    time_s: f64::from(tick) * SAMPLE_S,
                    input,
                });
            }
            (value, rate) = push(input);
            amplitude = amplitude.max(f64::abs(value));
        }
        let ki = 0.5 * pd.kp as f32;
        let settings = PidSettings { ki, ..pd.into() }.with_limits(-10.0, 10.0);
        let mut law = PidLaw::new(settings).unwrap().started_at(0.0, -0.02);
        let beginning = Beginning {
            edges: &edges,
            time_s: 1.7,
            value: value as f32,
            rate: rate as f32,
            reference: 0.0,
            input_bias: 0.02,
        };
        let mut model = Prediction::new(&process, law, SAMPLE_S, &beginning);
        let mut largest = 0.0_f64;
        for _ in 0..2000 {
            let predicted = model.step();
            let measured = Measurement::of(value as f32).with_rate(rate as f32);
            let input = law.step(SAMPLE_S as f32, 0.0, &measured);
            (value, rate) = push(f64::from(input));
            largest = largest.max((f64::from(predicted) - value).abs());
        }
        largest / amplitude
    }

    // The model is the process; the difference is single precision in the law.
    #[test]
    fn it_is_the_process() {
        for ticks in [1, 7, 100] {
            let off = largest(ticks, Pd { kp: 4.0, kd: 2.0 });
            assert!(off < 1e-5, "{ticks}: {off}");
        }
    }

    // Places of two and of four ticks: the edges before the switch and the outputs of the law are up to four
    // ticks late, which at a tenth of a rad per tick costs a per cent.
    #[test]
    fn long_dead_times_share_places() {
        for ticks in [150, 380] {
            let off = largest(ticks, Pd { kp: 0.2, kd: 0.3 });
            assert!(off < 0.05, "{ticks}: {off}");
        }
    }
}
