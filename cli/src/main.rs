//! The binary `onecycle`: everything is in the library of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    onecycle_cli::run()
}
