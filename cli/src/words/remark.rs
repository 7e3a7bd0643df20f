//! What a remark means.

use onecycle::{Parameter, Remark};

/// One or two sentences, with the options of this program.
pub(crate) fn sentence(remark: &Remark) -> String {
    of_recording(remark)
        .or_else(|| of_result(remark))
        .unwrap_or_else(|| format!("{}.", remark.kind()))
}

fn of_recording(remark: &Remark) -> Option<String> {
    Some(match *remark {
        Remark::Disturbed(part) => format!(
            "With more cycles {:.1} % of the oscillation stays unexplained, as after a gust or a changing bias: only \
             the cycles named above were fitted.",
            100.0 * part
        ),
        Remark::Unknown(score) => format!(
            "The last cycle does not look like a process of the pack's family (misfit score {score:.2}, limit 1). \
             Possible causes: another beta of the relay, a resonance, friction, a wrong sensor, a disturbance. The \
             fit was made without the pack; trust it less."
        ),
        Remark::Unread => "The pack cannot read the last cycle: it was made for another relay or for processes of \
                           other shapes, or the cycle has too few samples. The fit was made without the pack."
            .to_owned(),
        Remark::OneCycle { is_known } => {
            let rest = if is_known {
                "The pack knows it as a cycle of a steady oscillation, so the input a period earlier is taken to be \
                 the same."
            } else {
                "Record two cycles that are alike."
            };
            format!(
                "The recording holds one complete cycle: nothing in it confirms that the oscillation is steady. \
                 {rest}"
            )
        }
        Remark::FewCycles { used } => format!(
            "Only {used} steady cycles could be used; more cycles would narrow the intervals."
        ),
        Remark::Noisy(part) => format!(
            "The noise is {:.0} % of the amplitude; a larger relay amplitude would help.",
            100.0 * part
        ),
        Remark::Biased(part) => format!(
            "The relay works against a bias of {:.0} % of its amplitude. Trim the bias away or raise the amplitude: \
             at 100 % the relay cannot turn the output round.",
            100.0 * part
        ),
        Remark::Coarse(samples) => {
            format!("There are only {samples:.0} samples a cycle; record at a higher rate if you can.")
        }
        _ => return None,
    })
}

fn of_result(remark: &Remark) -> Option<String> {
    Some(match *remark {
        Remark::NegativeGain => {
            "The gain is negative: the output falls when the input rises. The controller's gains \
                                 have the same sign."
                .to_owned()
        }
        Remark::DampingNotSeen(above_s) => {
            let bound = above_s.map_or("T_body has no bound".to_owned(), |above_s| {
                format!("T_body is above {above_s:.2} s and has no upper bound")
            });
            format!(
                "The damping is hardly visible: {bound}, and so K has no upper bound. The controller depends on \
                 K/T_body, which is known."
            )
        }
        Remark::Weak {
            parameter: Parameter::TBody,
            relative_half_width,
        } => format!(
            "T_body is known to about {:.0} % only. The controller depends on K/T_body, which is known better.",
            100.0 * relative_half_width
        ),
        Remark::Weak {
            parameter,
            relative_half_width,
        } => format!(
            "{} is known to about {:.0} % only; use more cycles or a larger relay amplitude.",
            parameter.symbol(),
            100.0 * relative_half_width
        ),
        Remark::WeakDelay { low_s, high_s } => format!(
            "The delay is only known to lie between {:.2} and {:.2} ms.",
            1e3 * low_s,
            1e3 * high_s
        ),
        Remark::Misfit(part) => format!(
            "The model leaves {:.1} % of the oscillation unexplained beyond the noise; the intervals are widened for \
             it.",
            100.0 * part
        ),
        Remark::MarginMayBeLess(margin_rad) => format!(
            "Within the intervals the phase margin may be as low as {:.1} deg; use more cycles, or ask for a larger \
             margin with --phase-margin.",
            margin_rad.to_degrees()
        ),
        Remark::Overshoot(part) => format!(
            "The step overshoots by {:.0} %, which is usual for the least squared error at this phase margin. Less \
             overshoot: --phase-margin 45, or a filter on the reference.",
            100.0 * part
        ),
        _ => return None,
    })
}
