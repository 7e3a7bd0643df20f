//! Outputs of a pack of an identifier's size, and reading it.

use divan::{Bencher, black_box};
use onecycle_lab::pack::{LeadTableContents, PackContents, Precision, layers};
use onecycle_lab::train::{Layer, Network};
use onecycle_onboard::pack::{Domain, OUTPUTS, OutputScaling, Pack, Prior, VALUES};
use onecycle_onboard::signature::LENGTH;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// Width of the two hidden layers.
const HIDDEN: usize = 48;

fn main() {
    divan::main();
}

/// 34-48-48-14 with a table of 2 x 32 x 32 numbers.
fn bytes(precision: Precision) -> Vec<u8> {
    let dense = |outputs| Layer::Dense { outputs };
    let kinds = [
        dense(HIDDEN),
        Layer::Tanh,
        dense(HIDDEN),
        Layer::Tanh,
        dense(OUTPUTS),
    ];
    let network = Network::new(LENGTH, &kinds, &mut Pcg64Mcg::seed_from_u64(1));
    let network = network.expect("the sizes are those of a network");
    let contents = PackContents {
        layers: layers(&network, precision).expect("the layers are dense"),
        input_offsets: [0.0; LENGTH],
        input_scales: [1.0; LENGTH],
        output_scaling: OutputScaling {
            scales: [1.0; VALUES],
            temperatures: [1.0; VALUES],
            lowest: [-9.0; VALUES],
            highest: [9.0; VALUES],
        },
        domain: Domain {
            ln_samples: [3.0, 8.0],
            duty: [0.1, 0.9],
            beta: [-0.73; 2],
            phase_margin_rad: 0.35,
        },
        unknown_threshold: 1.0,
        prior: Prior::default(),
        calibration: Vec::new(),
        lead_table: LeadTableContents {
            n: 32,
            m: 32,
            fields: 2,
            axes: [0.0, 1.0, 0.0, 1.0],
            values: vec![0.5; 2 * 32 * 32],
        },
        self_tests: vec![[0.5; LENGTH]; 4],
        card: serde_json::json!({}),
    };
    contents
        .to_bytes()
        .expect("the contents are those of a pack")
}

fn signature() -> [f32; LENGTH] {
    std::array::from_fn(|i| (i as f32 / 5.0).sin())
}

#[divan::bench(args = [Precision::Bytes, Precision::Floats])]
fn outputs(bencher: Bencher, precision: Precision) {
    let bytes = bytes(precision);
    let pack = Pack::read(&bytes).expect("the pack is whole");
    let signature = signature();
    bencher.bench_local(|| pack.outputs(black_box(&signature)));
}

#[divan::bench]
fn read(bencher: Bencher) {
    let bytes = bytes(Precision::Bytes);
    bencher.bench_local(|| Pack::read(black_box(&bytes)).map(|pack| pack.content_hash()));
}
