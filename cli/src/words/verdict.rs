//! What to do about a verdict.

use onecycle::Verdict;
use onecycle_onboard::refine::DomainEdge;

/// One sentence of advice, with the options of this program.
pub(crate) fn advice(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::ConstantInput => {
            "Choose the column that holds the relay's output with --input, or record a relay test."
        }
        Verdict::ConstantOutput => {
            "Choose the column that holds the measurement with --output, or check the sensor."
        }
        Verdict::Units => "Write the recording in other units.",
        Verdict::NoRelay {
            output_is_relay: true,
        } => {
            "Swap the columns: give the relay's column with --input and the measurement with --output."
        }
        Verdict::NoRelay {
            output_is_relay: false,
        } => {
            "Record the relay's own output, before any filter or rate limit, and choose it with --input."
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
             lags and a delay."
        }
        Verdict::Unknown { .. } => {
            "Leave out --method classify, choose a pack of this family with --pack, or look for a resonance, friction, \
             or a wrong sensor."
        }
        Verdict::TooUncertain => {
            "Use more cycles or a larger relay amplitude: the intervals are too wide for a controller that is surely \
             stable."
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
        Verdict::NoFit => "Check the choice of columns: the output does not follow the input.",
        Verdict::NoController(_) => "Choose a smaller phase margin with --phase-margin.",
        // Facts that this program does not know yet.
        _ => "Record at least four cycles of a relay test.",
    }
}
