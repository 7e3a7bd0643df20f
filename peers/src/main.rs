//! A batch of one through onecycle and through other libraries, on one thread, in one run.
//!
//! | network                                        | compared                                     |
//! |------------------------------------------------|----------------------------------------------|
//! | 4520-3000-1000-182, ReLU, batch norm folded    | `Network::evaluate`, and merely reading as   |
//! |                                                | many bytes as its weights, 67 MB             |
//! | that of the pack that is built in              | `Pack::outputs`, and a whole `classify_by`   |
//!
//! with onnxruntime and tract, which read the ONNX file that onecycle writes, and candle, which is
//! given the weights. Each contender is called in turn, round after round, so that whatever else
//! the machine does falls on all of them; each has its own copy of the weights, so that none finds
//! in a cache what another has read. Outputs are held against a sum in f64. A peer that cannot be
//! had is named with the reason, and left out.
//!
//! ```text
//! python3 -m venv .venv && .venv/bin/pip install onnxruntime==1.31.1
//! PYTHON=.venv/bin/python cargo run --release --manifest-path peers/Cargo.toml
//! ```
//!
//! onnxruntime is the shared library of the Python package, called without Python. Status 1 where
//! outputs disagree.

mod contenders;
mod networks;
mod onnxruntime;
mod reading;
mod rounds;

use std::error::Error;
use std::process::{Command, ExitCode};

use onecycle_onboard::pack::Pack;
use ort::environment::Environment;

use crate::networks::Case;
use crate::rounds::{Contender, Rounds};

type Failure = Box<dyn Error>;

/// What candle asks for the number of threads.
const THREADS: &str = "RAYON_NUM_THREADS";

fn main() -> ExitCode {
    match on_one_thread() {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// The same program with one thread for everything: libraries look at their environment when they
/// start, so it must be there before.
fn on_one_thread() -> Result<ExitCode, Failure> {
    if std::env::var(THREADS).is_ok_and(|threads| threads == "1") {
        return compare();
    }
    let status = Command::new(std::env::current_exe()?)
        .env(THREADS, "1")
        .status()?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(ExitCode::from(code.unwrap_or(2)))
}

fn compare() -> Result<ExitCode, Failure> {
    let directory = tempfile::tempdir()?;
    let environment = onnxruntime::environment()
        .inspect_err(|error| println!("onnxruntime is left out: {error}\n"))
        .ok();

    let paper = networks::paper(directory.path())?;
    let weights = reading::copy(&paper.network);
    let megabytes = 4e-6 * weights.len() as f64;
    let mut all = vec![
        reading::contender(&weights, 1),
        reading::contender(&weights, 4),
        contenders::network(&paper.network),
    ];
    all.extend(peers(&paper, environment.as_ref()));
    let title = format!("4520-3000-1000-182, {megabytes:.0} MB of weights");
    let do_agree = Rounds::PAPER.report(&title, all, &paper)?;
    drop(weights);

    let pack = Pack::embedded()?;
    let shipped = networks::shipped(&pack, directory.path())?;
    let mut all = vec![contenders::pack(pack), contenders::classification(pack)];
    all.extend(peers(&shipped, environment.as_ref()));
    let widths = shipped.widths();
    let title = format!("the network of the pack that is built in, {widths}");
    let do_agree = Rounds::SHIPPED.report(&title, all, &shipped)? && do_agree;
    Ok(ExitCode::from(u8::from(!do_agree)))
}

/// The other libraries, and for each that fails to take the network, why.
fn peers<'a>(case: &'a Case, environment: Option<&Environment>) -> Vec<Contender<'a>> {
    let mut made = vec![
        ("tract", contenders::tract(case)),
        ("candle", contenders::candle(case)),
    ];
    if let Some(environment) = environment {
        made.insert(
            0,
            ("onnxruntime", onnxruntime::contender(environment, case)),
        );
    }
    let had = made.into_iter().filter_map(|(name, contender)| {
        contender
            .inspect_err(|error| println!("{name} is left out: {error}\n"))
            .ok()
    });
    had.collect()
}
