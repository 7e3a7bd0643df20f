//! What the sections of a pack hold, as a reader is handed it.

use super::{AXES, VALUES};
use crate::floats::Floats;
use crate::signature::LENGTH;

/// From the network's outputs to values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputScaling {
    /// Values are the network's means over these.
    pub scales: [f32; VALUES],
    /// Times the standard deviations that the network claims.
    pub temperatures: [f32; VALUES],
    /// Lowest values that are believed.
    pub lowest: [f32; VALUES],
    /// Highest values that are believed.
    pub highest: [f32; VALUES],
}

/// How the shapes of the family are distributed: a Gaussian over the first three values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prior {
    /// Its mean.
    pub mean: [f32; 3],
    /// The lower triangular root of its covariance.
    pub root: [[f32; 3]; 3],
}

/// What the pack was made for: lowest and highest of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// `ln(T/dt)`, samples in a period.
    pub ln_samples: [f32; 2],
    /// Duty of a cycle.
    pub duty: [f32; 2],
    /// `beta` of the relay.
    pub beta: [f32; 2],
    /// Phase margin of the controllers in the lead table (rad).
    pub phase_margin_rad: f32,
}

impl Domain {
    /// Whether a signature and the relay behind it are what the pack was made for.
    #[must_use]
    pub fn holds(&self, signature: &[f32; LENGTH], beta: f32) -> bool {
        let [.., duty, ln_samples] = *signature;
        [
            (self.ln_samples, ln_samples),
            (self.duty, duty),
            (self.beta, beta),
        ]
        .iter()
        .all(|([lowest, highest], value)| (lowest..=highest).contains(&value))
    }
}

/// The table of leads as it lies: what its numbers mean is for its reader to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadTableBytes<'a> {
    /// Points along the first axis.
    pub n: usize,
    /// Points along the second axis.
    pub m: usize,
    /// Numbers of each point.
    pub fields: usize,
    /// Four that say where the points lie.
    pub axes: [f32; AXES],
    /// `n m` times as many as there are fields.
    pub values: Floats<'a>,
    /// The axes, then the values: little-endian f32, one behind the other.
    pub bytes: &'a [u8],
}

impl LeadTableBytes<'_> {
    /// Number `index` of the values; `None` beyond the last.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<f32> {
        self.values.get(index)
    }
}

/// Bytes of a pack by what they are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Weights, biases and scales of the layers.
    pub weights: usize,
    /// The lead table, its axes included.
    pub table: usize,
    /// The card.
    pub card: usize,
    /// The file.
    pub total: usize,
}
