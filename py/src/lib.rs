//! The extension module of the Python package `onecycle`: bindings without logic of their own.
//!
//! Keywords become a request of the library, its report objects. Long work runs in a thread of its own; the calling thread looks
//! for Ctrl-C.

#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments from Python and errors are handed over by value"
)]

mod controller;
mod error;
mod process;
mod report;
mod waited;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use numpy::{PyArray1, PyReadonlyArray1};
use onecycle::results::log_gains::NamedFiles;
use onecycle::source::is_flight_log;
use onecycle::{DesignRequest, Error, Report, Request};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::prelude::*;

use crate::error::{OnecycleError, as_keyword, raised, refused};
use crate::report::{Designed, Found, Survey};
use crate::waited::waited;

/// Settings by name, as text.
type Settings = Vec<(String, String)>;

/// What keywords ask for.
fn asked<T: Default>(
    settings: &Settings,
    set: impl Fn(&mut T, &str, &str) -> Result<(), Error>,
) -> PyResult<T> {
    let mut request = T::default();
    for (name, value) in settings {
        set(&mut request, name, value).map_err(|error| refused(&error))?;
    }
    Ok(request)
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
#[pyclass(frozen, eq, module = "onecycle._onecycle")]
#[derive(PartialEq)]
struct Recording(Arc<onecycle::Recording>);

#[pymethods]
impl Recording {
    #[new]
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
        match recording {
            Ok(recording) => Ok(Self(Arc::new(recording))),
            Err(error) => Err(raised("recording", &error.to_string(), None)),
        }
    }

    /// All of it, for `of_stored`.
    fn stored<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = postcard::to_allocvec(&*self.0);
        let bytes = bytes.map_err(|error| raised("recording", &error.to_string(), None))?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[staticmethod]
    fn of_stored(bytes: &[u8]) -> PyResult<Self> {
        let recording = postcard::from_bytes(bytes);
        let other = |_| "the recording was stored by another version of onecycle".to_owned();
        let recording = recording.map_err(other);
        let recording = recording.map_err(|sentence| raised("recording", &sentence, None))?;
        Ok(Self(Arc::new(recording)))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.time_s())
    }

    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.input())
    }

    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.output())
    }

    #[getter]
    fn r<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        Some(PyArray1::from_slice(py, self.0.set_point()?))
    }

    #[getter]
    fn sample_period_s(&self) -> f64 {
        self.0.sample_period_s()
    }
}

#[pyfunction]
fn read(py: Python<'_>, path: PathBuf, settings: Settings) -> PyResult<Recording> {
    let request = asked(&settings, Request::set)?;
    let recording = waited(py, move || request.read(&path))?;
    let recording = recording.map_err(|error| refused(&error))?;
    Ok(Recording(Arc::new(recording)))
}

/// What is identified from: a file, or a recording in memory with its name.
#[derive(FromPyObject)]
enum Source<'py> {
    Recording(String, PyRef<'py, Recording>),
    File(PathBuf),
}

/// The same, out of the interpreter's hands.
enum Given {
    Recording(String, Arc<onecycle::Recording>),
    File(PathBuf),
}

impl From<Source<'_>> for Given {
    fn from(source: Source<'_>) -> Self {
        match source {
            Source::Recording(name, recording) => Self::Recording(name, Arc::clone(&recording.0)),
            Source::File(path) => Self::File(path),
        }
    }
}

impl Given {
    fn report(self, request: &Request) -> Result<Report, Error> {
        match self {
            Self::File(path) if request.is_of_all_loops() && is_flight_log(&path) => {
                Err(Error::Request(format!(
                    "{} is a flight log: choose one of its loops with `axis` and `loop`",
                    path.display()
                )))
            }
            Self::File(path) => request.identify(&path),
            Self::Recording(name, recording) => {
                request.identify_recording(&name, Arc::unwrap_or_clone(recording))
            }
        }
    }

