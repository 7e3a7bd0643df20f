//! Gradients of every layer and every loss compared with central differences.

use onecycle_lab::learn::train::{
    Batch, Dropped, Gaussian, Layer, Loss, Matrix, Network, Tape, TrainError,
};
use onecycle_lab::workers::OneThread;

use super::{dense, network, random, rng};

const DROPPED: Dropped = Dropped { seed: 5, step: 7 };

/// `sum c_ij y_ij` of the outputs in training mode.
fn weighted_sum(network: &Network, inputs: &Matrix, c: &Matrix) -> f64 {
    let mut tape = Tape::default();
    let mut network = network.clone();
    network
        .forward(&mut tape, inputs, DROPPED, &OneThread)
        .unwrap();
    let outputs = tape.outputs().unwrap();
    (outputs.values().iter().zip(c.values()))
        .map(|(y, c)| f64::from(*y) * f64::from(*c))
        .sum()
}

/// Largest error of a gradient over the largest gradient, for all parameters.
///
/// Outputs of size 1 are rounded to 6e-8, which steps of 2^-7 to both sides divide by 0.016. The
/// five-point formula has an error of `h^4/30 = 1e-10` of the fifth derivative.
fn worst_error(network: &Network, inputs: &Matrix) -> f64 {
    const H: f32 = 1.0 / 128.0;
    let c = random(inputs.rows(), network.outputs(), 99);
    let mut tape = Tape::default();
    let mut learning = network.clone();
    learning
        .forward(&mut tape, inputs, DROPPED, &OneThread)
        .unwrap();
    learning.backward(&mut tape, &c, &OneThread).unwrap();

    let numbers = network.numbers();
    let mut gradients = tape.gradients().iter();
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    let mut first = 0;
    for (name, matrix) in network.arrays() {
        let start = first;
        first += matrix.values().len();
        if name.contains("running") {
            continue;
        }
        let gradient = gradients.next().unwrap();
        for (k, slope) in gradient.values().iter().enumerate() {
            let at = |steps: f32| {
                let mut moved = numbers.clone();
                moved[start + k] += steps * H;
                let moved = network.clone().with_numbers(&moved).unwrap();
                weighted_sum(&moved, inputs, &c)
            };
            let difference =
                (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * f64::from(H));
            worst = worst.max((difference - f64::from(*slope)).abs());
            largest = largest.max(difference.abs());
        }
    }
    assert!(gradients.next().is_none());
    worst / largest
}

// The rounding error is about 6e-8/0.016 = 4e-6 per output; a dozen of them are summed.
const TOLERANCE: f64 = 5e-5;

#[test]
fn dense_and_tanh() {
    let network = network(4, &[dense(5), Layer::Tanh, dense(3)], 1);
    let error = worst_error(&network, &random(6, 4, 2));
    assert!(error < TOLERANCE, "{error}");
}

// Two steps of a weight change the input of a ReLU by at most 1/64; every input is farther than that
// from the kink.
#[test]
fn relu() {
    let inputs = random(4, 4, 4);
    let before = network(4, &[dense(5)], 3).evaluate(&inputs, &OneThread);
    let before = before.unwrap();
    assert!(before.values().iter().all(|x| x.abs() > 1.0 / 64.0));
    assert!(before.values().iter().any(|x| *x < 0.0));
    let network = network(4, &[dense(5), Layer::Relu, dense(3)], 3);
    let error = worst_error(&network, &inputs);
    assert!(error < TOLERANCE, "{error}");
}

// The first bias has no effect, because the normalisation removes it; its gradient is zero.
#[test]
fn batch_normalisation() {
    let layers = [dense(5), Layer::BatchNorm, Layer::Tanh, dense(3)];
    let network = network(4, &layers, 5);
    let error = worst_error(&network, &random(16, 4, 6));
    assert!(error < TOLERANCE, "{error}");
}

#[test]
fn dropout() {
    let layers = [
        dense(12),
        Layer::Tanh,
        Layer::Dropout { probability: 0.5 },
        dense(3),
    ];
    let network = network(4, &layers, 7);
    let error = worst_error(&network, &random(6, 4, 8));
    assert!(error < TOLERANCE, "{error}");
}

