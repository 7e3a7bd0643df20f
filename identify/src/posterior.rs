//! Intervals of the physical parameters from the estimator's covariance.
//!
//! The estimator's coordinates are those in which its error is Gaussian; the parameters are not
//! linear in them, least of all near equal lags and near no damping. So the Gaussian is drawn
//! from, every draw mapped, and quantiles taken: nothing is linearised, and a time constant whose
//! inverse may be zero is unbounded above.

use onecycle_design::bands::quantiles;
use onecycle_onboard::refine::{Refined, coordinate};
use onecycle_onboard::{Pd, Soiptd};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::cholesky::cholesky;
use onecycle_design::soiptd_pd::margins::margins;

/// Draws: the 5 % quantile of so many is known to 0.35 of a per cent point.
const DRAWS: usize = 4000;
/// Any seed would do; a fixed one gives the same bits for the same recording.
const SEED: u64 = 0x1c7c_1e00;

/// Standard deviation of an instrument's scale and clock: better ones are rare, and a perfect fit
/// promises no more.
const INSTRUMENT: f64 = 1e-3;

/// An estimate and the interval that holds the truth with a probability of 90 %; `None` stands
/// for unbounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Best value; `None` where it is infinite.
    pub estimate: Option<f64>,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
}

impl Interval {
    fn new(estimate: f64, ends: Option<(f64, f64)>) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        let (low, high) = ends.map_or((None, None), |(low, high)| {
            (finite(low.min(estimate)), finite(high.max(estimate)))
        });
        Self {
            estimate: finite(estimate),
            low,
            high,
        }
    }

    /// Whether `value` lies inside; infinity does where the upper end is unbounded.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        self.low.is_none_or(|low| low <= value) && self.high.is_none_or(|high| value <= high)
    }

    /// Width over twice the estimate: the relative half width; `None` where unbounded.
    #[must_use]
    pub fn relative_half_width(&self) -> Option<f64> {
        Some((self.high? - self.low?) / (2.0 * self.estimate?.abs()))
    }
}

/// The process with its intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProcessEstimate {
    /// Velocity gain `K`: output unit / (input unit s).
    pub k: Interval,
    /// Acceleration gain `K/T_body`: output unit / (input unit s^2).
    pub k_over_t_body: Interval,
    /// Lag of the actuator, the shorter of the two (s).
    pub t_prop_s: Interval,
    /// Lag of the body, the longer of the two (s).
    pub t_body_s: Interval,
    /// Dead time (s).
    pub tau_s: Interval,
    /// Constant input that the recording does not show (input unit).
    pub input_bias: Interval,
}

/// What the process may be: one draw from the posterior, in physical parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Velocity gain `K`: output unit / (input unit s), infinite without damping.
    pub k: f64,
    /// Acceleration gain `K/T_body`: output unit / (input unit s^2).
    pub k_over_t_body: f64,
    /// Lag of the actuator (s).
    pub t_prop_s: f64,
    /// Lag of the body (s), infinite without damping.
    pub t_body_s: f64,
    /// Dead time (s).
    pub tau_s: f64,
    /// Constant input that the recording does not show (input unit).
    pub input_bias: f64,
    /// Whether the Gaussian's coordinates were those of a process, not brought to the nearest one.
    pub is_process: bool,
}

impl Draw {
    /// From the estimator's coordinates; `sign` is the gain's.
    fn of(at: &[f64; 5], sign: f64) -> Self {
        let sum_per_s = at[coordinate::LN_POLE_SUM].exp();
        let ratio = at[coordinate::POLE_RATIO];
        let fast_per_s = 0.5 * sum_per_s * (1.0 + (1.0 - 4.0 * ratio).max(0.0).sqrt());
        // No damping, or less than none: the body's lag is beyond all bounds.
        let slow_per_s = (ratio * sum_per_s * sum_per_s / fast_per_s).clamp(0.0, fast_per_s);
        let k_over_t_body = sign * at[coordinate::LN_JERK_GAIN].exp() / fast_per_s;
        Self {
            k: k_over_t_body / slow_per_s,
            k_over_t_body,
            t_prop_s: 1.0 / fast_per_s,
            t_body_s: 1.0 / slow_per_s,
            tau_s: at[coordinate::TAU_S].max(0.0),
            input_bias: at[coordinate::INPUT_BIAS],
            is_process: (0.0..=0.25).contains(&ratio) && at[coordinate::TAU_S] >= 0.0,
        }
    }

    fn phase_margin_rad(&self, pd: Pd) -> Option<f64> {
        margins(&self.process()?, pd).map(|margins| margins.phase_margin_rad)
    }

    /// The process; `None` where the parameters are those of none.
    #[must_use]
    pub fn process(&self) -> Option<Soiptd> {
        let damping_per_s = 1.0 / self.t_body_s;
        let Self {
            k_over_t_body,
            t_prop_s,
            tau_s,
            ..
        } = *self;
        Soiptd::from_acceleration_gain(k_over_t_body, t_prop_s, damping_per_s, tau_s).ok()
    }
}

/// The estimate and draws from its distribution.
#[derive(Clone, Debug)]
pub struct Posterior {
    best: Draw,
    /// Empty where the estimator gives no covariance.
    draws: Vec<Draw>,
}

