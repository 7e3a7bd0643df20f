//! Root of a function of one variable, and edge of a condition. The root: hybrid of inverse quadratic interpolation and bisection.
//!
//! Reference: T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero
//! of a nonlinear function without using derivatives", Advances in Engineering Software 28 (1997).

/// Maximum number of steps. Interpolation usually needs about ten; 200 bisections shrink a bracket by `2^200`.
const MAX_STEPS: usize = 200;

/// Maximum number of bracketing steps: 1,100 factors of four cross the whole range of `f64`, about `2^2100`.
const MAX_BRACKETINGS: usize = 1100;

/// The point nearest to `outside`, on the way from `inside`, at which a condition holds, by `halvings` of the way. `None` if it does
/// not hold at `inside`.
pub(crate) fn edge(
    mut inside: f64,
    mut outside: f64,
    halvings: usize,
    holds: impl Fn(f64) -> bool,
) -> Option<f64> {
    if holds(outside) {
        return Some(outside);
    }
    if !holds(inside) {
        return None;
    }
    for _ in 0..halvings {
        let middle = 0.5 * (inside + outside);
        if holds(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    Some(inside)
}

/// Argument between `a` and `b` at which `f` changes sign, to `tolerance` plus one or two ulp.
///
/// `f(a)` and `f(b)` must have opposite signs. Otherwise the result is one of the points tried, not a root.
#[must_use]
pub fn root(f: impl Fn(f64) -> f64, a: f64, b: f64, tolerance: f64) -> f64 {
    let (mut newest, mut f_newest) = (b, f(b));
    let (mut across, mut f_across) = (a, f(a));
    let mut fraction = 0.5;
    for _ in 0..MAX_STEPS {
        let trial = newest + fraction * (across - newest);
        let f_trial = f(trial);
        // Keep the sign change between `newest` and `across`. `previous` is the point that is dropped.
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
        // Inverse quadratic interpolation if it is monotone across the bracket, otherwise bisection.
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

/// Positive argument at which `f` falls through zero: `f` is positive below it and negative above it.
///
/// Searches upwards or downwards from `start` in factors of four. `None` if the sign does not change within the range
/// of `f64`.
#[must_use]
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

/// Argument between `a` and `b` of a local minimum of `f`, to `tolerance`, and the minimum: golden-section search.
#[must_use]
pub fn minimum(f: impl Fn(f64) -> f64, a: f64, b: f64, tolerance: f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut low, mut high) = (a, b);
    let (mut left, mut right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut f_left, mut f_right) = (f(left), f(right));
    for _ in 0..MAX_STEPS {
        if f_left < f_right {
            high = right;
            (right, f_right) = (left, f_left);
            left = high - GOLDEN * (high - low);
            f_left = f(left);
        } else {
            low = left;
            (left, f_left) = (right, f_right);
            right = low + GOLDEN * (high - low);
            f_right = f(right);
        }
        if high - low <= tolerance {
            break;
        }
    }
    if f_left < f_right {
        (left, f_left)
    } else {
        (right, f_right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // (x - 1/3)^2 + 2 is least at 1/3. Near it the function is flat to rounding over 1e-8.
    #[test]
    fn minimum_of_a_parabola() {
        let (x, least) = minimum(|x| (x - 1.0 / 3.0).powi(2) + 2.0, -1.0, 4.0, 1e-9);
        assert!((x - 1.0 / 3.0).abs() < 3e-8 && least == 2.0, "{x} {least}");
    }

    // cos x = x at 0.739085133215160641655312...
    #[test]
    fn root_is_exact_to_an_ulp_or_two() {
        let x = root(|x| x.cos() - x, 0.0, 1.0, 0.0);
        assert!((x - 0.739_085_133_215_160_6).abs() < 3e-16, "{x}");
        // A triple root, where interpolation does not help: 0.1 to within 1e-5, where the function is flat.
        let x = root(|x| (x - 0.1).powi(3), -1.0, 2.0, 0.0);
        assert!((x - 0.1).abs() < 1e-5, "{x}");
    }

    // 1e-7 - w changes sign at 1e-7: 14 decades below the first start, 13 above the second.
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
