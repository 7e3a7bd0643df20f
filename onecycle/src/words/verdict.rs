//! What to do about a verdict.

use std::borrow::Cow;
use std::f64::consts::TAU;

use crate::{DesignError, Parameter, Verdict};
use onecycle_onboard::refine::DomainEdge;

use crate::words::number::{frequency, short};

/// One sentence of advice, with the options of this program.
pub fn advice(verdict: &Verdict) -> Cow<'static, str> {
    match verdict {
        Verdict::NoInformation {
            informative_rad_per_s,
            needed_rad_per_s,
            ..
        } => excite(*informative_rad_per_s, *needed_rad_per_s).into(),
        Verdict::AtBound(parameter) => at_bound(*parameter).into(),
        Verdict::NoController(error) => without_controller(error).into(),
        Verdict::TooFewRows { .. }
        | Verdict::NoPrediction { .. }
        | Verdict::NotDriven
        | Verdict::UnstableInForce
        | Verdict::UnstableProcess { .. }
        | Verdict::NothingGrows
        | Verdict::SignNotTold
        | Verdict::InputLeft { .. } => of_record(verdict).into(),
        Verdict::SetPointLeft { .. } => of_record(verdict).into(),
        Verdict::OutputLeads { .. } | Verdict::OfController => of_record(verdict).into(),
        Verdict::NotExcited { .. } | Verdict::Calm { .. } => NOT_EXCITED.into(),
        _ => of_relay(verdict).into(),
    }
}

/// What to record instead of calm flight.
const NOT_EXCITED: &str = "Move the set-point: 30 s of quick stick movements on this axis, or a chirp of the rate set-point from 1 Hz to the \
     frequency at which the loop does not follow any more.";

/// Lowest frequency of a chirp, as a fraction of its highest, and its length in periods of the lowest: a chirp of 20 s
/// from 1 to 20 Hz.
const LOWEST: f64 = 1.0 / 20.0;
const PERIODS: f64 = 20.0;

/// Beyond this length (s) a process is moved by hand, in steps.
const LONGEST_CHIRP_S: f64 = 300.0;

/// What was excited, what is missing, and the test that excites it.
fn excite(informative_rad_per_s: Option<(f64, f64)>, needed_rad_per_s: f64) -> String {
    let excited = match informative_rad_per_s {
        None => "The input excites the process too little".to_owned(),
        Some((low, high)) => {
            let band = format!("{} to {}", frequency(low), frequency(high));
            if high >= needed_rad_per_s {
                return format!(
                    "The recording is informative from {band}, but too short or too noisy: raise the amplitude of the \
                     input, or record longer."
                );
            }
            format!("The recording is informative from {band} only")
        }
    };
    if !(needed_rad_per_s > 0.0 && needed_rad_per_s.is_finite()) {
        return format!("{excited}: raise the amplitude of the input, or record a chirp.");
    }
    let lowest = LOWEST * needed_rad_per_s;
    let length_s = PERIODS * TAU / lowest;
    if length_s > LONGEST_CHIRP_S {
        // Half a period of the highest frequency, and of a fourth of it.
        let half_period_s = 0.5 * TAU / needed_rad_per_s;
        return format!(
            "{excited}: step the input up and down ten times or more, after changing times from {} s to {} s.",
            short(half_period_s),
            short(4.0 * half_period_s),
        );
    }
    format!(
        "{excited}: record a chirp from {} to {} for {length_s:.0} s.",
        frequency(lowest),
        frequency(needed_rad_per_s)
    )
}

fn at_bound(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::Tau => {
            "Check that input and output share one clock and that the input column is the one that acts on this output; \
             if they do, excite the process at higher frequencies."
        }
        _ => {
            "Choose a simpler structure with `structure`, or record an input that excites the process at lower and at \
             higher frequencies."
        }
    }
}

fn without_controller(error: &DesignError) -> &'static str {
    match error {
        DesignError::Structure(_) => {
            "Choose a structure with a controller, such as `structure=soiptd`."
        }
        DesignError::Overflow => "Write the recording in other units.",
        _ => "Choose a smaller phase margin with `phase_margin`.",
    }
}

