//! From a model, or from all that the process may be, to a controller.
//!
//! [`design`] takes one model. [`design_over`] takes draws from the posterior and returns the controller of least
//! expected cost over them:
//!
//! ```text
//! choose C to minimise   mean_i min(|J(C, i) / J*_i - 1|, 1),    i drawn from the posterior
//! ```
//!
//! `J*_i` is the least cost of draw `i` at the margin asked for. A controller that costs less than `J*_i` has less margin
//! there, so a lower cost counts as a loss too. An unstable loop has no cost: one unstable draw would dominate the mean,
//! so its loss is capped at 1, a doubled cost, some hundred times what identification usually costs.
//!
//! The candidates are the optima of the draws: each has the margin asked for on a process that is likely. A free search
//! over both gains finds controllers of the same expected cost with a third of the margin.

use std::fmt;

use crate::closed_loop::{ise, margins};
use crate::controller::{Controller, Form};
use crate::model::Model;
use crate::soiptd_pd;
use crate::soiptd_pd::margins::Margins;
use crate::soiptd_pd::optimum::OptimumError;

/// Draws that [`design_over`] needs: the mean of a distribution as wide as itself is then known to a tenth.
pub const DRAWS: usize = 96;

/// What a controller has to be and to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Specification {
    /// Form of the controller.
    pub form: Form,
    /// Least phase margin (rad), between 0 and `pi/2`.
    pub phase_margin_rad: f64,
}

impl Default for Specification {
    /// The paper's: a PD with 20 degrees.
    fn default() -> Self {
        Self {
            form: Form::Pd,
            phase_margin_rad: 20_f64.to_radians(),
        }
    }
}

impl Specification {
    /// The same with another least phase margin (rad).
    #[must_use]
    pub fn with_phase_margin_rad(self, phase_margin_rad: f64) -> Self {
        Self {
            phase_margin_rad,
            ..self
        }
    }
}

/// A controller with what it costs and leaves on one model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Design {
    /// The controller.
    pub controller: Controller,
    /// Integral of the squared error of a unit step of the reference (output unit^2 s).
    pub ise: f64,
    /// Margins of the loop.
    pub margins: Margins,
}

/// Why there is no controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum DesignError {
    /// The phase margin asked for (rad) is not between 0 and `pi/2`.
    PhaseMargin(f64),
    /// The gain or the times of the model are so extreme that gains or cost overflow.
    Overflow,
}

impl fmt::Display for DesignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PhaseMargin(rad) => write!(
                f,
                "the phase margin must lie between 0 and pi/2 rad, but is {rad} rad"
            ),
            Self::Overflow => f.write_str("the optimal gains of this process are out of range"),
        }
    }
}

impl std::error::Error for DesignError {}

impl From<OptimumError> for DesignError {
    fn from(error: OptimumError) -> Self {
        match error {
            OptimumError::PhaseMargin(rad) => Self::PhaseMargin(rad),
            OptimumError::Overflow => Self::Overflow,
        }
    }
}

/// The controller of least squared error that keeps the specification on `model`.
///
/// # Errors
/// [`DesignError`]: the margin is out of range, or the model is too extreme.
pub fn design(model: &Model, specification: &Specification) -> Result<Design, DesignError> {
    let (Model::Soiptd(process), Form::Pd) = (model, specification.form);
    let best = soiptd_pd::pd(process, specification.phase_margin_rad)?;
    Ok(Design {
        controller: best.pd.into(),
        ise: best.ise,
        margins: best.margins,
    })
}

/// The controller of least expected cost over `draws`, with its cost and margins on `model`, the most probable one.
/// [`DRAWS`] draws are enough; without any it is that of [`design`].
///
/// # Errors
/// Those of [`design`] for `model`; a draw without a controller is left out.
pub fn design_over(
    model: &Model,
    draws: &[Model],
    specification: &Specification,
) -> Result<Design, DesignError> {
    let own = design(model, specification)?;
    let optima: Vec<(Model, Design)> = (draws.iter())
        .filter_map(|draw| Some((*draw, design(draw, specification).ok()?)))
        .collect();
    let loss = |candidate: &Design| expected_loss(&candidate.controller, &optima);
    let best = (optima.iter())
        .filter_map(|(_, candidate)| on(model, candidate.controller))
        .map(|candidate| (loss(&candidate), candidate))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    Ok(match best {
        Some((least, candidate)) if least < loss(&own) => candidate,
        _ => own,
    })
}

fn expected_loss(controller: &Controller, optima: &[(Model, Design)]) -> f64 {
    let loss = |(model, optimum): &(Model, Design)| {
        ise(model, controller).map_or(1.0, |cost| (cost / optimum.ise - 1.0).abs().min(1.0))
    };
    optima.iter().map(loss).sum::<f64>() / optima.len().max(1) as f64
}

/// A controller on a model that it was not made for; `None` where their loop is unstable.
fn on(model: &Model, controller: Controller) -> Option<Design> {
    Some(Design {
        controller,
        ise: ise(model, &controller)?,
        margins: margins(model, &controller)?,
    })
}

#[cfg(test)]
mod tests {
    use onecycle_onboard::Soiptd;

    use super::*;

    fn specification() -> Specification {
        Specification::default().with_phase_margin_rad(0.35)
    }

    fn own(process: &Soiptd) -> Design {
        design(&(*process).into(), &specification()).unwrap()
    }

    fn chosen(process: &Soiptd, draws: &[Soiptd]) -> Design {
        let draws: Vec<Model> = draws.iter().map(|&draw| draw.into()).collect();
        design_over(&(*process).into(), &draws, &specification()).unwrap()
    }

    fn process() -> Soiptd {
        Soiptd::new(1.0, 0.05, 1.0, 0.02).unwrap()
    }

    // Of two gains that differ by 10 % one is three times as likely: the expected loss, a sum of absolute
    // values, is least at that one's optimum, whichever is called the most probable.
    #[test]
    fn the_majority_decides() {
        let process = process();
        let strong = process.with_gain_scaled(1.1).unwrap();
        let chosen = chosen(&process, &[process, strong, strong, strong]);
        assert_eq!(chosen.controller, own(&strong).controller);
        assert_eq!(
            Some(chosen.ise),
            ise(&process.into(), &own(&strong).controller)
        );
    }

    #[test]
    fn without_draws_the_most_probable_process_decides() {
        assert_eq!(chosen(&process(), &[]), own(&process()));
    }

    // Half of the probability is on a gain three times as large, with which the optimum of the other is
    // unstable: a loss of 1 there. The optimum of the large gain is stable on both.
    #[test]
    fn an_unstable_loop_is_avoided() {
        let process = process();
        let strong = process.with_gain_scaled(3.0).unwrap();
        assert_eq!(ise(&strong.into(), &own(&process).controller), None);
        let chosen = chosen(&process, &[process, strong]);
        assert_eq!(chosen.controller, own(&strong).controller);
    }

    #[test]
    fn margins_out_of_range_are_refused() {
        for margin_rad in [0.0, -1.0, 1.6, f64::NAN] {
            let asked = specification().with_phase_margin_rad(margin_rad);
            let refused = design(&process().into(), &asked);
            assert!(matches!(refused, Err(DesignError::PhaseMargin(_))));
        }
    }
}
