//! Networks exported to ONNX and imported again, and models of PyTorch.

use onecycle_lab::learn::onnx::{Normalisation, OnnxError, export, import};
use onecycle_lab::learn::train::{Layer, Matrix, Network};
use onecycle_lab::workers::OneThread;
use proptest::prelude::*;
use prost::Message;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;

use crate::changed;

const INPUTS: usize = 5;

fn dense(outputs: usize) -> Layer {
    Layer::Dense { outputs }
}

/// A network with random tensors, variances included.
fn drawn(layers: &[Layer], seed: u64) -> Network {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let network = Network::new(INPUTS, layers, &mut rng).unwrap();
    changed(network, |name, values| {
        values.fill_with(|| rng.random_range(0.2..1.2) * [-1.0, 1.0][rng.random_range(0..2)]);
        if name.ends_with("running_var") {
            values.iter_mut().for_each(|value| *value = value.abs());
        }
    })
}

fn inputs(rows: usize) -> Matrix {
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let values = (0..rows * INPUTS).map(|_| rng.random_range(-2.0..2.0));
    Matrix::from_rows(rows, INPUTS, values.collect()).unwrap()
}

fn normalised(inputs: &Matrix, by: &Normalisation) -> Matrix {
    let mut inputs = inputs.clone();
    for i in 0..inputs.rows() {
        let columns = by.offsets.iter().zip(&by.scales);
        for (value, (offset, scale)) in inputs.row_mut(i).iter_mut().zip(columns) {
            *value = (*value - offset) * scale;
        }
    }
    inputs
}

/// The largest difference, relative to the largest number.
fn difference(found: &Matrix, expected: &[f32]) -> f32 {
    assert_eq!(found.values().len(), expected.len());
    let largest = expected
        .iter()
        .fold(0.0_f32, |most, value| most.max(value.abs()));
    assert!(largest > 0.1, "{largest}");
    let both = found.values().iter().zip(expected);
    both.fold(0.0_f32, |most, (found, expected)| {
        most.max((found - expected).abs())
    }) / largest
}

// Nothing is folded, so every bit reads back: -offset scale / scale, in f64, rounds to the offset.
#[test]
fn networks_come_back() {
    let normalisation = Normalisation {
        offsets: vec![0.1, -2.0, 3.3, 0.0, 1e-3],
        scales: vec![3.0, 0.3, 1e3, 1.0, -7.7],
    };
    for layers in [
        &[dense(8), Layer::Tanh, dense(6), Layer::Relu, dense(3)][..],
        &[dense(4), dense(2)],
        &[dense(4), Layer::Relu, Layer::Tanh],
    ] {
        let network = drawn(layers, 1);
        let found = import(&export(&network, None, &[]).unwrap()).unwrap();
        assert_eq!(
            (found.network, found.normalisation),
            (network.clone(), None)
        );
        let bytes = export(&network, Some(&normalisation), &[]).unwrap();
        let found = import(&bytes).unwrap();
        assert_eq!(found.network, network);
        assert_eq!(found.normalisation.as_ref(), Some(&normalisation));
    }
}

#[test]
fn what_only_learning_needs_is_folded_or_dropped() {
    let layers = [
        Layer::BatchNorm,
        dense(8),
        Layer::BatchNorm,
        Layer::Relu,
        Layer::Dropout { probability: 0.4 },
        Layer::BatchNorm,
        dense(3),
    ];
    let network = drawn(&layers, 2);
    let found = import(&export(&network, None, &[]).unwrap())
        .unwrap()
        .network;
    assert_eq!(found.layers(), [dense(8), Layer::Relu, dense(3)]);
    let inputs = inputs(50);
    let expected = network.evaluate(&inputs, &OneThread).unwrap();
    let found = found.evaluate(&inputs, &OneThread).unwrap();
    let difference = difference(&found, expected.values());
    assert!(difference < 1e-6, "{difference}");
}

#[derive(Deserialize)]
struct Golden {
    inputs: Vec<f32>,
    outputs: Vec<f32>,
}

// Seven inputs of the order of 1 through three layers of sums: errors of a few units of 2^-24 = 6e-8.
#[test]
fn pytorch_models_give_pytorchs_numbers() {
    let golden: Golden = serde_json::from_str(include_str!("../golden/torch_onnx.json")).unwrap();
    let rows = golden.inputs.len() / INPUTS;
    let inputs = Matrix::from_rows(rows, INPUTS, golden.inputs).unwrap();
    for bytes in [
        &include_bytes!("../golden/torch_onnx.onnx")[..],
        include_bytes!("../golden/torch_onnx_script.onnx"),
    ] {
        let imported = import(bytes).unwrap();
        let kinds = [dense(7), Layer::Tanh, dense(6), Layer::Relu, dense(3)];
        assert_eq!(imported.network.layers(), kinds);
        let inputs = normalised(&inputs, &imported.normalisation.unwrap());
        let found = imported.network.evaluate(&inputs, &OneThread).unwrap();
        let difference = difference(&found, &golden.outputs);
        assert!(difference < 1e-6, "{difference}");
    }
}

