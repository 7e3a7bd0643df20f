//! Reports: what Python shows of them.

use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::{Complex64, IntoPyArray, PyArray1, PyReadonlyArray1};
use onecycle::words::verdict::advice;
use onecycle::{DesignReport, Identified, Interval, Report};
use onecycle_cli::report::json::to_text;
use onecycle_cli::report::{flight, identify as shown, tune};
use onecycle_cli::style::plain;
use pyo3::prelude::*;

use crate::controller::Law;
use crate::error::with_keywords;
use crate::{Recording, process};

/// An array of numbers by its name.
type Column<'py> = (&'static str, Bound<'py, PyArray1<f64>>);

/// A text report with the keywords of the package.
fn told(text: &str) -> String {
    with_keywords(&plain(text))
}

/// What was identified, and the time that it took (s).
#[pyclass(frozen, module = "onecycle._onecycle")]
pub(crate) struct Found {
    /// A page adds to it.
    report: Mutex<Report>,
    #[pyo3(get)]
    took_s: f64,
}

impl Found {
    pub(crate) fn new(report: Report, took_s: f64) -> Self {
        let report = Mutex::new(report);
        Self { report, took_s }
    }

    fn report(&self) -> MutexGuard<'_, Report> {
        self.report.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn of_identified<T>(&self, read: impl FnOnce(&Identified) -> T) -> Option<T> {
        self.report().identification.outcome.as_ref().ok().map(read)
    }
}

#[pymethods]
impl Found {
    /// The JSON report, without the names of options.
    fn raw(&self) -> String {
        raw(&*self.report())
    }

    /// The text that `identify --json --rows` prints.
    fn json_with_rows(&self) -> String {
        to_text(&self.report().with_rows())
    }

    fn page(&self) -> String {
        shown::page(&mut self.report())
    }

    fn text(&self, has_details: bool) -> String {
        told(&shown::text(&self.report(), has_details))
    }

    fn answer(&self) -> String {
        raw(&self.report().answer)
    }

    fn refusal(&self) -> Option<String> {
        let report = self.report();
        let verdict = report.identification.outcome.as_ref().err()?;
        Some(with_keywords(&format!("{verdict}: {}", advice(verdict))))
    }

    fn recording(&self) -> (String, Recording) {
        let report = self.report();
        (
            report.name.clone(),
            Recording(report.recording.clone().into()),
        )
    }

    /// The identified process, to the last bit.
    fn model(&self) -> Option<process::Model> {
        self.of_identified(|identified| process::Model(identified.model))
    }

    fn controller(&self) -> Option<Law> {
        self.of_identified(|identified| {
            identified.design.map(|design| (&design.controller).into())
        })?
    }

    /// Estimate, low and high of every parameter, by key.
    fn intervals(&self) -> Vec<(&'static str, [Option<f64>; 3])> {
        let ends = |of: Interval| [of.estimate, of.low, of.high];
        let all = |identified: &Identified| {
            let intervals = identified.estimate.iter();
            intervals
                .map(|(parameter, of)| (parameter.key(), ends(of)))
                .collect()
        };
        self.of_identified(all).unwrap_or_default()
    }

    /// Parameter of every draw from the posterior, by key.
    fn posterior<'py>(&self, py: Python<'py>) -> Vec<Column<'py>> {
        let all = |identified: &Identified| {
            let parameters = identified.estimate.iter().map(|(parameter, _)| parameter);
            let column = |parameter: onecycle::Parameter| {
                let values = identified.posterior.values(parameter);
                (parameter.key(), values.into_pyarray(py))
            };
            parameters.map(column).collect()
        };
        self.of_identified(all).unwrap_or_default()
    }

    /// Frequency responses (rad/s) of the draws that are processes, one after the other.
    fn responses<'py>(
        &self,
        py: Python<'py>,
        w: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        let w = w.as_slice()?;
        let models = self.of_identified(|identified| identified.posterior.models(usize::MAX));
        let all = models.unwrap_or_default().into_iter().flat_map(|model| {
            w.iter().map(move |&w| {
                let value = model.frequency_response(w);
                Complex64::new(value.re, value.im)
            })
        });
        Ok(all.collect::<Vec<_>>().into_pyarray(py))
    }

    /// The fit row by row.
    fn rows<'py>(&self, py: Python<'py>) -> Vec<Column<'py>> {
        self.of_identified(|identified| rows(py, identified))
            .unwrap_or_default()
    }
}

fn raw(report: &impl serde::Serialize) -> String {
    // Plain structures of numbers and strings always serialise.
    let mut text = serde_json::to_string_pretty(report).unwrap_or_default();
    text.push('\n');
    text
}

fn rows<'py>(py: Python<'py>, identified: &Identified) -> Vec<Column<'py>> {
    let Some(innovations) = identified.fit.innovations() else {
        let points = &identified.fit.points;
        return [
            (
                "time_s",
                points.iter().map(|at| at.time_s).collect::<Vec<_>>(),
            ),
            ("measured", points.iter().map(|at| at.measured).collect()),
            ("simulated", points.iter().map(|at| at.fitted).collect()),
        ]
        .map(|(name, values)| (name, values.into_pyarray(py)))
        .into();
    };
    let of = &innovations.rows;
    [
        (
            "time_s",
            of.iter().map(|row| row.time_s).collect::<Vec<_>>(),
        ),
        ("measured", of.iter().map(|row| row.measured).collect()),
        ("simulated", of.iter().map(|row| row.simulated).collect()),
        ("predicted", of.iter().map(|row| row.predicted).collect()),
        ("innovation", of.iter().map(|row| row.innovation).collect()),
        (
            "disturbance",
            of.iter().map(|row| row.disturbance).collect(),
        ),
    ]
    .map(|(name, values)| (name, values.into_pyarray(py)))
    .into()
}

/// Every loop of a flight log.
#[pyclass(frozen, module = "onecycle._onecycle")]
pub(crate) struct Survey(pub(crate) onecycle::Survey);

#[pymethods]
impl Survey {
    fn raw(&self) -> String {
        raw(&self.0)
    }

    fn text(&self, has_details: bool) -> String {
        told(&flight::text(&self.0, has_details))
    }
}

/// Controllers of a known process.
#[pyclass(frozen, module = "onecycle._onecycle")]
pub(crate) struct Designed(pub(crate) DesignReport);

#[pymethods]
impl Designed {
    fn raw(&self) -> String {
        raw(&self.0)
    }

    fn text(&self, _has_details: bool) -> String {
        told(&tune::text(&self.0))
    }

    fn controller(&self) -> Law {
        (&self.0.best.controller).into()
    }

    /// The controller of every style, if it has one.
    fn controllers(&self) -> Vec<(&'static str, Option<Law>)> {
        let rows = self.0.choice.rows.iter();
        rows.map(|row| {
            let design = row.proposal.outcome.as_ref().ok();
            let law = design.map(|design| (&design.controller).into());
            (row.proposal.specification.style.name(), law)
        })
        .collect()
    }
}
