//! Design in the named styles: from model and specification to the problem in the units of the process, and back.

use crate::analysis::evaluation::Loop;
use crate::analysis::process::Process;
use crate::controller::{Controller, Form};
use crate::model::Model;
use crate::synthesis::limits::Limits;
use crate::synthesis::objective::{NoiseLimit, Objective, Problem};
use crate::synthesis::optimum::{FINE_GRID, NoOptimum, Optimum, optimum};
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

/// Bisections of the least limit: exact to a percent.
const BISECTIONS: usize = 8;

/// A designed loop exceeds its limits by rounding at most.
const ROUNDING: f64 = 1e-6;

/// See [`super::design`].
pub(super) fn design(model: &Model, specification: &Specification) -> Result<Design, DesignError> {
    let problem = problem(model, specification)?;
    match optimum(problem) {
        Ok(best) if specification.refined && problem.noise.is_none() => {
            let best = polish(&mut Objective::new(problem, FINE_GRID), &best);
            checked(model, specification, &problem, &best)
        }
        Ok(best) => checked(model, specification, &problem, &best),
        Err(reason) => Err(refusal(problem, specification, reason)),
    }
}

/// See [`super::design_over`].
pub(super) fn design_over(
    model: &Model,
    draws: &[Model],
    specification: &Specification,
) -> Result<Design, DesignError> {
    if draws.is_empty() {
        return design(model, specification);
    }
    let problem = problem(model, specification)?;
    let nominal = optimum(problem).map_err(|reason| refusal(problem, specification, reason))?;
    let processes: Vec<Process> = (draws.iter())
        .filter_map(|draw| Process::new(&draw.linear(), &specification.execution))
        .collect();
    let mut set = Draws::new(problem, &processes, specification.coverage);
    let best = set.optimum(&nominal).map_err(|_| {
        let mut shape = nominal.z.clone();
        let mut is_kept = |peak| {
            set.set_peak(peak);
            let found = set.feasible(&shape, nominal.gain.omega);
            found.map(|found| shape = found).is_some()
        };
        DesignError::Infeasible {
            form: specification.form,
            least_peak: least_peak(problem.limits.ms.max(problem.limits.mt), &mut is_kept),
        }
    })?;
    let (found, alone) = (
        set.performance(&best, draws.len()),
        set.performance(&nominal, draws.len()),
    );
    let mut designed = loop_of(model, specification, &problem, &best)?;
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
    Ok(designed)
}

fn refusal(problem: Problem, specification: &Specification, reason: NoOptimum) -> DesignError {
    match reason {
        NoOptimum::Unbounded => DesignError::Unbounded,
        NoOptimum::Infeasible => DesignError::Infeasible {
            form: specification.form,
            least_peak: least_peak(problem.limits.ms.max(problem.limits.mt), &mut |peak| {
                optimum(with_peak(problem, peak)).is_ok()
            }),
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

/// Least limit of `Ms` and `Mt` above `from` that is kept. `None` if none up to 10 is.
pub(super) fn least_peak(from: f64, is_kept: &mut impl FnMut(f64) -> bool) -> Option<f64> {
    let (mut low, mut high) = (from.min(LARGEST_PEAK), LARGEST_PEAK);
    if !is_kept(high) {
        return None;
    }
    for _ in 0..BISECTIONS {
        let middle = (low * high).sqrt();
        if is_kept(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
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
    if !process.is_stable() {
        return Err(DesignError::UnstableProcess);
    }
    if !form.has_integral() && process.integrators() == 0 {
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
    let b = match specification.form {
        Form::Pi | Form::Pid => {
            setpoint::weight(process, &law, best.gain.omega, problem.input_peak)
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
