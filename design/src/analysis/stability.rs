//! Stability of a loop by Mikhailov's criterion (1938).
//!
//! The dead time does not act on the highest power of `f(s) = D(s) + N(s) e^(-tau s)`. So the loop is stable if and only if
//! `arg f(jw)` grows by `pi/2` for each power from `w = 0` to infinity. The argument is followed in steps of at most
//! 0.7 rad until `|L| < 1/2` for good; from there on it is that of `D` to within `pi/6`, without dead time.

use std::f64::consts::FRAC_PI_2;

use num_complex::Complex64;

use super::open_loop::OpenLoop;

/// Magnitude of `L` from which on its turns do not count.
const LARGEST_MAGNITUDE: f64 = 0.5;

/// Largest turn of `f` that counts as one step (rad).
const LARGEST_TURN_RAD: f64 = 0.7;

/// Most halvings of a step. A root that is closer to the axis than `2^-40` of its frequency decides nothing here.
const MOST_HALVINGS: usize = 40;

/// First length of a step, in steps of the frequency grid.
const STEPS: f64 = 4.0;

/// Most steps.
const MOST_STEPS: usize = 2_000_000;

/// Whether the closed loop is asymptotically stable. `false` too if this cannot be decided.
pub(crate) fn is_stable(open_loop: &OpenLoop) -> bool {
    if !open_loop.is_proper() {
        return false;
    }
    let Some((first, last)) = open_loop.range() else {
        return false;
    };
    let Some(turned) = turn(open_loop, first, last) else {
        return false;
    };
    let powers = open_loop.denominator.degree() as f64;
    (turned - powers * FRAC_PI_2).abs() < FRAC_PI_2
}

/// Growth of the argument of `f(jw)` from `first` to infinity (rad). `None` if a root is on the axis.
fn turn(open_loop: &OpenLoop, first: f64, last: f64) -> Option<f64> {
    let f = |omega: f64| {
        let delay = Complex64::cis(-omega * open_loop.tau);
        open_loop.denominator.at(omega) + open_loop.numerator.at(omega) * delay
    };
    let d = |omega: f64| open_loop.denominator.at(omega);
    let end = open_loop.end([first, last], LARGEST_MAGNITUDE);
    let mut omega = first;
    let mut here = f(omega);
    let mut turned = 0.0;
    for _ in 0..MOST_STEPS {
        if omega >= end {
            // From here to infinity: arg D(inf) - arg D(w) - arg(1 + L(w)).
            turned -= (here / d(omega)).arg();
            while omega < last {
                let next = omega + open_loop.undelayed_step(omega);
                turned += (d(next) / d(omega)).arg();
                omega = next;
            }
            // D is its highest power almost.
            let highest = Complex64::i().powu(open_loop.denominator.degree() as u32)
                * open_loop.denominator.coefficients().last()?.signum();
            return Some(turned + (highest / d(omega)).arg());
        }
        let (mut step, mut halvings) = (STEPS * open_loop.step(omega), 0);
        loop {
            let there = f(omega + step);
            let part = (there / here).arg();
            // The middle must agree, otherwise a quick turn of more than half a revolution would be missed.
            let middle = f(omega + 0.5 * step);
            let parts = (middle / here).arg() + (there / middle).arg();
            if part.abs() < LARGEST_TURN_RAD && (parts - part).abs() < 1e-6 {
                turned += part;
                omega += step;
                here = there;
                break;
            }
            halvings += 1;
            if halvings > MOST_HALVINGS || !part.is_finite() {
                return None;
            }
            step *= 0.5;
        }
    }
    None
}
