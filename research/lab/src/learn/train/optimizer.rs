//! Optimisers: SGD with momentum, and Adam.
//!
//! ```text
//! SGD     v := momentum v + g + decay w                                   w := w - rate v
//! Adam    m := b1 m + (1 - b1) g,  v := b2 v + (1 - b2) g^2
//!         w := (1 - rate decay) w - rate m / (1 - b1^t) / (sqrt(v / (1 - b2^t)) + eps)
//! ```
//!
//! Conventions of PyTorch's `SGD` and `AdamW`: decay acts on all parameters, the rate multiplies
//! the velocity, and decay is decoupled from Adam's moments. References: D. P. Kingma, J. Ba, "Adam:
//! a method for stochastic optimization", ICLR (2015); I. Loshchilov, F. Hutter, "Decoupled weight
//! decay regularization", ICLR (2019).

use std::sync::{Mutex, PoisonError};

use super::TrainError;
use super::expect_size;
use super::matrix::Matrix;
use super::network::{Network, Tape};
use crate::space::{FieldError, first_out_of_range};
use crate::workers::Workers;

/// Method of an optimiser.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum OptimizerMethod {
    /// Stochastic gradient descent.
    Sgd {
        /// Decay factor of the velocity per step, 0 to below 1.
        momentum: f64,
        /// Decay of the weights, 0 to 1.
        decay: f64,
    },
    /// Adam with decoupled decay.
    Adam {
        /// Decay factor of the mean gradient per step, 0 to below 1; usually 0.9.
        b1: f64,
        /// Decay factor of the mean square per step; usually 0.999.
        b2: f64,
        /// Decay of the weights, 0 to 1.
        decay: f64,
    },
}

/// Keeps Adam from dividing by zero: Kingma and Ba's value.
const EPSILON: f64 = 1e-8;

/// Numbers of a parameter in one part of the work: some 0.1 ms.
const PART: usize = 1 << 17;

/// An optimiser: a method with its memory of past gradients.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimizer {
    method: OptimizerMethod,
    steps: u64,
    /// Velocity or mean gradient of every parameter.
    first: Vec<Matrix>,
    /// Mean square of the gradient of every parameter; empty without Adam.
    second: Vec<Matrix>,
}

impl OptimizerMethod {
    /// Adam with its authors' values, without decay.
    pub const ADAM: Self = Self::Adam {
        b1: 0.9,
        b2: 0.999,
        decay: 0.0,
    };

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        let fraction = |field, value| (field, "0 to below 1", value, (0.0..1.0).contains(&value));
        let decay = |value| ("decay", "0 to 1", value, (0.0..=1.0).contains(&value));
        let checks = match *self {
            Self::Sgd { momentum, decay: d } => vec![fraction("momentum", momentum), decay(d)],
            Self::Adam { b1, b2, decay: d } => {
                vec![fraction("b1", b1), fraction("b2", b2), decay(d)]
            }
        };
        first_out_of_range(checks)
    }
}

/// The factors of one step.
#[derive(Clone, Copy)]
enum Factors {
    Sgd {
        momentum: f32,
        decay: f32,
        rate: f32,
    },
    Adam {
        /// `b1` and `1 - b1`; the difference is taken in `f64`.
        b1: [f32; 2],
        b2: [f32; 2],
        kept: f32,
        rate: f32,
        unbiased: f32,
    },
}

/// A stretch of one parameter with its gradient and moments.
struct Stretch<'a> {
    weights: &'a mut [f32],
    gradient: &'a [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
}

impl Optimizer {
    /// An optimiser without memory.
    ///
    /// # Errors
    /// Names the first field of the method that is out of its range.
    pub fn new(method: OptimizerMethod, network: &Network) -> Result<Self, FieldError> {
        method.validate()?;
        let zeros = || {
            (network.parameters())
                .map(|matrix| Matrix::zeros(matrix.rows(), matrix.columns()))
                .collect()
        };
        Ok(Self {
            method,
            steps: 0,
            first: zeros(),
            second: match method {
                OptimizerMethod::Sgd { .. } => Vec::new(),
                OptimizerMethod::Adam { .. } => zeros(),
            },
        })
    }

