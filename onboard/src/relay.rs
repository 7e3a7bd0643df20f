//! Relay of the test: modified relay feedback test (MRFT) with protection against noise, bias and offsets.
//!
//! ```text
//! u = trim + h   while high, until  e <= -beta max(e since the switch)
//! u = trim - h   while low,  until  e >= -beta min(e since the switch)
//! ```
//!
//! | symbol | name        | unit                                                |
//! |--------|-------------|-----------------------------------------------------|
//! | e      | `error`     | output unit, reference minus measurement            |
//! | u      | returned    | input unit                                          |
//! | h      | `amplitude` | input unit, half the jump of the output             |
//! | beta   | `beta`      | -1 to 1, sine of the phase of the oscillation       |
//! | trim   | `trim`      | input unit, centre of the output                    |
//! | sigma  | noise sigma | output unit, standard deviation of the noise        |
//!
//! The oscillation has the phase `asin(beta)` (equations 4 and 5 of the paper). With a negative `beta` the relay
//! switches before the error crosses zero, with a positive one after. Equation 4 taken literally does not
//! oscillate for `beta < 0`; the rule above is its meaning.
//!
//! A real process has noise, a bias and an initial offset. Therefore the relay adds to the rule:
//!
//! - **pre-roll**: the output is zero while sigma is measured;
//! - **kick**: the output is high until the error exceeds 6 sigma, or what the output wanders at rest;
//! - **ramp**: from a large offset the first switches are those of a plain relay (`beta = 0`), then `beta` grows
//!   in steps, because a leading relay need not reach zero from there;
//! - **smoothing**: the error is smoothed over a few per cent of the half period;
//! - **dwell** and **stand-off**: an extremum counts when the signal has returned from it by 3 sigma, when it is
//!   6 sigma from the opposite extremum, and when part of a half period has passed;
//! - **undo**: if the signal passes the extremum of the last switch, that extremum was false: the switch is
//!   reversed and the old excursion continues;
//! - **turn-back**: if the signal turns back before it has reached zero, the switch came too early (large offset
//!   or bias): it is reversed, and the next switch is at zero;
//! - **trim**: the mean of `u` over a cycle is minus the input bias; the trim follows it, so that the
//!   oscillation becomes symmetric.
//!
//! Reference for the noise protection: A. Abdul Hay, M. Chehadeh, I. Boiko et al., "Unsupervised tuning of
//! multirotor dynamics" (2021).

mod settings;

use libm::sqrtf;

pub use self::settings::{RelayError, RelaySettings};

/// Distance in sigma at which the error has left the noise, and by which two extrema must differ.
const CLEAR_OF_NOISE_SIGMA: f32 = 6.0;
/// Distance in sigma by which the signal must return from an extremum for the extremum to count.
const COME_BACK_SIGMA: f32 = 3.0;
/// Distance in sigma by which the signal must pass an extremum to disprove it.
const DISPROVED_SIGMA: f32 = 2.5;
/// Number of switches after which the trim moves: one complete cycle. Under a large bias there may be no second
/// one.
const TRIM_FROM_SWITCH: u32 = 2;
/// Length of an excursion, in half periods, from which the trim has taken the authority from the relay: the trim
/// is reset.
const TRIM_LOST: f32 = 4.0;

/// Phase of the relay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RelayPhase {
    /// The output is zero; the noise is being measured.
    Preroll,
    /// The output is high until the error leaves the noise.
    Kick,
    /// The relay oscillates.
    Oscillate,
}

/// Excursion of the error between two switches. "Signed" errors are positive on the side of the excursion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Excursion {
    /// Largest signed error since the switch (output unit).
    peak: f32,
    /// Largest signed error of the previous excursion, positive on its own side (output unit).
    opposite_peak: f32,
    /// Time since the switch (s).
    elapsed_s: f32,
    /// Duration of the previous excursion (s).
    previous_s: f32,
    /// Duration of the excursion before the previous one (s).
    before_previous_s: f32,
    /// Whether to switch at zero instead of at `beta`, because the signal has turned back once.
    to_zero: bool,
    /// Time since the last rise (s), and within it the time high minus the time low (s).
    cycle_s: f32,
    cycle_high_less_low_s: f32,
    /// Centre of the relay's output when the excursion began (input unit).
    trim: f32,
}

