//! Tuning rules of the field, to compare with: SIMC, AMIGO, Ziegler-Nichols, Tyreus-Luyben.
//!
//! | rule | needs | reference |
//! |------|-------|-----------|
//! | [`simc()`] | [`HalfRule`] | S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning", J. Process Control 13 (2003) |
//! | [`amigo()`] | [`StepFeatures`] | K. J. Astrom, T. Hagglund, J. Process Control 14 (2004), 635; "Advanced PID Control" (ISA, 2006), chapter 7 |
//! | [`ziegler_nichols()`] | [`Ultimate`] | J. G. Ziegler, N. B. Nichols, Trans. ASME 64 (1942) |
//! | [`no_overshoot()`] | [`Ultimate`] | in use for heated beds; [`UltimateRule`] finds the ultimate point behind such gains |
//! | [`tyreus_luyben()`] | [`Ultimate`] | PI: B. D. Tyreus, W. L. Luyben, Ind. Eng. Chem. Res. 31 (1992), 2625; PID: W. L. Luyben, the same 35 (1996), 3480 |
//! | [`Homogeneous`] | a relay oscillation | the paper, equations 11 to 13 |
//!
//! All rules return PI or PID without measurement filter; a rule has no controller of another form. They assume a positive
//! or negative gain of the process and return gains of the same sign.

mod gmvc;
mod homogeneous;
mod inverse;

use std::f64::consts::{PI, TAU};

use crate::analysis::process::Process;
use crate::controller::{Execution, Form, Ideal, Pid, Series};
use crate::model::Model;
use crate::model::state_space::StateSpace;
use crate::roots::root;

pub use gmvc::Gmvc;
pub use homogeneous::Homogeneous;
pub use inverse::{NotOfRule, UltimateRule};

/// First- or second-order model by the half rule.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct HalfRule {
    /// Gain over the longest time constant (output unit / (input unit s)): the gain of an integrating process.
    pub slope: f64,
    /// Longest time constant (s). Infinite for an integrating process.
    pub first_s: f64,
    /// Second time constant (s). Zero for a first-order model.
    pub second_s: f64,
    /// Effective dead time (s).
    pub dead_time_s: f64,
}

impl HalfRule {
    /// Model with this slope `K/T1`, these time constants and dead time (s).
    #[must_use]
    pub fn new(slope: f64, [first_s, second_s]: [f64; 2], dead_time_s: f64) -> Self {
        Self {
            slope,
            first_s,
            second_s,
            dead_time_s,
        }
    }

    /// Model of first order for [`Form::Pi`], of second order for [`Form::Pid`]. `None` for another form, an underdamped
    /// process, two integrators, or parameters out of range.
    #[must_use]
    pub fn of(model: &Model, form: Form) -> Option<Self> {
        let order = match form {
            Form::Pi => 1,
            Form::Pid => 2,
            _ => return None,
        };
        let process = Process::new(&model.linear(), &Execution::default())?;
        if process.resonance().is_some() || process.integrators() > 1 || !process.is_stable() {
            return None;
        }
        let times = process.times();
        let time = |i: usize| times.get(i).copied().unwrap_or(0.0);
        // Half of the longest time left out goes to the shortest one kept.
        let half = 0.5 * time(order);
        let second = if order == 2 { time(1) + half } else { 0.0 };
        let first = if order == 1 { time(0) + half } else { time(0) };
        let zero_gain = process
            .stage_denominator()
            .coefficients()
            .first()
            .copied()?;
        let slope = if first.is_finite() {
            1.0 / (zero_gain * first)
        } else {
            1.0 / process.stage_denominator().coefficients().get(1)?
        };
        let unit_s = process.unit_s;
        Some(Self {
            slope: slope * process.gain / unit_s,
            first_s: first * unit_s,
            second_s: second * unit_s,
            dead_time_s: process.half_rule_dead_time(order) * unit_s,
        })
    }
}

