//! Packs of networks: the board computes the outputs of the trainer, and all contents read back.

use onecycle_lab::learn::pack::{
    LeadTableContents, PackContents, PackContentsError, PackedWeights, Precision, layers,
    quantisation,
};
use onecycle_lab::learn::train::{Layer, Network};
use onecycle_onboard::pack::{Domain, OUTPUTS, OutputScaling, Pack, PackError, Prior};
use onecycle_onboard::signature::LENGTH;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::changed;

const HIDDEN: usize = 32;

/// Samples that networks are compared on.
const SAMPLES: usize = 1000;

/// A 34-32-32-14 network with random weights and biases.
fn drawn(activation: Layer, rng: &mut Pcg64Mcg) -> Network {
    let layers = [
        Layer::Dense { outputs: HIDDEN },
        activation,
        Layer::Dense { outputs: HIDDEN },
        activation,
        Layer::Dense { outputs: OUTPUTS },
    ];
    let network = Network::new(LENGTH, &layers, rng).unwrap();
    changed(network, |name, values| {
        if name.ends_with("bias") {
            values.fill_with(|| rng.random_range(-0.5..0.5));
        }
    })
}

/// A pack of the network, for inputs between -1 and 1.
fn contents(network: &Network, precision: Precision) -> PackContents {
    PackContents {
        layers: layers(network, precision).unwrap(),
        input_offsets: [0.5; LENGTH],
        input_scales: [2.0; LENGTH],
        output_scaling: OutputScaling {
            scales: [1.0, 8.0, 8.0, 1.0],
            temperatures: [1.0, 1.1, 1.2, 1.3],
            lowest: [-4.0; 4],
            highest: [4.0; 4],
        },
        domain: Domain {
            ln_samples: [3.0, 8.0],
            duty: [0.1, 0.9],
            beta: [-0.73, -0.73],
            phase_margin_rad: 0.35,
        },
        unknown_threshold: 3.0,
        prior: Prior::default(),
        calibration: vec![0.1, 0.2, 0.3],
        lead_table: LeadTableContents {
            n: 2,
            m: 3,
            fields: 2,
            axes: [0.0, 1.0, -1.0, 1.0],
            values: (0..12_u8).map(f32::from).collect(),
        },
        self_tests: vec![[0.25; LENGTH], [0.75; LENGTH]],
        card: serde_json::json!({ "seed": 7, "made": "for a test" }),
    }
}

fn signatures(rng: &mut Pcg64Mcg) -> Vec<[f32; LENGTH]> {
    (0..SAMPLES)
        .map(|_| std::array::from_fn(|_| rng.random_range(0.0..1.0)))
        .collect()
}

// Sums of 34 and 32 terms of the order of 1, in another order: a few units of 2^-24 = 6e-8 per layer;
// outputs are of the order of 1.
#[test]
fn outputs_are_the_trainers() {
    let mut rng = Pcg64Mcg::seed_from_u64(20);
    for activation in [Layer::Relu, Layer::Tanh] {
        let network = drawn(activation, &mut rng);
        let bytes = contents(&network, Precision::Floats).to_bytes().unwrap();
        let pack = Pack::read(&bytes).unwrap();
        let found = quantisation(&pack, &network, &signatures(&mut rng)).unwrap();
        assert!(found.size > 0.3 && found.size < 3.0, "{found:?}");
        assert!(found.largest < 2e-6, "{found:?} with {activation:?}");
    }
}

// The error of a weight is uniform, up to half a step s: s / sqrt(12). A step is 1/127 of the largest
// weight of its row, about 2.2 standard deviations sqrt(2 / 34) of the weights. That is an error of 0.5
// % per weight, 0.5 % of the sums of a layer, and 0.9 % of the outputs after three layers; the largest
// of 14,000 errors is four to five times that, 4 %.
#[test]
fn bytes_are_a_few_per_cent_off() {
    let mut rng = Pcg64Mcg::seed_from_u64(21);
    let network = drawn(Layer::Relu, &mut rng);
    let bytes = contents(&network, Precision::Bytes).to_bytes().unwrap();
    let pack = Pack::read(&bytes).unwrap();
    let found = quantisation(&pack, &network, &signatures(&mut rng)).unwrap();
    let (largest, rms) = (found.largest / found.size, found.rms / found.size);
    assert!(largest > 0.005 && largest < 0.06, "{found:?}");
    assert!(rms > 0.004 && rms < 0.014, "{found:?}");
}

// Every weight is within half a step of its row, and the largest weight is exactly 127 steps.
#[test]
fn every_weight_is_within_half_a_step() {
    let network = drawn(Layer::Tanh, &mut Pcg64Mcg::seed_from_u64(22));
    let weights = network.parameters().step_by(2);
    for (layer, weight) in layers(&network, Precision::Bytes)
        .unwrap()
        .iter()
        .zip(weights)
    {
        let PackedWeights::Bytes { rows, scales } = &layer.weights else {
            unreachable!("bytes were asked for");
        };
        let rounded = layer.values();
        for (o, row) in weight.iter_rows().enumerate() {
            let here = o * layer.inputs..(o + 1) * layer.inputs;
            for (rounded, weight) in rounded[here.clone()].iter().zip(row) {
                assert!((rounded - weight).abs() <= 0.500_01 * scales[o]);
            }
            assert_eq!(rows[here].iter().map(|q| q.unsigned_abs()).max(), Some(127));
        }
    }
}