/// Noise meter: second differences of white noise have six times its variance.
#[derive(Clone, Copy, Debug, Default)]
struct NoiseMeter {
    last: [f32; 2],
    seen: u32,
    sum_of_squares: f32,
}

impl NoiseMeter {
    fn push(&mut self, error: f32) {
        if self.seen >= 2 {
            let second_difference = error - 2.0 * self.last[0] + self.last[1];
            self.sum_of_squares += second_difference * second_difference;
        }
        self.last = [error, self.last[0]];
        self.seen += 1;
    }

    fn sigma(&self) -> f32 {
        let differences = self.seen.saturating_sub(2);
        if differences == 0 {
            0.0
        } else {
            sqrtf(self.sum_of_squares / (6.0 * differences as f32))
        }
    }
}

/// The relay: settings and state. See the [module](self) for the switching rule.
#[derive(Clone, Debug)]
pub struct Relay {
    settings: RelaySettings,
    phase: RelayPhase,
    noise: NoiseMeter,
    noise_sigma: f32,
    preroll_left_s: f32,
    /// +1 while the output is high, -1 while it is low.
    sign: f32,
    smoothed: f32,
    smoothing_gain: f32,
    smoothed_sigma: f32,
    excursion: Excursion,
    /// The last two excursions, latest first, as long as their switches can be reversed.
    undoable: [Option<Excursion>; 2],
    switches: u32,
    undone: u32,
    /// Share of `beta` used while high and while low. Halved when the signal turns back, one again when the trim
    /// moves.
    lead: [f32; 2],
    /// Target of the trim: the asymmetry, with the sign of the first cycle's.
    aim: Option<f32>,
    /// Error (output unit) within which the process is at rest, and whether it was there when the relay began.
    rest_level: f32,
    from_rest: bool,
}

impl Relay {
    /// A relay with these settings, ready for its first tick.
    ///
    /// # Errors
    /// The first setting that is out of range.
    pub fn new(settings: RelaySettings) -> Result<Self, RelayError> {
        settings.validate()?;
        let rest = Excursion {
            peak: 0.0,
            opposite_peak: 0.0,
            elapsed_s: 0.0,
            previous_s: 0.0,
            before_previous_s: 0.0,
            to_zero: false,
            cycle_s: 0.0,
            cycle_high_less_low_s: 0.0,
            trim: 0.0,
        };
        Ok(Self {
            settings,
            phase: if settings.preroll_s > 0.0 {
                RelayPhase::Preroll
            } else {
                RelayPhase::Kick
            },
            noise: NoiseMeter::default(),
            noise_sigma: settings.noise_sigma,
            preroll_left_s: settings.preroll_s,
            sign: 1.0,
            smoothed: 0.0,
            smoothing_gain: 1.0,
            smoothed_sigma: settings.noise_sigma,
            excursion: rest,
            undoable: [None; 2],
            switches: 0,
            undone: 0,
            lead: [1.0; 2],
            aim: None,
            rest_level: 0.0,
            from_rest: false,
        })
    }

    /// Counts the process as at rest within this error (output unit), besides the noise: where the noise of a sample is much
    /// smaller than what the output wanders, as behind a state estimator.
    pub fn begin_within(&mut self, level: f32) {
        self.rest_level = if level.is_finite() { level } else { 0.0 };
    }

    /// One tick. Takes the error `reference - measurement` (output unit) and the time since the last tick (s);
    /// returns the output to hold until the next tick (input unit).
    #[inline]
    pub fn step(&mut self, error: f32, dt_s: f32) -> f32 {
        match self.phase {
            RelayPhase::Oscillate => {
                self.follow(error, dt_s);
                if self.is_disproved() {
                    self.undo(false);
                } else if self.has_turned_back() {
                    self.undo(true);
                } else if self.is_due() {
                    self.switch(dt_s);
                }
            }
            RelayPhase::Preroll => return self.preroll(error, dt_s),
            RelayPhase::Kick => self.kick(error),
        }
        self.excursion.trim + self.sign * self.settings.amplitude
    }