/// SIMC rule with the closed-loop time constant `closed_loop_s` (s); the usual choice is the effective dead time. PI from a
/// first-order model, PID from a second-order one. `None` if both times are zero.
#[must_use]
pub fn simc(model: &HalfRule, closed_loop_s: f64) -> Option<Pid> {
    let sum_s = closed_loop_s + model.dead_time_s;
    let gain = 1.0 / (model.slope * sum_s);
    let integral_time_s = model.first_s.min(4.0 * sum_s);
    (sum_s > 0.0 && gain.is_finite())
        .then(|| Series::new(gain, integral_time_s, model.second_s).pid())
}

/// Features of the response of a process to a unit step of its input.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum StepFeatures {
    /// A process that settles.
    SelfRegulating {
        /// Static gain (output unit / input unit).
        gain: f64,
        /// Apparent lag (s): time to 63 % of the step, less the apparent dead time.
        lag_s: f64,
        /// Apparent dead time (s): where the steepest tangent meets zero.
        dead_time_s: f64,
    },
    /// A process that ends in a ramp.
    Integrating {
        /// Slope of the ramp (output unit / (input unit s)).
        slope: f64,
        /// Time at which the ramp meets zero (s).
        dead_time_s: f64,
    },
}

/// Steps of a simulated response, and its length in sums of time constants. The features are exact to about 1e-6.
const STEPS: usize = 20_000;
const LENGTH: f64 = 10.0;

impl StepFeatures {
    /// Features of a model. `None` for two integrators or parameters out of range.
    #[must_use]
    pub fn of(model: &Model) -> Option<Self> {
        let linear = model.linear();
        let process = Process::new(&linear, &Execution::default())?;
        let denominator = process.stage_denominator();
        let coefficients = denominator.coefficients();
        let (unit_s, zero) = (process.unit_s, *coefficients.first()?);
        if process.integrators() > 1 || !process.is_stable() {
            return None;
        }
        if zero == 0.0 {
            let first = *coefficients.get(1)?;
            let lags = coefficients.get(2).map_or(0.0, |second| second / first);
            return Some(Self::Integrating {
                slope: process.gain / (first * unit_s),
                dead_time_s: (process.tau + lags) * unit_s,
            });
        }
        let gain = process.gain / zero;
        let sum_s = coefficients.get(1)? / zero * unit_s;
        if coefficients.len() == 2 {
            return Some(Self::SelfRegulating {
                gain,
                lag_s: sum_s,
                dead_time_s: linear.tau_s(),
            });
        }
        let h_s = LENGTH * sum_s / STEPS as f64;
        let space = StateSpace::<6>::new(&linear);
        let step = space.step(h_s);
        let mut state = [0.0; 6];
        let mut outputs = Vec::with_capacity(STEPS + 1);
        for _ in 0..=STEPS {
            outputs.push(linear.gain() * state[space.output] / gain);
            let free = crate::matrix::times(&step.phi, &state);
            for i in 0..6 {
                state[i] = free[i] + step.held[i];
            }
        }
        let slope = |i: usize| 0.5 * (outputs[i + 1] - outputs[i - 1]) / h_s;
        let steepest = (1..STEPS).max_by(|&a, &b| slope(a).total_cmp(&slope(b)))?;
        let tangent_s = h_s * steepest as f64 - outputs[steepest] / slope(steepest);
        let level = 1.0 - (-1.0_f64).exp();
        let after = outputs.iter().position(|y| *y > level)?;
        let part = (level - outputs[after - 1]) / (outputs[after] - outputs[after - 1]);
        let reached_s = h_s * (after as f64 - 1.0 + part);
        Some(Self::SelfRegulating {
            gain,
            lag_s: reached_s - tangent_s,
            dead_time_s: linear.tau_s() + tangent_s,
        })
    }
}

