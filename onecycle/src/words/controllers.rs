//! Sentences about controllers: the reason why a design failed, the assumed noise and sampling, the cost of robustness, and
//! the verdict on the gains that the user flies now.

use crate::{DesignError, Form, Robustness, Specification, Style};
use onecycle_design::{Limit, Missed, TypedGain, VendorError};

use crate::results::controllers::{Against, Controllers, Source};
use crate::words::number::{frequency, seconds, short, significant};

/// Why the controller of a process control system cannot take the gains, and what to do.
pub fn no_gains(error: VendorError) -> &'static str {
    match error {
        VendorError::ComplexZeros => {
            "its form is in series and needs Ti of at least 4 Td; use `controller=pi`, or a controller in ideal form"
        }
        VendorError::NoProportional => "its form needs a proportional gain",
        VendorError::NoDerivative => "it has no derivative; use `controller=pi`",
        _ => "check `output_range` and `input_range`",
    }
}

/// The action of a controller with these gains: direct if its output rises with the measurement.
pub fn action(gains: &[TypedGain; 3]) -> &'static str {
    match gains[0].value < 0.0 {
        true => "direct",
        false => "reverse",
    }
}

/// Why there is no controller, as the cell of a table.
pub fn brief(error: &DesignError) -> String {
    match error {
        DesignError::Infeasible {
            least_peak: Some(peak),
            ..
        } => format!("none: the least Ms is {}", above(*peak)),
        DesignError::Infeasible { .. } => "none keeps the limits".to_owned(),
        DesignError::NoIntegral(_) => "none: the process needs an integral term".to_owned(),
        DesignError::NoRate(_) => "none: the output is not the integral of a rate".to_owned(),
        DesignError::Unbounded => "none: give `sample_period`".to_owned(),
        DesignError::Structure(_) => "none for this structure".to_owned(),
        _ => "none".to_owned(),
    }
}

/// What to do if there is no controller.
pub fn advice(error: &DesignError) -> String {
    match error {
        DesignError::Infeasible {
            least_peak: Some(peak),
            ..
        } => format!(
            "Ask for `ms={}` or more, record longer for narrower intervals, or choose another `controller`",
            above(*peak)
        ),
        DesignError::Infeasible { .. } => {
            "Relax the further limits, record longer for narrower intervals, or choose another `controller`".to_owned()
        }
        DesignError::NoIntegral(_) => "Use `controller=pi` or `controller=pid`".to_owned(),
        DesignError::NoRate(_) => "Use `controller=pi` or `controller=pid`".to_owned(),
        DesignError::Unbounded => {
            "The option is `sample_period`".to_owned()
        }
        DesignError::PhaseMargin(_) => "Choose another margin with `phase_margin`".to_owned(),
        DesignError::Structure(_) => {
            "Choose `style=sharp`, balanced or calm; `style=paper` is for the structure soiptd only".to_owned()
        }
        DesignError::UnstableProcess => "Stabilise the process by an inner loop and identify that".to_owned(),
        _ => "Write the process in other units".to_owned(),
    }
}

/// The error and what to do, as one clause.
pub fn refusal(error: &DesignError) -> String {
    format!("{error}. {}", advice(error))
}

/// A limit of `Ms` that can be kept, rounded up to two decimals.
fn above(peak: f64) -> String {
    format!("{:.2}", (100.0 * peak).ceil() / 100.0)
}

/// What was assumed about noise and execution, one sentence. `None` if nothing was.
pub fn assumed(asked: &Specification, is_recorded: bool) -> Option<String> {
    let noise = asked.noise.map_or_else(
        || "no measurement noise".to_owned(),
        |noise| {
            format!(
                "measurement noise {} in samples every {}, input amplitude {}",
                significant(noise.std),
                seconds(noise.sample_period_s),
                significant(noise.input_amplitude)
            )
        },
    );
    let execution = &asked.execution;
    let controller = match (execution.sample_period_s, execution.computation_delay_s) {
        (0.0, _) => "a continuous controller".to_owned(),
        (period_s, 0.0) => format!(
            "a controller that runs every {} without computation delay",
            seconds(period_s)
        ),
        (period_s, delay_s) => format!(
            "a controller that runs every {} with a computation delay of {}",
            seconds(period_s),
            seconds(delay_s)
        ),
    };
    (is_recorded || asked.execution.sample_period_s > 0.0).then(|| format!("{noise}; {controller}"))
}

/// The limits that the chosen controller does not keep, a sentence or two for each.
pub fn not_kept(choice: &Controllers) -> Vec<String> {
    let sentence = |missed: &Missed| match missed.limit {
        Limit::Overshoot => overshoots(choice, missed),
        _ => out_of_limit(missed),
    };
    choice.missed.iter().map(sentence).collect()
}

