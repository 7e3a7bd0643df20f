//! What limits a result: facts beside the numbers.

use onecycle_design::Parameter;

use crate::excitation::Oscillation;
use crate::outcome::{Identification, Identified};
use crate::relay::reading::Reading;
use crate::settings::Options;

/// Something that is weakly determined, or unusual. Sentences and advice are made by the program that shows it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remark {
    /// A longer stretch did not fit: the part of the oscillation that it leaves unexplained.
    Disturbed(f64),
    /// The recording holds one complete cycle.
    OneCycle {
        /// Whether the pack knows it as one of a steady oscillation.
        is_known: bool,
    },
    /// Fewer cycles than asked for, or than it takes to confirm steadiness.
    FewCycles {
        /// Number of cycles used.
        used: usize,
    },
    /// No process of the pack's family explains the last cycle: its misfit score, with limit 1.
    Unknown(f64),
    /// The pack has no answer for the last cycle.
    Unread,
    /// The gain is negative.
    NegativeGain,
    /// `T_body` and `K` have no upper bound; the lower bound of `T_body` (s), where it has one.
    DampingNotSeen(Option<f64>),
    /// The interval of a parameter is wide.
    Weak {
        /// The parameter.
        parameter: Parameter,
        /// Half the width of the interval over the estimate.
        relative_half_width: f64,
    },
    /// The interval of the dead time is wide: its ends (s).
    WeakDelay {
        /// Lower end (s).
        low_s: f64,
        /// Upper end (s).
        high_s: f64,
    },
    /// Standard deviation of the noise over the amplitude.
    Noisy(f64),
    /// Input bias that the relay's centre does not make up for, over the relay's amplitude.
    Biased(f64),
    /// Number of samples in a cycle.
    Coarse(f64),
    /// Part of the oscillation that the model leaves unexplained beyond the noise.
    Misfit(f64),
    /// Lower end of the interval of the phase margin (rad).
    MarginMayBeLess(f64),
    /// Overshoot of the predicted step, as a fraction of it.
    Overshoot(f64),
}

impl Remark {
    /// Fixed name for programs: an entry of `remark_kinds` in JSON.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Disturbed(_) => "disturbed",
            Self::OneCycle { .. } => "one_cycle",
            Self::FewCycles { .. } => "few_cycles",
            Self::Unknown(_) => "unknown",
            Self::Unread => "unread",
            Self::NegativeGain => "negative_gain",
            Self::DampingNotSeen(_) => "damping_not_seen",
            Self::Weak { .. } => "weak_parameter",
            Self::WeakDelay { .. } => "weak_delay",
            Self::Noisy(_) => "noisy",
            Self::Biased(_) => "biased",
            Self::Coarse(_) => "coarse",
            Self::Misfit(_) => "misfit",
            Self::MarginMayBeLess(_) => "margin_may_be_less",
            Self::Overshoot(_) => "overshoot",
        }
    }
}

pub(crate) fn remarks(found: &Identification, options: &Options, has_pack: bool) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if let Some(oscillation) = found.oscillation() {
        let is_known = found.last_cycle().is_some_and(Reading::is_known);
        of_oscillation(oscillation, is_known, options, &mut remarks);
        if found.outcome.is_ok() {
            match found.last_cycle() {
                Some(reading) if reading.is_known() => {}
                Some(reading) => remarks.push(Remark::Unknown(reading.classification.score)),
                None if has_pack => remarks.push(Remark::Unread),
                None => {}
            }
        }
        if let Ok(identified) = &found.outcome {
            of_process(identified, oscillation, &mut remarks);
            of_controller(identified, options, &mut remarks);
        }
    }
    remarks
}

fn of_oscillation(
    oscillation: &Oscillation,
    is_known: bool,
    options: &Options,
    remarks: &mut Vec<Remark>,
) {
    let used = oscillation.cycles_used;
    if oscillation.cycles_steady == 1 {
        remarks.push(Remark::OneCycle { is_known });
    } else if oscillation.cycles_steady < 3 || (used < options.cycles && used < 4) {
        remarks.push(Remark::FewCycles { used });
    }
    let noise = oscillation.noise_sigma / oscillation.amplitude;
    // From here on the relay needs its own protection against noise.
    if noise > 0.05 {
        remarks.push(Remark::Noisy(noise));
    }
    let samples = oscillation.period_s / oscillation.sample_s;
    // One sample is then over 10 degrees of the oscillation, half of a phase margin of 20 degrees.
    if samples < 360.0 / 10.0 {
        remarks.push(Remark::Coarse(samples));
    }
}

fn of_process(identified: &Identified, oscillation: &Oscillation, remarks: &mut Vec<Remark>) {
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
    for (parameter, most) in [
        (Parameter::KOverTBody, 0.1),
        (Parameter::TProp, 0.3),
        (Parameter::TBody, 0.5),
    ] {
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
    // The dead time is weakly known where the width of its interval, as a part of the period, costs phase margin.
    let tau = estimate.get(Parameter::Tau);
    if let Some((low_s, high_s)) = tau.and_then(|tau| tau.low.zip(tau.high))
        && high_s - low_s > 0.03 * oscillation.period_s
    {
        remarks.push(Remark::WeakDelay { low_s, high_s });
    }
    let bias = identified.fit.refined.input_bias;
    let untrimmed = bias + oscillation.relay_centre;
    let bias = untrimmed.abs() / oscillation.relay_amplitude;
    // A relay that was made asymmetric on purpose, by 0.2 as a rule, shows a bias of 0.2.
    if bias > 0.25 {
        remarks.push(Remark::Biased(bias));
    }
    if identified.fit.misfit > 0.01 {
        remarks.push(Remark::Misfit(identified.fit.misfit));
    }
}

fn of_controller(identified: &Identified, options: &Options, remarks: &mut Vec<Remark>) {
    let margin = identified.phase_margin_rad;
    if let Some(low) = margin
        .low
        .filter(|&low| low < 0.75 * options.specification.phase_margin_rad)
    {
        remarks.push(Remark::MarginMayBeLess(low));
    }
    if let Some(step) = identified.step.filter(|step| step.overshoot > 0.4) {
        remarks.push(Remark::Overshoot(step.overshoot));
    }
}
