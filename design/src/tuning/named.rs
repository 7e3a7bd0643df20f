//! Design in the named styles: from model and specification to the problem in the units of the process, and back.

use crate::analysis::evaluation::Loop;
use crate::analysis::process::Process;
use crate::controller::{Controller, Form};
use crate::model::Model;
use crate::synthesis::limits::Limits;
use crate::synthesis::objective::{FixedWeight, NoiseLimit, Objective, Problem};
use crate::synthesis::optimum::{Effort, FINE_GRID, NoOptimum, Optimum, optimum, optimum_near};
use crate::synthesis::polish::polish;
use crate::synthesis::robust::Draws;
use crate::synthesis::setpoint;
use crate::synthesis::shape::{Family, Filter};

use super::outcome::{Design, DesignError, Robustness};
use super::specification::Specification;

/// Without noise figure the filter time is this share of the dead time that the half rule leaves: the filter then costs
/// a few percent of the IAE.
const FILTER_SHARE: f64 = 0.05;

/// Largest limit of `Ms` and `Mt` that is offered where the specified one cannot be kept.
const LARGEST_PEAK: f64 = 10.0;

/// The least limit is searched upwards in steps of this factor, squared each time, and bisected to the second one.
const FIRST_STEP: f64 = 1.05;
const LEAST_STEP: f64 = 5e-3;

/// A designed loop exceeds its limits by rounding at most.
const ROUNDING: f64 = 1e-6;

/// See [`super::design`].
pub(super) fn design(model: &Model, specification: &Specification) -> Result<Design, DesignError> {
    let problem = problem(model, specification)?;
    match optimum(problem, Effort::Full) {
        Ok(best) if is_smooth(specification, &problem) => {
            let best = polish(&mut Objective::new(problem, FINE_GRID), &best);
            checked(model, specification, &problem, &best)
        }
        Ok(best) => checked(model, specification, &problem, &best),
        Err(reason) => Err(refusal(problem, specification, reason)),
    }
}

/// Whether the search continues to six digits: neither noise nor overshoot limits the gains.
fn is_smooth(specification: &Specification, problem: &Problem) -> bool {
    specification.refined && problem.noise.is_none() && problem.fixed_weight.is_none()
}

/// See [`super::design_over`].
pub(super) fn design_over(
    model: &Model,
    draws: &[Model],
    specification: &Specification,
) -> Result<Design, DesignError> {
    let mut over = DesignOver::new(model, draws, specification)?;
    over.design(specification)
}

/// Designs for one model and the same draws, each from the one before: in order of rising limits that saves most of the
/// search.
pub(super) struct DesignOver<'a> {
    model: &'a Model,
    count: usize,
    set: Draws,
    /// Shapes of the last design: for the most probable model alone, and over the draws.
    last: Option<[Vec<f64>; 2]>,
}

impl<'a> DesignOver<'a> {
    /// The specifications of the designs may differ from this one in their limits only.
    pub(super) fn new(
        model: &'a Model,
        draws: &[Model],
        specification: &Specification,
    ) -> Result<Self, DesignError> {
        let problem = problem(model, specification)?;
        let processes: Vec<Process> = (draws.iter())
            .filter_map(|draw| Process::new(&draw.linear(), &specification.execution))
            .collect();
        Ok(Self {
            model,
            count: draws.len(),
            set: Draws::new(problem, &processes, draws.len(), specification.coverage),
            last: None,
        })
    }