// ---------------------------------------------------------------- models by hand

/// The fields of a model that these tests need, with the field numbers of `onnx.proto`.
#[derive(Clone, PartialEq, Message)]
struct Model {
    #[prost(message, optional, tag = "7")]
    graph: Option<Graph>,
    #[prost(message, repeated, tag = "8")]
    opset_import: Vec<OperatorSet>,
}

#[derive(Clone, PartialEq, Message)]
struct OperatorSet {
    #[prost(int64, tag = "2")]
    version: i64,
}

#[derive(Clone, PartialEq, Message)]
struct Graph {
    #[prost(message, repeated, tag = "1")]
    node: Vec<Node>,
    #[prost(message, repeated, tag = "5")]
    initializer: Vec<Tensor>,
    #[prost(message, repeated, tag = "11")]
    input: Vec<Value>,
    #[prost(message, repeated, tag = "12")]
    output: Vec<Value>,
}

#[derive(Clone, PartialEq, Message)]
struct Node {
    #[prost(string, repeated, tag = "1")]
    input: Vec<String>,
    #[prost(string, repeated, tag = "2")]
    output: Vec<String>,
    #[prost(string, tag = "3")]
    name: String,
    #[prost(string, tag = "4")]
    op_type: String,
    #[prost(message, repeated, tag = "5")]
    attribute: Vec<Attribute>,
    #[prost(string, tag = "7")]
    domain: String,
}

#[derive(Clone, PartialEq, Message)]
struct Attribute {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(float, tag = "2")]
    f: f32,
    #[prost(int64, tag = "3")]
    i: i64,
    #[prost(message, optional, tag = "5")]
    t: Option<Tensor>,
}

#[derive(Clone, PartialEq, Message)]
struct Tensor {
    #[prost(int64, repeated, tag = "1")]
    dims: Vec<i64>,
    #[prost(int32, tag = "2")]
    data_type: i32,
    #[prost(float, repeated, tag = "4")]
    float_data: Vec<f32>,
    #[prost(string, tag = "8")]
    name: String,
    #[prost(int32, tag = "14")]
    data_location: i32,
}

#[derive(Clone, PartialEq, Message)]
struct Value {
    #[prost(string, tag = "1")]
    name: String,
}

fn tensor(name: &str, dims: &[i64], values: &[f32]) -> Tensor {
    Tensor {
        dims: dims.to_vec(),
        data_type: 1,
        float_data: values.to_vec(),
        name: name.to_owned(),
        data_location: 0,
    }
}

fn node(op: &str, inputs: &[&str], output: &str) -> Node {
    Node {
        input: inputs.iter().map(|&name| name.to_owned()).collect(),
        output: vec![output.to_owned()],
        name: format!("the {op}"),
        op_type: op.to_owned(),
        ..Node::default()
    }
}

