//! PID law as it runs at every tick: measurement filter, set-point weight, output limits, anti-windup, bumpless
//! take-over.
//!
//! ```text
//! u = kp (b r - yf) + ki int (r - yf) dt - kd dyf/dt,     yf = F y,     F = 1/(1 + Tf s + (Tf s)^2/2)
//! ```
//!
//! | symbol | name                 | unit                          |
//! |--------|----------------------|-------------------------------|
//! | kp     | `kp`                 | input unit / output unit      |
//! | ki     | `ki`                 | input unit / (output unit s)  |
//! | kd     | `kd`                 | input unit s / output unit    |
//! | Tf     | `filter_s`           | s                             |
//! | b      | `setpoint_weight`    | 0 to 1                        |
//! | h      | `dt_s`               | s, may differ at every tick   |
//! | u      | returned             | input unit                    |
//! | r, y   | `reference`, `value` | output unit                   |
//!
//! # Discretisation
//!
//! The integral is a backward Euler sum, the filter bilinear; its second state is `dyf/dt`. At a constant `h`, with
//! `z` the shift by one tick and `s = (2/h) (z - 1)/(z + 1)`, the law is exactly
//!
//! ```text
//! U = kp (b R - F(s) Y) + ki h z/(z - 1) (R - F(s) Y) - kd s F(s) Y
//! ```
//!
//! Up to the square of `h` this is the continuous law with `kp + ki h/2` in place of `kp`, behind the hold's `h/2` of dead
//! time: `Ms` agrees to 1e-5 at 2.5 ms and to 1.1e-4 at 10 ms (`plant/tests/it/pid.rs`).
//!
//! Without a filter (`Tf = 0`) `dyf/dt` is the difference of two values over `h`, with `z` the same as `s = (z - 1)/(h z)`.
//! A rate that a sensor measures replaces `dyf/dt`, behind a filter `F` of its own. Choose `Tf` zero or at least `h`: a
//! shorter filter rings.
//!
//! `b` weighs the changes of the reference since the last take-over, reset or start. The constant that this adds to
//! the law belongs to the integral, and far from zero no digits are lost.
//!
//! # Limits
//!
//! While the output is limited, back-calculation draws the integral back with the tracking time `sqrt(kd/ki)` (without
//! `kd`: `kp/ki`): `tests/it/pid.rs` compares it with conditional integration. Reference: K. J. Astrom, T. Hagglund,
//! "Advanced PID Control" (ISA, 2006), sections 3.2, 3.5 and 13.4.

use core::fmt;

use libm::sqrtf;

use crate::control::{Measurement, Pd};

/// Gains, filter and limits of a [`PidLaw`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PidSettings {
    /// Proportional gain (input unit / output unit).
    pub kp: f32,
    /// Integral gain (input unit / (output unit s)). Zero: a constant offset in place of the integral.
    pub ki: f32,
    /// Derivative gain, on the measurement (input unit s / output unit).
    pub kd: f32,
    /// Time `Tf` of the measurement filter (s). Zero: no filter.
    pub filter_s: f32,
    /// Weight `b` of the reference in the proportional term, 0 to 1.
    pub setpoint_weight: f32,
    /// Lower limit of the output (input unit).
    pub output_lowest: f32,
    /// Upper limit of the output (input unit).
    pub output_highest: f32,
}

impl PidSettings {
    /// These gains, without filter and limits, with set-point weight 1.
    #[must_use]
    pub fn new(kp: f32, ki: f32, kd: f32) -> Self {
        Self {
            kp,
            ki,
            kd,
            filter_s: 0.0,
            setpoint_weight: 1.0,
            output_lowest: f32::MIN,
            output_highest: f32::MAX,
        }
    }

    /// Sets the time of the measurement filter (s).
    #[must_use]
    pub fn with_filter_s(self, filter_s: f32) -> Self {
        Self { filter_s, ..self }
    }

    /// Sets the set-point weight.
    #[must_use]
    pub fn with_setpoint_weight(self, setpoint_weight: f32) -> Self {
        Self {
            setpoint_weight,
            ..self
        }
    }

