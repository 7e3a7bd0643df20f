//! Arguments of `man`.

use std::path::PathBuf;

use clap::Args;

/// Write the manual pages.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle man -o ~/.local/share/man/man1\n",
    "  onecycle man > onecycle.1\n\n",
    "After the first command, man onecycle and man onecycle-identify work; if they do not, add\n",
    "~/.local/share/man to MANPATH. man -l onecycle.1 shows a single file.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 5 output not written"
))]
pub(crate) struct Man {
    /// Folder to write a page for each command to; created if it is missing [default: print the page of
    /// the program]
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}
