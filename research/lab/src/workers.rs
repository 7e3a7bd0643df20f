//! Threads of the caller; this crate starts none.
//!
//! Work is cut into parts that do not depend on each other. The caller runs them on any number
//! of threads; results do not depend on that number.

use std::sync::{Mutex, PoisonError};

/// Threads that work on parts.
pub trait Workers: Sync {
    /// Number of parts that are worked on at a time.
    fn count(&self) -> usize;

    /// Calls `part` with each of `0..parts` once, in any order, on any threads, and waits for all.
    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync));
}

impl dyn Workers + '_ {
    /// Results of the parts `0..parts`, in order.
    pub fn map<T: Send>(&self, parts: usize, part: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let results: Vec<Mutex<Option<T>>> = (0..parts).map(|_| Mutex::new(None)).collect();
        self.each(parts, &|k| {
            let result = part(k);
            *results[k].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        });
        (results.into_iter())
            .filter_map(|result| result.into_inner().unwrap_or_else(PoisonError::into_inner))
            .collect()
    }
}

/// The caller's own thread.
#[derive(Clone, Copy, Debug, Default)]
pub struct OneThread;

impl Workers for OneThread {
    fn count(&self) -> usize {
        1
    }

    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
        (0..parts).for_each(part);
    }
}
