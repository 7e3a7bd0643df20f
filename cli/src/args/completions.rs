//! Arguments of `completions`.

use clap::Args;
use clap_complete::Shell;

/// Print the completion script of a shell.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle completions bash > ~/.local/share/bash-completion/completions/onecycle\n",
    "  onecycle completions zsh > ~/.zfunc/_onecycle\n",
    "  onecycle completions fish > ~/.config/fish/completions/onecycle.fish\n",
    "  onecycle completions powershell >> $PROFILE\n",
    "  onecycle completions elvish >> ~/.config/elvish/rc.elv\n\n",
    "New shells then complete commands, options and values. zsh also needs this line in ~/.zshrc, before\n",
    "compinit: fpath=(~/.zfunc $fpath)\n\n",
    "Exit codes: 0 done, 2 bad arguments, 5 output not written"
))]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    pub(crate) shell: Shell,
}
