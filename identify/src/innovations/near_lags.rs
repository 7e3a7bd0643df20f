//! Coordinates of a posterior in which equal lags are an ordinary point.
//!
//! A record tells the same of a process whose lags are exchanged. So the likelihood does not change with a small difference of
//! two equal lags, and a Gaussian over the difference has no end. But it is a smooth function of
//!
//! ```text
//! m = mean l_i,    p = 1/2 sum (l_i - m)^2,    r = prod (l_i - m),    l_i = ln T_i
//! ```
//!
//! of two lags `l = m +- sqrt p`, or of three `l = m + x` with the roots `x` of `x^3 - p x - r`. The roots are real for
//! `4 p^3 >= 27 r^2`. At the boundary two of them are equal: `x = s, s, -2 s`, `p = 3 s^2`, `r = -2 s^3`. Beyond it are complex
//! poles, which only a structure with a second-order stage has. The pole of the body counts as a lag `1/a`, a second-order stage
//! as two. A gain in front of these is not symmetric in the lags, but over the product of the lags of the actuator it is.
//!
//! A pole `a` that is no such lag has the coordinate `asinh(a t)`, with a twelfth `t` of the length of the record: of a body that comes
//! to rest well within the record that is the logarithm of its time constant, which no error makes negative; of a slower one the pole
//! itself, which may be that of an integrator. Over `sqrt(a^2 + 1/t^2)` the gain is that at rest, or that of an integrator.

use std::f64::consts::{LN_2, PI};

use num_complex::Complex64;

use super::search::LAGS_IN_A_RECORD;
use super::theta::{MOST, Theta};

/// Difference of `ln T` below which lags are nearly equal: a factor of 2. Beyond it their logarithms are as good.
const NEAR: f64 = LN_2;
/// Steps of the differences along `m`, `p` and `r`. Along the latter two the residual is smooth over lags that differ by a tenth.
const STEPS: [f64; 3] = [1e-4, 5e-3, 5e-4];
/// Points on the boundary that are compared, and steps of the search between the best of them.
const POINTS: i32 = 30;
const REFINEMENTS: usize = 40;

/// The unknowns of a fit whose lags are nearly equal, and of its pole.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NearLags {
    /// Empty if no two lags are nearly equal. In the order of descending lags: of the body, then of the actuator.
    members: Vec<usize>,
    /// The pole of the body, if it is a member.
    pole: Option<usize>,
    /// `c1` of the second-order stage, if that is a member.
    pair: Option<usize>,
    /// The pole of the body, if it is no member, and the rate below which it may be that of an integrator (1/s).
    alone: Option<(usize, f64)>,
}

impl NearLags {
    /// Those of the unknowns `free` of a record of this length.
    pub(super) fn of(theta: &Theta, free: &[usize], length_s: f64) -> Self {
        let near = Self::nearly_equal(theta, free);
        let pole = theta.layout().pole();
        let alone = pole.filter(|pole| free.contains(pole) && !near.members.contains(pole));
        Self {
            alone: alone.map(|pole| (pole, LAGS_IN_A_RECORD / length_s)),
            ..near
        }
    }

    fn nearly_equal(theta: &Theta, free: &[usize]) -> Self {
        let layout = theta.layout();
        let lags = 0..layout.stages.lags;
        let pole = layout.pole().filter(|pole| theta.values[*pole] > 0.0);
        let pair = layout.pair().filter(|_| !lags.is_empty());
        let of_pair = pair.into_iter().flat_map(|pair| [pair, pair + 1]);
        let all = pole.into_iter().chain(of_pair).chain(lags);
        let all = Self {
            members: all.filter(|index| free.contains(index)).collect(),
            pole,
            pair,
            alone: None,
        };
        let logs = all.logs(theta);
        // Of three lags at most one run of neighbours has two.
        let is_near = |of: usize| {
            let others = (0..logs.len()).filter(|other| *other != of);
            others
                .into_iter()
                .any(|other| (logs[other] - logs[of]).norm() < NEAR)
        };
        let near: Vec<usize> = (0..logs.len()).filter(|of| is_near(*of)).collect();
        let is_whole = near.len() == logs.len();
        if pair.is_some() && !(is_whole && all.members.len() == 3) {
            return Self::default();
        }
        let members: Vec<usize> = near.iter().map(|of| all.members[*of]).collect();
        Self {
            pole: pole.filter(|pole| members.contains(pole)),
            members,
            pair,
            alone: None,
        }
    }

