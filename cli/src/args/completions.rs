//! Arguments of `completions`.

use clap::Args;
use clap_complete::Shell;

/// Write the script that lets a shell complete commands, options and their values.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle completions bash > ~/.local/share/bash-completion/completions/onecycle\n",
    "  onecycle completions zsh > ~/.zfunc/_onecycle\n",
    "  onecycle completions fish > ~/.config/fish/completions/onecycle.fish\n",
    "  onecycle completions powershell >> $PROFILE\n",
    "  onecycle completions elvish >> ~/.config/elvish/rc.elv\n\n",
    "A shell that is started after that completes. For zsh, ~/.zshrc needs, before its line of compinit:\n",
    "fpath=(~/.zfunc $fpath)\n\n",
    "Exit codes: 0 done, 2 bad arguments, 5 output not written"
))]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    pub(crate) shell: Shell,
}
