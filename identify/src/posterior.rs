//! Posterior distribution of the physical parameters, and 90 % intervals, from the covariance of the estimator.
//!
//! The error of the estimator is Gaussian in its own coordinates (`onecycle_onboard::refine::coordinate`). The physical
//! parameters are nonlinear in these, most of all near equal lags and near zero damping. So draws from the Gaussian are
//! mapped to parameters, and the intervals are quantiles of the draws. Nothing is linearised. A time constant whose
//! inverse may be zero is unbounded above.

use onecycle_design::bands::quantiles;
use onecycle_design::{Controller, Model, Parameter, Structure, margins};
use onecycle_onboard::Soiptd;
use onecycle_onboard::refine::{Refined, coordinate};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::cholesky::cholesky;

/// Number of draws. The standard error of the probability below the 5 % quantile is `sqrt(0.05 * 0.95 / 4000)`, 0.35 of
/// a percentage point.
const DRAWS: usize = 4000;
/// Seed of the draws: arbitrary, fixed so that the same recording gives the same bits.
const SEED: u64 = 0x1c7c_1e00;

/// Relative standard deviation of the scale and of the clock of the instruments. Better ones are rare, so no fit makes
/// the intervals narrower than this.
const INSTRUMENT: f64 = 1e-3;

/// Estimate with its 90 % interval. `None` stands for infinite or unbounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Most probable value. `None` if it is infinite.
    pub estimate: Option<f64>,
    /// Lower end. `None` if the interval is unbounded below.
    pub low: Option<f64>,
    /// Upper end. `None` if the interval is unbounded above.
    pub high: Option<f64>,
}

impl Interval {
    /// Interval with these ends, widened to hold the estimate.
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

    /// Whether `value` lies within the interval. Infinity does if the interval is unbounded above.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        self.low.is_none_or(|low| low <= value) && self.high.is_none_or(|high| value <= high)
    }

    /// Half width of the interval as a fraction of the magnitude of the estimate. `None` if the interval is unbounded
    /// or the estimate infinite.
    #[must_use]
    pub fn relative_half_width(&self) -> Option<f64> {
        Some((self.high? - self.low?) / (2.0 * self.estimate?.abs()))
    }
}

/// Parameters of a model and the input bias, each with its 90 % interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    structure: Structure,
    intervals: Vec<(Parameter, Interval)>,
}

impl Estimate {
    /// Structure of the model.
    #[must_use]
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// Interval of a parameter. `None` if the structure does not report the parameter.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> Option<Interval> {
        (self.intervals.iter())
            .find(|(of, _)| *of == parameter)
            .map(|(_, interval)| *interval)
    }

    /// All parameters with their intervals: first those of the structure in the order of [`Structure::parameters`],
    /// then the input bias.
    pub fn iter(&self) -> impl Iterator<Item = (Parameter, Interval)> + '_ {
        self.intervals.iter().copied()
    }
}

/// Draw from the posterior, in physical parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Velocity gain `K` (output unit / (input unit s)). Infinite without damping.
    k: f64,
    /// Acceleration gain `K/T_body` (output unit / (input unit s^2)).
    k_over_t_body: f64,
    /// Actuator lag (s).
    t_prop_s: f64,
    /// Body lag (s). Infinite without damping.
    t_body_s: f64,
    /// Dead time (s).
    tau_s: f64,
    /// Constant disturbance at the process input (input unit).
    input_bias: f64,
    /// Whether the drawn coordinates belong to a process. If not (complex poles, negative damping or negative dead
    /// time), the parameters are those of the nearest process.
    is_process: bool,
}

impl Draw {
    /// Draw at these coordinates of the estimator. `sign` is the sign of the gain.
    fn of(at: &[f64; 5], sign: f64) -> Self {
        let sum_per_s = at[coordinate::LN_POLE_SUM].exp();
        let ratio = at[coordinate::POLE_RATIO];
        let fast_per_s = 0.5 * sum_per_s * (1.0 + (1.0 - 4.0 * ratio).max(0.0).sqrt());
        // Zero or negative damping: the body lag is infinite.
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

    /// Phase margin (rad) that a controller leaves on this draw. `None` if the loop has no margins.
    fn phase_margin_rad(&self, controller: &Controller) -> Option<f64> {
        margins(&self.model()?, controller).map(|margins| margins.phase_margin_rad)
    }

    /// Value of a parameter in its [unit](Parameter::unit). `K` and `T_body` are infinite without damping. NaN if the
    /// model does not have the parameter.
    #[must_use]
    pub fn value(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::K => self.k,
            Parameter::KOverTBody => self.k_over_t_body,
            Parameter::TProp => self.t_prop_s,
            Parameter::TBody => self.t_body_s,
            Parameter::InverseTBody => 1.0 / self.t_body_s,
            Parameter::Tau => self.tau_s,
            Parameter::InputBias => self.input_bias,
            _ => f64::NAN,
        }
    }

