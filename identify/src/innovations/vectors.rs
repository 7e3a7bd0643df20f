//! Numbers of an independent implementation (Python, numpy) on a data set that everybody can make.

use onecycle_design::state_space::StateSpace;
use onecycle_design::{Linear, Structure};

use super::lifted::{Lifted, Sample};
use super::likelihood::{Memory, evaluate};
use super::record::{Blocks, Hold, Record};
use super::response::sums;
use super::theta::{NoiseKind, Theta};

/// Sample period (s).
const DT_S: f64 = 0.02;

/// Noise of a linear congruential generator, four numbers a sample.
fn noise(count: usize) -> Vec<f64> {
    let mut s: u64 = 1;
    let mut uniform = || {
        s = (1_103_515_245 * s + 12345) % (1 << 31);
        s as f64 / f64::from(1_u32 << 31) - 0.5
    };
    (0..count)
        .map(|_| (0..4).map(|_| uniform()).sum())
        .collect()
}

/// A relay-like input that halves its amplitude, on an integrator with two lags and a slow disturbance (Euler steps).
pub(super) fn data(count: usize) -> Record {
    let mut input: Vec<f64> = (0..count)
        .map(|k| if k / 9 % 2 == 0 { 1.0 } else { -1.0 })
        .collect();
    input[count / 2..].iter_mut().for_each(|u| *u *= 0.5);
    let (mut p, mut v, mut l) = (0.0, 0.0, 0.0);
    let mut output = vec![0.0; count];
    for k in 0..count - 1 {
        p += DT_S * v;
        v += DT_S * (l + 0.2 + 0.1 * (0.05 * k as f64).sin() - 0.4 * v);
        l += DT_S / 0.08 * (input[k.saturating_sub(2)] - l);
        output[k + 1] = p;
    }
    for (y, n) in output.iter_mut().zip(noise(count)) {
        *y += 0.0005 * n;
    }
    Record::even(DT_S, input, output)
}

fn close(found: f64, expected: f64, relative: f64, what: &str) {
    let error = (found - expected).abs();
    assert!(
        error <= relative * expected.abs(),
        "{what}: {found} is not {expected}"
    );
}

/// Structure, its unknowns but the noise, and the noise frequencies w1, w0.
fn theta(structure: Structure, process: &[f64], w1: f64, w0: f64) -> Theta {
    let mut theta = Theta::new(structure);
    theta.values[..process.len()].copy_from_slice(process);
    theta.set_noise(NoiseKind::RandomWalk, w1);
    theta.set_noise(NoiseKind::WhiteForce, w0);
    theta
}

fn sample() -> Sample<4> {
    let process = Linear::new(Structure::Soiptd)
        .with_lags_s([0.05, 1.0])
        .with_pole_per_s(0.5);
    let model = StateSpace::<4>::new(&process);
    let mut intensity = [[0.0; 4]; 4];
    intensity[1][1] = 0.32;
    intensity[3][3] = 14.58;
    Sample {
        phi: model.step(DT_S).phi,
        c: [0.0, 0.0, 1.0, 0.0],
        q: model.covariance(&intensity, DT_S),
        noise: 1.0,
    }
}

#[test]
fn blocks_with_their_steady_filter() {
    let four = [2.0335425587e-03, 1.1861191879e-01, 4.0, 2.7761624177e-03];
    let s_of_four = [0.0, 9.0627604051e-04, 5.6464086613e-05, 6.9510389911e-04];
    let p_of_four = [0.0, 1.4562566278, 1.1970777853e-01, 1.0235450136e+01];
    let gain_of_four = [0.0, 2.6828315271e-01, 1.0348717698e-01, 4.3129131898e-01];
    let p_of_one = [0.0, 1.4468265265, 1.1901676482e-01, 1.0202052325e+01];
    let gain_of_one = [0.0, 3.0609559277e-01, 1.1240852666e-01, 5.1047615835e-01];
    let one = [0.0, 0.0, 1.0, 0.0];
    let cases = [
        (1, one, [0.0; 4], 1.0, p_of_one, 1.1190167648, gain_of_one),
        (
            4,
            four,
            s_of_four,
            4.0000655760,
            p_of_four,
            6.2705563858,
            gain_of_four,
        ),
    ];
    for (count, c, s, r, p, variance, gain) in cases {
        let block = Lifted::of_full(&sample(), count);
        let steady = block.steady_covariance().unwrap();
        let (found_gain, found_variance) = block.gain(&steady);
        for i in 0..4 {
            close(block.c[i], c[i], 2e-10, "C");
            close(block.s[i], s[i], 2e-10, "S");
            close(steady[i][i], p[i], 2e-10, "P");
            close(found_gain[i], gain[i], 2e-10, "K");
        }
        close(block.r, r, 2e-10, "R");
        close(found_variance, variance, 2e-10, "variance");
    }
}

