//! Work on many items: with the feature `threads` on all cores, else one after the other.

#[cfg(feature = "threads")]
use std::sync::{Arc, Mutex, PoisonError};

/// What `of` makes of each item, in their order. A thread of a pool takes the threads of that pool.
#[cfg(feature = "threads")]
pub(crate) fn each<T: Send, R: Send>(items: Vec<T>, of: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    use rayon::prelude::*;

    let work = || items.into_par_iter().map(of).collect();
    match pool().filter(|_| rayon::current_thread_index().is_none()) {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// The threads of this process. `None`: the system gives it none, as on a page.
///
/// No thread lives on in a forked process, which would wait for those of its parent for ever, as it does with rayon's own pool.
#[cfg(feature = "threads")]
fn pool() -> Option<Arc<rayon::ThreadPool>> {
    static POOL: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>> = Mutex::new(None);
    if cfg!(target_family = "wasm") {
        return None;
    }
    let mut kept = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((_, pool)) = kept.as_ref().filter(|(of, _)| *of == process) {
        return Some(Arc::clone(pool));
    }
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().build().ok()?);
    // Its threads are gone, and dropping it would wake them.
    std::mem::forget(kept.replace((process, Arc::clone(&pool))));
    Some(pool)
}

/// What `of` makes of each item, in their order.
#[cfg(not(feature = "threads"))]
pub(crate) fn each<T, R>(items: Vec<T>, of: impl Fn(T) -> R) -> Vec<R> {
    items.into_iter().map(of).collect()
}