    /// Controller of least mean cost over the draws; without draws, of least cost for the model.
    pub(super) fn design(&mut self, specification: &Specification) -> Result<Design, DesignError> {
        if self.count == 0 {
            return design(self.model, specification);
        }
        let problem = problem(self.model, specification)?;
        let last = self.last.as_ref();
        let nominal = match last {
            Some([nominal, _]) => optimum_near(problem, nominal),
            None => optimum(problem, Effort::Rough),
        };
        let nominal = match nominal {
            Ok(nominal) => nominal,
            Err(NoOptimum::Unbounded) => return Err(DesignError::Unbounded),
            Err(NoOptimum::Infeasible) => return Err(self.refusal(specification, problem, None)),
        };
        self.set.set_limits(problem.limits, problem.noise);
        let near = last.map(|[_, robust]| robust.as_slice());
        let Ok(best) = self.set.optimum(&nominal, near) else {
            return Err(self.refusal(specification, problem, Some(&nominal)));
        };
        let found = self.set.performance(&best, self.count);
        let alone = self.set.performance(&nominal, self.count);
        let mut designed = loop_of(self.model, specification, &problem, &best)?;
        // A cost after a step of the load is in the unit of the gain.
        let gain = if specification.form.has_integral() {
            problem.process.gain.abs()
        } else {
            1.0
        };
        let unit = gain * problem.process.unit_s;
        designed.robustness = Some(Robustness {
            coverage: found.coverage,
            mean_iae: found.mean_cost * unit,
            nominal_coverage: alone.coverage,
            nominal_mean_iae: alone.mean_cost * unit,
        });
        self.last = Some([nominal.z, best.z]);
        Ok(designed)
    }

    /// The refusal with the least limit that the draws allow, which is that of the model alone or more. `nominal` is the
    /// optimum of the model at the specified limits.
    fn refusal(
        &mut self,
        specification: &Specification,
        problem: Problem,
        nominal: Option<&Optimum>,
    ) -> DesignError {
        let asked = problem.limits.ms.max(problem.limits.mt);
        let start = match nominal {
            Some(nominal) => Some((asked, nominal.z.clone())),
            None => least_peak(asked, &mut |peak| {
                optimum(with_peak(problem, peak), Effort::Rough)
                    .ok()
                    .map(|found| found.z)
            }),
        };
        let least = start.and_then(|(from, mut shape)| {
            least_peak(from, &mut |peak| {
                self.set
                    .set_limits(with_peak(problem, peak).limits, problem.noise);
                (shape, _) = self.set.feasible(&shape, None)?;
                Some(shape.clone())
            })
        });
        DesignError::Infeasible {
            form: specification.form,
            least_peak: least.map(|(peak, _)| peak),
        }
    }
}

fn refusal(problem: Problem, specification: &Specification, reason: NoOptimum) -> DesignError {
    let asked = problem.limits.ms.max(problem.limits.mt);
    match reason {
        NoOptimum::Unbounded => DesignError::Unbounded,
        NoOptimum::Infeasible => DesignError::Infeasible {
            form: specification.form,
            least_peak: least_peak(asked, &mut |peak| {
                optimum(with_peak(problem, peak), Effort::Rough).ok()
            })
            .map(|(peak, _)| peak),
        },
    }
}

/// The problem with other limits of `Ms` and `Mt`.
pub(super) fn with_peak(problem: Problem, peak: f64) -> Problem {
    let limits = Limits {
        ms: peak,
        mt: peak,
        ..problem.limits
    };
    Problem { limits, ..problem }
}

/// Least limit of `Ms` and `Mt` from `from` on that is kept, with what keeps it. `None` if none up to 10 is.
pub(super) fn least_peak<T>(
    from: f64,
    kept: &mut impl FnMut(f64) -> Option<T>,
) -> Option<(f64, T)> {
    let mut low = from.min(LARGEST_PEAK);
    let mut step = FIRST_STEP;
    let mut best = loop {
        let peak = (low * step).min(LARGEST_PEAK);
        match kept(peak) {
            Some(found) => break (peak, found),
            None if peak == LARGEST_PEAK => return None,
            None => (low, step) = (peak, step * step),
        }
    };
    while best.0 > low * (1.0 + LEAST_STEP) {
        let middle = (low * best.0).sqrt();
        match kept(middle) {
            Some(found) => best = (middle, found),
            None => low = middle,
        }
    }
    Some(best)
}

