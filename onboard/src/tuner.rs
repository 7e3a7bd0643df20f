//! The switch from identification to control in flight: the paper's figure 1.
//!
//! | phase    | output                            | leaves when                                       | to       |
//! |----------|-----------------------------------|---------------------------------------------------|----------|
//! | Idle     | safe controller                   | [`Core::start`]                                  | TakeOff, or Relay without one |
//! | TakeOff  | integrator and relay (eq. 17)     | the relay has switched twice about the reference  | Relay    |
//! | Relay    | offset and relay                  | the cycles asked for are complete and steady      | Identify |
//! | Identify | offset and relay, slices each tick | a controller has been found                       | Control  |
//! |          |                                   | the cycles were refused and attempts are left     | Relay    |
//! | Control  | the controller that was found     | (stays; proven when the response was as predicted)|          |
//! | Aborted  | safe controller                   | [`Core::reset`]                                  | Idle     |
//!
//! Every phase of a test goes to Aborted in the tick in which the guard says so ([`Abort`](crate::guard::Abort) has the
//! reasons), and that tick's output is the safe controller's. Until the new controller has proven itself
//! (predicted, then checked) the reference is that of the start; with a bias filter it is where the safe
//! controller held the process, so that the relay begins at rest however far off that was.
//!
//! One tick is bounded work without a heap; samples that are no numbers are never passed on.

mod core;
mod settings;

use ::core::ops::{Deref, DerefMut};

use crate::control::Measurement;
use crate::identification::Workspace;
use crate::pack::Pack;

pub use self::core::Core;
pub use self::settings::{CheckedSettings, TunerError, TunerSettings};
pub use crate::take_off::TakeOffSettings;

/// What a tuner is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TunerPhase {
    /// Nothing yet: the safe controller.
    Idle,
    /// Lifting the vehicle from the ground.
    TakeOff,
    /// Exciting the oscillation.
    Relay,
    /// Finding process and controller from it while it goes on.
    Identify,
    /// Flying the controller that was found.
    Control,
    /// The test has ended in the safe controller.
    Aborted,
}

impl TunerPhase {
    /// Its name, for logs.
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

/// The tuner of one axis. See the [module](self).
pub struct Tuner<'a> {
    core: Core<'a>,
    room: Workspace,
}

impl Tuner<'static> {
    /// With the pack that is built in.
    ///
    /// # Errors
    /// Names the setting that is out of range.
    pub fn new(settings: &TunerSettings) -> Result<Self, TunerError> {
        let pack = Pack::embedded().map_err(|_| TunerError::Pack)?;
        Self::with_pack(settings, pack)
    }
}

impl<'a> Tuner<'a> {
    /// With a pack of one's own.
    ///
    /// # Errors
    /// Names the setting that is out of range.
    pub fn with_pack(settings: &TunerSettings, pack: Pack<'a>) -> Result<Self, TunerError> {
        Ok(Self {
            core: Core::of(&settings.checked()?, pack),
            room: Workspace::NEW,
        })
    }

    /// One tick: time (s), what the sensor says, where the output should be (output unit). Returns the
    /// input to hold until the next tick (input unit), always finite and within the limits.
    #[inline]
    pub fn step(&mut self, time_s: f64, measurement: &Measurement, reference: f32) -> f32 {
        self.core
            .step(&mut self.room, time_s, measurement, reference)
    }
}

impl<'a> Deref for Tuner<'a> {
    type Target = Core<'a>;

    fn deref(&self) -> &Core<'a> {
        &self.core
    }
}

impl<'a> DerefMut for Tuner<'a> {
    fn deref_mut(&mut self) -> &mut Core<'a> {
        &mut self.core
    }
}
