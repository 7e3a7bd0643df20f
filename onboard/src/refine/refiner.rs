//! Fit in slices: see the table in [`refine`](super).

use core::task::Poll;

use libm::sqrt;

use super::descent::NormalEquations;
use super::domain::{Shape, clamp, domain_edge, shape_of};
use super::fundamental::{STARTS, Sums};
use super::linear_fit::{Bench, Jacobian, LinearFit, PARTS};
use super::problem::Problem;
use super::search::{MOST_STEPS, MOST_TRIALS, Next, SEARCHED, Search};
use super::uncertainty::Uncertainty;
use super::{ALL, GIVEN, LINEAR, PriorKnowledge, RefineError, Refined, SHAPE};
use crate::window::Window;
use crate::{distortion, response};

/// State of a fit. It takes 120 bytes for each of `BINS` and 6.8 kB, so make it where it stays.
///
/// ```
/// use onecycle_onboard::refine::{PriorKnowledge, Refiner};
/// use onecycle_onboard::window::Window;
///
/// // Under a square wave of 0.2 s, a lag of 0.1 s and two integrations.
/// let mut window = Window::<69, 16>::new(0.4, 1e-3);
/// let (mut force, mut rate, mut output) = (0.0, 0.0, 0.0);
/// for tick in 0..800 {
///     let input = if tick / 100 % 2 == 0 { 1.0 } else { -1.0 };
///     window.push_input(1e-3 * f64::from(tick), input).map_err(|_| "edges")?;
///     if tick >= 400 {
///         window.push_output(1e-3 * f64::from(tick), output);
///     }
///     (output, rate) = (output + 1e-3 * rate, rate + 1e-3 * force);
///     force += 1e-3 * (input - force) / 0.1;
/// }
/// let mut refiner = Refiner::new();
/// refiner.begin(&window, 0.2, &PriorKnowledge::default()).map_err(|_| "window")?;
/// // One slice per control tick.
/// let refined = loop {
///     if let Some(outcome) = refiner.advance(&window) {
///         break outcome.map_err(|_| "no fit")?;
///     }
/// };
/// assert!((refined.process.t_prop_s() - 0.1).abs() < 0.01);
/// # Ok::<(), &str>(())
/// ```
pub struct Refiner<const BINS: usize> {
    problem: Problem<BINS>,
    given: [Shape; GIVEN],
    given_count: usize,
    may_walk: bool,
    /// The only shape to fit, without a search.
    only: Option<Shape>,
    fit: LinearFit<BINS>,
    bench: Bench<BINS>,
    search: Search,
    uncertainty: Uncertainty,
    stage: Stage,
}

/// Next step of a fit.
enum Stage {
    /// Not begun, or finished.
    Idle,
    /// Sum the fundamental of the oscillation.
    Oscillation(Sums),
    /// Linear fit at a start: its index.
    Start(usize),
    /// Linear fit at one of the best starts, to search from there.
    Best,
    /// Derivatives with respect to the shape.
    Derivatives(Jacobian),
    /// Project the linear columns out of the Jacobian: components removed so far, over all columns.
    Projection(usize),
    /// Solve for the step.
    Step,
    /// Linear fit at the shape after the step.
    Trial,
    /// Linear fit at the best shape of all.
    Last,
    /// Uncertainty of the best fit.
    Uncertainty,
}

