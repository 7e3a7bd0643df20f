//! What the checks beside the fit found: clocks, amplitudes, frequencies, limits of the controller.

use crate::Remark;

use crate::words::number::{seconds, significant};

/// One or two sentences. `None` for a remark of another kind.
pub(crate) fn sentence(remark: &Remark) -> Option<String> {
    Some(match remark {
        Remark::ClockUnknown {
            seen,
            beta,
            late_s,
            phase_margin_rad,
            rad_per_s,
        } => {
            let cost = rad_per_s.map_or(String::new(), |rad_per_s| {
                let (offset, deg) = cost_of_offset(rad_per_s);
                format!(" Each {offset} of an offset cost {deg:.1} deg.")
            });
            clock(*seen, *beta, late_s.map(|late_s| (late_s, *phase_margin_rad)), &cost)
        }
        Remark::ClockUnchecked { rad_per_s } => clock_unchecked(*rad_per_s),
        Remark::Extrapolated {
            ratio,
            is_withdrawn: false,
        } => format!(
            "The gain crossover lies at {ratio:.1} times the highest frequency that the recording excites: a resonance \
             there would not have shown. A relay that leads (beta -0.73) or a chirp excites higher frequencies."
        ),
        Remark::Extrapolated { ratio, .. } => format!(
            "No controller is given: its gain crossover would lie at {ratio:.1} times the highest frequency that the \
             recording excites, where a resonance would not have shown. Use a relay that leads (beta -0.73) or a chirp."
        ),
        Remark::OneAmplitude => "No two amplitudes of the input were compared, so a dead zone, backlash or saturation of the \
                                 actuator, or a valve that sticks, may stay hidden: repeat the test at 0.6 of the \
                                 amplitude, best in the same recording."
            .to_owned(),
        Remark::JumpsOnly => "Both amplitudes show the same process. The jumps of a relay overcome a valve or joint that sticks: \
                              if it may, try small steps too."
            .to_owned(),
        Remark::SwitchesBetweenSamples(cost_rad) => format!(
            "If the relay runs faster than the log, its switches come up to one sample before they are logged, which may \
             cost {:.1} deg of phase margin. Log every step of the relay, or say that the log does with `hold=held`.",
            cost_rad.to_degrees()
        ),
        Remark::OtherAmplitudeRefused(verdict) => format!(
            "The part of the recording at the other amplitude of the relay was refused ({verdict}), so the amplitudes could \
             not be compared."
        ),
        Remark::LittleGainMargin(margin) => format!(
            "The gain margin is a factor of {margin:.1} only ({:.1} dB). Ask for more with `style=balanced` or \
             `gain_margin=2`.",
            20.0 * margin.log10()
        ),
        Remark::NoiseAtActuator(share) => format!(
            "Noise moves the actuator with a standard deviation of {:.0} % of the amplitude of the input. Limit it with \
             `noise=10%`.",
            100.0 * share
        ),
        Remark::InputPeak { step, input } => format!(
            "A step of the reference above {} asks for more input than the {} that the test tried: take larger steps along \
             a ramp, or limit the input with `input_peak`.",
            significant(*step),
            significant(*input)
        ),
        _ => return None,
    })
}

/// Nothing shows an offset of the clocks, which would act at the gain crossover `rad_per_s`.
fn clock_unchecked(rad_per_s: f64) -> String {
    let (offset, deg) = cost_of_offset(rad_per_s);
    format!(
        "Nothing in this recording shows whether both columns come from one clock: each {offset} by which the input was \
         logged late cost {deg:.1} deg of phase margin. `input_late=0` says that they do."
    )
}

/// An offset of the clocks that a loop with the gain crossover `rad_per_s` feels, and the phase (deg) that it costs there.
fn cost_of_offset(rad_per_s: f64) -> (&'static str, f64) {
    // A loop of a plant with a crossover below 1 rad/s does not feel 5 ms.
    let (offset, offset_s) = match rad_per_s < 1.0 {
        true => ("second", 1.0),
        false => ("5 ms", 5e-3),
    };
    (offset, (offset_s * rad_per_s).to_degrees())
}

/// `later`: the offset of the clocks if the relay has this `beta` (s), and the phase margin then (rad).
fn clock(seen: f64, beta: f64, later: Option<(f64, Option<f64>)>, cost: &str) -> String {
    let ask = "State the relay's beta with `beta`, or give `input_late=0` if both columns come from one clock.";
    let Some((late_s, margin_rad)) = later else {
        return format!(
            "The relay switches as one with beta {seen:.2}, which no usual relay has.{cost} {ask}"
        );
    };
    // The relay of the board halves its beta where the output turns back.
    let halved = match beta < 0.0 && seen > 0.6 * beta {
        true => " A relay that turned back and halved its beta would look the same.",
        false => "",
    };
    let column = if late_s < 0.0 { "output" } else { "input" };
    let margin = match margin_rad {
        Some(margin) => format!("the phase margin would be {:.0} deg", margin.to_degrees()),
        None => "the loop would be unstable".to_owned(),
    };
    format!(
        "The relay switches as one with beta {seen:.2}. If it is one with beta {beta:.2}, the {column} was logged {} \
         late, and {margin}.{cost}{halved} {ask}",
        seconds(late_s.abs())
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    // A quarter turn is 90 deg; a factor of 1.5 is 3.5 dB.
    #[test]
    fn sentences_name_the_figures() {
        let clock = |late_s, phase_margin_rad| Remark::ClockUnknown {
            seen: -0.6,
            beta: -0.73,
            late_s,
            phase_margin_rad,
            rad_per_s: Some(20.0),
        };
        for (remark, words) in [
            (
                clock(Some(0.01), Some(std::f64::consts::FRAC_PI_2)),
                "the input was logged 10.0 ms late, and the phase margin would be 90 deg",
            ),
            (
                clock(Some(-0.002), None),
                "the output was logged 2.0 ms late, and the loop would be unstable",
            ),
            (clock(None, None), "Each 5 ms of an offset cost 5.7 deg."),
            (clock(None, None), "beta -0.60, which no usual relay has"),
            (
                Remark::ClockUnchecked { rad_per_s: 20.0 },
                "logged late cost 5.7 deg",
            ),
            (
                Remark::LittleGainMargin(1.5),
                "a factor of 1.5 only (3.5 dB)",
            ),
            (Remark::NoiseAtActuator(0.18), "18 % of the amplitude"),
            (
                Remark::InputPeak {
                    step: 0.2,
                    input: 1.0,
                },
                "above 0.2",
            ),
            (
                Remark::Extrapolated {
                    ratio: 1.75,
                    is_withdrawn: false,
                },
                "1.8 times",
            ),
            (
                Remark::Extrapolated {
                    ratio: 2.5,
                    is_withdrawn: true,
                },
                "No controller is given",
            ),
        ] {
            let sentence = sentence(&remark).unwrap();
            assert!(
                sentence.contains(words) && sentence.ends_with('.'),
                "{sentence}"
            );
        }
        assert_eq!(sentence(&Remark::NegativeGain), None);
    }
}
