//! What several tests need.

use onecycle_lab::paper::grid::Pieces;

/// Pieces on two threads.
pub(crate) struct Two;

impl Pieces for Two {
    fn map<T: Send>(&self, count: usize, piece: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        let half = count / 2;
        std::thread::scope(|scope| {
            let upper = scope.spawn(|| (half..count).map(&piece).collect::<Vec<T>>());
            let mut all: Vec<T> = (0..half).map(&piece).collect();
            all.extend(upper.join().unwrap());
            all
        })
    }
}
