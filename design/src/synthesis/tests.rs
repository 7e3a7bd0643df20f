//! Designs against an independent implementation and brute force.

use crate::analysis::vectors::{VECTORS, Vector};
use crate::synthesis::limits::Limits;
use crate::synthesis::objective::{Objective, Problem};
use crate::synthesis::optimum::{FINE_GRID, optimum};
use crate::synthesis::polish::polish;
use crate::synthesis::shape::{Family, Filter};

fn problem(vector: &Vector) -> Problem {
    let process = vector.process();
    Problem {
        process,
        family: Family {
            form: vector.form,
            filter: Filter::Fixed(vector.filter_s / process.unit_s),
        },
        limits: Limits::of(vector.m),
        noise: None,
        input_peak: None,
    }
}

/// Vectors whose gains are not the optimum to 1e-5, with the gains that are: `docs/decisions/0016-reference-gains.md`.
/// The same to 3e-7 with steps half and a quarter as long and with differences three times as long or short.
const CORRECTED: [(usize, [f64; 3]); 5] = [
    (1, [0.836570, 0.793427, 0.316488]),
    (3, [6.19286, 2.65243, 2.77929]),
    (8, [0.598782, 0.178328, 0.262720]),
    (10, [26.6782, 32.3169, 10.7388]),
    (11, [47.6914, 93.7459, 13.9438]),
];

/// Gains of least cost, to six digits.
fn gains(i: usize) -> [f64; 3] {
    let corrected = CORRECTED.iter().find(|(vector, _)| *vector == i);
    corrected.map_or(VECTORS[i].gains, |(_, gains)| *gains)
}

// The gains of the vectors to 1e-5, and at no more cost. The gains of the vectors are rounded to six digits, so that they
// exceed the limits by up to 2e-6: their cost may be lower by 3e-6.
#[test]
fn gains_of_the_vectors() {
    for (i, vector) in VECTORS.iter().enumerate() {
        let problem = problem(vector);
        let process = problem.process;
        let found = optimum(problem).unwrap();
        let coarse = found.ln_cost;
        let found = polish(&mut Objective::new(problem, FINE_GRID), &found);
        let law = problem.family.law(&process, &found.z).scaled(found.gain.k);
        let pid = law.controller(&process);
        for (found, expected) in [pid.kp, pid.ki, pid.kd].iter().zip(gains(i)) {
            let off = (found - expected).abs();
            assert!(off <= 1e-5 * expected, "vector {i}: {found} {expected}");
        }
        let unit = if law.ki == 0.0 {
            process.unit_s
        } else {
            process.unit_s * process.gain
        };
        let ratio = found.ln_cost.exp() * unit / vector.integrals[0];
        assert!(ratio < 1.0 + 3e-6, "vector {i}: {ratio}");
        // The search alone is within 0.2 % of the least cost.
        let ratio = coarse.exp() * unit / vector.integrals[0];
        assert!((ratio - 1.0).abs() < 2e-3, "vector {i}: {ratio}");
    }
}

// About the corrected optima no shape that keeps the limits costs less, in 48 directions at distances of 0.03 to 3 % in the
// logarithms of the times. The cost is exact to 1e-9; at the gains of the vectors it is higher by up to 1e-5.
#[test]
fn the_corrected_gains_are_optimal() {
    for (i, _) in CORRECTED {
        let problem = problem(&VECTORS[i]);
        let found = optimum(problem).unwrap();
        let mut objective = Objective::new(problem, FINE_GRID);
        let best = polish(&mut objective, &found);
        let mut feasible = 0;
        for step in 0..48 {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(step) / 48.0).sin_cos();
            for distance in [3e-4, 3e-3, 3e-2] {
                let z = [best.z[0] + distance * cos, best.z[1] + distance * sin];
                let gain = objective.gain(&z).unwrap();
                if gain.low > gain.k {
                    continue;
                }
                feasible += 1;
                let cost = objective.fine_cost(&z, gain.k, best.gain.omega, 4.0);
                assert!(cost > best.ln_cost - 1e-9, "vector {i}: {cost} {best:?}");
            }
        }
        // At the ends of the gain that meet, half of the directions keep the limits.
        assert!(feasible > 50, "vector {i}: {feasible}");
    }
}

// Grids of shapes with steps of 4 % about the whole range find no cost that is lower by more than 0.1 %.
#[test]
fn brute_force_finds_nothing_better() {
    for i in [2, 6, 13, 15, 20] {
        let vector = &VECTORS[i];
        let problem = problem(vector);
        let found = optimum(problem).unwrap();
        let mut objective = Objective::new(problem, FINE_GRID);
        objective.is_strict = true;
        let mut least = f64::INFINITY;
        let steps = |from: f64, to: f64, step: f64| {
            (0..=((to - from) / step) as usize).map(move |i| from + step * i as f64)
        };
        if found.z.len() == 1 {
            for ti in steps(-4.0, 3.0, 0.04) {
                least = least.min(objective.cost(&[ti]));
            }
        } else {
            for ti in steps(-3.0, 2.0, 0.1) {
                for td in steps(-5.0, 1.0, 0.1) {
                    least = least.min(objective.cost(&[ti, td]));
                }
            }
        }
        assert!(
            found.ln_cost < least + 1e-3,
            "vector {i}: {} {least}",
            found.ln_cost
        );
    }
}
