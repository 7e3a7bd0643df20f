//! Why bytes are no pack that can be used.

use core::fmt;

use super::{HEADER, MOST_LAYERS, OUTPUTS, VERSION, WIDEST};

/// A part of a pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Section {
    /// Layers of the network.
    Network,
    /// Normalisation of its inputs.
    Inputs,
    /// Scaling of its outputs.
    Outputs,
    /// What the pack was made for.
    Domain,
    /// Threshold and calibration of the unknown.
    Unknown,
    /// How the shapes of the family are distributed.
    Prior,
    /// Table of leads.
    LeadTable,
    /// Signatures with their outputs.
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
    /// There are none.
    Empty,
    /// They begin with something else.
    NotAPack,
    /// A version beyond this reader: which.
    Newer(u32),
    /// Fewer than there were.
    Truncated {
        /// Bytes that there were.
        expected: u64,
        /// Bytes that there are.
        found: usize,
    },
    /// More than there were.
    Longer {
        /// Bytes that there were.
        expected: u64,
        /// Bytes that there are.
        found: usize,
    },
    /// Other than they were.
    Damaged {
        /// The hash that the header names.
        expected: u64,
        /// The hash of what there is.
        found: u64,
    },
    /// A section that goes on beyond the end of the file.
    Ends(Section),
    /// Bytes behind the last section: how many.
    Left(usize),
    /// Too many layers, or none: how many.
    Layers(usize),
    /// A layer that is too wide, or has nothing in it.
    Width {
        /// Which, from 0.
        layer: usize,
        /// Its inputs or outputs.
        width: usize,
    },
    /// A layer whose weights or activation are of an unknown kind.
    Kind {
        /// Which, from 0.
        layer: usize,
    },
    /// A layer that does not take what comes before it.
    Fit {
        /// Which, from 0.
        layer: usize,
        /// What comes before it.
        expected: usize,
        /// Its inputs.
        found: usize,
    },
    /// A last layer of so many outputs.
    Outputs(usize),
    /// A number that is not finite, or not positive where it must be.
    Value {
        /// Where.
        section: Section,
        /// Which of its row, from 0.
        index: usize,
    },
    /// A lowest above its highest.
    Limits {
        /// Where.
        section: Section,
        /// Which, from 0.
        index: usize,
    },
    /// The card is not UTF-8.
    Card,
}

/// What helps where the file is whole but its contents are not.
const REMAKE: &str = "make or export the pack again";

impl fmt::Display for PackError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("there is no pack: it has no bytes"),
            Self::NotAPack => f.write_str("this is no pack of onecycle: it begins otherwise"),
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
                "the pack has {found} bytes where it says {expected}; copy it again"
            ),
            Self::Damaged { expected, found } => write!(
                f,
                "the pack is damaged: its content hash is {found:016x}, not {expected:016x}; copy \
                 it again"
            ),
            Self::Ends(section) => write!(
                f,
                "the section {section} of the pack goes on beyond its end; {REMAKE}"
            ),
            Self::Left(bytes) => write!(
                f,
                "{bytes} bytes of the pack belong to no section; {REMAKE}"
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
                "layer {layer} of the network has {found} inputs where {expected} come in"
            ),
            Self::Outputs(outputs) => write!(
                f,
                "the network must have {OUTPUTS} outputs, but has {outputs}"
            ),
            Self::Value { section, index } => write!(
                f,
                "number {index} in the section {section} of the pack is none that can be there; \
                 {REMAKE}"
            ),
            Self::Limits { section, index } => write!(
                f,
                "limits {index} in the section {section} of the pack are the wrong way round; \
                 {REMAKE}"
            ),
            Self::Card => f.write_str("the card of the pack is not text in UTF-8"),
        }
    }
}

impl core::error::Error for PackError {}
