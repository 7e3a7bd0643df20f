//! PID law for C, by itself.

use core::mem::MaybeUninit;

use onecycle_onboard::control::Measurement;
use onecycle_onboard::pid::{PidError, PidLaw, PidSettings, PidStatus};

use crate::settings::OnecycleStatus;
use crate::{OnecycleMeasurement, measurement_of};

/// Size of a PID law in words of eight bytes.
pub const ONECYCLE_PID_WORDS: usize = 18;

/// Mark of memory that holds a law: "ONECYPID".
const ALIVE: u64 = u64::from_le_bytes(*b"ONECYPID");

/// Layout of the memory of a law.
#[repr(C)]
struct Placed {
    alive: u64,
    law: MaybeUninit<PidLaw>,
}

const _: () = assert!(
    size_of::<Placed>() <= size_of::<OnecyclePid>()
        && align_of::<Placed>() <= align_of::<OnecyclePid>()
);

/// Memory for one PID law, static or anywhere else. Its contents are private.
#[repr(C)]
pub struct OnecyclePid {
    /// Private.
    pub memory: [u64; ONECYCLE_PID_WORDS],
}

/// Settings of a PID law. Start from onecycle_pid_settings_default.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct OnecyclePidSettings {
    /// Proportional gain (input unit / output unit).
    pub kp: f32,
    /// Integral gain (input unit / (output unit s)); 0: a constant offset in place of the integral.
    pub ki: f32,
    /// Derivative gain, on the measurement (input unit s / output unit).
    pub kd: f32,
    /// Time of the second-order measurement filter (s), zero or at least a tick; 0: no filter.
    pub filter_s: f32,
    /// Weight of the reference in the proportional term, 0 to 1.
    pub setpoint_weight: f32,
    /// Lower limit of the output (input unit).
    pub output_lowest: f32,
    /// Upper limit of the output (input unit).
    pub output_highest: f32,
}

/// What the last output of a PID law was.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum OnecyclePidOutput {
    /// The memory holds no law.
    None,
    /// The output is that of the law.
    Free,
    /// The output is at its lower limit.
    AtLowest,
    /// The output is at its upper limit.
    AtHighest,
    /// A number was not finite, or the time step not positive. The last output was held.
    Held,
}

impl OnecyclePidSettings {
    fn to_settings(self) -> PidSettings {
        PidSettings::new(self.kp, self.ki, self.kd)
            .with_filter_s(self.filter_s)
            .with_setpoint_weight(self.setpoint_weight)
            .with_limits(self.output_lowest, self.output_highest)
    }
}

impl From<PidError> for OnecycleStatus {
    fn from(error: PidError) -> Self {
        match error {
            PidError::Gain(..) => Self::Gain,
            PidError::Signs => Self::GainSigns,
            PidError::Filter(_) => Self::Filter,
            PidError::SetpointWeight(_) => Self::SetpointWeight,
            PidError::OutputLimits(..) => Self::OutputLimits,
        }
    }
}

impl OnecyclePid {
    fn placed_mut(&mut self) -> &mut Placed {
        // SAFETY: the size and alignment are asserted above, and any bits are a valid `Placed`.
        unsafe { &mut *(&raw mut *self).cast() }
    }
}

/// The law behind a pointer from C, if there is one.
///
/// # Safety
/// The pointer is null, or what it points to is valid, aligned and not used by anybody else meanwhile.
unsafe fn law_at<'a>(pid: *mut OnecyclePid) -> Option<&'a mut PidLaw> {
    // SAFETY: the caller's promise.
    let placed = unsafe { pid.as_mut() }?.placed_mut();
    // SAFETY: the first word shows that `onecycle_pid_init` has written a law, and the caller of every function
    // promises that nothing else has written to the memory since.
    (placed.alive == ALIVE).then(|| unsafe { placed.law.assume_init_mut() })
}

/// # Safety
/// The pointer is null or points to a valid measurement. A missing one counts as one that is not finite.
unsafe fn measured(measurement: *const OnecycleMeasurement) -> Measurement {
    // SAFETY: the caller's promise.
    measurement_of(unsafe { measurement.as_ref() })
}

