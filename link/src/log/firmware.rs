//! What the tables of a log mean: one file for each firmware.

mod ardupilot;
mod betaflight;
mod px4;

use super::flight::{
    Firmware, FirmwareKind, Gain, LoggedLoop, LoggedSignal, Mark, Setting, Span, Term,
};
use super::loops::ControlLoop;
use super::plan::{Plan, Quantity};
use super::tables::{FlightTables, LogFormat, Topic, Wanted};

/// Columns that tell about the flight itself, of every firmware.
pub(super) fn wanted() -> Wanted {
    let own = [px4::WANTED, ardupilot::WANTED, betaflight::WANTED].concat();
    own.iter()
        .fold(Wanted::nothing(), |wanted, (topic, field)| {
            let wanted = wanted.and(topic, field);
            if *topic == "SIDD" {
                wanted
            } else {
                wanted.changes_of(topic)
            }
        })
}

/// Which firmware wrote a flight.
pub(super) fn firmware(format: LogFormat, flight: &FlightTables) -> Firmware {
    match format {
        LogFormat::ULog | LogFormat::Mcap => px4::firmware(flight),
        LogFormat::DataFlash | LogFormat::DataFlashText => ardupilot::firmware(flight),
        LogFormat::Blackbox => betaflight::firmware(flight),
    }
}

/// Places where this firmware may log the signals of a loop, the best first.
pub(super) fn plans(kind: FirmwareKind, flight: &FlightTables, of: ControlLoop) -> Vec<Plan> {
    match kind {
        FirmwareKind::Px4 => px4::plans(of),
        FirmwareKind::ArduPilot => ardupilot::plans(of),
        FirmwareKind::Betaflight | FirmwareKind::Inav => betaflight::plans(flight, of),
    }
}

/// The first plan whose input and output are logged.
pub(super) fn plan(kind: FirmwareKind, flight: &FlightTables, of: ControlLoop) -> Option<Plan> {
    let logged = |quantity: &Quantity| quantity.logged(flight).is_some();
    let mut plan = plans(kind, flight, of)
        .into_iter()
        .find(|plan| plan.needed().iter().all(|q| logged(q)))?;
    plan.set_point = plan.set_point.filter(logged);
    plan.throttle = plan.throttle.filter(logged);
    Some(plan)
}

/// A loop as it was logged.
pub(super) fn logged_loop(
    kind: FirmwareKind,
    flight: &FlightTables,
    of: ControlLoop,
) -> LoggedLoop {
    let candidates = plans(kind, flight, of);
    let signal = |quantity: &Quantity| {
        let topic = quantity.logged(flight)?;
        Some(LoggedSignal {
            name: quantity.name(),
            rate_hz: topic.rate_hz(),
        })
    };
    let chosen: Vec<Plan> = plan(kind, flight, of).map_or(candidates, |plan| vec![plan]);
    LoggedLoop {
        control_loop: of,
        input: chosen.iter().find_map(|plan| signal(&plan.input)),
        output: chosen.iter().find_map(|plan| signal(&plan.output)),
        set_point: chosen
            .iter()
            .find_map(|plan| signal(plan.set_point.as_ref()?)),
        gains: match kind {
            FirmwareKind::Px4 => px4::gains(flight, of),
            FirmwareKind::ArduPilot => ardupilot::gains(flight, of),
            FirmwareKind::Betaflight => betaflight::gains(flight, of),
            FirmwareKind::Inav => Vec::new(),
        },
    }
}

/// Names of the parameters that hold the gains of a loop, with their terms. Empty for a firmware without named parameters.
pub fn gain_names(kind: FirmwareKind, of: ControlLoop) -> Vec<(Term, String)> {
    match kind {
        FirmwareKind::Px4 => px4::gain_names(of),
        FirmwareKind::ArduPilot => ardupilot::gain_names(of),
        FirmwareKind::Betaflight | FirmwareKind::Inav => Vec::new(),
    }
}

