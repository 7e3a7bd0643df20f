//! Posterior distribution of the physical parameters, and 90 % intervals, from the covariance of the estimator.
//!
//! The error of the estimator is Gaussian in its own coordinates (`onecycle_onboard::refine::coordinate`). The physical
//! parameters are nonlinear in these, most of all near equal lags and near zero damping. So draws from the Gaussian are
//! mapped to parameters, and the intervals are quantiles of the draws, widened at equal lags ([`edges`]). Nothing is
//! linearised. A time constant whose inverse may be zero is unbounded above.

mod edges;
mod intervals;

use onecycle_design::bands::quantiles;
use onecycle_design::{
    Controller, Linear, Model, Parameter, Specification, StepMetrics, Structure, design_over,
    margins, step_metrics,
};
use onecycle_onboard::refine::{Refined, coordinate};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use self::edges::{RULED_OUT, is_process, with_equal_lags, with_jumps, with_real_poles};
pub(crate) use self::intervals::Shortest;
pub use self::intervals::{Estimate, Interval, StepIntervals};
use onecycle_design::matrix::cholesky;

/// Number of draws. The standard error of the probability below the 5 % quantile is `sqrt(0.05 * 0.95 / 4000)`, 0.35 of
/// a percentage point.
pub(crate) const DRAWS: usize = 4000;
/// Seed of the draws: arbitrary, fixed so that the same recording gives the same bits.
const SEED: u64 = 0x1c7c_1e00;

/// Relative standard deviation of the scale and of the clock of the instruments. Better ones are rare, so no fit makes
/// the intervals narrower than this.
const INSTRUMENT: f64 = 1e-3;

/// Draws whose margins are computed where they are not in closed form. The ends of the central 90 % of 1000 draws have a
/// standard error of 7 % of the standard deviation.
const SEARCHED_MARGINS: usize = 1000;

/// Draws whose step responses are simulated. The ends of their central 90 % have a standard error of 15 % of the standard
/// deviation.
const STEPS: usize = 200;

/// What the likelihood draws.
pub(crate) struct Drawn {
    pub(crate) process: Linear,
    /// Constant disturbance at the process input (input unit).
    pub(crate) input_bias: f64,
    /// Whether the drawn coordinates have complex poles, of which `process` has equal lags.
    pub(crate) has_complex_poles: bool,
}

/// Draw from the posterior, in physical parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    process: Linear,
    /// Structure of the reported parameters. It may lack the damping of `process`, which a recording did not show but
    /// which may be there.
    reported: Structure,
    /// `K` and `T_body` of the relay's estimator, to the last bit.
    own: Option<(f64, f64)>,
    /// Constant disturbance at the process input (input unit).
    input_bias: f64,
    /// Whether the drawn coordinates belong to a process. If not (complex poles, negative damping or negative dead
    /// time), the parameters are those of the nearest process.
    is_process: bool,
    /// Whether two lags are equal, as those of a draw with complex poles become.
    has_equal_lags: bool,
}

impl Draw {
    /// Draw at these coordinates of the relay's estimator, whose `covariance` gives complex poles their nearest process.
    /// `sign` is the sign of the gain.
    fn of(drawn: [f64; 5], covariance: Option<&[[f64; 5]; 5]>, sign: f64) -> Self {
        let at = with_real_poles(drawn, covariance);
        let sum_per_s = at[coordinate::LN_POLE_SUM].exp();
        let ratio = at[coordinate::POLE_RATIO];
        let fast_per_s = 0.5 * sum_per_s * (1.0 + (1.0 - 4.0 * ratio).max(0.0).sqrt());
        // Zero or negative damping: the body lag is infinite.
        let slow_per_s = (ratio * sum_per_s * sum_per_s / fast_per_s).clamp(0.0, fast_per_s);
        let k_over_t_body = sign * at[coordinate::LN_JERK_GAIN].exp() / fast_per_s;
        let t_body_s = 1.0 / slow_per_s;
        Self {
            process: Linear::new(Structure::Soiptd)
                .with_gain(k_over_t_body)
                .with_lags_s([1.0 / fast_per_s, 1.0])
                .with_pole_per_s(1.0 / t_body_s)
                .with_tau_s(at[coordinate::TAU_S].max(0.0)),
            reported: Structure::Soiptd,
            own: Some((k_over_t_body / slow_per_s, t_body_s)),
            input_bias: at[coordinate::INPUT_BIAS],
            is_process: is_process(&drawn),
            has_equal_lags: fast_per_s == slow_per_s,
        }
    }

