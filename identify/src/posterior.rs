//! Intervals of the physical parameters from the estimator's covariance.
//!
//! The estimator's coordinates are those in which its error is Gaussian; the parameters are not
//! linear in them, least of all near equal lags and near no damping. So the Gaussian is drawn
//! from, every draw mapped, and quantiles taken: nothing is linearised, and a time constant whose
//! inverse may be zero is unbounded above.

use onecycle_design::bands::quantiles;
use onecycle_design::{Controller, Model, Parameter, Structure, margins};
use onecycle_onboard::Soiptd;
use onecycle_onboard::refine::{Refined, coordinate};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::cholesky::cholesky;

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

/// Parameters of a model and the input bias, each with its interval.
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

    /// Interval of a parameter; `None` where it is not reported.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> Option<Interval> {
        (self.intervals.iter())
            .find(|(of, _)| *of == parameter)
            .map(|(_, interval)| *interval)
    }

    /// All parameters with their intervals: those of the structure in its order, then the input bias.
    pub fn iter(&self) -> impl Iterator<Item = (Parameter, Interval)> + '_ {
        self.intervals.iter().copied()
    }
}

/// One draw from the posterior, in physical parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Velocity gain `K`: output unit / (input unit s), infinite without damping.
    k: f64,
    /// Acceleration gain `K/T_body`: output unit / (input unit s^2).
    k_over_t_body: f64,
    /// Lag of the actuator (s).
    t_prop_s: f64,
    /// Lag of the body (s), infinite without damping.
    t_body_s: f64,
    /// Dead time (s).
    tau_s: f64,
    /// Constant that the process adds to the recorded input (input unit).
    input_bias: f64,
    /// Whether the coordinates drawn were those of a process. Others are brought to the nearest one.
    is_process: bool,
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

    fn phase_margin_rad(&self, controller: &Controller) -> Option<f64> {
        margins(&self.model()?, controller).map(|margins| margins.phase_margin_rad)
    }

    /// Value of a parameter in its unit, which may be infinite; NaN where the model has no such parameter.
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

    /// The model; `None` where the parameters are out of range.
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

/// The most probable model, and draws from the distribution about it.
#[derive(Clone, Debug, PartialEq)]
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

    /// The parameters of the model and the input bias, with their 90 % intervals.
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

    /// All draws, none where the estimator gives no covariance.
    #[must_use]
    pub fn draws(&self) -> &[Draw] {
        &self.draws
    }

    /// The models of the first `most` draws that are processes. A draw beyond what a process can be has no weight here:
    /// the nearest process would get too much.
    #[must_use]
    pub fn models(&self, most: usize) -> Vec<Model> {
        self.draws
            .iter()
            .filter(|draw| draw.is_process)
            .filter_map(Draw::model)
            .take(most)
            .collect()
    }

    /// Probability that all parameters of the model are within their intervals at once; `None` where the estimator gives
    /// no covariance.
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

    /// Parameters of [`Posterior::correlations`], in its order.
    pub const CORRELATED: [Parameter; 5] = [
        Parameter::KOverTBody,
        Parameter::TProp,
        Parameter::InverseTBody,
        Parameter::Tau,
        Parameter::InputBias,
    ];

    /// Correlations of [`Posterior::CORRELATED`]; `None` where the estimator gives no covariance.
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
        // A parameter without spread is correlated with itself alone.
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

    /// Phase margin (rad) that a controller leaves, with its 90 % interval.
    #[must_use]
    pub fn phase_margin_rad(&self, controller: &Controller) -> Interval {
        let best = self.best.phase_margin_rad(controller);
        Interval::new(
            best.unwrap_or(f64::NEG_INFINITY),
            quantiles(self.phase_margins_rad(controller)),
        )
    }

    /// Phase margins (rad) that a controller leaves on the draws.
    #[must_use]
    pub fn phase_margins_rad(&self, controller: &Controller) -> Vec<f64> {
        let margin = |draw: &Draw| draw.phase_margin_rad(controller);
        self.draws.iter().filter_map(margin).collect()
    }
}