// A row of zeros has no scale. In the row -2 1 a step is 2 / 127, and 1 is 63.5 steps, rounded away
// from zero.
#[test]
fn rows_of_zeros_stay_zeros() {
    let network = Network::zeros(2, &[Layer::Dense { outputs: 2 }]).unwrap();
    let numbers = [0.0, 0.0, -2.0, 1.0, 0.0, 0.0];
    let network = network.with_numbers(&numbers).unwrap();
    let packed = &layers(&network, Precision::Bytes).unwrap()[0];
    let rows = vec![0, 0, -127, 64];
    let scales = vec![0.0, 2.0 / 127.0];
    assert_eq!(packed.weights, PackedWeights::Bytes { rows, scales });
}

#[test]
fn contents_come_back() {
    let network = drawn(Layer::Tanh, &mut Pcg64Mcg::seed_from_u64(23));
    for precision in [Precision::Floats, Precision::Bytes] {
        let contents = contents(&network, precision);
        let bytes = contents.to_bytes().unwrap();
        let pack = Pack::read(&bytes).unwrap();
        assert_eq!(PackContents::read(&pack).unwrap(), contents);
        assert_eq!(pack.self_test(), Some(0.0));
        assert_eq!(pack.self_tests().count(), 2);
        assert_eq!(pack.card(), r#"{"made":"for a test","seed":7}"#);
        // The same contents give the same bytes.
        assert_eq!(contents.to_bytes().unwrap(), bytes);
    }
    let floats = contents(&network, Precision::Floats);
    assert_eq!(floats.network().unwrap(), network);
}

// Four axes and 1 x 2 x 3 values.
#[test]
fn lead_tables_come_from_their_numbers() {
    let numbers: Vec<f32> = (0..10_u8).map(f32::from).collect();
    let table = LeadTableContents::of_numbers([1, 2], 3, &numbers).unwrap();
    assert_eq!((table.n, table.m, table.fields), (1, 2, 3));
    assert_eq!(table.axes, [0.0, 1.0, 2.0, 3.0]);
    assert_eq!(table.values, numbers[4..]);
    let of = |shape, numbers| LeadTableContents::of_numbers(shape, 3, numbers);
    assert_eq!(of([1, 2], &numbers[..9]), None);
    assert_eq!(of([1, 2], &numbers[..3]), None);
    assert_eq!(of([usize::MAX, 2], &numbers), None);
}

// Batch normalisation is folded into dense layers and dropout is omitted.
#[test]
fn a_trained_network_is_packed_as_it_evaluates() {
    let mut rng = Pcg64Mcg::seed_from_u64(24);
    let kinds = [
        Layer::BatchNorm,
        Layer::Dense { outputs: 20 },
        Layer::BatchNorm,
        Layer::Relu,
        Layer::Dropout { probability: 0.3 },
        Layer::Dense { outputs: OUTPUTS },
    ];
    let network = Network::new(LENGTH, &kinds, &mut rng).unwrap();
    let network = changed(network, |name, values| {
        if !["1.weight", "5.weight"].contains(&name) {
            values.fill_with(|| rng.random_range(0.5..1.5));
        }
    });
    let bytes = contents(&network, Precision::Floats).to_bytes().unwrap();
    let pack = Pack::read(&bytes).unwrap();
    assert_eq!(pack.layers().count(), 2);
    let found = quantisation(&pack, &network, &signatures(&mut rng)).unwrap();
    assert!(found.largest < 1e-5 * found.size.max(1.0), "{found:?}");
    assert!(found.size > 0.1, "{found:?}");
}

#[test]
fn what_a_pack_cannot_hold_is_named() {
    let of = |kinds: &[Layer]| {
        let network = Network::zeros(LENGTH, kinds).unwrap();
        layers(&network, Precision::Bytes).unwrap_err().to_string()
    };
    let dense = Layer::Dense { outputs: 4 };
    for (kinds, sentence) in [
        (&[Layer::Tanh, dense][..], "layer 0 of the network, a tanh"),
        (
            &[dense, Layer::Tanh, Layer::Relu],
            "layer 2 of the network, a relu",
        ),
        (
            &[dense, Layer::Relu, Layer::BatchNorm],
            "layer 2 of the network, a batch",
        ),
    ] {
        assert!(of(kinds).starts_with(sentence), "{}", of(kinds));
    }
    // Contents that the board's reader refuses are not written.
    let wide = [
        Layer::Dense { outputs: 200 },
        Layer::Dense { outputs: OUTPUTS },
    ];
    let network = Network::new(LENGTH, &wide, &mut Pcg64Mcg::seed_from_u64(1)).unwrap();
    let width = PackError::Width {
        layer: 0,
        width: 200,
    };
    assert_eq!(
        contents(&network, Precision::Bytes).to_bytes(),
        Err(PackContentsError::Pack(width))
    );
}
