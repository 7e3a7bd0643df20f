//! Shapes of each form: the controller up to its gain, from the variables of the search.
//!
//! | form | variables: logarithms of, in units of the process |
//! |------|-----------|
//! | P | - |
//! | PI | `Ti` |
//! | PD | `Td` |
//! | PID | `Ti`, `Td` |
//! | cascade with PI | integral time of the rate loop, `1/angle_p` |
//! | cascade with PID | the same, and the derivative time of the rate loop |
//!
//! A filter time that is searched is the last variable.

use crate::analysis::{Law, Process};
use crate::cascade::Cascade;
use crate::controller::{Autopilot, Controller, Execution, Form};

/// Filter times of the starts, in least ones.
const FILTERS: [f64; 2] = [0.5, 5.0];

/// How the filter time is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Filter {
    /// This time, in the unit of the process.
    Fixed(f64),
    /// This time, in the unit of the process, plus a variable of the search.
    Searched(f64),
}

/// Form and filter: what turns variables into laws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Family {
    pub form: Form,
    pub filter: Filter,
}

/// Longest time of a shape: 5000 units. A longer one would act below the grid of frequencies.
const LARGEST_VARIABLE: f64 = 8.5;

/// Shortest time of a shape, as a share of the dead time and lags behind the two longest ones: a shorter one acts above
/// all frequencies of the loop.
const SHORTEST: f64 = 1e-2;

impl Family {
    fn tf(&self, z: &[f64]) -> f64 {
        match self.filter {
            Filter::Fixed(time) => time,
            Filter::Searched(least) => least + z.last().map_or(0.0, |ln| ln.exp()),
        }
    }

    /// Whether a shape is in the range of the search.
    pub(crate) fn is_in_range(&self, process: &Process, z: &[f64]) -> bool {
        let order = process.integrators().max(1);
        let behind = [2, order].map(|order| process.half_rule_dead_time(order));
        let fast = if behind[0] > 0.0 {
            behind[0]
        } else {
            behind[1]
        };
        let least = (SHORTEST * fast).max(1e-8).ln();
        let times = match self.filter {
            Filter::Searched(_) => z.len().saturating_sub(1),
            Filter::Fixed(_) => z.len(),
        };
        z.iter().all(|variable| *variable <= LARGEST_VARIABLE)
            && z[..times].iter().all(|variable| *variable >= least)
    }

    /// Number of variables, from the first one on, whose larger values make the loop slower and more robust.
    pub(crate) fn slow_variables(&self) -> usize {
        match self.form {
            Form::P | Form::Pd => 0,
            Form::Pi | Form::Pid => 1,
            Form::CascadePi | Form::CascadePid => 2,
        }
    }

    /// The law of a shape with gain 1: `kp = 1`, for a cascade `rate_p = 1`.
    pub(crate) fn law(&self, process: &Process, z: &[f64]) -> Law {
        let time = |i: usize| z[i].exp();
        let tf = self.tf(z);
        match self.form {
            Form::P => Law::pid(process, [1.0, 0.0, 0.0], tf),
            Form::Pi => Law::pid(process, [1.0, 1.0 / time(0), 0.0], tf),
            Form::Pd => Law::pid(process, [1.0, 0.0, time(0)], tf),
            Form::Pid => Law::pid(process, [1.0, 1.0 / time(0), time(1)], tf),
            Form::CascadePi | Form::CascadePid => {
                let (rate_i, angle_p) = (1.0 / time(0), 1.0 / time(1));
                Law {
                    kd: 1.0,
                    kf: 0.0,
                    k2: self.rate_d(z),
                    b: angle_p / (angle_p + rate_i),
                    ..Law::pid(process, [angle_p + rate_i, rate_i * angle_p, 0.0], tf)
                }
            }
        }
    }

    /// Derivative time of the rate loop.
    fn rate_d(&self, z: &[f64]) -> f64 {
        if self.form == Form::CascadePid {
            z[2].exp()
        } else {
            0.0
        }
    }

    /// The rate loop of a cascade alone, with gain 1, as in acro mode: on the rate of the process. `None` for another form.
    pub(crate) fn rate_law(&self, process: &Process, z: &[f64]) -> Option<Law> {
        matches!(self.form, Form::CascadePi | Form::CascadePid)
            .then(|| Law::pid(process, [1.0, 1.0 / z[0].exp(), self.rate_d(z)], self.tf(z)))
    }

