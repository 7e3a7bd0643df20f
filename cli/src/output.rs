//! Output: the terminal, and files that are written whole or not at all. Nothing else in the program writes.

#[cfg(any(target_family = "wasm", not(feature = "program")))]
pub mod page;
#[cfg(all(feature = "program", not(target_family = "wasm")))]
mod terminal;

use std::fmt::Display;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use anstream::AutoStream;
use anstyle::Style;

use crate::failure::Failure;
use crate::style::{HEADING, REFUSAL};
use crate::words::with_options;
#[cfg(any(target_family = "wasm", not(feature = "program")))]
pub use page::{ProgressBar, Waiting, columns, progress_bar};
#[cfg(all(feature = "program", not(target_family = "wasm")))]
pub use terminal::{ProgressBar, Waiting, columns, progress_bar};

/// Prints a report to the standard output, with styles if that is a terminal.
pub fn print(text: &str) -> Result<(), Failure> {
    let text = with_options(text);
    written(AutoStream::auto(io::stdout().lock()), text.as_bytes())
}

/// Prints bytes to the standard output unchanged.
pub fn print_data(bytes: &[u8]) -> Result<(), Failure> {
    written(io::stdout().lock(), bytes)
}

fn written(mut out: impl Write, bytes: &[u8]) -> Result<(), Failure> {
    out.write_all(bytes)
        .and_then(|()| out.flush())
        .map_err(|reason| Failure::Output {
            target: "to the standard output".to_owned(),
            reason,
        })
}

/// Bytes that wait for the standard output in memory; more wait in a temporary file.
const WAITING_BYTES: usize = 1 << 24;

/// Prints what `write` writes to the standard output unchanged, once it is complete: whole or not at all, in bounded
/// memory.
pub fn print_whole(write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    let mut waiting = tempfile::spooled_tempfile(WAITING_BYTES);
    let kept = write(&mut waiting).and_then(|()| waiting.rewind());
    kept.map_err(|reason| Failure::Output {
        target: "to a temporary file".to_owned(),
        reason,
    })?;
    let mut out = io::stdout().lock();
    io::copy(&mut waiting, &mut out)
        .and_then(|_| out.flush())
        .map_err(|reason| Failure::Output {
            target: "to the standard output".to_owned(),
            reason,
        })
}

/// Prints an error of a program to the error output.
pub fn complain(program: &str, failure: &Failure) {
    say(program, REFUSAL, with_options(&failure.to_string()));
}

/// Prints a message about the progress of a program to the error output.
pub fn tell(program: &str, news: &str) {
    say(program, HEADING, news);
}

/// Prints a line to the error output; a closed one is ignored.
fn say(program: &str, style: Style, line: impl Display) {
    let _ = writeln!(
        AutoStream::auto(io::stderr().lock()),
        "{style}{program}:{style:#} {line}"
    );
}

/// A path with `.ENDING` added to its name.
pub fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    name.into()
}

/// Writes a file whole or not at all, through a temporary file beside it. Links are followed; pipes and devices are written
/// directly.
pub fn write_file(
    path: &Path,
    write: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> Result<(), Failure> {
    let failed = |reason| Failure::output(path, reason);
    let there = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    if there.exists() && !there.is_file() && !there.is_dir() {
        let mut open = File::options().write(true).open(&there).map_err(failed)?;
        return write(&mut open).map_err(failed);
    }
    let folder = match there.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        let missing = format!("there is no folder {}", folder.display());
        return Err(failed(io::Error::new(io::ErrorKind::NotFound, missing)));
    }
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    write(file.as_file_mut()).map_err(failed)?;
    set_usual_permissions(file.as_file()).map_err(failed)?;
    file.persist(&there).map_err(|error| failed(error.error))?;
    Ok(())
}

/// Writes a text to a file, whole or not at all.
pub fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_file(path, |file| file.write_all(text.as_bytes()))
}

/// Temporary files are private; an output file is readable like any other file.
#[cfg(unix)]
fn set_usual_permissions(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn set_usual_permissions(_: &File) -> io::Result<()> {
    Ok(())
}
