//! PX4's identifier: ARX(2,2) with a dead time of one sample by recursive least squares, from the input
//! to the angular rate (PX4 `mc_autotune_attitude_control` and its library `system_identification`,
//! M. Bresciani 2021; D. Bonvin, A. Karimi, "Identification de systemes dynamiques", EPFL 2011).
//!
//! ```text
//! v(k) = -a1 v(k-1) - a2 v(k-2) + b0 u(k-1) + b1 u(k-2) + b2 u(k-3) + e(k)
//! ```
//!
//! Both signals pass the filters of PX4 first: a Butterworth low pass of second order and a high pass
//! of first order; then every n-th sample is kept. The rate is the difference of the recorded output.
//! Both signals are scaled to a root mean square of one, so that the initial covariance is weak
//! whatever their units, and the estimator waits until the high pass has forgotten the signal before
//! the recording.
//!
//! The model becomes a process by its poles and its first moments:
//!
//! ```text
//! lags -dt/ln p,   K = sum b / ((1 - p1)(1 - p2)),
//! tau = dt (1 + (b1 + 2 b2)/sum b + sum p/(1 - p)) - sum of the lags - one sample of the recording
//! ```
//!
//! The last sample accounts for the hold of the input and the difference of the output, half a sample
//! each. The process then gets the same controller as those of all methods.
//!
//! PX4 itself designs its gains by another law: [`gmvc`](super::gmvc).

use std::f64::consts::{PI, SQRT_2, TAU};

use onecycle_onboard::Soiptd;

use super::{BaselineAnswer, BaselineError, check_even, steady_cycles};
use onecycle_identify::{MOST_CYCLES, Signals};

/// Coefficients, `a1`, `a2`, `b0`, `b1`, `b2`.
pub const COEFFICIENTS: usize = 5;

/// PX4's variance of every coefficient at the start.
const FIRST_VARIANCE: f64 = 1e4;

/// Fastest pole, to which faster ones are limited: a lag of a tenth of the model's sample period.
const FASTEST_POLE: f64 = 4.5e-5;

/// Samples of the model in a period of the oscillation: few enough for two samples to hold the dead
/// times of the paper's processes, which are up to a sixth of the period.
const SAMPLES_A_PERIOD: f64 = 16.0;

/// Shortest time constant of forgetting of a scaled estimator, in periods.
const FORGETTING_PERIODS: f64 = 60.0;

/// Time constants of the high pass after which the estimator starts: the signal before the recording is
/// then forgotten to a twentieth.
const WARM_UP: f64 = 3.0;

/// The recursive estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimator {
    forgetting: f64,
    coefficients: [f64; COEFFICIENTS],
    covariance: [[f64; COEFFICIENTS]; COEFFICIENTS],
    /// Latest first; `u(k-1)`, `u(k-2)`, `u(k-3)`.
    inputs: [f64; 3],
    /// Latest first; `v(k-1)`, `v(k-2)`.
    rates: [f64; 2],
    seen: usize,
}

impl Estimator {
    /// An estimator without data. The forgetting factor is the weight of a sample over the weight of
    /// the next one, above zero and at most one.
    ///
    /// # Errors
    /// [`BaselineError::Setting`] for a factor out of its range.
    pub fn new(forgetting: f64) -> Result<Self, BaselineError> {
        if !(forgetting > 0.0 && forgetting <= 1.0) {
            return Err(BaselineError::Setting("the forgetting factor", forgetting));
        }
        let mut covariance = [[0.0; COEFFICIENTS]; COEFFICIENTS];
        for (index, row) in covariance.iter_mut().enumerate() {
            row[index] = FIRST_VARIANCE;
        }
        Ok(Self {
            forgetting,
            coefficients: [0.0; COEFFICIENTS],
            covariance,
            inputs: [0.0; 3],
            rates: [0.0; 2],
            seen: 0,
        })
    }

