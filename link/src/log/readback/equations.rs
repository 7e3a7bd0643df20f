//! The linear equations of a firmware's rate loop: what the controller put out, and the columns of its terms.

use crate::log::flight::{FirmwareKind, Flight, MarkKind, Span, Term};
use crate::log::law::{LowPassSetting, RateLaw};
use crate::log::loops::{Axis, ControlLoop};
use crate::log::plan::{Quantity, Signals};
use crate::log::tables::FlightTables;

use super::fit::{derivative, filtered, integral};

/// Terms and their columns.
type Columns = Vec<(Term, Vec<f64>)>;

/// `target = sum of gain x column + sum of unknown x nuisance + constant`.
#[derive(Debug)]
pub(super) struct Equation {
    pub(super) target: Vec<f64>,
    pub(super) columns: Columns,
    pub(super) nuisance: Vec<Vec<f64>>,
}

/// Columns beside those of the loop.
pub(super) fn extra(kind: FirmwareKind, axis: Axis) -> Vec<Quantity> {
    let at = axis.index();
    match kind {
        FirmwareKind::Px4 => accelerations(at).to_vec(),
        FirmwareKind::ArduPilot => vec![sweep()],
        FirmwareKind::Betaflight | FirmwareKind::Inav => {
            Term::READ.map(|term| logged_term(term, at)).to_vec()
        }
    }
}

impl Term {
    /// Terms that are read back.
    pub(super) const READ: [Self; 4] = [
        Self::Proportional,
        Self::Integral,
        Self::Derivative,
        Self::FeedForward,
    ];
}

/// The filtered derivative of the gyro, as new and old PX4 logs it.
fn accelerations(at: usize) -> [Quantity; 2] {
    [
        Quantity::scaled(
            "vehicle_angular_velocity",
            format!("xyz_derivative[{at}]"),
            1.0,
        ),
        Quantity::scaled("vehicle_angular_acceleration", format!("xyz[{at}]"), 1.0),
    ]
}

/// The excitation of SYSTEMID.
fn sweep() -> Quantity {
    Quantity::scaled("SIDD", "Targ", 1.0)
}

/// A term as Betaflight logs it, as a fraction of the range of a motor.
fn logged_term(term: Term, at: usize) -> Quantity {
    let letter = match term {
        Term::Proportional => "P",
        Term::Integral => "I",
        Term::Derivative => "D",
        _ => "F",
    };
    Quantity::scaled("main", format!("axis{letter}[{at}]"), 1e-3)
}

fn low_passed(time_s: &[f64], column: &[f64], filter: Option<&LowPassSetting>) -> Vec<f64> {
    let Some(filter) = filter else {
        return column.to_vec();
    };
    let filter_s = 1.0 / (std::f64::consts::TAU * filter.cutoff_hz);
    match filter.order {
        1 => filtered(time_s, column, filter_s),
        // At low frequencies a Butterworth filter delays like two equal lags of 0.707 of its time each.
        _ => {
            let half_s = filter_s * std::f64::consts::FRAC_1_SQRT_2;
            filtered(time_s, &filtered(time_s, column, half_s), half_s)
        }
    }
}

/// The set-point a tick of the controller earlier: ArduPilot runs the rate controller first in its loop, then sets the next
/// set-point, and logs both at the end.
fn one_tick_before(times_s: &[f64], set_point: &[f64], period_s: f64) -> Vec<f64> {
    let first = set_point.first().copied();
    let before = |row: usize| {
        let step_s = times_s[row + 1] - times_s[row];
        let share = (period_s / step_s).min(1.0);
        set_point[row + 1] + share * (set_point[row] - set_point[row + 1])
    };
    let rest = 0..set_point.len().saturating_sub(1);
    first.into_iter().chain(rest.map(before)).collect()
}

