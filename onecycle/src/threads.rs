//! Work on many items: with the feature `threads` on all cores, else one after the other.

/// What `of` makes of each item, in their order.
#[cfg(feature = "threads")]
pub(crate) fn each<T: Send, R: Send>(items: Vec<T>, of: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    use rayon::prelude::*;

    items.into_par_iter().map(of).collect()
}

/// What `of` makes of each item, in their order.
#[cfg(not(feature = "threads"))]
pub(crate) fn each<T, R>(items: Vec<T>, of: impl Fn(T) -> R) -> Vec<R> {
    items.into_iter().map(of).collect()
}