/// AMIGO rule. `None` for another form than PI and PID, or without dead time.
#[must_use]
pub fn amigo(features: &StepFeatures, form: Form) -> Option<Pid> {
    let ideal = match (*features, form) {
        (
            StepFeatures::SelfRegulating {
                gain,
                lag_s: t,
                dead_time_s: l,
            },
            Form::Pi,
        ) => Ideal::new(
            (0.15 + (0.35 - l * t / (l + t).powi(2)) * t / l) / gain,
            0.35 * l + 13.0 * l * t * t / (t * t + 12.0 * l * t + 7.0 * l * l),
            0.0,
        ),
        (
            StepFeatures::SelfRegulating {
                gain,
                lag_s: t,
                dead_time_s: l,
            },
            Form::Pid,
        ) => Ideal::new(
            (0.2 + 0.45 * t / l) / gain,
            (0.4 * l + 0.8 * t) / (l + 0.1 * t) * l,
            0.5 * l * t / (0.3 * l + t),
        ),
        (
            StepFeatures::Integrating {
                slope,
                dead_time_s: l,
            },
            Form::Pi,
        ) => Ideal::new(0.35 / (slope * l), 13.4 * l, 0.0),
        (
            StepFeatures::Integrating {
                slope,
                dead_time_s: l,
            },
            Form::Pid,
        ) => Ideal::new(0.45 / (slope * l), 8.0 * l, 0.5 * l),
        _ => return None,
    };
    ideal.gain.is_finite().then(|| ideal.pid())
}

/// Proportional gain at which the loop oscillates, and the period of this oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Ultimate {
    /// Ultimate gain (input unit / output unit).
    pub gain: f64,
    /// Ultimate period (s).
    pub period_s: f64,
}

/// Step of the search for the ultimate frequency, as a factor, and its range in units of the process.
const FACTOR: f64 = 1.02;
const RANGE: [f64; 2] = [1e-4, 1e8];

impl Ultimate {
    /// Ultimate gain (input unit / output unit) and period (s).
    #[must_use]
    pub fn new(gain: f64, period_s: f64) -> Self {
        Self { gain, period_s }
    }

    /// Of a model: where its phase first falls through -180 deg. `None` if it does not, for two integrators, or with
    /// parameters out of range.
    #[must_use]
    pub fn of(model: &Model) -> Option<Self> {
        let process = Process::new(&model.linear(), &Execution::default())?;
        if process.integrators() > 1 || !process.is_stable() {
            return None;
        }
        let denominator = process.stage_denominator();
        // Phase above -pi: from one denominator angle to the next without jumps while it is between 0 and pi.
        let above = |omega: f64| {
            let lag = process.tau * omega;
            let angle = denominator.at(omega).arg().rem_euclid(TAU);
            PI - lag - angle
        };
        let mut omega = RANGE[0];
        while omega < RANGE[1] {
            let next = omega * FACTOR;
            if above(next) < 0.0 {
                let ultimate = root(above, omega, next, 0.0);
                let gain = denominator.at(ultimate).norm() / process.gain;
                return Some(Self::new(gain, TAU * process.unit_s / ultimate));
            }
            omega = next;
        }
        None
    }
}

/// Ziegler-Nichols rule from the ultimate gain. `None` for another form than P, PI and PID.
#[must_use]
pub fn ziegler_nichols(ultimate: &Ultimate, form: Form) -> Option<Pid> {
    let Ultimate { gain, period_s } = *ultimate;
    let ideal = match form {
        Form::P => Ideal::new(0.5 * gain, f64::INFINITY, 0.0),
        Form::Pi => Ideal::new(0.45 * gain, period_s / 1.2, 0.0),
        Form::Pid => Ideal::new(0.6 * gain, 0.5 * period_s, 0.125 * period_s),
        _ => return None,
    };
    Some(ideal.pid())
}

/// Rule without overshoot from the ultimate gain: `Kp = 0.2 KU`, `Ti = TU/2`, `Td = TU/3`. `None` for another form than PID.
#[must_use]
pub fn no_overshoot(ultimate: &Ultimate, form: Form) -> Option<Pid> {
    let Ultimate { gain, period_s } = *ultimate;
    let ideal = Ideal::new(0.2 * gain, 0.5 * period_s, period_s / 3.0);
    (form == Form::Pid).then(|| ideal.pid())
}

