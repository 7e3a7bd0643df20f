//! Packs: from a trained network, its scaling and its tables to the one file that an identifier is.
//!
//! ```text
//! Network -> layers() -> PackContents -> to_bytes()    ->  a file, or the board's flash
//!                                        read()        <-
//! ```
//!
//! The format stands in [`onecycle_onboard::pack`], whose reader checks whatever is written here
//! before it is handed out. The outputs of the self-test are those of the code that flies, on the
//! machine that makes the pack; [`quantisation`] says how far they are from the network's own.

mod layers;

use onecycle_onboard::floats::Floats;
use onecycle_onboard::network::Activation;
use onecycle_onboard::pack::{
    AXES, Domain, HEADER, MAGIC, OutputScaling, Pack, PackError, Prior, VERSION, content_hash,
};
use onecycle_onboard::signature::LENGTH;

use crate::learn::train::{Network, TrainError};

pub use layers::{PackedLayer, PackedWeights, Precision, Quantisation, layers, quantisation};

/// What a pack holds.
#[derive(Clone, Debug, PartialEq)]
pub struct PackContents {
    /// Layers of the network, first to last.
    pub layers: Vec<PackedLayer>,
    /// The network sees `(x - offset) scale`: offsets.
    pub input_offsets: [f32; LENGTH],
    /// The network sees `(x - offset) scale`: scales.
    pub input_scales: [f32; LENGTH],
    /// From the network's outputs to values.
    pub output_scaling: OutputScaling,
    /// What the pack is made for.
    pub domain: Domain,
    /// The score from which a cycle is unknown.
    pub unknown_threshold: f32,
    /// Calibration of the score.
    pub calibration: Vec<f32>,
    /// How the shapes of the family are distributed.
    pub prior: Prior,
    /// Table of leads.
    pub lead_table: LeadTableContents,
    /// Signatures of the self-test.
    pub self_tests: Vec<[f32; LENGTH]>,
    /// Recipe, seeds, scores, versions.
    pub card: serde_json::Value,
}

/// A table of leads, as [`onecycle_onboard::pack::LeadTableBytes`] hands it out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeadTableContents {
    /// Points along the first axis.
    pub n: usize,
    /// Points along the second axis.
    pub m: usize,
    /// Numbers of each point.
    pub fields: usize,
    /// Four that say where the points lie.
    pub axes: [f32; AXES],
    /// `n m` times as many as there are fields.
    pub values: Vec<f32>,
}

impl LeadTableContents {
    /// Of so many points and fields, its axes and values one behind the other; `None` where they are
    /// not that many.
    #[must_use]
    pub fn of_numbers([n, m]: [usize; 2], fields: usize, numbers: &[f32]) -> Option<Self> {
        let (axes, values) = numbers.split_first_chunk()?;
        (n.checked_mul(m)?.checked_mul(fields)? == values.len()).then(|| Self {
            n,
            m,
            fields,
            axes: *axes,
            values: values.to_vec(),
        })
    }
}

/// Why there is no pack, or none of this network.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PackContentsError {
    /// What the board's reader says of it.
    #[error("{0}")]
    Pack(#[from] PackError),
    /// A layer that a pack cannot hold.
    #[error(
        "layer {index} of the network, {layer}, has no place in a pack: it holds dense layers, \
         each with one relu or tanh behind it or none"
    )]
    Layer {
        /// Which, from 0.
        index: usize,
        /// Of which kind.
        layer: &'static str,
    },
    /// The card is no JSON.
    #[error("the card of the pack is not JSON: {0}")]
    Card(String),
    /// Sizes or numbers that no network has.
    #[error("{0}")]
    Train(#[from] TrainError),
}