    /// Adds a sample: the measured rate, and the input held after it.
    pub fn push(&mut self, input: f64, rate: f64) {
        if self.seen >= self.inputs.len() {
            self.update(rate);
        }
        self.seen += 1;
        self.inputs = [input, self.inputs[0], self.inputs[1]];
        self.rates = [rate, self.rates[0]];
    }

    fn update(&mut self, rate: f64) {
        let [v1, v2] = self.rates;
        let [u1, u2, u3] = self.inputs;
        let regressor = [-v1, -v2, u1, u2, u3];
        let dot =
            |a: &[f64; COEFFICIENTS]| -> f64 { a.iter().zip(&regressor).map(|(x, y)| x * y).sum() };
        let spread = self.covariance.map(|row| dot(&row));
        let scale = self.forgetting + dot(&spread);
        let innovation = rate - dot(&self.coefficients);
        for i in 0..COEFFICIENTS {
            self.coefficients[i] += spread[i] * innovation / scale;
            for j in 0..COEFFICIENTS {
                let told = spread[i] * spread[j] / scale;
                self.covariance[i][j] = (self.covariance[i][j] - told) / self.forgetting;
            }
        }
    }

    /// `a1`, `a2`, `b0`, `b1`, `b2`; `b` in rate unit / input unit.
    #[must_use]
    pub fn coefficients(&self) -> [f64; COEFFICIENTS] {
        self.coefficients
    }
}

/// Filters before the estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArxSettings {
    /// Cut-off of the low pass (Hz).
    pub low_pass_hz: f64,
    /// Cut-off of the high pass (Hz).
    pub high_pass_hz: f64,
    /// Sample period of the model (s), rounded down to a multiple of the recording's, at least one
    /// sample.
    pub model_s: f64,
    /// Time constant of forgetting (s).
    pub forgetting_s: f64,
}

impl ArxSettings {
    /// PX4's own settings: 30 Hz (the cut-off of its gyroscope, a parameter), 0.5 Hz, 10 ms (half the
    /// inverse of the first, 2 ms to 10 ms) and 60 s.
    pub const PX4: Self = Self {
        low_pass_hz: 30.0,
        high_pass_hz: 0.5,
        model_s: 0.01,
        forgetting_s: 60.0,
    };

    /// The same filters scaled with the oscillation, as a careful user would set them: a fixed number
    /// of model samples a period, the low pass at half their rate, the high pass at a tenth of the
    /// frequency of the oscillation.
    ///
    /// PX4's own settings suit dead times of 10 to 20 ms and the noise of a gyroscope. Of 50 random
    /// experiments with the paper's bias and noise, 48 controllers are unstable with them; with these
    /// none is, and the mean cost is 3.5 %.
    ///
    /// # Errors
    /// [`BaselineError::NoOscillation`], [`BaselineError::Uneven`].
    pub fn scaled_to_oscillation(signals: &Signals<'_>) -> Result<Self, BaselineError> {
        let (found, _) = steady_cycles(signals, MOST_CYCLES)?;
        Ok(Self {
            low_pass_hz: 0.5 * SAMPLES_A_PERIOD / found.period_s,
            high_pass_hz: 0.1 / found.period_s,
            model_s: found.period_s / SAMPLES_A_PERIOD,
            forgetting_s: f64::max(Self::PX4.forgetting_s, FORGETTING_PERIODS * found.period_s),
        })
    }

    fn validate(&self, sample_s: f64) -> Result<(), BaselineError> {
        for (name, value, is_right) in [
            (
                "the low pass",
                self.low_pass_hz,
                self.low_pass_hz * sample_s < 0.5,
            ),
            ("the high pass", self.high_pass_hz, true),
            ("the model's sample period", self.model_s, true),
            (
                "the forgetting",
                self.forgetting_s,
                self.forgetting_s > self.model_s,
            ),
        ] {
            if !(value.is_finite() && value > 0.0 && is_right) {
                return Err(BaselineError::Setting(name, value));
            }
        }
        Ok(())
    }
}