/// The equations that this log allows; `has` tells which terms have a gain.
pub(super) fn equations(
    about: &Flight,
    tables: &FlightTables,
    axis: Axis,
    signals: &Signals,
    law: &RateLaw,
    has: &dyn Fn(Term) -> bool,
) -> Vec<Equation> {
    let times_s = &signals.time_s;
    let Some(set_point) = &signals.set_point else {
        return Vec::new();
    };
    let kind = about.firmware.kind;
    let used = match (kind, law.sample_period_s) {
        (FirmwareKind::ArduPilot, Some(period_s)) => one_tick_before(times_s, set_point, period_s),
        _ => set_point.clone(),
    };
    let target = low_passed(times_s, &used, law.target.as_ref());
    let error: Vec<f64> = target
        .iter()
        .zip(&signals.output)
        .map(|(r, y)| r - y)
        .collect();
    let error = low_passed(times_s, &error, law.error.as_ref());
    let acceleration = || {
        let logged = match kind {
            FirmwareKind::Px4 => accelerations(axis.index())
                .iter()
                .find_map(|quantity| held(quantity, tables, times_s)),
            _ => None,
        };
        let minus = |column: Vec<f64>| column.into_iter().map(|value| -value).collect();
        logged.map_or_else(
            || {
                let rate = match law.derivative_on_error {
                    true => derivative(times_s, &error),
                    false => minus(derivative(times_s, &signals.output)),
                };
                let filters = law.derivative.iter();
                filters.fold(rate, |rate, filter| {
                    low_passed(times_s, &rate, Some(filter))
                })
            },
            minus,
        )
    };
    let column = |term: Term| match term {
        Term::Proportional => error.clone(),
        Term::Integral => integral(times_s, &error),
        Term::Derivative => acceleration(),
        _ => target.clone(),
    };
    let columns = |terms: &[Term]| -> Columns {
        let used = terms.iter().filter(|term| has(**term));
        used.map(|term| {
            (
                *term,
                low_passed(times_s, &column(*term), law.output.as_ref()),
            )
        })
        .collect()
    };
    match kind {
        FirmwareKind::Px4 | FirmwareKind::ArduPilot => {
            let mut nuisance = excitations(about, tables, axis, times_s);
            if kind == FirmwareKind::Px4 {
                // A set-point that was logged late by d adds -P d dr/dt.
                nuisance.push(derivative(times_s, set_point));
            }
            vec![Equation {
                target: signals.input.clone(),
                columns: columns(&Term::READ),
                nuisance,
            }]
        }
        FirmwareKind::Betaflight | FirmwareKind::Inav => {
            betaflight(about, tables, axis, signals, &columns)
        }
    }
}

/// What ArduPilot added to the output of the controller: each run of SYSTEMID on the axis, and its derivative, because it
/// is logged at another moment of the loop.
fn excitations(
    about: &Flight,
    tables: &FlightTables,
    axis: Axis,
    times_s: &[f64],
) -> Vec<Vec<f64>> {
    let runs = about
        .marks
        .iter()
        .filter(|mark| mark.kind == MarkKind::ArduPilotSystemId && mark.axis == Some(axis));
    let Some(column) = held(&sweep(), tables, times_s) else {
        return Vec::new();
    };
    let inside = |span: Span| -> Vec<f64> {
        let rows = times_s.iter().zip(&column);
        rows.map(|(time_s, &value)| {
            let is_in = (span.from_s..=span.to_s).contains(time_s);
            if is_in { value } else { 0.0 }
        })
        .collect()
    };
    runs.flat_map(|mark| {
        let own = inside(mark.span);
        let slope = derivative(times_s, &own);
        [own, slope]
    })
    .collect()
}

/// Betaflight logs each term, and the motors: their mix is the sum of the terms. Its feed-forward is the smoothed derivative of
/// the set-point, with a share of the second derivative (boost).
fn betaflight(
    about: &Flight,
    tables: &FlightTables,
    axis: Axis,
    signals: &Signals,
    columns: &dyn Fn(&[Term]) -> Columns,
) -> Vec<Equation> {
    let logged = about.logged_loop(ControlLoop::Rate(axis));
    let is_derived = logged
        .and_then(|of| of.set_point.as_ref())
        .is_some_and(|set_point| {
            // A set-point that was computed from the proportional term proves nothing about it.
            set_point.name.contains("axisP")
        });
    let read = (Term::READ.into_iter()).filter(|term| !is_derived || *term == Term::Derivative);
    let times_s = &signals.time_s;
    let of = |term: Term| held(&logged_term(term, axis.index()), tables, times_s);
    let equation = |term: Term| {
        let mut columns = columns(&[term]);
        let (_, column) = columns.first_mut()?;
        let mut nuisance = Vec::new();
        if term == Term::FeedForward {
            *column = derivative(times_s, column);
            nuisance.push(derivative(times_s, column));
        }
        Some(Equation {
            target: of(term)?,
            columns,
            nuisance,
        })
    };
    let is_mixed = logged
        .and_then(|of| of.input.as_ref())
        .is_some_and(|input| input.name.contains("motor"));
    let mixed = is_mixed.then(|| {
        let terms = Term::READ.into_iter().filter_map(of);
        let sum = terms.reduce(|sum, term| sum.iter().zip(&term).map(|(a, b)| a + b).collect());
        Some(Equation {
            target: signals.input.clone(),
            columns: vec![(Term::Mixer, sum?)],
            nuisance: Vec::new(),
        })
    });
    read.filter_map(equation).chain(mixed.flatten()).collect()
}

/// A quantity at the times of the output; NaN becomes 0.
fn held(quantity: &Quantity, tables: &FlightTables, times_s: &[f64]) -> Option<Vec<f64>> {
    let column = quantity.held_at(tables, times_s);
    column.iter().any(Option::is_some).then(|| {
        let fill = |value: Option<f64>| value.filter(|value| value.is_finite()).unwrap_or(0.0);
        column.into_iter().map(fill).collect()
    })
}
