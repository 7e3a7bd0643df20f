//! Noise and rounding of the sensor against their predicted statistics.

use onecycle_plant::{Noise, Sensor};

const READINGS: usize = 100_000;

fn errors(sensor: &Sensor, output: f64) -> Vec<f64> {
    let mut noise = Noise::from_seed(7);
    (0..READINGS)
        .map(|_| sensor.read(output, &mut noise) - output)
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / values.len() as f64
}

// For n normal readings the mean has a standard error of sigma / sqrt(n), the variance of sqrt(2/n) of itself, a
// product of neighbours of sigma^2 / sqrt(n): three of each.
#[test]
fn noise_is_white_with_the_given_sigma() {
    let sigma = 0.02;
    let errors = errors(&Sensor::noisy(sigma), 1.5);
    let n = READINGS as f64;
    assert!(mean(&errors).abs() < 3.0 * sigma / n.sqrt());
    assert!((variance(&errors) / (sigma * sigma) - 1.0).abs() < 3.0 * (2.0 / n).sqrt());
    let neighbours: Vec<f64> = errors.windows(2).map(|pair| pair[0] * pair[1]).collect();
    assert!(mean(&neighbours).abs() < 3.0 * sigma * sigma / n.sqrt());
    // Normal: the fourth moment is three sigma^4, with a standard error sqrt(96 / n) of sigma^4.
    let fourth = mean(
        &errors
            .iter()
            .map(|error| (error / sigma).powi(4))
            .collect::<Vec<_>>(),
    );
    assert!((fourth - 3.0).abs() < 3.0 * (96.0 / n).sqrt(), "{fourth}");
}

// A quantum of a quarter (a power of two, so multiples are exact): 0.3 reads 0.25, 0.38 reads 0.5.
#[test]
fn readings_are_multiples_of_the_quantum() {
    let sensor = Sensor::default().with_quantum(0.25);
    let mut noise = Noise::from_seed(0);
    for (output, reading) in [
        (0.3, 0.25),
        (0.38, 0.5),
        (-0.3, -0.25),
        (0.0, 0.0),
        (7.26, 7.25),
    ] {
        assert_eq!(sensor.read(output, &mut noise), reading);
    }
}

// Noise several quanta wide makes rounding an independent uniform error: variance + q^2 / 12.
#[test]
fn rounding_adds_a_twelfth_of_the_squared_quantum() {
    let (sigma, quantum) = (0.02, 0.03);
    let errors = errors(&Sensor::noisy(sigma).with_quantum(quantum), 0.4);
    let expected = sigma * sigma + quantum * quantum / 12.0;
    let tolerance = 3.0 * (2.0 / READINGS as f64).sqrt();
    assert!((variance(&errors) / expected - 1.0).abs() < tolerance);
}

#[test]
fn a_perfect_sensor_draws_nothing() {
    let mut used = Noise::from_seed(3);
    assert_eq!(Sensor::default().read(0.123, &mut used), 0.123);
    assert_eq!(used, Noise::from_seed(3));
}

// 5 % of 100,000: 5,000 with a standard deviation of 69. Each is off by exactly 3, half of them upwards (35).
#[test]
fn outliers_have_their_share_and_size() {
    let errors = errors(&Sensor::default().with_outliers(0.05, 3.0), 0.0);
    let [up, down] = [3.0, -3.0].map(|size| errors.iter().filter(|e| **e == size).count() as f64);
    assert!((up + down - 5000.0).abs() < 210.0, "{up} {down}");
    assert!((up - down).abs() < 3.0 * 71.0, "{up} {down}");
    let clean = errors.iter().filter(|error| **error == 0.0).count() as f64;
    assert_eq!(clean + up + down, READINGS as f64);
}