/// Tyreus-Luyben rule from the ultimate gain. `None` for another form than PI and PID.
#[must_use]
pub fn tyreus_luyben(ultimate: &Ultimate, form: Form) -> Option<Pid> {
    let Ultimate { gain, period_s } = *ultimate;
    let ideal = match form {
        Form::Pi => Ideal::new(gain / 3.2, 2.2 * period_s, 0.0),
        Form::Pid => Ideal::new(gain / 2.2, 2.2 * period_s, period_s / 6.3),
        _ => return None,
    };
    Some(ideal.pid())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Linear, Structure};

    fn near(found: f64, published: f64, digits: f64) {
        assert!(
            (found - published).abs() <= 0.5 * digits,
            "{found} {published}"
        );
    }

    // Skogestad (2003), table 4, E1: 1/((s + 1)(0.2 s + 1)) has the first-order model T = 1.1, theta = 0.1, and the PI
    // Kc = 5.5, Ti = 0.8.
    #[test]
    fn simc_of_skogestads_first_example() {
        let model: Model = Linear::new(Structure::Soptd)
            .with_pole_per_s(1.0)
            .with_lags_s([0.2, 1.0])
            .into();
        let half = HalfRule::of(&model, Form::Pi).unwrap();
        near(half.first_s, 1.1, 1e-9);
        near(half.dead_time_s, 0.1, 1e-9);
        let ideal = simc(&half, half.dead_time_s).unwrap().ideal().unwrap();
        near(ideal.gain, 5.5, 1e-9);
        near(ideal.integral_time_s, 0.8, 1e-9);
    }

    // E2, reduced by the half rule to T1 = 2.5, theta = 1.47 and to T1 = 2, T2 = 1.2, theta = 0.77: Kc = 0.85, Ti = 2.5,
    // and in series form Kc = 1.30, Ti = 2, Td = 1.2.
    #[test]
    fn simc_of_skogestads_second_example() {
        let first = HalfRule::new(1.0 / 2.5, [2.5, 0.0], 1.47);
        let series = simc(&first, 1.47).unwrap().series().unwrap();
        near(series.gain, 0.85, 0.01);
        near(series.integral_time_s, 2.5, 1e-9);
        let second = HalfRule::new(0.5, [2.0, 1.2], 0.77);
        let series = simc(&second, 0.77).unwrap().series().unwrap();
        near(series.gain, 1.30, 0.01);
        near(series.integral_time_s, 2.0, 1e-9);
        near(series.derivative_time_s, 1.2, 1e-9);
    }

    // Half rule of an integrating process by hand: lags 0.7 and 0.2 behind 2/s e^(-0.3 s). First order: half of 0.7 has no
    // lag to go to (the integrator takes it), theta = 0.3 + 0.35 + 0.2 = 0.85. Second order: T2 = 0.7 + 0.1, theta = 0.4.
    #[test]
    fn half_rule_of_an_integrating_process_by_hand() {
        let model: Model = Linear::new(Structure::Soiptd)
            .with_gain(2.0 / 0.7)
            .with_pole_per_s(1.0 / 0.7)
            .with_lags_s([0.2, 1.0])
            .with_tau_s(0.3)
            .into();
        let pi = HalfRule::of(&model, Form::Pi).unwrap();
        near(pi.slope, 2.0, 1e-9);
        near(pi.dead_time_s, 0.85, 1e-9);
        let pid = HalfRule::of(&model, Form::Pid).unwrap();
        near(pid.second_s, 0.8, 1e-9);
        near(pid.dead_time_s, 0.4, 1e-9);
        let rule = simc(&pi, 0.85).unwrap().ideal().unwrap();
        near(rule.gain, 1.0 / (2.0 * 1.7), 1e-9);
        near(rule.integral_time_s, 6.8, 1e-9);
    }

    // The balanced example of the article, 1/(s + 1)^4 with L = 1.42 and T = 2.9. By hand from the rule: L T/(L + T)^2 = 0.2207,
    // so PI K = 0.15 + 0.1293 T/L = 0.414, Ti = 2.66; PID K = 0.2 + 0.45 T/L = 1.12, Ti = 2.40, Td = 0.619.
    #[test]
    fn amigo_of_the_balanced_process() {
        let features = StepFeatures::SelfRegulating {
            gain: 1.0,
            lag_s: 2.9,
            dead_time_s: 1.42,
        };
        let pi = amigo(&features, Form::Pi).unwrap().ideal().unwrap();
        near(pi.gain, 0.414, 1e-3);
        near(pi.integral_time_s, 2.66, 1e-2);
        let pid = amigo(&features, Form::Pid).unwrap().ideal().unwrap();
        near(pid.gain, 1.12, 1e-2);
        near(pid.integral_time_s, 2.40, 1e-2);
        near(pid.derivative_time_s, 0.619, 1e-3);
    }

    // Two lags of 1 s: y = 1 - (1 + t) e^-t is steepest at t = 1, where y = 1 - 2/e and dy/dt = 1/e: the tangent meets zero at
    // 1 - (e - 2) = 3 - e. 63 % is reached at t with (1 + t) e^-t = 1/e: t = 2.146193.
    #[test]
    fn features_of_two_equal_lags_by_hand() {
        let model: Model = Linear::new(Structure::Soptd)
            .with_pole_per_s(1.0)
            .with_tau_s(0.5)
            .into();
        let Some(StepFeatures::SelfRegulating {
            gain,
            lag_s,
            dead_time_s,
        }) = StepFeatures::of(&model)
        else {
            panic!("two lags settle");
        };
        let tangent = 3.0 - std::f64::consts::E;
        near(gain, 1.0, 1e-12);
        near(dead_time_s, 0.5 + tangent, 1e-5);
        near(lag_s, 2.146_193 - tangent, 1e-5);
    }

    // Our own example: (1 + j w)^3 has the phase -pi at w = sqrt(3), where its magnitude is 8. So the ultimate gain is 8, the
    // period 2 pi/sqrt(3) = 3.63 s; PID K = 4.8, Ti = 1.81, Td = 0.45.
    #[test]
    fn ziegler_nichols_of_three_lags() {
        let model: Model = Linear::new(Structure::ResonantLag)
            .with_lags_s([1.0, 1.0])
            .with_pair(2.0, 1.0)
            .into();
        let ultimate = Ultimate::of(&model).unwrap();
        near(ultimate.gain, 8.0, 1e-9);
        near(ultimate.period_s, TAU / 3.0_f64.sqrt(), 1e-9);
        let pid = ziegler_nichols(&ultimate, Form::Pid)
            .unwrap()
            .ideal()
            .unwrap();
        near(pid.gain, 4.8, 1e-9);
        near(pid.integral_time_s, 1.81, 1e-2);
        near(pid.derivative_time_s, 0.45, 1e-2);
    }

    // Tyreus, Luyben (1992): an integrator with dead time D has Ku = pi/(2 K D), Pu = 4 D, and the PI Kc = 0.487/(K D),
    // Ti = 8.75 D; the rule rounds both to about 1 %. Luyben (1996), abstract: the PID has Kc = 0.46 Ku, and Td is the inverse
    // of the ultimate frequency.
    #[test]
    fn tyreus_luyben_of_an_integrator_with_dead_time() {
        let model: Model = Linear::new(Structure::Iptd)
            .with_gain(2.0)
            .with_tau_s(0.5)
            .into();
        let ultimate = Ultimate::of(&model).unwrap();
        near(ultimate.gain, std::f64::consts::FRAC_PI_2, 1e-9);
        near(ultimate.period_s, 2.0, 1e-9);
        let pi = tyreus_luyben(&ultimate, Form::Pi).unwrap().ideal().unwrap();
        near(pi.gain, 0.487, 0.01);
        near(pi.integral_time_s, 8.75 * 0.5, 0.1);
        let pid = tyreus_luyben(&ultimate, Form::Pid)
            .unwrap()
            .ideal()
            .unwrap();
        near(pid.gain / ultimate.gain, 0.46, 0.02);
        near(pid.derivative_time_s * TAU / ultimate.period_s, 1.0, 0.01);
    }
}
