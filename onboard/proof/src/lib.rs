//! One relay test from rest to the identified process, without std, heap and libc.
//!
//! The process, exact on the sampling grid and without noise:
//!
//! ```text
//! K/T_body = 4 1/s^2, T_prop = 0.05 s, T_body = 0.5 s, tau = 0.02 s; h = 0.1, beta = -0.73
//! ```
//!
//! What must come out, derived outside this crate:
//!
//! - **period and amplitude**: the odd periodic solution of the process under a square wave, with
//!   the switch where the error has fallen to 0.73 of its peak, has the half period 218.08 ms and
//!   the amplitude 0.0019394 (matrix exponentials, root to 1e-12). A relay that looks once in 1 ms
//!   switches 0..1 ms late, which acts as that much more delay: at most 221.55 ms and 0.0020113;
//! - **process**: the very one simulated, for without noise the model is exact. The search ends
//!   when a step lowers the sum of squares by less than 1e-9 of it; near its minimum it falls by
//!   orders of magnitude a step, so what is left is rounding: a few ulps, far below the 1e-9 allowed.
#![no_std]

#[cfg(feature = "use-alloc")]
extern crate alloc;
#[cfg(feature = "use-std")]
extern crate std;

use core::ffi::{CStr, c_char};
use core::ops::RangeInclusive;
use core::ptr;

use onecycle_onboard::cycle::{CycleDetector, SteadyRun};
use onecycle_onboard::refine::{Refined, refine};
use onecycle_onboard::transition::State;
use onecycle_onboard::window::{Edge, Window};
use onecycle_onboard::{Process, Relay, RelaySettings, Transition};

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

/// The window ends this many cycles after it began.
const CYCLES: u32 = 3;
/// Ten seconds, more than twenty periods: whoever has no window by then never will.
const MOST_SAMPLES: u32 = 10_000;
const BINS: usize = 257;
const EDGES: usize = 64;

/// Two half periods, each between 218.08 and 221.55 ms.
const PERIOD_S: RangeInclusive<f64> = 0.4361..=0.4432;
/// Between 0.0019394 and 0.0020113.
const OSCILLATION: RangeInclusive<f64> = 0.00193..=0.00202;
/// Largest relative error of an identified parameter.
const TOLERANCE: f64 = 1e-9;

/// Null when the process simulated is the process identified, else a sentence for what went wrong.
// The only exported symbol: no other defines this name, which is what `unsafe` asks for.
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_proof() -> *const c_char {
    match oscillate_and_identify().and_then(|(run, refined)| judge(&run, &refined)) {
        Ok(()) => ptr::null(),
        Err(sentence) => sentence.as_ptr(),
    }
}

/// One step at a time, as on board: the process, the relay, the cycles, the window.
fn oscillate_and_identify() -> Result<(SteadyRun, Refined), &'static CStr> {
    let process = Process::from_acceleration_gain(K_OVER_T_BODY, T_PROP_S, 1.0 / T_BODY_S, TAU_S)
        .map_err(|_| c"the parameters are not a process")?;
    let settings = RelaySettings::bare(AMPLITUDE as f32, RelaySettings::DISTINGUISHING_BETA);
    let mut relay = Relay::new(settings).map_err(|_| c"the settings are not a relay")?;
    let transition = Transition::over(&process, SAMPLE_S);
    let mut state = State::default();
    let mut delayed = [0.0; DELAY_SAMPLES];
    let mut detector = CycleDetector::new();
    let mut run = SteadyRun::default();
    let mut past = Past::default();
    let mut window: Option<(Window<BINS, EDGES>, u32)> = None;
    for sample in 0..MOST_SAMPLES {
        let time_s = f64::from(sample) * SAMPLE_S;
        let output = K_OVER_T_BODY * state.y;
        let input = f64::from(relay.step(-output as f32, SAMPLE_S as f32));
        let cycle = detector.push(time_s, relay.is_high(), output);
        if let Some(cycle) = cycle {
            run.push(&cycle);
            match &window {
                Some((full, began)) if run.cycles == began + CYCLES => {
                    let refined = refine(full, run.period_s);
                    return Ok((run, refined.map_err(|_| c"the window holds no process")?));
                }
                None if run.is_steady() => window = Some((past.window(time_s)?, run.cycles)),
                _ => {}
            }
        }
        past.push(time_s, input)?;
        if let Some((window, _)) = &mut window {
            window
                .push_input(time_s, input)
                .map_err(|_| c"more switches than the window holds")?;
            window.push_output(time_s, output);
        }
        let slot = &mut delayed[sample as usize % DELAY_SAMPLES];
        state = transition.apply(&state, *slot);
        *slot = input;
    }
    Err(c"no steady oscillation in ten seconds")
}