#[test]
fn a_block_with_an_absent_sample() {
    let block = Lifted::of_mask(&sample(), &[true, false, true, true]);
    let c = [1.8583459021e-03, 9.8711586289e-02, 3.0, 2.5768274211e-03];
    let s = [0.0, 8.4335769007e-04, 5.1817761929e-05, 6.7571240207e-04];
    for i in 0..4 {
        close(block.c[i], c[i], 2e-10, "C");
        close(block.s[i], s[i], 2e-10, "S");
    }
    close(block.r, 3.0000537159, 2e-10, "R");
}

#[test]
fn the_data_set() {
    let record = data(120);
    let expected = [
        (1, 2.4013038259e-05),
        (10, 1.1665242094e-02),
        (60, 2.7403291937e-01),
        (119, 6.9013145366e-01),
    ];
    for (k, y) in expected {
        close(record.output[k], y, 2e-10, "y");
    }
}

fn uneven(count: usize) -> Record {
    let mut record = data(count);
    let stamp = |k: usize| DT_S * k as f64 + 0.3 * DT_S * (k as f64).sin();
    record.uneven_s = (0..count).map(stamp).collect();
    let mut steps: Vec<f64> = record.uneven_s.windows(2).map(|t| t[1] - t[0]).collect();
    steps.sort_by(f64::total_cmp);
    record.dt_s = steps[steps.len() / 2];
    record
}

