//! What a recording says about the loop that a controller will close: noise, amplitude of the input, sample period.

use onecycle_design::{LowPass, MeasurementNoise, Model, Specification};

use crate::innovations::Hold;

/// Noise below this share of the output's deviation is rounding, not noise.
const LEAST_NOISE: f64 = 1e-6;

/// Highest crossover of a proposed controller over the highest excited frequency. Beyond it a resonance that the recording
/// does not show can make the loop unstable: of 426 loops on processes with a flexible mode, all 42 that were unstable had
/// a crossover at least twice as high as the frequency of the relay's oscillation.
pub(crate) const MOST_EXTRAPOLATION: f64 = 2.0;

/// Properties of a recording that a specification may leave open.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordedLoop {
    /// Standard deviation of the white noise of one sample (output unit).
    pub(crate) sigma: f64,
    /// Amplitude or standard deviation of the output (output unit).
    pub(crate) output_size: f64,
    /// Amplitude of a relay, or half of the range of the input (input unit).
    pub(crate) input_amplitude: f64,
    /// Sample period (s).
    pub(crate) sample_s: f64,
    pub(crate) hold: Hold,
    /// Highest frequency that the recording excites (rad/s).
    pub(crate) excited_rad_per_s: Option<f64>,
    /// Known filter of the output whose delay is part of the dead time.
    pub(crate) filter: Option<LowPass>,
}

/// The known filter of the output that the loop of a controller contains instead of its delay. A fit that has less dead time
/// than the filter has delay explains the rest by a lag: then a faster filter, so that the delay of the loop stays.
pub(crate) fn recorded_filter(filter: Option<LowPass>, model: &Model) -> Option<LowPass> {
    let time_s = filter?.time_s().min(model.linear().tau_s());
    (time_s > 0.0).then_some(LowPass::SecondOrder(time_s))
}

impl RecordedLoop {
    /// `specification` with the known filter of the output and the values that it leaves open: the noise, the highest
    /// crossover, and the sample period of a controller whose output leaves in the tick of its sample. Input that is not held says nothing about the sample period.
    pub(crate) fn complete(&self, specification: &Specification) -> Specification {
        let mut complete = *specification;
        let is_noisy = self.sigma > LEAST_NOISE * self.output_size && self.input_amplitude > 0.0;
        if complete.noise.is_none() && is_noisy {
            complete.noise = Some(MeasurementNoise::new(
                self.sigma,
                self.sample_s,
                self.input_amplitude,
            ));
        }
        if complete.crossover_rad_per_s.is_none() {
            complete.crossover_rad_per_s =
                (self.excited_rad_per_s).map(|omega| MOST_EXTRAPOLATION * omega);
        }
        complete.execution.recorded_filter = self.filter;
        let is_open = complete.execution.sample_period_s == 0.0;
        if is_open && self.hold == Hold::Held {
            complete.execution.sample_period_s = self.sample_s;
        }
        complete
    }
}
