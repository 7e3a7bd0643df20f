//! The only place that writes: the terminal, and files whole or not at all.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};

use crate::failure::Failure;

/// Prints `text` to the standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|reason| Failure::Output {
            target: "to the standard output".to_owned(),
            reason,
        })
}

/// Prints a line to the error output; where that is closed there is no one left to tell.
pub(crate) fn complain(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// A bar on the error output, for so many pieces of work; nothing where that is no terminal.
pub(crate) fn progress_bar(pieces: u64) -> ProgressBar {
    let bar = ProgressBar::new(pieces);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar
}

/// The same with a message behind it.
pub(crate) fn progress_bar_with_message(pieces: u64) -> ProgressBar {
    let bar = ProgressBar::new(pieces);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} {eta}  {msg}") {
        bar.set_style(style);
    }
    bar
}

/// Appends a value as a line of JSON to a file of this path. A whole line at a time reaches the system, so
/// that an end by force cuts the last at most.
pub(crate) fn append_line(
    file: &mut File,
    path: &Path,
    line: &impl serde::Serialize,
) -> Result<(), Failure> {
    let mut text = serde_json::to_vec(line).map_err(Failure::usage)?;
    text.push(b'\n');
    file.write_all(&text)
        .map_err(|error| Failure::output(path, error))
}

/// Writes a file through a temporary one beside it: whole, or not at all.
pub(crate) fn write_file(
    path: &Path,
    write: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> Result<(), Failure> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    };
    let failed = |reason| Failure::output(path, reason);
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    write(file.as_file_mut()).map_err(failed)?;
    set_usual_permissions(file.as_file()).map_err(failed)?;
    file.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

/// Writes a text to a file: whole, or not at all.
pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_file(path, |file| file.write_all(text.as_bytes()))
}

/// Temporary files are private; what a user asked for is readable like any other file.
#[cfg(unix)]
fn set_usual_permissions(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn set_usual_permissions(_: &std::fs::File) -> io::Result<()> {
    Ok(())
}
