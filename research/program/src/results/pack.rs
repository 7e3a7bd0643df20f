//! Results of `onecycle-lab pack verify` and `onecycle-lab pack import`.

use std::path::PathBuf;

use onecycle_cli::packs::passes;
use onecycle_lab::learn::pack::Quantisation;
use onecycle_onboard::pack::Pack;

/// The self-test of a pack.
pub(crate) struct VerifiedPack<'a> {
    pub(crate) name: String,
    pub(crate) pack: &'a Pack<'a>,
    /// Largest difference of an output from the stored one; `None` if the pack stores no test signature.
    pub(crate) worst: Option<f32>,
}

impl VerifiedPack<'_> {
    /// Whether all outputs are within the tolerance.
    pub(crate) fn passes(&self) -> bool {
        passes(self.worst)
    }
}

/// A network imported into a pack.
pub(crate) struct ImportedPack<'a> {
    /// File of the network.
    pub(crate) model: PathBuf,
    /// Name of the pack that everything else was taken from.
    pub(crate) like: String,
    /// File of the new pack.
    pub(crate) out: PathBuf,
    pub(crate) pack: &'a Pack<'a>,
    /// Whether the model has its own normalisation of the inputs.
    pub(crate) brings_normalisation: bool,
    /// Effect of rounding the weights.
    pub(crate) changed: Quantisation,
    /// Random signatures that the effect was measured on.
    pub(crate) samples: usize,
}
