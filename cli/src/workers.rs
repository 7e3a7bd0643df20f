//! A pool of threads that work on pieces, with a progress bar.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::failure::Failure;
use crate::output::{ProgressBar, progress_bar};

/// The threads and their bar.
pub struct Workers {
    pool: ThreadPool,
    bar: ProgressBar,
}

impl Workers {
    /// A pool with this number of threads, by default one for each core.
    pub fn new(threads: Option<u64>) -> Result<Self, Failure> {
        // For the builder, zero means one thread for each core.
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0) as usize)
            .build()
            .map_err(|error| Failure::usage(format!("cannot start the threads: {error}")))?;
        let bar = progress_bar(0);
        Ok(Self { pool, bar })
    }

    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Sets the progress bar to a number of pieces, some of them done.
    pub fn expect(&self, count: usize, done: usize) {
        // The length first: a bar of no length is drawn full.
        self.bar.set_length(count as u64);
        self.bar.reset();
        self.bar.set_position(done as u64);
    }

    /// Runs pieces with a progress bar of their own; the results are in order.
    pub fn map<T: Send>(&self, count: usize, piece: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        self.expect(count, 0);
        self.run(count, piece)
    }

    /// Runs pieces and advances the bar for each; the results are in order.
    pub fn run<T: Send>(&self, count: usize, piece: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        self.quietly(count, |k| {
            let result = piece(k);
            self.bar.inc(1);
            result
        })
    }

    /// Runs pieces without advancing the bar; the results are in order.
    pub fn quietly<T: Send>(
        &self,
        count: usize,
        piece: impl Fn(usize) -> T + Send + Sync,
    ) -> Vec<T> {
        self.pool
            .install(|| (0..count).into_par_iter().map(piece).collect())
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
