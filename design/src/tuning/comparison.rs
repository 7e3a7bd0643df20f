//! Whether a proposal is worth a change of the gains in force: what its user would feel, over what is known of the process.
//!
//! ```text
//! r_f = ln(max(f(now), limit) / max(f(proposed), limit))          f a figure of the loop, r_f > 0: the proposal is better
//! ```
//!
//! The errors after a step of the load and of the set-point (IAE) have no limit. Overshoot (the peak of the response), noise at
//! the actuator and `Ms` are as good as any within the limits that were asked for. The settling time is no such figure: it
//! jumps where a swing enters its band. `r_f` is felt if it is [`FELT`] or more on the most probable process and
//! has the same sign on 90 % of the draws, which both controllers share. A change pays if its greatest felt gain is more than
//! its greatest felt loss.

use crate::bands::quantiles;
use crate::closed_loop::{load_iae, noise_amplification, reference_iae, sensitivity, step_metrics};
use crate::controller::Controller;
use crate::model::Model;

use super::specification::{Specification, Style};

/// Least ratio of a figure before and after that is felt: a fifth. Two flights or two batches under the same gains differ by as
/// much. A convention, set by no campaign.
pub const FELT: f64 = 1.2;
/// Ratio that stands for an infinite one: of a steady error that goes, or of a loop that becomes stable.
const ALL: f64 = 1e3;
/// Share of the draws on which gains in force have to be stable to be kept.
const LEAST_STABLE: f64 = 0.95;

/// A figure that the user of a loop feels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Felt {
    /// Integrated absolute error after a step of the load (output unit s).
    LoadError,
    /// Integrated absolute error after a step of the set-point (output unit s).
    SetPointError,
    /// Overshoot after a step of the reference, a share of the step.
    Overshoot,
    /// Standard deviation of the noise at the actuator, a share of the input amplitude.
    Noise,
    /// Maximum sensitivity (1).
    Ms,
}

/// How a figure changes from the gains in force to the proposed ones.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Effect {
    /// Which figure.
    pub figure: Felt,
    /// Factor by which the proposal is better, beyond the limit that was asked for: low end, most probable process, high end
    /// of 90 %. Below 1 it is worse.
    pub better: [f64; 3],
}

impl Effect {
    fn is_felt(&self) -> bool {
        let [low, middle, high] = self.better;
        low > 1.0 && middle >= FELT || high < 1.0 && middle <= 1.0 / FELT
    }
}

/// The gains in force beside the proposed ones.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Comparison {
    /// Every figure that both have.
    pub effects: Vec<Effect>,
    /// Whether the gains in force are too risky to keep: the loop is unstable on 5 % of the draws, or its `Ms` is a fifth
    /// above that of the style sharp.
    pub is_now_fragile: bool,
}

impl Comparison {
    /// Compares on `model`, the most probable process, and on `draws`. `None` if the proposal is unstable on `model`.
    #[must_use]
    pub fn new(
        model: &Model,
        draws: &[Model],
        [now, proposed]: [&Controller; 2],
        asked: &Specification,
    ) -> Option<Self> {
        let both = |model: &Model| [now, proposed].map(|of| Figures::of(model, of, asked));
        let [old, new] = both(model);
        let new = new?;
        let over: Vec<[Option<Figures>; 2]> = draws.iter().map(both).collect();
        let stable = over.iter().filter(|[old, _]| old.is_some()).count();
        let most = FELT * Style::Sharp.peak();
        let is_now_fragile = old.is_none_or(|old| old.ms > most && old.ms > new.ms)
            || (stable as f64) < LEAST_STABLE * over.len() as f64;
        let effect = |figure| {
            let middle = better(figure, [old, Some(new)], asked)?;
            let ratios = over.iter().filter_map(|pair| better(figure, *pair, asked));
            let (low, high) = quantiles(ratios.collect()).unwrap_or((middle, middle));
            let better = [low.min(middle), middle, high.max(middle)];
            Some(Effect { figure, better })
        };
        let all = [
            Felt::LoadError,
            Felt::SetPointError,
            Felt::Overshoot,
            Felt::Noise,
            Felt::Ms,
        ];
        Some(Self {
            effects: all.into_iter().filter_map(effect).collect(),
            is_now_fragile,
        })
    }

    /// The felt effect that is the greatest gain.
    #[must_use]
    pub fn gain(&self) -> Option<&Effect> {
        let felt = self.effects.iter().filter(|effect| effect.is_felt());
        let gains = felt.filter(|effect| effect.better[1] > 1.0);
        gains.max_by(|a, b| a.better[1].total_cmp(&b.better[1]))
    }

    /// The felt effect that is the greatest loss.
    #[must_use]
    pub fn loss(&self) -> Option<&Effect> {
        let felt = self.effects.iter().filter(|effect| effect.is_felt());
        let losses = felt.filter(|effect| effect.better[1] < 1.0);
        losses.min_by(|a, b| a.better[1].total_cmp(&b.better[1]))
    }

    /// Whether the proposal is worth a change.
    #[must_use]
    pub fn pays(&self) -> bool {
        let gain = self.gain().map_or(1.0, |effect| effect.better[1]);
        let loss = self.loss().map_or(1.0, |effect| effect.better[1]);
        self.is_now_fragile || gain * loss > 1.0
    }
}

