//! The search over shapes: the best of many starts, and from each of these Levenberg-Marquardt in a box.
//!
//! Of a step that is tried and refused nothing is needed but its cost, and of the fit that it started
//! from nothing but what the [`NormalEquations`] have: so one [`LinearFit`](super::linear_fit::LinearFit)
//! serves both.

use super::descent::NormalEquations;
use super::domain::{SHAPE, Shape, clamp};

/// Starts that are searched to the end, after all were tried once.
pub(super) const SEARCHED: usize = 3;
/// Limit of the search from one start; it takes about ten steps.
pub(super) const MOST_STEPS: u32 = 60;
/// The search ends when a step lowers the sum of squares by less than this part.
const CONVERGED: f64 = 1e-9;
/// Damping of a search's first step, beyond which nothing is tried, after a success and a failure.
const DAMPING: f64 = 1e-2;
const MOST_DAMPING: f64 = 1e12;
const SUCCESS: f64 = 0.1;
const FAILURE: f64 = 8.0;
/// Linear fits of a search at most. With `a` successes of [`MOST_STEPS`] the damping is beyond its limit
/// after `log8(1e14 10^a) + 1` failures: 83.
pub(super) const MOST_TRIALS: u32 = MOST_STEPS + 83;

pub(super) struct Search {
    /// The best starts and their sums of squares, best first.
    starts: [(Shape, f64); SEARCHED],
    /// The one that is searched from.
    place: usize,
    /// Where the search from it is, and its sum of squares.
    shape: Shape,
    cost: f64,
    /// The sum of squares before the step under way.
    before: f64,
    damping: f64,
    normal: NormalEquations,
    /// Steps from this start, and from all.
    taken: u32,
    pub(super) steps: u32,
    /// The best of all searches.
    best: Option<(Shape, f64)>,
}

/// What a search does next.
#[derive(Clone, Copy)]
pub(super) enum Next {
    /// Another step, from the fit at hand.
    Step,
    /// A linear fit at this shape, whose step this is.
    Try(Shape),
    /// It has ended.
    End,
}

impl Search {
    /// Room for one, all zeros.
    pub(super) const ROOM: Self = Self {
        starts: [([0.0; SHAPE], 0.0); SEARCHED],
        cost: 0.0,
        before: 0.0,
        damping: 0.0,
        ..Self::NONE
    };

    /// Without starts.
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

    /// The first start to search from.
    pub(super) fn first(&self) -> Option<Shape> {
        self.start()
    }

    /// The next one, if any.
    pub(super) fn next_start(&mut self) -> Option<Shape> {
        self.place += 1;
        self.start()
    }

    fn start(&self) -> Option<Shape> {
        let (start, cost) = self.starts.get(self.place)?;
        cost.is_finite().then_some(*start)
    }

    /// Begins at the fit of a start.
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

    /// Solves a step's equations.
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

    /// Takes or refuses the shape that was tried, by its sum of squares.
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

    /// Keeps where the search has ended if it is the best; true where nothing better is to be found than
    /// this sum of squares.
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
