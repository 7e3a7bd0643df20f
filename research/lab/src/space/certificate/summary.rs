//! Summary of many certificates under one bias.

use super::{Certificate, CycleStability};
use crate::space::Range;
use crate::space::limit_cycle::LimitCycle;

/// Summary for a set of processes under one bias.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CertificateSummary {
    /// Constant added to the relay's output, whose amplitude is one.
    pub bias: f64,
    /// Number of processes.
    pub processes: usize,
    /// Number of processes without a stable cycle at zero bias.
    pub unbiased_failures: usize,
    /// The bare relay.
    pub bare: RelayCounts,
    /// The relay with turning back.
    pub turned_back: RelayCounts,
    /// Number of processes with a stable cycle while the trim cancels the bias.
    pub trimmed: usize,
    /// The largest spectral radius of those cycles.
    pub trimmed_radius: Option<f64>,
}

/// Counts for a kind of relay.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct RelayCounts {
    /// Processes with one stable cycle.
    pub stable: usize,
    /// Processes with two stable cycles or more.
    pub coexisting: usize,
    /// Processes with cycles of which none is stable.
    pub unstable: usize,
    /// Processes without a cycle of two switches.
    pub no_cycle: usize,
    /// The least and the largest number of stable cycles of a process.
    pub stable_cycles: (usize, usize),
    /// Shortest and longest stable period, over the period of the same process without bias.
    pub stretch: Option<Range>,
    /// The largest spectral radius of a cycle, stable or not.
    pub radius: Option<f64>,
    /// Over all processes, the largest of the smallest spectral radius of each.
    pub best_radius: Option<f64>,
}

impl CertificateSummary {
    /// Summarises certificates under one bias.
    #[must_use]
    pub fn of(bias: f64, certificates: &[Certificate]) -> Self {
        let trimmed = certificates.iter().filter_map(|c| c.trimmed);
        Self {
            bias,
            processes: certificates.len(),
            unbiased_failures: certificates
                .iter()
                .filter(|c| !c.unbiased.is_some_and(|cycle| cycle.is_stable()))
                .count(),
            bare: RelayCounts::of(certificates.iter().map(|c| (c.unbiased, c.bare.clone()))),
            turned_back: RelayCounts::of(certificates.iter().map(|c| {
                let halved = c.turned_back.iter().map(|&(_, cycle)| cycle);
                (c.unbiased, c.bare.iter().copied().chain(halved).collect())
            })),
            trimmed: trimmed.clone().filter(|&radius| radius < 1.0).count(),
            trimmed_radius: trimmed.reduce(f64::max),
        }
    }
}

impl RelayCounts {
    fn of(processes: impl Iterator<Item = (Option<LimitCycle>, Vec<LimitCycle>)>) -> Self {
        let mut kind = Self {
            stable_cycles: (usize::MAX, 0),
            ..Self::default()
        };
        for (unbiased, cycles) in processes {
            match CycleStability::of(&cycles) {
                CycleStability::Stable => kind.stable += 1,
                CycleStability::Coexisting => kind.coexisting += 1,
                CycleStability::Unstable => kind.unstable += 1,
                CycleStability::NoCycle => kind.no_cycle += 1,
            }
            let stable = cycles.iter().filter(|cycle| cycle.is_stable());
            let (fewest, most) = kind.stable_cycles;
            let count = stable.clone().count();
            kind.stable_cycles = (fewest.min(count), most.max(count));
            let radii = || cycles.iter().map(|cycle| cycle.spectral_radius);
            kind.radius = largest(kind.radius, radii().reduce(f64::max));
            kind.best_radius = largest(kind.best_radius, radii().reduce(f64::min));
            for ratio in stable.filter_map(|cycle| Some(cycle.period_s() / unbiased?.period_s())) {
                let (low, high) = kind.stretch.unwrap_or((ratio, ratio));
                kind.stretch = Some((low.min(ratio), high.max(ratio)));
            }
        }
        kind.stable_cycles.0 = kind.stable_cycles.0.min(kind.stable_cycles.1);
        kind
    }
}

fn largest(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).reduce(f64::max)
}