impl PackContents {
    /// What a pack holds, copied.
    ///
    /// # Errors
    /// Where the card is no JSON.
    pub fn read(pack: &Pack<'_>) -> Result<Self, PackContentsError> {
        let card = serde_json::from_str(pack.card());
        let table = pack.lead_table();
        let row = |floats: Floats<'_>| floats.first().unwrap_or([0.0; LENGTH]);
        Ok(Self {
            layers: pack.layers().map(PackedLayer::of).collect(),
            input_offsets: row(pack.input_offsets()),
            input_scales: row(pack.input_scales()),
            output_scaling: *pack.output_scaling(),
            domain: *pack.domain(),
            unknown_threshold: pack.unknown_threshold(),
            calibration: pack.calibration().iter().collect(),
            prior: *pack.prior(),
            lead_table: LeadTableContents {
                n: table.n,
                m: table.m,
                fields: table.fields,
                axes: table.axes,
                values: table.values.iter().collect(),
            },
            self_tests: pack.self_tests().map(|(signature, _)| signature).collect(),
            card: card.map_err(|error| PackContentsError::Card(error.to_string()))?,
        })
    }

    /// The bytes of the pack, which the board's reader has read.
    ///
    /// # Errors
    /// What that reader says.
    pub fn to_bytes(&self) -> Result<Vec<u8>, PackContentsError> {
        // Once without the outputs, once with what that pack puts out.
        let without = self.file(&[]);
        let pack = Pack::read(&without)?;
        let self_tests: Vec<_> = (self.self_tests.iter())
            .flat_map(|signature| signature.iter().copied().chain(pack.outputs(signature)))
            .collect();
        let bytes = self.file(&self_tests);
        Pack::read(&bytes)?;
        Ok(bytes)
    }

    /// The network in full precision: what its bytes stand for.
    ///
    /// # Errors
    /// Where the layers are none of a network.
    pub fn network(&self) -> Result<Network, PackContentsError> {
        layers::network(&self.layers)
    }

    fn file(&self, self_tests: &[f32]) -> Vec<u8> {
        let mut body = Body::default();
        body.count(self.layers.len());
        self.layers.iter().for_each(|layer| body.layer(layer));
        body.floats(&self.input_offsets);
        body.floats(&self.input_scales);
        let OutputScaling {
            scales,
            temperatures,
            lowest,
            highest,
        } = &self.output_scaling;
        for four in [scales, temperatures, lowest, highest] {
            body.floats(four);
        }
        let domain = &self.domain;
        for limits in [domain.ln_samples, domain.duty, domain.beta] {
            body.floats(&limits);
        }
        body.floats(&[domain.phase_margin_rad, self.unknown_threshold]);
        body.count(self.calibration.len());
        body.floats(&self.calibration);
        body.floats(&self.prior.mean);
        body.floats(self.prior.root.as_flattened());
        body.count(self.lead_table.n);
        body.count(self.lead_table.m);
        body.count(self.lead_table.fields);
        body.floats(&self.lead_table.axes);
        body.floats(&self.lead_table.values);
        body.count(if self_tests.is_empty() {
            0
        } else {
            self.self_tests.len()
        });
        body.floats(self_tests);
        let card = self.card.to_string();
        body.count(card.len());
        body.0.extend(card.as_bytes());

        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(saturated(HEADER + body.0.len()).to_le_bytes());
        bytes.extend(content_hash(&body.0).to_le_bytes());
        bytes.extend(body.0);
        bytes
    }
}

/// What is too large for the format is, as the largest number, too large for what follows: the
/// reader says so.
fn saturated(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// The sections of a file.
#[derive(Default)]
struct Body(Vec<u8>);

impl Body {
    fn count(&mut self, count: usize) {
        self.0.extend(saturated(count).to_le_bytes());
    }

    fn floats(&mut self, values: &[f32]) {
        self.0
            .extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }

    fn layer(&mut self, layer: &PackedLayer) {
        for width in [layer.inputs, layer.biases.len()] {
            let width = u16::try_from(width).unwrap_or(u16::MAX);
            self.0.extend(width.to_le_bytes());
        }
        let kind = match layer.weights {
            PackedWeights::Floats(_) => 0,
            PackedWeights::Bytes { .. } => 1,
        };
        let activation = match layer.activation {
            Activation::None => 0,
            Activation::Relu => 1,
            Activation::Tanh => 2,
        };
        self.0.extend([kind, activation, 0, 0]);
        self.floats(&layer.biases);
        match &layer.weights {
            PackedWeights::Floats(weights) => self.floats(weights),
            PackedWeights::Bytes { rows, scales } => {
                self.floats(scales);
                self.0
                    .extend(rows.iter().map(|weight| weight.cast_unsigned()));
            }
        }
    }
}
