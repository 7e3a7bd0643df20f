//! Limits of a specification that a controller does not keep.

use crate::closed_loop::step_response;
use crate::controller::Controller;
use crate::model::Model;
use crate::roots::edge;
use crate::soiptd_pd::step_response::Sample;

use super::proposal::Assessment;
use super::specification::{Specification, Style};

/// A figure beyond its limit by less than this share of the limit counts as kept: searches end there.
const SHARE: f64 = 0.02;
/// The same for an overshoot, as a share of the step.
const OVERSHOOT: f64 = 0.002;
/// Bisections of the time constant of a filter: exact to 1e-4 of the length of the response.
const BISECTIONS: usize = 24;

/// A limit of a [`Specification`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limit {
    /// Overshoot after a step of the reference, a share of the step.
    Overshoot,
    /// Phase margin (rad).
    PhaseMargin,
    /// Gain margin, a factor.
    GainMargin,
    /// Delay margin (s).
    DelayMargin,
    /// Maximum sensitivity.
    Ms,
    /// Maximum complementary sensitivity.
    Mt,
    /// Standard deviation of the noise at the actuator, a share of the input amplitude.
    Noise,
    /// Largest output of the controller after a unit step of the reference (input unit).
    InputPeak,
    /// Gain crossover (rad/s).
    Crossover,
}

/// A limit that is not kept.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Missed {
    /// Which limit.
    pub limit: Limit,
    /// Its value in the specification.
    pub asked: f64,
    /// The value that the controller reaches.
    pub reached: f64,
}

impl Specification {
    /// The limits that a controller with these figures does not keep. The paper's style limits the phase margin only.
    #[must_use]
    pub fn missed(&self, found: &Assessment) -> Vec<Missed> {
        let margins = &found.margins;
        let least = [
            (
                Limit::PhaseMargin,
                self.phase_margin_rad,
                Some(margins.phase_margin_rad),
            ),
            (Limit::GainMargin, self.gain_margin, margins.gain_margin),
            (
                Limit::DelayMargin,
                self.delay_margin_s,
                Some(margins.delay_margin_s),
            ),
        ];
        let step = found.step.as_ref();
        let most = [
            (Limit::Ms, Some(self.ms), Some(found.ms)),
            (Limit::Mt, Some(self.mt), Some(found.mt)),
            (Limit::Noise, Some(self.noise_share), found.noise_share),
            (
                Limit::InputPeak,
                self.input_peak,
                step.map(|step| step.peak_input),
            ),
            (
                Limit::Crossover,
                self.crossover_rad_per_s,
                Some(margins.gain_crossover_rad_per_s),
            ),
        ];
        let below = least.into_iter().filter_map(|(limit, asked, reached)| {
            let missed = Missed {
                limit,
                asked,
                reached: reached?,
            };
            (missed.reached < asked * (1.0 - SHARE)).then_some(missed)
        });
        let above = most.into_iter().filter_map(|(limit, asked, reached)| {
            let missed = Missed {
                limit,
                asked: asked?,
                reached: reached?,
            };
            (missed.reached > missed.asked * (1.0 + SHARE)).then_some(missed)
        });
        let overshoot = step.map(|step| step.overshoot);
        let overshoot = overshoot.filter(|reached| *reached > self.overshoot + OVERSHOOT);
        let overshoot = overshoot.map(|reached| Missed {
            limit: Limit::Overshoot,
            asked: self.overshoot,
            reached,
        });
        let is_limited =
            |missed: &Missed| self.style != Style::Paper || missed.limit == Limit::PhaseMargin;
        (overshoot.into_iter().chain(below).chain(above))
            .filter(is_limited)
            .collect()
    }
}

/// Least time constant (s) of a first-order filter of the reference, `1/(T s + 1)`, with which a step overshoots by at most
/// this share. Zero if it does so without a filter; `None` if the response cannot be simulated, or no time constant up to its
/// length is enough.
#[must_use]
pub fn reference_filter_s(model: &Model, controller: &Controller, overshoot: f64) -> Option<f64> {
    let samples = step_response(model, controller).ok()?.samples;
    let is_kept = |time_s: f64| filtered_peak(&samples, time_s) <= 1.0 + overshoot;
    edge(samples.last()?.t_s, 0.0, BISECTIONS, is_kept)
}

