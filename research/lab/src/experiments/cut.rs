//! Cycles cut out of a recorded relay experiment: all of them, the last steady one, its window, its
//! signature, its samples.

use onecycle_identify::Signals;
use onecycle_onboard::cycle::{Cycle, CycleDetector, SteadyRun};
use onecycle_onboard::signature::Signature;
use onecycle_onboard::window::Window;
use onecycle_plant::Trace;

/// Least jump of the input that is a switch of the relay: between the trim's small moves and the
/// relay's own jump of two.
const JUMP: f64 = 0.5;

/// Bins of a cycle's window, of which the window uses five itself: each is at most half as wide as a
/// part of the signature.
const BINS: usize = 261;
/// Edges of a cycle that the window has room for, and as many again that were taken back.
const EDGES: usize = 16;

/// A simulated recording at an even sample period (s).
#[must_use]
pub fn signals_of(trace: &Trace, sample_period_s: f64) -> Signals<'_> {
    Signals::even(&trace.time_s, &trace.input, &trace.output, sample_period_s)
}

/// The cycles of a relay of amplitude one, from the measured output or from the true one.
pub fn cycles<'a>(trace: &'a Trace, output: &'a [f64]) -> impl Iterator<Item = Cycle> + use<'a> {
    let mut detector = CycleDetector::new();
    let mut is_high = false;
    (1..trace.len()).filter_map(move |index| {
        let jump = trace.input[index] - trace.input[index - 1];
        if jump.abs() > JUMP {
            is_high = jump > 0.0;
        }
        detector.push(trace.time_s[index], is_high, output[index])
    })
}

/// The last cycle, if the relay is steady there: three cycles alike.
#[must_use]
pub fn last_steady_cycle(trace: &Trace) -> Option<Cycle> {
    let mut run = SteadyRun::default();
    let mut last = None;
    for cycle in cycles(trace, &trace.output) {
        run.push(&cycle);
        last = run.is_steady().then_some(cycle);
    }
    last
}

/// The samples of the last whole cycle of a relay of amplitude one, from a rise of its input to the next, steady or not.
#[must_use]
pub fn last_whole_cycle(trace: &Trace, sample_s: f64) -> Option<SampledCycle> {
    let rises = (1..trace.len()).rev();
    let mut rises = rises.filter(|&k| trace.input[k] - trace.input[k - 1] > JUMP);
    let last = rises.next()?;
    let first = rises.next()?;
    let single = |signal: &[f64]| signal[first..last].iter().map(|&x| x as f32).collect();
    Some(SampledCycle {
        sample_s,
        input: single(&trace.input),
        output: single(&trace.output),
        drift: 0.0,
    })
}

/// What the board keeps of one steady cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyCycle {
    /// What a network sees.
    pub signature: Signature,
    /// Period (s).
    pub period_s: f64,
    /// Noise of a sample as the window measures it (output unit).
    pub noise_sigma: f64,
}

impl SteadyCycle {
    /// The last cycle of a recording; `None` if the relay is not steady there, or the cycle has no
    /// signature.
    #[must_use]
    pub fn last_of(trace: &Trace, sample_s: f64) -> Option<Self> {
        let cycle = last_steady_cycle(trace)?;
        let window = window(trace, &cycle, sample_s)?;
        Some(Self {
            signature: Signature::new(&window, &cycle).ok()?,
            period_s: cycle.period_s,
            noise_sigma: window.noise_sigma(),
        })
    }
}

/// First sample of a cycle, and how many samples the cycle has.
fn samples_of(cycle: &Cycle, sample_s: f64) -> (usize, usize) {
    let first = (cycle.start_s / sample_s).round() as usize;
    let count = (cycle.period_s / sample_s).round() as usize;
    (first, count)
}

/// The samples of one cycle, as the board collects them.
fn window(trace: &Trace, cycle: &Cycle, sample_s: f64) -> Option<Window<BINS, EDGES>> {
    let (first, count) = samples_of(cycle, sample_s);
    let last = (first + count).min(trace.len());
    let mut window = Window::new(*trace.time_s.get(first)?, sample_s);
    for index in first..last {
        window.push_output(trace.time_s[index], trace.output[index]);
    }
    Some(window)
}

/// Both signals of a whole cycle, from a rise of the relay to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledCycle {
    /// Sample period (s).
    pub sample_s: f64,
    /// Input as commanded (input unit).
    pub input: Vec<f32>,
    /// Output as measured (output unit).
    pub output: Vec<f32>,
    /// Output at the end of the cycle less output at its start (output unit), each a mean around that
    /// point; zero in a steady state.
    pub drift: f64,
}

/// Part of the cycle on either side of its ends over which the drift is averaged.
const DRIFT_PART: f64 = 1.0 / 32.0;

impl SampledCycle {
    /// The samples of a cycle; `None` if the recording does not hold all of them.
    #[must_use]
    pub fn of(trace: &Trace, cycle: &Cycle, sample_s: f64) -> Option<Self> {
        let (first, count) = samples_of(cycle, sample_s);
        let last = first + count;
        let single = |signal: &[f64]| {
            let values = signal.get(first..last)?;
            Some(values.iter().map(|&value| value as f32).collect())
        };
        let around = ((DRIFT_PART * count as f64) as usize).clamp(1, first.max(1));
        let mean_about = |k: usize| {
            let end = (k + around).min(trace.len());
            let values = &trace.output[k - around..end];
            values.iter().sum::<f64>() / values.len() as f64
        };
        let is_inside = first >= around && last < trace.len();
        Some(Self {
            drift: if is_inside {
                mean_about(last) - mean_about(first)
            } else {
                0.0
            },
            sample_s,
            input: single(&trace.input)?,
            output: single(&trace.output)?,
        })
    }
}
