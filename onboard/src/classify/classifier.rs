//! Classification in slices: see the table in [`classify`](super).

use libm::{exp, hypot, sqrt};

use super::{
    CANDIDATES, Calibration, CandidateProcess, Classification, ClassifyError, CyclePosterior,
    Familiarity, OUTPUTS, process_of,
};
use crate::cycle::Cycle;
use crate::fit_score::{Doubt, ScoredCycle, Statistic};
use crate::pack::{Forward, Pack, VALUES};
use crate::process::SoiptdError;
use crate::signature::{PARTS, Signature, SignatureError, Signing};
use crate::window::Window;

/// Nodes, in standard deviations, and weights of the Gauss-Hermite rule of five points (Abramowitz and Stegun,
/// table 25.10, nodes times the square root of two, weights over that of pi).
pub(super) const NODES: [(f64, f64); CANDIDATES] = [
    (0.0, 8.0 / 15.0),
    (1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
];

/// Weight of an excess width. With weights of 0, 1, 2 and 4 the score calls 94, 96, 96 and 97 % of the harmful
/// out-of-family cycles unknown, and 0.8, 1.1, 1.3 and 2.1 % of the paper's multirotors.
const DOUBT: f64 = 2.0;

/// State of a classification. It takes 5.4 kB, so make it where it stays.
#[derive(Clone, Debug)]
pub struct Classifier {
    signature: Signature,
    period_s: f64,
    noise_sigma: f64,
    calibration: Calibration,
    network: Forward,
    outputs: [f32; OUTPUTS],
    statistic: Statistic,
    stage: Stage,
}

/// Next step.
#[derive(Clone, Debug)]
enum Stage {
    /// Not begun, or finished.
    Idle,
    /// Signature of the cycle, before the classification begins.
    Sign(Signing),
    /// A layer of the network.
    Network,
    /// Posterior from the outputs of the network.
    Posterior,
    /// Longest axis of the posterior.
    Axis(CyclePosterior),
    /// Processes along it.
    Candidates(CyclePosterior, [f64; VALUES]),
    /// Misfit score of its mean.
    Score(CyclePosterior, [CandidateProcess; CANDIDATES]),
    /// The result is there; what follows it gets a slice of its own.
    Done(Classification),
}

impl Default for Classifier {
    fn default() -> Self {
        Self::new()
    }
}

impl Classifier {
    /// A classification that has not begun, all zeros.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            signature: Signature::NONE,
            period_s: 0.0,
            noise_sigma: 0.0,
            calibration: Calibration::ROOM,
            network: Forward::NONE,
            outputs: [0.0; OUTPUTS],
            statistic: Statistic::NONE,
            stage: Stage::Idle,
        }
    }

    /// Lends its memory to the signature of the cycle that it is going to classify.
    pub(crate) fn begin_signing(&mut self) {
        self.stage = Stage::Sign(Signing::NONE);
    }

    /// One slice of that signature: see [`Signing::advance`].
    pub(crate) fn sign<const BINS: usize, const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        cycle: &Cycle,
    ) -> Option<Result<Signature, SignatureError>> {
        match &mut self.stage {
            Stage::Sign(signing) => signing.advance(window, cycle),
            _ => Some(Err(SignatureError::Period(f64::NAN))),
        }
    }

    /// Begins the classification of a cycle of `period_s` (s) with a pack. A classification in progress is
    /// dropped. The arguments are those of [`classify_by`](super::classify_by).
    ///
    /// # Errors
    /// [`ClassifyError::Pack`] if the pack has no calibration.
    pub fn begin(
        &mut self,
        pack: &Pack<'_>,
        signature: &Signature,
        period_s: f64,
        noise_sigma: f64,
    ) -> Result<(), ClassifyError> {
        self.stage = Stage::Idle;
        self.calibration = Calibration::of_pack(pack).ok_or(ClassifyError::Pack)?;
        self.network.begin(pack, &signature.values);
        self.set(signature, period_s, noise_sigma);
        self.stage = Stage::Network;
        Ok(())
    }

    fn set(&mut self, signature: &Signature, period_s: f64, noise_sigma: f64) {
        self.signature = *signature;
        self.period_s = period_s;
        self.noise_sigma = noise_sigma;
    }

    /// Begins after the network, with its outputs.
    pub(super) fn begin_at(
        &mut self,
        outputs: &[f32; OUTPUTS],
        signature: &Signature,
        period_s: f64,
        noise_sigma: f64,
        calibration: &Calibration,
    ) -> Result<(), ClassifyError> {
        self.calibration = *calibration;
        self.set(signature, period_s, noise_sigma);
        self.take(outputs)
    }

    /// Does one slice; give it the same pack each time. Returns the result after the last slice, `None` before.
    ///
    /// # Errors
    /// In the result: the output, the noise or the parameter that is out of range. If nothing was begun, output
    /// 0 is NaN.
    pub fn advance(&mut self, pack: &Pack<'_>) -> Option<Result<Classification, ClassifyError>> {
        let outcome = if let Stage::Network = self.stage {
            let outputs = self.network.advance(pack)?;
            self.take(&outputs).err().map(Err)
        } else {
            self.read()
        };
        if outcome.is_some() {
            self.stage = Stage::Idle;
        }
        outcome
    }

    /// Takes the outputs of the network if they are finite.
    fn take(&mut self, outputs: &[f32; OUTPUTS]) -> Result<(), ClassifyError> {
        if let Some(index) = outputs.iter().position(|output| !output.is_finite()) {
            return Err(ClassifyError::Output(index, outputs[index]));
        }
        if !(self.noise_sigma.is_finite() && self.noise_sigma >= 0.0) {
            return Err(ClassifyError::Noise(self.noise_sigma));
        }
        self.outputs = *outputs;
        self.stage = Stage::Posterior;
        Ok(())
    }

    /// A slice after the network.
    pub(super) fn read(&mut self) -> Option<Result<Classification, ClassifyError>> {
        match &mut self.stage {
            Stage::Idle | Stage::Sign(_) | Stage::Network => {
                Some(Err(ClassifyError::Output(0, f32::NAN)))
            }
            Stage::Posterior => {
                self.stage = Stage::Axis(self.posterior());
                None
            }
            Stage::Axis(posterior) => {
                let axis = posterior.longest_axis(&self.calibration.scale);
                self.stage = Stage::Candidates(*posterior, axis);
                None
            }
            Stage::Candidates(posterior, axis) => {
                let (posterior, axis) = (*posterior, *axis);
                match self.candidates(&posterior, &axis) {
                    Ok(candidates) => {
                        self.statistic.begin(self.cycle(&posterior));
                        self.stage = Stage::Score(posterior, candidates);
                        None
                    }
                    Err(error) => Some(Err(error.into())),
                }
            }
            Stage::Score(posterior, candidates) => {
                let statistic = self.statistic.advance()?;
                let (posterior, candidates) = (*posterior, *candidates);
                let score = self.score(statistic);
                self.stage = Stage::Done(Classification {
                    posterior,
                    candidates,
                    score,
                    familiarity: if score <= 1.0 {
                        Familiarity::Known
                    } else {
                        Familiarity::Unknown
                    },
                });
                None
            }
            Stage::Done(classification) => Some(Ok(*classification)),
        }
    }

    fn posterior(&self) -> CyclePosterior {
        let calibration = &self.calibration;
        let mut posterior = CyclePosterior::from_outputs(&self.outputs, &calibration.scale);
        for (row, temperature) in posterior.root.iter_mut().zip(calibration.temperature) {
            row.iter_mut().for_each(|value| *value *= temperature);
        }
        let [lowest, highest] = &calibration.range;
        for (k, mean) in posterior.mean.iter_mut().enumerate() {
            *mean = mean.max(lowest[k]).min(highest[k]);
        }
        posterior
    }

    fn candidates(
        &self,
        posterior: &CyclePosterior,
        axis: &[f64; VALUES],
    ) -> Result<[CandidateProcess; CANDIDATES], SoiptdError> {
        let at = |deviations: f64| -> [f64; VALUES] {
            core::array::from_fn(|k| posterior.mean[k] + deviations * axis[k])
        };
        let mut candidates = [CandidateProcess {
            process: process_of(&posterior.mean, &self.signature, self.period_s)?,
            probability: NODES[0].1,
        }; CANDIDATES];
        for (candidate, (deviations, probability)) in candidates.iter_mut().zip(NODES).skip(1) {
            *candidate = CandidateProcess {
                process: process_of(&at(deviations), &self.signature, self.period_s)?,
                probability,
            };
        }
        Ok(candidates)
    }

    /// Noise of a sample over the amplitude.
    fn noise(&self) -> f64 {
        self.noise_sigma / self.signature.amplitude
    }

    fn samples(&self) -> f64 {
        exp(f64::from(self.signature.values[PARTS + 1]))
    }

    /// Input of the score.
    fn cycle(&self, posterior: &CyclePosterior) -> ScoredCycle {
        let (calibration, noise, samples) = (&self.calibration, self.noise(), self.samples());
        ScoredCycle {
            parts: core::array::from_fn(|part| f64::from(self.signature.values[part])),
            mean: posterior.mean,
            doubt: Doubt {
                root: posterior.root,
                jump: calibration.jump + calibration.jump_of_noise * noise,
                // A harmonic has 1/32 of the variance of a part, half of it in the real part, and a part is the
                // mean of N/32 samples.
                sigma: hypot(calibration.floor, noise * sqrt(0.5 / samples)),
            },
            duty: f64::from(self.signature.values[PARTS]),
            samples,
        }
    }

    fn score(&self, statistic: f64) -> f64 {
        let (calibration, noise) = (&self.calibration, self.noise());
        let excess = calibration.excess(&self.outputs, noise, self.samples());
        let misfit = (statistic + DOUBT * excess * excess) / calibration.limit;
        misfit.max(noise / calibration.most_noise)
    }
}
