//! A steady oscillation seen by the general estimator: the same structure fitted to the whole recording.

use std::f64::consts::TAU;

use onecycle_design::{Linear, Model, Structure};

use super::prepare::prepare;
use super::record::Blocks;
use super::search;
use super::theta::{NoiseKind, Theta};
use super::{LONGEST_TAU, NEARLY, ROWS, forces, outliers, result};
use crate::settings::Options;
use crate::signals::Signals;

/// Rows a period of the oscillation, at least: with fewer the intervals widen.
const ROWS_A_PERIOD: f64 = 30.0;
/// First frequency of a noise over that of the oscillation. The search converges from far above.
const NOISE_OVER_OSCILLATION: f64 = 0.5;

/// Most samples to fit: of a longer recording the last ones.
const MOST: usize = 100_000;

/// What the whole recording shows.
pub(crate) struct Checked {
    /// The process.
    pub(crate) model: Model,
    /// Whether a process that comes to rest by itself, with two lags, explains the recording better.
    pub(crate) is_another: bool,
    /// The linear part of the process with the nonlinear forces that the recording asks for, if it asks for any.
    pub(crate) with_forces: Option<Model>,
}

/// Starts for a process that comes to rest by itself and responds like `theta` near the frequency of the oscillation: the lag
/// of the body stays, the integrator becomes a lag that is slow, or as fast as the oscillation, and the dead time takes up the
/// actuator's lag.
fn resting(theta: &Theta, omega_rad_per_s: f64) -> [Theta; 3] {
    const POLES: [f64; 3] = [0.03, 0.2, 1.0];
    let (tau_s, lag_s) = theta.delay_and_lag_s();
    let body_per_s = theta.process(1.0).pole_per_s().max(0.2 * omega_rad_per_s);
    POLES.map(|part| {
        let mut start = Theta::new(Structure::Soptd).with_noises_of(theta);
        let layout = start.layout();
        start.values[0] = -body_per_s.ln();
        start.values[1] = part * omega_rad_per_s;
        start.values[layout.tau()] = tau_s + lag_s;
        start
    })
}

/// The process that the whole recording shows, transient and disturbances included, in the structure of `found`, which
/// is the process of a steady oscillation with this period. `None` if nothing can be fitted.
pub(crate) fn check(
    signals: &Signals<'_>,
    options: &Options,
    found: &Linear,
    period_s: f64,
) -> Option<Checked> {
    let from_s = signals
        .time_s
        .len()
        .checked_sub(MOST)
        .map(|first| signals.time_s[first]);
    let options = Options {
        span_s: (from_s, None),
        ..*options
    };
    let mut prepared = prepare(signals, &options).ok()?;
    outliers::mark_far(&mut prepared.record);
    let record = &prepared.record;
    let longest_s = LONGEST_TAU * record.time_s(record.len() - 1);
    let skip_s = (1.5 * found.tau_s() + 2.0 * record.dt_s).min(longest_s);
    let rows = record.len() - record.index_at(skip_s);
    let a_period = (period_s / ROWS_A_PERIOD / record.dt_s) as usize;
    let samples = (rows / ROWS).min(a_period).max(1);
    let blocks = Blocks::new(record, samples, skip_s);
    let mut start = Theta::new(Structure::Soiptd);
    let layout = start.layout();
    start.values[0] = found.lags_s()[0].ln();
    start.values[layout.pole()?] = found.pole_per_s();
    start.values[layout.tau()] = found.tau_s() - prepared.early_s;
    let candidates = NoiseKind::ALL.into_iter().filter_map(|kind| {
        let mut start = start;
        start.set_noise(kind, NOISE_OVER_OSCILLATION * TAU / period_s);
        search::fit(&blocks, &start, longest_s)
    });
    let best = search::best(candidates)?;
    let theta = &best.found.theta;
    let resting = resting(theta, TAU / period_s);
    let resting = resting
        .iter()
        .filter_map(|start| search::fit(&blocks, start, longest_s));
    let is_another = search::best(resting).is_some_and(|resting| resting.bic < best.bic - NEARLY);
    let asked = forces::forces(record, &best, theta, (samples, skip_s, longest_s));
    Some(Checked {
        model: result::model(&best.found, prepared.early_s),
        is_another,
        with_forces: asked.map(|(_, with)| result::model(&with.found, prepared.early_s)),
    })
}
