//! What stands between controller and process in a real loop: known filters, and execution at a sample period.
//!
//! A filter that the recording already contains belongs to the identified model: set only the others here, or set it as
//! [`Execution::recorded_filter`] if the model has its delay as dead time. A recording
//! shows the held output of a sampled controller as input, so the hold is never part of the dead time of the model.

use num_complex::Complex64;

/// Low-pass filter of unit gain in the loop.
///
/// | order | transfer function | cutoff frequency `f` (-3 dB) |
/// |-------|-------------------|------------------------------|
/// | 1 | `1/(T s + 1)` | `T = 1/(2 pi f)` |
/// | 2 | `1/(T^2 s^2/2 + T s + 1)`, damping ratio 0.707 (Butterworth) | `T = sqrt(2)/(2 pi f)` |
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LowPass {
    /// First order, with its time constant (s).
    FirstOrder(f64),
    /// Second order, with its time `T` (s).
    SecondOrder(f64),
}

impl LowPass {
    /// First-order filter with this cutoff frequency (Hz).
    #[must_use]
    pub fn first_order(cutoff_hz: f64) -> Self {
        Self::FirstOrder(1.0 / (std::f64::consts::TAU * cutoff_hz))
    }

    /// Second-order Butterworth filter with this cutoff frequency (Hz).
    #[must_use]
    pub fn second_order(cutoff_hz: f64) -> Self {
        Self::SecondOrder(std::f64::consts::SQRT_2 / (std::f64::consts::TAU * cutoff_hz))
    }

    /// Time `T` (s).
    #[must_use]
    pub fn time_s(self) -> f64 {
        match self {
            Self::FirstOrder(time_s) | Self::SecondOrder(time_s) => time_s,
        }
    }

    /// Frequency response at a frequency (rad/s).
    #[must_use]
    pub fn frequency_response(self, omega_rad_per_s: f64) -> Complex64 {
        let [c0, c1, c2] = self.denominator();
        let omega = omega_rad_per_s;
        Complex64::new(c0 - c2 * omega * omega, c1 * omega).inv()
    }

    /// Coefficients of the denominator: constant, s, s^2.
    pub(crate) fn denominator(self) -> [f64; 3] {
        match self {
            Self::FirstOrder(time_s) => [1.0, time_s, 0.0],
            Self::SecondOrder(time_s) => [1.0, time_s, 0.5 * time_s * time_s],
        }
    }

    /// The same filter in another unit of time.
    pub(crate) fn in_unit(self, unit_s: f64) -> Self {
        match self {
            Self::FirstOrder(time_s) => Self::FirstOrder(time_s / unit_s),
            Self::SecondOrder(time_s) => Self::SecondOrder(time_s / unit_s),
        }
    }
}

/// Filters and sampling of the loop that are not part of the model. `Default`: none, a continuous controller.
///
/// A controller that runs every `h` seconds and holds its output adds the dead time `h/2` of the hold and the
/// computation delay, usually `h`. For the maximum sensitivity this agrees with the exact sampled loop to 0.002 while the
/// product of `h` and the frequency of the peak is below 0.05 rad, and to 0.006 at 0.13 rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Execution {
    /// Filter of the measurement before the controller, for example the gyro low-pass of an autopilot.
    pub sensor_filter: Option<LowPass>,
    /// Filter of the measurement that the recording already contains, and whose delay at low frequencies ([`LowPass::time_s`])
    /// is part of the dead time of the model. The loop has the filter itself instead of this delay, so that the filter
    /// attenuates.
    pub recorded_filter: Option<LowPass>,
    /// Filter of the derivative term alone, for example the D low-pass of an autopilot.
    pub derivative_filter: Option<LowPass>,
    /// Sample period of the controller (s). Zero: continuous.
    pub sample_period_s: f64,
    /// Delay from sample to output (s), beside the hold.
    pub computation_delay_s: f64,
}

impl Execution {
    /// Controller that runs every `sample_period_s` seconds, and whose output leaves one period after its sample.
    #[must_use]
    pub fn sampled(sample_period_s: f64) -> Self {
        Self {
            sample_period_s,
            computation_delay_s: sample_period_s,
            ..Self::default()
        }
    }

    /// Sets the delay from sample to output (s). Zero if the output leaves in the same tick.
    #[must_use]
    pub fn with_computation_delay_s(self, computation_delay_s: f64) -> Self {
        Self {
            computation_delay_s,
            ..self
        }
    }

    /// Sets the filter of the measurement.
    #[must_use]
    pub fn with_sensor_filter(self, filter: LowPass) -> Self {
        Self {
            sensor_filter: Some(filter),
            ..self
        }
    }

    /// Sets the filter of the measurement whose delay is part of the dead time of the model.
    #[must_use]
    pub fn with_recorded_filter(self, filter: LowPass) -> Self {
        Self {
            recorded_filter: Some(filter),
            ..self
        }
    }

    /// Sets the filter of the derivative term.
    #[must_use]
    pub fn with_derivative_filter(self, filter: LowPass) -> Self {
        Self {
            derivative_filter: Some(filter),
            ..self
        }
    }

    /// Dead time of sampling (s): half a sample period of the hold, and the computation delay.
    #[must_use]
    pub fn dead_time_s(&self) -> f64 {
        0.5 * self.sample_period_s + self.computation_delay_s
    }

    /// Dead time (s) of the loop on a process with this dead time: that of sampling is added, that of the recorded filter is
    /// taken out.
    pub(crate) fn loop_dead_time_s(&self, tau_s: f64) -> f64 {
        let recorded_s = self.recorded_filter.map_or(0.0, LowPass::time_s);
        (tau_s - recorded_s).max(0.0) + self.dead_time_s()
    }

    /// The filters of the measurement: that of the recording first.
    pub(crate) fn measurement_filters(&self) -> [Option<LowPass>; 2] {
        [self.recorded_filter, self.sensor_filter]
    }

    /// Whether all times are finite and not negative.
    pub(crate) fn is_valid(&self) -> bool {
        let time = |filter: Option<LowPass>| filter.map_or(0.0, LowPass::time_s);
        [
            self.sample_period_s,
            self.computation_delay_s,
            time(self.sensor_filter),
            time(self.recorded_filter),
            time(self.derivative_filter),
        ]
        .iter()
        .all(|time_s| time_s.is_finite() && *time_s >= 0.0)
    }
}
