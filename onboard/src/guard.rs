//! The limits of a test in flight: what must never happen, and what is said when it does.
//!
//! Checked at every tick before any output is made, so a limit that is passed ends the test in that
//! very tick. What is over is over: the first reason stays.

use core::fmt;

use crate::control::Measurement;
use crate::identification::Refusal;

/// What must never happen. Every limit is positive; `f32::INFINITY` switches one off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest distance of the output from the reference (output unit). Until the process has first come
    /// within half of it, as at a take-off, it counts from where the process began.
    pub excursion: f32,
    /// Largest rate of the output (output unit / s).
    pub rate: f32,
    /// Longest test, from its start to the controller's (s).
    pub duration_s: f32,
    /// Longest time without a switch of the relay (s).
    pub no_switch_s: f32,
    /// Oldest sample, and longest time between ticks (s).
    pub stale_s: f32,
}

impl Limits {
    /// None but those of the data: finite samples, time that goes on.
    pub const NONE: Self = Self {
        excursion: f32::INFINITY,
        rate: f32::INFINITY,
        duration_s: f32::INFINITY,
        no_switch_s: f32::INFINITY,
        stale_s: f32::INFINITY,
    };

    /// The first limit that is not positive: its name and value.
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

/// The process has come near when it is within this part of the excursion allowed.
const NEAR: f32 = 0.5;

/// Why a test ended in the safe controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Abort {
    /// The operator said so.
    Operator,
    /// A time, a reference or a measurement that is no finite number.
    NotFinite,
    /// A sample of this age, or ticks so far apart (s); zero or less where time stood still or ran back.
    Stale(f32),
    /// The output was so far from the reference (output unit).
    Excursion(f32),
    /// The output moved so fast (output unit / s).
    Rate(f32),
    /// The test took so long (s).
    Duration(f32),
    /// The relay did not switch for so long (s).
    NoOscillation(f32),
    /// No cycle that was looked at led to a controller: why the last one did not.
    Refused(Refusal),
    /// The response under the new gains was so far from the predicted one (output unit).
    Mismatch(f32),
}

impl fmt::Display for Abort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Operator => write!(f, "aborted by the operator"),
            Self::NotFinite => write!(f, "a sample is no finite number"),
            Self::Stale(v) if *v <= 0.0 => write!(f, "the time does not go on"),
            Self::Stale(v) => write!(f, "a sample is {v} s old"),
            Self::Excursion(v) => write!(f, "the output is {v} away from the reference"),
            Self::Rate(v) => write!(f, "the output moves by {v} a second"),
            Self::Duration(v) => write!(f, "the test has taken {v} s"),
            Self::NoOscillation(v) => write!(f, "the relay has not switched for {v} s"),
            Self::Refused(why) => write!(f, "no controller: {why}"),
            Self::Mismatch(v) => write!(f, "the response is {v} off the predicted one"),
        }
    }
}

/// How the process moves in a test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// From the reference (output unit).
    pub(crate) distance: f32,
    /// Of the output (output unit / s).
    pub(crate) rate: f32,
    /// Since the test's start (s); `None` once it has led to a controller.
    pub(crate) test_s: Option<f32>,
    /// Since the relay's last switch (s); `None` where there is no relay.
    pub(crate) since_switch_s: Option<f32>,
}

/// The limits and what they must remember.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guard {
    limits: Limits,
    /// Distance from the reference at the start, until the process has come near (output unit).
    approach: Option<f32>,
}

impl Guard {
    pub(crate) fn new(limits: Limits) -> Self {
        Self {
            limits,
            approach: None,
        }
    }

    /// A test begins at this distance from the reference.
    pub(crate) fn begin(&mut self, distance: f32) {
        self.approach = Some(distance);
    }

    /// Whether the numbers are such that anything can be computed from them; `dt_s` after the tick before.
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

    /// Whether the test may go on.
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