#[test]
fn responses_with_fractional_long_and_negative_dead_time() {
    let held = data(120);
    let mut interpolated = data(120);
    interpolated.hold = Hold::Interpolated;
    let short = 2.1326767126e-03;
    let cases = [
        (
            &held,
            0.033,
            [short, 3.8296365608e-02, 1.0414076712e-01, 1.7894486470e-01],
        ),
        (
            &interpolated,
            0.033,
            [short, 3.5551719163e-02, 9.5794175673e-02, 1.6590710790e-01],
        ),
        (
            &held,
            -0.01,
            [short, 2.5828903180e-02, 6.8374495167e-02, 1.2272128044e-01],
        ),
        (
            &held,
            0.25,
            [short, 5.8894537082e-02, 2.7123150542e-01, 4.6123348996e-01],
        ),
        (
            &uneven(120),
            0.033,
            [
                1.8259772035e-03,
                3.9284953060e-02,
                1.2626394512e-01,
                2.3113775130e-01,
            ],
        ),
    ];
    let process = Linear::new(Structure::Soiptd)
        .with_lags_s([0.05, 1.0])
        .with_pole_per_s(0.5);
    let model = StateSpace::<4>::new(&process);
    for (record, tau_s, expected) in cases {
        let g = sums(&model, &Blocks::new(record, 1, 0.0), tau_s);
        for (k, expected) in [5, 20, 61, 119].into_iter().zip(expected) {
            close(g[k], expected, 2e-10, "g");
        }
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of numbers")]
fn likelihoods() {
    use Structure::{DoubleIntegratorLag, Foptd, Iptd, ResonantLag, Soiptd, Soptd, Toiptd};
    let ln = f64::ln;
    let absent = [37, 60, 61];
    // Structure, unknowns, w1, w0, samples a block, absent samples; ln L, gain, variance, sum ln S, ln|X'X| - ln|X0'X0|.
    type Case<'a> = (Structure, Vec<f64>, f64, f64, usize, &'a [usize], [f64; 5]);
    let cases: [Case<'_>; 11] = [
        (
            Soiptd,
            vec![ln(0.05), 0.5, 0.033],
            3.0,
            0.0,
            1,
            &[],
            [
                470.54124399,
                5.9936430860e-01,
                1.1174279452e-05,
                12.71366864,
                -11.75408513,
            ],
        ),
        (
            Soiptd,
            vec![ln(0.05), 0.5, 0.033],
            0.0,
            2.0,
            1,
            &[],
            [
                432.69631770,
                4.7430727901e-01,
                2.2402826851e-05,
                5.45624704,
                -5.31978482,
            ],
        ),
        (
            Soiptd,
            vec![ln(0.05), 0.5, 0.033],
            3.0,
            2.0,
            4,
            &[],
            [
                66.02343932,
                5.6834083822e-01,
                4.5232379605e-05,
                51.40422248,
                -18.63723426,
            ],
        ),
        (
            Soiptd,
            vec![ln(0.05), 0.5, 0.033],
            3.0,
            2.0,
            4,
            &absent,
            [
                66.42349083,
                5.8128170084e-01,
                4.5205361314e-05,
                50.47560974,
                -18.49498204,
            ],
        ),
        (
            Soiptd,
            vec![ln(0.05), 0.0, 0.0],
            0.0,
            0.0,
            1,
            &[],
            [402.09428240, 3.1015036889e-01, 3.9127610045e-05, 0.0, 0.0],
        ),
        (
            Soptd,
            vec![ln(0.05), 2.0, 0.033],
            3.0,
            0.0,
            1,
            &[],
            [
                156.81339323,
                9.3185486638e-02,
                3.4151916591e-03,
                6.18795621,
                -4.39219225,
            ],
        ),
        (
            Foptd,
            vec![3.0, 0.033],
            3.0,
            0.0,
            1,
            &absent,
            [
                114.05358003,
                7.5701790724e-02,
                7.1147496754e-03,
                4.99820143,
                -3.36517159,
            ],
        ),
        (
            Iptd,
            vec![0.033],
            2.0,
            0.0,
            1,
            &[],
            [
                315.33450887,
                9.0068433016e-03,
                2.0842002095e-04,
                6.50538238,
                -5.70965108,
            ],
        ),
        (
            ResonantLag,
            vec![ln(0.05), 1.0, 30.0, 0.033],
            3.0,
            0.0,
            2,
            &[],
            [
                -15.51908152,
                -1.5882625217,
                5.2565974723e-02,
                42.24118662,
                -5.59694672,
            ],
        ),
        (
            DoubleIntegratorLag,
            vec![ln(0.05), 0.033],
            3.0,
            1.0,
            1,
            &[],
            [
                446.39486685,
                5.0172768765e-01,
                1.7331284226e-05,
                13.81416842,
                -12.84067062,
            ],
        ),
        (
            Toiptd,
            vec![ln(0.05), ln(0.02), 0.4, 0.033],
            3.0,
            0.0,
            1,
            &[],
            [
                463.64863449,
                7.3962509304e-01,
                1.1730245886e-05,
                12.92079844,
                -12.03261491,
            ],
        ),
    ];
    for (structure, process, w1, w0, samples, absent, expected) in cases {
        let mut record = data(120);
        absent.iter().for_each(|&k| record.present[k] = false);
        let (log_s, log_x) = check(
            &record,
            samples,
            &theta(structure, &process, w1, w0),
            expected,
        );
        let name = structure.name();
        assert!((log_s - expected[3]).abs() < 2e-8, "{name}: {log_s}");
        assert!((log_x - expected[4]).abs() < 2e-7, "{name}: {log_x}");
    }
    // Uneven stamps: the two determinants depend on the covariance that the filter starts from, their sum does not.
    let expected = [
        512.28284582,
        1.2149279719,
        4.8225240989e-06,
        12.78217922,
        -12.27524376,
    ];
    let soiptd = theta(Soiptd, &[ln(0.05), 0.5, 0.033], 3.0, 0.0);
    let (log_s, log_x) = check(&uneven(120), 1, &soiptd, expected);
    assert!((log_s + log_x - expected[3] - expected[4]).abs() < 2e-7);
}

/// Checks likelihood, gain and variance, and returns the two determinants.
fn check(record: &Record, samples: usize, theta: &Theta, expected: [f64; 5]) -> (f64, f64) {
    let blocks = Blocks::new(record, samples, 0.1);
    let found = evaluate(&blocks, theta, &mut Memory::default()).unwrap();
    let [likelihood, gain, variance, _, _] = expected;
    let name = theta.structure.name();
    close(found.gain, gain, 1e-9, name);
    close(found.variance, variance, 1e-9, name);
    assert!(
        (found.log_likelihood_in_output_units - likelihood).abs() < 2e-7,
        "{name} {}",
        found.log_likelihood_in_output_units
    );
    found.determinants
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of numbers")]
fn best_points_with_their_covariance() {
    use super::descent::{Patience, descend};
    use super::laplace::Laplace;
    use super::near_lags::NearLags;
    use super::theta::Bounds;

    // Samples a block, kind of noise; T, a, tau, w, gain, ln L, variance; deviations of ln T, a, tau, ln w, gain.
    let cases = [
        (
            1,
            NoiseKind::RandomWalk,
            [
                0.0724315,
                0.5482979,
                0.06000601,
                12.962674,
                1.05198827,
                3814.6517046,
                9.1047220248e-08,
            ],
            [3.1056e-01, 3.3379e-01, 8.6855e-03, 4.2885e-02, 2.0159e-01],
        ),
        (
            3,
            NoiseKind::RandomWalk,
            [
                0.0998265,
                0.4627307,
                0.05120661,
                13.445180,
                1.30678187,
                1069.2040133,
                7.4568419651e-08,
            ],
            [3.6083e-01, 3.4310e-01, 8.9777e-03, 4.8379e-02, 3.5626e-01],
        ),
        (
            1,
            NoiseKind::WhiteForce,
            [
                0.0808300,
                0.5193686,
                0.05702680,
                25.855543,
                1.13044775,
                3762.9033080,
                8.7666572320e-08,
            ],
            [3.5755e-01, 1.0676e-01, 9.7275e-03, 4.7161e-02, 2.6980e-01],
        ),
    ];
    for (samples, kind, best, deviations) in cases {
        let record = data(600);
        let blocks = Blocks::new(&record, samples, 0.1);
        let mut start = theta(Structure::Soiptd, &[0.05_f64.ln(), 0.5, 0.05], 0.0, 0.0);
        start.set_noise(kind, 2.0);
        let bounds = Bounds::new(&Theta::new(Structure::Soiptd), &blocks, 0.3);
        let patience = Patience {
            steps: 100,
            decrease: 1e-13,
        };
        let free = start.free();
        let found = descend(&blocks, &start, &free, &bounds, patience).unwrap();
        let [t, a, tau, w, gain, likelihood, variance] = best;
        close(found.theta.values[0].exp(), t, 1e-5, "T");
        close(found.theta.values[1], a, 1e-5, "a");
        close(found.theta.tau_s(), tau, 1e-5, "tau");
        close(found.theta.noise(kind), w, 1e-5, "w");
        close(found.at.gain, gain, 1e-5, "gain");
        close(found.at.variance, variance, 1e-5, "variance");
        assert!((found.at.log_likelihood_in_output_units - likelihood).abs() < 1e-6);
        let laplace =
            Laplace::new(&blocks, &found, (&free, &NearLags::default()), &bounds).unwrap();
        assert_eq!(laplace.free, free);
        for (slot, deviation) in deviations[..4].iter().enumerate() {
            let found = laplace.covariance[slot][slot].sqrt();
            close(found, *deviation, 1e-3, "deviation");
        }
        close(
            laplace.gain_deviation(&found),
            deviations[4] / gain,
            1e-3,
            "deviation of the gain",
        );
    }
}
