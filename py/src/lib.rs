//! The extension module of the Python package `onecycle`: bindings without logic of their own.
//!
//! Keywords become a request of the library, its report objects. Long work runs in a thread of its own; the calling thread looks
//! for Ctrl-C.

#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments from Python and errors are handed over by value"
)]

mod process;
mod waited;

use std::path::PathBuf;
use std::time::Instant;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use onecycle::results::log_gains::NamedFiles;
use onecycle::source::is_flight_log;
use onecycle::words::verdict::advice;
use onecycle::{DesignRequest, Error, Report, Request};
use onecycle_cli::report::json::to_text;
use onecycle_cli::report::{flight, identify as shown};
use onecycle_cli::style::plain;
use onecycle_cli::words::with_options;
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::{depythonize, pythonize};

use crate::waited::waited;

create_exception!(
    _onecycle,
    OnecycleError,
    PyValueError,
    "Input that cannot be used. The message says what is wrong and what to do."
);

fn refused(sentence: impl ToString) -> PyErr {
    OnecycleError::new_err(sentence.to_string())
}

/// What keywords ask for.
fn asked<T: serde::de::DeserializeOwned>(settings: &Bound<'_, PyDict>) -> PyResult<T> {
    depythonize(settings).map_err(refused)
}

/// Writes the files with parameters, or none where one of them exists.
fn write(files: Option<&NamedFiles>) -> Result<(), Error> {
    let Some(files) = files else {
        return Ok(());
    };
    let all = [
        (&files.restore, &files.text.restore),
        (&files.path, &files.text.apply),
    ];
    if let Some((path, _)) = all.iter().find(|(path, _)| path.exists()) {
        let reason = format!("{} exists: name another file with `write`", path.display());
        return Err(Error::Request(reason));
    }
    for (path, text) in all {
        std::fs::write(path, text).map_err(|error| Error::Unreadable {
            name: path.display().to_string(),
            reason: error.to_string(),
        })?;
    }
    Ok(())
}

/// A recording of a control loop.
#[pyclass(frozen, module = "onecycle")]
struct Recording(onecycle::Recording);

#[pymethods]
impl Recording {
    #[new]
    #[pyo3(signature = (t, u, y, r = None))]
    fn new(
        t: PyReadonlyArray1<'_, f64>,
        u: PyReadonlyArray1<'_, f64>,
        y: PyReadonlyArray1<'_, f64>,
        r: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        let (t, u, y) = (t.as_slice()?, u.as_slice()?, y.as_slice()?);
        let recording = match &r {
            None => onecycle::Recording::from_samples(t, u, y),
            Some(r) => onecycle::Recording::from_closed_loop(t, u, y, r.as_slice()?),
        };
        recording.map(Self).map_err(refused)
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    /// Time stamps in seconds.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.time_s())
    }

    /// Process input.
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.input())
    }

    /// Process output.
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.output())
    }

    /// Set-point, if it was recorded.
    #[getter]
    fn r<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        Some(PyArray1::from_slice(py, self.0.set_point()?))
    }

    /// Sample period in seconds.
    #[getter]
    fn sample_period_s(&self) -> f64 {
        self.0.sample_period_s()
    }
}

#[pyfunction]
fn read(py: Python<'_>, path: PathBuf, settings: &Bound<'_, PyDict>) -> PyResult<Recording> {
    let request: Request = asked(settings)?;
    let recording = waited(py, move || request.read(&path))?;
    recording.map(Recording).map_err(refused)
}

/// What was identified, and the time that it took (s).
#[pyclass(module = "onecycle")]
struct Found(Report, f64);

/// Identifies in another thread.
fn found(
    py: Python<'_>,
    work: impl FnOnce() -> Result<Report, Error> + Send + 'static,
) -> PyResult<Found> {
    let (found, took_s) = waited(py, move || {
        let begin = Instant::now();
        let found = work();
        (found, begin.elapsed().as_secs_f64())
    })?;
    let found = found.map_err(refused)?;
    write(found.files()).map_err(refused)?;
    Ok(Found(found, took_s))
}