/// Verdicts of the likelihood.
fn of_record(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::TooFewRows { .. } => {
            "Record longer or at a higher rate, or use more of the recording with `from` and `to`."
        }
        Verdict::NotDriven => {
            "Excite the process with more frequencies, as a chirp or steps do, which tell a resonance from another cause; or give \
             the structure with `structure` if it is known."
        }
        Verdict::OutputLeads { .. } => {
            "The input was logged late, or it is what a controller makes of the output. Correct a known lateness with `input_late` (0: both \
             columns come from one clock); in a closed loop move the set-point while you record."
        }
        Verdict::OfController => {
            "Move the set-point, or add steps to the output of the controller, while you record."
        }
        Verdict::UnstableInForce => {
            "Fly quick manoeuvres or a chirp on this axis: noise that goes round the loop can pass for a process."
        }
        Verdict::UnstableProcess { .. } => {
            "If you know that it is, as of a magnet that holds a ball, `unstable` fits a model with an unstable pole; keep the \
             controller that runs. If it is not, look for a second input, or a drift that the controller follows."
        }
        Verdict::SignNotTold => {
            "Hold the levels of the input for different times, or begin with a single step from rest."
        }
        Verdict::NothingGrows => {
            "Leave `unstable` out; if the process is unstable, record at least 300 rows in closed loop, at even times and with quick \
             moves of the set-point."
        }
        Verdict::NoPrediction { .. } => {
            "Use a part of the recording in which the process stays the same, with `from` and `to`, and look for a \
             resonance, a saturated actuator, friction, or a second input."
        }
        _ => {
            "Try another structure with `structure`, and look for a resonance, a saturated actuator, friction, or a filter or \
             limit between the recorded input and the process."
        }
    }
}

