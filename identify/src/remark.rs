//! What a user should know beside the numbers, in plain words.

use std::fmt;

use crate::outcome::{Identification, Identified, OscillationFound};
use crate::relay::Options;

/// Something weakly determined, or off.
#[derive(Clone, Debug, PartialEq)]
pub enum Remark {
    /// More cycles could not be fitted: what they leave unexplained, as a part of the oscillation.
    Disturbed(f64),
    /// The recording holds one complete cycle and no more.
    OneCycle {
        /// Whether the pack knows it as one of a steady oscillation.
        is_known: bool,
    },
    /// Fewer cycles than asked for, or than steadiness takes.
    FewCycles {
        /// Cycles used.
        used: usize,
    },
    /// The pack's family does not explain the last cycle: its score.
    Unknown(f64),
    /// The pack has no answer for the last cycle.
    Unread,
    /// The gain is negative.
    NegativeGain,
    /// No upper bound for `T_body` and `K`; the lower one of `T_body` (s).
    DampingNotSeen(Option<f64>),
    /// An interval is wide: the parameter and the relative half width.
    Weak(&'static str, f64),
    /// The delay's interval reaches from this to that (s).
    WeakDelay(f64, f64),
    /// Noise over amplitude.
    Noisy(f64),
    /// Input bias less what the relay's centre makes up for, over the relay's amplitude.
    Biased(f64),
    /// Samples a cycle.
    Coarse(f64),
    /// Part of the oscillation that the model leaves unexplained.
    Misfit(f64),
    /// Lower end of the phase margin (rad).
    MarginMayBeLess(f64),
    /// Overshoot of the predicted step.
    Overshoot(f64),
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            &self
                .of_oscillation()
                .or_else(|| self.of_result())
                .unwrap_or_default(),
        )
    }
}

impl Remark {
    fn of_oscillation(&self) -> Option<String> {
        Some(match *self {
            Self::Disturbed(part) => format!(
                "More cycles leave {:.1} % of the oscillation unexplained, as gusts or a moving bias \
                 would: only the cycles named above were fitted.",
                100.0 * part
            ),
            Self::Unknown(score) => format!(
                "The last cycle alone is unlike those of the family that the pack knows (score \
                 {score:.2}, the limit is 1): another beta of the relay, a resonance, friction, a wrong \
                 sensor, a disturbance. The fit stands without the pack; trust it less."
            ),
            Self::Unread => "The pack has no answer for the last cycle: it was made for another relay or for \
                             processes of other shapes, or the cycle has too few samples. The fit stands \
                             without it."
                .to_owned(),
            Self::OneCycle { is_known } => {
                let rest = if is_known {
                    "The pack knows it as one of a steady oscillation, so the input is taken to have \
                     been the same a period earlier."
                } else {
                    "Record two that are alike."
                };
                format!(
                    "The recording holds one complete cycle: nothing in it confirms that the \
                     oscillation is steady. {rest}"
                )
            }
            Self::FewCycles { used } => {
                format!("Only {used} steady cycles could be used; more of them would narrow the intervals.")
            }
            Self::Noisy(part) => format!(
                "The noise is {:.0} % of the amplitude; a larger relay amplitude would help.",
                100.0 * part
            ),
            Self::Biased(part) => format!(
                "The relay works against a bias of {:.0} % of its amplitude; trim it away or raise \
                 the amplitude before the relay loses its authority.",
                100.0 * part
            ),
            Self::Coarse(samples) => format!(
                "There are only {samples:.0} samples a cycle; record at a higher rate if you can."
            ),
            _ => return None,
        })
    }

