//! Relay test from rest to the controller without std, heap and libc, with all parts of the tuner in one
//! program.
//!
//! ```text
//! relay -> cycles -> window -> signature -> network -> candidates -> refinement -> gains
//! ```
//!
//! The process is simulated exactly on the sampling grid and without noise:
//!
//! ```text
//! K/T_body = 4 1/s^2, T_prop = 0.05 s, T_body = 0.5 s, tau = 0.02 s; h = 0.1, beta = -0.73
//! ```
//!
//! Expected results, derived outside this crate:
//!
//! - **period and amplitude**: the odd periodic solution of the process under a square wave, with the switch
//!   where the error has fallen to 0.73 of its peak, has the half period 218.08 ms and the amplitude 0.0019394
//!   (matrix exponentials, root to 1e-12). A relay that is called every 1 ms switches 0 to 1 ms late, which acts
//!   as additional delay: at most 221.55 ms and 0.0020113;
//! - **reading of the network**: known, because the process is a multirotor of the embedded pack's family, and
//!   the acceleration gain to 5 %: the worst of 8,000 cycles costs 6 %;
//! - **process**: the simulated process, because without noise the model is exact. Prior knowledge weighs as
//!   much as the noise of a sample, for which the lower limit is a millionth of the oscillation. It moves the
//!   estimate by the square of that, 1e-12, times a few hundred, the ratio of the cycle's size to its
//!   sensitivity to the shape. 1e-9 is allowed;
//! - **gains**: the search over exact costs (`onecycle tune`) gives Kp = 28.423, Kd = 4.4638. The lead table
//!   interpolates between four-byte numbers with an error of a thousandth of a radian, which changes the gains
//!   by a part in a hundred and their cost by one in a million.
#![no_std]

#[cfg(feature = "use-alloc")]
extern crate alloc;
#[cfg(feature = "use-std")]
extern crate std;

use core::ffi::{CStr, c_char};
use core::ops::RangeInclusive;
use core::ptr;

use onecycle_onboard::classify::{Classification, Classifier, Familiarity};
use onecycle_onboard::cycle::{Cycle, CycleDetector, SteadyRun};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::refine::{PriorKnowledge, Refined, Refiner, ShapePrior};
use onecycle_onboard::signature::Signature;
use onecycle_onboard::transition::State;
use onecycle_onboard::window::{Edge, Window};
use onecycle_onboard::{Pd, Relay, RelaySettings, Soiptd, Transition};

/// The simulated process. `K/T_body` (1/s^2), `T_prop`, `T_body` and `tau` (s).
const K_OVER_T_BODY: f64 = 4.0;
const T_PROP_S: f64 = 0.05;
const T_BODY_S: f64 = 0.5;
const TAU_S: f64 = 0.02;
/// Sample period (s); the delay is this many samples.
const SAMPLE_S: f64 = 0.001;
const DELAY_SAMPLES: usize = 20;
/// Half the jump of the relay (input unit).
const AMPLITUDE: f64 = 0.1;

/// Ten seconds, more than twenty periods: enough for a steady oscillation.
const MOST_SAMPLES: u32 = 10_000;
/// Rows of the window for the fit and of the window for the pack: 55 bins and 110 bins of the cycle. A signature
/// needs the finer ones; a fit takes 144 bytes per row.
const BINS: usize = 69;
const FINE_BINS: usize = 133;
const EDGES: usize = 16;

/// Slices for the layers of a pack and the rest of a classification: see `Classifier`.
const MOST_SLICES_TO_READ: u32 = 30;

/// Two half periods, each between 218.08 and 221.55 ms.
const PERIOD_S: RangeInclusive<f64> = 0.4361..=0.4432;
/// Between 0.0019394 and 0.0020113.
const OSCILLATION: RangeInclusive<f64> = 0.00193..=0.00202;
/// Largest relative error of the acceleration gain read by the network.
const READ_TOLERANCE: f64 = 0.05;
/// Largest relative error of a fitted parameter.
const TOLERANCE: f64 = 1e-9;
/// Gains of the search, and the largest relative error of the table's gains.
const OPTIMUM: Pd = Pd {
    kp: 28.423,
    kd: 4.4638,
};
const GAINS_TOLERANCE: f64 = 0.01;

/// Name and size (bytes) of an object.
#[repr(C)]
pub struct Size {
    /// Name; null after the last.
    name: *const c_char,
    bytes: usize,
}

/// Null if the simulated process is identified, else a sentence about the failure. These are the only exported
/// symbols: no other code defines their names, which is what `unsafe` requires.
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_proof() -> *const c_char {
    match identify().and_then(|found| judge(&found)) {
        Ok(()) => ptr::null(),
        Err(sentence) => sentence.as_ptr(),
    }
}