    /// The controller with gain `k` in the units of the user.
    pub(crate) fn controller(
        &self,
        process: &Process,
        (k, z): (f64, &[f64]),
        b: f64,
        execution: Execution,
    ) -> Controller {
        let law = Law {
            b,
            ..self.law(process, z).scaled(k)
        };
        let pid = law.controller(process).with_execution(execution);
        if self.rate_law(process, z).is_none() {
            return pid.into();
        }
        let t = process.unit_s;
        let gains = Cascade {
            angle_p: 1.0 / (z[1].exp() * t),
            rate_p: pid.kd,
            rate_i: 1.0 / (z[0].exp() * t),
            rate_d: self.rate_d(z) * t,
        };
        (Autopilot::from(gains).with_filter_s(pid.filter_s))
            .with_execution(execution)
            .into()
    }

    /// The family of cascades with PI, for a family of cascades with PID.
    pub(crate) fn without_rate_derivative(&self) -> Option<Self> {
        (self.form == Form::CascadePid).then_some(Self {
            form: Form::CascadePi,
            ..*self
        })
    }

    /// Starts of a cascade with PID from the variables of one with PI.
    pub(crate) fn with_rate_derivative(&self, process: &Process, simpler: &[f64]) -> Vec<Vec<f64>> {
        let fast = process.half_rule_dead_time(2);
        let start = |share: f64| {
            let mut start = simpler.to_vec();
            start.insert(2, (share * fast).ln());
            start
        };
        [0.011, 0.03, 0.1, 0.3, 1.0].map(start).to_vec()
    }

    /// The variables of a cascade with rate derivative, the times of its integral and of its angle loop exchanged: nearly the
    /// same to the whole loop, but not to the rate loop, so that each order has its own optimum.
    pub(crate) fn exchanged(&self, z: &[f64]) -> Option<Vec<f64>> {
        (self.form == Form::CascadePid).then(|| {
            let mut other = z.to_vec();
            other.swap(0, 1);
            other
        })
    }

    /// Variables to start a search from. A cascade with PID starts [from one with PI](Self::with_rate_derivative).
    pub(crate) fn starts(&self, process: &Process) -> Vec<Vec<f64>> {
        // An unstable pole turns the phase as two integrators do.
        let integrators = process.integrators() + 2 * process.unstable_poles();
        let is_integrating = integrators > 0;
        // Dead time and the lags behind the two longest ones: the time scale of a fast loop.
        let fast = process.half_rule_dead_time(2);
        let mut integral_times = vec![0.25, 0.6, 1.2, 3.0];
        if is_integrating {
            integral_times.extend([6.0, 12.0]);
        }
        let is_double = integrators > 1;
        if is_double {
            integral_times.extend([30.0, 100.0, 300.0, 1000.0]);
        }
        if fast > 0.0 && fast < 0.1 {
            integral_times.extend([3.0, 5.0, 8.0, 13.0, 20.0, 35.0, 60.0].map(|t| t * fast));
        }
        let mut derivative_times = vec![0.1, 0.4, 1.0];
        if is_integrating {
            derivative_times.push(3.0);
        }
        if is_double {
            derivative_times.extend([10.0, 30.0]);
        }
        if fast > 0.0 && fast < 0.1 {
            derivative_times.extend([2.0 * fast, 8.0 * fast]);
        }
        let mut starts: Vec<Vec<f64>> = match self.form {
            Form::P => vec![vec![]],
            Form::Pd => derivative_times
                .iter()
                .map(|td: &f64| vec![td.ln()])
                .collect(),
            Form::Pi => integral_times.iter().map(|ti| vec![ti.ln()]).collect(),
            Form::Pid => (integral_times.iter())
                .flat_map(|ti| {
                    let shares: &[f64] = if is_double {
                        &[0.03, 0.12, 0.3, 0.45, 0.6]
                    } else {
                        &[0.12, 0.3, 0.45, 0.6]
                    };
                    shares
                        .iter()
                        .map(move |share| vec![ti.ln(), (ti * share).ln()])
                })
                // The zeros of the controller on a resonance.
                .chain(process.resonance().map(|(peak, damping)| {
                    vec![(2.0 * damping / peak).ln(), -(2.0 * damping * peak).ln()]
                }))
                .collect(),
            Form::CascadePi | Form::CascadePid => (integral_times.iter())
                .map(|ti| vec![(0.5 * ti).ln(), (0.5 * ti).ln()])
                .collect(),
        };
        if let Filter::Searched(least) = self.filter {
            let first = if least > 0.0 { least } else { 0.05 };
            let with_filter = |start: &Vec<f64>| {
                FILTERS.map(|factor| [start.as_slice(), &[(factor * first).ln()]].concat())
            };
            starts = starts.iter().flat_map(with_filter).collect();
        }
        starts
    }
}
