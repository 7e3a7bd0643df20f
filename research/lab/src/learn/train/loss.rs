//! Losses: classes, costs of a mistake, densities.
//!
//! `J_iT` is the cost of the controller of class `i` on the true process, as a fraction, `T` the true
//! class. `gamma_iT = 1 + J_iT` with `J_iT` between zero and a cap. Without the cap an unstable pick would cost infinitely much,
//! and only that class would be learnt.
//!
//! | loss                 | formula                                                               |
//! |----------------------|-----------------------------------------------------------------------|
//! | cross-entropy        | `-ln p_T`, `p_i ~ exp(a_i)`                                           |
//! | modified softmax     | `-ln p_T`, `p_i ~ exp(gamma_iT a_i)`: the paper's equation 15         |
//! | shifted softmax      | `-ln p_T`, `p_i ~ exp(gamma_iT (a_i - min_j a_j))`                    |
//! | cost-augmented       | `-ln p_T`, `p_i ~ exp(a_i + m J_iT)`                                  |
//! | expected cost        | `sum_i p_i J_iT + c (-ln p_T) - h H(p)`, `p_i ~ exp(a_i)`             |
//! | squared error        | `|a - y|^2 / 2`: plain regression                                     |
//! | Gaussian             | `-ln N(y)`, the outputs of the network give mean and precision        |
//! | cost-aware Gaussian  | `-ln N(y) + w (sqrt(1 + (g . (mu - y) / c)^2) - 1)`                   |
//!
//! **The paper's loss has only a degenerate optimum.** `gamma_TT = 1` is the smallest gamma. A constant
//! `-s` added to all outputs therefore divides every `p_i / p_T` by `exp((gamma_iT - 1) s)`: the loss
//! falls to zero without learning anything from the inputs. The shifted softmax does not change with
//! `s`, and equals the paper's softmax if the least output is zero.
//!
//! The cost-aware Gaussian adds the cost of the controller made for its mean `mu`: `g . (mu - y)` to
//! first order, with `g` the derivatives of the cost by errors of `y`. A cost above `c` counts
//! linearly; a smaller one counts by its square, which is smooth where the cost changes its sign. A
//! network that cannot get all values right thus gets their costly combination right. The first order
//! does not see errors along which the cost has no slope; the likelihood alone keeps those small. For
//! multirotors (see [`dataset`](crate::learn::dataset)) `w = 1`, `c = 0.01` makes controllers cheaper,
//! `w = 10` dearer.
//!
//! References: A. Ayyad, M. Chehadeh, M. I. Awad, Y. Zweiri, IEEE Access 8 (2020), equations 15
//! and 16; K. Gimpel, N. A. Smith, "Softmax-margin CRFs: training log-linear models with cost
//! functions", NAACL (2010), for the cost-augmented one.

use super::data::Batch;
use super::density::{Gaussian, cost_of_mean, gaussian};
use super::matrix::Matrix;
use super::softmax::{Logits, Shares, Softmax};
use super::{TrainError, expect_size};
use crate::space::{FieldError, first_out_of_range};

