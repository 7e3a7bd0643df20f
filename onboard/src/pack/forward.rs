//! Evaluation of the network, one layer per slice.

use super::{OUTPUTS, Pack, WIDEST};
use crate::signature::LENGTH;

/// State of the evaluation.
#[derive(Clone, Debug)]
pub(crate) struct Forward {
    /// Inputs and outputs of the layer, alternating.
    rows: [[f32; WIDEST]; 2],
    layer: usize,
}

impl Forward {
    /// All zeros: memory before the first use.
    pub(crate) const NONE: Self = Self {
        rows: [[0.0; WIDEST]; 2],
        layer: 0,
    };

    /// Begins with a normalised signature.
    pub(crate) fn begin(&mut self, pack: &Pack<'_>, signature: &[f32; LENGTH]) {
        *self = Self::NONE;
        let normalised = (pack.offsets.iter().zip(pack.scales.iter())).zip(signature);
        let [inputs, _] = &mut self.rows;
        for (input, ((offset, scale), value)) in inputs.iter_mut().zip(normalised) {
            *input = (value - offset) * scale;
        }
    }

    /// Evaluates the next layer; returns the outputs after the last.
    pub(crate) fn advance(&mut self, pack: &Pack<'_>) -> Option<[f32; OUTPUTS]> {
        let [even, odd] = &mut self.rows;
        let (now, next) = if self.layer.is_multiple_of(2) {
            (even, odd)
        } else {
            (odd, even)
        };
        let mut layers = pack.layers().skip(self.layer);
        let Some(layer) = layers.next() else {
            return Some(core::array::from_fn(|i| now[i]));
        };
        layer.forward(&now[..layer.inputs()], &mut next[..layer.outputs()]);
        self.layer += 1;
        (layers.next().is_none()).then(|| core::array::from_fn(|i| next[i]))
    }
}
