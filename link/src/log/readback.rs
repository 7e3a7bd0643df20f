//! Gain read-back: the gains that a rate loop used, recovered from the logged signals and compared with the parameters.
//!
//! The law of the firmware ([`RateLaw`](super::RateLaw)) is linear in its gains, so that least squares of the logged output of the
//! controller on the logged set-point and gyro give them back. A wrong axis, sign, unit or version of the reader shows as
//! a gain that differs; a term that the flight did not excite cannot be judged.

mod equations;
mod fit;

use std::io::Read;

use super::error::LogError;
use super::flight::{FirmwareKind, Flight, Term};
use super::loops::{Axis, ControlLoop};
use super::plan::{Plan, Signals};
use super::tables::{FlightTables, Wanted};
use super::{FlightLog, firmware, read_tables};
use equations::{Equation, equations};
use fit::Rows;

/// How columns of motors begin, and the name of the mixer as a term.
const MIXER: &str = "motor";

/// What the comparison of a recovered gain with the stated one tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Agreement {
    /// Within the tolerance of the term.
    Agrees,
    /// Outside of it by more than three standard errors.
    Differs,
    /// The flight did not excite the term, or the signals that show it are not logged.
    Unknown,
}

/// A term of a controller: stated and recovered.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ReadTerm {
    /// Which term.
    pub term: Term,
    /// Name of the parameter; of the mixer `motor`.
    pub name: String,
    /// Stated gain (of the mixer 1: the mix of the motors over the output of the controller), in SI units (input of the process per rad/s, rad or rad/s^2): lower and upper end. They differ where
    /// the firmware moves the gain in flight.
    pub stated: [f64; 2],
    /// Recovered gain in the same unit, and its standard error. `None`: it cannot be computed.
    pub recovered: Option<(f64, f64)>,
    /// The verdict.
    pub agreement: Agreement,
}

impl ReadTerm {
    /// Recovered over stated gain; the nearer end of the stated range counts.
    pub fn ratio(&self) -> Option<f64> {
        let (value, _) = self.recovered?;
        let [low, high] = self.stated;
        Some(value / value.clamp(low.min(high), low.max(high)))
    }
}

/// Read-back of the rate loop of an axis.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ReadBack {
    /// The axis.
    pub axis: Axis,
    /// Rows used; 0 if there are too few.
    pub rows: usize,
    /// Share of the variance of the controller's output that the recovered law explains, the least over its equations.
    /// `None`: not computed.
    pub explained: Option<f64>,
    /// Terms whose stated gain is not zero.
    pub terms: Vec<ReadTerm>,
}

impl ReadBack {
    /// `Differs` if any term differs; `Agrees` if the proportional term agrees and none differs.
    pub fn agreement(&self) -> Agreement {
        let is = |agreement| move |term: &&ReadTerm| term.agreement == agreement;
        if self.terms.iter().any(|term| is(Agreement::Differs)(&term)) {
            return Agreement::Differs;
        }
        let mut agreeing = self.terms.iter().filter(is(Agreement::Agrees));
        match agreeing.any(|term| term.term == Term::Proportional) {
            true => Agreement::Agrees,
            false => Agreement::Unknown,
        }
    }
}

/// Tolerance of a term, as a share of the stated gain. On ten logs of three firmwares P came back within 10 %, D within
/// 25 % (filters that move with the throttle, logging at 50 Hz) and I within 25 %; a wrong unit, axis or sign is far
/// outside.
fn tolerance(term: Term) -> f64 {
    match term {
        Term::Proportional | Term::Mixer => 0.2,
        Term::Derivative => 0.35,
        _ => 0.5,
    }
}