/// Figures of a controller on a process.
#[derive(Clone, Copy)]
struct Figures {
    load_iae: f64,
    reference_iae: f64,
    overshoot: Option<f64>,
    noise_share: Option<f64>,
    ms: f64,
}

impl Figures {
    /// `None` if the loop is unstable.
    fn of(model: &Model, controller: &Controller, asked: &Specification) -> Option<Self> {
        let ms = sensitivity(model, controller)?.ms;
        let step = step_metrics(model, controller).ok();
        let share = asked.noise.and_then(|noise| {
            let amplification = noise_amplification(model, controller, noise.sample_period_s)?;
            Some(amplification * noise.std / noise.input_amplitude)
        });
        Some(Self {
            load_iae: load_iae(model, controller).unwrap_or(f64::INFINITY),
            reference_iae: reference_iae(model, controller).unwrap_or(f64::INFINITY),
            overshoot: step.map(|step| step.overshoot),
            noise_share: share,
            ms,
        })
    }

    /// What is compared: within the limits that were asked for all values are alike.
    fn value(&self, figure: Felt, asked: &Specification) -> Option<f64> {
        Some(match figure {
            Felt::LoadError => self.load_iae,
            Felt::SetPointError => self.reference_iae,
            Felt::Overshoot => 1.0 + self.overshoot?.max(asked.overshoot.min(1.0)),
            Felt::Noise => self.noise_share?.max(asked.noise_share),
            Felt::Ms => self.ms.max(asked.ms),
        })
    }
}

/// Factor by which the second of two loops is better in `figure`. `None` if one of them has no such figure.
fn better(figure: Felt, [old, new]: [Option<Figures>; 2], asked: &Specification) -> Option<f64> {
    let (old, new) = match (old, new) {
        (Some(old), Some(new)) => (old.value(figure, asked)?, new.value(figure, asked)?),
        (None, Some(_)) => return Some(ALL),
        (Some(_), None) => return Some(1.0 / ALL),
        (None, None) => return None,
    };
    // Without an integral term both leave a steady error.
    let is_alike = old == new || old.is_infinite() && new.is_infinite();
    let ratio = if is_alike { 1.0 } else { old / new };
    (!ratio.is_nan()).then(|| ratio.clamp(1.0 / ALL, ALL))
}

#[cfg(test)]
mod tests {
    use onecycle_onboard::Soiptd;

    use crate::controller::{Form, Pid};
    use crate::tuning::design;

    use super::*;

    fn process() -> Model {
        Soiptd::new(1.0, 0.05, 1.0, 0.02).unwrap().into()
    }

    fn proposed() -> (Controller, Specification) {
        let asked = Specification::new(Form::Pid, Style::Balanced);
        (design(&process(), &asked).unwrap().controller, asked)
    }

    fn compared(scale: [f64; 3]) -> Comparison {
        let (new, asked) = proposed();
        let of = new.pid();
        let old = Pid::new(scale[0] * of.kp, scale[1] * of.ki, scale[2] * of.kd)
            .with_filter_s(of.filter_s)
            .with_setpoint_weight(of.setpoint_weight);
        let draws: Vec<Model> = [0.97, 0.99, 1.0, 1.01, 1.03]
            .map(|gain| Soiptd::new(gain, 0.05, 1.0, 0.02).unwrap().into())
            .to_vec();
        let both = [&Controller::from(old), &new];
        Comparison::new(&process(), &draws, both, &asked).unwrap()
    }

    // The same gains, and gains that differ by a twentieth, are kept: nobody feels the difference.
    #[test]
    fn gains_near_the_optimum_are_kept() {
        for scale in [[1.0; 3], [0.95; 3], [1.05, 1.0, 0.95]] {
            let found = compared(scale);
            assert!(!found.pays(), "{found:?}");
            assert!(found.gain().is_none() && found.loss().is_none());
        }
    }

    // A third of all gains: three times the load error at least.
    #[test]
    fn much_too_low_gains_are_changed() {
        let found = compared([1.0 / 3.0; 3]);
        let gain = found.gain().unwrap();
        assert!(found.pays() && gain.figure == Felt::LoadError && gain.better[1] > 3.0);
    }

    // A third more of all gains: the proposal takes some of the peak of the response away and adds a third to the load error.
    #[test]
    fn what_is_better_in_one_and_much_worse_in_another_is_kept() {
        let found = compared([1.35; 3]);
        let loss = found.loss().unwrap_or_else(|| panic!("{found:?}"));
        assert!(
            loss.figure == Felt::LoadError && loss.better[1] < 0.7,
            "{found:?}"
        );
        assert!(!found.is_now_fragile && !found.pays(), "{found:?}");
    }

    // A third of the load error is no reason to stay with Ms of more than 3, or with an unstable loop.
    #[test]
    fn fragile_gains_are_changed() {
        for scale in [3.0, 5.0] {
            let found = compared([scale; 3]);
            assert!(found.is_now_fragile && found.pays(), "{found:?}");
        }
    }
}
