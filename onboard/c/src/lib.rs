//! C interface of the tuner for firmware. `onecycle.h` is generated from this file.
//!
//! Only this crate and the entry point of a bare board use `unsafe`, because pointers from C are unchecked. The
//! code behind the interface is safe; nothing is computed here.
#![no_std]

pub mod pid;
mod settings;

use core::mem::MaybeUninit;

use onecycle_onboard::control::Measurement;
use onecycle_onboard::guard::Abort;
use onecycle_onboard::identification::Refusal;
use onecycle_onboard::identification::Workspace;
use onecycle_onboard::pack::Pack;
use onecycle_onboard::tuner::{TunerCore, TunerError, TunerPhase};

pub use self::settings::{OnecycleSettings, OnecycleStatus};

/// Size of a tuner in words of eight bytes, for 64-bit machines, where it is largest.
pub const ONECYCLE_TUNER_WORDS: usize = 3700;

/// Mark of memory that holds a tuner: "ONECYCLE".
const ALIVE: u64 = u64::from_le_bytes(*b"ONECYCLE");

/// Layout of the memory of a tuner.
#[repr(C)]
struct Placed {
    alive: u64,
    core: MaybeUninit<TunerCore<'static>>,
    workspace: MaybeUninit<Workspace>,
}

const _: () = assert!(
    size_of::<Placed>() <= size_of::<OnecycleTuner>()
        && align_of::<Placed>() <= align_of::<OnecycleTuner>()
);

/// Memory for one tuner, static or anywhere else. Its contents are private.
#[repr(C)]
pub struct OnecycleTuner {
    /// Private.
    pub memory: [u64; ONECYCLE_TUNER_WORDS],
}

/// Measurement at one tick.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct OnecycleMeasurement {
    /// Output of the process (output unit).
    pub value: f32,
    /// Rate of the output (output unit / s), valid if has_rate.
    pub rate: f32,
    /// Age of value and rate (s).
    pub age_s: f32,
    /// Whether the rate is measured. If not, it is computed from differences of the value.
    pub has_rate: bool,
}

/// Phase of a tuner.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum OnecyclePhase {
    /// The memory holds no tuner.
    None,
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

/// Reason of an abort.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum OnecycleReason {
    /// The test was not aborted.
    None,
    /// The operator aborted the test.
    Operator,
    /// A time, a reference or a measurement is not finite.
    NotFinite,
    /// A sample is too old, ticks are too far apart, or the timestamp did not increase.
    Stale,
    /// The output is too far from the reference.
    Excursion,
    /// The output moves too fast.
    Rate,
    /// The test takes too long.
    Duration,
    /// The relay has not switched for too long.
    NoOscillation,
    /// None of the identification attempts led to a controller.
    Refused,
    /// The response with the new gains differs from the prediction.
    Mismatch,
    /// The gain depends on the amplitude of the relay: dead zone, saturation or backlash of the actuator.
    AmplitudeDependent,
}

/// Result of a test.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct OnecycleResult {
    /// Acceleration gain K/T_body (output unit / (input unit s^2)).
    pub k_over_t_body: f64,
    /// Lag of the actuator (s).
    pub t_prop_s: f64,
    /// Damping rate of the body, 1/T_body (1/s); zero for a double integrator.
    pub inv_t_body_per_s: f64,
    /// Dead time (s).
    pub tau_s: f64,
    /// Standard deviation of ln(K/T_body), that is, relative to K/T_body.
    pub k_over_t_body_deviation: f64,
    /// Standard deviation of T_prop (s).
    pub t_prop_deviation_s: f64,
    /// Standard deviation of 1/T_body (1/s).
    pub inv_t_body_deviation_per_s: f64,
    /// Standard deviation of the dead time (s).
    pub tau_deviation_s: f64,
    /// Proportional gain of the controller (input unit / output unit).
    pub kp: f64,
    /// Derivative gain, on the measurement (input unit s / output unit).
    pub kd: f64,
    /// Offset of the controller, where its integral starts: input that holds the process at rest (input unit).
    pub offset: f64,
    /// Phase margin without the integral (rad).
    pub phase_margin_rad: f64,
    /// Standard deviation of the phase margin (rad).
    pub phase_margin_deviation_rad: f64,
    /// Period of the oscillation (s).
    pub period_s: f64,
    /// Amplitude of the oscillation (output unit).
    pub amplitude: f64,
    /// Standard deviation of the noise of one sample (output unit).
    pub noise_sigma: f64,
    /// Misfit score of the last cycle against the family of processes (limit 1).
    pub score: f64,
    /// Whether the controller runs and its response was as predicted.
    pub is_proven: bool,
    /// Integral gain of the controller (input unit / (output unit s)); zero without an integral.
    pub ki: f64,
    /// Weight of the reference in the proportional term, 0 to 1.
    pub setpoint_weight: f64,
}

