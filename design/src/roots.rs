//! One root of one function of one variable.
//!
//! Reference: T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero
//! of a nonlinear function without using derivatives", Advances in Engineering Software 28 (1997).

/// Halvings that take any bracket within the range of `f64` down to one ulp; the interpolation
/// needs some ten steps.
const MAX_STEPS: usize = 200;

/// Steps of factor four that cross the whole range of `f64`.
const MAX_BRACKETINGS: usize = 1100;

/// Where `f` changes sign between `a` and `b`, to `tolerance` and an ulp or two.
///
/// Expects `f(a)` and `f(b)` of opposite sign; otherwise returns the end with the smaller value.
pub fn root(f: impl Fn(f64) -> f64, a: f64, b: f64, tolerance: f64) -> f64 {
    let (mut newest, mut f_newest) = (b, f(b));
    let (mut across, mut f_across) = (a, f(a));
    let mut fraction = 0.5;
    for _ in 0..MAX_STEPS {
        let trial = newest + fraction * (across - newest);
        let f_trial = f(trial);
        // Keep the sign change between `newest` and `across`; `previous` is the point let go.
        let (previous, f_previous);
        if (f_trial > 0.0) == (f_newest > 0.0) {
            (previous, f_previous) = (newest, f_newest);
        } else {
            (previous, f_previous) = (across, f_across);
            (across, f_across) = (newest, f_newest);
        }
        (newest, f_newest) = (trial, f_trial);

        let best = if f_newest.abs() < f_across.abs() {
            newest
        } else {
            across
        };
        let least_fraction = (tolerance + f64::EPSILON * best.abs()) / (across - newest).abs();
        if f_newest == 0.0 || least_fraction >= 0.5 || least_fraction.is_nan() {
            return best;
        }
        // Inverse quadratic interpolation where it is monotone across the bracket, else bisection.
        let xi = (newest - across) / (previous - across);
        let phi = (f_newest - f_across) / (f_previous - f_across);
        fraction = if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
            f_newest / (f_across - f_newest) * f_previous / (f_across - f_previous)
                + (previous - newest) / (across - newest) * f_newest / (f_previous - f_newest)
                    * f_across
                    / (f_previous - f_across)
        } else {
            0.5
        };
        fraction = fraction.clamp(least_fraction, 1.0 - least_fraction);
    }
    if f_newest.abs() < f_across.abs() {
        newest
    } else {
        across
    }
}

/// The positive frequency where `f`, positive below it and negative above it, changes sign.
///
/// Searches outwards from `start`; `None` where the sign never changes within the range of `f64`.
pub fn falling_root(f: impl Fn(f64) -> f64, start: f64) -> Option<f64> {
    let start_is_below = f(start) > 0.0;
    let factor = if start_is_below { 4.0 } else { 0.25 };
    let mut near = start;
    for _ in 0..MAX_BRACKETINGS {
        let far = near * factor;
        if !far.is_normal() {
            return None;
        }
        if (f(far) > 0.0) != start_is_below {
            return Some(root(f, near, far, 0.0));
        }
        near = far;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    // cos x = x at 0.739085133215160641655312...
    #[test]
    fn root_is_exact_to_an_ulp_or_two() {
        let x = root(|x| x.cos() - x, 0.0, 1.0, 0.0);
        assert!((x - 0.739_085_133_215_160_6).abs() < 3e-16, "{x}");
        // A triple root, where interpolation is no help: 0.1 to within the flat region 1e-5.
        let x = root(|x| (x - 0.1).powi(3), -1.0, 2.0, 0.0);
        assert!((x - 0.1).abs() < 1e-5, "{x}");
    }

    // 1e-7 - w changes sign at 1e-7, fourteen decades below the start.
    #[test]
    fn falling_root_searches_both_ways_and_gives_up() {
        for start in [1e7, 1e-20] {
            let w = falling_root(|w| 1e-7 - w, start).unwrap();
            assert!((w / 1e-7 - 1.0).abs() < 1e-15, "{w}");
        }
        assert_eq!(falling_root(|_| 1.0, 1.0), None);
        assert_eq!(falling_root(|_| -1.0, 1.0), None);
    }
}