#[pymethods]
impl Found {
    #[getter]
    fn took_s(&self) -> f64 {
        self.1
    }

    fn json(&self) -> String {
        to_text(&self.0)
    }

    fn dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        pythonize(py, &self.0).map_err(refused)
    }

    fn page(&mut self) -> String {
        shown::page(&mut self.0)
    }

    fn text(&self) -> String {
        plain(&with_options(&shown::text(&self.0, true)))
    }

    fn refusal(&self) -> Option<String> {
        let verdict = self.0.identification.outcome.as_ref().err()?;
        Some(format!("{verdict}: {}", advice(verdict)))
    }

    /// The identified process, to the last bit.
    fn model(&self) -> Option<process::Model> {
        let identified = self.0.identification.outcome.as_ref().ok()?;
        Some(process::Model(identified.model))
    }

    /// Parameter of every draw from the posterior, by key.
    fn posterior<'py>(&self, py: Python<'py>) -> Vec<(&'static str, Bound<'py, PyArray1<f64>>)> {
        let Ok(identified) = &self.0.identification.outcome else {
            return vec![];
        };
        let structure = identified.model.structure();
        let values = |&parameter: &onecycle::Parameter| {
            let values = identified.posterior.values(parameter);
            (parameter.key(), values.into_pyarray(py))
        };
        structure.parameters().iter().map(values).collect()
    }
}

#[pyfunction]
fn identify_file(py: Python<'_>, path: PathBuf, settings: &Bound<'_, PyDict>) -> PyResult<Found> {
    let request: Request = asked(settings)?;
    found(py, move || {
        if request.is_of_all_loops() && is_flight_log(&path) {
            return Err(Error::Request(format!(
                "{} is a flight log: choose one of its loops with `axis` and `loop`",
                path.display()
            )));
        }
        request.identify(&path)
    })
}

#[pyfunction]
fn identify_recording(
    py: Python<'_>,
    name: String,
    recording: &Recording,
    settings: &Bound<'_, PyDict>,
) -> PyResult<Found> {
    let request: Request = asked(settings)?;
    let recording = recording.0.clone();
    found(py, move || request.identify_recording(&name, recording))
}

/// Every loop of a flight log.
#[pyclass(frozen, module = "onecycle")]
struct Survey(onecycle::Survey);

#[pymethods]
impl Survey {
    fn json(&self) -> String {
        to_text(&self.0)
    }

    fn dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        pythonize(py, &self.0).map_err(refused)
    }

    fn text(&self) -> String {
        plain(&with_options(&flight::text(&self.0, false)))
    }
}

#[pyfunction]
fn identify_flight(
    py: Python<'_>,
    path: PathBuf,
    settings: &Bound<'_, PyDict>,
) -> PyResult<Survey> {
    let request: Request = asked(settings)?;
    let surveyed = waited(py, move || request.survey(&path))?.map_err(refused)?;
    write(surveyed.files.as_ref()).map_err(refused)?;
    Ok(Survey(surveyed))
}

#[pyfunction]
fn design<'py>(
    py: Python<'py>,
    model: &process::Model,
    settings: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let request: DesignRequest = asked(settings)?;
    let model = model.0;
    let designed = waited(py, move || request.design(model))?.map_err(refused)?;
    pythonize(py, &designed).map_err(refused)
}

#[pymodule]
fn _onecycle(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("OnecycleError", module.py().get_type::<OnecycleError>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Recording>()?;
    module.add_class::<Found>()?;
    module.add_class::<Survey>()?;
    module.add_class::<process::Model>()?;
    module.add_function(wrap_pyfunction!(read, module)?)?;
    module.add_function(wrap_pyfunction!(identify_file, module)?)?;
    module.add_function(wrap_pyfunction!(identify_recording, module)?)?;
    module.add_function(wrap_pyfunction!(identify_flight, module)?)?;
    module.add_function(wrap_pyfunction!(design, module)?)?;
    Ok(())
}
