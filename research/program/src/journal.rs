//! The finished steps of a run, kept until its output is written, so that an interrupted run can be resumed by the same
//! command.
//!
//! ```text
//! OUT.part/journal.jsonl   {"program":"0.3.0","command":"grid","settings":{..}}   the head
//!                          one line of JSON for each finished step
//! OUT.part/NAME            pieces: data that is replaced as a whole, such as a network in training
//! ```
//!
//! Lines are only added, each by a single write. A run that is killed can therefore cut the last line only, which is
//! dropped. Work of another program version, command or settings is refused.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::path::{Path, PathBuf};

use onecycle_cli::failure::Failure;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::output::{tell, with_ending, write_file};

const NAME: &str = "journal.jsonl";

/// What to do with work that cannot be continued.
const RESTART: &str = "use --restart to start over";

/// The run that a journal belongs to.
#[derive(Serialize, Deserialize)]
struct Head {
    program: String,
    command: String,
    settings: Value,
}

/// The work folder of a run, open for more lines.
pub(crate) struct Journal {
    folder: PathBuf,
    file: File,
}

impl Journal {
    /// The work folder of an output file, `OUT.part`.
    pub(crate) fn folder_of(out: &Path) -> PathBuf {
        with_ending(out, "part")
    }

    /// Opens the journal of a command with these settings, or begins one; with `restart` earlier work is discarded.
    /// Every line found is handed to `take`, which returns the reason if it refuses one.
    pub(crate) fn open<L: DeserializeOwned>(
        folder: &Path,
        command: &str,
        settings: &impl Serialize,
        restart: bool,
        take: impl FnMut(L) -> Result<(), String>,
    ) -> Result<Self, Failure> {
        let head = Head {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            command: command.to_owned(),
            settings: serde_json::to_value(settings).map_err(Failure::usage)?,
        };
        prepare(folder, restart)?;
        let path = folder.join(NAME);
        let failed = |error| Failure::output(&path, error);
        let file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(failed)?;
        let length = read(&path, &file, &head, take)?;
        file.set_len(length).map_err(failed)?;
        let mut journal = Self {
            folder: folder.to_owned(),
            file,
        };
        if length == 0 {
            journal.add(&head)?;
        }
        Ok(journal)
    }

    /// Says on the error output that earlier work is used.
    pub(crate) fn tell_resumed(&self, after: &str) {
        let folder = self.folder.display();
        tell(&format!("resuming after {after} of {folder} ({RESTART})"));
    }

    /// Adds a line.
    pub(crate) fn add(&mut self, line: &impl Serialize) -> Result<(), Failure> {
        let mut text = serde_json::to_vec(line).map_err(Failure::usage)?;
        text.push(b'\n');
        let written = self.file.write_all(&text);
        written.map_err(|error| Failure::output(&self.folder, error))
    }

    /// All lines behind the head, read one at a time.
    pub(crate) fn lines<L: DeserializeOwned>(
        &self,
    ) -> io::Result<impl Iterator<Item = io::Result<L>> + use<L>> {
        let lines = BufReader::new(File::open(self.folder.join(NAME))?).lines();
        let read = |line: io::Result<String>| Ok(serde_json::from_str(&line?)?);
        Ok(lines.skip(1).map(read))
    }

    /// A piece, if there is one.
    pub(crate) fn piece(&self, name: &str) -> Result<Option<Vec<u8>>, Failure> {
        let path = self.folder.join(name);
        match fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Failure::unreadable(&path, error)),
        }
    }

    /// Writes a piece, in place of an earlier one of this name.
    pub(crate) fn keep_piece(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        write_file(&self.folder.join(name), |file| file.write_all(bytes))
    }

    /// Removes a piece that is no longer needed.
    pub(crate) fn remove_piece(&self, name: &str) -> Result<(), Failure> {
        let path = self.folder.join(name);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(Failure::output(&path, error)),
            _ => Ok(()),
        }
    }

    /// The refusal of a piece that cannot be used.
    pub(crate) fn refused_piece(&self, name: &str, reason: &str) -> Failure {
        Failure::unreadable(&self.folder.join(name), format!("{reason}: {RESTART}"))
    }

    /// Removes the work folder: the output is written.
    pub(crate) fn remove(self) -> Result<(), Failure> {
        fs::remove_dir_all(&self.folder).map_err(|error| Failure::output(&self.folder, error))
    }
}