    fn preroll(&mut self, error: f32, dt_s: f32) -> f32 {
        if error.is_finite() {
            self.noise.push(error);
        }
        self.preroll_left_s -= dt_s;
        if self.preroll_left_s <= 0.0 {
            self.noise_sigma = self.noise.sigma().max(self.settings.noise_sigma);
            self.smoothed_sigma = self.noise_sigma;
            self.phase = RelayPhase::Kick;
        }
        0.0
    }

    fn kick(&mut self, error: f32) {
        let rest_level = (CLEAR_OF_NOISE_SIGMA * self.noise_sigma).max(self.rest_level);
        if error.is_finite() && error.abs() > rest_level {
            self.sign = if error > 0.0 { 1.0 } else { -1.0 };
            self.smoothed = error;
            self.excursion.peak = error.abs();
            self.phase = RelayPhase::Oscillate;
        } else {
            self.from_rest = true;
        }
    }

    fn follow(&mut self, error: f32, dt_s: f32) {
        // A sample that is not finite carries no information; only time advances.
        if error.is_finite() {
            self.smoothed += self.smoothing_gain * (error - self.smoothed);
        }
        let (signed, half_period_s) = (self.signed(), self.half_period_s());
        let excursion = &mut self.excursion;
        excursion.elapsed_s += dt_s;
        excursion.cycle_s += dt_s;
        excursion.cycle_high_less_low_s += self.sign * dt_s;
        excursion.peak = excursion.peak.max(signed);
        if half_period_s > 0.0 && excursion.elapsed_s > TRIM_LOST * half_period_s {
            excursion.trim = 0.0;
        }
    }

    /// Smoothed error, positive on the side of the running excursion (output unit).
    fn signed(&self) -> f32 {
        self.sign * self.smoothed
    }

    /// Index of the output's level: 0 high, 1 low.
    fn side(&self) -> usize {
        usize::from(!self.is_high())
    }

    /// Whether the extremum of the last switch was false: the signal has passed it.
    fn is_disproved(&self) -> bool {
        self.undoable[0]
            .is_some_and(|last| -self.signed() > last.peak + DISPROVED_SIGMA * self.smoothed_sigma)
    }

    /// Whether the signal moves away from zero again before it has reached it.
    fn has_turned_back(&self) -> bool {
        let turned = self.excursion.peak - self.signed();
        self.undoable[0].is_some()
            && self.excursion.peak <= 0.0
            && turned > CLEAR_OF_NOISE_SIGMA * self.smoothed_sigma
    }

    /// Whether the running excursion has a genuine extremum and the error has fallen back far enough.
    fn is_due(&self) -> bool {
        let Excursion {
            peak,
            opposite_peak,
            elapsed_s,
            to_zero,
            ..
        } = self.excursion;
        let value = self.signed();
        let beta = if to_zero {
            0.0
        } else {
            self.lead[self.side()] * self.beta()
        };
        value <= -beta * peak
            && peak > 0.0
            && elapsed_s >= self.settings.dwell * self.half_period_s()
            && peak - value >= COME_BACK_SIGMA * self.smoothed_sigma
            && peak + opposite_peak >= CLEAR_OF_NOISE_SIGMA * self.smoothed_sigma
    }

    /// `beta` for this switch: zero for the plain switches, then rising in equal steps.
    fn beta(&self) -> f32 {
        let plain = u32::from(self.settings.plain_switches);
        let ramp = u32::from(self.settings.ramp_switches);
        if self.from_rest || self.switches >= plain + ramp {
            self.settings.beta
        } else {
            let Some(done) = self.switches.checked_sub(plain) else {
                return 0.0;
            };
            self.settings.beta * (done + 1) as f32 / (ramp + 1) as f32
        }
    }

    /// Mean duration of the last two excursions (s); zero until there are two.
    fn half_period_s(&self) -> f32 {
        let Excursion {
            previous_s,
            before_previous_s,
            ..
        } = self.excursion;
        if before_previous_s > 0.0 {
            0.5 * (previous_s + before_previous_s)
        } else {
            0.0
        }
    }

    fn switch(&mut self, dt_s: f32) {
        let ended = self.excursion;
        self.undoable = [Some(ended), self.undoable[0]];
        self.sign = -self.sign;
        self.switches += 1;
        self.excursion = Excursion {
            peak: self.signed(),
            opposite_peak: ended.peak,
            elapsed_s: 0.0,
            previous_s: ended.elapsed_s,
            before_previous_s: ended.previous_s,
            to_zero: false,
            ..ended
        };
        if self.sign > 0.0 {
            self.begin_cycle();
        }
        self.set_smoothing(dt_s);
    }

