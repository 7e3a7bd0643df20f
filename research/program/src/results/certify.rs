//! Result of `onecycle-lab certify`: limit cycles of the relay on a space of processes, or on single ones.

use onecycle_lab::space::Space;
use onecycle_lab::space::certificate::{Certificate, CertificateSummary, LeastStable};
use onecycle_lab::space::limit_cycle::sampled::{Motion, SampledLimitCycle};

/// The certificates of a space under one input bias.
pub(crate) struct BiasRow {
    pub(crate) summary: CertificateSummary,
    /// Processes whose simulated relay reached a steady oscillation: without trim, with trim.
    pub(crate) settled: [usize; 2],
}

/// The certificates of a space.
pub(crate) struct CertifiedSpace {
    pub(crate) space: Space,
    pub(crate) least_stable: LeastStable,
    /// Certificates without bias, one for each shape.
    pub(crate) unbiased: Vec<Certificate>,
    /// Certificates without bias at the corners of the box.
    pub(crate) corners: Vec<Certificate>,
    pub(crate) rows: Vec<BiasRow>,
}

impl CertifiedSpace {
    /// Whether every process has a stable cycle without bias and, with the trim, under every bias.
    pub(crate) fn holds(&self) -> bool {
        self.least_stable.spectral_radius < 1.0
            && self
                .rows
                .iter()
                .all(|row| row.summary.trimmed == row.summary.processes)
    }
}

/// The certificates of one process, velocity gain 1.
pub(crate) struct CertifiedProcess {
    /// `T_prop`, `T_body`, `tau` (s).
    pub(crate) times_s: [f64; 3],
    /// Relay parameter, the sine of its phase.
    pub(crate) beta: f64,
    /// One entry for each bias.
    pub(crate) biases: Vec<(Certificate, Option<SampledRelay>)>,
}

/// A relay that reads the output at samples only.
pub(crate) struct SampledRelay {
    pub(crate) sample_s: f64,
    /// Cycles without bias; empty under a bias.
    pub(crate) cycles: Vec<SampledLimitCycle>,
    /// Motion from rest, if the relay oscillates at all.
    pub(crate) motion: Option<Motion>,
}
