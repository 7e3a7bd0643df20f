//! Are residuals white? What a model leaves of a recording should be noise, and noise forgets itself.
//!
//! ```text
//! r_k = sum_t (e_t - m)(e_(t+k) - m) / sum_t (e_t - m)^2          k = 1 .. lags
//! Q   = n (n + 2) sum_k r_k^2 / (n - k)
//! ```
//!
//! with the mean `m` of the `n` residuals. Of white ones each `r_k` is Gaussian with a deviation of
//! `1/sqrt(n)`, and `Q` is chi-square with `lags - parameters` degrees of freedom, the fit having used up
//! `parameters` of them. All numbers are ratios: the unit of the residuals does not matter.
//!
//! Reference: G. M. Ljung, G. E. P. Box, "On a measure of lack of fit in time series models",
//! Biometrika 65 (1978).

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// How much residuals remember. See the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct Whiteness {
    /// Autocorrelation at the lags `1..=lags`, each between -1 and 1.
    pub autocorrelation: Vec<f64>,
    /// Half the width of the band that holds 95 % of the autocorrelations of white residuals.
    pub band: f64,
    /// Portmanteau statistic of Ljung and Box, `Q`.
    pub portmanteau: f64,
    /// Probability that white residuals have a larger one.
    pub probability: f64,
    /// Lags outside of the band; of white residuals one in twenty.
    pub outside: usize,
}

/// Standard deviations that hold 95 % of a Gaussian.
const BAND_DEVIATIONS: f64 = 1.96;
/// Spread, in the largest residual, below which all are the same but for rounding.
const ROUNDING: f64 = 1e-12;

/// How white `residuals` are, in order and at even times, after a fit of so many parameters.
///
/// `None` where there are no more residuals than lags, no more lags than parameters, or where the
/// residuals are all the same or not all finite.
#[must_use]
pub fn whiteness(residuals: &[f64], lags: usize, parameters: usize) -> Option<Whiteness> {
    if residuals.len() <= lags || lags <= parameters {
        return None;
    }
    let count = residuals.len() as f64;
    let largest = (residuals.iter()).fold(0.0_f64, |largest, residual| largest.max(residual.abs()));
    // In units of the largest: no square is lost or too large. All zero makes them NaN.
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

    /// `e_t = memory e_(t-1)` and white noise, after a run-up.
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

    // 1, 2, 3, 4 about 2.5: -1.5, -0.5, 0.5, 1.5, squares 5. r_1 = (0.75 - 0.25 + 0.75)/5 = 0.25,
    // r_2 = (-0.75 - 0.75)/5 = -0.3; Q = 4 6 (0.0625/3 + 0.09/2) = 1.58; two degrees of freedom:
    // exp(-0.79); the band 0.98. With one parameter one degree: erfc(sqrt(0.79)) = 0.2087607.
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

    // +1, -1 in turn, 100 of them: r_k = (-1)^k (100 - k)/100, and Q = 100 102 sum (100 - k)/1e4
    // = 1.02 (99 + 98 + 97) = 299.88. Units and an offset change nothing.
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

    // The 5 % points that every table of chi-square has: 3.841, 11.070, 18.307, 31.410 for 1, 5, 10, 20 degrees
    // of freedom, to the half unit of their last digit (the density there is below 0.03); and with four
    // degrees (1 + x/2) exp(-x/2), far out too.
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

    // White noise is called coloured at 5 % by one in twenty: of 300 seeds 15, with a deviation of 3.8;
    // within three of them. Lags outside of the band: of 300 x 20 one in twenty too, 300 with a deviation
    // of 17, a few less for 200 residuals, whose r_k are a little narrower (variance (n-k)/(n(n+2))).
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
        // Uniform: the mean of 300 is 0.5 with a deviation of 0.017.
        let mean = found.iter().map(|found| found.probability).sum::<f64>() / 300.0;
        assert!((mean - 0.5).abs() < 0.06, "{mean}");
    }

    // With a memory of 0.3 the first lag of 200 residuals is 0.3 with a deviation of 0.067, above the
    // band of 0.139 in all but one of a hundred; Q is near 200 0.09/(1 - 0.09) = 20 above its mean of 10,
    // whose 5 % point is 18.3, so that most are found. With 0.6 (Q some 110 above) all are.
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
