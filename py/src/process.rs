//! Processes: frequency response, margins and step responses with a PID controller.

use std::collections::HashMap;

use numpy::{Complex64, IntoPyArray, PyArray1, PyReadonlyArray1};
use onecycle::{Controller, Linear, Noise, Parameter, Structure};
use onecycle_plant::{Disturbances, FixedStepLinear};
use pyo3::prelude::*;

use crate::controller::Law;
use crate::error::raised;

/// Difference of a given parameter from the one that the others make, as a share, that rounding explains.
const ROUNDING: f64 = 1e-9;

fn wrong(sentence: &str) -> PyErr {
    raised("request", sentence, None)
}

/// The numbers of a process.
type State = (String, f64, [f64; 2], f64, [f64; 2], f64);

/// A process.
#[pyclass(frozen, eq, module = "onecycle._onecycle")]
#[derive(PartialEq)]
pub(crate) struct Model(pub(crate) onecycle::Model);

#[pymethods]
impl Model {
    /// A structure and its parameters by their keys, as in the JSON report.
    #[new]
    fn new(structure: &str, parameters: HashMap<String, f64>) -> PyResult<Self> {
        let of = Structure::from_name(structure).ok_or_else(|| {
            let names: Vec<&str> = Structure::ALL.iter().map(|of| of.name()).collect();
            wrong(&format!(
                "there is no structure {structure}: take one of {}",
                names.join(", ")
            ))
        })?;
        let known = of.parameters();
        let is_of = |key: &String| known.iter().any(|parameter| parameter.key() == key);
        if let Some(key) = parameters.keys().find(|key| !is_of(key)) {
            let keys: Vec<&str> = known.iter().map(|parameter| parameter.key()).collect();
            return Err(wrong(&format!(
                "{structure} has no parameter {key}: its parameters are {}",
                keys.join(", ")
            )));
        }
        let given = |parameter: Parameter| parameters.get(parameter.key()).copied();
        let linear = Linear::from_parameters(of, given).map_err(|error| {
            let is_missing = given(error.parameter).is_none();
            let key = error.parameter.key();
            wrong(&match is_missing {
                true => format!("{structure} needs {key}, {}", error.requirement),
                false => format!(
                    "{key} must be {}, but is {}",
                    error.requirement, error.value
                ),
            })
        })?;
        let model = onecycle::Model::from(linear);
        for &parameter in known {
            let (Some(given), Some(made)) = (given(parameter), model.parameter(parameter)) else {
                continue;
            };
            // Equal infinities are no contradiction.
            if given != made && (given - made).abs() > ROUNDING * made.abs() {
                return Err(wrong(&format!(
                    "{} is {given}, but the other parameters make it {made}: leave one of them out",
                    parameter.key()
                )));
            }
        }
        Ok(Self(model))
    }

    /// Structure, gain, lags, pole, pair and dead time: the process to the last bit.
    fn state(&self) -> State {
        let linear = self.0.linear();
        let lag_s = |index: usize| linear.lags_s().get(index).copied().unwrap_or(1.0);
        let [c1, c0] = linear.pair();
        let name = linear.structure().name().to_owned();
        let lags_s = [lag_s(0), lag_s(1)];
        (
            name,
            linear.gain(),
            lags_s,
            linear.pole_per_s(),
            [c1, c0],
            linear.tau_s(),
        )
    }

    #[staticmethod]
    fn of_state(state: State) -> PyResult<Self> {
        let (structure, gain, lags_s, pole_per_s, [c1, c0], tau_s) = state;
        let of = Structure::from_name(&structure);
        let of = of.ok_or_else(|| wrong(&format!("there is no structure {structure}")))?;
        let linear = Linear::new(of)
            .with_gain(gain)
            .with_lags_s(lags_s)
            .with_pole_per_s(pole_per_s)
            .with_pair(c1, c0)
            .with_tau_s(tau_s);
        Ok(Self(linear.into()))
    }

    #[getter]
    fn structure(&self) -> &'static str {
        self.0.structure().name()
    }

    /// Value of every parameter, by key.
    #[getter]
    fn parameters(&self) -> Vec<(&'static str, Option<f64>)> {
        let of = |&parameter: &Parameter| (parameter.key(), self.0.parameter(parameter));
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

    /// Phase margin (rad), gain crossover (rad/s), gain margin, phase crossover (rad/s), delay margin (s), Ms and Mt. `None`: the loop
    /// is unstable.
    fn margins(&self, law: Law) -> Option<[Option<f64>; 7]> {
        let own = Controller::from(law);
        let margins = onecycle::margins(&self.0, &own)?;
        let peaks = onecycle::sensitivity(&self.0, &own)?;
        Some([
            Some(margins.phase_margin_rad),
            Some(margins.gain_crossover_rad_per_s),
            margins.gain_margin,
            margins.phase_crossover_rad_per_s,
            Some(margins.delay_margin_s),
            Some(peaks.ms),
            Some(peaks.mt),
        ])
    }

    /// Time (s), output and input after a unit step of the reference.
    fn step<'py>(&self, py: Python<'py>, law: Law) -> PyResult<[Bound<'py, PyArray1<f64>>; 3]> {
        let response = onecycle::step_response(&self.0, &Controller::from(law));
        let response = response.map_err(|error| wrong(&error.to_string()))?;
        let rows = &response.samples;
        let t: Vec<f64> = rows.iter().map(|at| at.t_s).collect();
        let y = rows.iter().map(|at| at.y).collect();
        let u = rows.iter().map(|at| at.u).collect();
        Ok([t, y, u].map(|values| values.into_pyarray(py)))
    }

    /// Output at every tick from rest, under an input held over each tick.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: PyReadonlyArray1<'_, f64>,
        sample_s: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        if !(sample_s.is_finite() && sample_s > 0.0) {
            return Err(wrong(&format!(
                "the sample period {sample_s} s must be positive"
            )));
        }
        let process = self.0.linear();
        let steps = process.tau_s() / sample_s;
        if steps > MOST_STEPS {
            return Err(wrong(&format!(
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