impl OnecycleTuner {
    fn placed(&self) -> &Placed {
        // SAFETY: the size and alignment are asserted above, and any bits are a valid `Placed`.
        unsafe { &*(&raw const *self).cast() }
    }

    fn placed_mut(&mut self) -> &mut Placed {
        // SAFETY: as in `placed`.
        unsafe { &mut *(&raw mut *self).cast() }
    }

    fn core(&self) -> Option<&TunerCore<'static>> {
        let placed = self.placed();
        // SAFETY: the first word shows that `onecycle_tuner_init` has written a tuner, and the caller of every
        // function promises that nothing else has written to the memory since.
        (placed.alive == ALIVE).then(|| unsafe { placed.core.assume_init_ref() })
    }

    fn parts(&mut self) -> Option<(&mut TunerCore<'static>, &mut Workspace)> {
        let placed = self.placed_mut();
        // SAFETY: as in `core`.
        (placed.alive == ALIVE).then(|| unsafe {
            (
                placed.core.assume_init_mut(),
                placed.workspace.assume_init_mut(),
            )
        })
    }
}

/// The parts of a tuner behind a pointer from C, if there is one.
///
/// # Safety
/// The pointer is null, or what it points to is valid, aligned and not used by anybody else meanwhile.
unsafe fn parts_at<'a>(
    tuner: *mut OnecycleTuner,
) -> Option<(&'a mut TunerCore<'static>, &'a mut Workspace)> {
    // SAFETY: the caller's promise.
    unsafe { tuner.as_mut() }.and_then(OnecycleTuner::parts)
}

/// A missing measurement counts as one that is not finite.
fn measurement_of(measurement: Option<&OnecycleMeasurement>) -> Measurement {
    measurement.map_or(Measurement::of(f32::NAN), |measurement| Measurement {
        value: measurement.value,
        rate: measurement.has_rate.then_some(measurement.rate),
        age_s: measurement.age_s,
    })
}

/// Default settings: a relay of this amplitude (input unit) with noise protection and trim at the distinguishing
/// phase, ticks every sample_s (s), two cycles, an integral beside the controller found; no take-off, no abort limits; the
/// fallback output is zero.
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_settings_default(amplitude: f32, sample_s: f32) -> OnecycleSettings {
    OnecycleSettings::new(amplitude, sample_s)
}

/// Initialises a tuner in the memory. Any status but ONECYCLE_STATUS_OK names the setting that is out of range;
/// the memory then holds no tuner.
///
/// # Safety
/// Both pointers are null or point to valid objects of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_init(
    tuner: *mut OnecycleTuner,
    settings: *const OnecycleSettings,
) -> OnecycleStatus {
    // SAFETY: the caller's promise.
    let (Some(memory), Some(settings)) = (unsafe { tuner.as_mut() }, unsafe { settings.as_ref() })
    else {
        return OnecycleStatus::Null;
    };
    let placed = memory.placed_mut();
    placed.alive = 0;
    let checked = settings.to_settings().checked();
    let pack = Pack::embedded().map_err(|_| TunerError::Pack);
    match checked.and_then(|checked| Ok((checked, pack?))) {
        Ok((checked, pack)) => {
            placed.core.write(TunerCore::of(&checked, pack));
            placed.workspace.write(Workspace::NEW);
            placed.alive = ALIVE;
            OnecycleStatus::Ok
        }
        Err(error) => OnecycleStatus::from(error),
    }
}

/// One tick: time (s), measurement, reference (output unit). Returns the input to hold until the next tick
/// (input unit), which is finite and within the limits. Without a tuner it returns zero.
///
/// # Safety
/// Both pointers are null or point to valid objects of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_step(
    tuner: *mut OnecycleTuner,
    time_s: f64,
    measurement: *const OnecycleMeasurement,
    reference: f32,
) -> f32 {
    // SAFETY: the caller's promise.
    let Some((core, workspace)) = (unsafe { parts_at(tuner) }) else {
        return 0.0;
    };
    // SAFETY: the caller's promise.
    let measurement = measurement_of(unsafe { measurement.as_ref() });
    core.step(workspace, time_s, &measurement, reference)
}

