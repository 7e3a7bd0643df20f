//! Linear fit at one shape, and its derivatives with respect to the shape: columns of the equations, their
//! orthonormal basis, and the residual.

use core::task::Poll;

use super::domain::{HIGHEST, SHAPE, Shape};
use super::model::Model;
use super::problem::Problem;
use super::{ALL, LINEAR};
use crate::least_squares::{Columns, Triangle, back_substitute, dot};
use crate::window::Window;

/// Number of components removed from a column per slice.
pub(super) const PARTS: usize = 5;

/// Work memory for the model.
pub(super) struct Bench<const BINS: usize> {
    pub(super) model: Model,
    /// Rows for intermediate results.
    pub(super) rows: [[f64; BINS]; 3],
}

impl<const BINS: usize> Bench<BINS> {
    pub(super) const NONE: Self = Self {
        model: Model::NONE,
        rows: [[0.0; BINS]; 3],
    };
}

pub(super) struct LinearFit<const BINS: usize> {
    /// Orthonormal basis of the linear unknowns' columns, followed by the derivatives with respect to the shape.
    pub(super) basis: Columns<ALL, BINS>,
    pub(super) triangle: Triangle<ALL>,
    pub(super) coefficients: [f64; LINEAR],
    pub(super) residual: [f64; BINS],
    pub(super) cost: f64,
    pub(super) shape: Shape,
    stage: Stage,
}

/// Next step of a fit.
enum Stage {
    /// Set the process of the shape.
    Process,
    /// Compute a column of the model: its index.
    Model(usize),
    /// Orthonormalise that column.
    Basis(Orthonormalisation),
    /// Remove the basis from the outputs: components found so far, and their number.
    Residual([f64; LINEAR], usize),
}

impl<const BINS: usize> LinearFit<BINS> {
    /// All zeros: memory before the first use.
    pub(super) const NONE: Self = Self {
        basis: Columns::NONE,
        triangle: [[0.0; ALL]; ALL],
        coefficients: [0.0; LINEAR],
        residual: [0.0; BINS],
        cost: 0.0,
        shape: [0.0; SHAPE],
        stage: Stage::Process,
    };

    /// Begins the fit at a shape.
    pub(super) fn begin(&mut self, shape: &Shape) {
        self.shape = *shape;
        self.stage = Stage::Process;
    }

    /// Does one slice. Returns the sum of squares after the last: `None` in it if there is no such process or no
    /// finite fit.
    #[inline(never)]
    pub(super) fn advance<const EDGES: usize>(
        &mut self,
        problem: &Problem<BINS>,
        window: &Window<BINS, EDGES>,
        bench: &mut Bench<BINS>,
    ) -> Poll<Option<f64>> {
        match &mut self.stage {
            Stage::Process => {
                if bench.model.set(problem, &self.shape).is_none() {
                    return Poll::Ready(None);
                }
                self.basis.rows = problem.rows;
                self.triangle = [[0.0; ALL]; ALL];
                self.begin_column(0, window, bench);
            }
            Stage::Model(column) => {
                let column = *column;
                let rows = &mut self.basis.column[column];
                let [_, even, _] = &mut bench.rows;
                if bench.model.follow(problem, window.edges(), rows, even) {
                    self.stage = Stage::Basis(Orthonormalisation::of(column));
                }
            }
            Stage::Basis(under_way) => {
                if under_way.advance(&mut self.basis, &mut self.triangle) {
                    let next = under_way.column + 1;
                    if next < LINEAR {
                        self.begin_column(next, window, bench);
                    } else {
                        problem.measured(window, &self.shape, &mut self.residual);
                        self.stage = Stage::Residual([0.0; LINEAR], 0);
                    }
                }
            }
            Stage::Residual(parts, done) => {
                let residual = &mut self.residual[..problem.rows];
                let from = *done;
                *done = LINEAR.min(from + PARTS);
                for i in from..*done {
                    parts[i] = self.basis.remove_from(i, residual);
                }
                if *done == LINEAR {
                    self.cost = dot(residual, residual);
                    self.coefficients = back_substitute(&self.triangle, parts);
                    return Poll::Ready(self.cost.is_finite().then_some(self.cost));
                }
            }
        }
        Poll::Pending
    }

