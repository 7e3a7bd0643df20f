//! Controllers to choose from: one in each style, and the figures by which any controller is judged.

use crate::bands::quantiles;
use crate::closed_loop::{
    LoadResponse, load_response, margins, noise_amplification, sensitivity, step_response,
};
use crate::controller::{Controller, Form};
use crate::model::{Model, Structure};
use crate::soiptd_pd::margins::Margins;
use crate::soiptd_pd::step_metrics::StepMetrics;
use crate::soiptd_pd::step_response::StepResponse;

use super::design_over;
use super::named::DesignOver;
use super::outcome::{Design, DesignError};
use super::specification::{MeasurementNoise, Specification, Style};

/// A specification and what its design gave.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Proposal {
    /// What was asked for.
    pub specification: Specification,
    /// The designed controller, or the error that prevented a design.
    pub outcome: Result<Design, DesignError>,
}

impl Proposal {
    /// Designs for `model` and draws from its posterior: see [`design_over()`]. Draws beyond
    /// [`Specification::draws`] are not used.
    #[must_use]
    pub fn new(model: &Model, draws: &[Model], specification: &Specification) -> Self {
        let draws = &draws[..draws.len().min(specification.draws())];
        Self {
            specification: *specification,
            outcome: design_over(model, draws, specification),
        }
    }

    /// A design that was made before.
    #[must_use]
    pub fn of(specification: Specification, outcome: Result<Design, DesignError>) -> Self {
        Self {
            specification,
            outcome,
        }
    }

    /// The specifications to choose from for a process of this structure: `asked` in each style, in the order of
    /// [`Style::ALL`]. The paper's style is left out where its method does not apply.
    #[must_use]
    pub fn choices(structure: Structure, asked: &Specification) -> Vec<Specification> {
        let applies = |style: &Style| *style != Style::Paper || structure == Structure::Soiptd;
        (Style::ALL.into_iter())
            .filter(applies)
            .map(|style| asked.in_style(style))
            .collect()
    }
}

/// Controllers for `model` and draws from its posterior, one for each of [`Proposal::choices`]. `made` is the design for
/// `asked`, if there is one already. The styles share most of the work: with draws three cost about as much as one and a
/// half. Draws beyond [`Specification::draws`] are not used.
#[must_use]
pub fn proposals(
    model: &Model,
    draws: &[Model],
    asked: &Specification,
    made: Option<&Design>,
) -> Vec<Proposal> {
    let choices = Proposal::choices(model.structure(), asked);
    let mut named: Vec<&Specification> = (choices.iter())
        .filter(|choice| choice.style != Style::Paper)
        .collect();
    // From the calmest to the sharpest: what keeps the lower limits is near what keeps the higher ones.
    named.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let first = named
        .first()
        .map(|first| &draws[..draws.len().min(first.draws())]);
    let mut over =
        (named.first().zip(first)).map(|(first, draws)| DesignOver::new(model, draws, first));
    let mut designed: Vec<Proposal> = Vec::with_capacity(choices.len());
    for choice in named {
        let outcome = match (made, &mut over) {
            (Some(made), _) if choice == asked => Ok(*made),
            (_, Some(Ok(over))) => over.design(choice),
            (_, Some(Err(error))) => Err(*error),
            (_, None) => continue,
        };
        designed.push(Proposal::of(*choice, outcome));
    }
    let proposal = |choice: &Specification| {
        let found = designed.iter().find(|found| found.specification == *choice);
        found.copied().unwrap_or_else(|| match made {
            Some(made) if choice == asked => Proposal::of(*choice, Ok(*made)),
            _ => Proposal::new(model, draws, choice),
        })
    };
    choices.iter().map(proposal).collect()
}