impl FlightLog {
    /// Reads the gains of the rate loops of a flight (from 1) back from the signals in the same bytes. Axes whose loop was
    /// not logged, or has no parameters, are left out.
    ///
    /// # Errors
    /// There is no such flight, or reading stopped.
    pub fn read_back(&self, bytes: impl Read, flight: usize) -> Result<Vec<ReadBack>, LogError> {
        let no_flight = LogError::NoSuchFlight {
            wanted: flight,
            flights: self.flights.len(),
        };
        let Some(about) = flight.checked_sub(1).and_then(|at| self.flights.get(at)) else {
            return Err(no_flight);
        };
        let kind = about.firmware.kind;
        let plans: Vec<(Axis, Plan)> = (Axis::ALL.into_iter())
            .filter_map(|axis| {
                let plan = firmware::plan(kind, &about.tables, ControlLoop::Rate(axis))?;
                Some((axis, plan))
            })
            .collect();
        let wanted = (plans.iter())
            .map(|(_, plan)| plan.wanted())
            .fold(Wanted::nothing(), Wanted::with);
        let wanted = (plans.iter())
            .flat_map(|(axis, _)| equations::extra(kind, *axis))
            .fold(wanted, |wanted, quantity| quantity.want(wanted));
        let tables = read_tables(bytes, &wanted)?;
        let Some(tables) = tables.flights.get(flight - 1) else {
            return Err(no_flight);
        };
        let of = |(axis, plan): &(Axis, Plan)| {
            let signals = plan.join(flight, tables);
            read_axis(about, tables, *axis, &signals)
        };
        Ok(plans.iter().filter_map(of).collect())
    }
}

/// Read-back of one axis. `None` without gains.
fn read_axis(
    about: &Flight,
    tables: &FlightTables,
    axis: Axis,
    signals: &Signals,
) -> Option<ReadBack> {
    let mut terms = stated(about, axis);
    if terms.is_empty() {
        return None;
    }
    let law = about.rate_law(axis);
    let has = |term: Term| terms.iter().any(|own| own.term == term);
    let equations = equations(about, tables, axis, signals, &law, &has);
    let counts = counts(about, signals);
    let rows = Rows {
        time_s: &signals.time_s,
        counts: &counts,
    };
    let mut read = ReadBack {
        axis,
        rows: 0,
        explained: None,
        terms: Vec::new(),
    };
    for equation in equations {
        let Equation {
            target,
            columns,
            nuisance,
        } = equation;
        let all: Vec<&[f64]> = (columns.iter().map(|(_, column)| column))
            .chain(&nuisance)
            .map(Vec::as_slice)
            .collect();
        let Some(fit) = rows.fit(&target, &all) else {
            continue;
        };
        read.rows = read.rows.max(fit.rows);
        if !matches!(
            columns.as_slice(),
            [(Term::Integral | Term::FeedForward | Term::Mixer, _)]
        ) {
            let least = read.explained.unwrap_or(f64::INFINITY).min(fit.explained);
            read.explained = Some(least);
        }
        for ((term, _), value) in columns.iter().zip(fit.values) {
            let own = terms.iter_mut().filter(|own| own.term == *term);
            own.for_each(|own| own.recovered = Some(value));
        }
    }
    let rate_hz = slowest_hz(about, axis);
    for term in &mut terms {
        term.agreement = match agreement(term, tolerance(term.term)) {
            Agreement::Differs if rate_hz < least_rate_hz(term.term) => Agreement::Unknown,
            Agreement::Differs if may_be_lowered(about.firmware.kind, term) => Agreement::Unknown,
            agreement => agreement,
        };
    }
    read.terms = terms;
    Some(read)
}

/// Rate (Hz) below which a difference proves nothing: the logged samples no longer follow the signals.
fn least_rate_hz(term: Term) -> f64 {
    match term {
        Term::Derivative => 100.0,
        _ => 40.0,
    }
}

/// Rate (Hz) of the slowest signal of a loop.
fn slowest_hz(about: &Flight, axis: Axis) -> f64 {
    let logged = about.logged_loop(ControlLoop::Rate(axis));
    let signals = logged.map(|of| [&of.input, &of.output, &of.set_point]);
    let rates = signals.into_iter().flatten().flatten().map(|of| of.rate_hz);
    rates.fold(f64::INFINITY, f64::min)
}

/// Whether limits, anti-windup or relaxation explain the recovered value: all of them lower the integral term. Smoothing,
/// interpolation and limits lower the feed-forward of Betaflight.
fn may_be_lowered(kind: FirmwareKind, term: &ReadTerm) -> bool {
    let Some((value, std)) = term.recovered else {
        return true;
    };
    let [stated, _] = term.stated;
    let is_lowered = match term.term {
        Term::Integral => true,
        Term::FeedForward => kind == FirmwareKind::Betaflight,
        _ => false,
    };
    is_lowered && (value + 3.0 * std) / stated > 0.0 && value / stated < 1.0
}