impl<const BINS: usize> Default for Refiner<BINS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const BINS: usize> Refiner<BINS> {
    /// A fit that has not begun, all zeros.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            problem: Problem::NONE,
            given: [[0.0; SHAPE]; GIVEN],
            given_count: 0,
            may_walk: false,
            only: None,
            fit: LinearFit::NONE,
            bench: Bench::NONE,
            search: Search::ROOM,
            uncertainty: Uncertainty::NONE,
            stage: Stage::Idle,
        }
    }

    /// Begins the fit of a window of an oscillation with period `period_s` (s). A fit in progress is dropped.
    ///
    /// # Errors
    /// A [`RefineError`] if the window does not permit a fit.
    pub fn begin<const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        period_s: f64,
        prior_knowledge: &PriorKnowledge<'_>,
    ) -> Result<(), RefineError> {
        self.stage = Stage::Idle;
        self.problem.set(window, period_s, prior_knowledge.prior)?;
        self.may_walk = prior_knowledge.may_walk;
        self.only = None;
        self.given_count = 0;
        for (place, given) in self.given.iter_mut().zip(prior_knowledge.starts) {
            *place = clamp(given);
            self.given_count += 1;
        }
        self.search = Search::NONE;
        self.stage = Stage::Oscillation(Sums::default());
        Ok(())
    }

    /// Begins the fit of gain, bias and initial state alone: poles and dead time stay those found, and so does the kind of
    /// noise.
    ///
    /// # Errors
    /// A [`RefineError`] if the window does not permit a fit.
    pub(crate) fn begin_gain<const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        period_s: f64,
        found: &Refined,
    ) -> Result<(), RefineError> {
        self.begin(window, period_s, &PriorKnowledge::default())?;
        self.problem.walk = found.walk;
        self.only = Some(shape_of(&found.process, period_s));
        Ok(())
    }

    /// Relative standard deviation of the gain of the last fit with its poles and its dead time given.
    pub(crate) fn gain_deviation(&self) -> f64 {
        let of_gain = self.fit.triangle[LINEAR - 1][LINEAR - 1] * self.fit.coefficients[LINEAR - 1];
        let freedom = (self.problem.used - ALL) as f64;
        (sqrt(self.fit.cost / freedom) / of_gain).abs()
    }

    /// Does one slice; give it the same window each time. Returns the result after the last slice, `None`
    /// before.
    ///
    /// # Errors
    /// In the result: [`RefineError::NoFit`], also if no fit was begun.
    pub fn advance<const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
    ) -> Option<Result<Refined, RefineError>> {
        match self.slice(window) {
            Ok(Poll::Pending) => None,
            Ok(Poll::Ready(refined)) => {
                self.stage = Stage::Idle;
                Some(Ok(refined))
            }
            Err(error) => {
                self.stage = Stage::Idle;
                Some(Err(error))
            }
        }
    }

    fn slice<const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
    ) -> Result<Poll<Refined>, RefineError> {
        let (problem, bench) = (&self.problem, &mut self.bench);
        match &mut self.stage {
            Stage::Idle => return Err(RefineError::NoFit),
            Stage::Oscillation(sums) => {
                if let Some(fundamental) = sums.advance(window, problem.period_s) {
                    self.problem.settle(fundamental);
                    self.first_fit()?;
                }
            }
            Stage::Start(index) => {
                let index = *index;
                if let Poll::Ready(cost) = self.fit.advance(problem, window, bench) {
                    let cost = cost.unwrap_or(f64::INFINITY);
                    self.search.rank(&self.fit.shape, cost);
                    self.next_start(index + 1)?;
                }
            }
            Stage::Best => match self.fit.advance(problem, window, bench) {
                Poll::Pending => {}
                Poll::Ready(None) => self.give_up()?,
                Poll::Ready(Some(cost)) => {
                    let next = self.search.begin(&self.fit.shape, cost);
                    self.follow(next)?;
                }
            },
            Stage::Derivatives(jacobian) => {
                match jacobian.advance(problem, window, &mut self.fit, bench) {
                    Poll::Pending => {}
                    Poll::Ready(None) => self.give_up()?,
                    Poll::Ready(Some(())) => self.stage = Stage::Projection(0),
                }
            }
            Stage::Projection(done) => {
                let from = *done;
                self.project(from);
            }
            Stage::Step => {
                let derivatives = &self.fit.basis.column[LINEAR..];
                let residual = &self.fit.residual[..problem.rows];
                let normal = NormalEquations::new(derivatives, residual, &self.fit.shape);
                let next = self.search.solve(normal);
                self.follow(next)?;
            }
            Stage::Trial => {
                if let Poll::Ready(cost) = self.fit.advance(problem, window, bench) {
                    let next = self.search.judge(&self.fit.shape, cost);
                    self.follow(next)?;
                }
            }
            Stage::Last => {
                if let Poll::Ready(cost) = self.fit.advance(problem, window, bench) {
                    cost.ok_or(RefineError::NoFit)?;
                    if self.only.is_some() {
                        return self.refined(None).map(Poll::Ready);
                    }
                    self.uncertainty.begin();
                    self.stage = Stage::Uncertainty;
                }
            }
            Stage::Uncertainty => {
                let fit = &mut self.fit;
                if let Poll::Ready(known) = self.uncertainty.advance(problem, window, fit, bench) {
                    return self.end(known);
                }
            }
        }
        Ok(Poll::Pending)
    }

    /// Ends the fit, or begins it again with differences where the residual is a random walk.
    fn end(&mut self, known: Option<([[f64; 5]; 5], f64)>) -> Result<Poll<Refined>, RefineError> {
        let walk = self.uncertainty.walk;
        match walk.filter(|_| self.may_walk && self.problem.walk.is_none()) {
            None => self.refined(known).map(Poll::Ready),
            Some(walk) => {
                self.problem.difference(walk);
                self.search = Search::NONE;
                self.first_fit()?;
                Ok(Poll::Pending)
            }
        }
    }

    /// Begins the first start, or the fit of the only shape.
    fn first_fit(&mut self) -> Result<(), RefineError> {
        let Some(shape) = self.only else {
            return self.next_start(0);
        };
        self.fit.begin(&shape);
        self.stage = Stage::Last;
        Ok(())
    }

    /// Begins the linear fit at a start; the given ones come first.
    fn start(&mut self, index: usize) {
        let start = match self.given[..self.given_count].get(index) {
            Some(given) => *given,
            None => (self.problem.fundamental).start(index - self.given_count),
        };
        self.fit.begin(&start);
        self.stage = Stage::Start(index);
    }

    /// Begins the next start, or, when all are ranked, the search from the best.
    fn next_start(&mut self, index: usize) -> Result<(), RefineError> {
        if index < self.given_count + STARTS {
            self.start(index);
            return Ok(());
        }
        let best = self.search.first();
        self.search_from(best)
    }

    /// Removes the next components along the basis from the derivatives.
    fn project(&mut self, from: usize) {
        let all = LINEAR * SHAPE;
        let end = all.min(from + PARTS);
        for part in from..end {
            (self.fit.basis).remove(part % LINEAR, LINEAR + part / LINEAR);
        }
        self.stage = if end == all {
            Stage::Step
        } else {
            Stage::Projection(end)
        };
    }

    fn follow(&mut self, next: Next) -> Result<(), RefineError> {
        match next {
            Next::Step => self.stage = Stage::Derivatives(Jacobian::BEGIN),
            Next::Try(shape) => {
                self.fit.begin(&shape);
                self.stage = Stage::Trial;
            }
            Next::End => {
                if self.search.keep(self.problem.cost_of_noise()) {
                    return self.search_from(None);
                }
                return self.give_up();
            }
        }
        Ok(())
    }

    /// Ends the search from this start and begins the next.
    fn give_up(&mut self) -> Result<(), RefineError> {
        let next = self.search.next_start();
        self.search_from(next)
    }

    /// Searches from a start; without one, ends with the best shape found. Its fit is computed again, because
    /// there is no memory to keep it.
    fn search_from(&mut self, start: Option<Shape>) -> Result<(), RefineError> {
        let (shape, stage) = match start {
            Some(shape) => (shape, Stage::Best),
            None => (self.search.best().ok_or(RefineError::NoFit)?, Stage::Last),
        };
        self.fit.begin(&shape);
        self.stage = stage;
        Ok(())
    }

    fn refined(&self, known: Option<([[f64; 5]; 5], f64)>) -> Result<Refined, RefineError> {
        let (problem, fit) = (&self.problem, &self.fit);
        let [.., bias_gain, gain] = fit.coefficients;
        let process = problem
            .process(&fit.shape)
            .and_then(|unit| unit.with_gain_scaled(gain * unit.t_prop_s()).ok())
            .ok_or(RefineError::NoFit)?;
        let freedom = (problem.used - ALL) as f64;
        let variance = fit.cost / freedom;
        Ok(Refined {
            process,
            input_bias: bias_gain / gain,
            covariance: known.map(|(covariance, _)| covariance),
            response_error: known.map_or(0.0, |(_, error)| error),
            residual_sigma: sqrt(variance),
            noise_sigma: problem.noise_sigma,
            walk: problem.walk,
            residual_rms: sqrt(variance / problem.mean_weight_2()),
            edge: domain_edge(&fit.shape),
            steps: self.search.steps,
        })
    }

    /// Residual of the linear fit at a shape in each bin (output unit).
    pub(super) fn residuals<const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        shape: &Shape,
        residuals: &mut [f64; BINS],
    ) -> Result<(), RefineError> {
        while let Stage::Oscillation(sums) = &mut self.stage {
            if let Some(fundamental) = sums.advance(window, self.problem.period_s) {
                self.problem.settle(fundamental);
                self.stage = Stage::Idle;
            }
        }
        self.fit.begin(shape);
        let (problem, bench) = (&self.problem, &mut self.bench);
        let cost = loop {
            if let Poll::Ready(cost) = self.fit.advance(problem, window, bench) {
                break cost;
            }
        };
        cost.ok_or(RefineError::NoFit)?;
        for (k, (left, weight)) in residuals.iter_mut().zip(&problem.weight).enumerate() {
            *left = if *weight > 0.0 {
                self.fit.residual[k] / weight
            } else {
                0.0
            };
        }
        Ok(())
    }

    /// Upper bound of the number of slices of the fit just begun. A typical window takes a tenth of it: ten
    /// steps of a search instead of sixty, and half as many failures.
    #[must_use]
    pub fn most_slices<const EDGES: usize>(&self, window: &Window<BINS, EDGES>) -> usize {
        let (bins, edges) = (self.problem.bins(), window.edges().len());
        let whole = self.problem.grid.past_bins + bins;
        // Bins without an edge are processed 56 at a time; each edge costs a slice and may end one.
        let still = whole / response::SLICE_BINS + 2;
        let moved = still + 2 * edges;
        let distorted = 2 * (whole / distortion::SLICE_BINS + 2) + edges;
        // Process; columns, one of them with an initial state and one with distortion; orthonormalisation;
        // outputs.
        let fit = 1 + 4 * still + moved + distorted + LINEAR + 2;
        let derivatives = (1 + SHAPE) * (1 + moved + distorted);
        let step = derivatives + LINEAR * SHAPE / PARTS + 1 + 1;
        let searched = fit * (1 + MOST_TRIALS as usize) + step * MOST_STEPS as usize;
        let oscillation = (bins + 2 * edges) / super::fundamental::SLICE + 2;
        let all = fit * (self.given_count + STARTS)
            + searched * SEARCHED
            + fit
            + derivatives
            + Uncertainty::most_slices(bins);
        // Once more with differences.
        oscillation + all * (1 + usize::from(self.may_walk))
    }
}
