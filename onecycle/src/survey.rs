//! Every loop of a flight, from the parts worth using.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use onecycle_design::{Parameter, Specification, Structure};
use onecycle_identify::progress::{one_of, part};
use onecycle_identify::{Identification, Identified, Verdict};
use onecycle_link::{Change, ControlLoop, Flight, Recording, Signals, Span};

use crate::answer;
use crate::builder::Identify;
use crate::error::Error;
use crate::log_gains::{self, LogLoop};
use crate::request::Request;
use crate::results::answer::{Advice, Answer};
use crate::results::controllers::Controllers;
use crate::results::flight::{FlightLoop, Found, Part, Refusal, Shown, Survey};
use crate::source::{LogFile, Source};
use crate::threads::each;
use crate::words::answer::refused;
use crate::words::flight as words;
use crate::words::log::{loss, of_firmware};
use crate::words::units::Units;

/// Largest ratio of the ends of the interval of a part's gain.
const MOST_RATIO: f64 = 2.0;

/// Share of the time of a loop in which its process is identified.
const IDENTIFIED: f64 = 0.8;

/// How a survey is made.
pub(crate) struct Manner<'a> {
    /// Whether all that a page shows of the gains is made.
    pub(crate) has_pages: bool,
    /// Told the number of loops that are done, of how many.
    pub(crate) progress: &'a (dyn Fn(usize, usize) + Sync),
}

/// Every loop of a flight, and the parameters of those to change if they are to be written.
pub(crate) fn survey(
    source: &dyn Source,
    request: &Request,
    asked: &Specification,
    manner: &Manner<'_>,
) -> Result<Survey, Error> {
    let file = LogFile::scan(source)?;
    let number = file.flight(request.flight);
    let is_damaged = file.log.loss.is_truncated || file.log.loss.bytes_skipped > 0;
    let mut surveyed = Survey {
        file: source.name(),
        number,
        firmware: String::new(),
        // What the logger itself dropped is in no copy of the file.
        lost: loss(&file.log.loss).filter(|_| is_damaged),
        ending: None,
        loops: vec![],
        files: None,
    };
    let Some(flight) = file.log.flights.get(number.saturating_sub(1)) else {
        // The error names the flights that there are.
        file.signals(number, ControlLoop::ALL[0])?;
        return Ok(surveyed);
    };
    surveyed.firmware = of_firmware(&flight.firmware);
    surveyed.ending = flight.firmware.kind.parameter_ending();
    let complete = flight.loops.iter().filter(|one| one.is_complete());
    let loops: Vec<ControlLoop> = complete.map(|one| one.control_loop).collect();
    let (all, done) = (loops.len(), AtomicUsize::new(0));
    let loops = each(loops.into_iter().enumerate().collect(), |(at, of)| {
        let of_log = LogLoop::new(flight.clone(), of);
        let found = one_of(at, all, || {
            of_loop((&file, number), of_log, (request, asked), manner.has_pages)
        });
        (manner.progress)(done.fetch_add(1, Relaxed) + 1, all);
        found
    });
    surveyed.loops = loops.into_iter().collect::<Result<_, _>>()?;
    if let Some(path) = &request.write.file {
        let to_write = (surveyed.loops.iter()).filter_map(|one| one.to_write.as_ref());
        let changes: Vec<Change> = (to_write.filter_map(|one| one.as_ref().ok()))
            .flat_map(|written| written.changes.clone())
            .collect();
        surveyed.files = log_gains::named_files(path, flight, &changes);
    }
    Ok(surveyed)
}

