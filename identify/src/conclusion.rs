//! From a posterior to a result: controller, margins, and the refusals for want of information.

use onecycle_design::{Model, Parameter, Proposal, Specification, step_response};

use crate::innovations::gain_of;
use crate::outcome::{Fit, Identified};
use crate::posterior::Posterior;
use crate::remark::Remark;
use crate::thresholds::MOST_WIDTH;
use crate::verdict::Verdict;

/// That half width in standard deviations of a normal distribution.
const HALF_WIDTH: f64 = 1.645;

/// The result of a model with its posterior, for a specification.
///
/// `no_information` makes the verdict of a gain with this relative standard deviation, and `fit` the quality of the fit
/// (`None` if it has none).
pub(crate) fn conclude(
    (model, posterior): (Model, Posterior),
    specification: Specification,
    remarks: &mut Vec<Remark>,
    no_information: impl FnOnce(Option<f64>) -> Verdict,
    fit: impl FnOnce() -> Option<Fit>,
) -> Result<Identified, Verdict> {
    let draws = posterior.models(specification.draws());
    let undamped = model.soiptd().map_or(model, Model::Soiptd);
    let proposed = Proposal::new(&undamped, &draws, &specification).outcome;
    let design = proposed.ok();
    let phase_margin_rad = design.map(|design| posterior.phase_margin_rad(&design.controller));
    if !posterior.is_narrow_enough(&undamped, &draws, (&specification, phase_margin_rad)) {
        return Err(Verdict::TooUncertain);
    }
    let estimate = posterior.estimate();
    // What the input does in the end, or what it does at first: the controller is robust over the other. A body that is faster than a
    // sample has no acceleration that the samples show.
    let width_of = |gain| (estimate.get(gain))?.relative_half_width();
    let widths = [gain_of(model.structure()), Parameter::K]
        .into_iter()
        .filter_map(width_of);
    let width = widths.min_by(f64::total_cmp);
    if width.is_none_or(|width| width > MOST_WIDTH) {
        return Err(no_information(width.map(|width| width / HALF_WIDTH)));
    }
    let fit = fit().ok_or(Verdict::NoFit)?;
    remarks.extend(proposed.err().map(Remark::NoController));
    Ok(Identified {
        joint_probability: posterior.joint_probability(&estimate),
        step: design
            .and_then(|design| step_response(&undamped, &design.controller).ok())
            .map(|step| step.metrics),
        model,
        estimate,
        posterior,
        specification,
        design,
        phase_margin_rad,
        resonance: None,
        fit,
    })
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Form, Linear, Structure, Style};

    use super::*;

    // A PD cannot hold a self-regulating process, and the gain may be anything from 0.1 to 2: the refusal stands alone, without a
    // remark on the model that was refused.
    #[test]
    fn a_refused_model_has_no_remark_on_its_controller() {
        let process = |gain: f64| {
            let lag = Linear::new(Structure::Foptd).with_pole_per_s(1.0);
            lag.with_gain(gain).with_tau_s(0.1)
        };
        let draws: Vec<Linear> = (1..=40).map(|k| process(0.05 * f64::from(k))).collect();
        let posterior = Posterior::of_draws(&process(1.0), &draws);
        let asked = Specification::new(Form::Pd, Style::Balanced);
        let mut remarks = vec![];
        let found = conclude(
            (process(1.0).into(), posterior),
            asked,
            &mut remarks,
            |_| Verdict::TooUncertain,
            || None,
        );
        assert_eq!(found.err(), Some(Verdict::TooUncertain));
        assert_eq!(remarks, []);
    }

    // A lag of 1 to 3 s, of which either the gain at rest or the first slope is the same: a PI holds all of them. If both are unknown,
    // the gain is not told. The fit, which is asked for last, is left out.
    #[test]
    fn either_gain_is_enough() {
        let outcome = |gains: &dyn Fn(f64, f64) -> f64| {
            let process = |k: i32| {
                let (lag_s, own) = (1.0 + f64::from(k) / 20.0, f64::from(k % 8));
                let lag = Linear::new(Structure::Foptd).with_pole_per_s(1.0 / lag_s);
                lag.with_gain(gains(lag_s, own)).with_tau_s(0.1)
            };
            let draws: Vec<Linear> = (1..=40).map(process).collect();
            let posterior = Posterior::of_draws(&process(20), &draws);
            let asked = Specification::new(Form::Pi, Style::Calm);
            let told = (process(20).into(), posterior);
            conclude(
                told,
                asked,
                &mut vec![],
                |_| Verdict::ConstantInput,
                || None,
            )
            .err()
        };
        assert_eq!(outcome(&|lag_s, _| 2.0 / lag_s), Some(Verdict::NoFit));
        assert_eq!(outcome(&|_, _| 2.0), Some(Verdict::NoFit));
        assert_eq!(outcome(&|_, own| 0.5 + own), Some(Verdict::ConstantInput));
    }
}
