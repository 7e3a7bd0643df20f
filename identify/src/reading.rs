//! Estimate of the process from one cycle, by the network of a pack.

use onecycle_onboard::SoiptdError;
use onecycle_onboard::classify::{Classification, Familiarity};
use onecycle_onboard::refine::{Refined, coordinate, residuals};
use onecycle_onboard::window::Window;

/// Standard deviation of the mean input of a cycle about minus the input bias, as a fraction of the relay amplitude.
/// Measured on the paper's multirotors with 2 to 3 % noise at 250 to 700 samples per period.
const INPUT_BIAS_DEVIATION: f64 = 0.004;

/// Estimate of the process from the last cycle of an oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Reading {
    /// Posterior, candidates and misfit score. Gains are those for a relay of amplitude one.
    pub classification: Classification,
    /// Period of the cycle (s).
    pub period_s: f64,
    /// Half the distance between the levels of the relay (input unit).
    pub(crate) relay_amplitude: f64,
    /// Mean of the input over the cycle (input unit).
    pub(crate) mean_input: f64,
}

impl Reading {
    /// Whether a process of the pack's family explains the cycle.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.classification.familiarity == Familiarity::Known
    }

    /// The estimate in the form of a fit of `window`, with the residual of the estimated process.
    ///
    /// # Errors
    /// [`SoiptdError`]: the gain over the relay amplitude is not finite.
    pub(crate) fn as_fit<const BINS: usize, const EDGES: usize>(
        &self,
        window: &Window<BINS, EDGES>,
    ) -> Result<Refined, SoiptdError> {
        let read = self.classification.candidates[0].process;
        let process = read.with_gain_scaled(1.0 / self.relay_amplitude)?;
        let mut residual = [0.0; BINS];
        let bins = residuals(window, self.period_s, &process, &mut residual).unwrap_or(0);
        let square = residual.iter().map(|value| value * value).sum::<f64>();
        let rms = (square / bins.max(1) as f64).sqrt();
        Ok(Refined {
            process,
            input_bias: -self.mean_input,
            covariance: Some(self.covariance()),
            response_error: 0.0,
            residual_sigma: rms * f64::from(window.per_bin()).sqrt(),
            noise_sigma: window.noise_sigma(),
            residual_rms: rms,
            walk: None,
            edge: None,
            steps: 0,
        })
    }

    /// Covariance over the coordinates of a fit (`onecycle_onboard::refine::coordinate`). The fourth value of the
    /// classification is minus the logarithm of the gain, hence the sign.
    fn covariance(&self) -> [[f64; 5]; 5] {
        let root = &self.classification.posterior.root;
        let mut rows = [[0.0; 4]; 5];
        rows[coordinate::LN_POLE_SUM] = root[0];
        rows[coordinate::POLE_RATIO] = root[1];
        rows[coordinate::TAU_S] = root[2].map(|value| value * self.period_s);
        rows[coordinate::LN_JERK_GAIN] = root[3].map(|value| -value);
        let mut covariance =
            rows.map(|a| rows.map(|b| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()));
        let bias = INPUT_BIAS_DEVIATION * self.relay_amplitude;
        covariance[coordinate::INPUT_BIAS][coordinate::INPUT_BIAS] = bias * bias;
        covariance
    }
}
