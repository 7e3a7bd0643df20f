//! Reading the recordings of a benchmark folder, in either file format.

use std::path::{Path, PathBuf};

use onecycle_cli::failure::Failure;
use onecycle_link::Recording;

use super::folder::recording;
use crate::commands::classify;
use crate::results::bench::{BenchManifest, RecordingFormat};
use crate::workers::Workers;

/// The source of the recordings.
pub(super) enum Recordings {
    /// One file for each experiment, in this folder.
    Csv(PathBuf),
    /// One file for all experiments.
    Parquet(table::Table),
}

impl Recordings {
    /// Opens a folder with this manifest.
    pub(super) fn open(folder: &Path, manifest: &BenchManifest) -> Result<Self, Failure> {
        match manifest.recordings {
            RecordingFormat::Csv => Ok(Self::Csv(folder.to_owned())),
            RecordingFormat::Parquet => table::Table::open(folder).map(Self::Parquet),
        }
    }

    /// Reads the recordings of some experiments, in order.
    pub(super) fn read(
        &self,
        numbers: &[u64],
        workers: &Workers,
    ) -> Result<Vec<Recording>, Failure> {
        match self {
            Self::Csv(folder) => {
                let read = |index: usize| classify::recording(&recording(folder, numbers[index]));
                workers.quietly(numbers.len(), read).into_iter().collect()
            }
            // One at a time: threads would share the position in the file.
            Self::Parquet(table) => numbers.iter().map(|&number| table.read(number)).collect(),
        }
    }
}

mod table {
    use std::fs::File;
    use std::path::{Path, PathBuf};

    use onecycle_lab::judge::evaluate::parquet::Reader;
    use onecycle_link::Recording;

    use crate::commands::bench::folder::PARQUET;
    use onecycle_cli::failure::Failure;

    /// The file with all recordings.
    pub(in crate::commands::bench) struct Table {
        path: PathBuf,
        reader: Reader,
    }

    impl Table {
        pub(super) fn open(folder: &Path) -> Result<Self, Failure> {
            let path = folder.join(PARQUET);
            let reader = File::open(&path).and_then(Reader::new);
            match reader {
                Ok(reader) => Ok(Self { path, reader }),
                Err(error) => Err(Failure::unreadable(&path, error.to_string())),
            }
        }

        pub(super) fn read(&self, number: u64) -> Result<Recording, Failure> {
            let wrong = |reason| Failure::unreadable(&self.path, reason);
            let recorded = self.reader.recording(number);
            let recorded = recorded.map_err(|error| wrong(error.to_string()))?;
            Recording::from_samples(&recorded.time_s, &recorded.input, &recorded.output)
                .map_err(|error| wrong(format!("experiment {number}: {error}")))
        }
    }
}
