//! Writes recordings as CSV.

use std::io::{self, BufWriter, Write};

use crate::recording::Recording;

/// Columns of a recording in the order of the writer.
const COLUMNS: [&str; 3] = ["time_s", "output", "input"];
/// The same beside a set-point, where `input` and `output` alone may be those of the controller.
const BESIDE_SET_POINT: [&str; 3] = ["time_s", "process_output", "process_input"];

/// Writes rows of `time_s,output,input` and further columns after comments that start with `#`, in constant memory. Beside a column
/// `setpoint` the names are `process_output` and `process_input`.
///
/// Each number is the shortest that reads back to the same bits.
#[derive(Debug)]
pub struct CsvWriter<W: Write> {
    out: BufWriter<W>,
}

impl<W: Write> CsvWriter<W> {
    /// Writes the comments and the names of the columns; `more` are those after time, output and input.
    ///
    /// # Errors
    /// The errors of `out`; so for all methods.
    pub fn new(out: W, comments: &[&str], more: &[&str]) -> io::Result<Self> {
        let mut out = BufWriter::new(out);
        for line in comments
            .iter()
            .flat_map(|comment| comment.split(['\n', '\r']))
        {
            writeln!(out, "# {line}")?;
        }
        let own = match more.contains(&"setpoint") {
            true => &BESIDE_SET_POINT,
            false => &COLUMNS,
        };
        writeln!(out, "{}", [own, more].concat().join(","))?;
        Ok(Self { out })
    }

    /// Writes a row; `more` are the values of the further columns.
    ///
    /// # Errors
    /// The errors of `out`.
    pub fn row(&mut self, time_s: f64, output: f64, input: f64, more: &[f64]) -> io::Result<()> {
        write!(self.out, "{time_s:?},{output:?},{input:?}")?;
        for value in more {
            write!(self.out, ",{value:?}")?;
        }
        writeln!(self.out)
    }

    /// Writes what is still buffered.
    ///
    /// # Errors
    /// The errors of `out`.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Writes a recording with a [`CsvWriter`]. An averaged recording is written point by point; a comment gives the samples
/// per point, but the reader does not read it.
///
/// # Errors
/// The errors of `out`.
pub fn write_csv(out: impl Write, recording: &Recording, comments: &[&str]) -> io::Result<()> {
    let mut comments = comments.to_vec();
    let averaged;
    if recording.samples_per_point() > 1 {
        let (samples, period_s) = (recording.samples_per_point(), recording.sample_period_s());
        averaged = format!("each row is the mean of {samples} samples of {period_s:?} s");
        comments.push(&averaged);
    }
    let mut writer = CsvWriter::new(out, &comments, &[])?;
    let (time_s, output, input) = (recording.time_s(), recording.output(), recording.input());
    for ((time_s, output), input) in time_s.iter().zip(output).zip(input) {
        writer.row(*time_s, *output, *input, &[])?;
    }
    writer.finish()
}
