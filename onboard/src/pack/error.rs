//! Errors of reading a pack.

use core::fmt;

use super::{HEADER, MOST_LAYERS, OUTPUTS, VERSION, WIDEST};

/// Section of a pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Section {
    /// Layers of the network.
    Network,
    /// Normalisation of the network's inputs.
    Inputs,
    /// Scaling of the network's outputs.
    Outputs,
    /// Domain that the pack was made for.
    Domain,
    /// Threshold and calibration of the score.
    Unknown,
    /// Distribution of the shapes of the family.
    Prior,
    /// Lead table.
    LeadTable,
    /// Self-test.
    SelfTest,
    /// Card.
    Card,
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Network => "network",
            Self::Inputs => "inputs",
            Self::Outputs => "outputs",
            Self::Domain => "domain",
            Self::Unknown => "unknown",
            Self::Prior => "prior",
            Self::LeadTable => "lead table",
            Self::SelfTest => "self-test",
            Self::Card => "card",
        })
    }
}

/// What is wrong with the bytes of a pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PackError {
    /// There are no bytes.
    Empty,
    /// The first bytes are not those of a pack.
    NotAPack,
    /// The version is newer than this reader: its number.
    Newer(u32),
    /// The file is too short.
    Truncated {
        /// Length in the header (bytes).
        expected: u64,
        /// Length found (bytes).
        found: usize,
    },
    /// The file is too long.
    Longer {
        /// Length in the header (bytes).
        expected: u64,
        /// Length found (bytes).
        found: usize,
    },
    /// The content differs from its hash.
    Damaged {
        /// Hash in the header.
        expected: u64,
        /// Hash of the content.
        found: u64,
    },
    /// A section continues after the end of the file.
    Ends(Section),
    /// There are bytes after the last section: their number.
    Left(usize),
    /// Wrong number of layers: the number.
    Layers(usize),
    /// A layer is too wide or empty.
    Width {
        /// Index of the layer, from 0.
        layer: usize,
        /// Number of its inputs or outputs.
        width: usize,
    },
    /// The weights or the activation of a layer are of an unknown kind.
    Kind {
        /// Index of the layer, from 0.
        layer: usize,
    },
    /// The inputs of a layer do not match the outputs before it.
    Fit {
        /// Index of the layer, from 0.
        layer: usize,
        /// Number of outputs before it.
        expected: usize,
        /// Number of its inputs.
        found: usize,
    },
    /// The last layer has a wrong number of outputs: the number.
    Outputs(usize),
    /// A number is not finite, or not positive where it must be.
    Value {
        /// Section.
        section: Section,
        /// Index in its row, from 0.
        index: usize,
    },
    /// A lower limit exceeds its upper limit.
    Limits {
        /// Section.
        section: Section,
        /// Index of the limits, from 0.
        index: usize,
    },
    /// The card is not UTF-8.
    Card,
}

/// Advice if the file is complete but its contents are not valid.
const REMAKE: &str = "make or export the pack again";

impl fmt::Display for PackError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("the pack is empty: it has no bytes"),
            Self::NotAPack => {
                f.write_str("this is not a pack of onecycle: its first bytes are wrong")
            }
            Self::Newer(version) => write!(
                f,
                "the pack was made by a newer onecycle, in version {version} of the format, where \
                 {VERSION} is known here; update onecycle"
            ),
            Self::Truncated { expected, found } if *expected == HEADER as u64 => write!(
                f,
                "the pack is cut off within its header, after {found} bytes; copy it again"
            ),
            Self::Truncated { expected, found } => write!(
                f,
                "the pack is cut off after {found} of {expected} bytes; copy it again"
            ),
            Self::Longer { expected, found } => write!(
                f,
                "the pack has {found} bytes, but its header says {expected}; copy it again"
            ),
            Self::Damaged { expected, found } => write!(
                f,
                "the pack is damaged: its content hash is {found:016x}, not {expected:016x}; copy \
                 it again"
            ),
            Self::Ends(section) => write!(
                f,
                "the section {section} of the pack continues after its end; {REMAKE}"
            ),
            Self::Left(bytes) => write!(
                f,
                "{bytes} bytes follow the last section of the pack; {REMAKE}"
            ),
            Self::Layers(layers) => write!(
                f,
                "the network must have 1 to {MOST_LAYERS} layers, but has {layers}"
            ),
            Self::Width { layer, width } => write!(
                f,
                "layer {layer} of the network must be 1 to {WIDEST} wide, but is {width}"
            ),
            Self::Kind { layer } => write!(
                f,
                "layer {layer} of the network has weights or an activation of an unknown kind; \
                 {REMAKE}"
            ),
            Self::Fit {
                layer,
                expected,
                found,
            } => write!(
                f,
                "layer {layer} of the network has {found} inputs, but gets {expected}"
            ),
            Self::Outputs(outputs) => write!(
                f,
                "the network must have {OUTPUTS} outputs, but has {outputs}"
            ),
            Self::Value { section, index } => write!(
                f,
                "number {index} in the section {section} of the pack is out of range; {REMAKE}"
            ),
            Self::Limits { section, index } => write!(
                f,
                "limits {index} in the section {section} of the pack are reversed; {REMAKE}"
            ),
            Self::Card => f.write_str("the card of the pack is not valid UTF-8"),
        }
    }
}

impl core::error::Error for PackError {}