/// The stated gains in SI units that are not zero. A gain that the firmware moves has two ends.
fn stated(about: &Flight, axis: Axis) -> Vec<ReadTerm> {
    let gains = about
        .logged_loop(ControlLoop::Rate(axis))
        .map_or(&[][..], |of| &of.gains);
    let known = [
        Term::Proportional,
        Term::Integral,
        Term::Derivative,
        Term::FeedForward,
    ];
    let term = |gain: &super::Gain| {
        let si = gain
            .si
            .filter(|si| *si != 0.0 && known.contains(&gain.term))?;
        let mut ends = [si, si];
        if gain.term == Term::Derivative {
            let limits = gains.iter().filter(|of| of.term == Term::DerivativeLimit);
            for limit in limits.filter_map(|of| of.si).filter(|limit| *limit > 0.0) {
                ends = [ends[0].min(limit), ends[1].max(limit)];
            }
        }
        Some(ReadTerm {
            term: gain.term,
            name: gain.name.clone(),
            stated: ends,
            recovered: None,
            agreement: Agreement::Unknown,
        })
    };
    let mut terms: Vec<ReadTerm> = gains.iter().filter_map(term).collect();
    let input = about
        .logged_loop(ControlLoop::Rate(axis))
        .and_then(|of| of.input.as_ref());
    if !terms.is_empty() && input.is_some_and(|input| input.name.contains(MIXER)) {
        terms.push(ReadTerm {
            term: Term::Mixer,
            name: MIXER.to_owned(),
            stated: [1.0, 1.0],
            recovered: None,
            agreement: Agreement::Unknown,
        });
    }
    terms
}

fn agreement(term: &ReadTerm, tolerance: f64) -> Agreement {
    let Some((value, std)) = term.recovered else {
        return Agreement::Unknown;
    };
    let [low, high] = term.stated;
    let near = value.clamp(low.min(high), low.max(high));
    let allowed = tolerance * near.abs();
    let off = (value - near).abs();
    if std > 0.5 * allowed {
        // So wrong that even a wide interval does not reach the stated value.
        return match off > allowed + 6.0 * std {
            true => Agreement::Differs,
            false => Agreement::Unknown,
        };
    }
    match off {
        off if off <= allowed => Agreement::Agrees,
        off if off > allowed + 3.0 * std => Agreement::Differs,
        _ => Agreement::Unknown,
    }
}

