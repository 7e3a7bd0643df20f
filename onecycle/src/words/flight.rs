//! Sentences about the control loops of a flight.

use onecycle_link::ControlLoop;

use crate::results::flight::{Part, Refusal};
use crate::words::number::short;
use crate::words::units::ratio;

pub const NOTHING_LOGGED: &str =
    "The log has input and output of no control loop. `log FILE` says what to log.";
pub const NO_PART: &str = "No part of the flight can be used: the vehicle was not armed and in the air for 5 s, or \
                                  the actuator was at its limit.";
const NO_PART_IN_BRIEF: &str = "no part of the flight can be used";
pub const MORE: &str = "Process, parts and other figures: `details`; one loop: `axis=AXIS`";
pub const DISAGREE: &str = "The parts disagree by more than their intervals: the process changed in flight (battery, \
                                   throttle, load). Design for the part in which the vehicle has to be stable first.";

/// What to do with a loop that was identified.
pub fn next(file: &str) -> String {
    format!(
        "The interval of a loop holds those of its parts. Gains, delay and margins are those of the part with the narrowest \
         interval. The whole report of a loop: `identify {file}` `axis=AXIS` `loop=LOOP` `from=S` `to=S`; with \
         `write=FILE` it writes the parameters."
    )
}

/// Why a part tells nothing, in a few words.
pub fn brief(refusal: &Refusal) -> String {
    match refusal {
        Refusal::Implausible { .. } => {
            "the gain that was found is impossible for this loop".to_owned()
        }
        Refusal::Verdict(verdict) => {
            let clause = verdict.to_string();
            clause.split(':').next().unwrap_or_default().to_owned()
        }
    }
}

/// What to do where no loop is told. `lost`: what the file has lost.
pub fn no_loop(lost: Option<&str>) -> String {
    let again = lost.map_or(String::new(), |lost| {
        format!("The file is damaged ({lost}): copy it from the vehicle again. ")
    });
    format!(
        "{again}Fly a chirp, or 30 s of quick stick movements on each axis. What each part of this flight told: `details`."
    )
}

/// Why no part of a flight tells anything about a loop.
pub(crate) fn none_told(parts: &[Part]) -> String {
    let mut refusals = parts.iter().filter_map(|part| part.outcome.as_ref().err());
    let reason = refusals.next().map(brief);
    reason.unwrap_or_else(|| NO_PART_IN_BRIEF.to_owned())
}

/// A gain that the loop cannot have.
pub fn implausible(gain: [f64; 3], (low, high): (f64, f64)) -> String {
    let range = match high.is_finite() {
        true => format!("{} to {}", short(low), short(high)),
        false => format!("more than {}", short(low)),
    };
    format!(
        "Not the process: the gain found is {} ({} .. {}), and this loop of a vehicle can have {range}.",
        short(gain[1]),
        short(gain[0]),
        short(gain[2])
    )
}

/// Heading of a loop.
pub fn title(of: ControlLoop) -> String {
    let name = of.to_string();
    let mut letters = name.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// Unit of the rate of change of an output per unit of input.
pub fn gain_unit([input, output]: [&str; 2]) -> String {
    ratio(output, input, 1)
}