    /// No lags, unless all of them are among `free`; and no pole that is not.
    pub(super) fn within(&self, free: &[usize]) -> Self {
        let near = match self.members.iter().all(|index| free.contains(index)) {
            true => self.clone(),
            false => Self::default(),
        };
        Self {
            alone: self.alone.filter(|(pole, _)| free.contains(pole)),
            ..near
        }
    }

    /// Logarithms of the lags, in the order of the members.
    fn logs(&self, theta: &Theta) -> Vec<Complex64> {
        let log_of = |index: &usize| match Some(*index) == self.pole {
            true => -theta.values[*index].max(f64::MIN_POSITIVE).ln(),
            false => theta.values[*index],
        };
        let Some(pair) = self.pair else {
            return (self.members.iter())
                .map(|index| log_of(index).into())
                .collect();
        };
        let half = 0.5 * theta.values[pair];
        let root = Complex64::from(half * half - theta.values[pair + 1]).sqrt();
        let of_pair = [half - root, half + root].map(|rate| -rate.ln());
        of_pair
            .into_iter()
            .chain([theta.values[0].into()])
            .collect()
    }

    /// Factor that makes the gain and the disturbance symmetric in the lags, and those of a body at rest.
    pub(super) fn symmetric(&self, theta: &Theta) -> f64 {
        if let Some((pole, slowest_per_s)) = self.alone {
            return 1.0 / theta.values[pole].hypot(slowest_per_s);
        }
        if self.pole.is_none() && self.pair.is_none() {
            return 1.0;
        }
        let lags = 0..theta.layout().stages.lags;
        let members = lags.filter(|index| self.members.contains(index));
        members.map(|index| (-theta.values[index]).exp()).product()
    }

    /// Derivative of the logarithm of [`Self::symmetric`] along the coordinate of an unknown: that of a pole that is no member, else zero.
    pub(super) fn slope_of_alone(&self, theta: &Theta, index: usize) -> f64 {
        let alone = self.alone.filter(|(pole, _)| *pole == index);
        // 1/cosh x, of sinh x = a t.
        alone.map_or(0.0, |(pole, slowest_per_s)| {
            let pole_per_s = theta.values[pole];
            -pole_per_s / pole_per_s.hypot(slowest_per_s)
        })
    }

    /// Coordinates: `m`, `p` and `r` take the places of the members in their order.
    fn coordinates(&self, theta: &Theta) -> [f64; MOST] {
        let mut at = theta.values;
        let logs = self.logs(theta);
        let mean = logs.iter().sum::<Complex64>() / logs.len().max(1) as f64;
        let apart = logs.iter().map(|log| log - mean);
        let squares: Complex64 = apart.clone().map(|x| x * x).sum();
        let product: Complex64 = apart.product();
        for (index, value) in (self.members.iter()).zip([mean.re, 0.5 * squares.re, product.re]) {
            at[*index] = value;
        }
        if let Some((pole, slowest_per_s)) = self.alone {
            at[pole] = (at[pole] / slowest_per_s).asinh();
        }
        at
    }

    /// Unknowns at these coordinates.
    fn theta(&self, template: &Theta, at: &[f64; MOST]) -> Theta {
        let mut theta = Theta {
            values: *at,
            ..*template
        };
        if let Some((pole, slowest_per_s)) = self.alone {
            theta.values[pole] = slowest_per_s * at[pole].sinh();
        }
        let value = |place: usize| self.members.get(place).map_or(0.0, |index| at[*index]);
        let (m, p, r) = (value(0), value(1), value(2));
        if let Some(pair) = self.pair {
            let [first, second, last] = roots(p, r).map(|x| (-m - x).exp());
            theta.values[pair] = (first + second).re;
            theta.values[pair + 1] = (first * second).re;
            theta.values[0] = -last.re.ln();
            return theta;
        }
        let apart = match self.members.len() {
            3 => roots(p, r).map(|x| x.re),
            _ => [1.0, -1.0, 0.0].map(|side| side * p.max(0.0).sqrt()),
        };
        for (index, x) in self.members.iter().zip(apart) {
            theta.values[*index] = match Some(*index) == self.pole {
                true => (-m - x).exp(),
                false => m + x,
            };
        }
        theta
    }

    /// Least `p` that the structure has at this `r`.
    fn least_spread(&self, r: f64) -> f64 {
        match (self.pair, self.members.len()) {
            (Some(_), _) => f64::NEG_INFINITY,
            (None, 3) => (6.75 * r * r).cbrt(),
            _ => 0.0,
        }
    }

