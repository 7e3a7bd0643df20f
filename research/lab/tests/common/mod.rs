//! Helpers that several tests share.

use onecycle_lab::workers::Workers;

/// Runs every piece of work on this many new threads, which share its parts.
pub(crate) struct Threads(pub(crate) usize);

impl Workers for Threads {
    fn count(&self) -> usize {
        self.0
    }

    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
        std::thread::scope(|scope| {
            for thread in 0..self.0 {
                scope.spawn(move || (thread..parts).step_by(self.0).for_each(part));
            }
        });
    }
}