/// Rows in the air and armed, as far as the log tells, and below the throttle at which the firmware lowers its gains.
fn counts(about: &Flight, signals: &Signals) -> Vec<bool> {
    let spans = [&about.armed, &about.airborne];
    let breakpoint = match about.firmware.kind {
        FirmwareKind::Betaflight => (about.tables.parameter("tpa_breakpoint"))
            .filter(|_| about.tables.parameter("tpa_rate") != Some(0.0))
            .map(|breakpoint| 1e-3 * (breakpoint - 1000.0)),
        _ => None,
    };
    let counts = |(row, time_s): (usize, &f64)| {
        let is_in = spans.iter().all(|spans| {
            spans.as_ref().is_none_or(|spans| {
                let covers = |span: &super::Span| (span.from_s..=span.to_s).contains(time_s);
                spans.is_empty() || spans.iter().any(covers)
            })
        });
        let throttle = signals.throttle.as_ref().map(|throttle| throttle[row]);
        let is_full = breakpoint.is_none_or(|breakpoint| throttle.is_none_or(|t| t < breakpoint));
        is_in && is_full
    };
    signals.time_s.iter().enumerate().map(counts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(name: &str) -> (Vec<u8>, FlightLog) {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/logs/");
        let bytes = std::fs::read(format!("{folder}{name}")).unwrap();
        let log = FlightLog::scan(&bytes[..]).unwrap();
        (bytes, log)
    }

    fn ratio(read: &ReadBack, term: Term) -> f64 {
        let of = read.terms.iter().find(|own| own.term == term);
        of.and_then(ReadTerm::ratio).unwrap()
    }

    // The logs of PX4 and ArduPilot come from simulations of the whole firmware: the gains are known exactly.
    #[test]
    fn gains_of_three_firmwares() {
        let cases = [
            ("px4_chirps.ulg", [0.02, 0.05]),
            ("ap_sysid_roll.bin", [0.05, 0.25]),
            ("betaflight_acro.bfl", [0.06, 0.05]),
        ];
        for (name, [p, d]) in cases {
            let (bytes, log) = log(name);
            let read = log.read_back(&bytes[..], 1).unwrap();
            assert_eq!(read.len(), 3, "{name}");
            for axis in &read[..2] {
                assert_eq!(axis.agreement(), Agreement::Agrees, "{name} {axis:?}");
                assert!(
                    (ratio(axis, Term::Proportional) - 1.0).abs() < p,
                    "{name} {axis:?}"
                );
                assert!(
                    (ratio(axis, Term::Derivative) - 1.0).abs() < d,
                    "{name} {axis:?}"
                );
                assert!(axis.explained.unwrap() > 0.9, "{name} {axis:?}");
            }
        }
    }

    // Wrong sign, gains of another unit (degrees), gains of another axis or version (half).
    #[test]
    fn wrong_gains_differ() {
        for name in ["px4_chirps.ulg", "ap_sysid_roll.bin", "betaflight_acro.bfl"] {
            for factor in [-1.0, 180.0 / std::f64::consts::PI, 0.5] {
                let (bytes, mut log) = log(name);
                for own in &mut log.flights[0].loops {
                    let gains = own.gains.iter_mut();
                    gains.for_each(|gain| gain.si = gain.si.map(|si| factor * si));
                }
                for axis in log.read_back(&bytes[..], 1).unwrap() {
                    assert_eq!(
                        axis.agreement(),
                        Agreement::Differs,
                        "{name} {factor} {axis:?}"
                    );
                }
            }
        }
    }

    // The controller's output of roll against the signals of pitch, and against the gyro with the wrong sign.
    #[test]
    fn wrong_signals_differ() {
        let name = "px4_chirps.ulg";
        let (bytes, log) = log(name);
        let about = &log.flights[0];
        let tables = read_tables(&bytes[..], &Wanted::everything()).unwrap();
        let tables = &tables.flights[0];
        let signals = |axis| {
            let plan = firmware::plan(FirmwareKind::Px4, tables, ControlLoop::Rate(axis)).unwrap();
            plan.join(1, tables)
        };
        let right = signals(Axis::Roll);
        let mut crossed = signals(Axis::Pitch);
        crossed.input.clone_from(&right.input);
        let mut opposed = right.clone();
        opposed.output.iter_mut().for_each(|rate| *rate = -*rate);
        let verdict = |signals: &Signals| {
            let read = read_axis(about, tables, Axis::Roll, signals).unwrap();
            read.agreement()
        };
        assert_eq!(verdict(&right), Agreement::Agrees);
        assert_eq!(verdict(&crossed), Agreement::Differs);
        assert_eq!(verdict(&opposed), Agreement::Differs);
    }

    // The motors of Betaflight mix to the sum of the terms; not those of another axis, nor with the other sign.
    #[test]
    fn mixer_of_betaflight() {
        let (bytes, log) = log("betaflight_acro.bfl");
        let read = log.read_back(&bytes[..], 1).unwrap();
        assert!(
            (ratio(&read[0], Term::Mixer) - 1.0).abs() < 0.03,
            "{read:?}"
        );
        assert!(
            (ratio(&read[2], Term::Mixer) - 1.0).abs() < 0.05,
            "{read:?}"
        );
        let about = &log.flights[0];
        let tables = read_tables(&bytes[..], &Wanted::everything()).unwrap();
        let tables = &tables.flights[0];
        let kind = FirmwareKind::Betaflight;
        let signals = |axis| {
            let plan = firmware::plan(kind, tables, ControlLoop::Rate(axis)).unwrap();
            plan.join(1, tables)
        };
        let mixer = |signals: &Signals| {
            let read = read_axis(about, tables, Axis::Roll, signals).unwrap();
            let own = read.terms.iter().find(|own| own.term == Term::Mixer);
            (own.unwrap().agreement, read.agreement())
        };
        let right = signals(Axis::Roll);
        assert_eq!(mixer(&right), (Agreement::Agrees, Agreement::Agrees));
        let mut crossed = right.clone();
        crossed.input = signals(Axis::Yaw).input;
        let mut opposed = right.clone();
        opposed.input.iter_mut().for_each(|input| *input = -*input);
        for wrong in [crossed, opposed] {
            assert_eq!(mixer(&wrong), (Agreement::Differs, Agreement::Differs));
        }
    }

    // A log at 9 Hz and one of an axis that hardly moves prove nothing.
    #[test]
    fn slow_logs_prove_nothing() {
        let (bytes, log) = log("px4_motor_failure.ulg");
        let read = log.read_back(&bytes[..], 1).unwrap();
        assert!(
            read.iter()
                .all(|axis| axis.agreement() == Agreement::Unknown),
            "{read:?}"
        );
        assert!(log.read_back(&bytes[..], 2).is_err());
    }
}