    /// Two points at or near `theta` that differ in the coordinate of an unknown alone, and by how much. `step`: half of that of
    /// an unknown that is no member.
    pub(super) fn ends(&self, theta: &Theta, index: usize, step: f64) -> ([Theta; 2], f64) {
        let mut at = self.coordinates(theta);
        let place = self.members.iter().position(|member| *member == index);
        let is_alone = self.alone.is_some_and(|(pole, _)| pole == index);
        let step = match place {
            Some(place) => STEPS[place],
            None if is_alone => STEPS[0],
            None => step,
        };
        let skew = self.members.get(2).map_or(0.0, |index| at[*index].abs());
        if let Some(spread) = self.members.get(1) {
            // Both ends are processes of the structure.
            let least = match place {
                Some(1) => self.least_spread(skew) + step,
                Some(2) => self.least_spread(skew + step),
                _ => f64::NEG_INFINITY,
            };
            at[*spread] = at[*spread].max(least);
        }
        let end = |sign: f64| {
            let mut at = at;
            at[index] += sign * step;
            self.theta(theta, &at)
        };
        ([end(-1.0), end(1.0)], 2.0 * step)
    }

    /// Adds `changes` of the coordinates of the unknowns `free`. Complex poles that the structure does not have become equal lags:
    /// the most probable ones, given the `covariance` of the coordinates. Returns whether they did; `changes` are then those to
    /// the equal lags.
    pub(super) fn moved(
        &self,
        theta: &Theta,
        free: &[usize],
        changes: &mut [f64],
        covariance: impl Fn(usize, usize) -> f64,
    ) -> (Theta, bool) {
        let mut at = self.coordinates(theta);
        for (index, change) in free.iter().zip(changes.iter()) {
            at[*index] += change;
        }
        let value = |place: usize| self.members.get(place).map_or(0.0, |index| at[*index]);
        let drawn = [value(1), value(2)];
        let slots = (self.members.iter().skip(1))
            .filter_map(|index| free.iter().position(|free| free == index));
        let slots: Vec<usize> = slots.collect();
        if slots.is_empty() || drawn[0] >= self.least_spread(drawn[1]) {
            return (self.theta(theta, &at), false);
        }
        let weights = |to: [f64; 2]| -> [f64; 2] {
            let [p, r] = [to[0] - drawn[0], to[1] - drawn[1]];
            let of = |i: usize, j: usize| covariance(slots[i], slots[j]);
            if slots.len() == 1 {
                return [p / of(0, 0), 0.0];
            }
            let determinant = of(0, 0) * of(1, 1) - of(0, 1) * of(1, 0);
            [
                (of(1, 1) * p - of(0, 1) * r) / determinant,
                (of(0, 0) * r - of(1, 0) * p) / determinant,
            ]
        };
        let distance = |to: [f64; 2]| {
            let [a, b] = weights(to);
            a * (to[0] - drawn[0]) + b * (to[1] - drawn[1])
        };
        let to = match slots.len() {
            1 => [0.0; 2],
            _ => nearest_boundary(drawn, distance),
        };
        let weights = weights(to);
        for (slot, change) in changes.iter_mut().enumerate() {
            let pairs = slots.iter().zip(weights);
            let shift: f64 = pairs
                .map(|(of, weight)| weight * covariance(slot, *of))
                .sum();
            *change += shift;
            at[free[slot]] += shift;
        }
        (self.theta(theta, &at), true)
    }
}

/// The `p` and `r` with two equal roots at the least distance from those that were drawn.
fn nearest_boundary(drawn: [f64; 2], distance: impl Fn([f64; 2]) -> f64) -> [f64; 2] {
    let at = |s: f64| [3.0 * s * s, -2.0 * s * s * s];
    let size = (drawn[0].abs() / 3.0)
        .sqrt()
        .max((0.5 * drawn[1].abs()).cbrt());
    let step = 2.0 * size / f64::from(POINTS);
    let far = |s: f64| distance(at(s));
    let points = (-POINTS..=POINTS).map(|k| f64::from(k) * step);
    let mut best = points
        .reduce(|a, b| if far(b) < far(a) { b } else { a })
        .unwrap_or(0.0);
    let mut step = step;
    for _ in 0..REFINEMENTS {
        step *= 0.5;
        for s in [best - step, best + step] {
            if far(s) < far(best) {
                best = s;
            }
        }
    }
    at(best)
}