/// Makes the folder, or accepts one that has a journal or is empty.
fn prepare(folder: &Path, restart: bool) -> Result<(), Failure> {
    let failed = |error| Failure::output(folder, error);
    let has_journal = folder.join(NAME).is_file();
    if restart && has_journal {
        fs::remove_dir_all(folder).map_err(failed)?;
    } else if has_journal {
        return Ok(());
    }
    match fs::create_dir(folder) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists && folder.is_dir() => {
            let mut entries = fs::read_dir(folder).map_err(failed)?;
            match entries.next() {
                None => Ok(()),
                Some(_) => Err(failed(io::Error::other(format!(
                    "the folder is not empty and has no {NAME}"
                )))),
            }
        }
        made => made.map_err(failed),
    }
}

/// Hands all whole lines over; returns their length in bytes.
fn read<L: DeserializeOwned>(
    path: &Path,
    file: &File,
    head: &Head,
    mut take: impl FnMut(L) -> Result<(), String>,
) -> Result<u64, Failure> {
    let failed = |error: io::Error| Failure::unreadable(path, error);
    let wrong = |number: usize, reason: &str| {
        Failure::unreadable(path, format!("line {number} {reason}: {RESTART}"))
    };
    let mut lines = BufReader::new(file.try_clone().map_err(failed)?);
    let (mut length, mut cut) = (0, None);
    let mut bytes = Vec::new();
    for number in 1.. {
        bytes.clear();
        let read = lines.read_until(b'\n', &mut bytes).map_err(failed)?;
        match cut {
            _ if read == 0 => break,
            Some(number) => return Err(wrong(number, "is damaged")),
            None => {}
        }
        let is_whole = bytes.ends_with(b"\n");
        let is_taken = if number == 1 {
            let found = serde_json::from_slice(&bytes).ok().filter(|_| is_whole);
            found.map(|found| head.check(path, &found)).transpose()?
        } else {
            let line = serde_json::from_slice(&bytes).ok().filter(|_| is_whole);
            let taken = line.map(&mut take).transpose();
            taken.map_err(|reason| wrong(number, &reason))?
        };
        match is_taken {
            Some(()) => length += read as u64,
            None => cut = Some(number),
        }
    }
    Ok(length)
}

impl Head {
    /// Refuses the work of another run, with the first difference.
    fn check(&self, path: &Path, found: &Self) -> Result<(), Failure> {
        let there = if found.program != self.program {
            format!(
                "is from onecycle-lab {}, not {}",
                found.program, self.program
            )
        } else if found.command != self.command {
            format!("is of onecycle-lab {}", found.command)
        } else if let Some(difference) = difference("", &found.settings, &self.settings) {
            format!("has other settings, {difference}")
        } else {
            return Ok(());
        };
        Err(Failure::unreadable(
            path,
            format!("unfinished work {there}: {RESTART}, or name another output to keep it"),
        ))
    }
}

/// The first value in which two settings differ, as `name 1 instead of 2`.
fn difference(name: &str, there: &Value, here: &Value) -> Option<String> {
    let null = Value::Null;
    match (there, here) {
        (Value::Object(a), Value::Object(b)) => a.keys().chain(b.keys()).find_map(|key| {
            let name = if name.is_empty() {
                key.clone()
            } else {
                format!("{name}.{key}")
            };
            let [there, here] = [a, b].map(|values| values.get(key).unwrap_or(&null));
            difference(&name, there, here)
        }),
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(index, (a, b))| difference(&format!("{name}[{index}]"), a, b))
        }
        _ => (there != here).then(|| format!("{name} {} instead of {}", short(there), short(here))),
    }
}

/// Most characters of a value in a sentence.
const SHORT: usize = 40;