/// A loss of outputs `a`, the true class `T` and costs `J_iT` up to a cap.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Loss {
    /// `-ln p_T`, `p_i ~ exp(a_i)`. Reads classes.
    CrossEntropy,
    /// `-ln p_T`, `p_i ~ exp((1 + J_iT) a_i)`: the paper's loss as printed, whose optimum is to shift
    /// all outputs to minus infinity. Reads classes and costs.
    ModifiedSoftmax {
        /// Highest cost that counts.
        cap: f64,
    },
    /// `-ln p_T`, `p_i ~ exp((1 + J_iT) (a_i - min_j a_j))`. Reads classes and costs.
    ShiftedSoftmax {
        /// Highest cost that counts.
        cap: f64,
    },
    /// `-ln p_T`, `p_i ~ exp(a_i + m J_iT)`: the output of a costly class must be further below the
    /// true one. Reads classes and costs.
    CostAugmented {
        /// `m`, distance of outputs per unit of cost.
        scale: f64,
        /// Highest cost that counts.
        cap: f64,
    },
    /// `sum_i p_i J_iT + c (-ln p_T) - h H(p)`, `p_i ~ exp(a_i)`: the cost of a random pick. Reads
    /// classes and costs.
    ExpectedCost {
        /// Highest cost that counts.
        cap: f64,
        /// `c`, share of the plain cross-entropy.
        cross_entropy: f64,
        /// `h`, share of the entropy `H`, which keeps picks from being certain. With the cost alone the
        /// optimum is then `p_i ~ exp(-J_iT / h)`.
        entropy: f64,
    },
    /// `|a - y|^2 / 2`. Reads values.
    SquaredError {
        /// Length of `y`.
        dimension: usize,
    },
    /// `-ln N(y)` of a [`Gaussian`]. Reads values.
    Gaussian {
        /// Length of `y`.
        dimension: usize,
    },
    /// `-ln N(y) + w (sqrt(1 + (g . (mu - y) / c)^2) - 1)` of a [`Gaussian`] with mean `mu`. Reads
    /// values: `y`, then `g`, the cost of an error of each number of `y`.
    CostAwareGaussian {
        /// Length of `y`.
        dimension: usize,
        /// `w`, weight of the cost beside the likelihood.
        weight: f64,
        /// `c`, cost below which the square counts, and above which the cost itself counts.
        scale: f64,
    },
}

/// Largest dimension of a Gaussian: outputs grow with its square.
const MOST_DIMENSIONS: usize = 1000;

/// Memory that is reused from sample to sample.
#[derive(Default)]
struct Scratch {
    softmax: Softmax,
    gradient: Vec<f64>,
}

