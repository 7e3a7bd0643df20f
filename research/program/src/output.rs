//! Output: that of `onecycle`, under the name of this program.

use onecycle_cli::output;
pub(crate) use onecycle_cli::output::{
    ProgressBar, Waiting, print, progress_bar, with_ending, write_file, write_text,
};

use crate::PROGRAM;

/// Prints a message about progress to the error output.
pub(crate) fn tell(news: &str) {
    output::tell(PROGRAM, news);
}
