//! Tuner of one axis in flight: from the safe controller through the relay test to the new controller (figure 1
//! of the paper).
//!
//! | phase    | output                            | leaves when                                       | to       |
//! |----------|-----------------------------------|---------------------------------------------------|----------|
//! | Idle     | safe controller                   | [`TunerCore::start`]                              | TakeOff if set, else Relay |
//! | TakeOff  | integrator and relay (eq. 17)     | the relay has switched twice about the reference  | Relay    |
//! | Relay    | offset and relay                  | the cycles are complete and steady                | Identify |
//! | Identify | offset and relay; some slices of work per tick | a controller has been found          | Control  |
//! |          |                                   | the cycles were refused and attempts are left     | Relay    |
//! |          |                                   | a second amplitude is set and not yet tried       | Relay, at that amplitude |
//! | Control  | controller found                  | (stays; proven when the response was as predicted)|          |
//! | Aborted  | safe controller                   | [`TunerCore::reset`]                              | Idle     |
//!
//! Every phase of a test changes to Aborted in the tick in which the guard finds a reason
//! ([`Abort`](crate::guard::Abort)), and the output of that tick is that of the safe controller. Until the new
//! controller has proven itself, the reference is that of the start of the test. With a bias filter it is the
//! mean output under the safe controller, so that the relay begins at rest even if the safe controller has a
//! steady-state error.
//!
//! The work per tick is bounded, there is no heap, and samples that are not finite are never used.

mod core;
mod settings;

use ::core::ops::{Deref, DerefMut};

use crate::control::Measurement;
use crate::identification::Workspace;
use crate::pack::Pack;

pub use self::core::TunerCore;
pub use self::settings::{CheckedSettings, TunerError, TunerSettings};
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
            Self::Control => "control",
            Self::Aborted => "aborted",
        }
    }
}

/// Tuner of one axis. See the [module](self).
pub struct Tuner<'a> {
    core: TunerCore<'a>,
    workspace: Workspace,
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
        Ok(Self {
            core: TunerCore::of(&settings.checked()?, pack),
            workspace: Workspace::NEW,
        })
    }

    /// One tick. Takes time (s), measurement and reference (output unit); returns the input to hold until the
    /// next tick (input unit), which is always finite and within the limits.
    #[inline]
    pub fn step(&mut self, time_s: f64, measurement: &Measurement, reference: f32) -> f32 {
        self.core
            .step(&mut self.workspace, time_s, measurement, reference)
    }
}

impl<'a> Deref for Tuner<'a> {
    type Target = TunerCore<'a>;

    fn deref(&self) -> &TunerCore<'a> {
        &self.core
    }
}

impl<'a> DerefMut for Tuner<'a> {
    fn deref_mut(&mut self) -> &mut TunerCore<'a> {
        &mut self.core
    }
}
