//! Arguments of `studio`.

use std::path::PathBuf;

use clap::Args;

/// Write the studio, a page with everything that identify does, and open it in the browser.
///
/// The page is one file and works without a network: recordings and logs that are dropped on it stay on this machine.
/// Programs built with the feature `studio` contain it.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle studio\n",
    "  onecycle studio --no-open --out studio.html\n\n",
    "Exit codes: 0 done, 2 bad arguments or a program without the studio, 5 output not written"
))]
pub(crate) struct Studio {
    /// File to write
    #[arg(
        long,
        short,
        value_name = "FILE",
        default_value = "onecycle-studio.html"
    )]
    pub(crate) out: PathBuf,
    /// Do not open the browser
    #[arg(long)]
    pub(crate) no_open: bool,
}
