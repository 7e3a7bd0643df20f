//! Writes random networks as ONNX, and what they make of random inputs, for another runtime to be
//! compared with: `cargo run --release -p onecycle-lab --example onnx`, then
//!
//! ```text
//! python3 experiments/onnx_check.py small.onnx small.safetensors
//! ```
//!
//! in the folder `onecycle_onnx` of the system's temporary files. `small` is of an identifier's size,
//! `paper` of the paper's: 4520-3000-1000-182 with batch normalisation and dropout.

use std::fs;

use onecycle_lab::learn::onnx::{Normalisation, export};
use onecycle_lab::learn::train::{Layer, Matrix, Network, Tensor, TensorFile};
use onecycle_lab::workers::OneThread;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const ROWS: usize = 64;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::temp_dir().join("onecycle_onnx");
    fs::create_dir_all(&folder)?;
    let dense = |outputs| Layer::Dense { outputs };
    let small = [dense(48), Layer::Tanh, dense(48), Layer::Tanh, dense(14)];
    let dropout = Layer::Dropout { probability: 0.3 };
    let paper = [
        dense(3000),
        Layer::BatchNorm,
        Layer::Relu,
        dropout,
        dense(1000),
        Layer::BatchNorm,
        Layer::Relu,
        dropout,
        dense(182),
    ];
    for (name, inputs, layers) in [("small", 34, &small[..]), ("paper", 4520, &paper)] {
        let (model, samples) = pair(inputs, layers)?;
        fs::write(folder.join(format!("{name}.onnx")), model)?;
        fs::write(folder.join(format!("{name}.safetensors")), samples)?;
    }
    Ok(())
}

/// A model and its samples.
fn pair(inputs: usize, layers: &[Layer]) -> Result<(Vec<u8>, Vec<u8>), Box<dyn std::error::Error>> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut network = Network::new(inputs, layers, &mut rng)?;
    // Biases and statistics too, so that every constant counts.
    let mut file = TensorFile::from_bytes(&network.save())?;
    for tensor in file
        .tensors
        .iter_mut()
        .filter(|tensor| tensor.shape.len() == 1)
    {
        tensor.values.fill_with(|| rng.random_range(0.5..1.5));
    }
    network.load(&file.to_bytes())?;
    let normalisation = Normalisation {
        offsets: (0..inputs).map(|_| rng.random_range(-1.0..1.0)).collect(),
        scales: (0..inputs).map(|_| rng.random_range(0.5..2.0)).collect(),
    };
    let values: Vec<f32> = (0..ROWS * inputs)
        .map(|_| rng.random_range(-2.0..2.0))
        .collect();
    let columns = || {
        normalisation
            .offsets
            .iter()
            .zip(&normalisation.scales)
            .cycle()
    };
    let normalised = values.iter().zip(columns());
    let normalised = normalised.map(|(value, (offset, scale))| (value - offset) * scale);
    let seen = Matrix::from_rows(ROWS, inputs, normalised.collect()).unwrap_or_default();
    let outputs = network.evaluate(&seen, &OneThread)?;
    let tensor = |name: &str, columns, values| Tensor {
        name: name.to_owned(),
        shape: vec![ROWS, columns],
        values,
    };
    let samples = TensorFile {
        tensors: vec![
            tensor("inputs", inputs, values),
            tensor("outputs", outputs.columns(), outputs.values().to_vec()),
        ],
        ..TensorFile::default()
    };
    Ok((export(&network, Some(&normalisation))?, samples.to_bytes()))
}
