//! The folder of a dataset: its manifest and its files.
//!
//! The manifest is written before the first file and after each file. A file that it does not list counts as missing.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use onecycle_cli::failure::Failure;
use onecycle_lab::experiments::Recipe;
use onecycle_lab::learn::dataset::shards::{
    Entry, ExampleRecord, MANIFEST_NAME, Manifest, file_name,
};

use crate::output::write_file;

pub(crate) struct Folder {
    path: PathBuf,
    manifest: Manifest,
}

impl Folder {
    /// Opens the folder of this recipe, or begins one; with `restart`, removes an earlier dataset first.
    pub(crate) fn open(
        path: &Path,
        recipe: Recipe,
        examples: u64,
        restart: bool,
    ) -> Result<Self, Failure> {
        let manifest_path = path.join(MANIFEST_NAME);
        let manifest = match std::fs::read_to_string(&manifest_path) {
            Ok(text) => {
                let refused = |error| Failure::unreadable(&manifest_path, error);
                let found = Manifest::read(&text).map_err(refused)?;
                if restart {
                    remove_files(path, &found)?;
                    Manifest::new(recipe, examples)
                } else {
                    found.go_on(&recipe, examples).map_err(refused)?
                }
            }
            // If this is a file, making the folder fails with a message.
            Err(error)
                if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&error.kind()) =>
            {
                begin(path)?;
                Manifest::new(recipe, examples)
            }
            Err(error) => return Err(Failure::unreadable(&manifest_path, error)),
        };
        let path = path.to_owned();
        let folder = Self { path, manifest };
        folder.write_manifest()?;
        Ok(folder)
    }

    pub(crate) fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    pub(crate) fn into_manifest(self) -> Manifest {
        self.manifest
    }

    /// Removes missing and damaged files from the manifest; returns their names.
    pub(crate) fn drop_damaged(&mut self) -> Vec<String> {
        let mut names = Vec::new();
        for (shard, slot) in self.manifest.shards.iter_mut().enumerate() {
            let name = file_name(shard);
            let is_whole = |entry: &Entry| {
                std::fs::read(self.path.join(&name)).is_ok_and(|bytes| entry.is_of(&bytes))
            };
            if slot.as_ref().is_some_and(|entry| !is_whole(entry)) {
                *slot = None;
                names.push(name);
            }
        }
        names
    }

    /// Numbers of the files that are not made yet.
    pub(crate) fn missing(&self) -> Vec<usize> {
        let shards = self.manifest.shards.iter().enumerate();
        shards
            .filter_map(|(shard, entry)| entry.is_none().then_some(shard))
            .collect()
    }

    /// Writes a file, then lists it in the manifest.
    pub(crate) fn keep(&mut self, shard: usize, bytes: &[u8], entry: Entry) -> Result<(), Failure> {
        write_file(&self.path.join(file_name(shard)), |file| {
            file.write_all(bytes)
        })?;
        self.manifest.shards[shard] = Some(entry);
        self.write_manifest()
    }

    /// The experiments of all files, in order.
    pub(crate) fn records(&self) -> Result<Vec<ExampleRecord>, Failure> {
        let mut records = Vec::with_capacity(self.manifest.rows());
        for shard in 0..self.manifest.shards.len() {
            records.extend(self.records_of(shard)?);
        }
        Ok(records)
    }

    fn records_of(&self, shard: usize) -> Result<Vec<ExampleRecord>, Failure> {
        let path = self.path.join(file_name(shard));
        let bytes = std::fs::read(&path).map_err(|error| Failure::unreadable(&path, error))?;
        let read = self.manifest.records(shard, &bytes);
        read.map_err(|error| Failure::unreadable(&path, error))
    }

    /// Removes the files, and the folder if there is nothing else in it.
    pub(crate) fn remove(self) -> Result<(), Failure> {
        let names = (0..self.manifest.shards.len()).map(file_name);
        for name in names.chain([MANIFEST_NAME.to_owned()]) {
            let path = self.path.join(name);
            std::fs::remove_file(&path).map_err(|error| Failure::output(&path, error))?;
        }
        std::fs::remove_dir(&self.path).map_err(|error| Failure::output(&self.path, error))
    }

    /// Writes the experiments of all files to one Parquet file, one file at a time.
    pub(super) fn write_parquet(&self, to: &Path) -> Result<(), Failure> {
        use onecycle_lab::learn::dataset::parquet::Writer;
        write_file(to, |file| {
            let mut writer = Writer::new(file)?;
            for shard in 0..self.manifest.shards.len() {
                let records = self.records_of(shard);
                writer.add(&records.map_err(std::io::Error::other)?)?;
            }
            writer.finish()
        })
    }

    fn write_manifest(&self) -> Result<(), Failure> {
        let text = self.manifest.text();
        write_file(&self.path.join(MANIFEST_NAME), |file| {
            file.write_all(text.as_bytes())
        })
    }
}

/// Removes the files of a dataset that exist.
fn remove_files(path: &Path, manifest: &Manifest) -> Result<(), Failure> {
    for name in (0..manifest.shards.len()).map(file_name) {
        let file = path.join(name);
        match std::fs::remove_file(&file) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(Failure::output(&file, error));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Creates the folder, but not its parent; refuses a folder that is not empty.
fn begin(path: &Path) -> Result<(), Failure> {
    if !path.exists() {
        std::fs::create_dir(path).map_err(|error| Failure::output(path, error))?;
    }
    let mut entries = std::fs::read_dir(path).map_err(|error| Failure::output(path, error))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(Failure::unreadable(
            path,
            format!(
                "the folder is not empty and has no {MANIFEST_NAME}: name a new folder for the dataset"
            ),
        )),
    }
}
