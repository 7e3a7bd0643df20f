//! The two networks, their ONNX files, samples, and what must come out.

use std::path::{Path, PathBuf};

use onecycle_lab::learn::onnx;
use onecycle_lab::learn::onnx::Normalisation;
use onecycle_lab::learn::pack::PackContents;
use onecycle_lab::learn::train::{Layer, Matrix, Network};
use onecycle_onboard::pack::Pack;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::Failure;

/// Seed of the weights and of the samples.
const SEED: u64 = 1;
/// Samples that are asked in turn.
const SAMPLES: usize = 8;

/// A network and what is asked of it.
pub(crate) struct Case {
    pub(crate) network: Network,
    pub(crate) normalisation: Option<Normalisation>,
    pub(crate) model: PathBuf,
    pub(crate) samples: Vec<Vec<f32>>,
    /// Outputs for each sample, by sums in f64.
    pub(crate) expected: Vec<Vec<f64>>,
}

impl Case {
    fn new(
        network: Network,
        normalisation: Option<Normalisation>,
        samples: Vec<Vec<f32>>,
        model: PathBuf,
    ) -> Result<Self, Failure> {
        std::fs::write(&model, onnx::export(&network, normalisation.as_ref(), &[])?)?;
        let expected = (samples.iter())
            .map(|sample| in_double(&network, normalisation.as_ref(), sample))
            .collect();
        Ok(Self {
            network,
            normalisation,
            model,
            samples,
            expected,
        })
    }

    /// Inputs, then the outputs of each dense layer.
    pub(crate) fn widths(&self) -> String {
        let mut widths = self.network.inputs().to_string();
        for layer in self.network.layers() {
            if let Layer::Dense { outputs } = layer {
                widths += &format!("-{outputs}");
            }
        }
        widths
    }
}

/// The paper's network, its weights drawn, batch normalisation folded into them.
pub(crate) fn paper(directory: &Path) -> Result<Case, Failure> {
    let mut layers = Vec::new();
    for outputs in [3000, 1000] {
        layers.extend([Layer::Dense { outputs }, Layer::Relu, Layer::BatchNorm]);
    }
    layers.push(Layer::Dense { outputs: 182 });
    let mut rng = Pcg64Mcg::seed_from_u64(SEED);
    let network = Network::new(4520, &layers, &mut rng)?.folded();
    let mut sample = || -> Vec<f32> {
        let numbers = StandardNormal.sample_iter(&mut rng);
        numbers.take(4520).collect()
    };
    let samples = (0..SAMPLES).map(|_| sample()).collect();
    Case::new(network, None, samples, directory.join("paper.onnx"))
}

/// The network of a pack, asked about the signatures of its self-test.
pub(crate) fn shipped(pack: &Pack<'_>, directory: &Path) -> Result<Case, Failure> {
    let contents = PackContents::read(pack)?;
    let normalisation = Normalisation {
        offsets: contents.input_offsets.to_vec(),
        scales: contents.input_scales.to_vec(),
    };
    let signatures = contents.self_tests.iter().take(SAMPLES);
    let samples: Vec<_> = signatures.map(|values| values.to_vec()).collect();
    if samples.is_empty() {
        return Err("the pack has no signature to test itself with".into());
    }
    let model = directory.join("shipped.onnx");
    Case::new(contents.network()?, Some(normalisation), samples, model)
}

fn in_double(network: &Network, normalisation: Option<&Normalisation>, sample: &[f32]) -> Vec<f64> {
    let mut values: Vec<f64> = sample.iter().copied().map(f64::from).collect();
    if let Some(Normalisation { offsets, scales }) = normalisation {
        for ((value, offset), scale) in values.iter_mut().zip(offsets).zip(scales) {
            *value = (*value - f64::from(*offset)) * f64::from(*scale);
        }
    }
    let mut parameters = network.parameters();
    for layer in network.layers() {
        match layer {
            Layer::Dense { .. } => {
                if let (Some(weight), Some(bias)) = (parameters.next(), parameters.next()) {
                    values = dense_in_double(weight, bias, &values);
                }
            }
            Layer::Relu => values.iter_mut().for_each(|value| *value = value.max(0.0)),
            Layer::Tanh => values.iter_mut().for_each(|value| *value = value.tanh()),
            Layer::BatchNorm | Layer::Dropout { .. } => unreachable!("it is folded"),
        }
    }
    values
}

fn dense_in_double(weight: &Matrix, bias: &Matrix, values: &[f64]) -> Vec<f64> {
    (weight.iter_rows().zip(bias.values()))
        .map(|(row, bias)| {
            let terms = row.iter().zip(values).map(|(w, x)| f64::from(*w) * x);
            f64::from(*bias) + terms.sum::<f64>()
        })
        .collect()
}
