//! The prediction error method: a continuous-time output-error fit by sequential quadratic programming.
//! It is the baseline of the paper's section IV-B.
//!
//! ```text
//!                          K e^(-tau s)
//! y(t) = ------------------------------------ (u(t) + b) + (initial state) + noise
//!        s (T_prop s + 1)(T_body s + 1)
//!
//! minimise  sum (y - model)^2 / sum (y - mean y)^2   over  ln T_prop, ln T_body, ln tau
//! ```
//!
//! With white noise at the output the prediction error is the output error (L. Ljung, "System
//! Identification: Theory for the User", 1999, chapter 7). `K`, the initial state and a bias `b` enter
//! linearly and are solved for at every step (G. Golub, V. Pereyra, "The differentiation of
//! pseudo-inverses and nonlinear least squares problems whose variables separate", SIAM J. Numer. Anal.
//! 10, 1973), so they need no start value. The toolbox behind the paper searches for `K` too and
//! depends on its start. The search runs over the logarithms of the three times, which keeps them
//! positive and scales them alike.
//!
//! The optimiser is Kraft's SLSQP (D. Kraft, "Algorithm 733: TOMP-Fortran modules for optimal control
//! calculations", ACM Trans. Math. Softw. 20, 1994). The model is simulated exactly, the delay too.
//!
//! [`PemSettings::paper`] follows the paper: one start, the initial state estimated, no bias.
//! [`PemSettings::with_offset`] is the default of MathWorks' `procest` today: the same with a bias.
//! [`PemSettings::fair`] is what a careful user would do today: a bias, and starts all over the domain.

mod output_error;

use std::ops::Range;

use onecycle_onboard::Soiptd;
use slsqp::{Func, StopTols, minimize};

use self::output_error::OutputError;
use super::{BaselineAnswer, BaselineError, check_even, steady_cycles};
use onecycle_identify::Signals;

/// The samples that are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Data {
    /// The last steady cycle, the paper's estimation set I.
    LastCycle,
    /// The whole recording, its estimation set II.
    Whole,
}

/// What is known of the process at the first sample of the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialState {
    /// The process was at rest at zero output, with zero input before.
    Rest,
    /// Nothing: output, rate and force are estimated. The recorded input before the first sample
    /// counts.
    Estimated,
}

/// Treatment of a constant input that was not recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputBias {
    /// The input has no bias.
    Ignored,
    /// The mean of the input over the fitted samples is removed. This is right if they are whole
    /// cycles, because an integrator oscillates only if its mean input is zero.
    MeanRemoved,
    /// The bias is estimated.
    Estimated,
}

/// Settings of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct PemSettings {
    /// Samples to fit.
    pub data: Data,
    /// State of the process at the first of these samples.
    pub initial_state: InitialState,
    /// Treatment of a constant input.
    pub input_bias: InputBias,
    /// Longest dead time over the duration of the fitted samples; infinite for the general limit of 2
    /// s.
    pub longest_delay: f64,
    /// Starts, `T_prop`, `T_body`, `tau` (s); the fit of least cost counts.
    pub starts_s: Vec<[f64; 3]>,
}

/// The paper's start, `T_prop`, `T_body`, `tau` (s), unless it says otherwise: the process of its
/// domain that is most sensitive to its parameters.
pub const PAPER_START_S: [f64; 3] = [0.015, 0.2, 0.1];

/// Times of the fair starts (s): the middles of thirds of the paper's domain, in logarithms.
const FAIR_TIMES_S: [[f64; 3]; 3] = [
    [0.025, 0.067, 0.18],
    [0.29, 0.63, 1.4],
    [0.0012, 0.007, 0.041],
];

/// Limits of the lags and of the dead time (s): at least fifteen times beyond the paper's domain on
/// either side.
const LIMITS_S: [(f64, f64); 3] = [(1e-3, 100.0), (1e-3, 100.0), (1e-5, 2.0)];

/// Longest dead time of a process under the paper's relay, over the period of the oscillation. A relay
/// with `beta` leads by `asin(-beta)`, 46.9 degrees at -0.73, so it oscillates where the process lags by
/// 226.9 degrees; the integrator takes 90 of them, dead time and lags the other 136.9, 0.38 of a turn.
pub const LONGEST_DELAY: f64 = 0.38;

/// Most evaluations of the cost for a start. Of 540 starts on random experiments half needed 60, none
/// more than 159.
const MOST_EVALUATIONS: usize = 400;
/// Relative change of the logarithms of the times, and of the cost, at which the search ends.
const TOLERANCE: f64 = 1e-12;

impl PemSettings {
    /// Settings that come nearest to the paper's results: one start, the initial state estimated, the mean
    /// of the input removed and no offset estimated.
    ///
    /// The paper does not say how its toolbox treated the input's offset; [`with_offset`](Self::with_offset)
    /// is that toolbox's default. Without removing the mean the method hardly works: of 50 random
    /// processes under the paper's bias and noise, 3 controllers are unstable from one cycle and 1 from the
    /// sweep; with the bias ignored 17 and 42 are (the paper: 5 and 1).
    #[must_use]
    pub fn paper(data: Data) -> Self {
        Self {
            data,
            initial_state: InitialState::Estimated,
            input_bias: InputBias::MeanRemoved,
            longest_delay: f64::INFINITY,
            starts_s: vec![PAPER_START_S],
        }
    }

