//! The road of a steady relay oscillation: find the relay and its cycles, fit the process to the last ones, judge the
//! fit, design. It is what the board does, off board.

pub mod input;
mod oscillation;
pub mod reading;
mod saturation;

use onecycle_design::decision::{self, Decision};
use onecycle_design::{pd, step_response};
use onecycle_onboard::judgement::{MOST_MISFIT, largest_response_error, misfit};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::refine::{PriorKnowledge, RefineError, Refined, ShapePrior, refine_with};

use self::input::{InputKind, RelayInput};
use self::oscillation::{FitWindow, Oscillation, Past};
use self::reading::Reading;
use crate::outcome::{Identification, Identified, OscillationFound};
use crate::posterior::Posterior;
use crate::remark::{self, Remark};
use crate::signals::Signals;
use crate::verdict::Verdict;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Most cycles to fit; [`MOST_CYCLES`] is the limit.
    pub cycles: usize,
    /// Least phase margin of the controller (rad).
    pub phase_margin_rad: f64,
    /// How the process is found.
    pub method: Method,
}

/// How the process is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Method {
    /// By the pack's network alone, from the last cycle.
    Classify,
    /// By least squares, with no pack.
    Refine,
    /// The most probable process: least squares from where the pack's network points to, with what the
    /// pack knows of its family.
    #[default]
    Map,
}

/// Most cycles that the window holds.
pub const MOST_CYCLES: usize = 50;

impl Default for Options {
    /// Eight cycles; the paper's phase margin of 20 degrees.
    fn default() -> Self {
        Self {
            cycles: 8,
            phase_margin_rad: 20_f64.to_radians(),
            method: Method::default(),
        }
    }
}

/// Identifies the process behind a recorded relay test, with the pack that is built in.
#[must_use]
pub fn identify(signals: &Signals<'_>, options: &Options) -> Identification {
    identify_by(signals, options, Pack::embedded().ok().as_ref())
}

/// The same with a pack of one's own, or none.
#[must_use]
pub fn identify_by(
    signals: &Signals<'_>,
    options: &Options,
    pack: Option<&Pack<'_>>,
) -> Identification {
    let pack = pack.filter(|_| options.method != Method::Refine);
    let mut found = Identification {
        oscillation: None,
        reading: None,
        outcome: Err(Verdict::NoFit),
        remarks: vec![],
    };
    found.outcome = find_relay(signals).and_then(|relay| {
        let most = options.cycles.clamp(1, MOST_CYCLES);
        let mut refusal = None;
        for oscillation in oscillation::candidates(signals, &relay, most)? {
            let (window, reading) = look(signals, &relay, &oscillation, pack);
            let described = describe(signals, &oscillation, &relay, &window);
            let saw = Seen {
                signals,
                oscillation: &oscillation,
                window: &window,
                reading: reading.as_ref(),
            };
            let outcome = attempt(&saw, pack, options);
            // A stretch that fits where a longer one did not is believed when it is a good one.
            let outcome = outcome.and_then(|identified| match &refusal {
                Some(_) if identified.refined.response_error > MOST_ERROR_OF_SECOND_CHOICE => {
                    Err(Verdict::NotThisProcess {
                        misfit: identified.misfit,
                    })
                }
                _ => Ok(identified),
            });
            match outcome {
                Ok(identified) => {
                    found.oscillation = Some(described);
                    found.reading = reading;
                    if let Some(Verdict::NotThisProcess { misfit }) = refusal {
                        found.remarks.push(Remark::Disturbed(misfit));
                    }
                    return Ok(identified);
                }
                Err(verdict) => {
                    found.oscillation.get_or_insert(described);
                    found.reading = found.reading.or(reading);
                    refusal.get_or_insert(verdict);
                }
            }
        }
        Err(refusal.unwrap_or(Verdict::NoFit))
    });
    let remarks = remark::remarks(&found, options, pack.is_some());
    found.remarks.extend(remarks);
    found
}

/// The window of an oscillation, and what the pack reads off its last cycle. Where that cycle is the only
/// one and known, so one of a steady oscillation, the input is taken to have repeated itself before the
/// recording: of 200 multirotors with 1 % noise the controllers then cost 0.17 % too much instead of 0.40 %.
fn look(
    signals: &Signals<'_>,
    relay: &RelayInput,
    oscillation: &Oscillation,
    pack: Option<&Pack<'_>>,
) -> (FitWindow, Option<Reading>) {
    let window = oscillation.window(signals, relay, Past::Held);
    let reading = pack.and_then(|pack| Reading::of(signals, relay, oscillation, &window, pack));
    let is_known = reading.as_ref().is_some_and(Reading::is_known);
    if oscillation.is_alone() && is_known {
        (oscillation.window(signals, relay, Past::Repeated), reading)
    } else {
        (window, reading)
    }
}

/// The steady oscillation that [`identify`] looks at first, its last `cycles` at most.
///
/// # Errors
/// The verdict that [`identify`] would give: no relay, too short, not steady.
pub fn find_oscillation(signals: &Signals<'_>, cycles: usize) -> Result<OscillationFound, Verdict> {
    let relay = find_relay(signals)?;
    let stretches = oscillation::candidates(signals, &relay, cycles.clamp(1, MOST_CYCLES))?;
    let first = stretches.first().ok_or(Verdict::TooShort { cycles: 0 })?;
    let window = first.window(signals, &relay, Past::Held);
    Ok(describe(signals, first, &relay, &window))
}

