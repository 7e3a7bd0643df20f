//! The terminal: its width, and progress on the error output.

use std::borrow::Cow;
use std::io;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

pub use indicatif::ProgressBar;
use indicatif::{ProgressDrawTarget, ProgressStyle};
use terminal_size::{Width, terminal_size_of};

/// Width of the standard output in characters, if it is a terminal.
pub fn columns() -> Option<usize> {
    terminal_size_of(io::stdout()).map(|(Width(columns), _)| usize::from(columns))
}

/// A progress bar on the error output for a number of pieces of work, with a message; hidden if that is not a terminal.
pub fn progress_bar(pieces: u64) -> ProgressBar {
    let bar = ProgressBar::new(pieces);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} {eta}  {msg}") {
        bar.set_style(style);
    }
    bar
}

/// Time before a progress indicator appears.
const QUICK: Duration = Duration::from_millis(500);
/// Time between two updates of a progress indicator.
const TURN: Duration = Duration::from_millis(100);

/// A progress indicator on the error output. It appears on a terminal only, if the work takes longer than half a second, and
/// disappears when it is dropped.
pub struct Waiting {
    bar: ProgressBar,
    over: Option<Sender<()>>,
    patience: Option<JoinHandle<()>>,
}

impl Waiting {
    /// For work of unknown length, named for example `identifying`.
    pub fn on(work: impl Into<Cow<'static, str>>) -> Self {
        Self::shown_as("{spinner} {msg} {elapsed}", None, work)
    }

    /// For work on a known number of bytes.
    pub fn on_bytes(work: impl Into<Cow<'static, str>>, bytes: u64) -> Self {
        let template = "{wide_bar} {bytes}/{total_bytes} {eta}  {msg}";
        Self::shown_as(template, Some(bytes), work)
    }

    fn shown_as(template: &str, length: Option<u64>, work: impl Into<Cow<'static, str>>) -> Self {
        let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(work);
        let (over, is_over) = channel();
        let shown = bar.clone();
        let patience = std::thread::Builder::new().spawn(move || {
            if is_over.recv_timeout(QUICK) == Err(RecvTimeoutError::Timeout) {
                shown.set_draw_target(ProgressDrawTarget::stderr());
                shown.enable_steady_tick(TURN);
            }
        });
        Self {
            bar,
            over: Some(over),
            // Without a thread there is no indicator.
            patience: patience.ok(),
        }
    }

    /// Names the next step of the work.
    pub fn goes_on(&self, work: impl Into<Cow<'static, str>>) {
        self.bar.set_message(work);
    }

    /// So many pieces of the work are done, of all.
    pub fn is_at(&self, work: &str, done: usize, all: usize) {
        self.bar.set_message(format!("{work}, {done} of {all}"));
    }

    /// Counts bytes as done.
    pub fn advance(&self, bytes: u64) {
        self.bar.inc(bytes);
    }

    /// Bytes done, and bytes in all.
    #[cfg(test)]
    pub fn position(&self) -> (u64, Option<u64>) {
        (self.bar.position(), self.bar.length())
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        drop(self.over.take());
        if let Some(patience) = self.patience.take() {
            // The thread cannot panic.
            let _ = patience.join();
        }
        self.bar.finish_and_clear();
    }
}
