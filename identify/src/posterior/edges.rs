//! Edges in the space of the draws: equal lags, and jumps of what follows from a process.

use onecycle_design::bands::quantiles;
use onecycle_onboard::refine::coordinate;

/// Ends of the central 90 % interval of values that may jump, and of those beyond a jump if any draw lies there. The settling
/// time jumps by half a period where an overshoot is just the half width of its band, and how many of the draws lie beyond
/// depends on more than their spread: a jump is wider than the rest of the interval.
pub(super) fn with_jumps(mut values: Vec<f64>) -> Option<(f64, f64)> {
    let (low, high) = quantiles(values.clone())?;
    let width = high - low;
    values.sort_unstable_by(f64::total_cmp);
    // An unstable draw has no settling time.
    let jumps = |from: f64, to: f64| to.is_finite() && to - from > width;
    let below = (values.windows(2).rev())
        .find(|pair| pair[1] <= low && jumps(pair[0], pair[1]))
        .map(|pair| pair[0]);
    let beyond = (values.windows(2))
        .find(|pair| pair[0] >= high && jumps(pair[0], pair[1]))
        .map(|pair| pair[1]);
    Some((
        below.map_or(low, |edge| edge - width),
        beyond.map_or(high, |edge| edge + width),
    ))
}

/// Ratio of the poles where both lags are equal.
const EQUAL: f64 = 0.25;

/// Whether these coordinates of the relay's estimator belong to a process: not those of complex poles, negative damping or
/// negative dead time.
pub(super) fn is_process(at: &[f64; 5]) -> bool {
    (0.0..=EQUAL).contains(&at[coordinate::POLE_RATIO]) && at[coordinate::TAU_S] >= 0.0
}

/// The most probable coordinates with equal lags, given that the drawn ones have complex poles; other draws as they are. To
/// keep the sum of the poles would move the sum of the lags, which a recording tells best.
pub(super) fn with_real_poles(mut at: [f64; 5], covariance: Option<&[[f64; 5]; 5]>) -> [f64; 5] {
    const RATIO: usize = coordinate::POLE_RATIO;
    let excess = at[RATIO] - EQUAL;
    if let Some(covariance) = covariance.filter(|_| excess > 0.0) {
        for (value, row) in at.iter_mut().zip(covariance) {
            *value -= excess * row[RATIO] / covariance[RATIO][RATIO];
        }
        at[RATIO] = EQUAL;
    }
    at
}

/// Part of the draws below which equal lags are ruled out: what the central 90 % leave out at one end.
pub(super) const RULED_OUT: f64 = 0.05;

/// Ends of the central 90 % interval of the values of a parameter, widened to those of the draws with `equal` lags unless equal
/// lags are ruled out. All draws with complex poles become one line of processes, at the end of the interval of a lag. Where
/// these are a tenth of the draws, the central 90 % hold one half of the line, and a process on it would lie outside of them
/// every second time.
pub(super) fn with_equal_lags(values: &[f64], equal: &[bool]) -> Option<(f64, f64)> {
    let (low, high) = quantiles(values.to_vec())?;
    let on_line = values.iter().zip(equal).filter(|(_, equal)| **equal);
    let on_line: Vec<f64> = on_line.map(|(value, _)| *value).collect();
    if (on_line.len() as f64) < RULED_OUT * values.len() as f64 {
        return Some((low, high));
    }
    quantiles(on_line).map(|(least, most)| (low.min(least), high.max(most)))
}

#[cfg(test)]
mod tests {
    use super::*;

    // 200 values from 1 to 1.0199: the central 90 % are 1.001 to 1.0189. Two of them half a second earlier or later belong to
    // the interval too, with the width of the rest about them.
    #[test]
    fn an_interval_holds_both_sides_of_a_jump() {
        let smooth: Vec<f64> = (0..200).map(|k| 1.0 + 1e-4 * f64::from(k)).collect();
        let (low, high) = with_jumps(smooth.clone()).unwrap();
        assert!((low - 1.001).abs() < 1e-12 && (high - 1.0189).abs() < 1e-12);
        let mut jumping = smooth.clone();
        (jumping[0], jumping[1]) = (0.5, 0.501);
        let (below, same) = with_jumps(jumping).unwrap();
        assert!((below - (0.501 - 0.0179)).abs() < 1e-12 && same == high);
        let mut jumping = smooth;
        (jumping[198], jumping[199]) = (1.5, f64::INFINITY);
        let (same, beyond) = with_jumps(jumping).unwrap();
        assert!(
            same == low && (beyond - (1.5 + 0.0179)).abs() < 1e-12,
            "{beyond}"
        );
    }

    // Values 0 to 99: the central 90 % are 5 to 94, and the last ten of them alone are 90 to 99. Four of 100 are ruled out.
    #[test]
    fn an_interval_holds_equal_lags_unless_they_are_ruled_out() {
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        let last = |count: usize| -> Vec<bool> { (0..100).map(|k| k >= 100 - count).collect() };
        assert_eq!(with_equal_lags(&values, &last(10)), Some((5.0, 99.0)));
        assert_eq!(with_equal_lags(&values, &last(4)), Some((5.0, 94.0)));
        assert_eq!(with_equal_lags(&values, &last(0)), Some((5.0, 94.0)));
        assert_eq!(with_equal_lags(&[], &[]), None);
    }

    // Variances of 0.01 and 0.04 with a covariance of 0.02: a ratio 0.05 above 1/4 lowers its neighbour by 0.05 * 0.5.
    #[test]
    fn complex_poles_become_the_most_probable_equal_ones() {
        let mut covariance = [[0.0; 5]; 5];
        for (k, row) in covariance.iter_mut().enumerate() {
            row[k] = 0.01;
        }
        covariance[coordinate::POLE_RATIO][coordinate::POLE_RATIO] = 0.04;
        covariance[coordinate::LN_POLE_SUM][coordinate::POLE_RATIO] = 0.02;
        let mut at = [1.0; 5];
        at[coordinate::POLE_RATIO] = 0.3;
        let found = with_real_poles(at, Some(&covariance));
        assert!((found[coordinate::LN_POLE_SUM] - 0.975).abs() < 1e-12);
        assert_eq!(found[coordinate::POLE_RATIO], 0.25);
        assert_eq!(found[coordinate::TAU_S], 1.0);
        at[coordinate::POLE_RATIO] = 0.2;
        assert_eq!(with_real_poles(at, Some(&covariance)), at);
    }
}
