//! Whiteness of residuals: autocorrelation and Ljung-Box test.
//!
//! If a model explains a recording, its residuals are white noise.
//!
//! ```text
//! r_k = sum_t (e_t - m)(e_(t+k) - m) / sum_t (e_t - m)^2          k = 1 .. lags
//! Q   = n (n + 2) sum_k r_k^2 / (n - k)
//! ```
//!
//! | symbol | meaning |
//! |--------|---------|
//! | `e_t` | residuals at even times, `n` of them, with the mean `m` |
//! | `r_k` | autocorrelation at the lag `k` |
//! | `Q` | portmanteau statistic |
//!
//! For white residuals each `r_k` is Gaussian with the standard deviation `1/sqrt(n)`, and `Q` has a chi-square
//! distribution with `lags - parameters` degrees of freedom, where `parameters` is the number of fitted parameters. All
//! results are ratios, so the unit of the residuals does not matter.
//!
//! Reference: G. M. Ljung, G. E. P. Box, "On a measure of lack of fit in time series models",
//! Biometrika 65 (1978).

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Autocorrelation of residuals and test for whiteness. For symbols see the [module](self).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Whiteness {
    /// Autocorrelations `r_k` at the lags `1..=lags`, each between -1 and 1.
    pub autocorrelation: Vec<f64>,
    /// Half width of the band that holds 95 % of the autocorrelations of white residuals: `1.96/sqrt(n)`.
    pub band: f64,
    /// Portmanteau statistic `Q` of Ljung and Box.
    pub portmanteau: f64,
    /// Probability that white residuals have a larger `Q`.
    pub probability: f64,
    /// Number of lags whose autocorrelation is outside the band; 5 % of the lags for white residuals.
    pub outside: usize,
}

/// Number of standard deviations on either side that hold 95 % of a Gaussian.
const BAND_DEVIATIONS: f64 = 1.96;
/// Standard deviation of the residuals, as a fraction of the largest, below which they differ by rounding only.
const ROUNDING: f64 = 1e-12;