/// Costs of four classes; one pick is unstable.
fn classified() -> (Matrix, Batch) {
    let mut costs = random(5, 4, 11);
    let classes = vec![2, 0, 1, 1, 3];
    for (i, class) in classes.iter().enumerate() {
        for cost in costs.row_mut(i) {
            *cost = 0.4 * cost.abs();
        }
        costs.row_mut(i)[*class] = 0.0;
    }
    costs.row_mut(1)[3] = f32::INFINITY;
    let batch = Batch {
        inputs: Matrix::zeros(5, 1),
        classes,
        costs,
        values: random(5, 3, 12),
        weights: vec![1.0, 0.5, 2.0, 0.0, 0.25],
    };
    (random(5, 4, 13), batch)
}

/// Largest error of a loss's gradient. Outputs are multiples of the step 2^-10, so only the gradient is
/// rounded, to 6e-8 of its size; `h^4/30` is 3e-14.
fn worst_error_of_loss(loss: Loss, outputs: &Matrix, batch: &Batch) -> f64 {
    const H: f32 = 1.0 / 1024.0;
    let mut gradient = Matrix::default();
    loss.evaluate(outputs, batch, &mut gradient).unwrap();
    let mut worst = 0.0_f64;
    for (k, slope) in gradient.values().iter().enumerate() {
        let at = |steps: f32| {
            let mut moved = outputs.clone();
            moved.values_mut()[k] += steps * H;
            loss.evaluate(&moved, batch, &mut Matrix::default())
                .unwrap()
        };
        let difference =
            (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * f64::from(H));
        worst = worst.max((difference - f64::from(*slope)).abs());
    }
    worst
}

#[test]
fn losses_of_classes() {
    let (outputs, batch) = classified();
    for loss in [
        Loss::CrossEntropy,
        Loss::ModifiedSoftmax { cap: 0.2 },
        Loss::ShiftedSoftmax { cap: 0.2 },
        Loss::CostAugmented {
            scale: 3.0,
            cap: 0.2,
        },
        Loss::ExpectedCost {
            cap: 1.0,
            cross_entropy: 0.0,
            entropy: 0.0,
        },
        Loss::ExpectedCost {
            cap: 1.0,
            cross_entropy: 0.3,
            entropy: 0.1,
        },
    ] {
        let error = worst_error_of_loss(loss, &outputs, &batch);
        assert!(error < 1e-7, "{loss:?} {error}");
    }
}