    /// Sets the limits of the output (input unit).
    #[must_use]
    pub fn with_limits(self, output_lowest: f32, output_highest: f32) -> Self {
        Self {
            output_lowest,
            output_highest,
            ..self
        }
    }

    /// The first setting that is out of range.
    fn check(&self) -> Result<(), PidError> {
        let gains = [("kp", self.kp), ("ki", self.ki), ("kd", self.kd)];
        if let Some(&(name, value)) = gains.iter().find(|(_, gain)| !gain.is_finite()) {
            return Err(PidError::Gain(name, value));
        }
        if gains.iter().any(|(_, gain)| *gain > 0.0) && gains.iter().any(|(_, gain)| *gain < 0.0) {
            return Err(PidError::Signs);
        }
        if !(self.filter_s.is_finite() && self.filter_s >= 0.0) {
            return Err(PidError::Filter(self.filter_s));
        }
        if !(0.0..=1.0).contains(&self.setpoint_weight) {
            return Err(PidError::SetpointWeight(self.setpoint_weight));
        }
        let (lowest, highest) = (self.output_lowest, self.output_highest);
        if !(lowest.is_finite() && highest.is_finite() && lowest < highest) {
            return Err(PidError::OutputLimits(lowest, highest));
        }
        Ok(())
    }

    /// Proportional and derivative term at a state.
    #[inline]
    fn terms(&self, state: &State) -> (f32, f32) {
        let change = state.reference - state.origin;
        let error = state.reference - state.value.output;
        let weighted = error - (1.0 - self.setpoint_weight) * change;
        (self.kp * weighted, -self.kd * state.rate)
    }

    fn limited(&self, input: f32) -> f32 {
        input.max(self.output_lowest).min(self.output_highest)
    }

    /// Time in which the integral follows a limited output (s); zero follows at once.
    fn tracking_s(&self) -> f32 {
        let square = self.kd / self.ki;
        if square > 0.0 {
            sqrtf(square)
        } else {
            self.kp / self.ki
        }
    }
}

/// Setting out of range, with its value. Exhaustive, because the C interface has a code for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PidError {
    /// A gain is not finite: its name and value.
    Gain(&'static str, f32),
    /// Two gains have opposite signs.
    Signs,
    /// The time of the filter is negative or not finite.
    Filter(f32),
    /// The set-point weight is not between 0 and 1.
    SetpointWeight(f32),
    /// The lower output limit is not below the upper one, or one is not finite.
    OutputLimits(f32, f32),
}

impl fmt::Display for PidError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gain(name, value) => write!(f, "the gain {name} must be finite, but is {value}"),
            Self::Signs => write!(f, "kp, ki and kd must have the same sign"),
            Self::Filter(value) => write!(
                f,
                "the filter's time must be zero or a positive time, but is {value} s"
            ),
            Self::SetpointWeight(value) => {
                write!(f, "the set-point weight must be 0 to 1, but is {value}")
            }
            Self::OutputLimits(lowest, highest) => write!(
                f,
                "the lower output limit must be below the upper one, but they are {lowest} and {highest}"
            ),
        }
    }
}

impl core::error::Error for PidError {}

/// What the output of a tick was. Exhaustive, because the C interface has a code for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PidStatus {
    /// The output is that of the law.
    Free,
    /// The output is at its lower limit.
    AtLowest,
    /// The output is at its upper limit.
    AtHighest,
    /// A number was not finite, or the time step not positive. The last output was held, and nothing else changed.
    Held,
}

/// Filter of a measured number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Filter {
    input: f32,
    output: f32,
    slope: f32,
}

impl Filter {
    fn at(input: f32) -> Self {
        Self {
            input,
            output: input,
            slope: 0.0,
        }
    }

