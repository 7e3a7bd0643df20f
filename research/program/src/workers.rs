//! The threads of the program as those that the library asks for.

use std::ops::Deref;

use onecycle_cli::failure::Failure;
use onecycle_cli::workers;
use onecycle_lab::workers::Workers as Seam;

/// A pool of threads with a progress bar.
pub(crate) struct Workers(workers::Workers);

impl Workers {
    /// A pool with this number of threads, by default one for each core.
    pub(crate) fn new(threads: Option<u64>) -> Result<Self, Failure> {
        workers::Workers::new(threads).map(Self)
    }
}

impl Deref for Workers {
    type Target = workers::Workers;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl Seam for Workers {
    fn count(&self) -> usize {
        self.threads()
    }

    /// The bar counts the parts from zero.
    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
        self.expect(parts, 0);
        self.run(parts, part);
    }
}

/// The same threads for one of several lots of work that the bar expects together.
pub(crate) struct Lot<'a>(pub(crate) &'a Workers);

impl Seam for Lot<'_> {
    fn count(&self) -> usize {
        self.0.threads()
    }

    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
        self.0.run(parts, part);
    }
}

/// The same threads for parts that the bar does not count.
pub(crate) struct Quiet<'a>(pub(crate) &'a Workers);

impl Seam for Quiet<'_> {
    fn count(&self) -> usize {
        self.0.threads()
    }

    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
        self.0.quietly(parts, part);
    }
}
