//! The learning rate, epoch by epoch.
//!
//! ```text
//! rate(t) = rate * shape(t) * min(1, t / warm_up)        t in epochs, in the middle of a step
//!
//! constant 1      step factor^floor(t / every)      cosine least + (1 - least) (1 + cos(pi t / epochs)) / 2
//! ```
//!
//! Reference: I. Loshchilov, F. Hutter, "SGDR: stochastic gradient descent with warm restarts", ICLR
//! (2017), for the cosine.

use std::f64::consts::PI;

use crate::space::{FieldError, first_out_of_range};

/// Learning rates over the epochs.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Highest rate.
    pub rate: f64,
    /// Epochs in which the rate rises from zero; zero if left out.
    #[serde(default)]
    pub warm_up: f64,
    /// Shape of the rate after that; constant if left out.
    #[serde(default)]
    pub shape: Shape,
}

/// Shape of the learning rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// Constant.
    #[default]
    Constant,
    /// Falls by a factor at regular intervals.
    Step {
        /// Epochs from one fall to the next.
        every: f64,
        /// Factor of each fall.
        factor: f64,
    },
    /// Falls as half a period of a cosine.
    Cosine {
        /// Epochs from the highest to the least rate.
        epochs: f64,
        /// Least rate over the highest.
        least: f64,
    },
}

impl Schedule {
    /// One rate for all epochs.
    #[must_use]
    pub fn constant(rate: f64) -> Self {
        Self {
            rate,
            warm_up: 0.0,
            shape: Shape::Constant,
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        let positive = |field, value: f64| {
            let is_right = value.is_finite() && value > 0.0;
            (field, "positive and finite", value, is_right)
        };
        let part = |field, value: f64| (field, "0 to 1", value, (0.0..=1.0).contains(&value));
        let mut checks = vec![
            positive("rate", self.rate),
            (
                "warm_up",
                "zero or positive, finite",
                self.warm_up,
                self.warm_up.is_finite() && self.warm_up >= 0.0,
            ),
        ];
        match self.shape {
            Shape::Constant => {}
            Shape::Step { every, factor } => {
                checks.extend([positive("every", every), part("factor", factor)]);
            }
            Shape::Cosine { epochs, least } => {
                checks.extend([positive("epochs", epochs), part("least", least)]);
            }
        }
        first_out_of_range(checks)
    }

    /// The rate after this number of epochs, which may be fractional.
    #[must_use]
    pub fn rate_after(&self, epochs: f64) -> f64 {
        let shape = match self.shape {
            Shape::Constant => 1.0,
            Shape::Step { every, factor } => factor.powf((epochs / every).floor()),
            Shape::Cosine { epochs: all, least } => {
                let turn = (epochs / all).min(1.0);
                least + (1.0 - least) * 0.5 * (1.0 + (PI * turn).cos())
            }
        };
        let warm_up = if epochs < self.warm_up {
            epochs / self.warm_up
        } else {
            1.0
        };
        self.rate * shape * warm_up
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: a quarter of the warm-up; 0.1^2 after two falls; the cosine's ends and middle.
    #[test]
    fn rates_are_those_of_the_formulas() {
        let schedule = |warm_up, shape| Schedule {
            rate: 2.0,
            warm_up,
            shape,
        };
        let step = Shape::Step {
            every: 3.0,
            factor: 0.1,
        };
        let cosine = Shape::Cosine {
            epochs: 10.0,
            least: 0.2,
        };
        for (schedule, epochs, rate) in [
            (schedule(0.0, Shape::Constant), 0.0, 2.0),
            (schedule(4.0, Shape::Constant), 1.0, 0.5),
            (schedule(4.0, Shape::Constant), 4.0, 2.0),
            (schedule(0.0, step), 2.9, 2.0),
            (schedule(0.0, step), 6.5, 0.02),
            (schedule(0.0, cosine), 0.0, 2.0),
            (schedule(0.0, cosine), 5.0, 1.2),
            (schedule(0.0, cosine), 10.0, 0.4),
            (schedule(0.0, cosine), 99.0, 0.4),
            (schedule(10.0, cosine), 5.0, 0.6),
        ] {
            assert_eq!(schedule.validate(), Ok(()));
            let found = schedule.rate_after(epochs);
            assert!(
                (found - rate).abs() < 1e-15,
                "{schedule:?} {epochs} {found}"
            );
        }
        let error = schedule(f64::NAN, step).validate().unwrap_err();
        assert_eq!(error.field, "warm_up");
    }
}