/// Identifies a process from a recording of input and output; the rate is the difference of the output.
///
/// # Errors
/// [`BaselineError::Uneven`], [`BaselineError::TooShort`], [`BaselineError::Setting`]; those of
/// [`Model::process`].
pub fn identify(
    signals: &Signals<'_>,
    settings: &ArxSettings,
    phase_margin_rad: f64,
) -> Result<BaselineAnswer, BaselineError> {
    let model = Model::of_differences(signals, settings)?;
    BaselineAnswer::of_process(model.process(signals.sample_period_s)?, phase_margin_rad)
}

/// The estimated model, in the units of the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// `a1`, `a2`, `b0`, `b1`, `b2`; `b` in rate unit / input unit.
    pub coefficients: [f64; COEFFICIENTS],
    /// Sample period of the model (s).
    pub sample_s: f64,
}

impl Model {
    /// A model from input and output; the rate is the difference of the output.
    ///
    /// # Errors
    /// Those of [`Model::of`].
    pub fn of_differences(
        signals: &Signals<'_>,
        settings: &ArxSettings,
    ) -> Result<Self, BaselineError> {
        let sample_s = signals.sample_period_s;
        let differences = signals
            .output
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / sample_s);
        let rate: Vec<f64> = std::iter::once(0.0).chain(differences).collect();
        Self::of(signals, &rate, settings)
    }

    /// Filters the signals and runs the estimator over them.
    ///
    /// # Errors
    /// [`BaselineError::Uneven`], also if the rate has another length, [`BaselineError::TooShort`],
    /// [`BaselineError::Setting`], [`BaselineError::NotThisProcess`] if a signal is constant.
    pub fn of(
        signals: &Signals<'_>,
        rate: &[f64],
        settings: &ArxSettings,
    ) -> Result<Self, BaselineError> {
        check_even(signals)?;
        let sample_s = signals.sample_period_s;
        settings.validate(sample_s)?;
        if rate.len() != signals.input.len() {
            return Err(BaselineError::Uneven);
        }
        let every = ((settings.model_s / sample_s + 1e-9) as usize).max(1);
        let warm_up = (WARM_UP / (TAU * settings.high_pass_hz * sample_s)).ceil() as usize;
        let filtered = |signal: &[f64]| {
            let mut filter = Filter::new(settings, sample_s);
            let all = signal.iter().map(|&value| filter.step(value));
            all.skip(warm_up).step_by(every).collect::<Vec<f64>>()
        };
        let (inputs, rates) = (filtered(signals.input), filtered(rate));
        if inputs.len() < 2 * COEFFICIENTS {
            return Err(BaselineError::TooShort {
                samples: rate.len(),
            });
        }
        let size = |values: &[f64]| {
            (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
        };
        let (input_size, rate_size) = (size(&inputs), size(&rates));
        if !(input_size > 0.0 && rate_size > 0.0) {
            return Err(BaselineError::NotThisProcess(
                "its input or its output is zero",
            ));
        }
        let model_s = every as f64 * sample_s;
        let mut estimator = Estimator::new(1.0 - model_s / settings.forgetting_s)?;
        for (input, rate) in inputs.iter().zip(&rates) {
            estimator.push(input / input_size, rate / rate_size);
        }
        let [a1, a2, b0, b1, b2] = estimator.coefficients();
        let unit = rate_size / input_size;
        Ok(Self {
            coefficients: [a1, a2, b0 * unit, b1 * unit, b2 * unit],
            sample_s: model_s,
        })
    }

    /// The process; `late_s` is the part of the delay due to hold and differences (s).
    ///
    /// A pole slower than an integrator becomes an integrator, a complex pair becomes two equal lags, a
    /// negative dead time becomes zero.
    ///
    /// # Errors
    /// [`BaselineError::NotThisProcess`] if the numbers are not finite; [`BaselineError::Process`].
    pub fn process(&self, late_s: f64) -> Result<Soiptd, BaselineError> {
        let [a1, a2, b0, b1, b2] = self.coefficients;
        let sum = b0 + b1 + b2;
        let discriminant = 0.25 * a1 * a1 - a2;
        // Clamped poles keep their gain of the force per sample.
        let (fast, slow, gain_part) = if discriminant >= 0.0 {
            let root = discriminant.sqrt();
            let pole = |p: f64| p.clamp(FASTEST_POLE, 1.0);
            let (fast, slow) = (pole(-0.5 * a1 - root), pole(-0.5 * a1 + root));
            (fast, slow, (1.0 - fast) * rest(slow))
        } else {
            let pole = a2.sqrt().clamp(FASTEST_POLE, 1.0 - 1e-9);
            (pole, pole, (1.0 + a1 + a2) / -pole.ln())
        };
        let steps = 1.0 + (b1 + 2.0 * b2) / sum + hold(fast) + hold(slow);
        let delay_s = self.sample_s * steps - late_s;
        let acceleration = sum / (gain_part * self.sample_s);
        if !(delay_s.is_finite() && acceleration.is_finite()) {
            return Err(BaselineError::NotThisProcess(
                "its gain or dead time is not finite",
            ));
        }
        Ok(Soiptd::from_acceleration_gain(
            acceleration,
            -self.sample_s / fast.ln(),
            -slow.ln() / self.sample_s,
            delay_s.max(0.0),
        )?)
    }
}

