//! Tests of the program as users run it. All are modules of one test program, which is linked once:
//! `cargo test -p onecycle-lab-cli bench` runs those of `bench`. Helpers are those of `onecycle-cli`.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests are tests too, which the lint does not see"
)]

mod bad_arguments;
mod bench;
mod campaign;
mod certify;
mod dataset;
mod documentation;
mod grid;
mod honesty;
mod identifier;
mod killed;
mod pack;
mod phase;
mod reproduce;
mod terminal;
mod train;
mod unknown;

#[path = "../../../../cli/tests/it/colours.rs"]
mod colours;
#[path = "../../../../cli/tests/it/common.rs"]
#[allow(dead_code, reason = "the other program needs all of them")]
mod common;
#[path = "../../../../cli/tests/it/pages.rs"]
mod pages;

use std::path::{Path, PathBuf};

/// The program that has a command. `onecycle` is the example of this package, which `cargo test` builds.
fn path_of(command: &str) -> PathBuf {
    let lab = Path::new(env!("CARGO_BIN_EXE_onecycle-lab"));
    if ["identify", "simulate", "tune"].contains(&command) {
        let name = format!("onecycle{}", std::env::consts::EXE_SUFFIX);
        lab.with_file_name("examples").join(name)
    } else {
        lab.to_owned()
    }
}
