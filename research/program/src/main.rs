//! The binary `onecycle-lab`. All code is in the library of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    onecycle_lab_cli::run()
}
