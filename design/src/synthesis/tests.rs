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

/// Vectors whose gains differ by up to 8e-4, where the cost is flat. With the largest gain that their shapes allow, 1, 3 and 11
/// cost more than ours, by 7e-10, 1e-5 and 1e-7. No gain of the shapes 8 and 10 keeps the limits: the ends of their intervals
/// miss each other by 8e-6 and 4e-6, and they cost 6e-7 and 2e-6 less.
const LOOSE: [usize; 5] = [1, 3, 8, 10, 11];

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
        let tolerance = if LOOSE.contains(&i) { 1e-3 } else { 1e-5 };
        for (found, expected) in [pid.kp, pid.ki, pid.kd].iter().zip(vector.gains) {
            let off = (found - expected).abs();
            assert!(
                off <= tolerance * expected,
                "vector {i}: {found} {expected}"
            );
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
