//! The binary `onecycle`. All code is in the library of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    onecycle_cli::run()
}