impl Loss {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        let positive = |field, value: f64| {
            let is_right = value.is_finite() && value > 0.0;
            (field, "positive and finite", value, is_right)
        };
        let share = |field, value: f64| {
            let is_right = value.is_finite() && value >= 0.0;
            (field, "zero or positive, finite", value, is_right)
        };
        let number = |field, value: usize| {
            let is_right = (1..=MOST_DIMENSIONS).contains(&value);
            (field, "1 to 1000", value as f64, is_right)
        };
        let checks = match *self {
            Self::CrossEntropy => vec![],
            Self::ModifiedSoftmax { cap } | Self::ShiftedSoftmax { cap } => {
                vec![positive("cap", cap)]
            }
            Self::CostAugmented { scale, cap } => {
                vec![share("scale", scale), positive("cap", cap)]
            }
            Self::ExpectedCost {
                cap,
                cross_entropy,
                entropy,
            } => vec![
                positive("cap", cap),
                share("cross_entropy", cross_entropy),
                share("entropy", entropy),
            ],
            Self::SquaredError { dimension } | Self::Gaussian { dimension } => {
                vec![number("dimension", dimension)]
            }
            Self::CostAwareGaussian {
                dimension,
                weight,
                scale,
            } => vec![
                number("dimension", dimension),
                share("weight", weight),
                positive("scale", scale),
            ],
        };
        first_out_of_range(checks)
    }

    /// Number of outputs that the loss needs; `None` if any number will do, one for each class.
    #[must_use]
    pub fn outputs(&self) -> Option<usize> {
        match *self {
            Self::SquaredError { dimension } => Some(dimension),
            Self::Gaussian { dimension } | Self::CostAwareGaussian { dimension, .. } => {
                Some(Gaussian::outputs(dimension))
            }
            _ => None,
        }
    }

    /// The mean over a batch, weighted by sample, and in `gradient` its derivatives with respect to the
    /// outputs, `batch x out`.
    ///
    /// # Errors
    /// [`TrainError`]: outputs and batch do not fit each other, or a field is out of its range.
    pub fn evaluate(
        &self,
        outputs: &Matrix,
        batch: &Batch,
        gradient: &mut Matrix,
    ) -> Result<f64, TrainError> {
        self.validate()?;
        self.expect_sizes(outputs, batch)?;
        let total = batch.total_weight()?;
        let mut scratch = Scratch {
            gradient: vec![0.0; outputs.columns()],
            ..Scratch::default()
        };
        gradient.reshape(outputs.rows(), outputs.columns());
        let mut loss = 0.0;
        for (i, outputs) in outputs.iter_rows().enumerate() {
            let share = batch.weight(i) / total;
            // A weight of zero excludes even an infinite loss.
            if share == 0.0 {
                gradient.row_mut(i).fill(0.0);
                continue;
            }
            loss += share * self.sample(outputs, batch, i, &mut scratch);
            for (to, slope) in gradient.row_mut(i).iter_mut().zip(&scratch.gradient) {
                *to = (share * slope) as f32;
            }
        }
        Ok(loss)
    }

    /// The loss of sample `i`; its derivatives are in the scratch.
    fn sample(&self, outputs: &[f32], batch: &Batch, i: usize, scratch: &mut Scratch) -> f64 {
        let Scratch { softmax, gradient } = scratch;
        let capped = |cap: f64| move |k: usize| f64::from(batch.costs.row(i)[k]).clamp(0.0, cap);
        let truth = || (outputs, batch.classes[i]);
        match *self {
            Self::CrossEntropy => softmax.cross_entropy(truth(), Logits::Plain, |_| 0.0, gradient),
            Self::ModifiedSoftmax { cap } => {
                softmax.cross_entropy(truth(), Logits::Scaled, capped(cap), gradient)
            }
            Self::ShiftedSoftmax { cap } => {
                softmax.cross_entropy(truth(), Logits::ScaledFromLeast, capped(cap), gradient)
            }
            Self::CostAugmented { scale, cap } => {
                softmax.cross_entropy(truth(), Logits::Raised(scale), capped(cap), gradient)
            }
            Self::ExpectedCost {
                cap,
                cross_entropy,
                entropy,
            } => {
                let shares = Shares {
                    cross_entropy,
                    entropy,
                };
                softmax.expected_cost(truth(), shares, capped(cap), gradient)
            }
            Self::SquaredError { .. } => {
                let mut loss = 0.0;
                for ((slope, a), y) in gradient.iter_mut().zip(outputs).zip(batch.values.row(i)) {
                    *slope = f64::from(*a) - f64::from(*y);
                    loss += 0.5 * *slope * *slope;
                }
                loss
            }
            Self::Gaussian { .. } => gaussian(outputs, batch.values.row(i), gradient),
            Self::CostAwareGaussian {
                dimension,
                weight,
                scale,
            } => {
                let (y, slopes) = batch.values.row(i).split_at(dimension);
                gaussian(outputs, y, gradient)
                    + cost_of_mean(outputs, (y, slopes), (weight, scale), gradient)
            }
        }
    }

    fn expect_sizes(&self, outputs: &Matrix, batch: &Batch) -> Result<(), TrainError> {
        let samples = batch.inputs.rows();
        if samples == 0 {
            return Err(TrainError::NoSample("learn from"));
        }
        expect_size("the number of samples", samples, outputs.rows())?;
        if let Some(expected) = self.outputs() {
            expect_size("the number of outputs", expected, outputs.columns())?;
        }
        match *self {
            Self::SquaredError { dimension } | Self::Gaussian { dimension } => {
                return expect_vectors(batch, dimension);
            }
            Self::CostAwareGaussian { dimension, .. } => {
                return expect_vectors(batch, 2 * dimension);
            }
            Self::CrossEntropy => {}
            _ => {
                let classes = outputs.columns();
                expect_size("the number of rows of costs", samples, batch.costs.rows())?;
                expect_size("the number of costs a row", classes, batch.costs.columns())?;
            }
        }
        expect_size("the number of classes", samples, batch.classes.len())?;
        let classes = outputs.columns();
        match batch.classes.iter().find(|&&class| class >= classes) {
            None => Ok(()),
            Some(&class) => Err(TrainError::Class { class, classes }),
        }
    }
}

fn expect_vectors(batch: &Batch, length: usize) -> Result<(), TrainError> {
    let samples = batch.inputs.rows();
    expect_size("the number of vectors", samples, batch.values.rows())?;
    expect_size("the length of a vector", length, batch.values.columns())
}
