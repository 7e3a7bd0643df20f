//! The extension module of the Python package `onecycle_lab`: campaigns and training sets.

#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments from Python and errors are handed over by value"
)]

mod waited;

use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
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

    /// Time (s), input and output of case `n`, or `None` if it has no recording, and its truth as JSON on one line.
    fn recording<'py>(&self, py: Python<'py>, n: u64) -> PyResult<(Option<Columns<'py>>, String)> {
        let campaign = Arc::clone(&self.0);
        let made = waited(py, move || campaign.recording(n))?;
        let (of, truth) = made.map_err(refused)?;
        let columns = of.map(|of| [of.time_s, of.input, of.output]);
        let columns = columns.map(|columns| columns.map(|values| values.into_pyarray(py)));
        Ok((columns, truth))
    }

    /// What the program prints for the outcomes of all cases, which an iterator brings as JSON.
    fn text(&self, cases: &Bound<'_, PyAny>) -> PyResult<String> {
        let mut failed = None;
        let mut cases = (cases.try_iter()?)
            .map(|case| case.and_then(|case| case.extract()))
            .map_while(|case: PyResult<String>| case.map_err(|error| failed = Some(error)).ok());
        let text = self.0.text(&mut cases);
        drop(cases);
        failed.map_or(Ok(()), Err)?;
        text.map_err(refused)
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

type Rows<'py> = (
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray1<f32>>,
);

/// The sets of a recipe of the paper's classifier, whose parts can be made anywhere.
#[pyclass(frozen, module = "onecycle_lab")]
struct ClassifierSets(Arc<lab::ClassifierSets>);

#[pymethods]
impl ClassifierSets {
    #[new]
    fn new(py: Python<'_>, file: String) -> PyResult<Self> {
        let sets = waited(py, move || lab::ClassifierSets::read(&file))?;
        Ok(Self(Arc::new(sets.map_err(refused)?)))
    }

    /// Whether a file is the recipe of a classifier.
    #[staticmethod]
    fn is_recipe(file: &str) -> PyResult<bool> {
        lab::ClassifierSets::is_recipe(file).map_err(refused)
    }

    /// Names of the sets, with their numbers of experiments.
    fn sizes(&self) -> Vec<(String, u64)> {
        self.0.sizes()
    }

    /// Inputs, classes and costs of the experiments from `first` to before `end` of a set, each row by row.
    fn part<'py>(&self, py: Python<'py>, set: usize, first: u64, end: u64) -> PyResult<Rows<'py>> {
        let sets = Arc::clone(&self.0);
        let made = waited(py, move || sets.part(set, first..end))?;
        let rows = made.map_err(refused)?;
        Ok((
            rows.inputs.into_pyarray(py),
            rows.labels.into_pyarray(py),
            rows.costs.into_pyarray(py),
        ))
    }

    /// Writes the files of all sets.
    fn write(&self, py: Python<'_>, into: String, sets: Vec<Rows<'_>>) -> PyResult<()> {
        let sets = sets.iter().map(|(inputs, labels, costs)| {
            Ok(lab::Rows {
                inputs: inputs.to_vec()?,
                labels: labels.to_vec()?,
                costs: costs.to_vec()?,
            })
        });
        let sets = sets.collect::<PyResult<Vec<_>>>()?;
        let all = Arc::clone(&self.0);
        waited(py, move || all.write(&into, sets))?.map_err(refused)
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
    module.add_class::<ClassifierSets>()?;
    module.add_function(wrap_pyfunction!(dataset_file, module)?)?;
    Ok(())
}