    /// The report, and the time that it took (s).
    fn timed(self, request: &Request) -> Result<(Report, f64), Error> {
        let begin = Instant::now();
        let report = self.report(request)?;
        Ok((report, begin.elapsed().as_secs_f64()))
    }
}

fn found((report, took_s): (Report, f64)) -> PyResult<Found> {
    write(report.files()).map_err(|error| refused(&error))?;
    Ok(Found::new(report, took_s))
}

#[pyfunction]
fn identify(py: Python<'_>, source: Source<'_>, settings: Settings) -> PyResult<Found> {
    let request = asked(&settings, Request::set)?;
    let given = Given::from(source);
    let report = waited(py, move || given.timed(&request))?;
    found(report.map_err(|error| refused(&error))?)
}

/// Identifies from every source, on this number of `threads`; 0 stands for one thread a core. The first error ends it.
#[pyfunction]
fn identify_many(
    py: Python<'_>,
    sources: Vec<Source<'_>>,
    threads: usize,
    settings: Settings,
) -> PyResult<Vec<Found>> {
    let request = asked(&settings, Request::set)?;
    let given: Vec<Given> = sources.into_iter().map(Given::from).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| raised("request", &error.to_string(), None))?;
    // Set after Ctrl-C: what has not begun is left.
    let is_left = Arc::new(AtomicBool::new(false));
    let leave = Arc::clone(&is_left);
    let work = move || {
        let one = |given: Given| match is_left.load(Ordering::Relaxed) {
            true => Err(Error::Request("interrupted".to_owned())),
            false => given.timed(&request),
        };
        pool.install(|| given.into_par_iter().map(one).collect())
    };
    let reports: PyResult<Result<Vec<_>, Error>> = waited(py, work);
    if reports.is_err() {
        leave.store(true, Ordering::Relaxed);
    }
    let reports = reports?.map_err(|error| refused(&error))?;
    reports.into_iter().map(found).collect()
}

#[pyfunction]
fn identify_flight(py: Python<'_>, path: PathBuf, settings: Settings) -> PyResult<Survey> {
    let request = asked(&settings, Request::set)?;
    let surveyed = waited(py, move || request.survey(&path))?.map_err(|error| refused(&error))?;
    write(surveyed.files.as_ref()).map_err(|error| refused(&error))?;
    Ok(Survey(surveyed))
}

#[pyfunction]
fn design(py: Python<'_>, model: &process::Model, settings: Settings) -> PyResult<Designed> {
    let request = asked(&settings, DesignRequest::set)?;
    let model = model.0;
    let designed = waited(py, move || request.design(model))?.map_err(|error| refused(&error))?;
    Ok(Designed(designed))
}

/// A text with the options of the program.
#[pyfunction]
fn with_options(text: &str) -> String {
    onecycle_cli::words::with_options(text).into_owned()
}

#[pymodule]
fn _onecycle(module: &Bound<'_, PyModule>) -> PyResult<()> {
    onecycle_cli::words::show_settings(as_keyword);
    let error = module.py().get_type::<OnecycleError>();
    for name in ["kind", "setting", "file"] {
        error.setattr(name, module.py().None())?;
    }
    // Where users find it, and pickle.
    error.setattr("__module__", "onecycle")?;
    module.add("OnecycleError", error)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Recording>()?;
    module.add_class::<Found>()?;
    module.add_class::<Survey>()?;
    module.add_class::<Designed>()?;
    module.add_class::<process::Model>()?;
    module.add_function(wrap_pyfunction!(read, module)?)?;
    module.add_function(wrap_pyfunction!(identify, module)?)?;
    module.add_function(wrap_pyfunction!(identify_many, module)?)?;
    module.add_function(wrap_pyfunction!(identify_flight, module)?)?;
    module.add_function(wrap_pyfunction!(design, module)?)?;
    module.add_function(wrap_pyfunction!(with_options, module)?)?;
    Ok(())
}
