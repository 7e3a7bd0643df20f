//! Rules that decide which remarks a result gets.

use onecycle_design::Parameter;

use crate::excitation::Oscillation;
use crate::outcome::{Identification, Identified};
use crate::reading::Reading;
use crate::remark::Remark;
use crate::thresholds::{
    FEW_SAMPLES, LITTLE_MARGIN, MUCH_BIAS, MUCH_MISFIT, MUCH_NOISE, WIDE, WIDE_DELAY,
};

/// Remarks on `found`, for which `cycles` cycles were requested.
pub(crate) fn remarks(found: &Identification, has_pack: bool, cycles: usize) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if let Some(oscillation) = found.oscillation() {
        let is_known = found.last_cycle().is_some_and(Reading::is_known);
        of_oscillation(oscillation, is_known, cycles, &mut remarks);
        if found.outcome.is_ok() {
            match found.last_cycle() {
                Some(reading) if reading.is_known() => {}
                Some(reading) => remarks.push(Remark::Unknown(reading.classification.score)),
                None if has_pack => remarks.push(Remark::Unread),
                None => {}
            }
        }
        if let Ok(identified) = &found.outcome {
            of_model(identified, oscillation.period_s, &mut remarks);
            of_fit(identified, oscillation, &mut remarks);
            of_controller(identified, &mut remarks);
        }
    }
    remarks
}

fn of_oscillation(
    oscillation: &Oscillation,
    is_known: bool,
    cycles: usize,
    remarks: &mut Vec<Remark>,
) {
    let used = oscillation.cycles_used;
    if oscillation.cycles_steady == 1 {
        remarks.push(Remark::OneCycle { is_known });
    } else if oscillation.cycles_steady < 3 || (used < cycles && used < 4) {
        remarks.push(Remark::FewCycles { used });
    }
    let noise = oscillation.noise_sigma / oscillation.amplitude;
    if noise > MUCH_NOISE {
        remarks.push(Remark::Noisy(noise));
    }
    let samples = oscillation.period_s / oscillation.sample_s;
    if samples < FEW_SAMPLES {
        remarks.push(Remark::Coarse(samples));
    }
}

/// Remarks on the parameters. `period_s` is the period of the oscillation, or that of the highest informative
/// frequency.
pub(crate) fn of_model(identified: &Identified, period_s: f64, remarks: &mut Vec<Remark>) {
    let estimate = &identified.estimate;
    let gain = identified.model.parameter(Parameter::KOverTBody);
    if gain.is_some_and(|gain| gain < 0.0) {
        remarks.push(Remark::NegativeGain);
    }
    if let Some(t_body) = estimate.get(Parameter::TBody)
        && t_body.high.is_none()
    {
        remarks.push(Remark::DampingNotSeen(t_body.low));
    }
    if let Some(growth_s) = identified.model.parameter(Parameter::TBody)
        && growth_s < 0.0
    {
        remarks.push(Remark::Unstable(-growth_s));
    }
    if let Some((lags, mean_s)) = identified.posterior.equal_lags() {
        remarks.push(Remark::EqualLags { lags, mean_s });
    }
    for (parameter, most) in WIDE {
        let width = estimate
            .get(parameter)
            .and_then(|interval| interval.relative_half_width());
        if let Some(relative_half_width) = width.filter(|&width| width > most) {
            remarks.push(Remark::Weak {
                parameter,
                relative_half_width,
            });
        }
    }
    let tau = estimate.get(Parameter::Tau);
    if let Some((low_s, high_s)) = tau.and_then(|tau| tau.low.zip(tau.high))
        && high_s - low_s > WIDE_DELAY * period_s
    {
        remarks.push(Remark::WeakDelay { low_s, high_s });
    }
}

fn of_fit(identified: &Identified, oscillation: &Oscillation, remarks: &mut Vec<Remark>) {
    let bias = (identified.fit.refined()).map_or(0.0, |refined| refined.input_bias);
    let untrimmed = bias + oscillation.relay_centre;
    let bias = untrimmed.abs() / oscillation.relay_amplitude;
    if bias > MUCH_BIAS {
        remarks.push(Remark::Biased(bias));
    }
    if identified.fit.misfit > MUCH_MISFIT {
        remarks.push(Remark::Misfit(identified.fit.misfit));
    }
}

/// Remarks on the controller.
pub(crate) fn of_controller(identified: &Identified, remarks: &mut Vec<Remark>) {
    let implied_rad = identified.specification.implied_phase_margin_rad();
    let margin = identified.phase_margin_rad;
    if let Some(low) = margin
        .and_then(|margin| margin.low)
        .filter(|&low| low < LITTLE_MARGIN * implied_rad)
    {
        remarks.push(Remark::MarginMayBeLess(low));
    }
}
