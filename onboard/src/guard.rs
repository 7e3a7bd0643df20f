//! Guard of a test in flight: limits, and the reason when one is exceeded.
//!
//! All limits are checked at every tick before the output is computed, so exceeding one ends the test in the
//! same tick. The first reason is kept.

use core::fmt;

use crate::control::Measurement;
use crate::identification::Refusal;

/// Abort limits. Every limit is positive; `f32::INFINITY` switches it off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest distance of the output from the reference (output unit). Until the process has first come within
    /// half of it, as in a take-off, the distance at the start is added.
    pub excursion: f32,
    /// Largest rate of the output (output unit / s).
    pub rate: f32,
    /// Longest test, from its start until a controller is found (s).
    pub duration_s: f32,
    /// Longest time without a switch of the relay (s).
    pub no_switch_s: f32,
    /// Largest age of a sample, and longest time between ticks (s).
    pub stale_s: f32,
}

impl Limits {
    /// No limits. Samples must still be finite and timestamps must increase.
    pub const NONE: Self = Self {
        excursion: f32::INFINITY,
        rate: f32::INFINITY,
        duration_s: f32::INFINITY,
        no_switch_s: f32::INFINITY,
        stale_s: f32::INFINITY,
    };

    /// Limits that are not set yet: a tuner with them is refused.
    pub const UNSET: Self = Self {
        excursion: f32::NAN,
        rate: f32::NAN,
        duration_s: f32::NAN,
        no_switch_s: f32::NAN,
        stale_s: f32::NAN,
    };

    /// The first limit that is not positive: name and value.
    pub(crate) fn out_of_range(&self) -> Option<(&'static str, f32)> {
        [
            ("the limit of the excursion", self.excursion),
            ("the limit of the rate", self.rate),
            ("the limit of the duration", self.duration_s),
            ("the limit of the time without a switch", self.no_switch_s),
            ("the limit of a sample's age", self.stale_s),
        ]
        .into_iter()
        .find(|&(_, value)| value.is_nan() || value <= 0.0)
    }
}

/// Part of the allowed excursion within which the process has arrived at the reference.
const NEAR: f32 = 0.5;

/// Why a test ended with the safe controller. Exhaustive, because the C interface has a code for each reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Abort {
    /// The operator aborted the test.
    Operator,
    /// A time, a reference or a measurement is not finite.
    NotFinite,
    /// A sample is too old or ticks are too far apart: the age (s). Zero or less if the timestamp did not
    /// increase.
    Stale(f32),
    /// The output is too far from the reference: the distance (output unit).
    Excursion(f32),
    /// The output moves too fast: its rate (output unit / s).
    Rate(f32),
    /// The test takes too long: its duration (s).
    Duration(f32),
    /// The relay has not switched for too long: the time (s).
    NoOscillation(f32),
    /// None of the identification attempts led to a controller: reason of the last refusal.
    Refused(Refusal),
    /// The response with the new gains differs from the prediction: by how much (output unit).
    Mismatch(f32),
}

impl fmt::Display for Abort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Operator => write!(f, "aborted by the operator"),
            Self::NotFinite => write!(f, "a sample is not finite"),
            Self::Stale(v) if *v <= 0.0 => write!(f, "the timestamp did not increase"),
            Self::Stale(v) => write!(f, "a sample is {v} s old, or ticks are that far apart"),
            Self::Excursion(v) => write!(
                f,
                "the output is {v} from the reference, which exceeds the limit"
            ),
            Self::Rate(v) => write!(
                f,
                "the output moves at {v} per second, which exceeds the limit"
            ),
            Self::Duration(v) => write!(f, "the test has taken {v} s, which exceeds the limit"),
            Self::NoOscillation(v) => write!(f, "the relay has not switched for {v} s"),
            Self::Refused(why) => write!(f, "no controller found: {why}"),
            Self::Mismatch(v) => write!(f, "the response differs from the prediction by {v}"),
        }
    }
}

/// Motion of the process in a test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// Distance from the reference (output unit).
    pub(crate) distance: f32,
    /// Rate of the output (output unit / s).
    pub(crate) rate: f32,
    /// Time since the start of the test (s); `None` once a controller has been found.
    pub(crate) test_s: Option<f32>,
    /// Time since the last switch of the relay (s); `None` without a relay.
    pub(crate) since_switch_s: Option<f32>,
}

/// The limits and their state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guard {
    limits: Limits,
    /// Distance from the reference at the start (output unit), until the process has arrived.
    approach: Option<f32>,
}

impl Guard {
    pub(crate) fn new(limits: Limits) -> Self {
        Self {
            limits,
            approach: None,
        }
    }

    /// Begins a test at this distance from the reference.
    pub(crate) fn begin(&mut self, distance: f32) {
        self.approach = Some(distance);
    }

    /// Checks that sample and reference are finite and recent; `dt_s` is the time since the last tick.
    pub(crate) fn check_data(
        &self,
        measurement: &Measurement,
        reference: f32,
        dt_s: f32,
    ) -> Result<(), Abort> {
        if !(measurement.is_finite() && reference.is_finite() && dt_s.is_finite()) {
            return Err(Abort::NotFinite);
        }
        if dt_s <= 0.0 {
            return Err(Abort::Stale(dt_s));
        }
        let age_s = measurement.age_s.max(dt_s);
        if age_s > self.limits.stale_s {
            return Err(Abort::Stale(age_s));
        }
        Ok(())
    }

    /// Checks the limits of the motion.
    pub(crate) fn check_motion(&mut self, motion: &Motion) -> Result<(), Abort> {
        let distance = motion.distance.abs();
        if distance <= NEAR * self.limits.excursion {
            self.approach = None;
        }
        let allowed = self.approach.unwrap_or(0.0) + self.limits.excursion;
        if distance > allowed {
            return Err(Abort::Excursion(distance));
        }
        if motion.rate.abs() > self.limits.rate {
            return Err(Abort::Rate(motion.rate.abs()));
        }
        if let Some(test_s) = motion.test_s
            && test_s > self.limits.duration_s
        {
            return Err(Abort::Duration(test_s));
        }
        if let Some(since_s) = motion.since_switch_s
            && since_s > self.limits.no_switch_s
        {
            return Err(Abort::NoOscillation(since_s));
        }
        Ok(())
    }
}
