//! Identification from a steady relay oscillation, with the estimator of the board.
//!
//! Structure: an integrator with two lags and dead time. Excitation: a two-level relay.
//!
//! ```text
//! 1. find the relay in the input                                        input
//! 2. find steady runs of cycles, list the stretches to try              oscillation
//!    for each stretch, until one is identified:
//! 3.     average its samples into the bins of a window                  oscillation
//! 4.     read its last cycle with the network of the pack               last_cycle
//! 5.     refuse it if the output is clipped                             saturation
//! 6.     fit the process to the window by variable projection           onecycle_onboard::refine
//! 7.     refuse it if the residual or the model error is too large      judge
//! 8.     draw from the posterior, design the controller                 design
//! 9. list what limits the result                                        remarks
//! ```

mod input;
mod last_cycle;
pub(crate) mod law;
mod oscillation;
mod saturation;

use std::f64::consts::TAU;

use onecycle_design::{DesignError, Model, Proposal, Specification, Style, step_response};
use onecycle_onboard::judgement::{MOST_MISFIT, largest_response_error, misfit};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::refine::{PriorKnowledge, RefineError, Refined, ShapePrior, refine_with};

use self::input::{RelayInput, find_relay};
pub(crate) use self::law::sign_of_gain;
use self::oscillation::{FitWindow, Past, Stretch};
use crate::assumed::RecordedLoop;
use crate::excitation::{Excitation, Oscillation};
use crate::innovations::Hold;
use crate::outcome::{Evidence, Fit, Identification, Identified, Refused};
use crate::posterior::Posterior;
use crate::reading::Reading;
use crate::remark::Remark;
use crate::remarks;
use crate::settings::{MOST_CYCLES, Method, Options};
use crate::signals::Signals;
use crate::thresholds::{MOST_ERROR_OF_SECOND_CHOICE, MOST_TENSION};
use crate::verdict::Verdict;

/// Identifies the process from a recorded relay test. For `pack` see [`identify_by`](crate::identify_by).
pub(crate) fn identify(
    signals: &Signals<'_>,
    (options, cycles): (&Options, usize),
    pack: Option<&Pack<'_>>,
) -> Identification {
    let pack = pack.filter(|_| options.method != Method::Refine);
    let mut search = Search {
        signals,
        pack,
        options,
        cycles,
        excitation: None,
        refusal: None,
        refused: None,
        tension: None,
        no_controller: None,
    };
    let outcome = search.run();
    let mut found = Identification {
        excitation: search.excitation,
        refused: search.refused.filter(|_| outcome.is_err()),
        outcome,
        steady: None,
        switching: None,
        amplitudes: None,
        remarks: vec![],
    };
    if let (Ok(_), Some(Verdict::NotThisProcess { misfit })) = (&found.outcome, &search.refusal) {
        found.remarks.push(Remark::Disturbed(*misfit));
    }
    if let (Ok(_), Some(tension)) = (&found.outcome, search.tension) {
        found.remarks.push(Remark::PriorDropped(tension));
    }
    if let (Ok(_), Some(error)) = (&found.outcome, search.no_controller) {
        found.remarks.push(Remark::NoController(error));
    }
    let remarks = remarks::remarks(&found, pack.is_some(), cycles);
    found.remarks.extend(remarks);
    found
}

/// Steady oscillation in a recording: the first stretch that an identification tries, with at most `cycles` cycles.
///
/// # Errors
/// The verdict of an identification for a recording without a relay or without a steady oscillation.
pub fn find_oscillation(signals: &Signals<'_>, cycles: usize) -> Result<Oscillation, Verdict> {
    first(signals, cycles, |_| Ok(()))
}

/// Steady oscillation of a relay that the sensor could follow.
///
/// # Errors
/// The verdict of an identification from cycles.
pub(crate) fn steady(signals: &Signals<'_>) -> Result<Oscillation, Verdict> {
    first(signals, MOST_CYCLES, |first| {
        let output = &signals.output[first.points(signals)];
        let flat = saturation::flat_part(output, first.cycles.len());
        flat.map_or(Ok(()), |part| Err(Verdict::Saturated { part }))
    })
}

/// The first stretch with at most `cycles` cycles, described if `check` has nothing against it.
fn first(
    signals: &Signals<'_>,
    cycles: usize,
    check: impl FnOnce(&Stretch) -> Result<(), Verdict>,
) -> Result<Oscillation, Verdict> {
    let relay = find_relay(signals)?;
    let stretches = oscillation::stretches(signals, &relay, cycles.clamp(1, MOST_CYCLES))?;
    let first = stretches.first().ok_or(Verdict::TooShort { cycles: 0 })?;
    check(first)?;
    let window = first.window(signals, &relay, Past::Held);
    Ok(first.describe(signals, &relay, &window))
}