/// `(1 - p)/(-ln p)`, one at `p = 1`.
fn rest(pole: f64) -> f64 {
    let rate = -pole.ln();
    if rate > 0.0 { (1.0 - pole) / rate } else { 1.0 }
}

/// `p/(1 - p) + 1/ln p`: mean delay of a discrete pole minus its lag, in samples; -1/2 at `p = 1`.
fn hold(pole: f64) -> f64 {
    let rate = -pole.ln();
    // Series for small rates, where the difference cancels: -1/2 + r/12.
    if rate < 1e-4 {
        rate / 12.0 - 0.5
    } else {
        pole / (1.0 - pole) - 1.0 / rate
    }
}

/// Low pass of second order (Butterworth, bilinear transform), then high pass of first order.
#[derive(Clone, Copy, Debug)]
struct Filter {
    forward: f64,
    back: [f64; 2],
    keep: f64,
    inner: Option<[f64; 2]>,
    low_passed: f64,
    high_passed: f64,
}

impl Filter {
    fn new(settings: &ArxSettings, sample_s: f64) -> Self {
        let warped = (PI * settings.low_pass_hz * sample_s).tan();
        let norm = 1.0 + SQRT_2 * warped + warped * warped;
        let time_s = 1.0 / (TAU * settings.high_pass_hz);
        Self {
            forward: warped * warped / norm,
            back: [
                2.0 * (warped * warped - 1.0) / norm,
                (1.0 - SQRT_2 * warped + warped * warped) / norm,
            ],
            keep: time_s / (time_s + sample_s),
            inner: None,
            low_passed: 0.0,
            high_passed: 0.0,
        }
    }

    /// The first value counts as the value for all time before.
    fn step(&mut self, value: f64) -> f64 {
        let [back1, back2] = self.back;
        let first = self.inner.is_none();
        let [w1, w2] = self.inner.unwrap_or([value / (1.0 + back1 + back2); 2]);
        let w0 = value - back1 * w1 - back2 * w2;
        self.inner = Some([w0, w1]);
        let low_passed = self.forward * (w0 + 2.0 * w1 + w2);
        if first {
            self.low_passed = low_passed;
        }
        self.high_passed = self.keep * (self.high_passed + low_passed - self.low_passed);
        self.low_passed = low_passed;
        self.high_passed
    }
}
