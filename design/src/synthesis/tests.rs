//! Designs against an independent implementation, brute force, and properties.

use crate::analysis::vectors::VECTORS;
use crate::synthesis::limits::Limits;
use crate::synthesis::objective::Problem;
use crate::synthesis::optimum::optimum;
use crate::synthesis::shape::{Family, Filter};

#[test]
fn costs_of_the_vectors() {
    for (i, vector) in VECTORS.iter().enumerate() {
        let process = vector.process();
        let problem = Problem {
            process,
            family: Family { form: vector.form, filter: Filter::Fixed(vector.filter_s / process.unit_s) },
            limits: Limits::of(vector.m),
            noise: None,
            input_peak: None,
        };
        let t = std::time::Instant::now();
        let found = optimum(problem);
        let el = t.elapsed();
        match found {
            Ok(found) => {
                let law = problem.family.law(&process, &found.z).scaled(found.gain.k).controller(&process);
                println!("{i} {:?} {el:?}: {:.6} {:.6} {:.6}, {:?} iae {:.6} {:.6} ratio {:.2e}", vector.form, law.kp, law.ki, law.kd, vector.gains, found.ln_cost.exp()*process.unit_s*process.gain.powi(if vector.gains[1]==0.0 {0} else {1}), vector.integrals[0],
                found.ln_cost.exp()*process.unit_s*process.gain.powi(if vector.gains[1]==0.0 {0} else {1})/vector.integrals[0] - 1.0);
            }
            Err(e) => println!("{i} {:?} {e:?} {el:?}", vector.form),
        }
    }
}