/// Search for a stretch of the recording from which the process can be identified.
struct Search<'a> {
    signals: &'a Signals<'a>,
    pack: Option<&'a Pack<'a>>,
    options: &'a Options,
    /// Most cycles to fit.
    cycles: usize,
    /// Excitation of the accepted stretch. If none is accepted, that of the first stretch.
    excitation: Option<Excitation>,
    /// Verdict on the first stretch, if that was refused.
    refusal: Option<Verdict>,
    /// Fit to the first stretch, if that was refused.
    refused: Option<Refused>,
    /// Misfit of the prior in the last fit, if that was dropped.
    tension: Option<f64>,
    /// Why the identified process has no controller.
    no_controller: Option<DesignError>,
}

impl Search<'_> {
    /// The main loop: steps 1 to 8 of the [module](self).
    fn run(&mut self) -> Result<Identified, Verdict> {
        let relay = find_relay(self.signals)?;
        for stretch in oscillation::stretches(self.signals, &relay, self.cycles)? {
            let (window, last_cycle) = self.observe(&stretch, &relay);
            let oscillation = stretch.describe(self.signals, &relay, &window);
            let excitation = Excitation::Relay {
                oscillation,
                last_cycle,
            };
            match self.identify_stretch(&stretch, &window, (&oscillation, last_cycle.as_ref())) {
                Ok(identified) => {
                    self.excitation = Some(excitation);
                    return Ok(identified);
                }
                Err(verdict) => {
                    self.keep_first(excitation);
                    self.refusal.get_or_insert(verdict);
                }
            }
        }
        Err(self.refusal.clone().unwrap_or(Verdict::NoFit))
    }

    /// Window of a stretch, and the reading of its last cycle (steps 3 and 4).
    ///
    /// If the recording has one complete cycle and the pack knows it as a cycle of a steady oscillation, the input
    /// before the recording is assumed to be periodic. On 200 multirotors with 1 % noise this lowers the excess cost of
    /// the controllers from 0.40 % to 0.17 %.
    fn observe(&self, stretch: &Stretch, relay: &RelayInput) -> (FitWindow, Option<Reading>) {
        let window = stretch.window(self.signals, relay, Past::Held);
        let reading = (self.pack)
            .and_then(|pack| last_cycle::read(self.signals, relay, stretch, &window, pack));
        let is_known = reading.as_ref().is_some_and(Reading::is_known);
        if stretch.is_alone() && is_known {
            (stretch.window(self.signals, relay, Past::Repeated), reading)
        } else {
            (window, reading)
        }
    }

    /// Process and controller from one stretch (steps 5 to 8).
    fn identify_stretch(
        &mut self,
        stretch: &Stretch,
        window: &FitWindow,
        (oscillation, reading): (&Oscillation, Option<&Reading>),
    ) -> Result<Identified, Verdict> {
        let output = &self.signals.output[stretch.points(self.signals)];
        if let Some(part) = saturation::flat_part(output, stretch.cycles.len()) {
            return Err(Verdict::Saturated { part });
        }
        let refined = match self.options.method {
            Method::Classify => classified(window, reading)?,
            Method::Refine | Method::Map => self.fit(stretch.period_s, window, reading)?,
        };
        let fit = Fit {
            misfit: misfit(&refined, window),
            evidence: Evidence::Relay(refined),
            points: oscillation::fit_points(window, stretch.period_s, &refined),
        };
        let recorded = RecordedLoop {
            sigma: refined.noise_sigma,
            output_size: oscillation.amplitude,
            input_amplitude: oscillation.relay_amplitude,
            sample_s: window.sample_s(),
            hold: Hold::Held,
            excited_rad_per_s: Some(TAU / oscillation.period_s),
            filter: None,
        };
        let specification = recorded.complete(&self.options.specification);
        let judged = self.judge(&refined, fit.misfit);
        let designed =
            judged.and_then(|()| design(fit.clone(), &refined, window.sample_s(), &specification));
        match designed {
            Ok((identified, refusal)) => {
                self.no_controller = refusal;
                Ok(identified)
            }
            Err(verdict) => {
                let model = Model::from(refined.process);
                if self.refusal.is_none() {
                    self.refused = Some(Refused { model, fit });
                }
                Err(verdict)
            }
        }
    }

    /// Least squares from the starts that the reading suggests. With the prior of the pack this is the most probable
    /// process. A reading that no process of the pack's family explains is ignored, and so is a prior that the window
    /// contradicts.
    fn fit(
        &mut self,
        period_s: f64,
        window: &FitWindow,
        reading: Option<&Reading>,
    ) -> Result<Refined, Verdict> {
        let known = reading.filter(|reading| reading.is_known());
        let starts = known.map(|reading| reading.classification.starts(period_s));
        let starts: &[_] = starts.as_ref().map_or(&[], |starts| starts);
        let prior = (self.pack)
            .filter(|_| known.is_some())
            .and_then(ShapePrior::of_pack);
        let fit = |prior| {
            let beforehand = PriorKnowledge {
                starts,
                prior,
                may_walk: false,
            };
            refine_with(window, period_s, &beforehand)
        };
        let refined = fit(prior).map_err(|error| match error {
            RefineError::TooFewBins(points) => Verdict::TooCoarse { points },
            _ => Verdict::NoFit,
        })?;
        self.tension = None;
        if prior.is_some()
            && let Ok(free) = fit(None)
        {
            let tension = tension(&refined, &free, window.bins().len());
            if tension > MOST_TENSION {
                self.tension = Some(tension);
                return Ok(free);
            }
        }
        Ok(refined)
    }

    /// Whether a fit with this misfit is acceptable.
    fn judge(&self, refined: &Refined, misfit: f64) -> Result<(), Verdict> {
        let specification = &self.options.specification;
        specification.check().map_err(Verdict::NoController)?;
        // No style of controller turns a refusal into an answer.
        let margin_rad = specification
            .implied_phase_margin_rad()
            .min(Specification::paper().phase_margin_rad);
        let most_error = match self.refusal {
            None => largest_response_error(margin_rad),
            Some(_) => MOST_ERROR_OF_SECOND_CHOICE,
        };
        if misfit > MOST_MISFIT || refined.response_error > most_error {
            return Err(Verdict::NotThisProcess { misfit });
        }
        refined
            .edge
            .map_or(Ok(()), |edge| Err(Verdict::EdgeOfDomain(edge)))
    }

    /// Keeps the first excitation, and the first reading of a last cycle.
    fn keep_first(&mut self, excitation: Excitation) {
        let Excitation::Relay { last_cycle, .. } = excitation else {
            return;
        };
        if let Excitation::Relay {
            last_cycle: kept, ..
        } = self.excitation.get_or_insert(excitation)
        {
            *kept = kept.or(last_cycle);
        }
    }
}