    fn of_result(&self) -> Option<String> {
        Some(match *self {
            Self::NegativeGain => {
                "The gain is negative: the output falls when the input rises, and \
                                   the controller's gains carry the sign."
                    .to_owned()
            }
            Self::DampingNotSeen(above_s) => {
                let above = above_s.map_or("T_body may be infinite".to_owned(), |above_s| {
                    format!("T_body is above {above_s:.2} s and may be infinite")
                });
                format!(
                    "The body's damping is hardly seen: {above}, so K has no upper bound. The \
                     controller rests on K/T_body."
                )
            }
            Self::Weak("T_body", width) => format!(
                "T_body is only known to about {:.0} %; the controller rests on K/T_body, which is known \
                 better.",
                100.0 * width
            ),
            Self::Weak(what, width) => format!(
                "{what} is only known to about {:.0} %; use more cycles or a larger relay \
                 amplitude.",
                100.0 * width
            ),
            Self::WeakDelay(low_s, high_s) => format!(
                "The delay is only known to lie between {:.2} and {:.2} ms.",
                1e3 * low_s,
                1e3 * high_s
            ),
            Self::Misfit(part) => format!(
                "The model leaves {:.1} % of the oscillation unexplained beyond the noise; the \
                 intervals are widened for it.",
                100.0 * part
            ),
            Self::MarginMayBeLess(margin_rad) => format!(
                "Within the intervals the phase margin may be as low as {:.1} deg; use more \
                 cycles, or ask for more margin with --phase-margin.",
                margin_rad.to_degrees()
            ),
            Self::Overshoot(part) => format!(
                "The step overshoots by {:.0} %, as the least squared error does at this phase \
                 margin; --phase-margin 45 gives a calmer one, and a reference filter helps.",
                100.0 * part
            ),
            _ => return None,
        })
    }
}

pub(crate) fn remarks(found: &Identification, options: &Options, has_pack: bool) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if let Some(oscillation) = &found.oscillation {
        let is_known = found.reading.is_some_and(|reading| reading.is_known());
        of_oscillation(oscillation, is_known, options, &mut remarks);
        if found.outcome.is_ok() {
            match &found.reading {
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
    oscillation: &OscillationFound,
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
    // Where the relay's own protection begins to be needed.
    if noise > 0.05 {
        remarks.push(Remark::Noisy(noise));
    }
    let samples = oscillation.period_s / oscillation.sample_s;
    // A sample is then over 10 degrees of the oscillation: half the phase margin of 20.
    if samples < 360.0 / 10.0 {
        remarks.push(Remark::Coarse(samples));
    }
}

fn of_process(identified: &Identified, oscillation: &OscillationFound, remarks: &mut Vec<Remark>) {
    let process = &identified.process;
    if identified.refined.process.k_over_t_body() < 0.0 {
        remarks.push(Remark::NegativeGain);
    }
    if process.t_body_s.high.is_none() {
        remarks.push(Remark::DampingNotSeen(process.t_body_s.low));
    }
    for (what, interval, most) in [
        ("K/T_body", process.k_over_t_body, 0.1),
        ("T_prop", process.t_prop_s, 0.3),
        ("T_body", process.t_body_s, 0.5),
    ] {
        if let Some(width) = interval.relative_half_width().filter(|&width| width > most) {
            remarks.push(Remark::Weak(what, width));
        }
    }
    // A delay is weakly known when its interval is a part of the period that costs phase margin.
    if let (Some(low_s), Some(high_s)) = (process.tau_s.low, process.tau_s.high)
        && high_s - low_s > 0.03 * oscillation.period_s
    {
        remarks.push(Remark::WeakDelay(low_s, high_s));
    }
    let untrimmed = identified.refined.input_bias + oscillation.relay_centre;
    let bias = untrimmed.abs() / oscillation.relay_amplitude;
    // An asymmetry that was asked for, 0.2 as a rule, needs a bias of as much.
    if bias > 0.25 {
        remarks.push(Remark::Biased(bias));
    }
    if identified.misfit > 0.01 {
        remarks.push(Remark::Misfit(identified.misfit));
    }
}

fn of_controller(identified: &Identified, options: &Options, remarks: &mut Vec<Remark>) {
    let margin = identified.phase_margin_rad;
    if let Some(low) = margin
        .low
        .filter(|&low| low < 0.75 * options.phase_margin_rad)
    {
        remarks.push(Remark::MarginMayBeLess(low));
    }
    if let Some(step) = identified.step.filter(|step| step.overshoot > 0.4) {
        remarks.push(Remark::Overshoot(step.overshoot));
    }
}