    /// Model with these parameters. `None` if they are out of range.
    #[must_use]
    pub fn model(&self) -> Option<Model> {
        let damping_per_s = 1.0 / self.t_body_s;
        let process = Soiptd::from_acceleration_gain(
            self.k_over_t_body,
            self.t_prop_s,
            damping_per_s,
            self.tau_s,
        );
        process.ok().map(Model::Soiptd)
    }
}

/// Probability distribution of the process: the most probable model, and 4,000 draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    best: Draw,
    /// Empty if the estimator returned no covariance.
    draws: Vec<Draw>,
}

impl Posterior {
    /// Posterior of the result of the estimator, for samples every `sample_s` (s).
    ///
    /// Two uncertainties are added to the covariance of the estimator. A recording does not tell where within the
    /// sample period its time stamps lie, so the dead time has a uniform error of one sample period. Scale and clock of
    /// the instruments make gain and poles uncertain by 0.1 %.
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
        // Draws in pairs on opposite sides of the centre, so that the mean of any even number of draws is the centre.
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

    /// Parameters of the model and the input bias, with their 90 % intervals.
    #[must_use]
    pub fn estimate(&self) -> Estimate {
        let structure = Structure::Soiptd;
        let interval = |parameter: Parameter| {
            let values = self.draws.iter().map(|draw| draw.value(parameter));
            let interval = Interval::new(self.best.value(parameter), quantiles(values.collect()));
            (parameter, interval)
        };
        let reported = structure.parameters().iter().copied();
        Estimate {
            structure,
            intervals: (reported.chain([Parameter::InputBias]))
                .map(interval)
                .collect(),
        }
    }

    /// All draws. Empty if the estimator returned no covariance.
    #[must_use]
    pub fn draws(&self) -> &[Draw] {
        &self.draws
    }

    /// Models of the first `most` draws whose coordinates belong to a process. The other draws are left out; replacing
    /// them by the nearest process would give that process too much weight.
    #[must_use]
    pub fn models(&self, most: usize) -> Vec<Model> {
        self.draws
            .iter()
            .filter(|draw| draw.is_process)
            .filter_map(Draw::model)
            .take(most)
            .collect()
    }

    /// Probability that all parameters of the model lie within the intervals of `within` at once. `None` if the
    /// estimator returned no covariance.
    #[must_use]
    pub fn joint_probability(&self, within: &Estimate) -> Option<f64> {
        let of_model: Vec<(Parameter, Interval)> = (within.iter())
            .filter(|(parameter, _)| within.structure.parameters().contains(parameter))
            .collect();
        let inside = |draw: &&Draw| {
            let holds = |(parameter, interval): &(Parameter, Interval)| {
                interval.holds(draw.value(*parameter))
            };
            of_model.iter().all(holds)
        };
        let count = self.draws.iter().filter(inside).count();
        (!self.draws.is_empty()).then(|| count as f64 / self.draws.len() as f64)
    }

    /// Parameters of [`Posterior::correlations`], in the order of its rows and columns.
    pub const CORRELATED: [Parameter; 5] = [
        Parameter::KOverTBody,
        Parameter::TProp,
        Parameter::InverseTBody,
        Parameter::Tau,
        Parameter::InputBias,
    ];

    /// Correlation coefficients of the parameters [`Posterior::CORRELATED`], 5 x 5. `None` if the estimator returned no
    /// covariance.
    #[must_use]
    pub fn correlations(&self) -> Option<[[f64; 5]; 5]> {
        let of = |draw: &Draw| Self::CORRELATED.map(|parameter| draw.value(parameter));
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
        // A parameter of zero variance has no correlation with the others.
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

    /// Phase margin (rad) that a controller leaves on the most probable model, with its 90 % interval over the draws.
    #[must_use]
    pub fn phase_margin_rad(&self, controller: &Controller) -> Interval {
        let best = self.best.phase_margin_rad(controller);
        Interval::new(
            best.unwrap_or(f64::NEG_INFINITY),
            quantiles(self.phase_margins_rad(controller)),
        )
    }

    /// Phase margins (rad) that a controller leaves on the draws. Draws without margins are left out.
    #[must_use]
    pub fn phase_margins_rad(&self, controller: &Controller) -> Vec<f64> {
        let margin = |draw: &Draw| draw.phase_margin_rad(controller);
        self.draws.iter().filter_map(margin).collect()
    }
}
