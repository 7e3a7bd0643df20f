//! What an interrupted training has done: a file of one network beside the one that is to be written,
//! as it was after its last epoch.

use std::path::{Path, PathBuf};

use onecycle_lab::learn::train::{TensorFile, Trainer};

use crate::failure::Failure;
use crate::output::write_file;

/// Key of the recipe in the file; changes with the file, so that what another program left is not gone
/// on with.
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
        let trainer = Trainer::resume(&bytes).map_err(|error| {
            self.unreadable(&format!("{error}: leave out --resume to begin anew"))
        })?;
        let file =
            TensorFile::from_bytes(&bytes).map_err(|error| self.unreadable(&error.to_string()))?;
        if file.metadata.get(RECIPE) != Some(&self.recipe) {
            return Err(self.unreadable(
                "another recipe or another version of the program made it: leave out --resume to \
                 begin anew",
            ));
        }
        Ok(Some(trainer))
    }

    /// Keeps a training.
    pub(super) fn write(&self, trainer: &Trainer) -> Result<(), Failure> {
        let failed = |error: &dyn std::fmt::Display| {
            Failure::output(&self.path, std::io::Error::other(error.to_string()))
        };
        let bytes = trainer.save().map_err(|error| failed(&error))?;
        let mut file = TensorFile::from_bytes(&bytes).map_err(|error| failed(&error))?;
        file.metadata.insert(RECIPE.to_owned(), self.recipe.clone());
        let bytes = file.to_bytes();
        write_file(&self.path, |file| file.write_all(&bytes))
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