    /// Draw of the likelihood, of an unstable process or of one that is not.
    fn of_linear(drawn: &Drawn, (reported, is_unstable): (Structure, bool)) -> Self {
        let process = drawn.process;
        let [c1, c0] = process.pair();
        let pole_per_s = match is_unstable {
            true => process.pole_per_s().min(-f64::MIN_POSITIVE),
            false => process.pole_per_s().max(0.0),
        };
        let is_process =
            process.tau_s() >= 0.0 && process.pole_per_s() == pole_per_s && c0 >= 0.0 && c1 >= 0.0;
        Self {
            process: process
                .with_pole_per_s(pole_per_s)
                .with_pair(c1.max(0.0), c0.max(0.0))
                .with_tau_s(process.tau_s().max(0.0)),
            reported,
            own: None,
            input_bias: drawn.input_bias,
            is_process: is_process && !drawn.has_complex_poles,
            has_equal_lags: drawn.has_complex_poles,
        }
    }

    /// The draw of a process that the estimator has found.
    fn of_known(process: &Linear, kind: (Structure, bool), input_bias: f64) -> Self {
        let drawn = Drawn {
            process: *process,
            input_bias,
            has_complex_poles: false,
        };
        Self::of_linear(&drawn, kind)
    }

    /// Phase margin (rad) that a controller leaves on this draw. `None` if the loop has no margins.
    fn phase_margin_rad(&self, controller: &Controller) -> Option<f64> {
        margins(&self.model()?, controller).map(|margins| margins.phase_margin_rad)
    }

    /// Value of a parameter in its [unit](Structure::unit). `K` and `T_body` are infinite without damping. `None` if the
    /// model does not have the parameter.
    #[must_use]
    pub fn value(&self, parameter: Parameter) -> Option<f64> {
        match (parameter, self.own) {
            (Parameter::K, Some((k, _))) => Some(k),
            (Parameter::TBody, Some((_, t_body_s))) => Some(t_body_s),
            (Parameter::InputBias, _) => Some(self.input_bias),
            _ => self
                .process
                .with_structure(self.reported)
                .parameter(parameter),
        }
    }

    /// Model with these parameters. `None` if they are out of range.
    #[must_use]
    pub fn model(&self) -> Option<Model> {
        match self.process.structure() {
            Structure::Soiptd => self.process.soiptd().map(Model::Soiptd),
            _ => (self.process.gain() != 0.0).then(|| self.process.into()),
        }
    }
}