/// Largest output where the reference passes a first-order filter first: filter and loop are linear, so the response itself is
/// filtered. Exact for straight lines between the samples.
fn filtered_peak(samples: &[Sample], time_s: f64) -> f64 {
    let (mut filtered, mut peak) = (0.0, 0.0_f64);
    for pair in samples.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let length_s = to.t_s - from.t_s;
        if time_s == 0.0 || length_s <= 0.0 {
            filtered = to.y;
        } else {
            let lag = (to.y - from.y) / length_s * time_s;
            let kept = (-length_s / time_s).exp();
            filtered = to.y - lag + (filtered - from.y + lag) * kept;
        }
        peak = peak.max(filtered);
    }
    peak
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::Pid;
    use crate::model::{Linear, Structure};
    use crate::tuning::{assess, design};

    fn model() -> Model {
        let process = Linear::new(Structure::Foptd).with_gain(0.2).with_tau_s(1.0);
        process.with_pole_per_s(0.1).into()
    }

    // The PID in the default style overshoots by 17 % with the least set-point weight, where 5 % is the default limit. All other
    // limits are kept.
    #[test]
    fn a_default_limit_that_is_not_kept_is_named() {
        let asked = Specification::default();
        let found = design(&model(), &asked).unwrap();
        let figures = assess(&model(), &found.controller, None).unwrap();
        let missed = asked.missed(&figures);
        assert_eq!(missed.len(), 1, "{missed:?}");
        assert_eq!((missed[0].limit, missed[0].asked), (Limit::Overshoot, 0.05));
        assert!((missed[0].reached - 0.17).abs() < 0.005, "{missed:?}");
        // The same controller against other limits.
        let strict = Specification {
            gain_margin: 4.0,
            input_peak: Some(1.0),
            overshoot: 0.2,
            ..asked.with_peak(1.4).with_phase_margin_rad(0.8)
        };
        let limits: Vec<Limit> = (strict.missed(&figures).iter()).map(|m| m.limit).collect();
        let wanted = [
            Limit::PhaseMargin,
            Limit::GainMargin,
            Limit::Ms,
            Limit::Mt,
            Limit::InputPeak,
        ];
        assert_eq!(limits, wanted);
        assert_eq!(Specification::paper().missed(&figures), []);
    }

    // Second order without delay: the loop of an integrator with the lag 1 s under P = 1 is 1/(s^2 + s + 1), which overshoots by
    // exp(-pi / sqrt(3)) = 16.3 %. The filter of the test is applied to a reference in closed form: its response at the peak
    // found is 1.05.
    #[test]
    fn a_filter_of_the_reference_keeps_the_overshoot() {
        let process = Linear::new(Structure::IntegratorLag).with_lags_s([1.0, 0.0]);
        let model: Model = process.with_tau_s(1e-6).into();
        let controller = Controller::from(Pid::new(1.0, 0.0, 0.0));
        let time_s = reference_filter_s(&model, &controller, 0.05).unwrap();
        // Real pole at -a, complex poles -1/2 +- i w: coefficients of the partial fractions of a / (s (s + a)(s^2 + s + 1)).
        let a = 1.0 / time_s;
        let p = num_complex::Complex64::new(-0.5, 0.75_f64.sqrt());
        let own = a / (-a * (a * a - a + 1.0));
        let pair = a / (p * (p + a) * (p - p.conj()));
        let y = |t: f64| 1.0 + own * (-a * t).exp() + 2.0 * (pair * (p * t).exp()).re;
        let peak = (0..20_000)
            .map(|k| y(1e-3 * f64::from(k)))
            .fold(0.0, f64::max);
        assert!((peak - 1.05).abs() < 2e-4, "{time_s} {peak}");
        assert_eq!(reference_filter_s(&model, &controller, 0.17), Some(0.0));
    }
}