/// Settings of a PID law with these gains, without filter and limits, with set-point weight 1.
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_pid_settings_default(kp: f32, ki: f32, kd: f32) -> OnecyclePidSettings {
    let new = PidSettings::new(kp, ki, kd);
    OnecyclePidSettings {
        kp,
        ki,
        kd,
        filter_s: new.filter_s,
        setpoint_weight: new.setpoint_weight,
        output_lowest: new.output_lowest,
        output_highest: new.output_highest,
    }
}

/// Initialises a PID law in the memory, with an integral of zero. Any status but ONECYCLE_STATUS_OK names the setting
/// that is out of range; the memory then holds no law.
///
/// # Safety
/// Both pointers are null or point to valid objects of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_pid_init(
    pid: *mut OnecyclePid,
    settings: *const OnecyclePidSettings,
) -> OnecycleStatus {
    // SAFETY: the caller's promise.
    let (Some(memory), Some(settings)) = (unsafe { pid.as_mut() }, unsafe { settings.as_ref() })
    else {
        return OnecycleStatus::Null;
    };
    let placed = memory.placed_mut();
    placed.alive = 0;
    match PidLaw::new(settings.to_settings()) {
        Ok(law) => {
            placed.law.write(law);
            placed.alive = ALIVE;
            OnecycleStatus::Ok
        }
        Err(error) => OnecycleStatus::from(error),
    }
}

/// One tick, dt_s (s) after the last: measurement, reference (output unit). Returns the input to hold until the next tick
/// (input unit), which is finite and within the limits. Without a law it returns zero.
///
/// # Safety
/// Both pointers are null or point to valid objects of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_pid_step(
    pid: *mut OnecyclePid,
    dt_s: f32,
    measurement: *const OnecycleMeasurement,
    reference: f32,
) -> f32 {
    // SAFETY: the caller's promise.
    let (law, measurement) = unsafe { (law_at(pid), measured(measurement)) };
    law.map_or(0.0, |law| law.step(dt_s, reference, &measurement))
}

/// Takes over without a bump from another controller that gives command (input unit) at this measurement and reference
/// (output unit).
///
/// # Safety
/// Both pointers are null or point to valid objects of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_pid_take_over(
    pid: *mut OnecyclePid,
    measurement: *const OnecycleMeasurement,
    reference: f32,
    command: f32,
) {
    // SAFETY: the caller's promise.
    let (law, measurement) = unsafe { (law_at(pid), measured(measurement)) };
    if let Some(law) = law {
        law.take_over(reference, &measurement, command);
    }
}

/// Changes gains, filter or limits without a bump. If a setting is out of range, the status names it and the old ones stay.
///
/// # Safety
/// Both pointers are null or point to valid objects of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_pid_change(
    pid: *mut OnecyclePid,
    settings: *const OnecyclePidSettings,
) -> OnecycleStatus {
    // SAFETY: the caller's promise.
    let (Some(law), Some(settings)) = (unsafe { (law_at(pid), settings.as_ref()) }) else {
        return OnecycleStatus::Null;
    };
    match law.change(settings.to_settings()) {
        Ok(()) => OnecycleStatus::Ok,
        Err(error) => OnecycleStatus::from(error),
    }
}

/// Resets the law: integral zero, as after onecycle_pid_init.
///
/// # Safety
/// The pointer is null or points to the memory of a law.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_pid_reset(pid: *mut OnecyclePid) {
    // SAFETY: the caller's promise.
    if let Some(law) = unsafe { law_at(pid) } {
        law.reset();
    }
}

/// What the last output was.
///
/// # Safety
/// The pointer is null or points to the memory of a law.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_pid_status(pid: *mut OnecyclePid) -> OnecyclePidOutput {
    // SAFETY: the caller's promise.
    let law = unsafe { law_at(pid) };
    law.map_or(OnecyclePidOutput::None, |law| match law.status() {
        PidStatus::Free => OnecyclePidOutput::Free,
        PidStatus::AtLowest => OnecyclePidOutput::AtLowest,
        PidStatus::AtHighest => OnecyclePidOutput::AtHighest,
        PidStatus::Held => OnecyclePidOutput::Held,
    })
}

/// Integral with the offset (input unit): the input that the law has found to hold the process at rest. Without a law zero.
///
/// # Safety
/// The pointer is null or points to the memory of a law.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_pid_integral(pid: *mut OnecyclePid) -> f32 {
    // SAFETY: the caller's promise.
    let law = unsafe { law_at(pid) };
    law.map_or(0.0, |law| law.integral())
}
