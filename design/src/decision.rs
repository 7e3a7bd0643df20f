//! The controller of least expected cost over all that the process may be, not the best one of the
//! single most probable process.
//!
//! ```text
//! choose C to minimise   mean_i min(|J(C, i) / J*_i - 1|, 1),    i drawn from the posterior
//! ```
//!
//! `J*_i` is the least cost of process `i` at the margin asked for; a controller that costs less has
//! less margin there, so a gain counts as a loss. An unstable loop has no cost; the expectation of one
//! that counts for ever more would be ruled by the last draw of the tail, so it counts as a cost
//! that has doubled, some hundred times what identification usually costs.
//!
//! The controllers to choose from are the optima of the draws: each has the margin asked for on a process
//! that is likely. A free search over both gains finds others of the same expected cost that have a
//! third of the margin.

use onecycle_onboard::{Pd, Soiptd};

use crate::soiptd_pd::cost::ise;
use crate::soiptd_pd::margins::margins;
use crate::soiptd_pd::optimum::{Optimum, pd};

/// Draws that the cost is averaged over and whose optima are tried: the mean of a distribution as
/// wide as itself is then known to a tenth.
pub const DRAWS: usize = 96;

/// What the process may be, each with its optimum.
pub struct Decision {
    optima: Vec<(Soiptd, Optimum)>,
}

impl Decision {
    /// About `processes`, drawn from the posterior: [`DRAWS`] are enough.
    pub fn new(processes: &[Soiptd], phase_margin_rad: f64) -> Self {
        let optimum = |process: &Soiptd| Some((*process, pd(process, phase_margin_rad).ok()?));
        Self {
            optima: processes.iter().filter_map(optimum).collect(),
        }
    }

    /// The best controller, with its cost and margins on `process`, the most probable one; `own` is
    /// that one's own optimum.
    pub fn controller(&self, process: &Soiptd, own: Optimum) -> Optimum {
        let loss = |candidate: &Optimum| self.expected_loss(candidate.pd);
        let best = self
            .optima
            .iter()
            .filter_map(|(_, candidate)| on(process, candidate.pd))
            .map(|candidate| (loss(&candidate), candidate))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((least, candidate)) if least < loss(&own) => candidate,
            _ => own,
        }
    }

    fn expected_loss(&self, controller: Pd) -> f64 {
        let loss = |(process, optimum): &(Soiptd, Optimum)| {
            ise(process, controller).map_or(1.0, |cost| (cost / optimum.ise - 1.0).abs().min(1.0))
        };
        self.optima.iter().map(loss).sum::<f64>() / self.optima.len().max(1) as f64
    }
}

fn on(process: &Soiptd, controller: Pd) -> Option<Optimum> {
    let margins = margins(process, controller)?;
    Some(Optimum {
        pd: controller,
        ise: ise(process, controller)?,
        lead_rad: (controller.kd * margins.gain_crossover_rad_per_s / controller.kp).atan(),
        margins,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARGIN_RAD: f64 = 0.35;

    fn own(process: &Soiptd) -> Optimum {
        pd(process, MARGIN_RAD).unwrap()
    }

    // Of two gains that differ by 10 % one is three times as likely: the expected loss, a sum of absolute
    // values, is least at that one's optimum, whichever is called the most probable.
    #[test]
    fn the_majority_decides() {
        let process = Soiptd::new(1.0, 0.05, 1.0, 0.02).unwrap();
        let strong = process.with_gain_scaled(1.1).unwrap();
        let decision = Decision::new(&[process, strong, strong, strong], MARGIN_RAD);
        let chosen = decision.controller(&process, own(&process));
        let best = own(&strong);
        assert_eq!(chosen.pd, best.pd);
        let cost = ise(&process, chosen.pd).unwrap();
        assert_eq!(chosen.ise, cost);
    }

    // Without a posterior the most probable process decides.
    #[test]
    fn no_draws_change_nothing() {
        let process = Soiptd::new(1.0, 0.05, 1.0, 0.02).unwrap();
        let alone = Decision::new(&[], MARGIN_RAD).controller(&process, own(&process));
        assert_eq!(alone.pd, own(&process).pd);
    }

    // Half of the probability is on a gain three times as large, with which the optimum of the other is
    // unstable: a loss of a whole there. The optimum of the large gain is stable on both.
    #[test]
    fn an_unstable_loop_is_avoided() {
        let process = Soiptd::new(1.0, 0.05, 1.0, 0.02).unwrap();
        let strong = process.with_gain_scaled(3.0).unwrap();
        assert_eq!(ise(&strong, own(&process).pd), None);
        let decision = Decision::new(&[process, strong], MARGIN_RAD);
        let chosen = decision.controller(&process, own(&process));
        assert_eq!(chosen.pd, own(&strong).pd);
    }
}