/// Relative error of the response above which a stretch is no second choice: a gust leaves the short
/// stretch between two a good one, a resonance is in every stretch.
const MOST_ERROR_OF_SECOND_CHOICE: f64 = 0.05;

/// One stretch of the recording.
struct Seen<'a> {
    signals: &'a Signals<'a>,
    oscillation: &'a Oscillation,
    window: &'a FitWindow,
    reading: Option<&'a Reading>,
}

/// Fits and judges a stretch.
fn attempt(
    seen: &Seen<'_>,
    pack: Option<&Pack<'_>>,
    options: &Options,
) -> Result<Identified, Verdict> {
    let (oscillation, window) = (seen.oscillation, seen.window);
    let output = &seen.signals.output[oscillation.points(seen.signals)];
    if let Some(part) = saturation::flat_part(output, oscillation.cycles.len()) {
        return Err(Verdict::Saturated { part });
    }
    let known = seen.reading.filter(|reading| reading.is_known());
    let refined = if options.method == Method::Classify {
        let reading = known.ok_or(Verdict::Unknown {
            score: seen.reading.map(|reading| reading.classification.score),
        })?;
        reading.as_fit(window).map_err(|_| Verdict::NoFit)?
    } else {
        let period_s = oscillation.period_s;
        let starts = known.map(|reading| reading.classification.starts(period_s));
        let beforehand = PriorKnowledge {
            starts: starts.as_ref().map_or(&[], |starts| starts),
            prior: pack
                .filter(|_| known.is_some())
                .and_then(ShapePrior::of_pack),
        };
        refine_with(window, period_s, &beforehand).map_err(|error| match error {
            RefineError::TooFewBins(points) => Verdict::TooCoarse { points },
            _ => Verdict::NoFit,
        })?
    };
    design(&refined, window, oscillation.period_s, options)
}

/// Sizes of signals whose squares and their sums are far from the limits of f64.
const SIZES: std::ops::Range<f64> = 1e-100..1e100;

fn find_relay(signals: &Signals<'_>) -> Result<RelayInput, Verdict> {
    for signal in [signals.input, signals.output] {
        let size = signal
            .iter()
            .fold(0.0_f64, |most, value| most.max(value.abs()));
        if size != 0.0 && !SIZES.contains(&size) {
            return Err(Verdict::Units);
        }
    }
    match input::find(signals.input) {
        InputKind::Relay(_) if signals.output.windows(2).all(|pair| pair[0] == pair[1]) => {
            Err(Verdict::ConstantOutput)
        }
        InputKind::Relay(relay) => Ok(relay),
        InputKind::Constant => Err(Verdict::ConstantInput),
        InputKind::NotTwoLevels => {
            let output_is_relay = matches!(input::find(signals.output), InputKind::Relay(_));
            Err(Verdict::NoRelay { output_is_relay })
        }
    }
}

fn describe(
    signals: &Signals<'_>,
    oscillation: &Oscillation,
    relay: &RelayInput,
    window: &FitWindow,
) -> OscillationFound {
    let cycles = &oscillation.cycles;
    let mean = |of: fn(&onecycle_onboard::cycle::Cycle) -> f64| {
        cycles.iter().map(of).sum::<f64>() / cycles.len() as f64
    };
    let (low, high) = relay.means(&signals.input[oscillation.points(signals)]);
    OscillationFound {
        period_s: oscillation.period_s,
        amplitude: mean(|cycle| cycle.amplitude),
        cycles_used: cycles.len(),
        cycles_steady: oscillation.steady,
        start_s: cycles[0].start_s,
        end_s: cycles[cycles.len() - 1].start_s + cycles[cycles.len() - 1].period_s,
        duty: mean(|cycle| cycle.duty),
        relay_amplitude: 0.5 * (high - low),
        relay_centre: 0.5 * (high + low),
        noise_sigma: window.noise_sigma(),
        sample_s: window.sample_s(),
    }
}

fn design(
    refined: &Refined,
    window: &FitWindow,
    period_s: f64,
    options: &Options,
) -> Result<Identified, Verdict> {
    let misfit = misfit(refined, window);
    let most_error = largest_response_error(options.phase_margin_rad);
    if misfit > MOST_MISFIT || refined.response_error > most_error {
        return Err(Verdict::NotThisProcess { misfit });
    }
    if let Some(edge) = refined.edge {
        return Err(Verdict::EdgeOfDomain(edge));
    }
    let optimum = pd(&refined.process, options.phase_margin_rad)
        .map_err(|error| Verdict::NoController(error.to_string()))?;
    let posterior = Posterior::new(refined, window.sample_s());
    // An error of the model widens the intervals, but is no distribution to choose a controller from.
    let draws = if refined.response_error > 0.0 {
        vec![]
    } else {
        posterior.processes(decision::DRAWS)
    };
    let controller =
        Decision::new(&draws, options.phase_margin_rad).controller(&refined.process, optimum);
    let phase_margin_rad = posterior.phase_margin_rad(controller.pd);
    if phase_margin_rad.low.is_none_or(|low| low <= 0.0) {
        return Err(if refined.response_error > 0.0 {
            Verdict::NotThisProcess { misfit }
        } else {
            Verdict::TooUncertain
        });
    }
    let process = posterior.process();
    Ok(Identified {
        refined: *refined,
        joint_probability: posterior.joint_probability(&process),
        process,
        phase_margin_rad,
        controller,
        step: step_response(&refined.process, controller.pd)
            .ok()
            .map(|step| step.metrics),
        misfit,
        fit: oscillation::fit_points(window, period_s, refined),
    })
}
