//! Finds the candidates near a process without comparing it with all of them.
//!
//! Candidates near each other have similar derivative gains `Kd`, whatever their times: at the same
//! amplitude under the same relay `Kd` is the gain of the loop at its crossover. Measured on 3000
//! random processes of the paper's space, and of one with all times from 1 ms to 10 s and to 1000 s for
//! the body (every pair; either choice of gains):
//!
//! | `J_(ij)` up to                 | 0.02 | 0.05 | 0.1  | 0.3  | 1    |
//! |--------------------------------|------|------|------|------|------|
//! | largest difference of `ln Kd`  | 0.37 | 0.45 | 0.55 | 0.95 | 1.73 |
//! | `reach`                        | 0.61 | 0.74 | 0.87 | 1.22 | 1.90 |
//!
//! Candidates beyond reach are not compared. If one of them is nearer after all, the distance found is
//! too large, never too small: a grid that passes its check does hold.

use crate::space::candidate::Candidate;

/// Candidates in the order of `ln Kd`.
#[derive(Clone, Debug)]
pub struct Index<'a> {
    candidates: Vec<&'a Candidate>,
    /// `ln Kd` and number of each candidate, rising.
    order: Vec<(f64, usize)>,
}

/// Difference of `ln Kd` beyond which no candidate is within this distance.
fn reach(distance: f64) -> f64 {
    0.4 + 1.5 * distance.sqrt()
}

fn ln_kd(candidate: &Candidate) -> f64 {
    candidate.optimum.pd.kd.abs().ln()
}

impl<'a> Index<'a> {
    /// An index of candidates.
    #[must_use]
    pub fn new(candidates: impl IntoIterator<Item = &'a Candidate>) -> Self {
        let candidates: Vec<&Candidate> = candidates.into_iter().collect();
        let mut order: Vec<(f64, usize)> = candidates
            .iter()
            .enumerate()
            .map(|(number, candidate)| (ln_kd(candidate), number))
            .collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Self { candidates, order }
    }

    /// Number of the candidate with the least `J_(ij)`, and that `J_(ij)`; of equals the one with the
    /// nearest `Kd`. `None` without candidates.
    #[must_use]
    pub fn nearest(&self, process: &Candidate) -> Option<(usize, f64)> {
        let key = ln_kd(process);
        let middle = self.order.partition_point(|entry| entry.0 < key);
        let mut below = self.order[..middle].iter().rev().peekable();
        let mut above = self.order[middle..].iter().peekable();
        let mut best: Option<(usize, f64)> = None;
        loop {
            // Outwards from the process, the nearer `Kd` first.
            let is_below = match (below.peek(), above.peek()) {
                (Some(low), Some(high)) => key - low.0 < high.0 - key,
                (low, _) => low.is_some(),
            };
            let side = if is_below { below.next() } else { above.next() };
            let Some(&(other, number)) = side else { break };
            let least = best.map_or(f64::INFINITY, |(_, distance)| distance);
            if (other - key).abs() > reach(least) {
                break;
            }
            match process.distance_below(self.candidates[number], least) {
                Some(distance) => best = Some((number, distance)),
                None if best.is_none() => best = Some((number, f64::INFINITY)),
                None => {}
            }
        }
        best
    }

    /// Numbers of all candidates within `distance`, in the order of `Kd`.
    #[must_use]
    pub fn within(&self, process: &Candidate, distance: f64) -> Vec<usize> {
        let key = ln_kd(process);
        let first = self
            .order
            .partition_point(|entry| entry.0 < key - reach(distance));
        self.order[first..]
            .iter()
            .take_while(|entry| entry.0 <= key + reach(distance))
            .map(|&(_, number)| number)
            .filter(|&number| process.distance(self.candidates[number]) <= distance)
            .collect()
    }
}