/// Sizes of the pack's parts and of the objects in memory, one after the other.
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_proof_size(index: usize) -> Size {
    let of_pack = Pack::embedded()
        .map(|pack| pack.sizes())
        .unwrap_or_default();
    let sizes = [
        (c"weights", of_pack.weights),
        (c"lead_table", of_pack.table),
        (c"pack", of_pack.total),
        (c"card", of_pack.card),
        (c"relay", size_of::<Relay>()),
        (
            c"cycles",
            size_of::<CycleDetector>() + size_of::<SteadyRun>(),
        ),
        (c"past", size_of::<Past>()),
        (
            c"windows",
            size_of::<Window<BINS, EDGES>>() + size_of::<Window<FINE_BINS, 0>>(),
        ),
        (c"classifier", size_of::<Classifier>()),
        (c"refiner", size_of::<Refiner<BINS>>()),
        (c"pack_reader", size_of::<Pack<'_>>()),
        (c"classification", size_of::<Classification>()),
    ];
    sizes.get(index).map_or(
        Size {
            name: ptr::null(),
            bytes: 0,
        },
        |&(name, bytes)| Size {
            name: name.as_ptr(),
            bytes,
        },
    )
}

/// Results of the test.
struct Found {
    run: SteadyRun,
    read: Classification,
    refined: Refined,
    gains: Pd,
}

/// From the relay test to the gains, as on board: large objects exist only while they are needed.
fn identify() -> Result<Found, &'static CStr> {
    let mut coarse = Window::NONE;
    let pack = Pack::embedded().map_err(|_| c"there is no embedded pack")?;
    let test = measure(&mut coarse)?;
    let read = read(&test, &pack)?;
    let prior_knowledge = PriorKnowledge {
        may_walk: true,
        starts: &read.starts(test.period_s),
        prior: ShapePrior::of_pack(&pack),
    };
    let refined = refine(&coarse, test.period_s, &prior_knowledge)?;
    let table = pack.gains_table().ok_or(c"the pack has no lead table")?;
    let gains = table
        .pd_at_phase_margin(&refined.process)
        .map_err(|_| c"the lead table has no gains for the process")?;
    Ok(Found {
        run: test.run,
        read,
        refined,
        gains,
    })
}

/// Results of a relay test, besides the window for the fit.
struct Test {
    run: SteadyRun,
    /// Period of the last cycle (s).
    period_s: f64,
    signature: Signature,
    /// Standard deviation of the white noise of one sample (output unit).
    noise_sigma: f64,
}

/// The relay test, and the signature of its last cycle from the finer window.
#[inline(never)]
fn measure(coarse: &mut Window<BINS, EDGES>) -> Result<Test, &'static CStr> {
    let mut fine = Window::NONE;
    let (run, last) = oscillate(coarse, &mut fine)?;
    let signature = Signature::new(&fine, &last).map_err(|_| c"the cycle has no signature")?;
    Ok(Test {
        run,
        period_s: last.period_s,
        signature,
        noise_sigma: fine.noise_sigma(),
    })
}

/// Classification of the cycle, slice by slice.
#[inline(never)]
fn read(test: &Test, pack: &Pack<'_>) -> Result<Classification, &'static CStr> {
    let mut classifier = Classifier::new();
    classifier
        .begin(pack, &test.signature, test.period_s, test.noise_sigma)
        .map_err(|_| c"the pack has no calibration")?;
    for _ in 0..MOST_SLICES_TO_READ {
        if let Some(read) = classifier.advance(pack) {
            return read.map_err(|_| c"the classification failed");
        }
    }
    Err(c"the classification takes more slices than it may")
}

/// Fit of the window, slice by slice.
#[inline(never)]
fn refine(
    window: &Window<BINS, EDGES>,
    period_s: f64,
    prior_knowledge: &PriorKnowledge<'_>,
) -> Result<Refined, &'static CStr> {
    let mut refiner = Refiner::new();
    refiner
        .begin(window, period_s, prior_knowledge)
        .map_err(|_| c"the window cannot be fitted")?;
    for _ in 0..refiner.most_slices(window) {
        if let Some(refined) = refiner.advance(window) {
            return refined.map_err(|_| c"no process fits the window");
        }
    }
    Err(c"the refinement takes more slices than it may")
}