    /// Moves the trim by a share of the way to the value at which the last cycle would have had its target
    /// asymmetry.
    fn begin_cycle(&mut self) {
        let h = self.settings.amplitude;
        let Excursion {
            cycle_s,
            cycle_high_less_low_s,
            trim,
            ..
        } = self.excursion;
        if self.switches >= TRIM_FROM_SWITCH && cycle_s > 0.0 {
            let excess = cycle_high_less_low_s / cycle_s;
            let asymmetry = self.settings.asymmetry;
            let aim = *self.aim.get_or_insert(asymmetry.copysign(excess));
            let moved = trim + self.settings.trim_gain * h * (excess - aim);
            let limit = RelaySettings::TRIM_LIMIT * h;
            self.excursion.trim = moved.clamp(-limit, limit);
            if self.settings.trim_gain > 0.0 {
                self.lead = [1.0; 2];
            }
        }
        self.excursion.cycle_s = 0.0;
        self.excursion.cycle_high_less_low_s = 0.0;
    }

    /// Reverses the last switch and continues the excursion before it.
    fn undo(&mut self, to_zero: bool) {
        if let Some(last) = self.undoable[0] {
            let wrong_s = self.excursion.elapsed_s;
            self.excursion = Excursion {
                peak: last.peak.max(-self.signed()),
                elapsed_s: last.elapsed_s + wrong_s,
                to_zero,
                cycle_s: last.cycle_s + wrong_s,
                cycle_high_less_low_s: last.cycle_high_less_low_s + self.sign * wrong_s,
                ..last
            };
            self.sign = -self.sign;
            if to_zero {
                self.lead[self.side()] *= 0.5;
            }
            self.undoable = [self.undoable[1], None];
            self.switches -= 1;
            self.undone += 1;
        }
    }

    /// First-order smoothing with the variance and the mean delay of an average of `n` samples.
    fn set_smoothing(&mut self, dt_s: f32) {
        let span_s = self.settings.smoothing * self.half_period_s();
        let n = if dt_s > 0.0 {
            (span_s / dt_s).max(1.0)
        } else {
            1.0
        };
        self.smoothing_gain = 2.0 / (n + 1.0);
        self.smoothed_sigma = self.noise_sigma / sqrtf(n);
    }

    /// Changes the phase of the oscillation, `asin(beta)`, from the next tick on. The running excursion and the
    /// state are kept.
    ///
    /// # Errors
    /// [`RelayError::Beta`] unless `beta` is between -1 and 1; the relay is unchanged then.
    pub fn set_beta(&mut self, beta: f32) -> Result<(), RelayError> {
        let settings = RelaySettings {
            beta,
            ..self.settings
        };
        settings.validate()?;
        self.settings = settings;
        Ok(())
    }

    /// Changes half the jump of the output (input unit) from the next tick on. The running excursion and the state are kept.
    ///
    /// # Errors
    /// [`RelayError::Amplitude`] unless `amplitude` is positive and finite; the relay is unchanged then.
    pub fn set_amplitude(&mut self, amplitude: f32) -> Result<(), RelayError> {
        let settings = RelaySettings {
            amplitude,
            ..self.settings
        };
        settings.validate()?;
        self.settings = settings;
        Ok(())
    }

    /// What the relay is doing.
    #[must_use]
    pub fn phase(&self) -> RelayPhase {
        self.phase
    }

    /// Whether the output is high.
    #[must_use]
    pub fn is_high(&self) -> bool {
        self.sign > 0.0
    }

    /// Number of switches made, without those reversed.
    #[must_use]
    pub fn switches(&self) -> u32 {
        self.switches
    }

    /// Number of switches reversed.
    #[must_use]
    pub fn undone(&self) -> u32 {
        self.undone
    }

    /// Centre of the output (input unit). Once settled it is minus the input bias.
    #[must_use]
    pub fn trim(&self) -> f32 {
        self.excursion.trim
    }

    /// Standard deviation of the noise, measured or given (output unit).
    #[must_use]
    pub fn noise_sigma(&self) -> f32 {
        self.noise_sigma
    }
}

#[cfg(test)]
mod tests;
