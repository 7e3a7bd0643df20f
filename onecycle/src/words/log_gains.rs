//! Sentences about the gains of a flight log: read-back, overlay, parameters that are written or not.

use onecycle_link::{Agreement, ControlLoop, GainsError, ReadBack, ReadTerm};

use crate::results::log_gains::Written;
use crate::words::number::short;
use crate::words::sentence;

use super::listed;

pub const NOTHING_IDENTIFIED: &str = "no process was identified, so no gains can be justified.";
pub const CONTRADICTED: &str = "the gains read back from the signals contradict the parameters of the log. Check \
    that no gain was moved in flight by a knob, and that the axes are not exchanged or mounted the other way round.";
pub const NO_DESIGN: &str =
    "no controller keeps the limits; choose a calmer `style` or another stretch of the log.";
pub const NOT_ITS_FORM: &str =
    "the proposed controller has a form that the firmware does not have: leave out `controller`.";
pub const NOT_ITS_FILTER: &str = "the proposed controller needs a filter of the measurement, and the log shows no such \
    filter of the firmware. Use a log that holds all parameters, with a filter of the derivative.";
pub const NO_CHANGE: &str =
    "the step leaves every parameter as it is; the gains in force are near the proposed ones.";

/// The loop has no gains to write.
pub fn no_gains(of: ControlLoop) -> String {
    format!("the log has no gains of the {of} loop whose scale is known; choose a rate loop.")
}

/// Why gains are no parameters of the firmware, and what to do.
pub fn unwritable(error: &GainsError) -> String {
    let advice = match error {
        GainsError::Range { .. } => "take calmer gains: a smaller `step` or a calmer `style`",
        GainsError::Firmware(_) | GainsError::Version(_) => {
            "type the gains in by hand, in the scale of your firmware"
        }
        _ => "choose another loop with `axis` and `loop`",
    };
    format!("{error}; {advice}.")
}

/// The gains to write are not stable, with the share of draws on which they are.
pub fn unstable(stable: Option<f64>) -> String {
    let share = stable.map_or(String::new(), |share| {
        format!(" ({:.0} % of the draws are stable)", 100.0 * share)
    });
    format!(
        "the gains of this step are unstable on processes that the log allows{share}. Choose another `step`, or record a \
         longer or stronger excitation."
    )
}

/// Why gains that break limits are not written, and how they are.
pub fn below_limits(broken: &str) -> String {
    format!("{broken}; choose another `step` or `style`, or add `below_limits` to write them.")
}

/// What a read-back tells about the log.
pub fn read_back(read: &ReadBack) -> String {
    let since = read.since_s.map_or(String::new(), |since_s| {
        format!("Gains were changed in flight: the last ones are in force, and the signals after {since_s:.1} s count. ")
    });
    let explained = read.explained.map_or(String::new(), |share| {
        format!(
            " The recovered law explains {:.1} % of the output of the controller.",
            100.0 * share
        )
    });
    let names = |agreement: Agreement| {
        let of = read.terms.iter().filter(|term| term.agreement == agreement);
        let names: Vec<&str> = of.map(|term| term.name.as_str()).collect();
        (!names.is_empty()).then(|| listed(&names))
    };
    let parts = (names(Agreement::Agrees), names(Agreement::Unknown));
    let verdict = match (read.agreement(), parts) {
        (Agreement::Agrees, (Some(agreeing), Some(unknown))) => format!(
            "The signals agree with {agreeing}, and show too little of {unknown} to compare."
        ),
        (Agreement::Agrees, _) => "The signals agree with the parameters of the log.".to_owned(),
        (Agreement::Differs, _) => {
            "The signals contradict the parameters of the log: an axis, a sign, a unit or the version is not what it seems, \
             or a gain was moved in flight by a knob."
                .to_owned()
        }
        _ => {
            "The signals cannot confirm the parameters: the axis moved too little, or the log is too slow.".to_owned()
        }
    };
    format!("{since}{verdict}{explained}")
}

/// A term that was read back, as the value of its name.
pub fn term(term: &ReadTerm) -> String {
    let [low, high] = term.stated;
    let stated = if low == high {
        short(low)
    } else {
        format!("{} to {}", short(low), short(high))
    };
    let verdict = agreement(term.agreement);
    match term.recovered {
        Some((value, std)) => format!(
            "stated {stated}, read back {} (standard error {}): {verdict}",
            short(value),
            short(std)
        ),
        None => format!("stated {stated}: {verdict}"),
    }
}

/// The verdict on a term.
pub fn agreement(agreement: Agreement) -> &'static str {
    match agreement {
        Agreement::Agrees => "agrees",
        Agreement::Differs => "differs",
        _ => "cannot tell",
    }
}

/// How far the simulated loop explains the log.
pub fn overlay(explained: f64) -> String {
    format!(
        "The identified process under the gains in force, driven by the logged set-point, explains {:.1} % of the variance \
         of the logged output.",
        100.0 * explained
    )
}

/// Margins of the gains to write.
pub fn margins(written: &Written) -> String {
    let margins = &written.figures.margins;
    let gain = margins
        .gain_margin
        .map_or(String::new(), |gain| format!(", gain margin {gain:.2}"));
    let least = written.least.map_or(String::new(), |least| {
        format!(
            "; over the posterior at least {:.1} deg and at most Ms {:.2} (90 %), stable on {:.0} % of the draws",
            least.phase_margin_rad.to_degrees(),
            least.ms,
            100.0 * least.stable
        )
    });
    let overshoot = written.overshoot.map_or(String::new(), |overshoot| {
        format!(
            ", an overshoot of {:.0} % after a step of the set-point",
            100.0 * overshoot
        )
    });
    format!(
        "With these values the loop has a phase margin of {:.1} deg{gain}, Ms {:.2}{overshoot}{least}.",
        margins.phase_margin_rad.to_degrees(),
        written.figures.ms
    )
}

/// The limits that the gains to write break.
pub fn broken(written: &Written) -> Option<String> {
    let in_force = match written.needs_consent {
        true => "",
        false => " The gains in force break them by more.",
    };
    Some(sentence(written.broken.as_ref()?) + in_force)
}

/// Margins of the gains that were written, and how to go on.
pub fn written(written: &Written) -> Vec<String> {
    let mut sentences = vec![margins(written)];
    sentences.extend(broken(written));
    if let Some(files) = &written.files {
        sentences.push(format!(
            "Written to {}; {} sets the old values again.",
            files.path.display(),
            files.restore.display()
        ));
    }
    if written.least.is_none() {
        sentences.push(
            "The margins are those of the most probable process only: the recording gives no distribution of it."
                .to_owned(),
        );
    }
    if written.share < 1.0 {
        sentences.push(format!(
            "The step is {:.0} % of the way to the proposed gains. Fly and log again before the next one, or use `step=1`.",
            100.0 * written.share
        ));
    }
    sentences
}
