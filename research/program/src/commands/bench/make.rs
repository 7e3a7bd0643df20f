//! `onecycle-lab bench make`: simulate the experiments and write the folder.

use std::path::Path;
use std::process::ExitCode;

use onecycle_cli::failure::{Failure, exit};
use onecycle_cli::report::json::to_text;
use onecycle_lab::experiments::{Benchmark, Recorded, Truth};
use onecycle_lab::judge::evaluate::files::truth_csv;
use onecycle_link::{Recording, write_csv};

use super::folder::{self, MANIFEST, RULES, TRUTH, recording};
use crate::args::{Format, MakeBench};
use crate::output::{print, write_file, write_text};
use crate::report;
use crate::results::bench::{BenchManifest, FORMAT};
use crate::workers::Workers;

/// Largest noise, divided by the amplitude of the oscillation: above it hardly any relay settles.
const MOST_SIGMA: f64 = 0.2;

pub(super) fn run(arguments: &MakeBench) -> Result<ExitCode, Failure> {
    if !(0.0..=MOST_SIGMA).contains(&arguments.sigma) {
        return Err(Failure::usage(format!(
            "--sigma {} is not between 0 and {MOST_SIGMA}",
            arguments.sigma
        )));
    }
    let out = &arguments.out;
    folder::refuse_filled(out)?;
    let workers = Workers::new(arguments.threads)?;
    let manifest = BenchManifest {
        format: FORMAT.to_owned(),
        benchmark: Benchmark {
            experiments: arguments.cases,
            seed: arguments.seed,
            sigma: arguments.sigma,
        },
        recordings: arguments.format.into(),
    };
    folder::write_whole(out, |staged| {
        let truths = match arguments.format {
            Format::Csv => write_recordings(staged, &manifest.benchmark, &workers)?,
            Format::Parquet => write_table(staged, &manifest.benchmark, &workers)?,
        };
        workers.finish();
        let files = [
            (MANIFEST, to_text(&manifest)),
            (TRUTH, truth_csv(&truths)),
            (RULES, report::bench::rules(&manifest)),
        ];
        for (name, text) in files {
            write_text(&staged.join(name), &text)?;
        }
        Ok(())
    })?;
    print(&format!(
        "{} experiments in {}\n",
        arguments.cases,
        out.display()
    ))?;
    Ok(ExitCode::from(exit::DONE))
}

fn experiment(benchmark: &Benchmark, number: u64) -> Result<(Truth, Recorded), Failure> {
    benchmark.experiment(number).map_err(Failure::usage)
}

/// Writes one file for each experiment.
fn write_recordings(
    folder: &Path,
    benchmark: &Benchmark,
    workers: &Workers,
) -> Result<Vec<Truth>, Failure> {
    let inside = folder.join(folder::RECORDINGS);
    std::fs::create_dir(&inside).map_err(|error| Failure::output(&inside, error))?;
    let count = benchmark.experiments as usize;
    workers.expect(count, 0);
    let written = workers.run(count, |index| {
        let number = index as u64 + 1;
        let (truth, recorded) = experiment(benchmark, number)?;
        let table = Recording::from_samples(&recorded.time_s, &recorded.input, &recorded.output)
            .map_err(Failure::usage)?;
        write_file(&recording(folder, number), |file| {
            write_csv(file, &table, &[])
        })?;
        Ok(truth)
    });
    written.into_iter().collect()
}

/// Number of experiments in memory at a time.
const LOT: usize = 64;

/// Writes one file with a row group for each experiment.
fn write_table(
    folder: &Path,
    benchmark: &Benchmark,
    workers: &Workers,
) -> Result<Vec<Truth>, Failure> {
    use onecycle_lab::judge::evaluate::parquet::Writer;
    let count = benchmark.experiments as usize;
    workers.expect(count, 0);
    let mut truths = Vec::with_capacity(count);
    write_file(&folder.join(folder::PARQUET), |file| {
        let mut writer = Writer::new(file)?;
        for begin in (0..count).step_by(LOT) {
            let lot = workers.run(LOT.min(count - begin), |index| {
                experiment(benchmark, (begin + index) as u64 + 1)
            });
            for made in lot {
                let (truth, recorded) = made.map_err(std::io::Error::other)?;
                writer.add(truth.number, &recorded)?;
                truths.push(truth);
            }
        }
        writer.finish()
    })?;
    Ok(truths)
}
