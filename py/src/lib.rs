//! The extension module of the Python package `onecycle`: bindings without logic of their own.
//!
//! Options arrive as those of the command line, so that the package and the program accept the same. Long work runs in a
//! thread of its own with the interpreter's lock released; the calling thread looks for Ctrl-C.

#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments from Python and errors are handed over by value"
)]

mod process;

use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use onecycle_cli::embed;
use onecycle_lab_cli::embed as lab;
use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

create_exception!(
    _onecycle,
    OnecycleError,
    PyValueError,
    "Input that cannot be used. The message says what is wrong and what to do."
);

fn refused(sentence: impl ToString) -> PyErr {
    OnecycleError::new_err(sentence.to_string())
}

/// Time between two looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Runs work in a thread. After Ctrl-C the result of the thread is dropped.
fn waited<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    let receiver = std::sync::Mutex::new(receiver);
    std::thread::spawn(move || {
        // Nobody receives after Ctrl-C.
        let _ = sender.send(work());
    });
    loop {
        let received = py.detach(|| match receiver.lock() {
            Ok(receiver) => receiver.recv_timeout(LOOK),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        match received {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the computation ended in a panic"));
            }
        }
    }
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
fn read(py: Python<'_>, path: String, options: Vec<String>) -> PyResult<Recording> {
    let recording = waited(py, move || embed::read(&path, &options))?;
    recording.map(Recording).map_err(refused)
}

/// What was identified, and the time that it took (s).
#[pyclass(module = "onecycle")]
struct Found(embed::Found, f64);

/// Identifies in another thread.
fn found(
    py: Python<'_>,
    work: impl FnOnce() -> Result<embed::Found, String> + Send + 'static,
) -> PyResult<Found> {
    let (found, took_s) = waited(py, move || {
        let begin = Instant::now();
        let found = work();
        (found, begin.elapsed().as_secs_f64())
    })?;
    let found = found.map_err(refused)?;
    Ok(Found(found, took_s))
}

#[pymethods]
impl Found {
    #[getter]
    fn took_s(&self) -> f64 {
        self.1
    }

    fn json(&self) -> String {
        self.0.json()
    }

    fn page(&mut self) -> String {
        self.0.page()
    }

    fn text(&self) -> String {
        self.0.text()
    }

    fn remarks(&self) -> Vec<String> {
        self.0.remarks()
    }

    fn details(&self) -> Vec<String> {
        self.0.details()
    }

    fn refusal(&self) -> Option<String> {
        self.0.refusal()
    }

    /// The identified process, to the last bit.
    fn model(&self) -> Option<process::Model> {
        let identified = self.0.identification().outcome.as_ref().ok()?;
        Some(process::Model(identified.model))
    }

    /// Parameter of every draw from the posterior, by key.
    fn posterior<'py>(&self, py: Python<'py>) -> Vec<(&'static str, Bound<'py, PyArray1<f64>>)> {
        let Ok(identified) = &self.0.identification().outcome else {
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
fn identify_file(py: Python<'_>, path: String, options: Vec<String>) -> PyResult<Found> {
    found(py, move || embed::Found::in_file(&path, &options))
}

#[pyfunction]
fn identify_recording(
    py: Python<'_>,
    name: String,
    recording: &Recording,
    options: Vec<String>,
) -> PyResult<Found> {
    let recording = recording.0.clone();
    found(py, move || {
        embed::Found::in_recording(&name, recording, &options)
    })
}

/// Table and JSON report of every loop of a flight log.
#[pyfunction]
fn identify_flight(
    py: Python<'_>,
    path: String,
    options: Vec<String>,
) -> PyResult<(String, String)> {
    waited(py, move || embed::flight(&path, &options))?.map_err(refused)
}

#[pyfunction]
fn design(py: Python<'_>, options: Vec<String>) -> PyResult<String> {
    waited(py, move || embed::design(&options))?.map_err(refused)
}

/// A campaign, whose cases can be computed anywhere.
#[pyclass(frozen, module = "onecycle")]
struct Campaign(Arc<lab::Campaign>);

#[pymethods]
impl Campaign {
    #[new]
    fn new(file: &str, options: Vec<String>) -> PyResult<Self> {
        let campaign = lab::Campaign::read(file, &options).map_err(refused)?;
        Ok(Self(Arc::new(campaign)))
    }

    fn __len__(&self) -> usize {
        self.0.count() as usize
    }

    /// Outcomes of the cases from `first` to before `end`, each as JSON on one line.
    fn cases(&self, py: Python<'_>, first: u64, end: u64) -> PyResult<Vec<String>> {
        let campaign = Arc::clone(&self.0);
        let work = move || (first..end).map(|n| campaign.case(n)).collect();
        let cases: Result<Vec<String>, String> = waited(py, work)?;
        cases.map_err(refused)
    }

    /// What the program prints for the outcomes of all cases.
    fn text(&self, py: Python<'_>, cases: Vec<String>) -> PyResult<String> {
        let campaign = Arc::clone(&self.0);
        waited(py, move || campaign.text(&cases))?.map_err(refused)
    }
}

/// A folder of experiments to train on.
#[pyclass(module = "onecycle")]
struct Dataset(lab::Dataset);

#[pymethods]
impl Dataset {
    #[new]
    fn new(recipe: Option<&str>, options: Vec<String>) -> PyResult<Self> {
        let dataset = lab::Dataset::open(recipe, &options).map_err(refused)?;
        Ok(Self(dataset))
    }

    fn manifest(&self) -> String {
        self.0.manifest()
    }

    fn missing(&self) -> Vec<usize> {
        self.0.missing()
    }

    fn keep(&mut self, file: usize, bytes: &[u8], rows: usize) -> PyResult<()> {
        self.0.keep(file, bytes, rows).map_err(refused)
    }
}

/// Bytes and number of examples of a file.
#[pyfunction]
fn dataset_file<'py>(
    py: Python<'py>,
    manifest: String,
    file: usize,
) -> PyResult<(Bound<'py, PyBytes>, usize)> {
    let made = waited(py, move || lab::dataset_file(&manifest, file))?;
    let (bytes, rows) = made.map_err(refused)?;
    Ok((PyBytes::new(py, &bytes), rows))
}

#[pymodule]
fn _onecycle(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("OnecycleError", module.py().get_type::<OnecycleError>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Recording>()?;
    module.add_class::<Found>()?;
    module.add_class::<process::Model>()?;
    module.add_function(wrap_pyfunction!(read, module)?)?;
    module.add_function(wrap_pyfunction!(identify_file, module)?)?;
    module.add_function(wrap_pyfunction!(identify_recording, module)?)?;
    module.add_function(wrap_pyfunction!(identify_flight, module)?)?;
    module.add_function(wrap_pyfunction!(design, module)?)?;
    module.add_class::<Campaign>()?;
    module.add_class::<Dataset>()?;
    module.add_function(wrap_pyfunction!(dataset_file, module)?)?;
    Ok(())
}
