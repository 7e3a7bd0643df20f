//! Recordings of the relay tests that methods make for themselves, as CSV files that `identify` reads.
//!
//! ```text
//! pem-sweep/0001.csv ..     one folder for each method, one file for each experiment
//! ```

use std::path::Path;

use onecycle_cli::failure::Failure;
use onecycle_lab::experiments::{Recorded, RelayTest, Truth};
use onecycle_lab::judge::evaluate::Contender;
use onecycle_link::{Recording, write_csv};

use super::folder::{numbered, refuse_filled, write_whole};
use crate::output::write_file;
use crate::workers::Workers;

/// Refuses a folder that is not empty, and a list of methods none of which makes a relay test of its own.
pub(super) fn check(folder: &Path, methods: &[Contender]) -> Result<(), Failure> {
    if !methods.iter().any(makes_its_own) {
        return Err(Failure::usage(
            "no method makes a relay test of its own: name pem-sweep or asymmetric in --methods, or leave out --traces",
        ));
    }
    refuse_filled(folder)
}

fn makes_its_own(method: &Contender) -> bool {
    method.relay_test() != RelayTest::Recorded
}

/// Writes the recordings of all experiments to a folder, whole or not at all.
pub(super) fn write(
    folder: &Path,
    methods: &[Contender],
    truths: &[Truth],
    workers: &Workers,
) -> Result<(), Failure> {
    let methods: Vec<&Contender> = methods.iter().filter(|one| makes_its_own(one)).collect();
    write_whole(folder, |staged| {
        for method in &methods {
            let path = staged.join(method.name());
            std::fs::create_dir(&path).map_err(|error| Failure::output(&path, error))?;
        }
        let written = workers.map(methods.len() * truths.len(), |index| {
            let (method, truth) = (methods[index / truths.len()], &truths[index % truths.len()]);
            let recorded = truth.recorded_by(method.relay_test());
            match recorded.map_err(Failure::usage)? {
                Some(recorded) => write_one(&staged.join(method.name()), truth.number, &recorded),
                None => Ok(()),
            }
        });
        workers.finish();
        written.into_iter().collect()
    })
}

fn write_one(folder: &Path, number: u64, recorded: &Recorded) -> Result<(), Failure> {
    let table = Recording::from_samples(&recorded.time_s, &recorded.input, &recorded.output)
        .map_err(Failure::usage)?;
    let hysteresis = format!("hysteresis of the relay: {:?}", recorded.hysteresis);
    write_file(&folder.join(numbered(number)), |file| {
        write_csv(file, &table, &[&hysteresis])
    })
}
