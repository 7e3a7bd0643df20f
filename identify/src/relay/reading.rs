//! What a pack reads off the last cycle alone: where to start, what is likely, whether it is known.

use onecycle_onboard::SoiptdError;
use onecycle_onboard::classify::{Classification, Familiarity, classify_by};
use onecycle_onboard::cycle::Cycle;
use onecycle_onboard::pack::Pack;
use onecycle_onboard::refine::{Refined, coordinate, residuals};
use onecycle_onboard::signature::Signature;
use onecycle_onboard::window::Window;

use super::input::RelayInput;
use super::oscillation::{Beginning, FitWindow, Oscillation};
use crate::signals::Signals;

/// Bins of a cycle's window, five of which it keeps for itself: each at least twice as narrow as a part
/// of the signature.
const BINS: usize = 261;
/// Edges of a cycle, and as many again that were taken back.
const EDGES: usize = 16;

/// One cycle as a pack reads it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Posterior, candidates and score; gains are for a relay of amplitude one.
    pub classification: Classification,
    /// Period of the cycle (s).
    pub period_s: f64,
    /// Half the distance of the relay's levels (input unit).
    relay_amplitude: f64,
    /// Mean of the input over the cycle (input unit).
    mean_input: f64,
}

impl Reading {
    /// Of the last cycle of an oscillation; `None` where it has no signature or the pack no answer.
    pub(super) fn of(
        signals: &Signals<'_>,
        relay: &RelayInput,
        oscillation: &Oscillation,
        window: &FitWindow,
        pack: &Pack<'_>,
    ) -> Option<Self> {
        let last = oscillation.last();
        let cycle = last.cycles[0];
        let points = last.points(signals);
        let sample_s = window.sample_s();
        let start_s = *signals.time_s.get(points.start)?;
        // A signature begins with a rise. A process answers the mirrored input with the mirrored output.
        let (sign, duty) = match oscillation.beginning {
            Beginning::Rise => (1.0, cycle.duty),
            Beginning::Fall => (-1.0, 1.0 - cycle.duty),
        };
        let mut of_cycle =
            Window::<BINS, EDGES>::of_groups(start_s, sample_s, signals.samples_per_point);
        for index in points.clone() {
            of_cycle.push_output(signals.time_s[index], sign * signals.output[index]);
        }
        let signature = Signature::new(&of_cycle, &Cycle { duty, ..cycle }).ok()?;
        let period_s = cycle.period_s;
        let noise_sigma = window.noise_sigma();
        let classification = classify_by(pack, &signature, period_s, noise_sigma).ok()?;
        let (low, high) = relay.means(&signals.input[points]);
        let relay_amplitude = 0.5 * (high - low);
        Some(Self {
            classification,
            period_s,
            relay_amplitude,
            mean_input: 0.5 * (high + low) + relay_amplitude * (2.0 * cycle.duty - 1.0),
        })
    }

    /// Whether the cycle is of the pack's family.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.classification.familiarity == Familiarity::Known
    }

    /// The posterior's mean as a fit of the window would be.
    ///
    /// # Errors
    /// Where the relay's amplitude leaves no finite gain.
    pub(super) fn as_fit(&self, window: &FitWindow) -> Result<Refined, SoiptdError> {
        let read = self.classification.candidates[0].process;
        let process = read.with_gain_scaled(1.0 / self.relay_amplitude)?;
        let mut residual = [0.0; super::oscillation::BINS];
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
            edge: None,
            steps: 0,
        })
    }

    /// Over the coordinates of a fit. The fourth value falls with the logarithm of the gain.
    fn covariance(&self) -> [[f64; 5]; 5] {
        let root = &self.classification.posterior.root;
        let mut rows = [[0.0; 4]; 5];
        rows[coordinate::LN_POLE_SUM] = root[0];
        rows[coordinate::POLE_RATIO] = root[1];
        rows[coordinate::TAU_S] = root[2].map(|value| value * self.period_s);
        rows[coordinate::LN_JERK_GAIN] = root[3].map(|value| -value);
        let mut covariance =
            rows.map(|a| rows.map(|b| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()));
        let bias = BIAS * self.relay_amplitude;
        covariance[coordinate::INPUT_BIAS][coordinate::INPUT_BIAS] = bias * bias;
        covariance
    }
}

/// Standard deviation of a cycle's mean input about minus the bias, over the relay's amplitude: of the
/// paper's multirotors with 2 to 3 % noise at 250 to 700 samples a period.
const BIAS: f64 = 0.004;