fn short(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= SHORT {
        return text;
    }
    text.chars().take(SHORT).chain("...".chars()).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn open(folder: &Path, settings: &Value, restart: bool) -> Result<(Journal, Vec<u64>), String> {
        let mut found = Vec::new();
        let journal = Journal::open(folder, "count", settings, restart, |line: u64| {
            found.push(line);
            if line == 13 {
                return Err("is unlucky".to_owned());
            }
            Ok(())
        });
        match journal {
            Ok(journal) => Ok((journal, found)),
            Err(failure) => Err(failure.to_string()),
        }
    }

    // Three lines, of which every cut leaves the whole ones; the next line follows them.
    #[test]
    fn whole_lines_are_found_again() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = scratch.path().join("out.part");
        let settings = json!({ "limit": 0.1 });
        let (mut journal, found) = open(&folder, &settings, false).unwrap();
        assert!(found.is_empty());
        for line in [1, 2, 3] {
            journal.add(&line).unwrap();
        }
        let path = folder.join(NAME);
        let whole = fs::read(&path).unwrap();
        let head = whole.len() - 6;
        for (length, expected) in [
            (whole.len(), &[1, 2, 3][..]),
            (whole.len() - 1, &[1, 2]),
            (head + 2, &[1]),
            (head, &[]),
            (head - 1, &[]),
            (5, &[]),
            (0, &[]),
        ] {
            fs::write(&path, &whole[..length]).unwrap();
            let (mut journal, found) = open(&folder, &settings, false).unwrap();
            assert_eq!(found, expected, "{length}");
            journal.add(&9).unwrap();
            let lines: Vec<u64> = journal.lines().unwrap().map(Result::unwrap).collect();
            assert_eq!(lines, [expected, &[9]].concat());
        }
        let (journal, found) = open(&folder, &settings, true).unwrap();
        assert!(found.is_empty());
        journal.remove().unwrap();
        assert!(!folder.exists());
    }

    // Another setting, another command's line, damage within, a folder of something else: a sentence, and nothing changed.
    #[test]
    fn other_work_is_refused() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = scratch.path().join("out.part");
        let settings = json!({ "space": { "tau_s": [0.1, 0.2] }, "seed": 1 });
        let (mut journal, _) = open(&folder, &settings, false).unwrap();
        journal.add(&1).unwrap();
        let path = folder.join(NAME);
        let whole = fs::read_to_string(&path).unwrap();
        let other = json!({ "space": { "tau_s": [0.1, 0.3] }, "seed": 1 });
        for (text, settings, words) in [
            (
                whole.clone(),
                &other,
                "settings, space.tau_s[1] 0.2 instead of 0.3",
            ),
            (
                whole.replace("\"count\"", "\"grid\""),
                &settings,
                "unfinished work is of onecycle-lab grid",
            ),
            (
                whole.replace(env!("CARGO_PKG_VERSION"), "0.0.9"),
                &settings,
                "is from onecycle-lab 0.0.9",
            ),
            (format!("{whole}x\n2\n"), &settings, "line 3 is damaged"),
            (format!("{whole}13\n2\n"), &settings, "line 3 is unlucky"),
        ] {
            fs::write(&path, &text).unwrap();
            let refusal = open(&folder, settings, false).err().unwrap();
            assert!(refusal.contains(words), "{words}: {refusal}");
            assert!(refusal.contains("--restart"), "{refusal}");
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        fs::rename(&path, folder.join("thesis.tex")).unwrap();
        for restart in [false, true] {
            let refusal = open(&folder, &settings, restart).err().unwrap();
            assert!(refusal.contains("is not empty"), "{refusal}");
        }
        assert!(folder.join("thesis.tex").exists());
    }

    // A piece is replaced, found again, and gone once it is removed.
    #[test]
    fn pieces_are_kept() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = scratch.path().join("out.part");
        let (journal, _) = open(&folder, &json!({}), false).unwrap();
        assert_eq!(journal.piece("network").unwrap(), None);
        journal.keep_piece("network", b"one").unwrap();
        journal.keep_piece("network", b"two").unwrap();
        drop(journal);
        let (journal, _) = open(&folder, &json!({}), false).unwrap();
        assert_eq!(journal.piece("network").unwrap().unwrap(), b"two");
        journal.remove_piece("network").unwrap();
        journal.remove_piece("network").unwrap();
        assert_eq!(journal.piece("network").unwrap(), None);
        journal.remove().unwrap();
        assert!(!folder.exists());
    }
}
