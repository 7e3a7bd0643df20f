//! The tuner for firmware in C. `onecycle.h` is generated from this file.
//!
//! `unsafe` stands here and where a program begins on a bare board, nowhere else: at the border to C,
//! pointers are what the caller says they are. Everything behind it is safe code; nothing here computes.
#![no_std]

mod settings;

use core::mem::MaybeUninit;

use onecycle_onboard::control::Measurement;
use onecycle_onboard::guard::Abort;
use onecycle_onboard::identification::Workspace;
use onecycle_onboard::pack::Pack;
use onecycle_onboard::tuner::{TunerCore, TunerError, TunerPhase};

pub use self::settings::{OnecycleSettings, OnecycleStatus};

/// Memory of a tuner, in words of eight bytes: what it takes on 64-bit machines, the largest.
pub const ONECYCLE_TUNER_WORDS: usize = 3700;

/// Marks memory that holds a tuner: "ONECYCLE".
const ALIVE: u64 = u64::from_le_bytes(*b"ONECYCLE");

/// What the memory holds once it is a tuner's.
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

/// Memory for one tuner: static, or wherever the caller has room. Its contents are no business of the
/// caller's.
#[repr(C)]
pub struct OnecycleTuner {
    /// The tuner.
    pub memory: [u64; ONECYCLE_TUNER_WORDS],
}

/// What the sensor says at a tick.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct OnecycleMeasurement {
    /// The output (output unit).
    pub value: f32,
    /// Its rate, where has_rate (output unit / s).
    pub rate: f32,
    /// How old both are (s).
    pub age_s: f32,
    /// Whether the rate is measured; otherwise it is found from differences.
    pub has_rate: bool,
}

/// What a tuner is doing.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum OnecyclePhase {
    /// There is no tuner in this memory.
    None,
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

/// Why a test was aborted.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum OnecycleReason {
    /// It was not.
    None,
    /// The operator said so.
    Operator,
    /// A time, a reference or a measurement that is no finite number.
    NotFinite,
    /// A sample too old, ticks too far apart, or time that does not go on.
    Stale,
    /// The output was too far from the reference.
    Excursion,
    /// The output moved too fast.
    Rate,
    /// The test took too long.
    Duration,
    /// The relay did not switch for too long.
    NoOscillation,
    /// No cycle that was looked at led to a controller.
    Refused,
    /// The response under the new gains was not the predicted one.
    Mismatch,
}

/// What the test has told.
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
    /// Standard deviation of ln(K/T_body): relative.
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
    /// Input that holds the process at rest, the controller's offset (input unit).
    pub offset: f64,
    /// Phase margin (rad).
    pub phase_margin_rad: f64,
    /// Standard deviation of the phase margin (rad).
    pub phase_margin_deviation_rad: f64,
    /// Period of the oscillation (s).
    pub period_s: f64,
    /// Amplitude of the oscillation (output unit).
    pub amplitude: f64,
    /// Noise on a sample (output unit).
    pub noise_sigma: f64,
    /// How badly the family of processes explains the last cycle; one is the limit.
    pub score: f64,
    /// Whether the controller is in force and its response was as predicted.
    pub is_proven: bool,
}

impl OnecycleTuner {
    fn placed(&self) -> &Placed {
        // SAFETY: large enough and aligned, as is asserted above, and any bits are a `Placed`.
        unsafe { &*(&raw const *self).cast() }
    }

    fn placed_mut(&mut self) -> &mut Placed {
        // SAFETY: as in `placed`.
        unsafe { &mut *(&raw mut *self).cast() }
    }

    fn core(&self) -> Option<&TunerCore<'static>> {
        let placed = self.placed();
        // SAFETY: the first word says that `onecycle_tuner_init` has written a tuner behind it, and
        // nothing else has been here since: that is what the caller of every function promises.
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

/// A pointer from C as the parts of a tuner, where there is one.
///
/// # Safety
/// Null, or what it points to is valid, aligned and nobody else's meanwhile.
unsafe fn parts_at<'a>(
    tuner: *mut OnecycleTuner,
) -> Option<(&'a mut TunerCore<'static>, &'a mut Workspace)> {
    // SAFETY: the caller's promise.
    unsafe { tuner.as_mut() }.and_then(OnecycleTuner::parts)
}

/// Settings to start from: a noise-protected relay of this amplitude (input unit) at the distinguishing
/// phase with trim, ticks every sample_s (s), two cycles; no take-off, no limits, nothing safe but zero.
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_settings_default(amplitude: f32, sample_s: f32) -> OnecycleSettings {
    OnecycleSettings::new(amplitude, sample_s)
}

/// Makes the memory a tuner with these settings; anything but ONECYCLE_STATUS_OK names what is wrong
/// with them, and there is no tuner.
///
/// # Safety
/// Both pointers are null or point to what they say.
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

/// One tick: time (s), measurement, where the output should be (output unit). Returns the input to hold
/// until the next tick (input unit), finite and within the limits; zero where there is no tuner.
///
/// # Safety
/// Both pointers are null or point to what they say.
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
    // SAFETY: the caller's promise. No measurement is as good as one that is no number.
    let measurement =
        unsafe { measurement.as_ref() }.map_or(Measurement::of(f32::NAN), |measurement| {
            Measurement {
                value: measurement.value,
                rate: measurement.has_rate.then_some(measurement.rate),
                age_s: measurement.age_s,
            }
        });
    core.step(workspace, time_s, &measurement, reference)
}

/// Begins the test at the next tick; only when idle.
///
/// # Safety
/// The pointer is null or points to a tuner's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_start(tuner: *mut OnecycleTuner) {
    // SAFETY: the caller's promise.
    if let Some((core, _)) = unsafe { parts_at(tuner) } {
        core.start();
    }
}

/// The operator ends the test, or the controller that came of it; the next tick's output is safe.
///
/// # Safety
/// The pointer is null or points to a tuner's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_abort(tuner: *mut OnecycleTuner) {
    // SAFETY: the caller's promise.
    if let Some((core, _)) = unsafe { parts_at(tuner) } {
        core.abort();
    }
}

/// Ready for another test, all that was learned forgotten; only when aborted or in control.
///
/// # Safety
/// The pointer is null or points to a tuner's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_reset(tuner: *mut OnecycleTuner) {
    // SAFETY: the caller's promise.
    if let Some((core, _)) = unsafe { parts_at(tuner) } {
        core.reset();
    }
}

/// What the tuner is doing.
///
/// # Safety
/// The pointer is null or points to a tuner's memory.
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

/// Why the test was aborted.
///
/// # Safety
/// The pointer is null or points to a tuner's memory.
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
        Some(Abort::Refused(_)) => OnecycleReason::Refused,
        Some(Abort::Mismatch(_)) => OnecycleReason::Mismatch,
    }
}

/// What the test has told, into result; false, and nothing written, where it has not told anything yet.
///
/// # Safety
/// Both pointers are null or point to what they say.
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
    };
    true
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    // No code behind this interface panics by intent; firmware's watchdog ends what cannot go on.
    loop {
        core::hint::spin_loop();
    }
}