impl Posterior {
    /// From the estimator's result on samples every `sample_s`.
    ///
    /// A recording does not say where within a sample its stamp stands: the delay is uncertain by
    /// a uniform error of one sample period on top of the estimator's. Gain and poles are uncertain by
    /// the scale and the clock of the instruments.
    #[must_use]
    pub fn new(refined: &Refined, sample_s: f64) -> Self {
        let process = &refined.process;
        let sign = process.k_over_t_body().signum();
        let (pole_sum, pole_ratio) = process.pole_sum();
        let mut centre = [0.0; 5];
        centre[coordinate::LN_POLE_SUM] = pole_sum.ln();
        centre[coordinate::POLE_RATIO] = pole_ratio;
        centre[coordinate::TAU_S] = process.tau_s();
        let jerk_gain = process.jerk_gain();
        centre[coordinate::LN_JERK_GAIN] = jerk_gain.abs().ln();
        centre[coordinate::INPUT_BIAS] = refined.input_bias;
        let root = refined.covariance.and_then(|mut covariance| {
            covariance[coordinate::TAU_S][coordinate::TAU_S] += sample_s * sample_s / 12.0;
            for index in [coordinate::LN_POLE_SUM, coordinate::LN_JERK_GAIN] {
                covariance[index][index] += INSTRUMENT * INSTRUMENT;
            }
            cholesky(&covariance)
        });
        let mut rng = Pcg64Mcg::seed_from_u64(SEED);
        // In pairs on either side of the centre: so few as a handful have their mean there.
        let mut pair = |root: &[[f64; 5]; 5]| {
            let normal: [f64; 5] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            [1.0, -1.0].map(|side| {
                let at = std::array::from_fn(|i| {
                    centre[i] + side * (0..=i).map(|j| root[i][j] * normal[j]).sum::<f64>()
                });
                Draw::of(&at, sign)
            })
        };
        let draws = root.map_or(vec![], |root| {
            (0..DRAWS / 2).flat_map(|_| pair(&root)).collect()
        });
        Self {
            best: Draw::of(&centre, sign),
            draws,
        }
    }

    /// The parameters with their 90 % intervals.
    #[must_use]
    pub fn process(&self) -> ProcessEstimate {
        let interval = |parameter: fn(&Draw) -> f64| {
            let values = self.draws.iter().map(parameter).collect();
            Interval::new(parameter(&self.best), quantiles(values))
        };
        ProcessEstimate {
            k: interval(|p| p.k),
            k_over_t_body: interval(|p| p.k_over_t_body),
            t_prop_s: interval(|p| p.t_prop_s),
            t_body_s: interval(|p| p.t_body_s),
            tau_s: interval(|p| p.tau_s),
            input_bias: interval(|p| p.input_bias),
        }
    }

    /// All draws, none where the estimator gives no covariance.
    #[must_use]
    pub fn draws(&self) -> &[Draw] {
        &self.draws
    }

    /// The first draws that are processes, at most so many. Those beyond what a process can be have no
    /// weight here, where the nearest one would have too much.
    #[must_use]
    pub fn processes(&self, most: usize) -> Vec<Soiptd> {
        self.draws
            .iter()
            .filter(|draw| draw.is_process)
            .filter_map(Draw::process)
            .take(most)
            .collect()
    }

    /// Probability that gain, lags and delay are all within their intervals at once; `None` where the
    /// estimator gives no covariance.
    #[must_use]
    pub fn joint_probability(&self, within: &ProcessEstimate) -> Option<f64> {
        let inside = |draw: &&Draw| {
            within.k.holds(draw.k)
                && within.k_over_t_body.holds(draw.k_over_t_body)
                && within.t_prop_s.holds(draw.t_prop_s)
                && within.t_body_s.holds(draw.t_body_s)
                && within.tau_s.holds(draw.tau_s)
        };
        let count = self.draws.iter().filter(inside).count();
        (!self.draws.is_empty()).then(|| count as f64 / self.draws.len() as f64)
    }

    /// Correlations of `K/T_body`, `T_prop`, `1/T_body`, `tau` and the input bias, in this order; `None` where the
    /// estimator gives no covariance.
    #[must_use]
    pub fn correlations(&self) -> Option<[[f64; 5]; 5]> {
        let of = |draw: &Draw| {
            let damping_per_s = 1.0 / draw.t_body_s;
            [
                draw.k_over_t_body,
                draw.t_prop_s,
                damping_per_s,
                draw.tau_s,
                draw.input_bias,
            ]
        };
        let count = self.draws.len() as f64;
        let mut mean = [0.0; 5];
        for draw in &self.draws {
            let values = of(draw);
            (0..5).for_each(|i| mean[i] += values[i] / count);
        }
        let mut covariance = [[0.0; 5]; 5];
        for draw in &self.draws {
            let values = of(draw);
            for i in 0..5 {
                for j in 0..5 {
                    covariance[i][j] += (values[i] - mean[i]) * (values[j] - mean[j]);
                }
            }
        }
        // What has no spread is correlated with itself alone.
        let entry = |i: usize, j: usize| {
            let size = (covariance[i][i] * covariance[j][j]).sqrt();
            if i == j {
                1.0
            } else if size > 0.0 {
                covariance[i][j] / size
            } else {
                0.0
            }
        };
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
        (!self.draws.is_empty()).then_some(rows)
    }

    /// Phase margin (rad) that a controller leaves on the process, with its 90 % interval.
    #[must_use]
    pub fn phase_margin_rad(&self, pd: Pd) -> Interval {
        Interval::new(
            self.best.phase_margin_rad(pd).unwrap_or(f64::NEG_INFINITY),
            quantiles(self.phase_margins_rad(pd)),
        )
    }

    /// The phase margins (rad) that a controller leaves on the draws.
    #[must_use]
    pub fn phase_margins_rad(&self, pd: Pd) -> Vec<f64> {
        let margin = |draw: &Draw| draw.phase_margin_rad(pd);
        self.draws.iter().filter_map(margin).collect()
    }
}