/// From `x` to `y`, with constants `w` (2 x 3), `r` (3), `s` (one number), `n` (batch norm, 3).
fn model(nodes: &[Node]) -> Model {
    let value = |name: &str| Value {
        name: name.to_owned(),
    };
    Model {
        graph: Some(Graph {
            node: nodes.to_vec(),
            initializer: vec![
                tensor("w", &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
                tensor("r", &[1, 3], &[0.5, -1.0, 2.0]),
                tensor("s", &[], &[4.0]),
                tensor("n", &[3], &[1.0, 1.0, 3.0]),
            ],
            input: vec![value("x"), value("w")],
            output: vec![value("y")],
        }),
        opset_import: vec![OperatorSet { version: 17 }],
    }
}

/// Outputs of the model for the inputs 1 and 10.
fn outputs(nodes: &[Node]) -> Vec<f32> {
    let imported = import(&model(nodes).encode_to_vec()).unwrap();
    let mut inputs = Matrix::from_rows(1, 2, vec![1.0, 10.0]).unwrap();
    if let Some(normalisation) = imported.normalisation {
        inputs = normalised(&inputs, &normalisation);
    }
    let outputs = imported.network.evaluate(&inputs, &OneThread).unwrap();
    outputs.values().to_vec()
}

// x w = 1 + 40, 2 + 50, 3 + 60 = 41, 52, 63.
#[test]
fn nodes_do_what_the_operators_say() {
    let matmul = |to| node("MatMul", &["x", "w"], to);
    assert_eq!(outputs(&[matmul("y")]), [41.0, 52.0, 63.0]);
    for (op, inputs, expected) in [
        ("Add", ["a", "r"], [41.5, 51.0, 65.0]),
        ("Add", ["r", "a"], [41.5, 51.0, 65.0]),
        ("Sub", ["a", "r"], [40.5, 53.0, 61.0]),
        ("Sub", ["r", "a"], [-40.5, -53.0, -61.0]),
        ("Mul", ["a", "s"], [164.0, 208.0, 252.0]),
        ("Div", ["a", "s"], [10.25, 13.0, 15.75]),
    ] {
        let nodes = [matmul("a"), node(op, &inputs, "y")];
        assert_eq!(outputs(&nodes), expected, "{op}");
    }
    // (x - 4) 0.25 before: (-0.75, 1.5) w = 5.25, 6, 6.75.
    let nodes = [
        node("Sub", &["x", "s"], "a"),
        node("Div", &["a", "s"], "b"),
        node("Identity", &["b"], "c"),
        node("MatMul", &["c", "w"], "d"),
        node("Relu", &["d"], "y"),
    ];
    assert_eq!(outputs(&nodes), [5.25, 6.0, 6.75]);
}

// x w^T with w^T as the output of a Constant node: 41 = 1 + 4 * 10 and so on; then 2 x w + 0.5 r.
#[test]
fn gemm_and_constants_in_nodes() {
    let number = |name: &str, f: f32, i: i64| Attribute {
        name: name.to_owned(),
        f,
        i,
        t: None,
    };
    let gemm = |inputs: &[&str], attribute| Node {
        attribute,
        ..node("Gemm", inputs, "y")
    };
    let scaled = vec![number("alpha", 2.0, 0), number("beta", 0.5, 0)];
    assert_eq!(
        outputs(&[gemm(&["x", "w", "r"], scaled)]),
        [82.25, 103.5, 127.0]
    );
    assert_eq!(outputs(&[gemm(&["x", "w"], vec![])]), [41.0, 52.0, 63.0]);
    assert_eq!(
        outputs(&[gemm(&["x", "w", "s"], vec![])]),
        [45.0, 56.0, 67.0]
    );
    let transposed = tensor("", &[3, 2], &[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    let constant = Node {
        attribute: vec![Attribute {
            t: Some(transposed),
            ..number("value", 0.0, 0)
        }],
        ..node("Constant", &[], "wt")
    };
    let nodes = [
        constant,
        node("Identity", &["wt"], "same"),
        gemm(&["x", "same"], vec![number("transB", 0.0, 1)]),
    ];
    assert_eq!(outputs(&nodes), [41.0, 52.0, 63.0]);
}

// (a - mean) / sqrt(var) weight + bias with mean = bias = r and weight = var = (1, 1, 3): for a = (41,
// 52, 63) the third value is 61 / sqrt(3) 3 + 2.
#[test]
fn batch_normalisation_is_evaluated() {
    let epsilon = Attribute {
        name: "epsilon".to_owned(),
        ..Attribute::default()
    };
    let norm = Node {
        attribute: vec![epsilon],
        ..node("BatchNormalization", &["a", "n", "r", "r", "n"], "y")
    };
    let found = outputs(&[node("MatMul", &["x", "w"], "a"), norm]);
    let expected = [41.0, 52.0, 61.0 * 3_f32.sqrt() + 2.0];
    assert!(
        found
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() < 2e-5),
        "{found:?}"
    );
}

#[test]
fn what_cannot_be_read_is_named() {
    let matmul = node("MatMul", &["x", "w"], "a");
    let refused = |nodes: &[Node]| {
        import(&model(nodes).encode_to_vec())
            .unwrap_err()
            .to_string()
    };
    let with = |node: Node| refused(&[matmul.clone(), node]);
    let is_set = |name: &str| Attribute {
        name: name.to_owned(),
        i: 1,
        ..Attribute::default()
    };
    let mut foreign = node("Relu", &["a"], "y");
    foreign.domain = "com.example".to_owned();
    let mut unnamed = node("Softmax", &["a"], "y");
    unnamed.name.clear();
    let mut learning = node("BatchNormalization", &["a", "n", "r", "r", "n"], "y");
    learning.attribute = vec![is_set("training_mode")];
    let mut transposed = node("Gemm", &["x", "w"], "y");
    transposed.attribute = vec![is_set("transA")];
    for (sentence, words) in [
        (
            with(node("Conv", &["a"], "y")),
            "node the Conv, Conv: this operator is not supported",
        ),
        (with(unnamed), "node number 1, Softmax: "),
        (with(foreign), "com.example"),
        (with(node("Relu", &["x"], "y")), "its input is x, not a"),
        (
            with(node("Relu", &["a"], "z")),
            "output y is not the output of its last node",
        ),
        (with(node("Add", &["a", "x"], "y")), "must be a constant"),
        (with(node("Add", &["a", "w"], "y")), "must be a row"),
        (
            with(node("Div", &["s", "a"], "y")),
            "division of a constant",
        ),
        (
            with(node("MatMul", &["a", "r"], "y")),
            "takes 1 inputs, but the layer before it has 3 outputs",
        ),
        (with(node("MatMul", &["a", "n"], "y")), "must be a matrix"),
        (with(node("MatMul", &["w", "a"], "y")), "must be a constant"),
        (with(learning), "eval()"),
        (refused(&[transposed]), "transA is not supported"),
        (refused(&[node("Relu", &["x"], "y")]), "no dense layer"),
        (refused(&[]), "output y is not the output of its last node"),
    ] {
        assert!(sentence.contains(words), "{words}: {sentence}");
        assert!(!sentence.contains('\n'), "{sentence}");
    }
}

#[test]
fn malformed_tensors_are_named() {
    let spoilt = |spoil: fn(&mut Tensor)| {
        let mut model = model(&[node("MatMul", &["x", "w"], "y")]);
        spoil(&mut model.graph.as_mut().unwrap().initializer[0]);
        import(&model.encode_to_vec()).unwrap_err().to_string()
    };
    for (sentence, words) in [
        (spoilt(|w| w.data_location = 1), "external_data=False"),
        (spoilt(|w| w.data_type = 11), "must hold f32"),
        (spoilt(|w| w.dims = vec![2, 4]), "6 numbers"),
        (spoilt(|w| w.dims = vec![-2, 3]), "6 numbers"),
        (spoilt(|w| w.dims = vec![i64::MAX, i64::MAX]), "6 numbers"),
        (spoilt(|w| w.dims = vec![0, 3]), "6 numbers"),
        (spoilt(|w| w.float_data[2] = f32::NAN), "must not hold NaN"),
    ] {
        assert!(sentence.contains(words), "{words}: {sentence}");
    }
}

#[test]
fn malformed_files_are_refused() {
    let bytes = model(&[node("MatMul", &["x", "w"], "y")]).encode_to_vec();
    assert!(import(&bytes).is_ok());
    for bytes in [
        &b"onecycle"[..],
        &[],
        &bytes[..bytes.len() / 2],
        &[0xff; 40],
    ] {
        let error = import(bytes).unwrap_err();
        assert!(
            matches!(error, OnnxError::File(_) | OnnxError::Model(_)),
            "{error}"
        );
    }
    let mut old = model(&[]);
    old.opset_import[0].version = 6;
    let error = import(&old.encode_to_vec()).unwrap_err().to_string();
    assert!(error.contains("opset 6"), "{error}");
    let mut two = model(&[node("MatMul", &["x", "w"], "y")]);
    two.graph.as_mut().unwrap().input[1].name = "z".to_owned();
    let error = import(&two.encode_to_vec()).unwrap_err().to_string();
    assert!(error.contains("more than one input"), "{error}");
}

proptest! {
    // Changes any byte: lengths, names, shapes, operators.
    #[test]
    fn no_change_of_a_model_makes_it_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let mut bytes = include_bytes!("../golden/torch_onnx_script.onnx").to_vec();
        for (index, byte) in changes {
            let index = index.index(bytes.len());
            bytes[index] = byte;
        }
        if let Ok(imported) = import(&bytes) {
            prop_assert_eq!(imported.network.inputs(), INPUTS);
        }
    }
}

#[test]
fn what_cannot_be_written_is_named() {
    let alone = drawn(&[Layer::BatchNorm], 3);
    let error = export(&alone, None, &[]).unwrap_err().to_string();
    assert!(
        error.contains("layer 0") && error.contains("batch normalisation"),
        "{error}"
    );
    let (expected, found) = (INPUTS, 2);
    let normalisation = Normalisation {
        offsets: vec![0.0; found],
        scales: vec![1.0; found],
    };
    assert_eq!(
        export(&drawn(&[dense(2)], 4), Some(&normalisation), &[]),
        Err(OnnxError::Normalisation { expected, found })
    );
    assert!(matches!(
        export(&drawn(&[], 5), None, &[]),
        Err(OnnxError::Layer { .. })
    ));
}