    fn begin_column<const EDGES: usize>(
        &mut self,
        column: usize,
        window: &Window<BINS, EDGES>,
        bench: &mut Bench<BINS>,
    ) {
        let mut unit = [0.0; LINEAR];
        unit[column] = 1.0;
        let rows = &mut self.basis.column[column];
        bench.model.begin(window.edges(), &unit, rows);
        self.stage = Stage::Model(column);
    }
}

/// Orthonormalisation of a column against the basis before it, some components per slice.
#[derive(Clone, Copy)]
pub(super) struct Orthonormalisation {
    pub(super) column: usize,
    /// Number of components removed, and the length before.
    done: usize,
    before: f64,
}

impl Orthonormalisation {
    pub(super) fn of(column: usize) -> Self {
        Self {
            column,
            done: 0,
            before: 0.0,
        }
    }

    /// Does one slice; true when the column is a unit vector or zero.
    pub(super) fn advance<const BINS: usize>(
        &mut self,
        basis: &mut Columns<ALL, BINS>,
        triangle: &mut Triangle<ALL>,
    ) -> bool {
        let j = self.column;
        if self.done == 0 {
            self.before = basis.length(j);
        }
        let from = self.done;
        self.done = j.min(from + PARTS);
        for i in from..self.done {
            triangle[i][j] = basis.remove(i, j);
        }
        if self.done < j {
            return false;
        }
        triangle[j][j] = basis.normalise(j, self.before);
        true
    }
}

/// Derivatives of the fitted model with respect to the shape at fixed coefficients: forward differences, or
/// backward differences at a limit of the domain.
#[derive(Clone, Copy)]
pub(super) struct Jacobian {
    /// Zero for the model at the shape itself, then the index of the derivative plus one.
    point: usize,
    is_begun: bool,
}

impl Jacobian {
    pub(super) const BEGIN: Self = Self {
        point: 0,
        is_begun: false,
    };

    /// Does one slice, into the columns after the basis; `None` if there is no process beside the shape.
    #[inline(never)]
    pub(super) fn advance<const BINS: usize, const EDGES: usize>(
        &mut self,
        problem: &Problem<BINS>,
        window: &Window<BINS, EDGES>,
        fit: &mut LinearFit<BINS>,
        bench: &mut Bench<BINS>,
    ) -> Poll<Option<()>> {
        let [here, even, _] = &mut bench.rows;
        let (mut moved, mut step) = (fit.shape, 0.0);
        let rows = match self.point.checked_sub(1) {
            None => &mut *here,
            Some(index) => {
                step = step_of(&fit.shape, index);
                moved[index] += step;
                &mut fit.basis.column[LINEAR + index]
            }
        };
        if !self.is_begun {
            if bench.model.set(problem, &moved).is_none() {
                return Poll::Ready(None);
            }
            let of = &fit.coefficients;
            bench.model.begin(window.edges(), of, rows);
            self.is_begun = true;
            return Poll::Pending;
        }
        if !bench.model.follow(problem, window.edges(), rows, even) {
            return Poll::Pending;
        }
        if let Some(index) = self.point.checked_sub(1) {
            let column = &mut fit.basis.column[LINEAR + index];
            for (value, here) in column.iter_mut().zip(&*here) {
                *value = (*value - here) / step;
            }
        }
        if self.point < SHAPE {
            (self.point, self.is_begun) = (self.point + 1, false);
            return Poll::Pending;
        }
        if let Some(prior) = &problem.prior {
            let columns = &mut fit.basis.column[LINEAR..];
            prior.add_to(columns, problem.rows - SHAPE, problem.sigma);
        }
        Poll::Ready(Some(()))
    }
}

/// Step of the differences: truncation error 1e-6, rounding error 1e-9.
const STEP: f64 = 1e-6;

fn step_of(shape: &Shape, index: usize) -> f64 {
    if shape[index] + STEP > HIGHEST[index] {
        -STEP
    } else {
        STEP
    }
}
