//! C interface of the tuner for firmware. `onecycle.h` is generated from this file.
//!
//! Only this crate and the entry point of a bare board use `unsafe`, because pointers from C are unchecked. The
//! code behind the interface is safe; nothing is computed here.
#![no_std]

pub mod pid;
mod settings;

use core::ffi::{CStr, c_char};
use core::mem::MaybeUninit;

use onecycle_handover::{Handover, Side};
use onecycle_onboard::control::Measurement;
use onecycle_onboard::guard::Abort;
use onecycle_onboard::identification::{Analysis, Bench, Desk, Refusal};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::tuner::{TunerCore, TunerPhase};

pub use self::settings::{
    ONECYCLE_CONSENT_ASK, ONECYCLE_CONSENT_AUTOMATIC, ONECYCLE_CONSENT_NEVER,
    ONECYCLE_SETTINGS_VERSION, OnecycleSettings, OnecycleStatus,
};

/// Size of a tuner in words of eight bytes, for 64-bit machines, where it is largest.
pub const ONECYCLE_TUNER_WORDS: usize = 3700;

/// Mark of memory that holds a tuner: "ONECYCLE".
const ALIVE: u64 = u64::from_le_bytes(*b"ONECYCLE");

/// Layout of the memory of a tuner.
#[repr(C)]
struct Placed {
    alive: u64,
    /// Slices of the analysis in a tick; zero if onecycle_tuner_work does it.
    slices: u16,
    core: MaybeUninit<TunerCore>,
    /// Passed to and fro by the two threads.
    desk: MaybeUninit<Handover<Desk>>,
    /// Used with the desk only.
    analyst: MaybeUninit<Analyst>,
}

struct Analyst {
    analysis: Analysis<'static>,
    bench: Bench,
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
    /// A controller has been found and waits for onecycle_tuner_accept; the safe controller runs.
    Proposed,
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
    /// None of the identification attempts led to a controller, for another reason than those below.
    Refused,
    /// The response with the new gains differs from the prediction.
    Mismatch,
    /// The gain depends on the amplitude of the relay: dead zone, saturation or backlash of the actuator.
    AmplitudeDependent,
    /// Refused: the last cycle is constant or lacks samples.
    NoSignature,
    /// Refused: no process of the pack's family explains the last cycle.
    Unknown,
    /// Refused: the output does not follow the input.
    NoFit,
    /// Refused: the best fit leaves part of the oscillation unexplained.
    Misfit,
    /// Refused: the best fit lies on a limit of the domain.
    Edge,
    /// Refused: the pack has no gains for the process.
    NoGains,
    /// Refused: the phase margin is too uncertain.
    TooUncertain,
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

/// The parts of a tuner behind a pointer from C, if there is one.
///
/// # Safety
/// The pointer is null or points to memory of this size and alignment.
unsafe fn placed_at(tuner: *const OnecycleTuner) -> Option<*mut Placed> {
    let placed = tuner.cast_mut().cast::<Placed>();
    // SAFETY: the caller's promise; the size and alignment are asserted above, and any bits are a number.
    let is_alive = !placed.is_null() && unsafe { (*placed).alive } == ALIVE;
    is_alive.then_some(placed)
}

/// The core of a tuner behind a pointer from C, if there is one.
///
/// # Safety
/// The pointer is null, or what it points to is valid and aligned, and its core is not used by anybody else meanwhile.
unsafe fn core_at<'a>(tuner: *mut OnecycleTuner) -> Option<&'a mut TunerCore> {
    // SAFETY: the caller's promise; `alive` shows that `onecycle_tuner_init` has written a core, and the caller of every
    // function promises that nothing else has written to the memory since.
    unsafe { placed_at(tuner).map(|placed| (*placed).core.assume_init_mut()) }
}

/// Like [`core_at`], to read.
///
/// # Safety
/// As for [`core_at`].
unsafe fn read_at<'a>(tuner: *const OnecycleTuner) -> Option<&'a TunerCore> {
    // SAFETY: as in `core_at`.
    unsafe { placed_at(tuner).map(|placed| (*placed).core.assume_init_ref()) }
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
/// phase, ticks every sample_s (s), two cycles, an integral beside the controller found, which is put in force after
/// onecycle_tuner_accept; no take-off; the fallback output is zero. The limits of the test and of the output have no default:
/// set them.
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
    // SAFETY: the caller's promise; null and zero bytes stand for the embedded pack.
    unsafe { onecycle_tuner_init_with_pack(tuner, settings, core::ptr::null(), 0) }
}

/// Like onecycle_tuner_init, with another pack than the embedded one: its bytes, which must stay where they are, and their
/// number. A pack holds the family of processes, and the gains for the phase margin for which it was made. Null: the embedded
/// pack.
///
/// # Safety
/// The first two pointers are null or point to valid objects of their types, the third is null or points to `pack_bytes`
/// bytes that live and do not change as long as the tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_init_with_pack(
    tuner: *mut OnecycleTuner,
    settings: *const OnecycleSettings,
    pack: *const u8,
    pack_bytes: usize,
) -> OnecycleStatus {
    // SAFETY: the caller's promise.
    let Some(settings) = (unsafe { settings.as_ref() }) else {
        return OnecycleStatus::Null;
    };
    if tuner.is_null() {
        return OnecycleStatus::Null;
    }
    let placed = tuner.cast::<Placed>();
    // SAFETY: the caller's promise; any bits are a number.
    unsafe { (*placed).alive = 0 };
    let checked = match settings.checked() {
        Ok(checked) => checked,
        Err(status) => return status,
    };
    let pack = if pack.is_null() {
        Pack::embedded()
    } else {
        // SAFETY: the caller's promise.
        Pack::read(unsafe { core::slice::from_raw_parts(pack, pack_bytes) })
    };
    let Ok(pack) = pack else {
        return OnecycleStatus::Pack;
    };
    // SAFETY: the caller's promise; the parts are written before the mark says so.
    unsafe {
        (*placed).slices = settings.slices;
        (*placed).core.write(TunerCore::of(&checked));
        (*placed).desk.write(Handover::new(Desk::NEW));
        (*placed).analyst.write(Analyst {
            analysis: Analysis::new(pack),
            bench: Bench::NEW,
        });
        (*placed).alive = ALIVE;
    }
    OnecycleStatus::Ok
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
    let (placed, core) = match unsafe { (placed_at(tuner), core_at(tuner)) } {
        (Some(placed), Some(core)) => (placed, core),
        _ => return 0.0,
    };
    // SAFETY: the caller's promise.
    let measurement = measurement_of(unsafe { measurement.as_ref() });
    // SAFETY: written by `onecycle_tuner_init`; the analyst is used with the desk only.
    let (slices, desk) = unsafe { ((*placed).slices, (*placed).desk.assume_init_ref()) };
    // SAFETY: the first side is the thread of this function, by the caller's promise.
    let turn = unsafe {
        desk.turn(Side::First, |desk| {
            core.tick(Some(desk), time_s, &measurement, reference);
            if slices > 0 {
                let Analyst { analysis, bench } = (*placed).analyst.assume_init_mut();
                analysis.work(desk, bench, slices);
            }
            let output = core.conclude(desk);
            (output, slices == 0 && desk.is_ordered())
        })
    };
    turn.unwrap_or_else(|| core.tick(None, time_s, &measurement, reference))
}

