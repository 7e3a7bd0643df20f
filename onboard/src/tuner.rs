//! Tuner of one axis in flight: from the safe controller through the relay test to the new controller (figure 1
//! of the paper).
//!
//! | phase    | output                            | leaves when                                       | to       |
//! |----------|-----------------------------------|---------------------------------------------------|----------|
//! | Idle     | safe controller, or another one   | [`TunerCore::start`]                              | TakeOff if set, else Relay |
//! | TakeOff  | integrator and relay (eq. 17)     | the relay has switched twice about the reference  | Relay    |
//! | Relay    | offset and relay                  | the cycles are complete and steady                | Identify |
//! | Identify | offset and relay; some slices of work per tick | a controller has been found          | Proposed, or Control without consent |
//! |          |                                   | the cycles were refused and attempts are left     | Relay    |
//! |          |                                   | a second amplitude is set and not yet tried       | Relay, at that amplitude |
//! | Proposed | safe controller, or another one   | [`TunerCore::accept`]; [`TunerCore::abort`] rejects it | Control; Aborted |
//! | Control  | controller found                  | (stays; proven when the response was as predicted)|          |
//! | Aborted  | safe controller                   | [`TunerCore::reset`]                              | Idle     |
//!
//! Every phase of a test changes to Aborted in the tick in which the guard finds a reason
//! ([`Abort`](crate::guard::Abort)), and the output of that tick is that of the safe controller. Until the new
//! controller has proven itself, the reference is that of the start of the test. With a bias filter it is the
//! mean output under the safe controller, so that the relay begins at rest even if the safe controller has a
//! steady-state error.
//!
//! [`Tuner`] does everything in one thread. For two, place a [`TunerCore`], an [`Analysis`], a
//! [`Bench`] and a [`Desk`]: the thread of the control loop calls
//! [`TunerCore::tick`] and, while it has the desk, [`TunerCore::conclude`]; as soon as
//! [`Desk::is_ordered`](crate::identification::Desk::is_ordered) the other thread gets the desk, calls [`Analysis::work`] until it
//! returns false, and gives it back.
//!
//! The work per tick is bounded, there is no heap, and samples that are not finite are never used.

mod core;
mod settings;

use ::core::ops::{Deref, DerefMut};

use crate::control::Measurement;
use crate::identification::{Analysis, Bench, Desk, Stage};
use crate::pack::Pack;

pub use self::core::TunerCore;
pub use self::settings::{CheckedSettings, Consent, TunerError, TunerSettings};
pub use crate::take_off::TakeOffSettings;

/// Phase of a tuner. Exhaustive, because the C interface has a code for each phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TunerPhase {
    /// The safe controller runs; no test has begun.
    Idle,
    /// The vehicle is lifted from the ground.
    TakeOff,
    /// The relay excites the oscillation.
    Relay,
    /// Process and controller are computed while the oscillation continues.
    Identify,
    /// A controller has been found and waits for consent; the safe controller runs.
    Proposed,
    /// The controller found runs.
    Control,
    /// The test has ended; the safe controller runs.
    Aborted,
}

impl TunerPhase {
    /// Name, for logs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::TakeOff => "takeoff",
            Self::Relay => "relay",
            Self::Identify => "identify",
            Self::Proposed => "proposed",
            Self::Control => "control",
            Self::Aborted => "aborted",
        }
    }
}

/// Tuner of one axis. See the [module](self).
pub struct Tuner<'a> {
    core: TunerCore,
    analysis: Analysis<'a>,
    desk: Desk,
    bench: Bench,
    slices: u16,
}

impl Tuner<'static> {
    /// A tuner with the embedded pack.
    ///
    /// # Errors
    /// The first setting that is out of range.
    pub fn new(settings: &TunerSettings) -> Result<Self, TunerError> {
        let pack = Pack::embedded().map_err(|_| TunerError::Pack)?;
        Self::with_pack(settings, pack)
    }
}

impl<'a> Tuner<'a> {
    /// A tuner with another pack.
    ///
    /// # Errors
    /// The first setting that is out of range.
    pub fn with_pack(settings: &TunerSettings, pack: Pack<'a>) -> Result<Self, TunerError> {
        if settings.slices == 0 {
            return Err(TunerError::NoWork);
        }
        Ok(Self {
            core: TunerCore::of(&settings.checked()?),
            analysis: Analysis::new(pack),
            desk: Desk::NEW,
            bench: Bench::NEW,
            slices: settings.slices,
        })
    }

    /// One tick. Takes time (s), measurement and reference (output unit); returns the input to hold until the next tick (input
    /// unit), which is always finite, and within the limits if it is the tuner's own ([`TunerCore::is_in_charge`]).
    #[inline]
    pub fn step(&mut self, time_s: f64, measurement: &Measurement, reference: f32) -> f32 {
        (self.core).tick(Some(&mut self.desk), time_s, measurement, reference);
        (self.analysis).work(&mut self.desk, &mut self.bench, self.slices);
        self.core.conclude(&mut self.desk)
    }

    /// Next step of the identification.
    #[must_use]
    pub fn stage(&self) -> Stage {
        if self.core.is_collecting() {
            Stage::Collect
        } else {
            self.analysis.stage()
        }
    }
}

impl Deref for Tuner<'_> {
    type Target = TunerCore;

    fn deref(&self) -> &TunerCore {
        &self.core
    }
}

impl DerefMut for Tuner<'_> {
    fn deref_mut(&mut self) -> &mut TunerCore {
        &mut self.core
    }
}
