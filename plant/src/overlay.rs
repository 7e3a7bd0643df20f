//! A closed loop driven by a logged set-point, as a firmware runs it.
//!
//! ```text
//! u = kp e + ki int e dt + kd v + ff rf + fd drf/dt,     e = F_e (rf - y),    rf = F_t r,    v = d(F_d e)/dt  or  -d(F_d y)/dt
//! ```
//!
//! `F_e` is the filter of the measurement of the [`Execution`](onecycle_design::Execution), `F_d` that of the derivative.
//! A recorded filter is part of the output `y`, instead of its delay in the model.
//! The process starts at rest and has no disturbances. Between its samples the controller holds its output.

use onecycle_design::{LowPass, Model, Pid};

use crate::disturbance::Disturbances;
use crate::linear::FixedStepLinear;
use crate::noise::Noise;

/// Longest step of the controller (s), and the share of the shortest filter time that it may have.
const LONGEST_STEP_S: f64 = 1e-3;
const SHARE: f64 = 0.125;

/// Cutoff of the derivative of the set-point (Hz).
const AHEAD_HZ: f64 = 30.0;

/// Most steps of a simulation.
const MOST_STEPS: f64 = 2e7;

/// A loop with the gains in force.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FollowedLoop {
    /// Gains and filters; the measurement filter `Tf` and the set-point weight are not used.
    pub pid: Pid,
    /// Gain of the feed-forward of the set-point (input unit / output unit).
    pub feed_forward: f64,
    /// Gain of the feed-forward of the derivative of the set-point (input unit s / output unit). The derivative passes a
    /// first-order filter of 30 Hz: a firmware smooths it, and the log holds the set-point in steps.
    pub feed_forward_rate: f64,
    /// Whether the derivative acts on the error.
    pub derivative_on_error: bool,
    /// Filter of the set-point.
    pub target: Option<LowPass>,
}

impl FollowedLoop {
    /// A loop without feed-forward, derivative on the measurement.
    #[must_use]
    pub fn new(pid: Pid) -> Self {
        Self {
            pid,
            feed_forward: 0.0,
            feed_forward_rate: 0.0,
            derivative_on_error: false,
            target: None,
        }
    }

    /// Output of `model` at the times (s, ascending) of a set-point that is held between them. `None`: there are fewer
    /// than two times, they do not ascend, the record is too long, or the loop is unstable.
    #[must_use]
    pub fn follow(&self, model: &Model, time_s: &[f64], set_point: &[f64]) -> Option<Vec<f64>> {
        let (first_s, last_s) = (*time_s.first()?, *time_s.last()?);
        let step_s = self.step_s();
        if !(last_s > first_s && (last_s - first_s) / step_s < MOST_STEPS) {
            return None;
        }
        // Without disturbances nothing is drawn.
        let mut noise = Noise::from_seed(0);
        let execution = &self.pid.execution;
        let recorded_s = execution.recorded_filter.map_or(0.0, LowPass::time_s);
        let linear = model.linear();
        let linear = linear.with_tau_s((linear.tau_s() - recorded_s).max(0.0));
        let mut process =
            FixedStepLinear::new(&linear, &Disturbances::default(), step_s, &mut noise);
        let [mut recorded, mut target, mut ahead, mut error, mut slope] = [
            Filter::new(execution.recorded_filter),
            Filter::new(self.target),
            Filter::new(Some(LowPass::first_order(AHEAD_HZ))),
            Filter::new(execution.sensor_filter),
            Filter::new(execution.derivative_filter),
        ];
        let mut integral = 0.0;
        let mut step = 0_u64;
        let mut outputs = Vec::with_capacity(time_s.len());
        for (row, &until_s) in time_s.iter().enumerate() {
            let reference = set_point.get(row.saturating_sub(1)).copied()?;
            while first_s + step_s * (step as f64) < until_s {
                let (y, _) = recorded.step(process.output(), step_s);
                let (aim, _) = target.step(reference, step_s);
                let (_, aim_rate) = ahead.step(aim, step_s);
                let (e, _) = error.step(aim - y, step_s);
                integral += e * step_s;
                let moved = if self.derivative_on_error { e } else { -y };
                let (_, rate) = slope.step(moved, step_s);
                let u = self.pid.kp * e
                    + self.pid.ki * integral
                    + self.pid.kd * rate
                    + self.feed_forward * aim
                    + self.feed_forward_rate * aim_rate;
                process.step(u, &mut noise);
                step += 1;
            }
            outputs.push(match recorded.kind {
                Some(_) => recorded.value,
                None => process.output(),
            });
        }
        let size = |values: &[f64]| {
            values
                .iter()
                .fold(0.0_f64, |most, value| most.max(value.abs()))
        };
        // A loop that amplifies its reference a hundredfold is unstable.
        (size(&outputs) <= 100.0 * size(set_point)).then_some(outputs)
    }

    fn step_s(&self) -> f64 {
        let execution = &self.pid.execution;
        let filters = [
            self.target,
            execution.sensor_filter,
            execution.recorded_filter,
            execution.derivative_filter,
        ];
        let times_s = filters
            .into_iter()
            .flatten()
            .map(|filter| SHARE * filter.time_s());
        let own_s = Some(execution.sample_period_s).filter(|period_s| *period_s > 0.0);
        let shortest_s = times_s.chain(own_s).filter(|time_s| *time_s > 0.0);
        shortest_s.fold(LONGEST_STEP_S, f64::min)
    }
}