/// Roots of `x^3 - p x - r`: three real ones in descending order, or two complex ones and the real one.
fn roots(p: f64, r: f64) -> [Complex64; 3] {
    let size = (p.max(0.0) / 3.0).sqrt();
    let discriminant = 0.25 * r * r - size.powi(6);
    if p > 0.0 && discriminant <= 1e-12 * size.powi(6) {
        let angle = (0.5 * r / size.powi(3)).clamp(-1.0, 1.0).acos() / 3.0;
        return [0.0, -2.0, 2.0]
            .map(|thirds| (2.0 * size * (angle + thirds * PI / 3.0).cos()).into());
    }
    let root = (0.25 * r * r - p * p * p / 27.0).max(0.0).sqrt();
    let real = (0.5 * r + root).cbrt() + (0.5 * r - root).cbrt();
    let height = (0.75 * real * real - p).max(0.0).sqrt();
    let upper = Complex64::new(-0.5 * real, height);
    [upper, upper.conj(), real.into()]
}

#[cfg(test)]
mod tests {
    use onecycle_design::Structure;

    use super::*;

    fn theta(structure: Structure, values: &[f64]) -> Theta {
        let mut theta = Theta::new(structure);
        theta.values[..values.len()].copy_from_slice(values);
        theta
    }

    fn is_close(a: &Theta, b: &Theta) -> bool {
        let pairs = a.values.iter().zip(&b.values);
        pairs
            .into_iter()
            .all(|(a, b)| a == b || (a - b).abs() < 1e-9)
    }

    // Lags of 1 and 3 s with a body of 1.5 s: all within a factor of 2 of the next. A body of 0.4 s is alone.
    #[test]
    fn lags_within_a_factor_of_two_are_near() {
        let near = |body_s: f64| {
            let theta = theta(Structure::Toptd, &[3_f64.ln(), 0.0, 1.0 / body_s, 0.2]);
            NearLags::of(&theta, &[0, 1, 2, 3], 9.0).members
        };
        assert_eq!(near(1.9), [2, 0, 1]);
        assert_eq!(near(1.1), [2, 1]);
        assert_eq!(near(4.0), [2, 0]);
        assert!(near(0.4).is_empty());
        let theta = theta(Structure::Toptd, &[0.1, 0.0, 1.0, 0.2]);
        assert!(NearLags::of(&theta, &[0, 3], 9.0).members.is_empty());
        assert_eq!(NearLags::of(&theta, &[0, 1, 3], 9.0).members, [0, 1]);
    }

    // Two lags, three, and a lag beside complex poles come back.
    #[test]
    fn coordinates_lead_back() {
        let rate = (-0.1_f64).exp();
        for (structure, values) in [
            (Structure::Soptd, vec![0.1, rate / 1.3, 0.2]),
            (Structure::Toptd, vec![0.3, -0.1, (-0.6_f64).exp(), 0.2]),
            (Structure::Toptd, vec![0.1, 0.1, (-0.1_f64).exp(), 0.2]),
            (Structure::ResonantLag, vec![0.05, 1.7, 0.8, 0.2]),
            (Structure::ResonantLag, vec![-0.4, 2.0, 0.97, 0.2]),
            (Structure::Foptd, vec![-0.03, 0.2]),
            (Structure::Toptd, vec![0.1, 0.0, 0.03, 0.2]),
        ] {
            let theta = theta(structure, &values);
            let free: Vec<usize> = (0..values.len()).collect();
            let near = NearLags::of(&theta, &free, 9.0);
            assert!(
                near.members.len() >= 2 || near.alone.is_some(),
                "{structure:?}"
            );
            let back = near.theta(&theta, &near.coordinates(&theta));
            assert!(is_close(&back, &theta), "{back:?} {theta:?}");
            let gain = 2.0 * near.symmetric(&theta) / near.symmetric(&back);
            assert!((gain - 2.0).abs() < 1e-9);
        }
    }