/// An overshoot above its limit: why, and the filter that keeps it.
fn overshoots(choice: &Controllers, missed: &Missed) -> String {
    let limit = percent(missed.asked);
    let why = match (choice.asked.setpoint_weight, choice.asked.form) {
        (Some(weight), _) => format!("the set-point weight of the firmware is {}", short(weight)),
        (None, Form::Pi | Form::Pid) => {
            "even the least set-point weight, b = 0, does not keep it".to_owned()
        }
        (None, _) => "this form of controller has no set-point weight".to_owned(),
    };
    let advice = choice.reference_filter_s.map_or_else(
        || "Ramp the reference instead of stepping it".to_owned(),
        |time_s| {
            format!(
                "Pass the reference through a first-order filter with a time constant of {}: that keeps {limit}",
                seconds(up(time_s))
            )
        },
    );
    format!(
        "The overshoot of {} is above its limit of {limit} (`overshoot`): {why}. {advice}.",
        percent(missed.reached)
    )
}

/// A share in percent, with a decimal where it has one.
fn percent(share: f64) -> String {
    format!("{} %", (1e3 * share).round() / 10.0)
}

/// Rounded up to two significant digits, as a time is shown.
pub(crate) fn up(time_s: f64) -> f64 {
    let digit = 10_f64.powf(time_s.log10().floor() - 1.0);
    (time_s / digit).ceil() * digit
}

/// Another limit that is not kept.
fn out_of_limit(missed: &Missed) -> String {
    let (name, option) = match missed.limit {
        Limit::PhaseMargin => ("phase margin", " (`phase_margin`)"),
        Limit::GainMargin => ("gain margin", " (`gain_margin`)"),
        Limit::DelayMargin => ("delay margin", ""),
        Limit::Ms => ("maximum sensitivity Ms", " (`ms`)"),
        Limit::Mt => ("maximum complementary sensitivity Mt", " (`ms`)"),
        Limit::Noise => ("noise at the actuator", " (`noise`)"),
        Limit::InputPeak => (
            "largest input after a step of the reference",
            " (`input_peak`)",
        ),
        _ => ("gain crossover", ""),
    };
    let shown = |value: f64| match missed.limit {
        Limit::PhaseMargin => format!("{:.1} deg", value.to_degrees()),
        Limit::DelayMargin => seconds(value),
        Limit::Noise => percent(value),
        Limit::Crossover => frequency(value),
        _ => short(value),
    };
    let side = if missed.reached < missed.asked {
        "below"
    } else {
        "above"
    };
    format!(
        "The {name} of {} is {side} its limit of {}{option}. Check the loop before you use these gains, or choose `style=calm`.",
        shown(missed.reached),
        shown(missed.asked)
    )
}

/// What robustness costs.
pub fn price(robustness: &Robustness, source: Source) -> String {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let nominal = percent(robustness.nominal_coverage);
    let cost = robustness.mean_iae / robustness.nominal_mean_iae - 1.0;
    let price = if !robustness.nominal_mean_iae.is_finite() {
        "and is unstable on some of them".to_owned()
    } else if cost >= 0.0 {
        format!(
            "for an expected IAE lower by {}",
            percent(cost / (1.0 + cost))
        )
    } else {
        format!(
            "for an expected IAE higher by {}",
            percent(-cost / (1.0 + cost))
        )
    };
    let (all, one) = members(source);
    format!(
        "the limits hold on {} of the {all}; the design for {one} one alone keeps them on {nominal}, {price}",
        percent(robustness.coverage)
    )
}

/// Names of the processes over which a controller is judged, and of the one for which its figures are given.
fn members(source: Source) -> (&'static str, &'static str) {
    match source {
        Source::Oscillation => ("processes that agree", "the middle"),
        _ => ("likely processes", "the most probable"),
    }
}

/// How the gains in force do.
pub fn judgement(against: &Against, source: Source) -> String {
    let (all, one) = members(source);
    let Some(figures) = &against.figures else {
        return format!("your gains are unstable on {one} process");
    };
    let filter = match against.filter_s {
        Some(filter_s) => format!(
            ", with a filter Tf of {} because you gave none,",
            seconds(filter_s)
        ),
        None => String::new(),
    };
    let own = format!(
        "your gains{filter} are stable on {one} process with phase margin {:.1} deg and Ms {:.2}",
        figures.margins.phase_margin_rad.to_degrees(),
        figures.ms
    );
    let Some(least) = &against.least else {
        return own;
    };
    let stable = match 100.0 * least.stable {
        100.0 => format!("on all {all}"),
        share => format!("on {share:.1} % of the {all}"),
    };
    if least.ms.is_finite() {
        format!(
            "{own}, and {stable}; at the bad end of 90 %: phase margin {:.1} deg, gain margin {}, Ms {:.2}",
            least.phase_margin_rad.to_degrees(),
            factor(least.gain_margin),
            least.ms
        )
    } else {
        format!("{own}, but {stable} only")
    }
}