/// Figures of a controller on a model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Assessment {
    /// Stability margins.
    pub margins: Margins,
    /// Maximum sensitivity (1).
    pub ms: f64,
    /// Maximum complementary sensitivity (1).
    pub mt: f64,
    /// Response to a unit step of the reference. `None` if it is too slow to simulate.
    pub step: Option<StepMetrics>,
    /// IAE of a unit step of the load (output unit s). Infinite without an integral term, `None` if too slow to simulate.
    pub load_iae: Option<f64>,
    /// Largest output after a unit step of the load (output unit). `None` if too slow to simulate.
    pub load_peak: Option<f64>,
    /// Standard deviation of the noise at the actuator, as a share of the input amplitude. `None` without noise.
    pub noise_share: Option<f64>,
}

/// Figures of `controller` on `model`, with the share of `noise` that reaches the actuator. `None` if the loop is
/// unstable, or the gain has the wrong sign.
#[must_use]
pub fn assess(
    model: &Model,
    controller: &Controller,
    noise: Option<&MeasurementNoise>,
) -> Option<Assessment> {
    assess_and_simulate(model, controller, noise).map(|(figures, _)| figures)
}

/// Responses to unit steps of the reference and of the load; `None` if they are too slow to simulate.
pub type Responses = (Option<StepResponse>, Option<LoadResponse>);

/// As [`assess`], with the responses that the figures are of.
#[must_use]
pub fn assess_and_simulate(
    model: &Model,
    controller: &Controller,
    noise: Option<&MeasurementNoise>,
) -> Option<(Assessment, Responses)> {
    let peaks = sensitivity(model, controller)?;
    let load = load_response(model, controller).ok();
    let share = |noise: &MeasurementNoise| {
        let amplification = noise_amplification(model, controller, noise.sample_period_s)?;
        Some(amplification * noise.std / noise.input_amplitude)
    };
    let margins = margins(model, controller)?;
    let step = step_response(model, controller).ok();
    let figures = Assessment {
        margins,
        ms: peaks.ms,
        mt: peaks.mt,
        step: step.as_ref().map(|step| step.metrics),
        load_iae: load.as_ref().map(|load| load.iae),
        load_peak: load.as_ref().map(|load| load.peak),
        noise_share: noise.and_then(share),
    };
    Some((figures, (step, load)))
}

/// Margins of a controller over draws from a posterior, each at the bad end of its central 90 % interval. An unstable draw
/// counts as one without margins.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LeastMargins {
    /// Share of the draws on which the loop is stable.
    pub stable: f64,
    /// Phase margin (rad).
    pub phase_margin_rad: f64,
    /// Gain margin (1). Infinite if nothing limits the gain.
    pub gain_margin: f64,
    /// Delay margin (s).
    pub delay_margin_s: f64,
    /// Maximum sensitivity (1). Infinite if the loop is unstable there.
    pub ms: f64,
}

/// Margins of `controller` over `draws`. `None` if there are no draws.
#[must_use]
pub fn least_margins(draws: &[Model], controller: &Controller) -> Option<LeastMargins> {
    let loops: Vec<Option<(Margins, f64)>> = (draws.iter())
        .map(|draw| {
            let peaks = sensitivity(draw, controller)?;
            Some((margins(draw, controller)?, peaks.ms))
        })
        .collect();
    let low = |value: &dyn Fn(&Margins) -> f64| {
        let of = |found: &Option<(Margins, f64)>| found.as_ref().map_or(0.0, |(m, _)| value(m));
        quantiles(loops.iter().map(of).collect()).map(|(low, _)| low)
    };
    let peaks = loops
        .iter()
        .map(|found| found.map_or(f64::INFINITY, |(_, ms)| ms));
    let stable = loops.iter().filter(|found| found.is_some()).count();
    Some(LeastMargins {
        stable: stable as f64 / draws.len() as f64,
        phase_margin_rad: low(&|margins| margins.phase_margin_rad)?,
        gain_margin: low(&|margins| margins.gain_margin.unwrap_or(f64::INFINITY))?,
        delay_margin_s: low(&|margins| margins.delay_margin_s)?,
        ms: quantiles(peaks.collect())?.1,
    })
}

