//! The output-error model on a window of samples: best linear parameters, cost, slopes.

use std::ops::Range;

use onecycle_onboard::Soiptd;
use onecycle_onboard::transition::{State, Transition};
use onecycle_plant::FixedStepProcess;

use super::{InitialState, InputBias, OutputErrorFit, PemSettings};
use crate::judge::baselines::BaselineError;
use onecycle_identify::Signals;

/// Half the step of the central differences of the response over the logarithm of a time: its square
/// and the rounding error over it are both some 1e-10.
const HALF_STEP: f64 = 1e-5;

/// A linear term of the response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Term {
    /// The recorded input; its factor is the gain `K`.
    Input,
    /// A constant input; its factor is `K` times the bias.
    Bias,
    /// The output at the first sample.
    Output,
    /// The rate at the first sample.
    Rate,
    /// The force at the first sample (output unit / s^2).
    Force,
}

/// The samples and the linear terms of the model.
pub(super) struct OutputError<'a> {
    sample_s: f64,
    /// The recorded input up to the end of the window, with its mean removed if the settings ask for
    /// that.
    input: Vec<f64>,
    /// First sample of the window.
    begin: usize,
    output: &'a [f64],
    initial_state: InitialState,
    terms: Vec<Term>,
    /// Sum of squares of the output about its mean.
    total: f64,
}

impl<'a> OutputError<'a> {
    pub(super) fn new(
        signals: &Signals<'a>,
        window: Range<usize>,
        settings: &PemSettings,
    ) -> Result<Self, BaselineError> {
        let mut terms = vec![Term::Input];
        if settings.input_bias == InputBias::Estimated {
            terms.push(Term::Bias);
        }
        if settings.initial_state == InitialState::Estimated {
            terms.extend([Term::Output, Term::Rate, Term::Force]);
        }
        let samples = window.len();
        // A fit needs more samples than parameters.
        let output = signals.output.get(window.clone());
        let Some(output) = output.filter(|_| samples > terms.len() + 3) else {
            return Err(BaselineError::TooShort { samples });
        };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let offset = match settings.input_bias {
            InputBias::MeanRemoved => mean(&signals.input[window.clone()]),
            InputBias::Ignored | InputBias::Estimated => 0.0,
        };
        let centre = mean(output);
        Ok(Self {
            sample_s: signals.sample_period_s,
            input: signals.input[..window.end]
                .iter()
                .map(|u| u - offset)
                .collect(),
            begin: window.start,
            output,
            initial_state: settings.initial_state,
            terms,
            total: output.iter().map(|y| (y - centre) * (y - centre)).sum(),
        })
    }

    /// The fit at these times (s); `None` if they are out of range or the output does not follow the
    /// input.
    pub(super) fn fit(&self, times_s: [f64; 3], start: usize) -> Option<OutputErrorFit> {
        let unit = unit_process(times_s)?;
        let (factors, residual) = self.solve(&unit);
        let gain = factors[0];
        let bias = self.terms.iter().position(|&term| term == Term::Bias);
        Some(OutputErrorFit {
            process: unit.with_gain_scaled(gain).ok()?,
            input_bias: bias.map(|at| factors[at] / gain),
            cost: self.relative(&residual),
            start,
        })
    }

    /// The cost at these times (s) and, if asked for, its slopes over their logarithms. Infinite if the
    /// times are out of range.
    pub(super) fn cost_and_slopes(&self, times_s: [f64; 3], with_slopes: bool) -> (f64, [f64; 3]) {
        let Some(unit) = unit_process(times_s) else {
            return (f64::INFINITY, [0.0; 3]);
        };
        let (factors, residual) = self.solve(&unit);
        let mut slopes = [0.0; 3];
        if with_slopes {
            // The best factors are a stationary point, so only the response at these factors changes.
            for (index, slope) in slopes.iter_mut().enumerate() {
                let along = |step: f64| {
                    let mut times_s = times_s;
                    times_s[index] *= step.exp();
                    unit_process(times_s).map_or(0.0, |unit| {
                        let response = self.response(&unit, &factors);
                        residual.iter().zip(response).map(|(r, y)| r * y).sum()
                    })
                };
                *slope = -(along(HALF_STEP) - along(-HALF_STEP)) / (HALF_STEP * self.total);
            }
        }
        (self.relative(&residual), slopes)
    }

    fn relative(&self, residual: &[f64]) -> f64 {
        residual.iter().map(|r| r * r).sum::<f64>() / self.total
    }

    /// The best factors of the terms, and the residual of the output.
    fn solve(&self, unit: &Soiptd) -> (Vec<f64>, Vec<f64>) {
        let columns = (0..self.terms.len()).map(|index| {
            let mut factors = vec![0.0; self.terms.len()];
            factors[index] = 1.0;
            self.response(unit, &factors)
        });
        least_squares(columns.collect(), self.output)
    }

