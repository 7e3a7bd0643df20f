//! The extension module of the Python package `onecycle_lab`: campaigns and training sets.

#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments from Python and errors are handed over by value"
)]

mod waited;

use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1};
use onecycle_lab_cli::embed as lab;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};

use crate::waited::waited;

type Columns<'py> = [Bound<'py, PyArray1<f64>>; 3];

/// The error of the package `onecycle`.
fn refused(sentence: String) -> PyErr {
    Python::attach(|py| {
        let error = py
            .import("onecycle")
            .and_then(|of| of.getattr("OnecycleError"));
        match error.and_then(|of| Ok(of.cast_into::<PyType>()?)) {
            Ok(of) => PyErr::from_type(of, sentence),
            Err(error) => error,
        }
    })
}

/// A campaign, whose cases can be computed anywhere.
#[pyclass(frozen, module = "onecycle_lab")]
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

    /// All that decides the outcome of a case, as JSON.
    fn settings(&self) -> String {
        self.0.settings()
    }

    /// Outcomes and truths of the cases from `first` to before `end`, each as JSON on one line.
    fn cases(&self, py: Python<'_>, first: u64, end: u64) -> PyResult<Vec<[String; 2]>> {
        let campaign = Arc::clone(&self.0);
        let work = move || (first..end).map(|n| campaign.case(n)).collect();
        let cases: Result<Vec<[String; 2]>, String> = waited(py, work)?;
        cases.map_err(refused)
    }

    /// Time (s), input and output of case `n`, and its truth as JSON on one line.
    fn recording<'py>(&self, py: Python<'py>, n: u64) -> PyResult<(Columns<'py>, String)> {
        let campaign = Arc::clone(&self.0);
        let made = waited(py, move || campaign.recording(n))?;
        let (of, truth) = made.map_err(refused)?;
        let columns = [of.time_s, of.input, of.output];
        Ok((columns.map(|values| values.into_pyarray(py)), truth))
    }

    /// What the program prints for the outcomes of all cases.
    fn text(&self, py: Python<'_>, cases: Vec<String>) -> PyResult<String> {
        let campaign = Arc::clone(&self.0);
        waited(py, move || campaign.text(&cases))?.map_err(refused)
    }
}

/// A folder of experiments to train on.
#[pyclass(module = "onecycle_lab")]
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
fn _lab(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Campaign>()?;
    module.add_class::<Dataset>()?;
    module.add_function(wrap_pyfunction!(dataset_file, module)?)?;
    Ok(())
}
