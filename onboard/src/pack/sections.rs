//! Contents of the sections of a pack.

use super::{AXES, VALUES};
use crate::floats::Floats;
use crate::signature::LENGTH;

/// Scaling from the outputs of the network to values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputScaling {
    /// Values are the means of the network divided by these.
    pub scales: [f32; VALUES],
    /// Factors for the standard deviations of the network.
    pub temperatures: [f32; VALUES],
    /// Lower limits of the values.
    pub lowest: [f32; VALUES],
    /// Upper limits of the values.
    pub highest: [f32; VALUES],
}

/// Distribution of the shapes of the family: a Gaussian over the first three values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prior {
    /// Mean.
    pub mean: [f32; 3],
    /// Lower triangular root of the covariance.
    pub root: [[f32; 3]; 3],
}

/// Domain that the pack was made for: lowest and highest value of each quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// `ln(T/dt)`, the logarithm of the samples in a period.
    pub ln_samples: [f32; 2],
    /// Duty of a cycle.
    pub duty: [f32; 2],
    /// `beta` of the relay.
    pub beta: [f32; 2],
    /// Phase margin of the controllers in the lead table (rad).
    pub phase_margin_rad: f32,
}

impl Domain {
    /// Whether a signature, and the relay that produced it, are in the domain.
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

/// Lead table as stored. [`Pack::gains_table`](super::Pack::gains_table) has the checked table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadTableBytes<'a> {
    /// Number of points along the first axis.
    pub n: usize,
    /// Number of points along the second axis.
    pub m: usize,
    /// Numbers per point.
    pub fields: usize,
    /// Position of the points.
    pub axes: [f32; AXES],
    /// Numbers, `n m fields` of them.
    pub values: Floats<'a>,
    /// Axes, then values, as little-endian f32.
    pub bytes: &'a [u8],
}

impl LeadTableBytes<'_> {
    /// Number `index` of the values; `None` after the last.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<f32> {
        self.values.get(index)
    }
}

/// Sizes of the parts of a pack (bytes).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Weights, biases and scales of the layers.
    pub weights: usize,
    /// Lead table with its axes.
    pub table: usize,
    /// Card.
    pub card: usize,
    /// Whole file.
    pub total: usize,
}