    /// The response at the samples of the window of a process with the gain one.
    fn response(&self, unit: &Soiptd, factors: &[f64]) -> Vec<f64> {
        let factor = |term: Term| {
            let at = self.terms.iter().position(|&other| other == term);
            at.map_or(0.0, |at| factors[at])
        };
        let (gain, bias) = (factor(Term::Input), factor(Term::Bias));
        let mut state = State {
            y: factor(Term::Output),
            v: factor(Term::Rate),
            f: factor(Term::Force),
        };
        // `offset` is added to the input, `constant` drives the state.
        let (past, offset, constant) = match self.initial_state {
            InitialState::Rest => (0, bias, 0.0),
            // The input that arrives in the window left before it; the bias has always been there.
            InitialState::Estimated => {
                let under_way = (unit.tau_s() / self.sample_s).ceil() as usize + 1;
                (self.begin.min(under_way), 0.0, bias * unit.k_over_t_body())
            }
        };
        let step = Transition::over(unit, self.sample_s);
        let mut driven = FixedStepProcess::new(unit, self.sample_s);
        let mut response = Vec::with_capacity(self.output.len());
        for (index, u) in self.input.iter().enumerate().skip(self.begin - past) {
            if index >= self.begin {
                response.push(driven.output() + state.y);
                state = step.apply(&state, constant);
            }
            driven.step(gain * u + offset);
        }
        response
    }
}

/// The process of these times (s) with `K` one.
fn unit_process([t_prop_s, t_body_s, tau_s]: [f64; 3]) -> Option<Soiptd> {
    Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).ok()
}

/// A column counts as a combination of the columns before it if its remainder is less than this part of
/// it.
const DEPENDENT: f64 = 1e-12;

/// Least-squares factors of the columns and the residual of `right`, by modified Gram-Schmidt (A.
/// Bjorck 1967); columns that depend on those before them get a factor of zero.
fn least_squares(mut columns: Vec<Vec<f64>>, right: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let count = columns.len();
    let mut residual = right.to_vec();
    let mut triangle = vec![vec![0.0; count]; count];
    let mut parts = vec![0.0; count];
    for j in 0..count {
        let (basis, rest) = columns.split_at_mut(j);
        let column = &mut rest[0];
        let before = dot(column, column).sqrt();
        for (i, q) in basis.iter().enumerate() {
            triangle[i][j] = take_out(q, column);
        }
        let length = dot(column, column).sqrt();
        if length > DEPENDENT * before {
            triangle[j][j] = length;
            column.iter_mut().for_each(|value| *value /= length);
            parts[j] = take_out(column, &mut residual);
        } else {
            column.fill(0.0);
        }
    }
    let mut factors = vec![0.0; count];
    for i in (0..count).rev() {
        let known: f64 = (i + 1..count).map(|j| triangle[i][j] * factors[j]).sum();
        if triangle[i][i] > 0.0 {
            factors[i] = (parts[i] - known) / triangle[i][i];
        }
    }
    (factors, residual)
}

/// Removes the part along the unit vector `q` from `vector` and returns its length.
fn take_out(q: &[f64], vector: &mut [f64]) -> f64 {
    let part = q.iter().zip(&*vector).map(|(x, y)| x * y).sum::<f64>();
    for (value, q) in vector.iter_mut().zip(q) {
        *value -= part * q;
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::baselines::pem::Data;

    // Fit of 3 - 2 t by the columns 1, t and 4 + 2 t, where the third depends on the first two: factors
    // 3, -2 and 0.
    #[test]
    fn dependent_columns_get_nothing() {
        let times = [0.0, 1.0, 2.0, 5.0];
        let columns = vec![
            vec![1.0; 4],
            times.to_vec(),
            times.map(|t| 4.0 + 2.0 * t).to_vec(),
        ];
        let (factors, residual) = least_squares(columns, &times.map(|t| 3.0 - 2.0 * t));
        for (factor, expected) in factors.iter().zip([3.0, -2.0, 0.0]) {
            assert!((factor - expected).abs() < 1e-14, "{factors:?}");
        }
        assert!(residual.iter().all(|r| r.abs() < 1e-14), "{residual:?}");
    }

    // Slopes of the cost against central differences of the cost, away from the optimum. The error of
    // the differences is of the order of 1e-8 of the cost, and so is the bound.
    #[test]
    fn slopes_are_those_of_the_cost() {
        let samples = 400;
        let time_s: Vec<f64> = (0..samples).map(|k| f64::from(k) * 1e-3).collect();
        let input: Vec<f64> = (0..samples)
            .map(|k| if k / 50 % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let mut process = FixedStepProcess::new(&Soiptd::new(2.0, 0.02, 0.3, 0.01).unwrap(), 1e-3);
        let output: Vec<f64> = input
            .iter()
            .map(|&u| {
                let y = process.output();
                process.step(u);
                y
            })
            .collect();
        let signals = Signals {
            time_s: &time_s,
            input: &input,
            output: &output,
            samples_per_point: 1,
            sample_period_s: 1e-3,
            breaks: &[],
        };
        for initial_state in [InitialState::Rest, InitialState::Estimated] {
            let settings = PemSettings {
                initial_state,
                input_bias: InputBias::Estimated,
                ..PemSettings::paper(Data::Whole)
            };
            let model = OutputError::new(&signals, 150..400, &settings).unwrap();
            let at = [0.035, 0.2, 0.0153];
            let (cost, slopes) = model.cost_and_slopes(at, true);
            for (index, slope) in slopes.into_iter().enumerate() {
                let along = |step: f64| {
                    let mut times_s = at;
                    times_s[index] *= step.exp();
                    model.cost_and_slopes(times_s, false).0
                };
                let difference = (along(1e-4) - along(-1e-4)) / 2e-4;
                assert!(
                    (slope - difference).abs() < 1e-6 * cost.max(slope.abs()),
                    "{initial_state:?} {index}: {slope} against {difference}"
                );
            }
        }
    }
}
