//! A recording to our own dialect of CSV.

use std::io::{self, BufWriter, Write};

use crate::recording::Recording;

/// Writes a recording as lines of `time_s,output,input` under comments that start with `#`.
///
/// Numbers are the shortest that read back to the same bits. Of an averaged recording the points
/// are written; a comment says how many samples each stands for, but reading it back does not
/// restore that.
///
/// # Errors
/// What the writer fails with.
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
