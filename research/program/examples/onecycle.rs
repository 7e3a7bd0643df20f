//! The program `onecycle`, for the tests.

use std::process::ExitCode;

fn main() -> ExitCode {
    onecycle_cli::run()
}