/// A low-pass filter in steps, and the derivative of its output.
struct Filter {
    kind: Option<LowPass>,
    value: f64,
    rate: f64,
}

impl Filter {
    fn new(kind: Option<LowPass>) -> Self {
        Self {
            kind: kind.filter(|kind| kind.time_s() > 0.0),
            value: 0.0,
            rate: 0.0,
        }
    }

    /// Value and derivative after a step with this input.
    fn step(&mut self, input: f64, step_s: f64) -> (f64, f64) {
        let before = self.value;
        match self.kind {
            Some(LowPass::FirstOrder(time_s)) => {
                self.value += (input - self.value) * step_s / (time_s + step_s);
                self.rate = (self.value - before) / step_s;
            }
            Some(LowPass::SecondOrder(time_s)) => {
                let stiffness = 2.0 / (time_s * time_s);
                self.rate += step_s * stiffness * (input - self.value - time_s * self.rate);
                self.value += step_s * self.rate;
            }
            _ => {
                self.value = input;
                self.rate = (input - before) / step_s;
            }
        }
        (self.value, self.rate)
    }
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Execution, Linear, Structure};

    use super::*;

    // By hand: P on an integrator with gain 1 and no delay is a lag of 1/kp: y = 1 - exp(-kp t), with a derivative
    // (1 - exp(-kp t/(1 + kd))). Steps of 1 ms shift it by about half a step.
    #[test]
    fn loops_by_hand() {
        let model = Model::from(Linear::new(Structure::Iptd).with_gain(1.0));
        let time_s: Vec<f64> = (0..500).map(|row| 0.004 * f64::from(row)).collect();
        let ones = vec![1.0; time_s.len()];
        for kd in [0.0, 0.5] {
            let y = FollowedLoop::new(Pid::new(2.0, 0.0, kd))
                .follow(&model, &time_s, &ones)
                .unwrap();
            for (time_s, y) in time_s.iter().zip(&y) {
                let exact = 1.0 - (-2.0 * time_s / (1.0 + kd)).exp();
                assert!((y - exact).abs() < 4e-3, "{kd} {time_s} {y} {exact}");
            }
        }
        // The feed-forward raises the final value: y = (kp + ff)/kp.
        let mut ahead = FollowedLoop::new(Pid::new(2.0, 0.0, 0.0));
        ahead.feed_forward = 1.0;
        let last = *ahead
            .follow(&model, &time_s, &ones)
            .unwrap()
            .last()
            .unwrap();
        assert!(
            (last - 1.5 * (1.0 - (-4.0_f64).exp())).abs() < 2e-2,
            "{last}"
        );
    }

    // A recorded filter instead of its delay: the ramp that a feed-forward drives through an integrator comes out as late, but
    // its beginning is no corner.
    #[test]
    fn a_recorded_filter_takes_the_place_of_its_delay() {
        let filter = LowPass::second_order(20.0);
        let tau_s = 0.01 + filter.time_s();
        let model = Model::from(
            Linear::new(Structure::Iptd)
                .with_gain(1.0)
                .with_tau_s(tau_s),
        );
        let time_s: Vec<f64> = (0..200).map(|row| 0.001 * f64::from(row)).collect();
        let execution = Execution::default().with_recorded_filter(filter);
        let mut open = FollowedLoop::new(Pid::new(0.0, 0.0, 0.0).with_execution(execution));
        open.feed_forward = 1.0;
        let y = open.follow(&model, &time_s, &vec![1.0; 200]).unwrap();
        assert!((y[199] - (0.199 - tau_s)).abs() < 2e-3, "{}", y[199]);
        // When the delay would end (21 ms), more than 1 ms of the ramp has passed the filter.
        assert!(y[21] > 1e-3 && y[9] < 1e-9, "{} {}", y[21], y[9]);
    }

    // Filters of unit gain leave the final value; an unstable loop and a record without length give nothing.
    #[test]
    fn filters_and_refusals() {
        let model = Model::from(Linear::new(Structure::Iptd).with_gain(1.0).with_tau_s(0.01));
        let time_s: Vec<f64> = (0..2000).map(|row| 0.004 * f64::from(row)).collect();
        let ones = vec![1.0; time_s.len()];
        let execution = Execution::default()
            .with_sensor_filter(LowPass::first_order(20.0))
            .with_derivative_filter(LowPass::second_order(20.0));
        let mut own = FollowedLoop::new(Pid::new(3.0, 0.5, 0.01).with_execution(execution));
        own.target = Some(LowPass::first_order(20.0));
        for on_error in [false, true] {
            own.derivative_on_error = on_error;
            let y = own.follow(&model, &time_s, &ones).unwrap();
            assert!((y.last().unwrap() - 1.0).abs() < 0.02, "{:?}", y.last());
        }
        let unstable = FollowedLoop::new(Pid::new(300.0, 0.0, 0.0));
        assert_eq!(unstable.follow(&model, &time_s, &ones), None);
        assert_eq!(own.follow(&model, &[1.0], &[1.0]), None);
    }
}
