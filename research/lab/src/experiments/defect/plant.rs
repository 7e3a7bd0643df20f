//! A process with one defect, integrated numerically.
//!
//! ```text
//! dy/dt = v,   dv/dt = b F(f) - v/T_body - b c tanh(v/v_c),   df/dt = (u_d - f)/T_prop
//! ```
//!
//! | symbol  | meaning                                                                  |
//! |---------|--------------------------------------------------------------------------|
//! | `u_d`   | delayed input, after the rate limit if there is one                      |
//! | `F`     | the force `f`, the force outside the dead zone, or the force after a third lag |
//! | `c`     | Coulomb friction (input unit), smoothed below `v_c`, a hundredth of the oscillation's rate |
//! | `b`     | `K/T_body`                                                               |
//!
//! Integrated by the classical Runge-Kutta method; steps end exactly at the edges of the delayed input.
//! Without a defect the output agrees with the exact simulation to 1e-8 of its amplitude. For defects with
//! kinks (dead zone, friction, backlash, rate limit), halving the step changes ten periods under a square
//! wave by less than 1e-3 of the amplitude.

use std::f64::consts::TAU;

use onecycle_onboard::Soiptd;

use super::Defect;
use crate::experiments::oscillation::Oscillation;

/// Least number of steps in a period of the oscillation: fifteen in a quarter period of the fastest
/// resonance.
const STEPS_PER_PERIOD: f64 = 600.0;

/// Rate below which friction is smoothed, over the rate of the oscillation.
const CREEP: f64 = 0.01;

/// States: output, rate, force, and up to two states of the defect.
type State = [f64; 5];

/// Part of the input with a delay of its own.
#[derive(Clone, Copy, Debug)]
struct Path {
    share: f64,
    /// Delay in whole steps, and the remaining fraction of a step.
    whole: usize,
    fraction: f64,
}

/// A process with a defect, to be stepped with a held input. See the [module](self).
#[derive(Clone, Debug)]
pub struct DefectPlant {
    process: Soiptd,
    defect: Defect,
    step_s: f64,
    finest_s: f64,
    creep: f64,
    state: State,
    /// Input after the rate limit; output after the backlash.
    slewed: f64,
    played: f64,
    paths: Vec<Path>,
    history: Vec<f64>,
    newest: usize,
}

impl DefectPlant {
    /// A plant at rest, to be stepped by `step_s > 0`; an undriven limit cycle starts near its own orbit.
    #[must_use]
    pub fn new(process: &Soiptd, defect: &Defect, oscillation: Oscillation, step_s: f64) -> Self {
        let path = |share, delay_s: f64| {
            let steps = delay_s / step_s;
            Path {
                share,
                whole: steps as usize,
                fraction: steps.fract(),
            }
        };
        let tau_s = process.tau_s();
        let paths = match *defect {
            Defect::SecondPath { share, delay_s } => {
                vec![path(1.0 - share, tau_s), path(share, tau_s + delay_s)]
            }
            _ => vec![path(1.0, tau_s)],
        };
        let longest = paths.iter().map(|path| path.whole).max().unwrap_or(0);
        Self {
            process: *process,
            defect: *defect,
            step_s,
            finest_s: oscillation.period_s / STEPS_PER_PERIOD,
            creep: CREEP * oscillation.amplitude * TAU / oscillation.period_s,
            state: defect.start(),
            slewed: 0.0,
            played: 0.0,
            paths,
            history: vec![0.0; longest + 2],
            newest: 0,
        }
    }

    /// One step with the input held at `u`.
    pub fn step(&mut self, u: f64) {
        self.newest = (self.newest + 1) % self.history.len();
        self.history[self.newest] = u;
        let mut cuts = [0.0, 1.0, 1.0, 1.0];
        for (cut, path) in cuts[1..].iter_mut().zip(&self.paths) {
            *cut = path.fraction;
        }
        cuts.sort_unstable_by(f64::total_cmp);
        for pair in cuts.windows(2) {
            let length_s = (pair[1] - pair[0]) * self.step_s;
            if length_s > 0.0 {
                let input = self.arriving(0.5 * (pair[0] + pair[1]));
                self.advance(input, length_s);
            }
        }
    }

    /// Input that arrives at this part of the step.
    fn arriving(&self, part: f64) -> f64 {
        let ago = |steps: usize| {
            self.history[(self.newest + self.history.len() - steps) % self.history.len()]
        };
        (self.paths.iter())
            .map(|path| path.share * ago(path.whole + usize::from(part < path.fraction)))
            .sum()
    }

    fn advance(&mut self, input: f64, length_s: f64) {
        let steps = (length_s / self.finest_s).ceil().max(1.0);
        let step_s = length_s / steps;
        for _ in 0..steps as usize {
            let input = self.slew(input, step_s);
            self.runge_kutta(input, step_s);
            if let Defect::Play { half_width } = self.defect {
                let y = self.state[0];
                self.played = self.played.clamp(y - half_width, y + half_width);
            }
        }
    }