/// Simulation as on board, step by step: process, relay, cycles, window.
#[inline(never)]
fn oscillate(
    coarse: &mut Window<BINS, EDGES>,
    fine: &mut Window<FINE_BINS, 0>,
) -> Result<(SteadyRun, Cycle), &'static CStr> {
    let process = Soiptd::from_acceleration_gain(K_OVER_T_BODY, T_PROP_S, 1.0 / T_BODY_S, TAU_S)
        .map_err(|_| c"the parameters are not a process")?;
    let settings = RelaySettings::bare(AMPLITUDE as f32, RelaySettings::DISTINGUISHING_BETA);
    let mut relay = Relay::new(settings).map_err(|_| c"the settings are not a relay")?;
    let transition = Transition::over(&process, SAMPLE_S);
    let mut state = State::default();
    let mut delayed = [0.0; DELAY_SAMPLES];
    let mut detector = CycleDetector::new();
    let mut run = SteadyRun::default();
    let mut past = Past::default();
    let (mut is_open, mut was_high) = (false, true);
    for sample in 0..MOST_SAMPLES {
        let time_s = f64::from(sample) * SAMPLE_S;
        let output = K_OVER_T_BODY * state.y;
        let input = f64::from(relay.step(-output as f32, SAMPLE_S as f32));
        if let Some(cycle) = detector.push(time_s, relay.is_high(), output) {
            run.push(&cycle);
            if is_open && cycle.start_s >= fine.start_s() {
                return Ok((run, cycle));
            }
        }
        // From a rise on, so that the cycle that begins there lies in the windows.
        let rises = relay.is_high() && !was_high;
        was_high = relay.is_high();
        if run.is_steady() && rises && !is_open {
            past.open(coarse, time_s)?;
            fine.begin(time_s, SAMPLE_S);
            is_open = true;
        }
        past.push(time_s, input);
        if is_open {
            coarse
                .push_input(time_s, input)
                .map_err(|_| c"more switches than the window holds")?;
            coarse.push_output(time_s, output);
            fine.push_output(time_s, output);
        }
        let slot = &mut delayed[sample as usize % DELAY_SAMPLES];
        state = transition.apply(&state, *slot);
        *slot = input;
    }
    Err(c"no steady oscillation in ten seconds")
}

fn judge(found: &Found) -> Result<(), &'static CStr> {
    let process = &found.refined.process;
    let near = |value: f64, truth: f64, part: f64| (value - truth).abs() <= part * truth;
    let exact = |value, truth| near(value, truth, TOLERANCE);
    let check = |holds: bool, sentence| if holds { Ok(()) } else { Err(sentence) };
    check(
        PERIOD_S.contains(&found.run.period_s),
        c"the period differs from the prediction",
    )?;
    check(
        OSCILLATION.contains(&found.run.amplitude),
        c"the amplitude differs from the prediction",
    )?;
    check(
        found.read.familiarity == Familiarity::Known,
        c"the pack does not know the cycle",
    )?;
    // The gain read is for a relay of amplitude one.
    let read = found.read.candidates[0].process.k_over_t_body() / AMPLITUDE;
    check(
        near(read, K_OVER_T_BODY, READ_TOLERANCE),
        c"the pack reads another K/T_body",
    )?;
    check(
        exact(process.k_over_t_body(), K_OVER_T_BODY),
        c"K/T_body is wrong",
    )?;
    check(exact(process.t_prop_s(), T_PROP_S), c"T_prop is wrong")?;
    check(
        exact(process.inv_t_body_per_s(), 1.0 / T_BODY_S),
        c"T_body is wrong",
    )?;
    check(exact(process.tau_s(), TAU_S), c"tau is wrong")?;
    check(
        found.refined.covariance.is_some(),
        c"the covariance is missing",
    )?;
    check(
        near(found.gains.kp, OPTIMUM.kp, GAINS_TOLERANCE)
            && near(found.gains.kd, OPTIMUM.kd, GAINS_TOLERANCE),
        c"the gains are not optimal",
    )
}

/// The latest switches, for the window that opens after them.
#[derive(Default)]
struct Past {
    edges: [Edge; PAST_EDGES],
}

/// Four periods of switches: with that much past the fit is exact, without any its error is 2e-6.
const PAST_EDGES: usize = 8;

impl Past {
    fn push(&mut self, time_s: f64, input: f64) {
        if self.edges[PAST_EDGES - 1].input != input {
            self.edges.rotate_left(1);
            self.edges[PAST_EDGES - 1] = Edge { time_s, input };
        }
    }

    fn open(&self, window: &mut Window<BINS, EDGES>, start_s: f64) -> Result<(), &'static CStr> {
        window.begin(start_s, SAMPLE_S);
        for edge in &self.edges {
            window
                .push_input(edge.time_s, edge.input)
                .map_err(|_| c"more switches than the window holds")?;
        }
        Ok(())
    }
}

/// Needs a heap: the compiler rejects it because there is no allocator.
#[cfg(feature = "use-alloc")]
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_proof_control(length: usize) -> usize {
    let mut values = alloc::vec::Vec::with_capacity(length);
    values.extend(0..length);
    values.iter().sum()
}

/// Needs the standard library and, through it, libc: the linker rejects it.
#[cfg(feature = "use-std")]
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_proof_control(length: usize) -> usize {
    let values: std::vec::Vec<usize> = (0..length).collect();
    std::thread::spawn(move || values.iter().sum())
        .join()
        .unwrap_or(0)
}

// With std its own handler is linked; a second one would be rejected before the linker reports.
#[cfg(not(feature = "use-std"))]
mod panic {
    use core::panic::PanicInfo;

    // Sound: start.c defines this function, and it does not return.
    unsafe extern "C" {
        safe fn onecycle_proof_panicked() -> !;
    }

    #[panic_handler]
    fn panicked(_: &PanicInfo<'_>) -> ! {
        onecycle_proof_panicked()
    }
}
