//! The law of a firmware's rate loop as far as its parameters tell: filters and rate of execution.
//!
//! ```text
//! PX4, Betaflight   u = F_u (P (r - y) + I int (r - y) dt - D d(F_d y)/dt + FF ...)
//! ArduPilot         u = P e + I int e dt + D d(F_d e)/dt + FF F_t r,     e = F_e (F_t r - y)
//! ```
//!
//! `y` is the gyro behind the filters that the log already contains. Reference: PX4 user guide, parameters `IMU_*` and
//! `MC_*`; ArduPilot `AC_PID`; Betaflight documentation, "PID controller", headers of blackbox.

use super::flight::{FirmwareKind, Flight};
use super::loops::Axis;

/// Low-pass filter of a firmware.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LowPassSetting {
    /// Cutoff frequency (Hz), above 0.
    pub cutoff_hz: f64,
    /// Order: 1, or 2 with a damping ratio of 0.707.
    pub order: u8,
}

/// Filters and execution of a rate loop.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct RateLaw {
    /// Sample period of the controller (s). `None`: the log does not tell.
    pub sample_period_s: Option<f64>,
    /// Whether the derivative acts on the error instead of the measurement.
    pub derivative_on_error: bool,
    /// Filters of the derivative term, in series.
    pub derivative: Vec<LowPassSetting>,
    /// Filter of the set-point.
    pub target: Option<LowPassSetting>,
    /// Filter of the error.
    pub error: Option<LowPassSetting>,
    /// Filter of the output.
    pub output: Option<LowPassSetting>,
}

fn low_pass(cutoff_hz: Option<f64>, order: u8) -> Option<LowPassSetting> {
    let cutoff_hz = cutoff_hz.filter(|hz| hz.is_finite() && *hz > 0.0)?;
    Some(LowPassSetting { cutoff_hz, order })
}

impl Flight {
    /// The law of the rate loop of an axis. Without parameters no filter is known.
    pub fn rate_law(&self, axis: Axis) -> RateLaw {
        match self.firmware.kind {
            FirmwareKind::Px4 => self.px4_law(axis),
            FirmwareKind::ArduPilot => self.ardupilot_law(axis),
            FirmwareKind::Betaflight | FirmwareKind::Inav => self.betaflight_law(),
        }
    }

    fn px4_law(&self, axis: Axis) -> RateLaw {
        let parameter = |name: &str| self.tables.parameter(name);
        let rate_hz = parameter("IMU_GYRO_RATEMAX").filter(|hz| *hz > 0.0);
        RateLaw {
            sample_period_s: rate_hz.map(f64::recip),
            derivative: low_pass(parameter("IMU_DGYRO_CUTOFF"), 2)
                .into_iter()
                .collect(),
            output: low_pass(parameter("MC_YAW_TQ_CUTOFF"), 1).filter(|_| axis == Axis::Yaw),
            ..RateLaw::default()
        }
    }

    fn ardupilot_law(&self, axis: Axis) -> RateLaw {
        let short = ["RLL", "PIT", "YAW"][axis.index()];
        let filter = |of: &str| {
            let name = format!("ATC_RAT_{short}_{of}");
            low_pass(self.tables.parameter(&name), 1)
        };
        let rate_hz = self.tables.parameter("SCHED_LOOP_RATE");
        RateLaw {
            sample_period_s: rate_hz.filter(|hz| *hz > 0.0).map(f64::recip),
            derivative_on_error: true,
            derivative: filter("FLTD").into_iter().collect(),
            target: filter("FLTT"),
            error: filter("FLTE"),
            output: None,
        }
    }

    /// Of a cutoff that rises with the throttle, the lower third of its range.
    fn betaflight_law(&self) -> RateLaw {
        let parameter = |name: &str| self.tables.parameter(name);
        let first = |names: [&str; 2]| names.into_iter().find_map(parameter);
        let dynamic = |at: usize| {
            let [new, old] = ["dterm_lpf1_dyn_hz", "dterm_lowpass_dyn_hz"];
            parameter(&format!("{new}[{at}]")).or_else(|| parameter(&format!("{old}[{at}]")))
        };
        let risen = dynamic(0)
            .zip(dynamic(1))
            .filter(|(low, high)| *low > 0.0 && high > low);
        let cutoff_hz = risen
            .map(|(low, high)| low + (high - low) / 3.0)
            .or_else(|| first(["dterm_lpf1_static_hz", "dterm_lowpass_hz"]));
        let order = |names: [&str; 2]| match first(names) {
            None | Some(0.0) => 1,
            Some(_) => 2,
        };
        let second_hz = first(["dterm_lpf2_static_hz", "dterm_lowpass2_hz"]);
        let filters = [
            low_pass(cutoff_hz, order(["dterm_lpf1_type", "dterm_filter_type"])),
            low_pass(second_hz, order(["dterm_lpf2_type", "dterm_filter2_type"])),
        ];
        let period_us = parameter("looptime").filter(|period| *period > 0.0);
        let divisor = parameter("pid_process_denom").filter(|divisor| *divisor >= 1.0);
        RateLaw {
            sample_period_s: period_us.map(|period| 1e-6 * period * divisor.unwrap_or(1.0)),
            derivative: filters.into_iter().flatten().collect(),
            ..RateLaw::default()
        }
    }
}
