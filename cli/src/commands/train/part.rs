//! What an interrupted training has done: a file of one network beside the one that is to be written,
//! as it was after its last epoch.

use std::path::{Path, PathBuf};

use onecycle_lab::learn::train::Trainer;

use crate::failure::Failure;
use crate::output::write_file;

/// Begins the first line of the file; a part of another version of the program is not continued.
const RECIPE: &str = concat!("onecycle ", env!("CARGO_PKG_VERSION"), " recipe");

/// The file of a network, and the recipe that must be the same.
pub(super) struct Part {
    path: PathBuf,
    recipe: String,
}

impl Part {
    /// That of network `number`, from one, of those that `out` chooses from.
    pub(super) fn of(out: &Path, number: usize, recipe: String) -> Self {
        let mut path = out.as_os_str().to_owned();
        path.push(format!(".{number}.part"));
        Self {
            path: PathBuf::from(path),
            recipe,
        }
    }

    /// The training as it was, if there is one.
    pub(super) fn read(&self) -> Result<Option<Trainer>, Failure> {
        let bytes = match std::fs::read(&self.path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            read => read.map_err(|error| self.unreadable(&error.to_string()))?,
        };
        let unreadable =
            |reason: &str| self.unreadable(&format!("{reason}: leave out --resume to begin anew"));
        let end = bytes.iter().position(|&byte| byte == b'\n');
        let (head, training) = bytes.split_at(end.map_or(0, |end| end + 1));
        let trainer = Trainer::resume(training).map_err(|error| unreadable(&error.to_string()))?;
        if head != self.head().as_bytes() {
            return Err(unreadable(
                "another recipe or another version of the program made it",
            ));
        }
        Ok(Some(trainer))
    }

    /// Keeps a training.
    pub(super) fn write(&self, trainer: &Trainer) -> Result<(), Failure> {
        let failed = |error: &dyn std::fmt::Display| {
            Failure::output(&self.path, std::io::Error::other(error.to_string()))
        };
        let training = trainer.save().map_err(|error| failed(&error))?;
        write_file(&self.path, |file| {
            file.write_all(self.head().as_bytes())?;
            file.write_all(&training)
        })
    }

    /// The first line of the file: who made it from which recipe.
    fn head(&self) -> String {
        format!("{RECIPE} {}\n", self.recipe)
    }

    /// There is nothing left to go on with.
    pub(super) fn remove(&self) -> Result<(), Failure> {
        match std::fs::remove_file(&self.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(Failure::output(&self.path, error))
            }
            _ => Ok(()),
        }
    }

    fn unreadable(&self, reason: &str) -> Failure {
        Failure::Settings {
            path: self.path.clone(),
            reason: reason.to_owned(),
        }
    }
}
