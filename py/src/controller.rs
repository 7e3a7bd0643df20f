//! Controllers between Python, where they are fields, and the library.

use onecycle::{Autopilot, Cascade, Controller, Execution, LowPass, Pid};
use pyo3::prelude::*;

/// Order and time (s).
type Filter = Option<(u8, f64)>;

/// The fields of a controller.
#[derive(FromPyObject, IntoPyObject)]
pub(crate) struct Law {
    kp: f64,
    ki: f64,
    kd: f64,
    filter_s: f64,
    setpoint_weight: f64,
    sample_period_s: f64,
    computation_delay_s: f64,
    sensor_filter: Filter,
    recorded_filter: Filter,
    derivative_filter: Filter,
    /// Gains of the angle loop (1/s), the rate loop, its inverse integral time (1/s) and its derivative time (s).
    cascade: Option<(f64, f64, f64, f64)>,
}

fn fields(filter: Option<LowPass>) -> Filter {
    filter.map(|filter| match filter {
        LowPass::FirstOrder(time_s) => (1, time_s),
        other => (2, other.time_s()),
    })
}

fn low_pass(filter: Filter) -> Option<LowPass> {
    filter.map(|(order, time_s)| match order {
        1 => LowPass::FirstOrder(time_s),
        _ => LowPass::SecondOrder(time_s),
    })
}

impl From<&Controller> for Law {
    fn from(of: &Controller) -> Self {
        let pid = of.pid();
        let execution = pid.execution;
        let cascade = match of {
            Controller::Autopilot(of) => {
                let gains = of.gains;
                Some((gains.angle_p, gains.rate_p, gains.rate_i, gains.rate_d))
            }
            _ => None,
        };
        Self {
            kp: pid.kp,
            ki: pid.ki,
            kd: pid.kd,
            filter_s: pid.filter_s,
            setpoint_weight: pid.setpoint_weight,
            sample_period_s: execution.sample_period_s,
            computation_delay_s: execution.computation_delay_s,
            sensor_filter: fields(execution.sensor_filter),
            recorded_filter: fields(execution.recorded_filter),
            derivative_filter: fields(execution.derivative_filter),
            cascade,
        }
    }
}

impl From<Law> for Controller {
    fn from(of: Law) -> Self {
        let mut execution =
            Execution::sampled(of.sample_period_s).with_computation_delay_s(of.computation_delay_s);
        execution.sensor_filter = low_pass(of.sensor_filter);
        execution.recorded_filter = low_pass(of.recorded_filter);
        execution.derivative_filter = low_pass(of.derivative_filter);
        if let Some((angle_p, rate_p, rate_i, rate_d)) = of.cascade {
            let gains = Cascade {
                angle_p,
                rate_p,
                rate_i,
                rate_d,
            };
            let autopilot = Autopilot::from(gains).with_filter_s(of.filter_s);
            return autopilot.with_execution(execution).into();
        }
        let pid = Pid::new(of.kp, of.ki, of.kd)
            .with_filter_s(of.filter_s)
            .with_setpoint_weight(of.setpoint_weight);
        pid.with_execution(execution).into()
    }
}