/// Does at most this number of slices of the identification, in another thread than onecycle_tuner_step, of lower priority.
/// For tuners whose setting `slices` is zero. Returns whether work is left: call it again when there is time. An
/// identification takes 2,000 to 9,000 slices.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner; one thread at a time calls this function.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_work(tuner: *mut OnecycleTuner, slices: u16) -> bool {
    // SAFETY: the caller's promise.
    let Some(placed) = (unsafe { placed_at(tuner) }) else {
        return false;
    };
    // SAFETY: written by `onecycle_tuner_init`.
    let desk = unsafe { (*placed).desk.assume_init_ref() };
    // SAFETY: the second side is the thread of this function, by the caller's promise; the analyst is used with the desk only.
    let turn = unsafe {
        desk.turn(Side::Second, |desk| {
            let Analyst { analysis, bench } = (*placed).analyst.assume_init_mut();
            let is_left = analysis.work(desk, bench, slices);
            (is_left, !is_left)
        })
    };
    turn.unwrap_or(false)
}

/// Gives the command (input unit) of another controller for the next tick, which holds the axis instead of the safe controller
/// outside of a test. Call it before each onecycle_tuner_step. That controller must hold its integral while
/// onecycle_tuner_is_in_charge, and go on from onecycle_tuner_usual.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_beside(tuner: *mut OnecycleTuner, command: f32) {
    // SAFETY: the caller's promise.
    if let Some(core) = unsafe { core_at(tuner) } {
        core.beside(command);
    }
}

/// Whether the last output was the tuner's own: that of the relay or of the controller found. If not, it was that of the safe
/// controller, or the command given to onecycle_tuner_beside, unchanged.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_is_in_charge(tuner: *const OnecycleTuner) -> bool {
    // SAFETY: the caller's promise.
    unsafe { read_at(tuner) }.is_some_and(|core| core.is_in_charge())
}