/// Probability distribution of the process: the most probable model, and 4,000 draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    /// Structure of the most probable model.
    structure: Structure,
    best: Draw,
    /// Whether the input bias is estimated.
    has_bias: bool,
    /// Empty if the estimator returned no covariance.
    draws: Vec<Draw>,
    shortest: Shortest,
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
        let covariance = refined.covariance.map(|mut covariance| {
            covariance[coordinate::TAU_S][coordinate::TAU_S] += sample_s * sample_s / 12.0;
            for index in [coordinate::LN_POLE_SUM, coordinate::LN_JERK_GAIN] {
                covariance[index][index] += INSTRUMENT * INSTRUMENT;
            }
            covariance
        });
        let root = covariance.as_ref().and_then(cholesky);
        let mut rng = Pcg64Mcg::seed_from_u64(SEED);
        // Draws in pairs on opposite sides of the centre, so that the mean of any even number of draws is the centre.
        let mut pair = |root: &[[f64; 5]; 5]| {
            let normal: [f64; 5] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            [1.0, -1.0].map(|side| {
                let at: [f64; 5] = std::array::from_fn(|i| {
                    centre[i] + side * (0..=i).map(|j| root[i][j] * normal[j]).sum::<f64>()
                });
                Draw::of(at, covariance.as_ref(), sign)
            })
        };
        let draws = root.map_or(vec![], |root| {
            (0..DRAWS / 2).flat_map(|_| pair(&root)).collect()
        });
        Self {
            structure: Structure::Soiptd,
            best: Draw::of(centre, None, sign),
            has_bias: true,
            draws,
            shortest: Shortest::default(),
        }
    }

    /// Posterior of the likelihood about `best`: draws from a mixture. `draw` turns a component, by its index, and
    /// standard normal numbers into a process.
    pub(crate) fn of_mixture(
        best: &Linear,
        input_bias: Option<f64>,
        weights: &[f64],
        draw: impl Fn(usize, &[f64]) -> Drawn,
    ) -> Self {
        let structure = best.structure();
        let kind = (structure, best.pole_per_s() < 0.0);
        let mut rng = Pcg64Mcg::seed_from_u64(SEED);
        let mut draws = Vec::with_capacity(DRAWS);
        let mut sum = 0.0;
        for (component, weight) in weights.iter().enumerate() {
            // Rounding the cumulated weights keeps the total.
            let until = |sum: f64| ((sum * (DRAWS / 2) as f64).round() as usize).min(DRAWS / 2);
            let count = until(sum + weight) - until(sum);
            sum += weight;
            for _ in 0..count {
                let normal: [f64; 10] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                for side in [1.0, -1.0] {
                    let drawn = draw(component, &normal.map(|z| side * z));
                    draws.push(Draw::of_linear(&drawn, kind));
                }
            }
        }
        // Consecutive pairs come from different components, so that the first few represent all: 617 is a prime that does
        // not divide the number of pairs.
        let pairs = draws.len() / 2;
        let shuffled = (0..pairs).flat_map(|k| {
            let at = 2 * (617 * k % pairs);
            [draws[at], draws[at + 1]]
        });
        let draws = shuffled.collect();
        Self {
            structure,
            best: Draw::of_known(best, kind, input_bias.unwrap_or(0.0)),
            has_bias: input_bias.is_some(),
            draws,
            shortest: Shortest::default(),
        }
    }

    /// Posterior about `best` of which `draws` are known. The input bias is not estimated.
    pub(crate) fn of_draws(best: &Linear, draws: &[Linear]) -> Self {
        let structure = best.structure();
        let kind = (structure, best.pole_per_s() < 0.0);
        // Neighbours of a chain are alike: every 617th in turn, a prime, so that the first few represent all.
        let count = draws.len();
        let shuffled = (0..count).map(|k| &draws[617 * k % count]);
        Self {
            structure,
            best: Draw::of_known(best, kind, 0.0),
            has_bias: false,
            draws: shuffled
                .map(|draw| Draw::of_known(draw, kind, 0.0))
                .collect(),
            shortest: Shortest::default(),
        }
    }

    /// The same, from a search that went down to these times.
    pub(crate) fn down_to(self, shortest: Shortest) -> Self {
        Self { shortest, ..self }
    }

    /// Parameters of the model and the input bias, with their 90 % intervals.
    #[must_use]
    pub fn estimate(&self) -> Estimate {
        let equal: Vec<bool> = self.draws.iter().map(|draw| draw.has_equal_lags).collect();
        let interval = |parameter: Parameter| {
            let best = self.best.value(parameter)?;
            let ends = with_equal_lags(&self.values(parameter), &equal);
            Some((parameter, Interval::new(best, ends)))
        };
        let bias = self.has_bias.then_some(Parameter::InputBias);
        let reported = self.structure.parameters().iter().copied();
        Estimate {
            structure: self.structure,
            shortest: self.shortest,
            intervals: reported.chain(bias).filter_map(interval).collect(),
        }
    }

    /// Values of a parameter in all draws. Empty if the model does not have the parameter.
    #[must_use]
    pub fn values(&self, parameter: Parameter) -> Vec<f64> {
        let values = self.draws.iter().filter_map(|draw| draw.value(parameter));
        values.collect()
    }

    /// Lags of the model that cannot be told from equal ones, longest first, and their mean (s) with its 90 % interval.
    /// The mean is the geometric one. `None` if equal lags are ruled out.
    #[must_use]
    pub fn equal_lags(&self) -> Option<(Vec<Parameter>, Interval)> {
        let equal = self.draws.iter().filter(|draw| draw.has_equal_lags).count();
        if (equal as f64) < RULED_OUT * self.draws.len() as f64 || equal == 0 {
            return None;
        }
        let estimate = self.estimate();
        let lags = [Parameter::TBody, Parameter::TProp, Parameter::TProp2];
        let of = |lag: &Parameter| Some((*lag, estimate.get(*lag)?));
        let lags: Vec<(Parameter, Interval)> = lags.iter().filter_map(of).collect();
        let meet = |pair: &[(Parameter, Interval)]| pair[0].1.low <= pair[1].1.high;
        let is_first = |at: &usize| *at + 1 < lags.len() && meet(&lags[*at..*at + 2]);
        let first = (0..lags.len()).find(is_first)?;
        let next = lags[first..]
            .windows(2)
            .take_while(|pair| meet(pair))
            .count();
        let equal: Vec<Parameter> = lags[first..=first + next].iter().map(|lag| lag.0).collect();
        let mean = |draw: &Draw| {
            let logs = equal.iter().filter_map(|lag| draw.value(*lag)).map(f64::ln);
            (logs.sum::<f64>() / equal.len() as f64).exp()
        };
        let ends = quantiles(self.draws.iter().map(mean).collect());
        let mean = Interval::new(mean(&self.best), ends);
        Some((equal, mean))
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
                draw.value(*parameter)
                    .is_none_or(|value| interval.holds(value))
            };
            of_model.iter().all(holds)
        };
        let count = self.draws.iter().filter(inside).count();
        (!self.draws.is_empty()).then(|| count as f64 / self.draws.len() as f64)
    }

    /// Parameters of [`Posterior::correlations`], in the order of its rows and columns: those that are finite for every
    /// process, then the input bias.
    #[must_use]
    pub fn correlated(&self) -> Vec<Parameter> {
        let reported = self.structure.parameters();
        let finite = |parameter: &Parameter| match parameter {
            // Infinite without damping, where K/T_body is not.
            Parameter::K if reported.contains(&Parameter::KOverTBody) => None,
            Parameter::TBody => Some(Parameter::InverseTBody),
            other => Some(*other),
        };
        let bias = self.has_bias.then_some(Parameter::InputBias);
        reported.iter().filter_map(finite).chain(bias).collect()
    }

    /// Correlation coefficients of the parameters [`Posterior::correlated`], one row and one column each. `None` if the
    /// estimator returned no covariance.
    #[must_use]
    pub fn correlations(&self) -> Option<Vec<Vec<f64>>> {
        let columns: Vec<Vec<f64>> = (self.correlated().into_iter())
            .map(|parameter| {
                let values = self.values(parameter);
                let mean = values.iter().map(|v| v / values.len() as f64).sum::<f64>();
                values.iter().map(|v| v - mean).collect()
            })
            .collect();
        let product = |i: usize, j: usize| -> f64 {
            let pairs = columns[i].iter().zip(&columns[j]);
            pairs.map(|(a, b)| a * b).sum()
        };
        // A parameter of zero variance has no correlation with the others.
        let entry = |i: usize, j: usize| {
            let size = (product(i, i) * product(j, j)).sqrt();
            if i == j {
                1.0
            } else if size > 0.0 {
                product(i, j) / size
            } else {
                0.0
            }
        };
        let count = columns.len();
        let row = |i: usize| (0..count).map(|j| entry(i, j)).collect();
        (!self.draws.is_empty()).then(|| (0..count).map(row).collect())
    }

    /// Whether the posterior is narrow enough for control: on at least 95 % of the draws the designed controller is stable,
    /// whose phase margin is `designed` (`None` without a controller), and so is the paper's, the least robust one on offer.
    /// The latter is designed for `model` over `draws`, unless it is the one `asked` for already, and left out where the
    /// paper has none for the structure.
    ///
    /// The paper's controller judges every result, so no other style turns a refusal into an answer.
    pub(crate) fn is_narrow_enough(
        &self,
        model: &Model,
        draws: &[Model],
        (asked, designed): (&Specification, Option<Interval>),
    ) -> bool {
        let is_stable = |margin: Interval| margin.low.is_some_and(|low| low > 0.0);
        if !designed.is_none_or(is_stable) {
            return false;
        }
        let paper = Specification::paper();
        let is_asked =
            asked.style == paper.style && asked.phase_margin_rad == paper.phase_margin_rad;
        if is_asked && designed.is_some() {
            return true;
        }
        let design = design_over(model, &draws[..draws.len().min(paper.draws())], &paper);
        design.map_or(true, |design| {
            is_stable(self.phase_margin_rad(&design.controller))
        })
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

    /// Characteristics of the step response `step` of the most probable model under `controller`, with their intervals over
    /// the draws. `None` if fewer than half of the draws are processes whose response can be simulated.
    #[must_use]
    pub fn step(&self, step: &StepMetrics, controller: &Controller) -> Option<StepIntervals> {
        let metrics = |model: &Model| step_metrics(model, controller).ok();
        let draws: Vec<Option<StepMetrics>> = self.models(STEPS).iter().map(metrics).collect();
        if 2 * draws.iter().flatten().count() <= draws.len() {
            return None;
        }
        let values = |value: fn(&StepMetrics) -> f64| -> Vec<f64> {
            let draws = draws.iter();
            (draws.map(|draw| draw.as_ref().map_or(f64::INFINITY, value))).collect()
        };
        let interval =
            |value: fn(&StepMetrics) -> f64| Interval::new(value(step), quantiles(values(value)));
        let settling = values(|step| step.settling_time_s);
        Some(StepIntervals {
            overshoot: interval(|step| step.overshoot),
            rise_time_s: interval(|step| step.rise_time_s),
            settling_time_s: Interval::new(step.settling_time_s, with_jumps(settling)),
            peak_input: interval(|step| step.peak_input),
        })
    }

    /// Phase margins (rad) that a controller leaves on the draws; on the first 1000 of them, unless it is a PD without
    /// filter. Draws without margins are left out.
    #[must_use]
    pub fn phase_margins_rad(&self, controller: &Controller) -> Vec<f64> {
        let margin = |draw: &Draw| draw.phase_margin_rad(controller);
        let most = match controller {
            Controller::Pd(_) => DRAWS,
            _ => SEARCHED_MARGINS,
        };
        self.draws.iter().take(most).filter_map(margin).collect()
    }
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Pid, step_metrics};

    use super::*;

    // Draws with a negative dead time are no processes: without any other the step has no interval instead of an unbounded one.
    #[test]
    fn a_step_without_processes_has_no_intervals() {
        let process = |tau_s: f64| {
            let lag = Linear::new(Structure::Foptd).with_pole_per_s(1.0);
            lag.with_gain(1.0).with_tau_s(tau_s)
        };
        let controller = Controller::from(Pid::new(2.0, 2.0, 0.0));
        let best: Model = process(0.1).into();
        let step = step_metrics(&best, &controller).unwrap();
        let of =
            |draws: &[Linear]| Posterior::of_draws(&process(0.1), draws).step(&step, &controller);
        assert_eq!(of(&[process(-0.01); 20]), None);
        assert_eq!(of(&[]), None);
        let known = of(&[process(0.1); 20]).unwrap();
        assert_eq!(known.overshoot.low, Some(step.overshoot));
    }
}
