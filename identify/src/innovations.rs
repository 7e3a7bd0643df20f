//! Identification from any recording, by an exact likelihood with disturbances.
mod descent;
mod laplace;
mod lifted;
mod likelihood;
mod orthogonal;
mod record;
mod response;
mod search;
mod theta;
#[cfg(test)]
mod vectors;

use onecycle_design::Structure;
pub use record::Hold;
use record::*;
pub use theta::NoiseKind;
pub fn try_it(dt_s: f64, u: &[f64], y: &[f64]) {
    let record = Record {
        uneven_s: vec![],
        dt_s,
        input: u.to_vec(),
        output: y.to_vec(),
        present: vec![true; y.len()],
        hold: Hold::Held,
    };
    let length = dt_s * y.len() as f64;
    let longest = length / 8.0;
    let skip = longest;
    let t0 = std::time::Instant::now();
    let mut all: Vec<search::Candidate> = vec![];
    let m = (record.len() / 1500).max(1);
    let blocks = Blocks::new(&record, m, skip);
    println!("{} blocks of {m}", blocks.len());
    for h in search::HEADS {
        let t = std::time::Instant::now();
        let starts = search::screen(&record, h, skip, longest);
        let a = t.elapsed();
        let t = std::time::Instant::now();
        let c = search::head(&blocks, &starts, longest);
        println!(
            "{} screen {:?} {} head {:?}",
            h.name(),
            a,
            starts.len(),
            t.elapsed()
        );
        all.extend(c);
    }
    all.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    for s in Structure::ALL {
        if search::HEADS.contains(&s) {
            continue;
        }
        let t = std::time::Instant::now();
        let from: Vec<_> = all
            .iter()
            .filter(|c| search::HEADS.contains(&c.structure()))
            .take(3)
            .flat_map(|c| search::derive(&c.found.theta, s, dt_s))
            .collect();
        let c = search::best(from.iter().filter_map(|t| search::fit(&blocks, t, longest)));
        println!("{} {:?} {}", s.name(), t.elapsed(), from.len());
        all.extend(c);
    }
    all.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    println!("{:?}", t0.elapsed());
    let b = all[0].bic;
    for c in all.iter().take(14) {
        let n: Vec<_> = c
            .found
            .theta
            .noises()
            .map(|k| format!("{}={:.3}", k.name(), c.found.theta.noise(k)))
            .collect();
        let p = c.found.theta.process(c.found.at.gain);
        println!(
            "{:22} bic {:+9.1} {:?} gain {:.5} lags {:?} a {:.4} pair {:?} tau {:.5}",
            c.structure().name(),
            c.bic - b,
            n,
            p.gain(),
            p.lags_s(),
            p.pole_per_s(),
            p.pair(),
            p.tau_s()
        );
    }
}