/// Begins the test at the next tick. Only in the phase idle.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_start(tuner: *mut OnecycleTuner) {
    // SAFETY: the caller's promise.
    if let Some((core, _)) = unsafe { parts_at(tuner) } {
        core.start();
    }
}

/// Aborts the test, or stops the controller found. The output of the next tick is that of the safe controller.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_abort(tuner: *mut OnecycleTuner) {
    // SAFETY: the caller's promise.
    if let Some((core, _)) = unsafe { parts_at(tuner) } {
        core.abort();
    }
}

/// Resets the tuner for another test; results are forgotten. Only in the phases aborted and control.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_reset(tuner: *mut OnecycleTuner) {
    // SAFETY: the caller's promise.
    if let Some((core, _)) = unsafe { parts_at(tuner) } {
        core.reset();
    }
}

/// Phase of the tuner.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_phase(tuner: *const OnecycleTuner) -> OnecyclePhase {
    // SAFETY: the caller's promise.
    let tuner = unsafe { tuner.as_ref() }.and_then(OnecycleTuner::core);
    tuner.map_or(OnecyclePhase::None, |tuner| match tuner.phase() {
        TunerPhase::Idle => OnecyclePhase::Idle,
        TunerPhase::TakeOff => OnecyclePhase::TakeOff,
        TunerPhase::Relay => OnecyclePhase::Relay,
        TunerPhase::Identify => OnecyclePhase::Identify,
        TunerPhase::Control => OnecyclePhase::Control,
        TunerPhase::Aborted => OnecyclePhase::Aborted,
    })
}

/// Reason of the abort, if the test was aborted.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_reason(tuner: *const OnecycleTuner) -> OnecycleReason {
    // SAFETY: the caller's promise.
    let tuner = unsafe { tuner.as_ref() }.and_then(OnecycleTuner::core);
    match tuner.and_then(TunerCore::reason) {
        None => OnecycleReason::None,
        Some(Abort::Operator) => OnecycleReason::Operator,
        Some(Abort::NotFinite) => OnecycleReason::NotFinite,
        Some(Abort::Stale(_)) => OnecycleReason::Stale,
        Some(Abort::Excursion(_)) => OnecycleReason::Excursion,
        Some(Abort::Rate(_)) => OnecycleReason::Rate,
        Some(Abort::Duration(_)) => OnecycleReason::Duration,
        Some(Abort::NoOscillation(_)) => OnecycleReason::NoOscillation,
        Some(Abort::Refused(Refusal::AmplitudeDependent(_))) => OnecycleReason::AmplitudeDependent,
        Some(Abort::Refused(_)) => OnecycleReason::Refused,
        Some(Abort::Mismatch(_)) => OnecycleReason::Mismatch,
    }
}

/// Writes the result of the test. Returns false, and writes nothing, if there is no result yet.
///
/// # Safety
/// Both pointers are null or point to valid objects of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_result(
    tuner: *const OnecycleTuner,
    result: *mut OnecycleResult,
) -> bool {
    // SAFETY: the caller's promise.
    let tuner = unsafe { tuner.as_ref() }.and_then(OnecycleTuner::core);
    // SAFETY: the caller's promise.
    let (Some(tuner), Some(result)) = (tuner, unsafe { result.as_mut() }) else {
        return false;
    };
    let Some(found) = tuner.identified() else {
        return false;
    };
    *result = OnecycleResult {
        k_over_t_body: found.process.k_over_t_body(),
        t_prop_s: found.process.t_prop_s(),
        inv_t_body_per_s: found.process.inv_t_body_per_s(),
        tau_s: found.process.tau_s(),
        k_over_t_body_deviation: found.deviations.ln_k_over_t_body,
        t_prop_deviation_s: found.deviations.t_prop_s,
        inv_t_body_deviation_per_s: found.deviations.inv_t_body_per_s,
        tau_deviation_s: found.deviations.tau_s,
        kp: found.pd.kp,
        kd: found.pd.kd,
        offset: f64::from(tuner.offset()),
        phase_margin_rad: found.phase_margin_rad,
        phase_margin_deviation_rad: found.deviations.phase_margin_rad,
        period_s: found.period_s,
        amplitude: found.amplitude,
        noise_sigma: found.noise_sigma,
        score: found.score,
        is_proven: tuner.is_proven(),
        ki: tuner.integral().ki,
        setpoint_weight: tuner.integral().setpoint_weight,
    };
    true
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    // No code behind this interface panics by intent; the watchdog of the firmware ends this loop.
    loop {
        core::hint::spin_loop();
    }
}
