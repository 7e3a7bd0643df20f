//! The latest changes of the input.

use super::PAST_EDGES;
use crate::window::Edge;

/// The latest changes of the input, for the next window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Past {
    edges: [Edge; PAST_EDGES],
    count: usize,
}

impl Past {
    pub(super) fn push(&mut self, time_s: f64, input: f64) {
        if self.edges().last().is_some_and(|edge| edge.input == input) {
            return;
        }
        self.edges.rotate_left(1);
        self.edges[PAST_EDGES - 1] = Edge { time_s, input };
        self.count = PAST_EDGES.min(self.count + 1);
    }

    pub(super) fn edges(&self) -> &[Edge] {
        &self.edges[PAST_EDGES - self.count..]
    }
}
