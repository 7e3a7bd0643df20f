//! The steps of a model's nodes, and the network that they make.
//!
//! ```text
//! y = scale x + shift     folded into a dense layer before it:   W := diag(scale) W, b := scale b + shift
//!                         or behind it:                          b := b + W shift,   W := W diag(scale)
//!                         before the first:                      the normalisation
//! ```

use super::{Normalisation, OnnxError};
use crate::learn::train::{Layer, Network};

/// Step of a node on a row of numbers.
pub(super) enum Step {
    Affine(Affine),
    Dense(Dense),
    Activation(Layer),
}

/// `scale x + shift`, with one number for each column or one for all.
#[derive(Clone)]
pub(super) struct Affine {
    pub(super) scale: Vec<f64>,
    pub(super) shift: Vec<f64>,
}

/// `W x + b`.
pub(super) struct Dense {
    pub(super) inputs: usize,
    /// One row for each output.
    pub(super) weight: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

impl Affine {
    /// Scale and shift of every column; `None` for another number of columns.
    fn of_columns(&self, columns: usize) -> Option<Vec<(f64, f64)>> {
        let fits = |values: &[f64]| values.len() == 1 || values.len() == columns;
        let at = |values: &[f64], i: usize| values[if values.len() == 1 { 0 } else { i }];
        (fits(&self.scale) && fits(&self.shift)).then(|| {
            (0..columns)
                .map(|i| (at(&self.scale, i), at(&self.shift, i)))
                .collect()
        })
    }

    /// This step followed by another; `None` if their numbers of columns differ.
    fn then(&self, next: &Self) -> Option<Self> {
        let lengths = [&self.scale, &self.shift, &next.scale, &next.shift].map(Vec::len);
        let columns = lengths.into_iter().max()?;
        let (first, second) = (self.of_columns(columns)?, next.of_columns(columns)?);
        let both = first.into_iter().zip(second);
        let (scale, shift) = both
            .map(|((scale, shift), (next, more))| (next * scale, next * shift + more))
            .unzip();
        Some(Self { scale, shift })
    }
}

impl Dense {
    fn scale_outputs(&mut self, affine: &Affine) -> Option<()> {
        let columns = affine.of_columns(self.bias.len())?;
        let rows = self.weight.chunks_mut(self.inputs);
        for ((row, bias), (scale, shift)) in rows.zip(&mut self.bias).zip(columns) {
            for weight in row {
                *weight = (scale * f64::from(*weight)) as f32;
            }
            *bias = (scale * f64::from(*bias) + shift) as f32;
        }
        Some(())
    }

    fn scale_inputs(&mut self, affine: &Affine) -> Option<()> {
        let columns = affine.of_columns(self.inputs)?;
        for (row, bias) in self.weight.chunks_mut(self.inputs).zip(&mut self.bias) {
            let mut sum = f64::from(*bias);
            for (weight, (scale, shift)) in row.iter_mut().zip(&columns) {
                sum += f64::from(*weight) * shift;
                *weight = (scale * f64::from(*weight)) as f32;
            }
            *bias = sum as f32;
        }
        Some(())
    }
}

/// Steps taken so far.
#[derive(Default)]
pub(super) struct Chain {
    layers: Vec<Layer>,
    dense: Vec<Dense>,
    normalisation: Option<Normalisation>,
    /// Scale and shift that wait for the next layer.
    waiting: Option<Affine>,
}

impl Chain {
    /// Adds a step. The error says why it does not fit.
    pub(super) fn take(&mut self, step: Step) -> Result<(), String> {
        match step {
            Step::Affine(affine) => self.take_affine(affine),
            Step::Dense(dense) => self.take_dense(dense),
            Step::Activation(_) if self.waiting.is_some() => Err(
                "no dense layer stands between this activation and the scaling or shift before it"
                    .into(),
            ),
            Step::Activation(layer) => {
                self.layers.push(layer);
                Ok(())
            }
        }
    }

    fn take_affine(&mut self, affine: Affine) -> Result<(), String> {
        let widths = || "the width of its constant differs from the width of its input".to_owned();
        let is_dense = matches!(self.layers.last(), Some(Layer::Dense { .. }));
        match (self.waiting.take(), self.dense.last_mut()) {
            (Some(first), _) => {
                self.waiting = Some(first.then(&affine).ok_or_else(widths)?);
            }
            (None, Some(last)) if is_dense => last.scale_outputs(&affine).ok_or_else(widths)?,
            (None, _) => self.waiting = Some(affine),
        }
        Ok(())
    }

    fn take_dense(&mut self, mut dense: Dense) -> Result<(), String> {
        let inputs = dense.inputs;
        if let Some(before) = self.dense.last()
            && before.bias.len() != inputs
        {
            let outputs = before.bias.len();
            return Err(format!(
                "it takes {inputs} inputs, but the layer before it has {outputs} outputs"
            ));
        }
        if let Some(affine) = self.waiting.take() {
            let widths = || {
                "the width of the scaling or shift before it differs from its number of inputs"
                    .to_owned()
            };
            if self.layers.is_empty() {
                let columns = affine.of_columns(inputs).ok_or_else(widths)?;
                self.normalisation = Some(normalisation(&columns)?);
            } else {
                dense.scale_inputs(&affine).ok_or_else(widths)?;
            }
        }
        let outputs = dense.bias.len();
        self.layers.push(Layer::Dense { outputs });
        self.dense.push(dense);
        Ok(())
    }

    /// The network of all steps.
    pub(super) fn network(self) -> Result<(Option<Normalisation>, Network), OnnxError> {
        if self.waiting.is_some() {
            let reason = "the scaling or shift at its end follows no dense layer";
            return Err(OnnxError::Model(reason.to_owned()));
        }
        let Some(first) = self.dense.first() else {
            let reason = "it has no dense layer (Gemm or MatMul)";
            return Err(OnnxError::Model(reason.to_owned()));
        };
        let network = Network::zeros(first.inputs, &self.layers)?;
        let numbers: Vec<f32> = (self.dense.into_iter())
            .flat_map(|dense| dense.weight.into_iter().chain(dense.bias))
            .collect();
        let network = network.with_numbers(&numbers)?;
        Ok((self.normalisation, network))
    }
}

/// `scale x + shift = (x - offset) scale`.
fn normalisation(columns: &[(f64, f64)]) -> Result<Normalisation, String> {
    let offsets = columns.iter().map(|(scale, shift)| (-shift / scale) as f32);
    let normalisation = Normalisation {
        offsets: offsets.collect(),
        scales: columns.iter().map(|(scale, _)| *scale as f32).collect(),
    };
    let Normalisation { offsets, scales } = &normalisation;
    if offsets.iter().chain(scales).all(|value| value.is_finite()) {
        Ok(normalisation)
    } else {
        Err("the scaling or shift of an input before it is zero or not finite".to_owned())
    }
}