/// Tests `residuals`, in order and at even times, for whiteness at the first `lags` lags, after a fit of `parameters`
/// parameters.
///
/// `None` if there are not more residuals than lags or not more lags than parameters, if all residuals are equal, or if
/// one is not finite.
#[must_use]
pub fn whiteness(residuals: &[f64], lags: usize, parameters: usize) -> Option<Whiteness> {
    if residuals.len() <= lags || lags <= parameters {
        return None;
    }
    let count = residuals.len() as f64;
    let largest = (residuals.iter()).fold(0.0_f64, |largest, residual| largest.max(residual.abs()));
    // In units of the largest residual no square overflows or vanishes. If all are zero, this gives NaN, refused below.
    let scaled: Vec<f64> = residuals
        .iter()
        .map(|residual| residual / largest)
        .collect();
    let mean = scaled.iter().sum::<f64>() / count;
    let about_mean: Vec<f64> = scaled.iter().map(|value| value - mean).collect();
    let product = |lag: usize| -> f64 {
        let later = about_mean.iter().skip(lag);
        about_mean.iter().zip(later).map(|(a, b)| a * b).sum()
    };
    let squares = product(0);
    let varies = squares > count * ROUNDING * ROUNDING;
    if !(varies && squares.is_finite()) {
        return None;
    }
    let autocorrelation: Vec<f64> = (1..=lags).map(|lag| product(lag) / squares).collect();
    let weighted =
        (autocorrelation.iter().enumerate()).map(|(index, r)| r * r / (count - (index + 1) as f64));
    let portmanteau = count * (count + 2.0) * weighted.sum::<f64>();
    let chi_square = ChiSquared::new((lags - parameters) as f64).ok()?;
    let band = BAND_DEVIATIONS / count.sqrt();
    Some(Whiteness {
        band,
        portmanteau,
        probability: chi_square.sf(portmanteau),
        outside: autocorrelation.iter().filter(|r| r.abs() > band).count(),
        autocorrelation,
    })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Autoregressive noise `e_t = memory e_(t-1) + white noise`, without its first 50 values.
    fn noise(seed: u64, count: usize, memory: f64) -> Vec<f64> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut last = 0.0;
        let mut step = || {
            let white: f64 = StandardNormal.sample(&mut rng);
            last = memory * last + white;
            last
        };
        (0..50 + count).map(|_| step()).skip(50).collect()
    }

    // 1, 2, 3, 4 about their mean 2.5: -1.5, -0.5, 0.5, 1.5, sum of squares 5. r_1 = (0.75 - 0.25 + 0.75)/5 = 0.25,
    // r_2 = (-0.75 - 0.75)/5 = -0.3, Q = 4 6 (0.0625/3 + 0.09/2) = 1.58, band 1.96/2 = 0.98. Two degrees of freedom:
    // probability exp(-0.79). With one parameter, one degree of freedom: erfc(sqrt(0.79)) = 0.2087607.
    #[test]
    fn four_numbers_by_hand() {
        let found = whiteness(&[1.0, 2.0, 3.0, 4.0], 2, 0).unwrap();
        for (r, expected) in found.autocorrelation.iter().zip([0.25, -0.3]) {
            assert!((r - expected).abs() < 1e-15, "{found:?}");
        }
        assert!((found.portmanteau - 1.58).abs() < 1e-14, "{found:?}");
        assert!(
            (found.probability - (-0.79_f64).exp()).abs() < 1e-13,
            "{found:?}"
        );
        assert!((found.band - 0.98).abs() < 1e-15);
        assert_eq!(found.outside, 0);
        let fitted = whiteness(&[1.0, 2.0, 3.0, 4.0], 2, 1).unwrap();
        assert!(
            (fitted.probability - 0.208_760_7).abs() < 1e-7,
            "{fitted:?}"
        );
    }

    // 100 alternating residuals +1, -1: r_k = (-1)^k (100 - k)/100 and Q = 100 102 sum (100 - k)/1e4
    // = 1.02 (99 + 98 + 97) = 299.88. A unit and an offset change nothing.
    #[test]
    fn alternating_residuals_by_hand() {
        for (unit, offset) in [(1.0, 0.0), (1e-200, 0.0), (1e200, 0.0), (1.0, 1000.0)] {
            let residuals: Vec<f64> = (0..100)
                .map(|k| offset + if k % 2 == 0 { unit } else { -unit })
                .collect();
            let found = whiteness(&residuals, 3, 0).unwrap();
            for (r, expected) in found.autocorrelation.iter().zip([-0.99, 0.98, -0.97]) {
                assert!((r - expected).abs() < 1e-12, "{found:?}");
            }
            assert!((found.portmanteau - 299.88).abs() < 1e-9, "{found:?}");
            assert_eq!(found.outside, 3);
            assert!(found.probability < 1e-60);
        }
    }

    // 5 % points from tables of the chi-square distribution: 3.841, 11.070, 18.307, 31.410 for 1, 5, 10, 20 degrees of
    // freedom, exact to half a unit of the last digit, where the density is below 0.03. For four degrees of freedom the
    // probability is (1 + x/2) exp(-x/2), tested up to x = 1000.
    #[test]
    fn chi_square_is_that_of_the_tables() {
        let tail = |freedom: f64, x: f64| ChiSquared::new(freedom).unwrap().sf(x);
        for (freedom, x) in [(1.0, 3.841), (5.0, 11.070), (10.0, 18.307), (20.0, 31.410)] {
            assert!((tail(freedom, x) - 0.05).abs() < 2e-5, "{freedom}");
        }
        for x in [0.1_f64, 3.0, 30.0, 300.0, 1000.0] {
            let expected = (1.0 + 0.5 * x) * (-0.5 * x).exp();
            assert!((tail(4.0, x) / expected - 1.0).abs() < 1e-10, "{x}");
        }
    }

    // At the 5 % level the test rejects white noise in 5 % of the cases: 15 of 300 seeds with a standard deviation of
    // 3.8; accepted within three deviations. Autocorrelations outside the band: 5 % of 300 x 20, that is 300 with a
    // standard deviation of 17, and slightly fewer for n = 200, where the variance of r_k is (n-k)/(n(n+2)).
    #[test]
    fn white_noise_is_white() {
        let found: Vec<Whiteness> = (0..300)
            .map(|seed| whiteness(&noise(seed, 200, 0.0), 20, 0).unwrap())
            .collect();
        let rejected = found
            .iter()
            .filter(|found| found.probability < 0.05)
            .count();
        assert!((4..=26).contains(&rejected), "{rejected}");
        let outside: usize = found.iter().map(|found| found.outside).sum();
        assert!((220..=340).contains(&outside), "{outside}");
        // The probabilities are uniform: the mean of 300 is 0.5 with a standard deviation of 0.017.
        let mean = found.iter().map(|found| found.probability).sum::<f64>() / 300.0;
        assert!((mean - 0.5).abs() < 0.06, "{mean}");
    }

    // With a memory of 0.3 the first autocorrelation of 200 residuals is 0.3 with a standard deviation of 0.067, above
    // the band of 0.139 in 99 of 100 cases. Q is about 200 0.09/(1 - 0.09) = 20 above its mean of 10, and its 5 % point
    // is 18.3, so most cases are rejected. With a memory of 0.6 Q is about 110 above, so all are.
    #[test]
    fn memory_is_found() {
        let found = |memory: f64| -> Vec<Whiteness> {
            (0..100)
                .map(|seed| whiteness(&noise(seed, 200, memory), 10, 0).unwrap())
                .collect()
        };
        let weak = found(0.3);
        let rejected = weak.iter().filter(|found| found.probability < 0.05).count();
        assert!(rejected > 75, "{rejected}");
        let mean = weak
            .iter()
            .map(|found| found.autocorrelation[0])
            .sum::<f64>()
            / 100.0;
        assert!((mean - 0.3).abs() < 0.03, "{mean}");
        assert!(found(0.6).iter().all(|found| found.probability < 1e-6));
    }

    #[test]
    fn too_little_gives_none() {
        let some = [1.0, -1.0, 2.0, 0.5];
        assert_eq!(whiteness(&[], 1, 0), None);
        assert_eq!(whiteness(&some, 4, 0), None);
        assert_eq!(whiteness(&some, 0, 0), None);
        assert_eq!(whiteness(&some, 2, 2), None);
        for value in [0.0, 0.1, -1e300, f64::NAN, f64::INFINITY] {
            assert_eq!(whiteness(&[value; 100], 5, 0), None, "{value}");
        }
        assert_eq!(whiteness(&[1.0, f64::NAN, 2.0, 0.0], 1, 0), None);
    }
}