    /// Trapezoidal rule for `output' = slope`, `slope' = (2/Tf^2) (input - output) - (2/Tf) slope`, solved for the sum
    /// of the slopes at both ends of the tick.
    #[inline]
    fn step(&mut self, input: f32, dt_s: f32, filter_s: f32) {
        if filter_s > 0.0 {
            let q = 0.5 * dt_s / filter_s;
            let pull = (self.input - self.output) + (input - self.output);
            let sum = 2.0 * (self.slope + q / filter_s * pull) / (1.0 + 2.0 * q * (1.0 + q));
            self.slope = sum - self.slope;
            self.output += 0.5 * dt_s * sum;
        } else {
            self.slope = (input - self.input) / dt_s;
            self.output = input;
        }
        self.input = input;
    }
}

/// State of a law.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct State {
    /// Integral with the offset (input unit). In double precision, because a step of it may be below the rounding of
    /// single precision.
    integral: f64,
    reference: f32,
    /// Reference from which the set-point weight counts.
    origin: f32,
    value: Filter,
    measured_rate: Filter,
    /// Rate in the derivative term.
    rate: f32,
}

impl State {
    /// At rest at this measurement.
    fn at(measurement: &Measurement, reference: f32) -> Self {
        let rate = measurement.rate.unwrap_or(0.0);
        Self {
            reference,
            origin: reference,
            value: Filter::at(measurement.value),
            measured_rate: Filter::at(rate),
            rate,
            ..Self::default()
        }
    }

    #[inline]
    fn measure(&mut self, measurement: &Measurement, dt_s: f32, filter_s: f32) {
        self.value.step(measurement.value, dt_s, filter_s);
        self.rate = self.value.slope;
        if let Some(rate) = measurement.rate {
            self.measured_rate.step(rate, dt_s, filter_s);
            self.rate = self.measured_rate.output;
        }
    }
}

/// PID law with its state. See the [module](self).
///
/// ```
/// use onecycle_onboard::control::Measurement;
/// use onecycle_onboard::pid::{PidLaw, PidSettings, PidStatus};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut law = PidLaw::new(PidSettings::new(2.0, 1.0, 0.5).with_limits(-1.0, 1.0))?;
/// // An old controller has held the process at 0.1 with an output of 0.3; the new law goes on from there.
/// law.take_over(0.1, &Measurement::of(0.1), 0.3);
/// assert_eq!(law.step(0.01, 0.1, &Measurement::of(0.1)), 0.3);
/// // The limit.
/// assert_eq!(law.step(0.01, 1.0, &Measurement::of(0.1)), 1.0);
/// assert_eq!(law.status(), PidStatus::AtHighest);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidLaw {
    settings: PidSettings,
    tracking_s: f32,
    /// `None` before the first tick.
    state: Option<State>,
    /// Integral (input unit) and origin (output unit) at the first tick.
    start: (f32, f32),
    command: f32,
    status: PidStatus,
}

impl PidLaw {
    /// A law whose first tick starts with an integral of zero.
    ///
    /// # Errors
    /// The first setting that is out of range.
    pub fn new(settings: PidSettings) -> Result<Self, PidError> {
        settings.check()?;
        Ok(Self {
            settings,
            tracking_s: settings.tracking_s(),
            state: None,
            start: (0.0, 0.0),
            command: settings.limited(0.0),
            status: PidStatus::Free,
        })
    }

    /// The same law, starting with the input `offset` (input unit) that holds the process at rest at `reference`
    /// (output unit).
    #[must_use]
    pub fn started_at(mut self, reference: f32, offset: f32) -> Self {
        self.reset();
        if reference.is_finite() && offset.is_finite() {
            self.start = (offset, reference);
            self.command = self.settings.limited(offset);
        }
        self
    }

