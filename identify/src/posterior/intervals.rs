//! Estimates with 90 % intervals.

use onecycle_design::{Parameter, Structure};

/// Estimate with its 90 % interval. `None` stands for infinite or unbounded.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Interval {
    /// Most probable value. `None` if it is infinite.
    pub estimate: Option<f64>,
    /// Lower end. `None` if the interval is unbounded below.
    pub low: Option<f64>,
    /// Upper end. `None` if the interval is unbounded above.
    pub high: Option<f64>,
}

impl Interval {
    /// Interval with these ends, widened to hold the estimate.
    pub(super) fn new(estimate: f64, ends: Option<(f64, f64)>) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        let (low, high) = ends.map_or((None, None), |(low, high)| {
            (finite(low.min(estimate)), finite(high.max(estimate)))
        });
        Self {
            estimate: finite(estimate),
            low,
            high,
        }
    }

    /// Whether `value` lies within the interval. Infinity does if the interval is unbounded above.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        self.low.is_none_or(|low| low <= value) && self.high.is_none_or(|high| value <= high)
    }

    /// Half width of the interval as a fraction of the magnitude of the estimate. `None` if the interval is unbounded
    /// or the estimate infinite.
    #[must_use]
    pub fn relative_half_width(&self) -> Option<f64> {
        Some((self.high? - self.low?) / (2.0 * self.estimate?.abs()))
    }
}

/// Characteristics of the response to a unit step of the reference, each with its 90 % interval. A loop that is unstable or
/// too slow to simulate counts with infinite values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StepIntervals {
    /// Overshoot as a fraction of the step.
    pub overshoot: Interval,
    /// Rise time from 10 % to 90 % of the step (s).
    pub rise_time_s: Interval,
    /// Time after which the output stays within 2 % of the reference (s).
    pub settling_time_s: Interval,
    /// Largest magnitude of the controller output (input unit).
    pub peak_input: Interval,
}

/// Shortest time constants (s) that a search went down to. Zero: all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shortest {
    /// Of an actuator.
    pub(crate) lag_s: f64,
    /// Of a body.
    pub(crate) body_s: f64,
}

/// Parameters of a model and the input bias, each with its 90 % interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    pub(super) structure: Structure,
    pub(super) intervals: Vec<(Parameter, Interval)>,
    pub(super) shortest: Shortest,
}

impl Estimate {
    /// Structure of the model.
    #[must_use]
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// Interval of a parameter. `None` if the structure does not report the parameter.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> Option<Interval> {
        (self.intervals.iter())
            .find(|(of, _)| *of == parameter)
            .map(|(_, interval)| *interval)
    }

    /// Whether a parameter is below the upper end of its interval, and no more is known of it: the lower end is where its search
    /// begins. That is zero for a dead time and a damping ratio, and a part of a sample for a lag.
    #[must_use]
    pub fn is_below(&self, parameter: Parameter) -> bool {
        let bound = match parameter {
            Parameter::Tau | Parameter::Zeta => 0.0,
            Parameter::TProp | Parameter::TProp2 => self.shortest.lag_s,
            Parameter::TBody => self.shortest.body_s,
            _ => return false,
        };
        self.get(parameter).is_some_and(|interval| {
            let is_at_bound = |low: f64| low <= bound * (1.0 + 1e-9);
            // The time of an unstable process is negative.
            let is_positive = |high: f64| high >= 0.0;
            interval.low.is_some_and(is_at_bound) && interval.high.is_some_and(is_positive)
        })
    }

    /// All parameters with their intervals: first those of the structure in the order of [`Structure::parameters`],
    /// then the input bias.
    pub fn iter(&self) -> impl Iterator<Item = (Parameter, Interval)> + '_ {
        self.intervals.iter().copied()
    }
}