fn of_loop(
    (file, number): (&LogFile<'_>, usize),
    mut of_log: LogLoop,
    (request, asked): (&Request, &Specification),
    has_pages: bool,
) -> Result<FlightLoop, Error> {
    let file_name = file.name();
    let signals = file.signals(number, of_log.control_loop())?;
    let asked = of_log.specification(*asked, false);
    let (mut one, mut shown) = part(0.0..IDENTIFIED, || parts(&signals, of_log.flight(), &asked));
    if one.best().is_some() {
        of_log = of_log.with_read_back(file, number)?;
    }
    while let Some((at, of)) = one.best().and_then(|at| Some((at, shown.get_mut(at)?))) {
        let Ok(best) = &of.identification.outcome else {
            break;
        };
        let mut choice = Controllers::of_identified(best, of_log.in_force());
        if of_log.contradicts(&choice) {
            one.parts[at].outcome = Err(Refusal::Verdict(Verdict::UnstableInForce));
            of.identification.refuse(Verdict::UnstableInForce);
            continue;
        }
        let answer = answer::of_identified(
            best,
            &answer::Subject {
                file: &file_name,
                units: &Units::default(),
                choice: Some(&choice),
                of_log: Some(&of_log),
                gains: None,
                share: request.write.step,
            },
        );
        if request.write.file.is_some() && answer.verdict == Advice::Change {
            one.to_write = Some(of_log.judged(&request.write, Some(best), Some(&choice)));
        }
        if has_pages {
            let gains = of_log.gains(&of.recording, &of.identification, Some(&choice));
            choice = choice.with_trade_off(&best.for_design(0).0);
            of.gains = Some(gains);
        }
        one.answer = answer;
        one.choice = Some(choice);
        break;
    }
    let at = one.best();
    one.shown = shown.into_iter().nth(at.unwrap_or(0));
    if at.is_none() {
        one.answer = none_told(&one);
    }
    Ok(one)
}

/// The answer where no part tells anything.
fn none_told(one: &FlightLoop) -> Answer {
    Answer {
        next: (one.refusal()).map_or_else(String::new, |verdict| refused(verdict).1),
        ..Answer::not_yet(words::none_told(&one.parts))
    }
}

/// The part of a flight that tells most about a loop, as in the table of all loops, with how and what was identified from it; if none
/// tells anything, from the first part to the last. `None`: no part is worth using.
pub(crate) fn best_part(
    signals: &Signals,
    flight: &Flight,
    asked: &Specification,
) -> Option<(Span, Option<(Identify<'static>, Identification)>)> {
    let (one, shown) = parts(signals, flight, asked);
    let spans = one.parts.iter().map(|part| part.span);
    match one.best() {
        Some(best) => {
            let how = manner(*asked, signals.control_loop);
            let found = shown.into_iter().nth(best);
            let found = found.map(|of| (how, of.identification));
            Some((one.parts[best].span, found))
        }
        None => Some((spans.reduce(Span::with)?, None)),
    }
}

/// How the parts of a flight are identified.
fn manner(asked: Specification, of: ControlLoop) -> Identify<'static> {
    let structure = log_gains::structure(of);
    Identify::new().specification(asked).structure(structure)
}

/// A loop with the parts of the flight worth using, and what was identified from each.
fn parts(signals: &Signals, flight: &Flight, asked: &Specification) -> (FlightLoop, Vec<Shown>) {
    let spans = flight.stretches(signals);
    let numbered = spans.iter().copied().enumerate().collect();
    let all = each(numbered, |(at, span)| {
        let shown = one_of(at, spans.len(), || identified(&signals.part(span), asked));
        Some((span, shown?))
    });
    let mut all: Vec<(Span, Shown)> = all.into_iter().flatten().collect();
    // What no part tells alone, the response to the set-point over all of the flight may tell. A fit to the input that no part
    // confirms is not taken.
    let is_refused = |(_, shown): &(_, Shown)| shown.identification.outcome.is_err();
    if spans.len() > 1 && all.iter().all(is_refused) {
        let whole = spans.iter().fold(spans[0], |all, span| all.with(*span));
        all.extend(by_response(&signals.part(whole), asked).map(|shown| (whole, shown)));
    }
    let part = |(span, shown): &(Span, Shown)| {
        let found = match &shown.identification.outcome {
            Ok(identified) => {
                let input = shown.recording.input();
                let mean_input = input.iter().sum::<f64>() / input.len() as f64;
                let found = found(identified).ok_or(Refusal::Verdict(Verdict::TooUncertain));
                found.and_then(|found| plausible(found, signals.control_loop, mean_input))
            }
            Err(verdict) => Err(Refusal::Verdict(verdict.clone())),
        };
        Part {
            span: *span,
            outcome: found,
        }
    };
    let parts = all.iter().map(part).collect();
    let one = FlightLoop {
        control_loop: signals.control_loop,
        units: signals.units,
        parts,
        choice: None,
        answer: Answer::not_yet(String::new()),
        to_write: None,
        shown: None,
    };
    (one, all.into_iter().map(|(_, shown)| shown).collect())
}

/// What was identified from a part. `None`: its signals make no recording.
fn identified(part: &Signals, asked: &Specification) -> Option<Shown> {
    let recording = part.recording().ok()?;
    let identification = manner(*asked, part.control_loop).run(&recording);
    Some(shown(recording, identification))
}

/// What the response to the set-point tells of a part. `None`: nothing.
fn by_response(part: &Signals, asked: &Specification) -> Option<Shown> {
    let recording = part.recording().ok()?;
    let identification = manner(*asked, part.control_loop).run_on_response(&recording)?;
    let shown = shown(recording, identification);
    shown.identification.outcome.is_ok().then_some(shown)
}

/// Of several parts one that knows its gain to less than a factor of two tells nothing.
fn shown(recording: Recording, mut identification: Identification) -> Shown {
    let tells = |found: &Identified| {
        let gain = found.effectiveness();
        gain.is_none_or(|[low, _, high]| high < MOST_RATIO * low)
    };
    let found = identification.outcome.as_ref();
    if found.is_ok_and(|found| !tells(found)) {
        identification.refuse(Verdict::TooUncertain);
    }
    Shown {
        recording,
        identification,
        gains: None,
    }
}

/// What is shown of a process. `None`: its gain has no interval.
fn found(identified: &Identified) -> Option<Found> {
    let structure = identified.model.structure();
    let value = |parameter: Parameter| identified.estimate.get(parameter)?.estimate;
    let mut late = vec![Parameter::TProp, Parameter::TProp2, Parameter::Tau];
    if structure.stages().integrators > 0 {
        // Behind the integrator, the body is one lag more of the acceleration.
        late.push(Parameter::TBody);
    }
    let lags_s = late.into_iter().filter_map(value);
    Some(Found {
        structure,
        gain: identified.effectiveness()?,
        delay_s: lags_s.sum::<f64>() + slow_pair_s(structure, &value),
    })
}

/// Refuses a gain that the loop of a vehicle cannot have: the firmware's signs make every gain positive, an angle is the
/// integral of the rate, and the mean thrust of a flight carries the weight while thrust grows at least in proportion to the
/// command.
fn plausible(found: Found, of: ControlLoop, mean_input: f64) -> Result<Found, Refusal> {
    const GRAVITY: f64 = 9.81;
    // The drag of a climb, which the structure leaves out, makes the estimate low, its interval less.
    const DRAG: f64 = 0.7;
    let [_, gain, high] = found.gain;
    let (expected, is_low) = match of {
        ControlLoop::Rate(_) => ((0.0, f64::INFINITY), gain <= 0.0),
        ControlLoop::Attitude(_) => ((0.7, 1.4), gain <= 0.7),
        _ => {
            let expected = (0.85 * GRAVITY / mean_input, 1.7 * GRAVITY / mean_input);
            let is_low = high <= expected.0 || gain <= DRAG * expected.0;
            (expected, is_low)
        }
    };
    if is_low || gain >= expected.1 {
        let gain = found.gain;
        return Err(Refusal::Implausible { gain, expected });
    }
    Ok(found)
}

/// Delay (s) of a resonance at low frequencies.
fn slow_pair_s(structure: Structure, value: &impl Fn(Parameter) -> Option<f64>) -> f64 {
    match structure {
        Structure::Resonant | Structure::ResonantLag => {
            let (zeta, frequency) = (value(Parameter::Zeta), value(Parameter::NaturalFrequency));
            zeta.zip(frequency)
                .map_or(0.0, |(zeta, w0)| 2.0 * zeta / w0)
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use onecycle_design::Linear;
    use onecycle_plant::{Disturbances, FixedStepLinear, Noise, NoiseSource};

    use super::*;

    /// A rate loop of this structure: its input changes every 0.2 s for a minute.
    fn identified(structure: Structure, values: &[(Parameter, f64)]) -> Identified {
        const STEP_S: f64 = 0.004;
        let value = |asked: Parameter| {
            let given = values.iter().find(|(parameter, _)| *parameter == asked);
            given.map(|(_, value)| *value)
        };
        let process = Linear::from_parameters(structure, value).unwrap();
        let mut noise = Noise::from_seed(1);
        let none = Disturbances::default();
        let mut process = FixedStepLinear::new(&process, &none, STEP_S, &mut noise);
        let (mut time_s, mut input, mut output) = (vec![], vec![], vec![]);
        let mut u = 0.0;
        for k in 0..15_000_u32 {
            if k % 50 == 0 {
                u = 0.1 * noise.standard_normal();
            }
            time_s.push(f64::from(k) * STEP_S);
            input.push(u);
            output.push(process.output() + 0.02 * noise.standard_normal());
            process.step(u, &mut noise);
        }
        let signals = onecycle_identify::Signals {
            time_s: &time_s,
            input: &input,
            output: &output,
            samples_per_point: 1,
            sample_period_s: STEP_S,
            breaks: &[],
        };
        let options = onecycle_identify::Options::default().structure(Some(structure));
        onecycle_identify::identify(&signals, &options)
            .outcome
            .unwrap()
    }

    // 100 rad/s^2 of full torque whatever the structure: K of an integrator, K/T_body of a damped body, and K w0 / (2 zeta) where the
    // lags make a resonance. The table showed K/T_body of an integrator with two lags (rad/s^3) and K of a resonance (rad/s).
    #[test]
    fn gains_of_all_structures_are_angular_accelerations() {
        use Parameter::{K, NaturalFrequency, TBody, TProp, TProp2, Tau, Zeta};
        for (structure, values) in [
            (Structure::Iptd, vec![(K, 100.0), (Tau, 0.02)]),
            (
                Structure::IntegratorLag,
                vec![(K, 100.0), (TProp, 0.03), (Tau, 0.02)],
            ),
            (
                Structure::Soiptd,
                vec![(K, 100.0), (TProp, 0.03), (TBody, 0.1), (Tau, 0.02)],
            ),
            (
                Structure::Toiptd,
                vec![
                    (K, 100.0),
                    (TProp, 0.06),
                    (TProp2, 0.02),
                    (TBody, 0.15),
                    (Tau, 0.02),
                ],
            ),
            (Structure::Foptd, vec![(K, 80.0), (TBody, 0.8), (Tau, 0.02)]),
            (
                Structure::Soptd,
                vec![(K, 80.0), (TProp, 0.03), (TBody, 0.8), (Tau, 0.02)],
            ),
            (
                Structure::Resonant,
                vec![
                    (K, 10.0),
                    (NaturalFrequency, 10.0),
                    (Zeta, 0.5),
                    (Tau, 0.02),
                ],
            ),
        ] {
            let found = found(&identified(structure, &values)).unwrap();
            let [low, gain, high] = found.gain;
            assert_eq!(found.structure, structure);
            assert!((gain / 100.0 - 1.0).abs() < 0.05, "{structure:?} {gain}");
            assert!(
                low <= gain && gain <= high && high < 1.3 * low,
                "{structure:?} {low} {high}"
            );
        }
    }

    // A vehicle that hovers at 0.5 has 19.6 m/s^2 for all of the thrust if thrust is in proportion to the command.
    #[test]
    fn thrust_carries_the_weight() {
        let is_taken = |gain: [f64; 3]| {
            let found = Found {
                structure: Structure::IntegratorLag,
                gain,
                delay_s: 0.0,
            };
            plausible(found, ControlLoop::Altitude, 0.5).is_ok()
        };
        assert!(is_taken([18.0, 20.0, 22.0]));
        assert!(is_taken([9.0, 13.0, 21.0]));
        assert!(!is_taken([10.0, 13.0, 16.0]));
        assert!(!is_taken([5.0, 8.0, 21.0]));
        assert!(!is_taken([30.0, 35.0, 40.0]));
    }
}