    /// Output to hold until the next tick (input unit), `dt_s` after the last. Takes reference and measurement (output
    /// unit). The output is always finite and within the limits; [`PidLaw::status`] tells whether it was limited or
    /// held.
    #[inline]
    pub fn step(&mut self, dt_s: f32, reference: f32, measurement: &Measurement) -> f32 {
        let is_right =
            dt_s > 0.0 && dt_s.is_finite() && reference.is_finite() && measurement.is_finite();
        let mut next = match self.state {
            _ if !is_right => return self.hold(),
            Some(state) => state,
            None => State {
                integral: f64::from(self.start.0),
                origin: self.start.1,
                ..State::at(measurement, reference)
            },
        };
        let settings = &self.settings;
        next.reference = reference;
        next.measure(measurement, dt_s, settings.filter_s);
        if settings.ki != 0.0 {
            let error = reference - next.value.output;
            next.integral += f64::from(settings.ki * dt_s * error);
        }
        let (proportional, derivative) = settings.terms(&next);
        let wanted = next.integral as f32 + proportional + derivative;
        let command = settings.limited(wanted);
        if settings.ki != 0.0 && command != wanted {
            let share = dt_s / (dt_s + self.tracking_s);
            next.integral += f64::from(share * (command - wanted));
        }
        if !(wanted.is_finite() && next.rate.is_finite() && next.integral.is_finite()) {
            return self.hold();
        }
        self.status = if wanted > command {
            PidStatus::AtHighest
        } else if wanted < command {
            PidStatus::AtLowest
        } else {
            PidStatus::Free
        };
        self.state = Some(next);
        self.command = command;
        command
    }

    fn hold(&mut self) -> f32 {
        self.status = PidStatus::Held;
        self.command
    }

    /// Takes over from another controller that gives `command` (input unit) at this reference and measurement: the
    /// output of the next tick differs from it by what changes until then, and by `ki dt (r - y)`. Without an integral
    /// the difference stays as an offset. If a number is not finite nothing changes, and the status is
    /// [`PidStatus::Held`].
    pub fn take_over(&mut self, reference: f32, measurement: &Measurement, command: f32) {
        let mut state = State::at(measurement, reference);
        let (proportional, derivative) = self.settings.terms(&state);
        let limited = self.settings.limited(command);
        let integral = f64::from(limited) - f64::from(proportional + derivative);
        let is_right = command.is_finite() && reference.is_finite() && measurement.is_finite();
        if !(is_right && integral.is_finite()) {
            self.hold();
            return;
        }
        state.integral = integral;
        self.state = Some(state);
        self.command = limited;
        self.status = PidStatus::Free;
    }

    /// Changes gains, filter or limits without a jump of the output, beside that of new limits: the integral takes up
    /// the difference.
    ///
    /// # Errors
    /// The first setting that is out of range; the law then goes on with the old ones.
    pub fn change(&mut self, settings: PidSettings) -> Result<(), PidError> {
        settings.check()?;
        if let Some(state) = &mut self.state {
            let [before, after] = [&self.settings, &settings].map(|settings| {
                let (proportional, derivative) = settings.terms(state);
                f64::from(proportional + derivative)
            });
            if (before - after).is_finite() {
                state.integral += before - after;
            }
        }
        self.tracking_s = settings.tracking_s();
        self.command = settings.limited(self.command);
        self.settings = settings;
        Ok(())
    }

    /// Back to the state of [`PidLaw::new`].
    pub fn reset(&mut self) {
        self.state = None;
        self.start = (0.0, 0.0);
        self.command = self.settings.limited(0.0);
        self.status = PidStatus::Free;
    }

    /// Gains, filter and limits.
    #[must_use]
    pub fn settings(&self) -> &PidSettings {
        &self.settings
    }

    /// Integral with the offset (input unit): the input that the law has found to hold the process at rest.
    #[must_use]
    pub fn integral(&self) -> f32 {
        self.state
            .map_or(self.start.0, |state| state.integral as f32)
    }

    /// The last output (input unit).
    #[must_use]
    pub fn command(&self) -> f32 {
        self.command
    }

    /// What the last output was.
    #[must_use]
    pub fn status(&self) -> PidStatus {
        self.status
    }
}

impl From<Pd> for PidSettings {
    fn from(pd: Pd) -> Self {
        Self::new(pd.kp as f32, 0.0, pd.kd as f32)
    }
}

#[cfg(test)]
mod tests;
