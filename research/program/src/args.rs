//! Command line arguments. `--help` is generated from these definitions.

mod bench;
mod campaign;
mod certify;
mod classify;
mod dataset;
mod grid;
mod pack;
mod phase;
mod reproduce;
mod train;

use clap::{Parser, Subcommand};

pub(crate) use self::bench::{
    Answers, Bench, BenchAction, CLASSIFIER, Format, MakeBench, RunBench,
};
pub(crate) use self::campaign::Campaign;
pub(crate) use self::certify::Certify;
pub(crate) use self::classify::Classify;
pub(crate) use self::dataset::Dataset;
pub(crate) use self::grid::{Cost, Grid};
pub(crate) use self::pack::{
    ExportPack, ImportPack, MarginPack, Pack, PackAction, ShowPack, VerifyPack,
};
pub(crate) use self::phase::Phase;
pub(crate) use self::reproduce::{Name, Reproduce};
pub(crate) use self::train::Train;

const AFTER_HELP: &str = "\
onecycle-lab COMMAND --help explains each command and has examples. A SHARE is written as 5% or 0.05.

Exit codes:
  0  done
  2  bad arguments
  3  an input file cannot be read; the message says where and what to do
  4  finished, with a negative result: a space is not certified, a grid leaves holes, a pack fails
     its self-test, or a trained pack is of little use
  5  the output cannot be written";

/// Experiments, training and evaluation behind onecycle.
#[derive(Debug, Parser)]
#[command(name = "onecycle-lab", version, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Commands in the order of the work: spaces of processes, benchmarks, training.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Certify(Certify),
    Phase(Phase),
    Grid(Grid),
    Campaign(Campaign),
    Bench(Bench),
    Reproduce(Reproduce),
    Dataset(Dataset),
    Train(Train),
    Classify(Classify),
    Pack(Pack),
}

// Those of the other program.
#[cfg(test)]
#[path = "../../../cli/src/args/tests.rs"]
mod tests;
