//! Packs of networks: the same outputs on board as where they learnt, and everything comes back.

use onecycle_lab::learn::pack::{
    LeadTableContents, PackContents, PackContentsError, PackedWeights, Precision, layers,
    network_of_tensors, quantisation,
};
use onecycle_lab::learn::train::{Layer, Matrix, Network, Tensor, TensorFile};
use onecycle_lab::workers::OneThread;
use onecycle_onboard::network::Activation;
use onecycle_onboard::pack::{Domain, OUTPUTS, OutputScaling, Pack, PackError, Prior};
use onecycle_onboard::signature::LENGTH;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const HIDDEN: usize = 32;

/// Samples that networks are compared on.
const SAMPLES: usize = 1000;

/// 34-32-32-14 with drawn weights and biases.
fn drawn(activation: Layer, rng: &mut Pcg64Mcg) -> Network {
    let layers = [
        Layer::Dense { outputs: HIDDEN },
        activation,
        Layer::Dense { outputs: HIDDEN },
        activation,
        Layer::Dense { outputs: OUTPUTS },
    ];
    let mut network = Network::new(LENGTH, &layers, rng).unwrap();
    let mut file = TensorFile::from_bytes(&network.save()).unwrap();
    for tensor in &mut file.tensors {
        if tensor.name.ends_with("bias") {
            (tensor.values).fill_with(|| rng.random_range(-0.5..0.5));
        }
    }
    network.load(&file.to_bytes()).unwrap();
    network
}

/// A pack of the network, what the network sees of a signature being between -1 and 1.
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

// Sums of 34 and 32 terms near one in another order: a few units of 2^-24 = 6e-8 a layer, and the
// outputs are of the order of one.
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

// A weight is off by up to half a step, evenly: s / sqrt(12) for steps s of a 127th of the row's
// largest, some 2.2 standard deviations sqrt(2 / 34) of the weights: 0.5 % of it, thus 0.5 % of the
// size of the sums a layer, in three layers 0.9 % of the outputs; the largest of 14,000 some four
// or five times that, 4 %.
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

// Half a step of each row, and the largest weight exactly 127 steps.
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

// 0 0 has no scale; of -2 1 a step is 2 / 127 and 1 is 63.5 of them, away from zero.
#[test]
fn rows_of_zeros_stay_zeros() {
    let mut network = Network::zeros(2, &[Layer::Dense { outputs: 2 }]).unwrap();
    let mut file = TensorFile::from_bytes(&network.save()).unwrap();
    file.tensors[0].values[2..].copy_from_slice(&[-2.0, 1.0]);
    network.load(&file.to_bytes()).unwrap();
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
        // The same contents, the same bytes.
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

// Batch normalisation is folded and dropout dropped.
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
    let mut network = Network::new(LENGTH, &kinds, &mut rng).unwrap();
    let mut file = TensorFile::from_bytes(&network.save()).unwrap();
    for tensor in &mut file.tensors {
        if tensor.shape.len() == 1 {
            (tensor.values).fill_with(|| rng.random_range(0.5..1.5));
        }
    }
    network.load(&file.to_bytes()).unwrap();
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
    // What the board's reader refuses is not written.
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

// ---------------------------------------------------------------- tensors without their layers

const TANH: [Activation; 3] = [Activation::Tanh, Activation::Tanh, Activation::None];

#[test]
fn tensors_and_activations_are_a_network() {
    let network = drawn(Layer::Tanh, &mut Pcg64Mcg::seed_from_u64(25));
    let found = network_of_tensors(&network.save(), &TANH).unwrap();
    assert_eq!(found, network);

    // Linear, BatchNorm1d, ReLU, Dropout, Linear: the first number without tensors is the relu's.
    let kinds = [
        Layer::Dense { outputs: 3 },
        Layer::BatchNorm,
        Layer::Relu,
        Layer::Dropout { probability: 0.5 },
        Layer::Dense { outputs: 2 },
    ];
    let network = Network::new(2, &kinds, &mut Pcg64Mcg::seed_from_u64(26)).unwrap();
    let activations = [Activation::Relu, Activation::None];
    let found = network_of_tensors(&network.save(), &activations).unwrap();
    let inputs = Matrix::from_rows(1, 2, vec![0.5, -1.5]).unwrap();
    assert_eq!(
        found.evaluate(&inputs, &OneThread),
        network.evaluate(&inputs, &OneThread)
    );
    assert_eq!(found.layers()[2], Layer::Relu);
}

#[derive(serde::Deserialize)]
struct Golden {
    inputs: Vec<f32>,
    evaluated: Vec<f32>,
}

// Linear, BatchNorm1d, ReLU, Dropout, Linear of PyTorch, and its numbers in float64: two layers of
// sums of 5 and 8 terms near one, a few units of 6e-8.
#[test]
fn pytorch_tensors_are_read() {
    let golden = include_str!("../golden/torch_steps.json");
    let golden: Golden = serde_json::from_str(golden).unwrap();
    let bytes = include_bytes!("../golden/torch_steps.safetensors");
    let network = network_of_tensors(bytes, &[Activation::Relu, Activation::None]).unwrap();
    let rows = golden.inputs.len() / network.inputs();
    let inputs = Matrix::from_rows(rows, network.inputs(), golden.inputs).unwrap();
    let found = network.evaluate(&inputs, &OneThread).unwrap();
    assert_eq!(found.values().len(), golden.evaluated.len());
    for (found, expected) in found.values().iter().zip(golden.evaluated) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
}

#[test]
fn tensors_of_other_networks_are_refused() {
    let network = drawn(Layer::Tanh, &mut Pcg64Mcg::seed_from_u64(27));
    let refused = |bytes: &[u8], activations: &[Activation]| {
        let error = network_of_tensors(bytes, activations).unwrap_err();
        error.to_string()
    };
    let depth = refused(&network.save(), &TANH[1..]);
    assert!(
        depth.starts_with("the file has 3 dense layers where the pack has 2"),
        "{depth}"
    );
    let gap = refused(
        &Network::zeros(2, &[Layer::Dense { outputs: 2 }; 3])
            .unwrap()
            .save(),
        &TANH,
    );
    assert!(gap.contains("behind layer 0"), "{gap}");
    for name in [
        "conv.weight",
        "0",
        "x.0.weight",
        "1.kernel",
        "4000000000.bias",
    ] {
        let file = TensorFile {
            tensors: vec![Tensor {
                name: name.to_owned(),
                shape: vec![1],
                values: vec![0.0],
            }],
            ..TensorFile::default()
        };
        let sentence = refused(&file.to_bytes(), &TANH);
        assert!(
            sentence.starts_with(&format!("tensor {name} is not named")),
            "{sentence}"
        );
    }
    let wide = |outputs, inputs| Network::zeros(inputs, &[Layer::Dense { outputs }]).unwrap();
    let mut file = TensorFile::from_bytes(&wide(20, 3).save()).unwrap();
    for mut tensor in wide(2, 9).tensors() {
        tensor.name = tensor.name.replace("0.", "2.");
        file.tensors.push(tensor);
    }
    assert_eq!(
        refused(&file.to_bytes(), &TANH[1..]),
        "tensor 2.weight must have shape [2, 20], but has [2, 9]"
    );
    let cut = network.save();
    assert!(refused(&cut[..cut.len() - 1], &TANH).contains("claims bytes"));
    assert!(refused(b"no", &TANH).contains("not safetensors"));
}