fn judge(run: &SteadyRun, refined: &Refined) -> Result<(), &'static CStr> {
    let process = &refined.process;
    let near = |value: f64, truth: f64| (value - truth).abs() <= TOLERANCE * truth;
    let check = |holds: bool, sentence| if holds { Ok(()) } else { Err(sentence) };
    check(
        PERIOD_S.contains(&run.period_s),
        c"the period is not the predicted one",
    )?;
    check(
        OSCILLATION.contains(&run.amplitude),
        c"the amplitude is not the predicted one",
    )?;
    check(
        near(process.k_over_t_body(), K_OVER_T_BODY),
        c"K/T_body is wrong",
    )?;
    check(near(process.t_prop_s(), T_PROP_S), c"T_prop is wrong")?;
    check(
        near(process.inv_t_body_per_s(), 1.0 / T_BODY_S),
        c"T_body is wrong",
    )?;
    check(near(process.tau_s(), TAU_S), c"tau is wrong")?;
    check(refined.covariance.is_some(), c"the covariance is missing")
}

/// The switches so far, for the window that opens after some of them.
#[derive(Default)]
struct Past {
    edges: [Edge; 32],
    count: usize,
}

impl Past {
    fn push(&mut self, time_s: f64, input: f64) -> Result<(), &'static CStr> {
        if self.count > 0 && self.edges[self.count - 1].input == input {
            return Ok(());
        }
        let free = self
            .edges
            .get_mut(self.count)
            .ok_or(c"more switches than the past holds")?;
        *free = Edge { time_s, input };
        self.count += 1;
        Ok(())
    }

    fn window(&self, start_s: f64) -> Result<Window<BINS, EDGES>, &'static CStr> {
        let mut window = Window::new(start_s, SAMPLE_S);
        for edge in &self.edges[..self.count] {
            window
                .push_input(edge.time_s, edge.input)
                .map_err(|_| c"more switches than the window holds")?;
        }
        Ok(window)
    }
}

/// Needs a heap: refused for want of an allocator.
#[cfg(feature = "use-alloc")]
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_proof_control(length: usize) -> usize {
    let mut values = alloc::vec::Vec::with_capacity(length);
    values.extend(0..length);
    values.iter().sum()
}

/// Needs the standard library and, through it, libc: refused by the linker.
#[cfg(feature = "use-std")]
#[unsafe(no_mangle)]
pub extern "C" fn onecycle_proof_control(length: usize) -> usize {
    let values: std::vec::Vec<usize> = (0..length).collect();
    std::thread::spawn(move || values.iter().sum())
        .join()
        .unwrap_or(0)
}

// With std linked its own handler is there, and a second one would be refused before the linker
// has its say.
#[cfg(not(feature = "use-std"))]
mod panic {
    use core::panic::PanicInfo;

    // Sound: start.c defines it so, and it does not come back.
    unsafe extern "C" {
        safe fn onecycle_proof_panicked() -> !;
    }

    #[panic_handler]
    fn panicked(_: &PanicInfo<'_>) -> ! {
        onecycle_proof_panicked()
    }
}
