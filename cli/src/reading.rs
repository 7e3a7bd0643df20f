//! Files that are read with a bar of bytes on the error output.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use onecycle::{Source, shown};
use onecycle_link::LogFormat;

use crate::failure::Failure;
use crate::output::Waiting;

/// Largest file of settings, in bytes: the longest of ours has 10 kB.
pub const MOST_OF_SETTINGS: u64 = 1 << 20;

/// The bytes of a file of at most this size.
pub fn bytes_at_most(path: &Path, most: u64) -> Result<Vec<u8>, Failure> {
    let file = open_with_bar(path).map_err(|error| Failure::unreadable(path, error))?;
    let mut bytes = Vec::new();
    let read = file.take(most + 1).read_to_end(&mut bytes);
    match read {
        Ok(count) if count as u64 > most => {
            let reason = format!(
                "the file has more than {most} bytes, too many for its kind: check its name"
            );
            Err(Failure::unreadable(path, reason))
        }
        Ok(_) => Ok(bytes),
        Err(error) => Err(Failure::unreadable(path, error)),
    }
}

/// The text of a file of at most this size.
pub fn text_at_most(path: &Path, most: u64) -> Result<String, Failure> {
    let bytes = bytes_at_most(path, most)?;
    String::from_utf8(bytes).map_err(|_| Failure::unreadable(path, "the file is not UTF-8 text"))
}

/// Opens a file. While it is read, a bar of its bytes is shown on the error output if reading takes longer than half a
/// second and that is a terminal; the bar goes when the reader is dropped.
///
/// # Errors
/// The error of opening. A folder is refused here, though systems open one.
pub(crate) fn open_with_bar(path: &Path) -> io::Result<FileWithBar> {
    let work = format!("reading {}", shown(path));
    let file = File::open(path)?;
    let about = file.metadata()?;
    if about.is_dir() {
        return Err(io::Error::new(ErrorKind::IsADirectory, "Is a directory"));
    }
    // Pipes and devices do not tell their length.
    let waiting = if about.is_file() {
        Waiting::on_bytes(work, about.len())
    } else {
        Waiting::on(work)
    };
    Ok(FileWithBar { file, waiting })
}

/// The source of a recording: a file, or the standard input.
pub(crate) struct Input<'a> {
    path: &'a Path,
    /// What was read of the standard input: all of a flight log, of anything else the first bytes.
    piped: Option<Vec<u8>>,
}

/// Largest flight log on the standard input, in bytes: it is read twice, so it is kept.
const MOST_PIPED: u64 = 1 << 29;

impl<'a> Input<'a> {
    /// The file of this name; `-` is the standard input.
    pub(crate) fn new(path: &'a Path) -> Result<Self, Failure> {
        let piped = match path == Path::new("-") {
            true => Some(piped()?),
            false => None,
        };
        Ok(Self { path, piped })
    }

    pub(crate) fn is_piped(&self) -> bool {
        self.piped.is_some()
    }
}

/// The standard input if it is a flight log, or else its first bytes.
fn piped() -> Result<Vec<u8>, Failure> {
    let failed = |error: io::Error| Failure::unreadable(Path::new("-"), error);
    let mut bytes = Vec::new();
    let mut input = io::stdin().lock();
    let most = LogFormat::HEAD_BYTES as u64;
    let head = input.by_ref().take(most).read_to_end(&mut bytes);
    head.map_err(failed)?;
    if LogFormat::detect(&bytes).is_none() {
        return Ok(bytes);
    }
    let _waiting = Waiting::on("reading the standard input");
    let rest = input.take(MOST_PIPED).read_to_end(&mut bytes);
    rest.map_err(failed)?;
    if bytes.len() as u64 > MOST_PIPED {
        let reason =
            format!("the log has more than {MOST_PIPED} bytes: write it to a file and name that");
        return Err(Failure::unreadable(Path::new("-"), reason));
    }
    Ok(bytes)
}

impl Source for Input<'_> {
    fn name(&self) -> String {
        shown(self.path)
    }

    fn open(&self) -> io::Result<Box<dyn Read + '_>> {
        match &self.piped {
            // Of a flight log nothing is left there.
            Some(bytes) => Ok(Box::new(bytes.chain(io::stdin()))),
            None => Ok(Box::new(open_with_bar(self.path)?)),
        }
    }

    fn head(&self, most: u64) -> Vec<u8> {
        match &self.piped {
            Some(bytes) => bytes.iter().take(most as usize).copied().collect(),
            None => self.path.to_owned().head(most),
        }
    }
}

/// A file that counts the bytes read from it.
pub(crate) struct FileWithBar {
    file: File,
    waiting: Waiting,
}

impl Read for FileWithBar {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.waiting.advance(count as u64);
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 10,000 bytes of 10,000, in pieces of 4096, and they are those of the file.
    #[test]
    fn bytes_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        let bytes: Vec<u8> = (0..10_000_u32).map(|k| k as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let mut reader = open_with_bar(&path).unwrap();
        assert_eq!(reader.waiting.position(), (0, Some(10_000)));
        let mut read = vec![0; 4096];
        reader.read_exact(&mut read).unwrap();
        assert_eq!(reader.waiting.position(), (4096, Some(10_000)));
        reader.read_to_end(&mut read).unwrap();
        assert_eq!(reader.waiting.position(), (10_000, Some(10_000)));
        assert!(read == bytes);
    }

    #[test]
    fn what_cannot_be_read_does_not_open() {
        let folder = tempfile::tempdir().unwrap();
        let kind = |path: &Path| open_with_bar(path).err().map(|error| error.kind());
        assert_eq!(kind(folder.path()), Some(ErrorKind::IsADirectory));
        let missing = folder.path().join("nosuch.csv");
        assert_eq!(kind(&missing), Some(ErrorKind::NotFound));
    }
}