    /// Number of steps taken.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Memory of past gradients: velocities or means, and mean squares.
    pub(super) fn moments(&self) -> [&[Matrix]; 2] {
        [&self.first, &self.second]
    }

    /// As [`Self::moments`], to change, with the number of steps.
    pub(super) fn state_mut(&mut self) -> ([&mut [Matrix]; 2], &mut u64) {
        ([&mut self.first, &mut self.second], &mut self.steps)
    }

    /// One step of a network down the gradients of a tape.
    ///
    /// # Errors
    /// [`TrainError::Size`]: network or tape are not those of this optimiser.
    pub fn step(
        &mut self,
        network: &mut Network,
        tape: &Tape,
        rate: f64,
        workers: &dyn Workers,
    ) -> Result<(), TrainError> {
        let gradients = tape.gradients();
        let what = "the number of parameters";
        expect_size(what, self.first.len(), network.parameters().count())?;
        expect_size(what, self.first.len(), gradients.len())?;
        for ((own, its), gradient) in self.first.iter().zip(network.parameters()).zip(gradients) {
            expect_size(what, own.values().len(), its.values().len())?;
            expect_size(what, own.values().len(), gradient.values().len())?;
        }
        self.steps += 1;
        let factors = self.factors(rate);
        let mut seconds = self.second.iter_mut();
        let mut stretches = Vec::new();
        for ((weights, gradient), first) in (network.parameters_mut())
            .zip(gradients)
            .zip(&mut self.first)
        {
            let mut second = (seconds.next()).map(|matrix| matrix.values_mut().chunks_mut(PART));
            for ((weights, gradient), first) in (weights.values_mut().chunks_mut(PART))
                .zip(gradient.values().chunks(PART))
                .zip(first.values_mut().chunks_mut(PART))
            {
                stretches.push(Mutex::new(Stretch {
                    weights,
                    gradient,
                    first,
                    second: second.as_mut().and_then(Iterator::next).unwrap_or_default(),
                }));
            }
        }
        let step = |i: usize| {
            let mut stretch = stretches[i].lock().unwrap_or_else(PoisonError::into_inner);
            stretch.step(factors);
        };
        if network_is_small(stretches.len(), workers) {
            (0..stretches.len()).for_each(step);
        } else {
            workers.each(stretches.len(), &step);
        }
        Ok(())
    }

    fn factors(&self, rate: f64) -> Factors {
        match self.method {
            OptimizerMethod::Sgd { momentum, decay } => Factors::Sgd {
                momentum: momentum as f32,
                decay: decay as f32,
                rate: rate as f32,
            },
            OptimizerMethod::Adam { b1, b2, decay } => {
                let steps = self.steps as f64;
                Factors::Adam {
                    b1: [b1 as f32, (1.0 - b1) as f32],
                    b2: [b2 as f32, (1.0 - b2) as f32],
                    kept: (1.0 - rate * decay) as f32,
                    rate: (rate / (1.0 - b1.powf(steps))) as f32,
                    unbiased: (1.0 - b2.powf(steps)).sqrt().recip() as f32,
                }
            }
        }
    }
}

/// Whether there are too few stretches to be worth handing to threads; every parameter has at least
/// one.
fn network_is_small(stretches: usize, workers: &dyn Workers) -> bool {
    stretches < 8 * workers.count()
}

impl Stretch<'_> {
    fn step(&mut self, factors: Factors) {
        let moving = self.weights.iter_mut().zip(self.gradient);
        match factors {
            Factors::Sgd {
                momentum,
                decay,
                rate,
            } => {
                for ((w, g), v) in moving.zip(&mut *self.first) {
                    *v = momentum * *v + (g + decay * *w);
                    *w -= rate * *v;
                }
            }
            Factors::Adam {
                b1,
                b2,
                kept,
                rate,
                unbiased,
            } => {
                for (((w, g), m), v) in moving.zip(&mut *self.first).zip(&mut *self.second) {
                    *m = b1[0] * *m + b1[1] * g;
                    *v = b2[0] * *v + b2[1] * (g * g);
                    *w = kept * *w - rate * *m / (v.sqrt() * unbiased + EPSILON as f32);
                }
            }
        }
    }
}
