//! onecycle itself, tract and candle.

use candle_core::{Device, Tensor};
use onecycle_lab::learn::train::{Layer, Matrix, Network};
use onecycle_lab::workers::OneThread;
use onecycle_onboard::classify::classify_by;
use onecycle_onboard::pack::Pack;
use onecycle_onboard::signature::{LENGTH, Signature};
use tract_onnx::prelude::*;

use crate::Failure;
use crate::networks::Case;
use crate::rounds::Contender;

/// Of the cycle that is classified; neither changes what there is to do.
const PERIOD_S: f64 = 0.4;
const NOISE_SIGMA: f64 = 1e-3;

pub(crate) fn network(network: &Network) -> Contender<'_> {
    Contender::new("onecycle, Network::evaluate", move |sample, outputs| {
        let inputs = Matrix::from_rows(1, sample.len(), sample.to_vec());
        let found = network.evaluate(&inputs.ok_or("no row")?, &OneThread)?;
        outputs.clear();
        outputs.extend_from_slice(found.values());
        Ok(())
    })
}

pub(crate) fn pack(pack: Pack<'static>) -> Contender<'static> {
    Contender::new("onecycle, Pack::outputs", move |sample, outputs| {
        let values: &[f32; LENGTH] = sample.try_into()?;
        outputs.clear();
        outputs.extend(pack.outputs(values));
        Ok(())
    })
}

/// The whole of it: the outputs, the process, its doubt, and whether it explains the cycle.
pub(crate) fn classification(pack: Pack<'static>) -> Contender<'static> {
    let run = move |sample: &[f32], outputs: &mut Vec<f32>| {
        let signature = Signature {
            values: sample.try_into()?,
            amplitude: 1.0,
            centre: 0.0,
            sign: 1.0,
        };
        let found = classify_by(&pack, &signature, PERIOD_S, NOISE_SIGMA)?;
        outputs.clear();
        outputs.push(found.score as f32);
        Ok(())
    };
    Contender::new("onecycle, classify_by: outputs, process, verdict", run).without_outputs()
}

/// The model is read with its batch open, and then told that it is one.
pub(crate) fn tract(case: &Case) -> Result<Contender<'_>, Failure> {
    let shape = [1, case.network.inputs()];
    let plan = tract_onnx::onnx()
        .model_for_path(&case.model)?
        .with_input_fact(0, f32::fact(shape).into())?
        .with_output_fact(0, Default::default())?
        .into_optimized()?
        .into_runnable()?;
    let mut state = plan.spawn()?;
    Ok(Contender::new("tract", move |sample, outputs| {
        let inputs = tract_onnx::prelude::Tensor::from_shape(&shape, sample)?;
        let found = state.run(tvec!(inputs.into()))?;
        outputs.clear();
        outputs.extend(found[0].to_plain_array_view::<f32>()?.iter());
        Ok(())
    }))
}

/// A layer as candle has it.
enum Step {
    Normalise(Tensor, Tensor),
    /// Weights, `out x in`, and biases.
    Dense(Tensor, Tensor),
    Relu,
    Tanh,
}

pub(crate) fn candle(case: &Case) -> Result<Contender<'_>, Failure> {
    let cpu = &Device::Cpu;
    let mut steps = Vec::new();
    if let Some(normalisation) = &case.normalisation {
        let row = |values: &[f32]| Tensor::from_slice(values, (1, values.len()), cpu);
        steps.push(Step::Normalise(
            row(&normalisation.offsets)?,
            row(&normalisation.scales)?,
        ));
    }
    let mut parameters = case.network.parameters();
    for layer in case.network.layers() {
        steps.push(match layer {
            Layer::Dense { outputs } => {
                let weight = parameters.next().ok_or("a layer without weights")?;
                let bias = parameters.next().ok_or("a layer without bias")?;
                let weight = Tensor::from_slice(weight.values(), (outputs, weight.columns()), cpu)?;
                let bias = Tensor::from_slice(bias.values(), outputs, cpu)?;
                Step::Dense(weight, bias)
            }
            Layer::Relu => Step::Relu,
            Layer::Tanh => Step::Tanh,
            Layer::BatchNorm | Layer::Dropout { .. } => return Err("it is not folded".into()),
        });
    }
    Ok(Contender::new("candle", move |sample, outputs| {
        let mut values = Tensor::from_slice(sample, (1, sample.len()), &Device::Cpu)?;
        for step in &steps {
            values = match step {
                Step::Normalise(offsets, scales) => ((values - offsets)? * scales)?,
                Step::Dense(weight, bias) => values.matmul(&weight.t()?)?.broadcast_add(bias)?,
                Step::Relu => values.relu()?,
                Step::Tanh => values.tanh()?,
            };
        }
        *outputs = values.flatten_all()?.to_vec1()?;
        Ok(())
    }))
}