/// The problem in the units of the process.
pub(crate) fn problem(
    model: &Model,
    specification: &Specification,
) -> Result<Problem, DesignError> {
    specification.check()?;
    let form = specification.form;
    let execution = &specification.execution;
    let process = Process::new(&model.linear(), execution).ok_or(DesignError::Overflow)?;
    let is_integrating = process.integrators() > 0;
    if process.unstable_poles() > usize::from(!is_integrating) {
        return Err(DesignError::UnstableProcess);
    }
    if !form.has_integral() && !is_integrating {
        return Err(DesignError::NoIntegral(form));
    }
    let is_cascade = matches!(form, Form::CascadePi | Form::CascadePid);
    if is_cascade && process.rate().is_none() {
        return Err(DesignError::NoRate(form));
    }
    let unit_s = process.unit_s;
    let usual = FILTER_SHARE * process.half_rule_dead_time(2);
    let filter = match (specification.filter_s, specification.noise, form) {
        (Some(filter_s), ..) => Filter::Fixed(filter_s / unit_s),
        (None, Some(_), _) => Filter::Searched(usual),
        (None, None, Form::P | Form::Pi) => Filter::Fixed(0.0),
        (None, None, _) if usual > 0.0 => Filter::Fixed(usual),
        (None, None, _) => return Err(DesignError::Unbounded),
    };
    let k = process.gain.abs();
    Ok(Problem {
        process,
        family: Family { form, filter },
        limits: Limits {
            ms: specification.ms,
            mt: specification.mt,
            phase_margin_rad: specification.phase_margin_rad,
            delay_margin: specification.delay_margin_s / unit_s,
            gain_margin: specification.gain_margin,
        },
        noise: specification.noise.map(|noise| NoiseLimit {
            amplification: specification.noise_share * noise.input_amplitude / noise.std * k,
            period: noise.sample_period_s / unit_s,
        }),
        input_peak: specification.input_peak.map(|peak| peak * k),
        crossover: specification
            .crossover_rad_per_s
            .map(|omega| omega * unit_s),
        fixed_weight: (specification.setpoint_weight)
            .filter(|_| !is_cascade)
            .map(|weight| FixedWeight {
                weight,
                overshoot: specification.overshoot,
            }),
    })
}

/// The controller of an optimum in the units of the user.
pub(super) fn controller(
    specification: &Specification,
    problem: &Problem,
    best: &Optimum,
) -> Controller {
    let Problem {
        process, family, ..
    } = problem;
    let law = family.law(process, &best.z).scaled(best.gain.k);
    let b = match (problem.fixed_weight, specification.form) {
        (Some(fixed), _) => fixed.weight,
        (None, Form::Pi | Form::Pid) => {
            let limits = (specification.overshoot, problem.input_peak);
            setpoint::weight(process, &law, best.gain.omega, limits)
        }
        _ => law.b,
    };
    family.controller(process, (best.gain.k, &best.z), b, specification.execution)
}

/// Design of an optimum, after a check of the limits by another method than the search.
fn checked(
    model: &Model,
    specification: &Specification,
    problem: &Problem,
    best: &Optimum,
) -> Result<Design, DesignError> {
    let designed = loop_of(model, specification, problem, best)?;
    let found = Loop::new(model, &designed.controller).and_then(|found| found.sensitivity());
    let is_kept = found.is_some_and(|peaks| {
        peaks.ms <= specification.ms * (1.0 + ROUNDING)
            && peaks.mt <= specification.mt * (1.0 + ROUNDING)
    });
    if is_kept {
        Ok(designed)
    } else {
        Err(unexplained(specification))
    }
}

/// Controller, cost and margins of an optimum on the model. An error if the loop is unstable.
fn loop_of(
    model: &Model,
    specification: &Specification,
    problem: &Problem,
    best: &Optimum,
) -> Result<Design, DesignError> {
    let controller = controller(specification, problem, best);
    let found = Loop::new(model, &controller).ok_or(DesignError::Overflow)?;
    Ok(Design {
        controller,
        ise: found.reference_ise().ok_or(unexplained(specification))?,
        margins: found.margins().ok_or(unexplained(specification))?,
        robustness: None,
    })
}

/// The refusal of a result that the check does not confirm.
fn unexplained(specification: &Specification) -> DesignError {
    DesignError::Infeasible {
        form: specification.form,
        least_peak: None,
    }
}