/// Verdicts of the estimator of steady oscillations, and those on the columns.
fn of_relay(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::ConstantInput => {
            "Choose the column that holds the input of the process with `input`; if the step came before the first row, \
             give the input before it with `input_before`. Otherwise record a relay test, steps or a chirp."
        }
        Verdict::ConstantOutput => {
            "Choose the column that holds the measurement with `output`, or check the sensor."
        }
        Verdict::Units => "Write the recording in other units.",
        Verdict::NoRelay {
            output_is_relay: true,
        } => {
            "Swap the columns: give the relay's column with `input` and the measurement with `output`."
        }
        Verdict::NoRelay {
            output_is_relay: false,
        } => {
            "Record the relay's own output, before any filter or rate limit, and choose it with `input`."
        }
        Verdict::FewSwitches { .. } => {
            "Check that the relay acts on the measurement and that the process follows it, then record at least four \
             cycles."
        }
        Verdict::TooShort { .. } => "Record at least four cycles of steady oscillation.",
        Verdict::NotSteady { .. } => {
            "Let the oscillation settle, keep gusts and set-point changes out of the test, or raise the relay's \
             amplitude above the noise."
        }
        Verdict::TooCoarse { .. } => {
            "Record at a higher rate: at least 16 samples a cycle, better 50 or more."
        }
        Verdict::Saturated { .. } => {
            "Lower the relay's amplitude or widen the sensor's range, and repeat the test."
        }
        Verdict::NotThisProcess { .. } => {
            "Look for a resonance, friction, wind, or another loop at work: the process is not an integrator with two \
             lags and a delay. For a self-regulating process (flow, temperature) give `structure=foptd` or `structure=soptd`."
        }
        Verdict::Unknown { .. } => {
            "Leave out `method=classify`, choose a pack of this family with `pack`, or look for a resonance, friction, \
             or a wrong sensor."
        }
        Verdict::TooUncertain => {
            "Excite the process more strongly or longer (a relay test: a larger amplitude, more cycles): the intervals \
             are too wide for a controller that is surely stable."
        }
        Verdict::EdgeOfDomain(DomainEdge::SlowLags) => {
            "Check that the output is a position and not its rate: both lags appear longer than the period."
        }
        Verdict::EdgeOfDomain(DomainEdge::FastLag) => {
            "Check that the output is a position and not its rate, and that the sample rate is high enough: no actuator \
             lag is visible."
        }
        Verdict::EdgeOfDomain(DomainEdge::LongDelay) => {
            "Check that input and output share one clock: the delay appears longer than half a period."
        }
        Verdict::ClockOffset { .. } => {
            "Correct a known offset with `input_late`. If both columns come from one clock, give `input_late=0`, or the \
             right `beta`."
        }
        Verdict::AmplitudeDependent(_) => {
            "Look for a dead zone, backlash, friction or saturation of the actuator, and test at the amplitudes at which \
             the controller will work."
        }
        Verdict::NoFit => "Check the choice of columns: the output does not follow the input.",
        // Facts that this program does not know yet.
        _ => "Record a relay test of at least four cycles, or a chirp.",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn without_information(band_hz: Option<(f64, f64)>, needed_hz: f64) -> String {
        let verdict = Verdict::NoInformation {
            parameter: Parameter::TProp,
            deviation: Some(0.8),
            informative_rad_per_s: band_hz.map(|(low, high)| (TAU * low, TAU * high)),
            needed_rad_per_s: TAU * needed_hz,
        };
        advice(&verdict).into_owned()
    }

    // A deviation above the value itself is no measure of it.
    #[test]
    fn a_parameter_that_may_be_anything_has_no_deviation() {
        let of = |deviation| Verdict::NoInformation {
            parameter: Parameter::K,
            deviation: Some(deviation),
            informative_rad_per_s: None,
            needed_rad_per_s: 1.0,
        };
        assert!(
            of(0.54)
                .to_string()
                .ends_with("of the gain is 54 % of its value")
        );
        assert!(of(39.0).to_string().ends_with("does not tell the gain"));
    }

    // A chirp up to 20 Hz begins at 1 Hz; 20 periods of 1 Hz are 20 s. A slow process is stepped: half a period of 0.02 Hz is 25 s.
    #[test]
    fn the_missing_excitation_is_a_chirp_or_steps() {
        assert_eq!(
            without_information(Some((0.13, 2.31)), 20.0),
            "The recording is informative from 0.13 Hz to 2.3 Hz only: record a chirp from 1.0 Hz to 20 Hz for 20 s."
        );
        assert_eq!(
            without_information(None, 0.02),
            "The input excites the process too little: step the input up and down ten times or more, after changing times \
             from 25.0 s to 100 s."
        );
    }

    // Where the band is wide enough, a chirp is no help: there is too much noise. No sentence names NaN.
    #[test]
    fn a_band_that_is_wide_enough_needs_less_noise() {
        let noisy = without_information(Some((0.1, 30.0)), 20.0);
        assert!(
            noisy.ends_with("raise the amplitude of the input, or record longer."),
            "{noisy}"
        );
        for needed_hz in [f64::NAN, 0.0, f64::INFINITY] {
            let advice = without_information(None, needed_hz);
            assert!(advice.ends_with("or record a chirp."), "{advice}");
        }
    }

    // Every verdict of the likelihood has advice of its own, in one sentence.
    #[test]
    fn every_verdict_on_a_record_has_advice() {
        let verdicts = [
            Verdict::TooFewRows {
                rows: 10,
                needed: 20,
            },
            Verdict::AtBound(Parameter::Tau),
            Verdict::AtBound(Parameter::TProp),
            Verdict::NoPrediction {
                explained: 0.2,
                horizon_s: 0.5,
            },
            Verdict::InputLeft { share: 0.3 },
            Verdict::UnstableInForce,
            Verdict::NotDriven,
            Verdict::OutputLeads { share: 0.3 },
            Verdict::OfController,
            Verdict::UnstableProcess { growth_per_s: 56.0 },
            Verdict::NothingGrows,
            Verdict::SignNotTold,
            Verdict::NoController(DesignError::Structure(crate::Structure::Foptd)),
            Verdict::NoController(DesignError::PhaseMargin(2.0)),
        ];
        let all = verdicts.map(|verdict| advice(&verdict).into_owned());
        for (k, one) in all.iter().enumerate() {
            assert!(one.ends_with('.') && !all[..k].contains(one), "{one}");
        }
    }
}
