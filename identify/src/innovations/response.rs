//! Response of a process of unit gain, at rest at the first sample, to the recorded input.
//!
//! The dead time is `tau = (m + f) dt` with a whole `m` and `0 <= f < 1`. During one sample the delayed input is that of
//! two samples: a part `f` of the older one, then the newer one. Before the record the input is that of the first
//! sample. A negative dead time uses later input.

use onecycle_design::state_space::{StateSpace, Step, product, times};

use super::record::{Hold, Record};

/// Output of the response at each sample (output unit / input unit for unit gain), and the state at each sample if
/// `output` wants it.
pub(crate) fn response<const N: usize>(
    model: &StateSpace<N>,
    record: &Record,
    tau_s: f64,
) -> Vec<f64> {
    if record.uneven_s.is_empty() {
        even(model, record, tau_s)
    } else {
        uneven(model, record, tau_s)
    }
}

/// Samples on an even grid.
fn even<const N: usize>(model: &StateSpace<N>, record: &Record, tau_s: f64) -> Vec<f64> {
    let dt = record.dt_s;
    let whole = (tau_s / dt).floor();
    let fraction = tau_s / dt - whole;
    let (older, newer) = (model.step(fraction * dt), model.step((1.0 - fraction) * dt));
    let phi = product(&newer.phi, &older.phi);
    let older_held = times(&newer.phi, &older.held);
    let older_ramp = times(&newer.phi, &older.ramp);
    let last = record.len() as i64 - 1;
    let at = |index: i64| record.input[index.clamp(0, last) as usize];
    let delay = whole as i64;
    let mut state = [0.0; N];
    let mut outputs = Vec::with_capacity(record.len());
    for sample in 0..record.len() as i64 {
        outputs.push(state[model.output]);
        let (before, now) = (at(sample - delay - 1), at(sample - delay));
        let mut next = times(&phi, &state);
        match record.hold {
            Hold::Held => {
                for i in 0..N {
                    next[i] += older_held[i] * before + newer.held[i] * now;
                }
            }
            Hold::Interpolated => {
                let slope = (now - before) / dt;
                let later = (at(sample - delay + 1) - now) / dt;
                let start = before + slope * (1.0 - fraction) * dt;
                for i in 0..N {
                    next[i] += older_held[i] * start
                        + older_ramp[i] * slope
                        + newer.held[i] * now
                        + newer.ramp[i] * later;
                }
            }
        }
        state = next;
    }
    outputs
}

/// Samples at any times: from edge to edge of the delayed input and from sample to sample.
fn uneven<const N: usize>(model: &StateSpace<N>, record: &Record, tau_s: f64) -> Vec<f64> {
    let times_s = &record.uneven_s;
    let mut steps = Steps::new(model);
    let mut state = [0.0; N];
    let mut outputs = vec![0.0];
    let mut now_s = times_s[0];
    // Sample whose input acts; that of the first sample acts before the record too.
    let mut acting = times_s.partition_point(|at| at + tau_s <= now_s);
    for &end_s in &times_s[1..] {
        while now_s < end_s {
            let edge_s = times_s.get(acting).map_or(f64::INFINITY, |at| at + tau_s);
            let until_s = end_s.min(edge_s);
            let (value, slope) = input(record, acting, now_s - tau_s);
            if until_s > now_s {
                let step = steps.of(until_s - now_s);
                let mut next = times(&step.phi, &state);
                for i in 0..N {
                    next[i] += step.held[i] * value + step.ramp[i] * slope;
                }
                state = next;
            }
            now_s = until_s;
            acting += usize::from(edge_s <= now_s);
        }
        outputs.push(state[model.output]);
    }
    outputs
}

/// Input and its slope at a time, where `acting` samples have passed.
fn input(record: &Record, acting: usize, time_s: f64) -> (f64, f64) {
    let Some(sample) = acting.checked_sub(1) else {
        return (record.input[0], 0.0);
    };
    let value = record.input[sample];
    match (record.hold, record.input.get(sample + 1)) {
        (Hold::Interpolated, Some(next)) => {
            let (start_s, end_s) = (record.uneven_s[sample], record.uneven_s[sample + 1]);
            let slope = (next - value) / (end_s - start_s);
            (value + slope * (time_s - start_s), slope)
        }
        _ => (value, 0.0),
    }
}

/// Matrices of the lengths of step that occurred lately, to the nanosecond.
struct Steps<'a, const N: usize> {
    model: &'a StateSpace<N>,
    known: Vec<(i64, Step<N>)>,
}

impl<'a, const N: usize> Steps<'a, N> {
    /// Number of lengths to remember.
    const SIZE: usize = 4096;

    fn new(model: &'a StateSpace<N>) -> Self {
        let none = (-1, model.step(0.0));
        Self {
            model,
            known: vec![none; Self::SIZE],
        }
    }

    fn of(&mut self, length_s: f64) -> Step<N> {
        let key = (length_s * 1e9).round() as i64;
        let slot = &mut self.known[key as usize % Self::SIZE];
        if slot.0 != key {
            *slot = (key, self.model.step(length_s));
        }
        slot.1
    }
}
