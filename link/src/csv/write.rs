//! Writes a recording as CSV.

use std::io::{self, BufWriter, Write};

use crate::recording::Recording;

/// Writes a recording as rows of `time_s,output,input` after comments that start with `#`.
///
/// Each number is the shortest that reads back to the same bits. An averaged recording is written
/// point by point; a comment gives the samples per point, but the reader does not read it.
///
/// # Errors
/// The errors of `out`.
pub fn write_csv(out: impl Write, recording: &Recording, comments: &[&str]) -> io::Result<()> {
    let mut out = BufWriter::new(out);
    for line in comments
        .iter()
        .flat_map(|comment| comment.split(['\n', '\r']))
    {
        writeln!(out, "# {line}")?;
    }
    if recording.samples_per_point() > 1 {
        let (samples, period_s) = (recording.samples_per_point(), recording.sample_period_s());
        writeln!(
            out,
            "# each row is the mean of {samples} samples of {period_s:?} s"
        )?;
    }
    writeln!(out, "time_s,output,input")?;
    let (time_s, output, input) = (recording.time_s(), recording.output(), recording.input());
    for ((time_s, output), input) in time_s.iter().zip(output).zip(input) {
        writeln!(out, "{time_s:?},{output:?},{input:?}")?;
    }
    out.flush()
}