/// Mean of the output before the test (input unit); needs the setting bias_filter_s.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_usual(tuner: *const OnecycleTuner) -> f32 {
    // SAFETY: the caller's promise.
    unsafe { read_at(tuner) }.map_or(0.0, |core| core.usual())
}

/// Puts the proposed controller in force from the next tick on. Only in the phase proposed, and with the setting consent
/// ONECYCLE_CONSENT_ASK; returns whether it was so.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_accept(tuner: *mut OnecycleTuner) -> bool {
    // SAFETY: the caller's promise.
    unsafe { core_at(tuner) }.is_some_and(|core| core.accept())
}

/// Begins the test at the next tick. Only in the phase idle.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_start(tuner: *mut OnecycleTuner) {
    // SAFETY: the caller's promise.
    if let Some(core) = unsafe { core_at(tuner) } {
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
    if let Some(core) = unsafe { core_at(tuner) } {
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
    if let Some(core) = unsafe { core_at(tuner) } {
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
    let tuner = unsafe { read_at(tuner) };
    tuner.map_or(OnecyclePhase::None, |tuner| match tuner.phase() {
        TunerPhase::Idle => OnecyclePhase::Idle,
        TunerPhase::TakeOff => OnecyclePhase::TakeOff,
        TunerPhase::Relay => OnecyclePhase::Relay,
        TunerPhase::Identify => OnecyclePhase::Identify,
        TunerPhase::Proposed => OnecyclePhase::Proposed,
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
    let tuner = unsafe { read_at(tuner) };
    reason_of(tuner.and_then(|core| core.reason()))
}

/// A sentence about the reason of the abort, in English; empty if the test was not aborted.
///
/// # Safety
/// The pointer is null or points to the memory of a tuner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn onecycle_tuner_reason_text(tuner: *const OnecycleTuner) -> *const c_char {
    // SAFETY: the caller's promise.
    let reason = reason_of(unsafe { read_at(tuner) }.and_then(|core| core.reason()));
    text_of(reason).as_ptr()
}

fn text_of(reason: OnecycleReason) -> &'static CStr {
    match reason {
        OnecycleReason::None => c"",
        OnecycleReason::Operator => c"aborted by the operator",
        OnecycleReason::NotFinite => c"a time, a reference or a measurement is not finite",
        OnecycleReason::Stale => c"a sample is too old, or the timestamp did not increase",
        OnecycleReason::Excursion => c"the output is too far from the reference",
        OnecycleReason::Rate => c"the output moves too fast",
        OnecycleReason::Duration => c"the test takes too long",
        OnecycleReason::NoOscillation => c"the relay has not switched for too long",
        OnecycleReason::Refused => c"no controller found",
        OnecycleReason::Mismatch => c"the response with the new gains differs from the prediction",
        OnecycleReason::AmplitudeDependent => c"the gain depends on the amplitude",
        OnecycleReason::NoSignature => c"the last cycle is constant or lacks samples",
        OnecycleReason::Unknown => c"no process of the pack's family explains the last cycle",
        OnecycleReason::NoFit => c"the output does not follow the input",
        OnecycleReason::Misfit => c"the best fit leaves part of the oscillation unexplained",
        OnecycleReason::Edge => c"the best fit lies on a limit of the domain",
        OnecycleReason::NoGains => c"the pack has no gains for the process",
        OnecycleReason::TooUncertain => c"the phase margin is too uncertain",
    }
}

fn reason_of(abort: Option<Abort>) -> OnecycleReason {
    match abort {
        None => OnecycleReason::None,
        Some(Abort::Operator) => OnecycleReason::Operator,
        Some(Abort::NotFinite) => OnecycleReason::NotFinite,
        Some(Abort::Stale(_)) => OnecycleReason::Stale,
        Some(Abort::Excursion(_)) => OnecycleReason::Excursion,
        Some(Abort::Rate(_)) => OnecycleReason::Rate,
        Some(Abort::Duration(_)) => OnecycleReason::Duration,
        Some(Abort::NoOscillation(_)) => OnecycleReason::NoOscillation,
        Some(Abort::Refused(refusal)) => match refusal {
            Refusal::AmplitudeDependent(_) => OnecycleReason::AmplitudeDependent,
            Refusal::NoSignature => OnecycleReason::NoSignature,
            Refusal::Unknown(_) => OnecycleReason::Unknown,
            Refusal::NoFit => OnecycleReason::NoFit,
            Refusal::Misfit(_) => OnecycleReason::Misfit,
            Refusal::Edge(_) => OnecycleReason::Edge,
            Refusal::NoGains => OnecycleReason::NoGains,
            Refusal::TooUncertain(..) => OnecycleReason::TooUncertain,
            _ => OnecycleReason::Refused,
        },
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
    let tuner = unsafe { read_at(tuner) };
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
