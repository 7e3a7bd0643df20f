//! Where a firmware logs the signals of a loop, and how samples of several topics are joined on one clock.
//!
//! The clock is that of the output. Each output sample takes the input of the same sample of the sensor where both
//! topics carry its time stamp (`timestamp_sample`) and most rows match; rows without a partner are dropped. Otherwise it
//! takes the last input at or before it. Set-point and throttle are always the last ones.

use super::loops::{Axis, ControlLoop};
use super::tables::{FlightTables, Topic, Wanted};

/// A value that was logged longer ago than this, in seconds, is not in force any more.
const OLDEST_S: f64 = 1.0;

/// With fewer partners than this share of rows, samples are joined by time instead of by the stamp of their sensor.
const LEAST_MATCH: f64 = 0.5;

/// A quantity computed from columns of one topic.
#[derive(Debug, Clone)]
pub(super) struct Quantity {
    pub(super) topic: &'static str,
    pub(super) fields: Vec<String>,
    pub(super) map: Map,
    /// Column with the time (us) of the sensor's sample.
    pub(super) stamp: Option<&'static str>,
}

/// From columns to the value.
#[derive(Debug, Clone)]
pub(super) enum Map {
    /// Weighted sum of the columns, plus an offset.
    Linear(Vec<f64>, f64),
    /// Angle (rad) of the rotation that four columns describe (w, x, y, z).
    Angle(Axis),
}

impl Quantity {
    /// A column times a factor.
    pub(super) fn scaled(topic: &'static str, field: impl Into<String>, factor: f64) -> Self {
        Self {
            topic,
            fields: vec![field.into()],
            map: Map::Linear(vec![factor], 0.0),
            stamp: None,
        }
    }

    /// The angle of the quaternion in columns `field[0]` to `field[3]`.
    pub(super) fn angle(topic: &'static str, field: &str, axis: Axis) -> Self {
        Self {
            topic,
            fields: (0..4).map(|at| format!("{field}[{at}]")).collect(),
            map: Map::Angle(axis),
            stamp: None,
        }
    }

    #[must_use]
    pub(super) fn stamped(mut self) -> Self {
        self.stamp = Some("timestamp_sample");
        self
    }

    /// `topic.field`, or `topic.first, second, ...`; of an angle the name of the quaternion.
    pub(super) fn name(&self) -> String {
        let fields = match (&self.map, self.fields.first()) {
            (Map::Angle(_), Some(first)) => first.trim_end_matches("[0]").to_owned(),
            _ => self.fields.join(", "),
        };
        format!("{}.{fields}", self.topic)
    }

    /// The topic, if it has rows and all columns.
    pub(super) fn logged<'a>(&self, flight: &'a FlightTables) -> Option<&'a Topic> {
        let topic = flight.topic(self.topic)?;
        (topic.rows > 1 && self.fields.iter().all(|field| topic.has(field))).then_some(topic)
    }

    pub(super) fn want(&self, mut wanted: Wanted) -> Wanted {
        for field in self.fields.iter().map(String::as_str).chain(self.stamp) {
            wanted = wanted.and(self.topic, field);
        }
        wanted
    }

    /// The last value at or before each time; `None` where the last second before has none.
    pub(super) fn held_at(&self, flight: &FlightTables, times_s: &[f64]) -> Vec<Option<f64>> {
        self.rows(flight).held(times_s).collect()
    }

    /// Times (s) and values of the rows whose time goes on.
    fn rows(&self, flight: &FlightTables) -> Rows {
        let mut rows = Rows::default();
        let Some(topic) = flight.topic(self.topic) else {
            return rows;
        };
        let columns: Option<Vec<&[f64]>> = self
            .fields
            .iter()
            .map(|field| topic.column(field))
            .collect();
        let Some(columns) = columns else {
            return rows;
        };
        let stamps = self.stamp.and_then(|stamp| topic.column(stamp));
        rows.is_stamped = stamps.is_some();
        let mut cells = vec![0.0; columns.len()];
        let mut before_s = f64::NEG_INFINITY;
        for row in 0..topic.time_s.len() {
            for (cell, column) in cells.iter_mut().zip(&columns) {
                *cell = column[row];
            }
            let time_s = stamps.map_or(topic.time_s[row], |stamps| stamps[row] * 1e-6);
            let value = self.map.of(&cells);
            if value.is_finite() && time_s > before_s {
                rows.time_s.push(time_s);
                rows.value.push(value);
                before_s = time_s;
            } else {
                rows.dropped += 1;
            }
        }
        rows
    }
}

