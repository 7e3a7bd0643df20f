//! Recordings of the relay tests that methods make for themselves, as CSV like any other.
//!
//! ```text
//! pem-sweep/0001.csv ..     a folder a method, a file an experiment
//! ```

use std::path::Path;

use onecycle_lab::experiments::{Recorded, RelayTest, Truth};
use onecycle_lab::judge::evaluate::Contender;
use onecycle_link::{Recording, write_csv};

use super::folder::{numbered, refuse_filled};
use crate::commands::workers::Workers;
use crate::failure::Failure;
use crate::output::write_file;

/// Writes those of all experiments to a folder.
pub(super) fn write(
    folder: &Path,
    methods: &[Contender],
    truths: &[Truth],
    workers: &Workers,
) -> Result<(), Failure> {
    let own = |method: &&Contender| method.relay_test() != RelayTest::Recorded;
    let methods: Vec<&Contender> = methods.iter().filter(own).collect();
    if methods.is_empty() {
        return Err(Failure::usage(
            "no method makes an experiment of its own: name pem-sweep or asymmetric in --methods, or leave \
             --traces out",
        ));
    }
    refuse_filled(folder)?;
    let make =
        |path: &Path| std::fs::create_dir(path).map_err(|error| Failure::output(path, error));
    if !folder.exists() {
        make(folder)?;
    }
    for method in &methods {
        make(&folder.join(method.name()))?;
    }
    workers.expect(methods.len() * truths.len(), 0);
    let written = workers.run(methods.len() * truths.len(), |index| {
        let (method, truth) = (methods[index / truths.len()], &truths[index % truths.len()]);
        let recorded = truth.recorded_by(method.relay_test());
        match recorded.map_err(Failure::usage)? {
            Some(recorded) => write_one(&folder.join(method.name()), truth.number, &recorded),
            None => Ok(()),
        }
    });
    workers.finish();
    written.into_iter().collect()
}

fn write_one(folder: &Path, number: u64, recorded: &Recorded) -> Result<(), Failure> {
    let table = Recording::from_samples(&recorded.time_s, &recorded.input, &recorded.output)
        .map_err(Failure::usage)?;
    let hysteresis = format!("hysteresis of the relay: {:?}", recorded.hysteresis);
    write_file(&folder.join(numbered(number)), |file| {
        write_csv(file, &table, &[&hysteresis])
    })
}
