//! Settings that contradict each other, or do not go with a source.

use onecycle_identify::Hold;

use super::{Request, given};
use crate::Structure;
use crate::error::Error;
use crate::source::Source;

impl Request {
    /// Refuses structures without an unstable pole where one is asked for, and settings that a fit to the cycles of a relay test does
    /// not have.
    pub(super) fn check_estimator(&self) -> Result<(), Error> {
        let has_one_pole = |structure| matches!(structure, Structure::Foptd | Structure::Soptd);
        if self.is_unstable && !self.structure.is_none_or(has_one_pole) {
            return Err(Error::request(
                "`unstable` is for the structures foptd and soptd: leave out `structure`, or choose one of them",
            ));
        }
        let is_other = |structure| structure != Structure::Soiptd;
        let refused = [
            ("structure", self.structure.is_some_and(is_other)),
            ("from", self.from_s.is_some()),
            ("to", self.to_s.is_some()),
            ("hold=interpolated", self.hold == Some(Hold::Interpolated)),
            ("unstable", self.is_unstable),
        ];
        match given(&refused).filter(|_| self.of_cycles().is_some()) {
            Some(setting) => Err(Error::Request(format!(
                "`{setting}` is for the whole recording: leave it out, or `cycles`, `method` and `pack`"
            ))),
            None => Ok(()),
        }
    }

    /// Refuses a part of the recording that is empty.
    pub(crate) fn check_span(&self, times_s: &[f64]) -> Result<(), Error> {
        let (Some(&start_s), Some(&end_s)) = (times_s.first(), times_s.last()) else {
            return Ok(());
        };
        let from_s = self.from_s.unwrap_or(start_s);
        let to_s = self.to_s.unwrap_or(end_s);
        if from_s >= to_s || from_s >= end_s || to_s <= start_s {
            return Err(Error::Request(format!(
                "`from={from_s}` `to={to_s}` leaves nothing: the recording runs from {start_s:.3} to {end_s:.3} s"
            )));
        }
        Ok(())
    }

    /// Refuses settings of flight logs, for a table.
    pub(crate) fn check_table(&self, source: &dyn Source) -> Result<(), Error> {
        let options = [
            ("axis", self.axis.is_some()),
            ("loop", self.control_loop.is_some()),
            ("flight", self.flight.is_some()),
        ];
        let name = source.name();
        if self.write.file.is_some() || given(&options).is_some() {
            // A file that is not there is no table either.
            source.open().map_err(|error| Error::Unreadable {
                name: name.clone(),
                reason: error.to_string(),
            })?;
        }
        if self.write.file.is_some() {
            return Err(Error::Request(format!(
                "`write` writes parameters of an autopilot, and {name} is not a flight log: leave out `write`"
            )));
        }
        match given(&options) {
            Some(setting) => Err(Error::Request(format!(
                "`{setting}` is for flight logs, and {name} is not a flight log: leave out `{setting}`"
            ))),
            None => Ok(()),
        }
    }

    /// Settings of a table that are given.
    fn of_table(&self) -> Option<&'static str> {
        let columns = &self.columns;
        given(&[
            ("time", columns.time_column.is_some()),
            ("input", columns.input_column.is_some()),
            ("output", columns.output_column.is_some()),
            ("set_point", columns.set_point_column.is_some()),
            ("tag", columns.control_loop.is_some()),
            ("sample_rate", columns.sample_rate_hz.is_some()),
            ("time_unit", columns.time_unit.is_some()),
            ("dbc", columns.dbc.is_some()),
        ])
    }

    /// Refuses the names of columns, which a flight log does not have.
    pub(crate) fn check_log(&self, name: &str) -> Result<(), Error> {
        match self.of_table() {
            Some(setting) => Err(Error::Request(format!(
                "`{setting}` is for tables, and {name} is a flight log: choose its signals with `axis` and `loop`"
            ))),
            None => Ok(()),
        }
    }

    /// Refuses settings of files, for a recording in memory.
    pub(crate) fn check_samples(&self) -> Result<(), Error> {
        let of_file = [
            ("axis", self.axis.is_some()),
            ("loop", self.control_loop.is_some()),
            ("flight", self.flight.is_some()),
            ("write", self.write.file.is_some()),
        ];
        match self.of_table().or(given(&of_file)) {
            Some(setting) => Err(Error::Request(format!(
                "`{setting}` is for a file, and the recording is in memory: leave out `{setting}`"
            ))),
            None => Ok(()),
        }
    }
}