/// Filters in force, and the geometry of the motors.
pub(super) fn settings(kind: FirmwareKind, flight: &FlightTables) -> [Vec<Setting>; 2] {
    let [filters, mixer]: [&[&str]; 2] = match kind {
        FirmwareKind::Px4 => [px4::FILTERS, px4::MIXER],
        FirmwareKind::ArduPilot => [ardupilot::FILTERS, ardupilot::MIXER],
        FirmwareKind::Betaflight | FirmwareKind::Inav => [betaflight::FILTERS, betaflight::MIXER],
    };
    [filters, mixer].map(|starts| {
        let is_one = |name: &str| starts.iter().any(|start| name.starts_with(start));
        let found = flight.parameters.iter().filter(|(name, _)| is_one(name));
        let all = found.map(|(name, parameter)| Setting {
            name: name.clone(),
            value: parameter.value,
        });
        all.collect()
    })
}

/// Cutoff (Hz) of the second-order low-pass through which the output of a loop was logged. `None`: there is none, or it is
/// not of this kind.
pub(super) fn output_filter_hz(
    kind: FirmwareKind,
    flight: &FlightTables,
    of: ControlLoop,
) -> Option<f64> {
    let name = match (kind, of) {
        (FirmwareKind::Px4, ControlLoop::Rate(_)) => px4::GYRO_FILTER,
        (FirmwareKind::ArduPilot, ControlLoop::Rate(_)) => ardupilot::GYRO_FILTER,
        _ => return None,
    };
    flight.parameter(name).filter(|cutoff_hz| *cutoff_hz > 0.0)
}

/// Deliberate excitation.
pub(super) fn marks(kind: FirmwareKind, flight: &FlightTables) -> Vec<Mark> {
    match kind {
        FirmwareKind::Px4 => px4::marks(flight),
        FirmwareKind::ArduPilot => ardupilot::marks(flight),
        FirmwareKind::Betaflight | FirmwareKind::Inav => betaflight::marks(flight),
    }
}

/// Armed and airborne spans.
pub(super) fn armed_and_airborne(
    kind: FirmwareKind,
    flight: &FlightTables,
    span: Span,
) -> [Option<Vec<Span>>; 2] {
    match kind {
        FirmwareKind::Px4 => px4::armed_and_airborne(flight),
        FirmwareKind::ArduPilot => ardupilot::armed_and_airborne(flight, span),
        // These log while they are armed.
        FirmwareKind::Betaflight | FirmwareKind::Inav => [Some(vec![span]), None],
    }
}

/// Spans in which a column satisfies a condition. `None`: it is not logged.
fn spans(topic: Option<&Topic>, field: &str, is_on: impl Fn(f64) -> bool) -> Option<Vec<Span>> {
    let topic = topic.filter(|topic| topic.rows > 0)?;
    let values = topic.column(field)?;
    let states = topic
        .time_s
        .iter()
        .zip(values)
        .map(|(&time_s, &value)| (time_s, is_on(value)));
    Some(spans_of(states, topic.end_s))
}

/// Spans between changes of a state.
fn spans_of(states: impl Iterator<Item = (f64, bool)>, end_s: f64) -> Vec<Span> {
    let mut spans = Vec::new();
    let mut since = None;
    for (time_s, is_on) in states.chain([(end_s, false)]) {
        match (since, is_on) {
            (None, true) => since = Some(time_s),
            (Some(from_s), false) => {
                spans.push(Span {
                    from_s,
                    to_s: time_s,
                });
                since = None;
            }
            _ => {}
        }
    }
    spans
}

/// A gain as it is at the end of the flight, if the log has its parameter.
fn gain(flight: &FlightTables, term: Term, name: String, si_per_unit: Option<f64>) -> Option<Gain> {
    let parameter = flight.parameters.get(&name)?;
    let value = parameter.last();
    Some(Gain {
        term,
        name,
        value,
        changed_s: parameter.changes.last().map(|&(time_s, _)| time_s),
        si: si_per_unit.map(|factor| factor * value),
        si_per_unit,
    })
}