impl Map {
    fn of(&self, cells: &[f64]) -> f64 {
        match self {
            Self::Linear(weights, offset) => {
                offset
                    + weights
                        .iter()
                        .zip(cells)
                        .map(|(weight, cell)| weight * cell)
                        .sum::<f64>()
            }
            Self::Angle(axis) => {
                let &[w, x, y, z] = cells else {
                    return f64::NAN;
                };
                match axis {
                    Axis::Roll => (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
                    Axis::Pitch => (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
                    Axis::Yaw => (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
                }
            }
        }
    }
}

/// A signal by itself.
#[derive(Debug, Default)]
struct Rows {
    time_s: Vec<f64>,
    value: Vec<f64>,
    is_stamped: bool,
    dropped: u64,
}

impl Rows {
    /// Whether the covariance with another signal of the same rows is negative.
    fn opposes(&self, other: &Self) -> bool {
        let count = self.value.len().min(other.value.len()).max(1) as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
        let (own, others) = (mean(&self.value), mean(&other.value));
        let products = self
            .value
            .iter()
            .zip(&other.value)
            .map(|(a, b)| (a - own) * (b - others));
        products.sum::<f64>() < 0.0
    }

    /// Value of the last row at or before each time; `None` if the last second before has no row.
    fn held<'a>(&'a self, times_s: &'a [f64]) -> impl Iterator<Item = Option<f64>> + 'a {
        let mut next = 0;
        times_s.iter().map(move |&time_s| {
            while self.time_s.get(next).is_some_and(|&own| own <= time_s) {
                next += 1;
            }
            let last = next.checked_sub(1)?;
            (time_s - self.time_s[last] <= OLDEST_S).then(|| self.value[last])
        })
    }

    /// Value of the row with the same time stamp, to a microsecond.
    fn same<'a>(&'a self, times_s: &'a [f64]) -> impl Iterator<Item = Option<f64>> + 'a {
        let mut next = 0;
        times_s.iter().map(move |&time_s| {
            while self
                .time_s
                .get(next)
                .is_some_and(|&own| own < time_s - 5e-7)
            {
                next += 1;
            }
            let own = self.time_s.get(next)?;
            (*own <= time_s + 5e-7).then(|| self.value[next])
        })
    }
}

/// Where a firmware logs the signals of a loop.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) control_loop: ControlLoop,
    pub(super) input: Quantity,
    pub(super) output: Quantity,
    pub(super) set_point: Option<Quantity>,
    pub(super) throttle: Option<Quantity>,
    /// Unit of the input.
    pub(super) input_unit: &'static str,
    /// What has the sign of the input, if the log does not tell the sign otherwise.
    pub(super) sign: Option<Quantity>,
}

/// The signals of a loop on one clock.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Signals {
    /// The flight, from 1.
    pub flight: usize,
    /// The loop.
    pub control_loop: ControlLoop,
    /// Clock of the firmware, in seconds, strictly increasing.
    pub time_s: Vec<f64>,
    /// Input of the process, held from its time on.
    pub input: Vec<f64>,
    /// Measurement, in rad/s, rad or m/s.
    pub output: Vec<f64>,
    /// Set-point of the output; `None` if it is not logged.
    pub set_point: Option<Vec<f64>>,
    /// Throttle or collective thrust as a fraction of its range; NaN where it is not known; `None` if it is not logged.
    pub throttle: Option<Vec<f64>>,
    /// Names of input and output as the firmware has them.
    pub names: [String; 2],
    /// Units of input and output.
    pub units: [&'static str; 2],
    /// Rows of the output that were dropped because another signal had no value there, or because time went back.
    pub rows_dropped: u64,
    /// Cutoff (Hz) of the second-order low-pass (Butterworth) through which the output was logged; `None`: not known.
    pub output_filter_hz: Option<f64>,
}

impl Plan {
    /// Unit of the output.
    pub(super) fn output_unit(&self) -> &'static str {
        match self.control_loop {
            ControlLoop::Rate(_) => "rad/s",
            ControlLoop::Attitude(_) => "rad",
            ControlLoop::Altitude => "m/s",
        }
    }

    /// Quantities that must be there.
    pub(super) fn needed(&self) -> [&Quantity; 2] {
        [&self.input, &self.output]
    }

    /// The columns to read.
    pub(super) fn wanted(&self) -> Wanted {
        let optional = self
            .set_point
            .iter()
            .chain(&self.throttle)
            .chain(&self.sign);
        self.needed()
            .into_iter()
            .chain(optional)
            .fold(Wanted::nothing(), |wanted, quantity| quantity.want(wanted))
    }

    /// Joins the columns that were read of the flight with this number.
    pub(super) fn join(&self, number: usize, flight: &FlightTables) -> Signals {
        let output = self.output.rows(flight);
        let mut input = self.input.rows(flight);
        if let Some(sign) = &self.sign
            && input.opposes(&sign.rows(flight))
        {
            input.value.iter_mut().for_each(|value| *value = -*value);
        }
        let times_s = &output.time_s;
        let stamped = input.is_stamped && output.is_stamped;
        let mut inputs: Vec<Option<f64>> = Vec::new();
        if stamped || self.input.topic == self.output.topic {
            inputs.extend(input.same(times_s));
        }
        let matched = inputs.iter().flatten().count();
        if matched as f64 <= LEAST_MATCH * times_s.len() as f64 {
            inputs = input.held(times_s).collect();
        }
        let others = [&self.set_point, &self.throttle].map(|quantity| {
            let rows = quantity.as_ref()?.rows(flight);
            (!rows.time_s.is_empty()).then(|| rows.held(times_s).collect::<Vec<_>>())
        });
        let [set_points, throttles] = others;
        let mut signals = Signals {
            flight: number,
            control_loop: self.control_loop,
            time_s: Vec::new(),
            input: Vec::new(),
            output: Vec::new(),
            set_point: set_points.as_ref().map(|_| Vec::new()),
            throttle: throttles.as_ref().map(|_| Vec::new()),
            names: [self.input.name(), self.output.name()],
            units: [self.input_unit, self.output_unit()],
            rows_dropped: output.dropped,
            output_filter_hz: None,
        };
        for (row, &time_s) in times_s.iter().enumerate() {
            let set_point = set_points.as_ref().map_or(Some(0.0), |values| values[row]);
            let (Some(input), Some(set_point)) = (inputs[row], set_point) else {
                signals.rows_dropped += 1;
                continue;
            };
            signals.time_s.push(time_s);
            signals.input.push(input);
            signals.output.push(output.value[row]);
            if let Some(column) = &mut signals.set_point {
                column.push(set_point);
            }
            if let (Some(column), Some(values)) = (&mut signals.throttle, &throttles) {
                column.push(values[row].unwrap_or(f64::NAN));
            }
        }
        signals
    }
}