/// Growth of the sum of squares of `bins` residuals from the free fit to the one with a prior, over the variance of the
/// free one.
fn tension(with_prior: &Refined, free: &Refined, bins: usize) -> f64 {
    let ratio = with_prior.residual_rms / free.residual_rms;
    bins as f64 * (ratio * ratio - 1.0)
}

/// The reading of the last cycle as a fit.
fn classified(window: &FitWindow, reading: Option<&Reading>) -> Result<Refined, Verdict> {
    match reading {
        Some(reading) if reading.is_known() => reading.as_fit(window).map_err(|_| Verdict::NoFit),
        _ => Err(Verdict::Unknown {
            score: reading.map(|reading| reading.classification.score),
        }),
    }
}

/// Posterior of an accepted fit to samples every `sample_s`, with controller, margins and step response. The second value
/// is the error of the design if it failed.
///
/// # Errors
/// The controller may be unstable on a process within the intervals, or the paper's style gives none.
fn design(
    fit: Fit,
    refined: &Refined,
    sample_s: f64,
    specification: &Specification,
) -> Result<(Identified, Option<DesignError>), Verdict> {
    let model = Model::from(refined.process);
    let posterior = Posterior::new(refined, sample_s);
    let has_model_error = refined.response_error > 0.0;
    // A model error widens the intervals, but its distribution is not known. So the controller is not optimised over
    // draws.
    let draws = if has_model_error {
        vec![]
    } else {
        posterior.models(specification.draws())
    };
    let outcome = Proposal::new(&model, &draws, specification).outcome;
    let (design, refusal) = match outcome {
        Ok(design) => (Some(design), None),
        Err(error) if specification.style == Style::Paper => {
            return Err(Verdict::NoController(error));
        }
        Err(error) => (None, Some(error)),
    };
    let phase_margin_rad = design.map(|design| posterior.phase_margin_rad(&design.controller));
    if !posterior.is_narrow_enough(&model, &draws, (specification, phase_margin_rad)) {
        return Err(if has_model_error {
            Verdict::NotThisProcess { misfit: fit.misfit }
        } else {
            Verdict::TooUncertain
        });
    }
    let estimate = posterior.estimate();
    let identified = Identified {
        joint_probability: posterior.joint_probability(&estimate),
        step: design
            .and_then(|design| step_response(&model, &design.controller).ok())
            .map(|step| step.metrics),
        model,
        estimate,
        posterior,
        specification: *specification,
        design,
        phase_margin_rad,
        resonance: None,
        fit,
    };
    Ok((identified, refusal))
}
