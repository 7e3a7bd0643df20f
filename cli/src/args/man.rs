//! Arguments of `man`.

use std::path::PathBuf;

use clap::Args;

/// Write the manual: a page for the program, and with -o one for every command.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle man -o ~/.local/share/man/man1\n",
    "  onecycle man > onecycle.1\n\n",
    "After the first, man onecycle and man onecycle-identify show their pages; where they do not, add\n",
    "~/.local/share/man to MANPATH. man -l onecycle.1 shows a single file.\n\n",
    "Exit codes: 0 done, 2 bad arguments, 5 output not written"
))]
pub(crate) struct Man {
    /// Folder to write the pages to, made if it is not there [default: the program's page to the
    /// standard output]
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}
