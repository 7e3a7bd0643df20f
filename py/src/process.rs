//! Processes: frequency response, margins and step responses with a PID controller.

use std::collections::HashMap;

use numpy::{Complex64, IntoPyArray, PyArray1, PyReadonlyArray1};
use onecycle::{Controller, Linear, Noise, Pid, Structure};
use onecycle_plant::{Disturbances, FixedStepLinear};
use pyo3::prelude::*;

use crate::refused;

/// `kp`, `ki`, `kd`, the time of the measurement filter (s) and the weight of the reference.
fn controller([kp, ki, kd, filter_s, setpoint_weight]: [f64; 5]) -> Controller {
    let mut pid = Pid::new(kp, ki, kd);
    pid.filter_s = filter_s;
    pid.setpoint_weight = setpoint_weight;
    Controller::from(pid)
}

/// A process.
#[pyclass(frozen, module = "onecycle")]
pub(crate) struct Model(pub(crate) onecycle::Model);

#[pymethods]
impl Model {
    /// A structure and its parameters by their keys, as in the JSON report.
    #[new]
    #[pyo3(signature = (structure, **parameters))]
    fn new(structure: &str, parameters: Option<HashMap<String, f64>>) -> PyResult<Self> {
        let of = Structure::from_name(structure);
        let of = of.ok_or_else(|| {
            refused(format!(
                "there is no structure {structure}: see docs/identify-json.md"
            ))
        })?;
        let given = parameters.unwrap_or_default();
        let is_of = |key: &String| {
            of.parameters()
                .iter()
                .any(|parameter| parameter.key() == key)
        };
        if let Some(key) = given.keys().find(|key| !is_of(key)) {
            return Err(refused(format!("{structure} has no parameter {key}")));
        }
        let value = |parameter: onecycle::Parameter| given.get(parameter.key()).copied();
        let linear = Linear::from_parameters(of, value).map_err(refused)?;
        Ok(Self(
            linear.soiptd().map_or_else(|| linear.into(), Into::into),
        ))
    }

    #[getter]
    fn structure(&self) -> &'static str {
        self.0.structure().name()
    }

    /// Value of every parameter, by key.
    #[getter]
    fn parameters(&self) -> Vec<(&'static str, Option<f64>)> {
        let of = |&parameter: &onecycle::Parameter| (parameter.key(), self.0.parameter(parameter));
        self.0.structure().parameters().iter().map(of).collect()
    }

    /// Gain, coefficients of the denominator from the highest power down, for each factor, and dead time (s).
    fn factors(&self) -> (f64, Vec<Vec<f64>>, f64) {
        let linear = self.0.linear();
        let stages = linear.structure().stages();
        let [c1, c0] = linear.pair();
        let mut factors = vec![vec![1.0, 0.0]; stages.integrators];
        factors.extend(linear.lags_s().iter().map(|&lag_s| vec![lag_s, 1.0]));
        factors.extend(vec![vec![1.0, linear.pole_per_s()]; stages.poles]);
        factors.extend(vec![vec![1.0, c1, c0]; stages.pairs]);
        (linear.gain(), factors, linear.tau_s())
    }

    fn frequency_response<'py>(
        &self,
        py: Python<'py>,
        w: PyReadonlyArray1<'_, f64>,
    ) -> Bound<'py, PyArray1<Complex64>> {
        let at = |&w: &f64| {
            let value = self.0.frequency_response(w);
            Complex64::new(value.re, value.im)
        };
        let response: Vec<Complex64> = w.as_array().iter().map(at).collect();
        response.into_pyarray(py)
    }

    /// Phase margin (rad), gain crossover (rad/s), gain margin, phase crossover (rad/s), delay margin (s), Ms and Mt.
    fn margins(&self, gains: [f64; 5]) -> Option<Vec<Option<f64>>> {
        let own = controller(gains);
        let margins = onecycle::margins(&self.0, &own)?;
        let peaks = onecycle::sensitivity(&self.0, &own);
        Some(vec![
            Some(margins.phase_margin_rad),
            Some(margins.gain_crossover_rad_per_s),
            margins.gain_margin,
            margins.phase_crossover_rad_per_s,
            Some(margins.delay_margin_s),
            peaks.map(|peaks| peaks.ms),
            peaks.map(|peaks| peaks.mt),
        ])
    }

    /// Time (s), output and input after a unit step of the reference.
    fn step(&self, gains: [f64; 5]) -> PyResult<(Vec<f64>, Vec<f64>, Vec<f64>)> {
        let own = controller(gains);
        let response = onecycle::step_response(&self.0, &own).map_err(refused)?;
        let rows = response.samples.iter();
        let mut columns = (vec![], vec![], vec![]);
        for sample in rows {
            columns.0.push(sample.t_s);
            columns.1.push(sample.y);
            columns.2.push(sample.u);
        }
        Ok(columns)
    }

    /// Output at every tick from rest, under an input held over each tick.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: PyReadonlyArray1<'_, f64>,
        sample_s: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        if !(sample_s.is_finite() && sample_s > 0.0) {
            return Err(refused(format!(
                "the sample period {sample_s} s must be positive"
            )));
        }
        let process = self.0.linear();
        let steps = process.tau_s() / sample_s;
        if steps > MOST_STEPS {
            return Err(refused(format!(
                "a dead time of {steps:.0} sample periods is too long: the limit is {MOST_STEPS:.0}"
            )));
        }
        let input = u.as_slice()?;
        let output = py.detach(|| {
            // Without disturbances no number is drawn.
            let mut noise = Noise::from_seed(0);
            let mut process =
                FixedStepLinear::new(&process, &Disturbances::default(), sample_s, &mut noise);
            let outputs = input.iter().map(|&input| {
                let output = process.output();
                process.step(input, &mut noise);
                output
            });
            outputs.collect::<Vec<f64>>()
        });
        Ok(output.into_pyarray(py))
    }
}

/// Longest dead time of a simulation, in sample periods.
const MOST_STEPS: f64 = 1e7;