/// What changes with the chosen controller against the gains in force. `None` if these are unstable.
pub fn change(choice: &Controllers) -> Option<String> {
    let old = choice.against.as_ref()?.figures?;
    let (_, new) = choice.design()?;
    let mut parts = vec![
        format!("Ms {:.2} instead of {:.2}", new.ms, old.ms),
        format!(
            "phase margin {:.1} deg instead of {:.1}",
            new.margins.phase_margin_rad.to_degrees(),
            old.margins.phase_margin_rad.to_degrees()
        ),
    ];
    if let (Some(new), Some(old)) = (new.step, old.step) {
        parts.push(format!(
            "settling in {} instead of {}",
            seconds(new.settling_time_s),
            seconds(old.settling_time_s)
        ));
    }
    match (new.load_iae, old.load_iae) {
        (Some(new), Some(old)) if new.is_finite() && old.is_finite() => parts.push(format!(
            "{:.2} times the error after a step of the load",
            new / old
        )),
        (Some(new), Some(old)) if new.is_finite() && old.is_infinite() => {
            parts.push("a constant load leaves no offset".to_owned());
        }
        _ => {}
    }
    if let (Some(new), Some(old)) = (new.noise_share, old.noise_share) {
        parts.push(format!(
            "noise at the actuator {:.0} % instead of {:.0} % of the input amplitude",
            100.0 * new,
            100.0 * old
        ));
    }
    Some(format!("with the chosen controller: {}", parts.join(", ")))
}

fn factor(gain_margin: f64) -> String {
    if gain_margin.is_finite() {
        format!("{gain_margin:.2}")
    } else {
        "unbounded".to_owned()
    }
}

/// Name of a style in a sentence.
pub fn style(style: Style) -> &'static str {
    match style {
        Style::Paper => "the paper's",
        other => other.name(),
    }
}

/// Resonance that the loop bears above 1.5 times the highest frequency that the recording excites, `excited` (rad/s).
pub fn resonance(factor: f64, excited: f64) -> String {
    format!(
        "The recording excites frequencies up to {}. A resonance above {}, which it would not show, makes the loop unstable \
         if it raises the response of the process by a factor of {factor:.1} or more.",
        frequency(excited),
        frequency(1.5 * excited)
    )
}

#[cfg(test)]
mod tests {
    use crate::{Execution, Form, MeasurementNoise, Structure};

    use super::*;

    // A limit that can be kept is rounded up: 1.8312 becomes 1.84.
    #[test]
    fn every_refusal_names_an_option() {
        let form = Form::Pid;
        let infeasible = |least_peak| DesignError::Infeasible { form, least_peak };
        let errors = [
            (infeasible(Some(1.8312)), "`ms=1.84` or more"),
            (infeasible(None), "`controller`"),
            (DesignError::NoIntegral(Form::Pd), "`controller=pi`"),
            (DesignError::NoRate(Form::CascadePi), "`controller=pid`"),
            (DesignError::Unbounded, "`sample_period`"),
            (DesignError::PhaseMargin(2.0), "`phase_margin`"),
            (DesignError::Structure(Structure::Foptd), "`style=sharp`"),
        ];
        for (error, words) in errors {
            let text = refusal(&error);
            assert!(text.contains(words), "{text}");
            assert!(!text.ends_with('.') && brief(&error).len() < 60, "{text}");
        }
        assert_eq!(
            brief(&infeasible(Some(1.8312))),
            "none: the least Ms is 1.84"
        );
    }

    #[test]
    fn assumptions_are_those_of_the_recording() {
        let asked = Specification::default();
        assert_eq!(assumed(&asked, false), None);
        let noise = MeasurementNoise::new(0.02, 0.004, 3.0);
        let sampled = asked
            .with_noise(noise)
            .with_execution(Execution::sampled(0.004));
        assert_eq!(
            assumed(&sampled, true).as_deref(),
            Some(
                "measurement noise 0.02000 in samples every 4.0 ms, input amplitude 3.000; a controller that runs every \
                 4.0 ms with a computation delay of 4.0 ms"
            )
        );
    }
}