    /// As [`paper`](Self::paper), with the offset of the input estimated: MathWorks' `procest` does so by
    /// default (`InputOffset` `auto`) for a model with an integrator.
    #[must_use]
    pub fn with_offset(data: Data) -> Self {
        Self {
            input_bias: InputBias::Estimated,
            ..Self::paper(data)
        }
    }

    /// Settings of a careful user: one cycle, the initial state and a bias estimated, 27 starts all
    /// over the paper's domain, the dead time at most 0.38 of the period.
    ///
    /// On 50 random experiments with the paper's bias and noise the cost is 0.31 % on average, 1.4 % at
    /// worst. With [`InputBias::MeanRemoved`] it is 0.20 and 1.5 %, but never exact, because the
    /// samples of a cycle are not exactly a whole period.
    ///
    /// A dead time longer by one period explains a periodic recording equally well. It is excluded: see
    /// [`LONGEST_DELAY`].
    #[must_use]
    pub fn fair() -> Self {
        let [props, bodies, delays] = FAIR_TIMES_S;
        let starts = props.into_iter().flat_map(|t_prop_s| {
            bodies.into_iter().flat_map(move |t_body_s| {
                delays
                    .into_iter()
                    .map(move |tau_s| [t_prop_s, t_body_s, tau_s])
            })
        });
        Self {
            input_bias: InputBias::Estimated,
            longest_delay: LONGEST_DELAY,
            starts_s: starts.collect(),
            ..Self::paper(Data::LastCycle)
        }
    }
}

/// The fit of least cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputErrorFit {
    /// The process.
    pub process: Soiptd,
    /// The constant input (input unit), if it was estimated.
    pub input_bias: Option<f64>,
    /// Residual sum of squares over the output's sum of squares about its mean.
    pub cost: f64,
    /// Index of the start that led to this fit.
    pub start: usize,
}

/// Fits the samples that the settings name and designs the PD of least ISE at a phase margin (rad).
///
/// # Errors
/// [`BaselineError::NoOscillation`] if a cycle is asked for and none is steady; the errors of [`fit`];
/// the process found may have no controller.
pub fn identify(
    signals: &Signals<'_>,
    settings: &PemSettings,
    phase_margin_rad: f64,
) -> Result<BaselineAnswer, BaselineError> {
    let window = match settings.data {
        Data::LastCycle => steady_cycles(signals, 1)?.1,
        Data::Whole => 0..signals.time_s.len(),
    };
    let found = fit(signals, window, settings)?;
    BaselineAnswer::of_process(found.process, phase_margin_rad)
}

/// Fits the samples of a window of the recording.
///
/// # Errors
/// [`BaselineError::Uneven`], [`BaselineError::TooShort`], [`BaselineError::Setting`] for a start that
/// is not a positive time, [`BaselineError::NotThisProcess`] if no start leads to a fit.
pub fn fit(
    signals: &Signals<'_>,
    window: Range<usize>,
    settings: &PemSettings,
) -> Result<OutputErrorFit, BaselineError> {
    check_even(signals)?;
    let duration_s = window.len() as f64 * signals.sample_period_s;
    let model = OutputError::new(signals, window, settings)?;
    let mut limits_s = LIMITS_S;
    limits_s[2].1 = limits_s[2].1.min(settings.longest_delay * duration_s);
    let [.., (shortest_s, longest_s)] = limits_s;
    if longest_s.is_nan() || longest_s <= shortest_s {
        return Err(BaselineError::Setting("the longest delay", longest_s));
    }
    let mut best: Option<OutputErrorFit> = None;
    for (start, times_s) in settings.starts_s.iter().enumerate() {
        for &time_s in times_s {
            if !(time_s.is_finite() && time_s > 0.0) {
                return Err(BaselineError::Setting("a time of a start", time_s));
            }
        }
        let found =
            search(&model, *times_s, limits_s).and_then(|times_s| model.fit(times_s, start));
        best = match (best, found) {
            (Some(best), Some(found)) if found.cost >= best.cost => Some(best),
            (best, found) => found.or(best),
        };
    }
    best.ok_or(BaselineError::NotThisProcess("no start leads to a fit"))
}

/// The times (s) at which SLSQP ends; `None` if the cost is not defined there.
fn search(
    model: &OutputError<'_>,
    start_s: [f64; 3],
    limits_s: [(f64, f64); 3],
) -> Option<[f64; 3]> {
    let limits = limits_s.map(|(low, high)| (low.ln(), high.ln()));
    let start: Vec<f64> = start_s
        .iter()
        .zip(limits)
        .map(|(time_s, (low, high))| time_s.ln().clamp(low, high))
        .collect();
    let times_s = |x: &[f64]| [x[0].exp(), x[1].exp(), x[2].exp()];
    let objective = |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
        let (cost, slopes) = model.cost_and_slopes(times_s(x), gradient.is_some());
        if let Some(gradient) = gradient {
            gradient.copy_from_slice(&slopes);
        }
        cost
    };
    let stop = StopTols {
        ftol_rel: TOLERANCE,
        xtol_rel: TOLERANCE,
        ..StopTols::default()
    };
    let constraints: [&dyn Func<()>; 0] = [];
    // The end of the search is the answer whatever the reason it stopped: rounding stops most searches
    // that are at the optimum.
    let (x, cost) = match minimize(
        objective,
        &start,
        &limits,
        &constraints,
        (),
        MOST_EVALUATIONS,
        Some(stop),
    ) {
        Ok((_, x, cost)) | Err((_, x, cost)) => (x, cost),
    };
    cost.is_finite().then(|| times_s(&x))
}
