//! Search over shapes: ranks all starts, then runs Levenberg-Marquardt with box constraints from the best ones.
//!
//! A rejected step needs only its cost, and the fit at which a step began only its [`NormalEquations`], so a
//! single [`LinearFit`](super::linear_fit::LinearFit) serves both.

use super::descent::NormalEquations;
use super::domain::{SHAPE, Shape, clamp};

/// Number of starts that are searched to the end.
pub(super) const SEARCHED: usize = 3;
/// Maximum number of steps from one start; ten are typical.
pub(super) const MOST_STEPS: u32 = 60;
/// The search ends when a step lowers the sum of squares by less than this fraction.
const CONVERGED: f64 = 1e-9;
/// Damping: of the first step, upper limit, factor after a success, factor after a failure.
const DAMPING: f64 = 1e-2;
const MOST_DAMPING: f64 = 1e12;
const SUCCESS: f64 = 0.1;
const FAILURE: f64 = 8.0;
/// Maximum number of linear fits of a search. After `a` successes, [`MOST_STEPS`] at most, the damping exceeds
/// its limit after `log8(1e14 10^a) + 1` failures: 83.
pub(super) const MOST_TRIALS: u32 = MOST_STEPS + 83;

pub(super) struct Search {
    /// The best starts and their sums of squares, best first.
    starts: [(Shape, f64); SEARCHED],
    /// Index of the start that is being searched from.
    place: usize,
    /// Present shape of that search, and its sum of squares.
    shape: Shape,
    cost: f64,
    /// Sum of squares before the step in progress.
    before: f64,
    damping: f64,
    normal: NormalEquations,
    /// Steps from this start, and from all starts.
    taken: u32,
    pub(super) steps: u32,
    /// Best result of all searches.
    best: Option<(Shape, f64)>,
}

/// What a search does next.
#[derive(Clone, Copy)]
pub(super) enum Next {
    /// Another step, from the present fit.
    Step,
    /// A linear fit at this shape, the result of a step.
    Try(Shape),
    /// The search has ended.
    End,
}

impl Search {
    /// All zeros: memory before the first use.
    pub(super) const ROOM: Self = Self {
        starts: [([0.0; SHAPE], 0.0); SEARCHED],
        cost: 0.0,
        before: 0.0,
        damping: 0.0,
        ..Self::NONE
    };

    /// No starts.
    pub(super) const NONE: Self = Self {
        starts: [([0.0; SHAPE], f64::INFINITY); SEARCHED],
        place: 0,
        shape: [0.0; SHAPE],
        cost: f64::INFINITY,
        before: f64::INFINITY,
        damping: DAMPING,
        normal: NormalEquations::NONE,
        taken: 0,
        steps: 0,
        best: None,
    };

    /// Ranks a start by its sum of squares.
    pub(super) fn rank(&mut self, start: &Shape, cost: f64) {
        if let Some(place) = self.starts.iter().position(|&(_, other)| cost < other) {
            self.starts[place..].rotate_right(1);
            self.starts[place] = (*start, cost);
        }
    }

    /// First start to search from.
    pub(super) fn first(&self) -> Option<Shape> {
        self.start()
    }

    /// Next start, if any.
    pub(super) fn next_start(&mut self) -> Option<Shape> {
        self.place += 1;
        self.start()
    }

    fn start(&self) -> Option<Shape> {
        let (start, cost) = self.starts.get(self.place)?;
        cost.is_finite().then_some(*start)
    }

    /// Begins the search at the fit of a start.
    pub(super) fn begin(&mut self, start: &Shape, cost: f64) -> Next {
        (self.shape, self.cost) = (*start, cost);
        self.damping = DAMPING;
        self.taken = 0;
        self.step()
    }

    fn step(&mut self) -> Next {
        if self.taken == MOST_STEPS {
            return Next::End;
        }
        self.taken += 1;
        self.steps += 1;
        Next::Step
    }

    /// Solves the equations of a step.
    pub(super) fn solve(&mut self, normal: NormalEquations) -> Next {
        self.normal = normal;
        self.before = self.cost;
        self.attempt()
    }

    fn attempt(&self) -> Next {
        if self.damping < MOST_DAMPING {
            Next::Try(clamp(&self.normal.step(&self.shape, self.damping)))
        } else {
            Next::End
        }
    }

    /// Accepts or rejects the shape tried, by its sum of squares.
    pub(super) fn judge(&mut self, tried: &Shape, cost: Option<f64>) -> Next {
        match cost {
            Some(cost) if cost < self.cost => {
                (self.shape, self.cost) = (*tried, cost);
                self.damping *= SUCCESS;
                if self.before - self.cost <= CONVERGED * self.before {
                    Next::End
                } else {
                    self.step()
                }
            }
            _ => {
                self.damping *= FAILURE;
                if self.normal.step_is_negligible(self.damping) {
                    Next::End
                } else {
                    self.attempt()
                }
            }
        }
    }

    /// Keeps the result of a search if it is the best so far. True if its sum of squares is `enough` or less, so
    /// that no further search is needed.
    pub(super) fn keep(&mut self, enough: f64) -> bool {
        let is_better = (self.best).is_none_or(|(_, least)| self.cost < least);
        if is_better {
            self.best = Some((self.shape, self.cost));
        }
        is_better && self.cost <= enough
    }

    /// The best shape.
    pub(super) fn best(&self) -> Option<Shape> {
        self.best.map(|(shape, _)| shape)
    }
}
