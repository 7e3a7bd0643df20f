//! In a page there is no terminal and no thread: progress becomes messages to the page.

use std::borrow::Cow;
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A page has no terminal.
pub fn columns() -> Option<usize> {
    None
}

/// A bar that nobody sees: the commands with pieces of work do not run in a page.
#[derive(Clone, Debug)]
pub struct ProgressBar;

/// A bar that nobody sees.
pub fn progress_bar(_: u64) -> ProgressBar {
    ProgressBar
}

impl ProgressBar {
    pub fn set_length(&self, _: u64) {}
    pub fn set_position(&self, _: u64) {}
    pub fn set_message(&self, _: impl Into<Cow<'static, str>>) {}
    pub fn inc(&self, _: u64) {}
    pub fn reset(&self) {}
    pub fn finish_and_clear(&self) {}
}

/// Takes the name of the work, the bytes done and, where it is known, the number of bytes in all.
pub type Listener = fn(&str, u64, Option<u64>);

thread_local! {
    static LISTENER: Cell<Option<Listener>> = const { Cell::new(None) };
}

/// Sets who hears of progress.
pub fn listen(listener: Listener) {
    LISTENER.set(Some(listener));
}

/// Bytes between two messages.
const STEP_BYTES: u64 = 1 << 21;

/// Work that goes on.
pub struct Waiting {
    work: Cow<'static, str>,
    done: AtomicU64,
    told: AtomicU64,
    bytes: Option<u64>,
}

impl Waiting {
    /// For work of unknown length, named for example `identifying`.
    pub fn on(work: impl Into<Cow<'static, str>>) -> Self {
        Self::told(work.into(), None)
    }

    /// For work on a known number of bytes.
    pub fn on_bytes(work: impl Into<Cow<'static, str>>, bytes: u64) -> Self {
        Self::told(work.into(), Some(bytes))
    }

    fn told(work: Cow<'static, str>, bytes: Option<u64>) -> Self {
        let waiting = Self {
            work,
            done: AtomicU64::new(0),
            told: AtomicU64::new(0),
            bytes,
        };
        waiting.tell(&waiting.work);
        waiting
    }

    fn tell(&self, work: &str) {
        let done = self.done.load(Relaxed);
        self.told.store(done, Relaxed);
        if let Some(listener) = LISTENER.get() {
            listener(work, done, self.bytes);
        }
    }

    /// Names the next step of the work.
    pub fn goes_on(&self, work: impl Into<Cow<'static, str>>) {
        self.tell(&work.into());
    }

    /// So many pieces of the work are done, of all.
    pub fn is_at(&self, work: &str, done: usize, all: usize) {
        if let Some(listener) = LISTENER.get() {
            listener(work, done as u64, Some(all as u64));
        }
    }

    /// Counts bytes as done.
    pub fn advance(&self, bytes: u64) {
        let done = self.done.fetch_add(bytes, Relaxed) + bytes;
        if done - self.told.load(Relaxed) >= STEP_BYTES {
            self.tell(&self.work);
        }
    }
}