    // A time constant of 1 s in a record of 1,200 s, known to a factor of e: its pole stays positive, and the gain at rest is that of the
    // fit. A pole of a time constant of 1,000 records moves as it is, with the gain of an integrator.
    #[test]
    fn a_pole_is_a_time_constant_or_that_of_an_integrator() {
        for (pole_per_s, change, expected_per_s, ratio) in [
            (1.0, -1.0, (-1.0_f64).exp(), (-1.0_f64).exp()),
            (1.0, 2.0, 2.0_f64.exp(), 2.0_f64.exp()),
            (1e-5, -2e-3, -1e-5, 1.0),
        ] {
            let theta = theta(Structure::Foptd, &[pole_per_s, 0.2]);
            let near = NearLags::of(&theta, &[0, 1], 1200.0);
            let (moved, _) = near.moved(&theta, &[0], &mut [change], |_, _| 1.0);
            let found = near.symmetric(&theta) / near.symmetric(&moved);
            assert!(
                (moved.values[0] / expected_per_s - 1.0).abs() < 1e-3,
                "{moved:?}"
            );
            assert!((found / ratio - 1.0).abs() < 1e-3, "{found}");
            let (ends, step) = near.ends(&theta, 0, 1.0);
            let [low, high] = ends.map(|end| near.symmetric(&end).ln());
            let slope = near.slope_of_alone(&theta, 0);
            assert!((slope - (high - low) / step).abs() < 1e-6, "{slope}");
        }
    }

    // (x - 1)(x - 2)(x + 3) = x^3 - 7 x + 6; (x + 2)(x^2 - 2 x + 2) = x^3 - 2 x + 4.
    #[test]
    fn roots_by_hand() {
        let close = |found: [Complex64; 3], expected: [Complex64; 3]| {
            let pairs = found.iter().zip(expected);
            pairs.into_iter().all(|(a, b)| (a - b).norm() < 1e-9)
        };
        assert!(close(
            roots(7.0, -6.0),
            [2.0, 1.0, -3.0].map(Complex64::from)
        ));
        let upper = Complex64::new(1.0, 1.0);
        assert!(close(
            roots(2.0, -4.0),
            [upper, upper.conj(), (-2.0).into()]
        ));
        assert!(close(roots(0.0, 0.0), [Complex64::ZERO; 3]));
    }

    // Two equal lags of 1 s, p = -0.02 drawn: the equal ones are left, and what is correlated with p follows by half of it.
    #[test]
    fn complex_poles_become_the_most_probable_equal_lags() {
        let theta = theta(Structure::Soptd, &[0.0, 1.0, 0.2]);
        let free = [0, 1, 2];
        let near = NearLags::of(&theta, &free, 9.0);
        // m stands in the place of the pole, p in that of the lag.
        let mut changes = [-0.02, 0.01, 0.0];
        let covariance = |i: usize, j: usize| match (i, j) {
            (0, 0) => 0.04,
            (2, 0) | (0, 2) => 0.02,
            _ => 0.0,
        };
        let (moved, is_equal) = near.moved(&theta, &free, &mut changes, covariance);
        assert!(is_equal);
        assert!((moved.values[0] - 0.01).abs() < 1e-12);
        assert!((moved.values[1] - (-0.01_f64).exp()).abs() < 1e-12);
        assert!((moved.values[2] - 0.21).abs() < 1e-12);
    }

    // Three equal lags of 1 s with independent errors of p and r: a draw on the boundary stays, one beyond it moves to the nearest
    // double lag, one with r = 0 and p < 0 to the triple one.
    #[test]
    fn complex_poles_of_three_lags_become_a_double_lag() {
        let theta = theta(Structure::Toptd, &[0.0, 0.0, 1.0, 0.2]);
        let free = [0, 1, 2, 3];
        let near = NearLags::of(&theta, &free, 9.0);
        let covariance = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let of = |p: f64, r: f64| {
            let mut changes = [p, r, 0.0, 0.0];
            let (moved, is_equal) = near.moved(&theta, &free, &mut changes, covariance);
            (
                [-moved.values[2].ln(), moved.values[0], moved.values[1]],
                is_equal,
            )
        };
        let (logs, is_equal) = of(0.04, 0.0);
        assert!(!is_equal && (logs[0] - 0.2).abs() < 1e-9 && logs[1].abs() < 1e-9);
        let (logs, is_equal) = of(-0.04, 0.0);
        assert!(
            is_equal && logs.iter().all(|log| log.abs() < 1e-4),
            "{logs:?}"
        );
        // From (0.03, 0.01), s = -0.1 gives (0.03, 0.002), at a distance of 0.008.
        let (logs, is_equal) = of(0.03, 0.01);
        let s = -0.5 * logs[0];
        assert!(is_equal && (logs[1] - s).abs() < 1e-6 && (logs[2] - s).abs() < 1e-6);
        let distance = (3.0 * s * s - 0.03).hypot(-2.0 * s.powi(3) - 0.01);
        assert!(distance < 0.008 && s < -0.1, "{s} {distance}");
    }
}
