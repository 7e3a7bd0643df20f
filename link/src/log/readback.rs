//! Gain read-back: the gains that a rate loop used, recovered from the logged signals and compared with the parameters.
//!
//! The law of the firmware ([`RateLaw`](super::RateLaw)) is linear in its gains, so that least squares of the logged output of the
//! controller on the logged set-point and gyro give them back. A wrong axis, sign, unit or version of the reader shows as
//! a gain that differs; a term that the flight did not excite cannot be judged.

mod equations;
mod fit;
mod motors;

use std::io::Read;

use super::error::LogError;
use super::flight::{FirmwareKind, Flight, LoggedLoop, Term};
use super::loops::{Axis, ControlLoop};
use super::plan::{Plan, Signals};
use super::tables::{FlightTables, Wanted};
use super::{FlightLog, firmware, read_tables};
use equations::{Equation, equations};
use fit::{Fit, Rows};
use motors::Motors;

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
    /// Stated gain in SI units (input of the process per rad/s, rad or rad/s^2): lower and upper end. They differ where the
    /// firmware moves the gain in flight. Of the mixer 1: the torque of the motors over the output of the controller.
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
    /// Time (s) of the last change of a gain in flight: the rows after it count. `None`: no gain was changed.
    pub since_s: Option<f64>,
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
fn tolerance(kind: FirmwareKind, term: Term) -> f64 {
    match term {
        // Compensation of the battery, thrust curve; two exchanged motors of a quadcopter give 0.5 or less.
        Term::Mixer if matches!(kind, FirmwareKind::Px4 | FirmwareKind::ArduPilot) => 0.45,
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
        let motors = Motors::of(kind, &about.tables);
        let wanted = (motors.iter()).fold(wanted, |wanted, own| own.quantity().want(wanted));
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
    let since_s = about
        .logged_loop(ControlLoop::Rate(axis))
        .and_then(LoggedLoop::gains_changed_s);
    let counts = counts(about, &signals.time_s, signals.throttle.as_deref(), since_s);
    let rows = Rows {
        time_s: &signals.time_s,
        counts: &counts,
    };
    let mut read = ReadBack {
        axis,
        since_s,
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
    let mix = mixed(about, tables, axis);
    terms.extend(
        mix.iter()
            .flat_map(|fit| fit.values.first())
            .map(|slope| ReadTerm {
                recovered: Some(*slope),
                ..mixer()
            }),
    );
    judge(about, axis, &mut terms);
    read.terms = terms;
    Some(read)
}

/// The verdict on each term.
fn judge(about: &Flight, axis: Axis, terms: &mut [ReadTerm]) {
    let rate_hz = slowest_hz(about, axis);
    for term in terms {
        let tolerance = tolerance(about.firmware.kind, term.term);
        term.agreement = match agreement(term, tolerance) {
            Agreement::Differs if rate_hz < least_rate_hz(term.term) => Agreement::Unknown,
            Agreement::Differs if may_be_lowered(about.firmware.kind, term) => Agreement::Unknown,
            agreement => agreement,
        };
    }
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
        terms.push(mixer());
    }
    terms
}

/// The mix of the motors as a term.
fn mixer() -> ReadTerm {
    ReadTerm {
        term: Term::Mixer,
        name: MIXER.to_owned(),
        stated: [1.0, 1.0],
        recovered: None,
        agreement: Agreement::Unknown,
    }
}

/// The torque that the motors of PX4 and ArduPilot put out about an axis, over the output of its controller. `None`: motors
/// or frame are not known.
fn mixed(about: &Flight, tables: &FlightTables, axis: Axis) -> Option<Fit> {
    let kind = about.firmware.kind;
    let motors = Motors::of(kind, &about.tables)?;
    let (times_s, torque) = motors.torque(tables, axis)?;
    let asked = |axis: Axis| {
        let input = firmware::plan(kind, tables, ControlLoop::Rate(axis))?.input;
        Some(input.held_at(tables, &times_s))
    };
    let others = Axis::ALL.into_iter().filter(|other| *other != axis);
    let columns: Vec<_> = std::iter::once(axis)
        .chain(others)
        .filter_map(asked)
        .collect();
    let in_air = counts(about, &times_s, None, None);
    let counts: Vec<bool> = (0..times_s.len())
        .map(|row| {
            let is_known = columns.iter().all(|column| column[row].is_some());
            in_air[row] && is_known && torque[row].is_some()
        })
        .collect();
    let filled = |column: &[Option<f64>]| -> Vec<f64> {
        let held = column.iter().scan(0.0, |last, value| {
            *last = value.unwrap_or(*last);
            Some(*last)
        });
        held.collect()
    };
    let columns: Vec<Vec<f64>> = columns.iter().map(|column| filled(column)).collect();
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let rows = Rows {
        time_s: &times_s,
        counts: &counts,
    };
    rows.fit(&filled(&torque), &columns)
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

/// Rows in the air and armed, as far as the log tells, below the throttle at which the firmware lowers its gains, and after the
/// last change of a gain.
fn counts(
    about: &Flight,
    times_s: &[f64],
    throttle: Option<&[f64]>,
    since_s: Option<f64>,
) -> Vec<bool> {
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
        let throttle = throttle.map(|throttle| throttle[row]);
        let is_full = breakpoint.is_none_or(|breakpoint| throttle.is_none_or(|t| t < breakpoint));
        is_in && is_full && since_s.is_none_or(|since_s| *time_s > since_s)
    };
    times_s.iter().enumerate().map(counts).collect()
}

#[cfg(test)]
mod tests;
