//! Design in the named styles: from model and specification to the problem in the units of the process, and back.

use crate::analysis::evaluation::Loop;
use crate::analysis::process::Process;
use crate::controller::{Controller, Form};
use crate::model::Model;
use crate::synthesis::limits::Limits;
use crate::synthesis::objective::{NoiseLimit, Problem};
use crate::synthesis::optimum::{NoOptimum, Optimum, optimum};
use crate::synthesis::setpoint;
use crate::synthesis::shape::{Family, Filter};

use super::outcome::{Design, DesignError};
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
        Ok(best) => checked(model, specification, &problem, &best),
        Err(NoOptimum::Unbounded) => Err(DesignError::Unbounded),
        Err(NoOptimum::Infeasible) => Err(DesignError::Infeasible {
            form: specification.form,
            least_peak: least_peak(problem.limits.ms.max(problem.limits.mt), |peak| {
                optimum(with_peak(problem, peak)).is_ok()
            }),
        }),
    }
}

/// The problem with other limits of `Ms` and `Mt`.
pub(super) fn with_peak(problem: Problem, peak: f64) -> Problem {
    let limits = Limits { ms: peak, mt: peak, ..problem.limits };
    Problem { limits, ..problem }
}

/// Least limit of `Ms` and `Mt` above `from` that is kept. `None` if none up to 10 is.
pub(super) fn least_peak(from: f64, is_kept: impl Fn(f64) -> bool) -> Option<f64> {
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
pub(super) fn problem(model: &Model, specification: &Specification) -> Result<Problem, DesignError> {
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
    })
}

/// The controller of an optimum in the units of the user.
pub(super) fn controller(
    specification: &Specification,
    problem: &Problem,
    best: &Optimum,
) -> Controller {
    let Problem { process, family, .. } = problem;
    let law = family.law(process, &best.z).scaled(best.gain.k);
    let b = match specification.form {
        Form::Pi | Form::Pid => {
            setpoint::weight(process, &law, best.gain.omega, problem.input_peak)
        }
        _ => law.b,
    };
    family.controller(process, (best.gain.k, &best.z), b, specification.execution)
}

/// Design of an optimum, after a check of stability and limits by another method than the search.
fn checked(
    model: &Model,
    specification: &Specification,
    problem: &Problem,
    best: &Optimum,
) -> Result<Design, DesignError> {
    let controller = controller(specification, problem, best);
    let infeasible = DesignError::Infeasible {
        form: specification.form,
        least_peak: None,
    };
    let found = Loop::new(model, &controller).ok_or(DesignError::Overflow)?;
    let peaks = found.sensitivity().ok_or(infeasible)?;
    let is_kept = peaks.ms <= specification.ms * (1.0 + ROUNDING)
        && peaks.mt <= specification.mt * (1.0 + ROUNDING);
    if !is_kept {
        return Err(infeasible);
    }
    Ok(Design {
        controller,
        ise: found.reference_ise().ok_or(infeasible)?,
        margins: found.margins().ok_or(infeasible)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::Execution;
    use crate::model::{Linear, Structure};
    use crate::synthesis::objective::Objective;
    use crate::tuning::{MeasurementNoise, Style};

    #[test]
    fn dbg() {
        for (form, st) in [(Form::Pd, Structure::DoubleIntegratorLag), (Form::CascadePi, Structure::DoubleIntegratorLag)] {
        let model: Model = Linear::new(st).with_lags_s([0.1, 1.0]).with_tau_s(1.0).into();
        let spec = Specification::new(form, Style::Balanced);
        let p = problem(&model, &spec).unwrap();
        let mut o = Objective::new(p, 0.08);
        for s in [1.0f64, 3.0, 10.0, 20.0, 30.0, 60.0, 100.0, 300.0] {
            for r in [1.0, 0.5, 0.25, 0.1] {
            let z = if form == Form::Pd { vec![s.ln()] } else {vec![s.ln(), (s*r).ln()]};
            println!("{form:?} {s} {r} {:?} {:?} {}", o.allowed(&z).map(|(a,b)| ((a.low,a.high), b.map(|b| (b.low,b.high)))), 0, o.cost(&z));
            if form == Form::Pd {break;}
            }
        }
        }
    }
}