// Gamma is 1 + J between 1 and 2: J of -0.3, 0 and 7 give 1, 1 and 2, so that with outputs 1, 2, 0.5 all three exponents are
// known, 1, 2 and 1. The gradient of the clamped loss is that of differences.
#[test]
fn gamma_is_clamped() {
    let outputs = Matrix::from_rows(1, 3, vec![1.0, 2.0, 0.5]).unwrap();
    let batch = Batch {
        inputs: Matrix::zeros(1, 1),
        classes: vec![1],
        costs: Matrix::from_rows(1, 3, vec![-0.3, 0.0, 7.0]).unwrap(),
        ..Batch::default()
    };
    let loss = Loss::ModifiedSoftmax { cap: 1.0 };
    let found = loss
        .evaluate(&outputs, &batch, &mut Matrix::default())
        .unwrap();
    let one = 1.0_f64.exp();
    let expected = (2.0 * one + one * one).ln() - 2.0;
    assert!((found - expected).abs() < 1e-12, "{found}");
    let worst = worst_error_of_loss(loss, &outputs, &batch);
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn losses_of_densities() {
    let (_, batch) = classified();
    let loss = Loss::Gaussian { dimension: 3 };
    // Gradients are up to 10, so their rounding is up to 10 times 6e-8.
    let error = worst_error_of_loss(loss, &random(5, 9, 14), &batch);
    assert!(error < 1e-6, "{error}");
}

// Half the square of the distance: (1, 2) from (0, 0) is 2.5, with the slopes 1 and 2.
#[test]
fn loss_of_a_regression() {
    let (_, batch) = classified();
    let loss = Loss::SquaredError { dimension: 3 };
    let error = worst_error_of_loss(loss, &random(5, 3, 14), &batch);
    assert!(error < 1e-6, "{error}");
    let one = Batch {
        inputs: Matrix::zeros(1, 1),
        values: Matrix::zeros(1, 2),
        ..Batch::default()
    };
    let outputs = Matrix::from_rows(1, 2, vec![1.0, 2.0]).unwrap();
    let mut gradient = Matrix::default();
    let loss = Loss::SquaredError { dimension: 2 };
    assert_eq!(loss.evaluate(&outputs, &one, &mut gradient).unwrap(), 2.5);
    assert_eq!(gradient.row(0), [1.0, 2.0]);
}

// The cost of the mean is above its scale for some samples and below it for others. With slopes of
// zero, or a weight of zero, the Gaussian loss is left.
#[test]
fn loss_of_a_density_that_knows_costs() {
    let (_, mut batch) = classified();
    let plain = batch.clone();
    batch.values = random(5, 6, 15);
    let outputs = random(5, 9, 14);
    for (weight, scale) in [(1.0, 0.25), (3.0, 10.0), (0.5, 2.0)] {
        let loss = Loss::CostAwareGaussian {
            dimension: 3,
            weight,
            scale,
        };
        let error = worst_error_of_loss(loss, &outputs, &batch);
        assert!(error < 1e-6, "{loss:?} {error}");
    }

    for (i, row) in plain.values.iter_rows().enumerate() {
        batch.values.row_mut(i)[..3].copy_from_slice(row);
        if i == 2 {
            batch.values.row_mut(i)[3..].fill(0.0);
        }
    }
    let of = |loss: Loss, batch: &Batch| {
        let mut gradient = Matrix::default();
        let value = loss.evaluate(&outputs, batch, &mut gradient).unwrap();
        (value, gradient)
    };
    let aware = |weight| Loss::CostAwareGaussian {
        dimension: 3,
        weight,
        scale: 0.5,
    };
    let gaussian = of(Loss::Gaussian { dimension: 3 }, &plain);
    assert_eq!(of(aware(0.0), &batch), gaussian);
    let (value, gradient) = of(aware(1.0), &batch);
    assert!(value > gaussian.0);
    assert_eq!(gradient.row(2), gaussian.1.row(2));
    assert_ne!(gradient.row(1), gaussian.1.row(1));
}

// One value with a mean 3 above y and a slope of 2, so a cost of 6, at a scale of 8: sqrt(1 + (6/8)^2)
// = 5/4. The density is a standard normal. The loss gains 4 (5/4 - 1) = 1, and its slope of 3 gains 4 *
// 6/64 / (5/4) * 2 = 0.6.
#[test]
fn cost_of_a_mean_by_hand() {
    let batch = Batch {
        inputs: Matrix::zeros(1, 1),
        values: Matrix::from_rows(1, 2, vec![0.0, 2.0]).unwrap(),
        ..Batch::default()
    };
    let outputs = Matrix::from_rows(1, 2, vec![3.0, 0.0]).unwrap();
    let loss = Loss::CostAwareGaussian {
        dimension: 1,
        weight: 4.0,
        scale: 8.0,
    };
    let mut gradient = Matrix::default();
    let value = loss.evaluate(&outputs, &batch, &mut gradient).unwrap();
    let normal = 0.5 * std::f64::consts::TAU.ln() + 4.5;
    assert!((value - normal - 1.0).abs() < 1e-12);
    assert!((gradient.row(0)[0] - 3.6).abs() < 1e-6);
}

// gamma_k (p_k - y_k) by hand: for outputs 0 and ln 2, T = 1, J_0 = 1, p_0 = 1/(1 + 2); for outputs ln
// 2 and 0, p_0 = 4/(4 + 1). With J instead of gamma, as printed in the paper, it would be 0 for k = T.
#[test]
fn gradient_of_the_modified_softmax() {
    let outputs = Matrix::from_rows(2, 2, vec![0.0, 2_f32.ln(), 2_f32.ln(), 0.0]).unwrap();
    let batch = Batch {
        inputs: Matrix::zeros(2, 1),
        classes: vec![1, 1],
        costs: Matrix::from_rows(2, 2, vec![1.0, 0.0, 1.0, 0.0]).unwrap(),
        ..Batch::default()
    };
    let mut gradient = Matrix::default();
    let loss = Loss::ModifiedSoftmax { cap: 1.0 }
        .evaluate(&outputs, &batch, &mut gradient)
        .unwrap();
    assert!(
        (loss - 0.5 * (1.5_f64.ln() + 5_f64.ln())).abs() < 1e-7,
        "{loss}"
    );
    // Divided by two: the mean of two samples.
    for (slope, by_hand) in (gradient.values().iter()).zip([2.0 / 3.0, -1.0 / 3.0, 8.0 / 5.0, -0.8])
    {
        assert!((slope - 0.5 * by_hand).abs() < 1e-7, "{slope}");
    }
}

// A common shift of all outputs does not change the shifted softmax. It changes the paper's loss, which
// is the cause of its degenerate optimum.
#[test]
fn only_the_shifted_softmax_ignores_a_shift() {
    let (outputs, batch) = classified();
    let mut shifted = outputs.clone();
    shifted.values_mut().iter_mut().for_each(|a| *a -= 8.0);
    let value = |loss: Loss, outputs| {
        loss.evaluate(outputs, &batch, &mut Matrix::default())
            .unwrap()
    };
    let loss = Loss::ShiftedSoftmax { cap: 0.2 };
    assert_eq!(value(loss, &outputs), value(loss, &shifted));
    let loss = Loss::ModifiedSoftmax { cap: 0.2 };
    assert!(value(loss, &shifted) < 0.8 * value(loss, &outputs));
}

// `Gaussian`, the public type, agrees with the loss.
#[test]
fn the_loss_is_that_of_the_gaussian() {
    let (_, batch) = classified();
    let outputs = random(5, 9, 15);
    let loss = Loss::Gaussian { dimension: 3 }
        .evaluate(&outputs, &batch, &mut Matrix::default())
        .unwrap();
    let by_type: f64 = (0..5)
        .map(|i| {
            let y: Vec<f64> = batch.values.row(i).iter().map(|y| f64::from(*y)).collect();
            let gaussian = Gaussian::from_outputs(3, outputs.row(i)).unwrap();
            f64::from(batch.weights[i]) / 3.75 * gaussian.negative_log_likelihood(&y)
        })
        .sum();
    assert!((loss - by_type).abs() < 1e-14, "{loss} {by_type}");
    assert_eq!(Gaussian::from_outputs(3, &[0.0; 8]), None);
}

// Two samples, the second with a weight of three, equal four samples of which three are the same.
#[test]
fn weights_count_samples() {
    let (outputs, batch) = classified();
    let pick = |rows: &[usize], weights: &[f32]| {
        let mut picked = Batch::default();
        onecycle_lab::learn::train::Dataset::fill(&batch, rows, &mut picked);
        picked.weights = weights.to_vec();
        let mut values = Vec::new();
        rows.iter().for_each(|&i| values.extend(outputs.row(i)));
        let outputs = Matrix::from_rows(rows.len(), 4, values).unwrap();
        Loss::CrossEntropy
            .evaluate(&outputs, &picked, &mut Matrix::default())
            .unwrap()
    };
    let weighted = pick(&[0, 2], &[1.0, 3.0]);
    assert!((weighted - pick(&[0, 2, 2, 2], &[])).abs() < 1e-15);
}

#[test]
fn what_does_not_fit_is_named() {
    let (outputs, batch) = classified();
    let error = |loss: Loss, change: fn(&mut Batch)| {
        let mut batch = batch.clone();
        change(&mut batch);
        loss.evaluate(&outputs, &batch, &mut Matrix::default())
            .unwrap_err()
            .to_string()
    };
    let softmax = Loss::ShiftedSoftmax { cap: 0.2 };
    let gaussian = Loss::Gaussian { dimension: 2 };
    for (found, sentence) in [
        (
            error(Loss::CrossEntropy, |b| b.classes[0] = 4),
            "there is no class 4: the network has 4 outputs",
        ),
        (
            error(Loss::CrossEntropy, |b| b.weights[0] = -1.0),
            "the weights of the samples must be finite and not negative, and their sum must be positive",
        ),
        (
            error(Loss::CrossEntropy, |b| b.weights = vec![1.0]),
            "the number of weights of samples must be 5, but is 1",
        ),
        (
            error(softmax, |b| b.costs = Matrix::default()),
            "the number of rows of costs must be 5, but is 0",
        ),
        (
            error(gaussian, |_| {}),
            "the number of outputs must be 5, but is 4",
        ),
        (
            error(Loss::ModifiedSoftmax { cap: f64::NAN }, |_| {}),
            "cap must be positive and finite, but is NaN",
        ),
    ] {
        assert_eq!(found, sentence);
    }
}

#[test]
fn networks_refuse_what_they_cannot_take() {
    let mut net = network(4, &[dense(5), Layer::BatchNorm], 1);
    let error = net
        .evaluate(&Matrix::zeros(2, 3), &OneThread)
        .unwrap_err()
        .to_string();
    assert_eq!(error, "the number of inputs must be 4, but is 3");
    let mut tape = Tape::default();
    let one = Matrix::zeros(1, 4);
    assert_eq!(
        net.forward(&mut tape, &one, DROPPED, &OneThread),
        Err(TrainError::OneSample)
    );
    let empty = net.backward(&mut Tape::default(), &one, &OneThread);
    assert!(empty.is_err());
    for (inputs, layer, field) in [
        (0, dense(1), "inputs"),
        (1, dense(0), "outputs"),
        (1 << 20, dense(1 << 20), "outputs"),
        (1, Layer::Dropout { probability: 1.0 }, "probability"),
    ] {
        let error = Network::new(inputs, &[layer], &mut rng(1)).unwrap_err();
        assert!(error.to_string().starts_with(field), "{error}");
    }
}

// Of 100,000 numbers a share of 0.3 is dropped (tolerance: five standard deviations of 0.0014) and the
// others are divided by 0.7. The same step drops the same numbers, the next step others; an evaluation
// drops none.
#[test]
fn dropout_leaves_out_its_share() {
    let mut network = network(1000, &[Layer::Dropout { probability: 0.3 }], 1);
    let ones = Matrix::from_rows(100, 1000, vec![1.0; 100_000]).unwrap();
    let mut draw = |step| {
        let mut tape = Tape::default();
        network
            .forward(&mut tape, &ones, Dropped { seed: 1, step }, &OneThread)
            .unwrap();
        tape.outputs().unwrap().clone()
    };
    let dropped = draw(1);
    let left_out = dropped.values().iter().filter(|x| **x == 0.0).count();
    assert!((left_out as f64 / 1e5 - 0.3).abs() < 0.007, "{left_out}");
    let kept = (1.0_f64 / 0.7) as f32;
    assert!(dropped.values().iter().all(|x| *x == 0.0 || *x == kept));
    assert_eq!(draw(1), dropped);
    assert_ne!(draw(2), dropped);
    assert_eq!(network.evaluate(&ones, &OneThread), Ok(ones));
}

// 50,000 weights have a variance of 2/50 (tolerance: five standard deviations of 2/50 sqrt(2/50,000)).
#[test]
fn initial_weights_are_those_of_he() {
    let network = network(50, &[dense(1000)], 1);
    let mut parameters = network.parameters();
    let weights = parameters.next().unwrap();
    let squares: f64 = (weights.values().iter())
        .map(|w| f64::from(*w).powi(2))
        .sum();
    let ratio = squares / 50_000.0 / (2.0 / 50.0);
    assert!((ratio - 1.0).abs() < 0.032, "{ratio}");
    assert!(
        parameters
            .next()
            .unwrap()
            .values()
            .iter()
            .all(|b| *b == 0.0)
    );
}
