//! Packs: a trained network, its scaling and its tables in one file, which is the identifier on board.
//!
//! ```text
//! Network -> layers() -> PackContents -> to_bytes()    ->  a file, or the board's flash
//!                                        read()        <-
//! ```
//!
//! The format is documented in [`onecycle_onboard::pack`], whose reader checks every pack before it is
//! returned. The outputs of the self-test are those of the board's code on the machine that makes the
//! pack; [`quantisation`] measures how far they are from the network's own.

mod layers;

use onecycle_onboard::floats::Floats;
use onecycle_onboard::gains::FIELDS;
use onecycle_onboard::network::Activation;
use onecycle_onboard::pack::{
    AXES, Domain, HEADER, MAGIC, OutputScaling, Pack, PackError, Prior, VERSION, content_hash,
};
use onecycle_onboard::signature::LENGTH;

use crate::learn::lead_table::{self, LeadTableError};
use crate::learn::train::{Network, TrainError};

pub use layers::{PackedLayer, PackedWeights, Precision, Quantisation, layers, quantisation};

/// Contents of a pack.
#[derive(Clone, Debug, PartialEq)]
pub struct PackContents {
    /// Layers of the network, first to last.
    pub layers: Vec<PackedLayer>,
    /// Offsets of the inputs: the network sees `(x - offset) scale`.
    pub input_offsets: [f32; LENGTH],
    /// Scales of the inputs.
    pub input_scales: [f32; LENGTH],
    /// Scaling from the network's outputs to values.
    pub output_scaling: OutputScaling,
    /// Domain that the pack is made for.
    pub domain: Domain,
    /// Score above which a cycle is unknown.
    pub unknown_threshold: f32,
    /// Calibration of the score.
    pub calibration: Vec<f32>,
    /// Distribution of the shapes of the family.
    pub prior: Prior,
    /// Table of leads.
    pub lead_table: LeadTableContents,
    /// Signatures of the self-test.
    pub self_tests: Vec<[f32; LENGTH]>,
    /// Recipe, seeds, scores, versions.
    pub card: serde_json::Value,
}

/// A table of leads, as in [`onecycle_onboard::pack::LeadTableBytes`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeadTableContents {
    /// Points along the first axis.
    pub n: usize,
    /// Points along the second axis.
    pub m: usize,
    /// Number of numbers at each point.
    pub fields: usize,
    /// Four numbers that determine where the points lie.
    pub axes: [f32; AXES],
    /// The numbers of all points, `n m` times the number of fields.
    pub values: Vec<f32>,
}

impl LeadTableContents {
    /// A table of these numbers of points and fields, from its axes followed by its values; `None` if
    /// the count does not match.
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

    /// The table of this phase margin (rad, 0 to pi/2), whose controllers cost the fraction `excess` more than the optimum.
    ///
    /// # Errors
    /// [`LeadTableError`]: there is no table for this margin.
    pub(super) fn for_phase_margin(
        phase_margin_rad: f64,
        excess: f64,
    ) -> Result<Self, LeadTableError> {
        let numbers = lead_table::build(phase_margin_rad, excess, lead_table::POINTS)?;
        let table = Self::of_numbers([lead_table::POINTS; 2], FIELDS, &numbers);
        Ok(table.unwrap_or_default())
    }
}

/// Why a pack cannot be made or read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PackContentsError {
    /// The board's reader refuses the pack.
    #[error("{0}")]
    Pack(#[from] PackError),
    /// A pack cannot hold a layer.
    #[error(
        "layer {index} of the network, {layer}, does not fit into a pack: a pack holds dense \
         layers, each with at most one relu or tanh after it"
    )]
    Layer {
        /// Number of the layer, from 0.
        index: usize,
        /// Kind of the layer.
        layer: &'static str,
    },
    /// The card is not JSON.
    #[error("the card of the pack is not JSON: {0}")]
    Card(String),
    /// There is no table for a phase margin.
    #[error("{0}")]
    Table(#[from] LeadTableError),
    /// Sizes or numbers that no network has.
    #[error("{0}")]
    Train(#[from] TrainError),
}

impl PackContents {
    /// Copies the contents of a pack.
    ///
    /// # Errors
    /// [`PackContentsError::Card`]: the card is not JSON.
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

    /// The bytes of the pack; the board's reader has checked them.
    ///
    /// # Errors
    /// [`PackContentsError::Pack`]: the reader refuses the pack.
    pub fn to_bytes(&self) -> Result<Vec<u8>, PackContentsError> {
        // First without the outputs of the self-test, then with the outputs of that pack.
        let without = self.file(&[]);
        let pack = Pack::read(&without)?;
        let self_tests: Vec<_> = (self.self_tests.iter())
            .flat_map(|signature| signature.iter().copied().chain(pack.outputs(signature)))
            .collect();
        let bytes = self.file(&self_tests);
        Pack::read(&bytes)?;
        Ok(bytes)
    }

    /// The same identifier with controllers of another phase margin (rad, 0 to pi/2): the table of leads is computed again,
    /// nothing is trained. The controllers cost the fraction `excess` more than the optimum and are quieter for it.
    ///
    /// # Errors
    /// [`PackContentsError::Table`]: there is no table for this margin.
    pub fn with_phase_margin(
        self,
        phase_margin_rad: f64,
        excess: f64,
    ) -> Result<Self, PackContentsError> {
        Ok(Self {
            lead_table: LeadTableContents::for_phase_margin(phase_margin_rad, excess)?,
            domain: Domain {
                phase_margin_rad: phase_margin_rad as f32,
                ..self.domain
            },
            ..self
        })
    }

    /// The network with the weights that the bytes stand for.
    ///
    /// # Errors
    /// [`PackContentsError::Train`]: the layers have sizes or numbers that no network has.
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

/// Numbers too large for the format are limited to the largest one; the reader then refuses the pack.
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
