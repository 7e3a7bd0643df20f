//! Controller design for one model, or for draws from a posterior.
//!
//! In the styles sharp, balanced and calm a design has the least IAE within limits of `Ms`, `Mt`, margins and noise; over
//! draws it keeps the limits on most of them and has the least mean IAE. The rest of this page is about
//! [`Style::Paper`].
//!
//! [`design()`] takes one model and returns the controller of least cost that keeps the specified phase margin.
//! [`design_over()`] takes draws from a posterior and returns the controller of least expected loss:
//!
//! ```text
//! choose C to minimise   mean_i min(|J(C, i) / J*_i - 1|, 1),    i drawn from the posterior
//! ```
//!
//! | symbol | meaning | unit |
//! |--------|---------|------|
//! | `J(C, i)` | cost of the controller `C` on draw `i`: ISE of a unit step | output unit^2 s |
//! | `J*_i` | least cost on draw `i` at the specified phase margin | output unit^2 s |
//!
//! A controller that costs less than `J*_i` leaves less phase margin on draw `i`, so a lower cost is a loss too. An
//! unstable loop has no finite cost. One unstable draw would dominate the mean, so the loss of a draw is capped at 1,
//! which stands for a doubled cost: about 100 times the usual loss through identification.
//!
//! The candidates are the optima of the draws: each of them keeps the specified margin on a likely process. An
//! unconstrained search over both gains finds controllers of the same expected loss with a third of the margin.

mod comparison;
mod missed;
pub(crate) mod named;
mod outcome;
mod proposal;
mod specification;

use crate::closed_loop::{ise, margins};
use crate::controller::{Controller, Form};
use crate::model::Model;
use crate::soiptd_pd;

pub use comparison::{Comparison, Effect, FELT, Felt};
pub use missed::{Limit, Missed, reference_filter_s};
pub use outcome::{Design, DesignError, Robustness};
pub use proposal::{
    Assessment, LeastMargins, Proposal, Responses, assess, assess_and_simulate, forms,
    least_margins, proposals,
};
pub use specification::{MeasurementNoise, Specification, Style};

/// Number of draws that [`design_over`] needs. If the loss varies as much as its mean, the mean of 96 draws has a
/// relative standard error of `1/sqrt(96)`, a tenth.
pub const DRAWS: usize = 96;

/// Controller of least cost among those that meet `specification` on `model`.
///
/// The cost is the IAE of a unit step of the load, for a form without integral term that of a unit step of the reference,
/// and for [`Style::Paper`] the ISE of a unit step of the reference. With a
/// [set-point weight](Specification::setpoint_weight) that is fixed the gains of a PI or PID also keep the overshoot.
///
/// # Errors
/// - [`DesignError::PhaseMargin`], [`DesignError::Setting`]: a value of the specification is out of range.
/// - [`DesignError::Structure`]: the paper's method does not cover this structure or form.
/// - [`DesignError::Overflow`]: the parameters of the model are near the limits of `f64`.
/// - [`DesignError::UnstableProcess`], [`DesignError::NoIntegral`], [`DesignError::NoRate`], [`DesignError::Unbounded`]:
///   the form does not fit the process.
/// - [`DesignError::Infeasible`]: no controller of this form keeps the limits.
pub fn design(model: &Model, specification: &Specification) -> Result<Design, DesignError> {
    if specification.style != Style::Paper {
        return named::design(model, specification);
    }
    let (Model::Soiptd(process), Form::Pd) = (model, specification.form) else {
        return Err(DesignError::Structure(model.structure()));
    };
    let best = soiptd_pd::pd(process, specification.phase_margin_rad)?;
    Ok(Design {
        controller: best.pd.into(),
        ise: best.ise,
        margins: best.margins,
        robustness: None,
    })
}

/// Controller of least expected loss over `draws`, with its cost and margins on `model`, the most probable model.
///
/// Without draws the result is that of [`design()`] for `model`. For the loss in the paper's style see the
/// [module](self): [`DRAWS`] draws are enough. In the other styles the loss is the mean cost over the first 12 draws, and
/// the limits hold on the specified share of the posterior with a probability of 93 %, for which 200 draws are enough.
///
/// # Errors
/// The errors of [`design()`] for `model`. In the paper's style a draw for which [`design()`] fails is left out; in the
/// others an unstable draw counts as one that misses the limits.
pub fn design_over(
    model: &Model,
    draws: &[Model],
    specification: &Specification,
) -> Result<Design, DesignError> {
    if specification.style != Style::Paper {
        return named::design_over(model, draws, specification);
    }
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

/// Mean loss of `controller` over models with their optima. For the loss see the [module](self).
fn expected_loss(controller: &Controller, optima: &[(Model, Design)]) -> f64 {
    let loss = |(model, optimum): &(Model, Design)| {
        ise(model, controller).map_or(1.0, |cost| (cost / optimum.ise - 1.0).abs().min(1.0))
    };
    optima.iter().map(loss).sum::<f64>() / optima.len().max(1) as f64
}

/// Cost and margins of a controller on a model. `None` if the loop is unstable.
fn on(model: &Model, controller: Controller) -> Option<Design> {
    Some(Design {
        controller,
        ise: ise(model, &controller)?,
        margins: margins(model, &controller)?,
        robustness: None,
    })
}

#[cfg(test)]
mod tests {
    use onecycle_onboard::Soiptd;

    use super::*;

    fn specification() -> Specification {
        Specification::paper().with_phase_margin_rad(0.35)
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

    // Two processes differ by 10 % in gain; the stronger one is drawn three times as often. The expected loss, a sum of
    // absolute values, is then least at the optimum of the stronger one, although `model` is the weaker one.
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

    // Half of the probability is on a process of three times the gain, on which the optimum of the weak process is
    // unstable, a loss of 1. The optimum of the strong process is stable on both.
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