/// Forms that a process of this structure can use in the named styles, in the order of [`Form::ALL`].
#[must_use]
pub fn forms(structure: Structure) -> Vec<Form> {
    let stages = structure.stages();
    let is_usable = |form: &Form| match form {
        Form::P | Form::Pd => stages.integrators > 0,
        Form::CascadePi | Form::CascadePid => {
            stages.integrators > 0 && structure != Structure::Iptd
        }
        _ => true,
    };
    Form::ALL.into_iter().filter(is_usable).collect()
}

#[cfg(test)]
mod tests {
    use onecycle_onboard::{Pd, Soiptd};

    use super::*;
    use crate::closed_loop::load_iae;
    use crate::controller::Pid;

    fn model() -> Model {
        Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap().into()
    }

    // The paper's style designs for an integrator with two lags only.
    #[test]
    fn a_structure_has_its_choices() {
        let styles = |structure| -> Vec<Style> {
            let choices = Proposal::choices(structure, &Specification::default());
            choices.iter().map(|choice| choice.style).collect()
        };
        assert_eq!(styles(Structure::Soiptd), Style::ALL);
        assert_eq!(styles(Structure::Foptd), Style::ALL[1..]);
        assert_eq!(forms(Structure::Foptd), [Form::Pi, Form::Pid]);
        assert_eq!(forms(Structure::Soiptd), Form::ALL);
    }

    // Sharp rejects a load better than balanced, and balanced better than calm, at the Ms of the style.
    #[test]
    fn styles_trade_robustness_for_cost() {
        let model = model();
        let found = proposals(&model, &[], &Specification::default(), None);
        let figures: Vec<Assessment> = (found.iter())
            .map(|proposal| assess(&model, &proposal.outcome.unwrap().controller, None).unwrap())
            .collect();
        assert!(figures[0].margins.phase_margin_rad.to_degrees() - 20.0 < 1e-6);
        assert_eq!(figures[0].load_iae, Some(f64::INFINITY));
        for (style, pair) in Style::ALL[1..].iter().zip(figures[1..].windows(2)) {
            assert!(pair[0].load_iae < pair[1].load_iae);
            assert!(pair[0].ms <= style.peak() * (1.0 + 1e-6));
        }
    }

    // The noise of a P controller that hardly closes the loop is Kp times the noise: 0.001 * 0.2/0.5 of the amplitude.
    #[test]
    fn figures_of_a_weak_controller() {
        let noise = MeasurementNoise::new(0.2, 1e-3, 0.5);
        let weak = Controller::from(Pid::new(1e-3, 0.0, 0.0));
        let found = assess(&model(), &weak, Some(&noise)).unwrap();
        assert!((found.noise_share.unwrap() / 4e-4 - 1.0).abs() < 1e-2);
        assert_eq!(
            assess(&model(), &Controller::from(Pid::new(-1.0, 0.0, 0.0)), None),
            None
        );
        let pid = Controller::from(Pid::new(26.7, 32.3, 10.7));
        let found = assess(&model(), &pid, None).unwrap();
        assert_eq!(
            (found.load_iae, found.noise_share),
            (load_iae(&model(), &pid), None)
        );
    }

    // 19 equal draws and one of 9 times the gain, on which the loop is unstable: 5 % of the draws, so the bad end of the
    // central 90 % still is the stable one. With two of them it is not.
    #[test]
    fn unstable_draws_are_without_margins() {
        let (stable, unstable) = (
            model(),
            Soiptd::new(9.0, 0.0321, 1.6886, 0.0237).unwrap().into(),
        );
        let pd = Controller::from(Pd {
            kp: 192.9,
            kd: 29.5,
        });
        let mut draws = vec![stable; 19];
        draws.push(unstable);
        let own = margins(&stable, &pd).unwrap();
        let found = least_margins(&draws, &pd).unwrap();
        assert_eq!(
            (found.stable, found.phase_margin_rad),
            (0.95, own.phase_margin_rad)
        );
        assert_eq!(Some(found.gain_margin), own.gain_margin);
        draws[0] = unstable;
        let found = least_margins(&draws, &pd).unwrap();
        assert_eq!((found.phase_margin_rad, found.ms), (0.0, f64::INFINITY));
        assert_eq!(least_margins(&[], &pd), None);
    }
}