    /// Mean over a step of the input after the rate limit.
    fn slew(&mut self, input: f64, step_s: f64) -> f64 {
        let Defect::RateLimit { per_s } = self.defect else {
            return input;
        };
        let before = self.slewed;
        let most = per_s * step_s;
        self.slewed += (input - before).clamp(-most, most);
        0.5 * (before + self.slewed)
    }

    fn runge_kutta(&mut self, input: f64, step_s: f64) {
        let along = |slope: &State, by_s: f64| -> State {
            std::array::from_fn(|k| self.state[k] + by_s * slope[k])
        };
        let first = self.slope(&self.state, input);
        let second = self.slope(&along(&first, 0.5 * step_s), input);
        let third = self.slope(&along(&second, 0.5 * step_s), input);
        let fourth = self.slope(&along(&third, step_s), input);
        for k in 0..self.state.len() {
            self.state[k] += step_s / 6.0 * (first[k] + 2.0 * (second[k] + third[k]) + fourth[k]);
        }
    }

    fn slope(&self, state: &State, input: f64) -> State {
        match self.defect {
            Defect::VanDerPol {
                amplitude,
                rad_per_s,
                bend,
            } => {
                let [y, v, ..] = *state;
                let x = 2.0 * y / amplitude;
                let pull = bend * (1.0 - x * x) * v - rad_per_s * y;
                [v, rad_per_s * pull, 0.0, 0.0, 0.0]
            }
            Defect::OtherLoop {
                amplitude,
                lag_s,
                proportional,
                integral,
            } => {
                // Three equal lags and the integral; the controller's output is limited.
                let [y, second, first, sum, _] = *state;
                let effort = (proportional * -y + sum).clamp(-amplitude, amplitude);
                [
                    (second - y) / lag_s,
                    (first - second) / lag_s,
                    (effort - first) / lag_s,
                    -integral * y / lag_s,
                    0.0,
                ]
            }
            _ => self.slope_of_process(state, input),
        }
    }

    fn slope_of_process(&self, state: &State, input: f64) -> State {
        let [y, v, f, extra, extra_rate] = *state;
        let b = self.process.k_over_t_body();
        let mut force = f;
        let mut lag_s = self.process.t_prop_s();
        let mut of_extra = [0.0; 2];
        match self.defect {
            Defect::Resonance {
                rad_per_s, damping, ..
            } => {
                let pull = rad_per_s * (y - extra) - 2.0 * damping * extra_rate;
                of_extra = [extra_rate, rad_per_s * pull];
            }
            Defect::ExtraLag { lag_s } => {
                force = extra;
                of_extra[0] = (f - extra) / lag_s;
            }
            Defect::SlowSensor { lag_s } => of_extra[0] = (y - extra) / lag_s,
            Defect::DeadZone { half_width } => force = f - f.clamp(-half_width, half_width),
            Defect::Friction { force: most } => force = f - most * (v / self.creep).tanh(),
            Defect::AsymmetricLag { falling_s } if input < f => lag_s = falling_s,
            Defect::Drag { force: most, rate } => force = f - most * (v / rate) * (v / rate).abs(),
            Defect::Thrust { curvature } => force = f + curvature * f * f,
            _ => {}
        }
        [
            v,
            b * force - self.process.inv_t_body_per_s() * v,
            (input - f) / lag_s,
            of_extra[0],
            of_extra[1],
        ]
    }

    /// Reading of the plant's sensor, without noise (output unit).
    #[must_use]
    pub fn output(&self) -> f64 {
        let [y, v, _, extra, _] = self.state;
        match self.defect {
            Defect::Resonance { mass_ratio, .. } if mass_ratio > 0.0 => {
                y + mass_ratio * (y - extra)
            }
            Defect::Resonance { .. } | Defect::SlowSensor { .. } => extra,
            Defect::RateSensor => v,
            Defect::Play { .. } => self.played,
            _ => y,
        }
    }

    /// Rate of [`Self::output`] (output unit / s).
    #[must_use]
    pub fn rate(&self) -> f64 {
        let [y, v, f, extra, extra_rate] = self.state;
        match self.defect {
            Defect::Resonance { mass_ratio, .. } if mass_ratio > 0.0 => {
                v + mass_ratio * (v - extra_rate)
            }
            Defect::Resonance { .. } => extra_rate,
            Defect::SlowSensor { lag_s } => (y - extra) / lag_s,
            Defect::RateSensor => {
                self.process.k_over_t_body() * f - self.process.inv_t_body_per_s() * v
            }
            // The output moves only while the backlash is taken up.
            Defect::Play { half_width } => {
                let pushed = (y - self.played).abs() >= half_width && (y - self.played) * v > 0.0;
                if pushed { v } else { 0.0 }
            }
            _ => v,
        }
    }
}
