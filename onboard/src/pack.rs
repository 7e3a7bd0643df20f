//! Pack: network, calibration, prior and lead table in one file that is read in place.
//!
//! The file is checked once and then borrowed: nothing is copied, there is no heap, and any bytes give a
//! [`PackError`] at worst. All numbers are little endian, at any address.
//!
//! | offset | type              | meaning                                                              |
//! |--------|-------------------|----------------------------------------------------------------------|
//! | 0      | 8 bytes           | `4f 4e 45 43 59 43 1a 0a`, "ONECYC" and two bytes that text transfers would change |
//! | 8      | u32               | version of the format, 1                                             |
//! | 12     | u32               | length of the file (bytes)                                           |
//! | 16     | u64               | FNV-1a hash of all bytes from 24 on                                  |
//! | 24     |                   | the sections, in this order                                          |
//!
//! | section     | type              | meaning                                                         |
//! |-------------|-------------------|-----------------------------------------------------------------|
//! | network     | u32               | number of layers, 1 to 6; then for each layer:                  |
//! |             | u16, u16          | inputs and outputs, 1 to 128                                    |
//! |             | u8                | weights: 0 f32, 1 bytes                                         |
//! |             | u8                | activation: 0 none, 1 relu, 2 tanh                              |
//! |             | u16               | 0                                                               |
//! |             | outputs f32       | biases                                                          |
//! |             | outputs f32       | only with byte weights: scale of each row                       |
//! |             | inputs x outputs  | weights, one row per output: f32, or two's complement bytes     |
//! | inputs      | 34 f32, 34 f32    | offsets, then scales: the network sees `(x - offset) scale`     |
//! | outputs     | 4 f32             | scales: values are the means of the network over these          |
//! |             | 4 f32             | temperatures: factors for the standard deviations               |
//! |             | 4 f32, 4 f32      | lowest and highest values                                       |
//! | domain      | 3 times 2 f32     | lowest and highest `ln(T/dt)`, duty and beta                    |
//! |             | f32               | phase margin of the gains (rad)                                 |
//! | unknown     | f32               | score above which a cycle is unknown                            |
//! |             | u32, that many f32| calibration of the score                                        |
//! | prior       | 3 f32             | mean of the first three values over the family                  |
//! |             | 3 times 3 f32     | root of their covariance, lower triangular, row by row          |
//! | lead table  | u32, u32          | points `n` along its first axis, `m` along its second           |
//! |             | u32               | numbers `k` per point                                           |
//! |             | 4 f32             | position of the points                                          |
//! |             | n m k f32         | the numbers                                                     |
//! | self-test   | u32; then for each:| number of signatures                                           |
//! |             | 34 f32, 14 f32    | a signature, and the outputs expected for it                    |
//! | card        | u32, that many    | JSON in UTF-8: recipe, seeds, scores, versions; ends the file   |
//!
//! A reader rejects versions that it does not know; any change of these tables changes the version. The 14
//! outputs of a network are the means of the four values, the logarithms of the diagonal of the Cholesky factor
//! of their precision, and the elements below it, row by row.
//!
//! Reference: G. Fowler, L. C. Noll, K.-P. Vo, D. Eastlake, "The FNV non-cryptographic hash algorithm",
//! draft-eastlake-fnv. Each step is invertible, so every change of a single byte is detected. The hash does not
//! protect against intent.

mod cursor;
mod error;
mod forward;
mod sections;

use crate::floats::Floats;
use crate::gains::LeadTable;
use crate::network::{Activation, Dense, Weights};
use crate::signature::LENGTH;

use self::cursor::Cursor;
pub use self::error::{PackError, Section};
pub(crate) use self::forward::Forward;
pub use self::sections::{Domain, LeadTableBytes, OutputScaling, Prior, Sizes};

/// First bytes of every pack.
pub const MAGIC: [u8; 8] = *b"ONECYC\x1a\n";
/// Version of the format that this reader knows.
pub const VERSION: u32 = 1;
/// Structure of the processes that a pack of this version is for, by its name off board: an integrator with two lags
/// and a delay.
pub const STRUCTURE: &str = "soiptd";
/// Excitation that a pack of this version is for, by its name off board: a two-level relay.
pub const EXCITATION: &str = "relay";
/// Form of the controllers in the table of a pack of this version, by its name off board.
pub const CONTROLLER_FORM: &str = "pd";
/// Number of bytes before the first section.
pub const HEADER: usize = 24;

/// Number of values that describe a process.
pub const VALUES: usize = 4;
/// Number of outputs of the network: means, and the Cholesky factor of the precision.
pub const OUTPUTS: usize = 2 * VALUES + VALUES * (VALUES - 1) / 2;

/// Numbers that give the position of the lead table's points.
pub const AXES: usize = 4;

/// Maximum number of layers: twice what any pack has needed so far.
pub const MOST_LAYERS: usize = 6;
/// Maximum width of a layer: two rows of it are the work memory, 1 KiB of a board's stack.
pub const WIDEST: usize = 128;

/// Largest accepted difference from the outputs of the self-test, relative for outputs beyond one. The
/// arithmetic has the same bits on every machine. Sums in another order, as in a later version, differ by 1e-6;
/// a wrong weight differs by a hundredth.
pub const SELF_TEST_TOLERANCE: f32 = 1e-5;

/// The embedded pack.
pub const DEFAULT: &[u8] = include_bytes!("../packs/default.pack");

/// A pack whose bytes have been checked. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pack<'a> {
    bytes: &'a [u8],
    hash: u64,
    layers: [Option<Dense<'a>>; MOST_LAYERS],
    offsets: Floats<'a>,
    scales: Floats<'a>,
    output_scaling: OutputScaling,
    domain: Domain,
    unknown_threshold: f32,
    calibration: Floats<'a>,
    prior: Prior,
    lead_table: LeadTableBytes<'a>,
    gains_table: Option<LeadTable<'a>>,
    self_tests: Floats<'a>,
    card: &'a str,
}

impl Pack<'static> {
    /// The embedded pack.
    ///
    /// # Errors
    /// [`PackError::Empty`] in a build without one.
    pub fn embedded() -> Result<Self, PackError> {
        Self::read(DEFAULT)
    }
}

impl<'a> Pack<'a> {
    /// Checks the bytes of a pack and borrows them.
    ///
    /// # Errors
    /// What is wrong with the bytes, and where.
    pub fn read(bytes: &'a [u8]) -> Result<Self, PackError> {
        let (hash, body) = checked_body(bytes)?;
        let mut cursor = Cursor::new(body);
        let layers = network(&mut cursor)?;

        cursor.enter(Section::Inputs);
        let offsets = cursor.finite(LENGTH)?;
        let scales = cursor.finite(LENGTH)?;

        cursor.enter(Section::Outputs);
        let output_scaling = OutputScaling {
            scales: cursor.positive()?,
            temperatures: cursor.positive()?,
            lowest: cursor.array()?,
            highest: cursor.array()?,
        };
        let (lowest, highest) = (output_scaling.lowest, output_scaling.highest);
        cursor.ordered(lowest.into_iter().zip(highest))?;

        cursor.enter(Section::Domain);
        let domain = Domain {
            ln_samples: cursor.array()?,
            duty: cursor.array()?,
            beta: cursor.array()?,
            phase_margin_rad: cursor.array::<1>()?[0],
        };
        let limits = [domain.ln_samples, domain.duty, domain.beta];
        cursor.ordered(limits.map(|[low, high]| (low, high)).into_iter())?;

        cursor.enter(Section::Unknown);
        let [unknown_threshold] = cursor.array()?;
        let count = cursor.count()?;
        let calibration = cursor.finite(count)?;

        cursor.enter(Section::Prior);
        let prior = Prior {
            mean: cursor.array()?,
            root: [cursor.array()?, cursor.array()?, cursor.array()?],
        };

        let lead_table = lead_table(&mut cursor)?;
        let gains_table = LeadTable::from_bytes(lead_table.bytes).ok();

        cursor.enter(Section::SelfTest);
        let count = cursor.count()?;
        let each = LENGTH + OUTPUTS;
        let self_tests = cursor.finite(count.checked_mul(each).ok_or(cursor.ends())?)?;

        cursor.enter(Section::Card);
        let length = cursor.count()?;
        let card = core::str::from_utf8(cursor.bytes(length)?).map_err(|_| PackError::Card)?;
        match cursor.left() {
            0 => Ok(Self {
                bytes,
                hash,
                layers,
                offsets,
                scales,
                output_scaling,
                domain,
                unknown_threshold,
                calibration,
                prior,
                lead_table,
                gains_table,
                self_tests,
                card,
            }),
            left => Err(PackError::Left(left)),
        }
    }

    /// Outputs of the network for a signature; the [module](self) gives their meaning.
    #[must_use]
    pub fn outputs(&self, signature: &[f32; LENGTH]) -> [f32; OUTPUTS] {
        let mut forward = Forward::NONE;
        forward.begin(self, signature);
        loop {
            if let Some(outputs) = forward.advance(self) {
                return outputs;
            }
        }
    }

    /// Largest difference from the outputs of the self-test, relative for outputs beyond one; `None` if the pack
    /// has no self-test.
    #[must_use]
    pub fn self_test(&self) -> Option<f32> {
        self.self_tests()
            .flat_map(|(signature, expected)| {
                let found = self.outputs(&signature);
                (found.into_iter().zip(expected))
                    .map(|(found, expected)| (found - expected).abs() / expected.abs().max(1.0))
            })
            // NaN counts as the largest difference.
            .reduce(|worst, next| if next <= worst { worst } else { next })
    }

    /// Signatures of the self-test and the outputs expected for them.
    pub fn self_tests(&self) -> impl Iterator<Item = ([f32; LENGTH], [f32; OUTPUTS])> + use<'a> {
        let (numbers, each) = (self.self_tests, LENGTH + OUTPUTS);
        (0..numbers.len() / each).filter_map(move |i| {
            let signature = numbers.range(i * each, LENGTH)?.first()?;
            let outputs = numbers.range(i * each + LENGTH, OUTPUTS)?.first()?;
            Some((signature, outputs))
        })
    }

    /// Layers of the network, first to last.
    pub fn layers(&self) -> impl Iterator<Item = &Dense<'a>> {
        self.layers.iter().flatten()
    }

    /// Offsets that are subtracted from the values of a signature.
    #[must_use]
    pub fn input_offsets(&self) -> Floats<'a> {
        self.offsets
    }

    /// Scales that the differences are multiplied by.
    #[must_use]
    pub fn input_scales(&self) -> Floats<'a> {
        self.scales
    }

    /// Scaling from the outputs of the network to values.
    #[must_use]
    pub fn output_scaling(&self) -> &OutputScaling {
        &self.output_scaling
    }

    /// Domain that the pack was made for.
    #[must_use]
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Score above which a cycle is unknown.
    #[must_use]
    pub fn unknown_threshold(&self) -> f32 {
        self.unknown_threshold
    }

    /// Calibration of the score.
    #[must_use]
    pub fn calibration(&self) -> Floats<'a> {
        self.calibration
    }

    /// Distribution of the shapes of the family.
    #[must_use]
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// The lead table, checked when the pack was read. `None` if its numbers are not those of a [`LeadTable`].
    #[must_use]
    pub fn gains_table(&self) -> Option<&LeadTable<'a>> {
        self.gains_table.as_ref()
    }

    /// The lead table as stored in the pack.
    #[must_use]
    pub fn lead_table(&self) -> LeadTableBytes<'a> {
        self.lead_table
    }

    /// Card in JSON: recipe, seeds, scores, versions.
    #[must_use]
    pub fn card(&self) -> &'a str {
        self.card
    }

    /// FNV-1a hash of everything after the header; it identifies the pack.
    #[must_use]
    pub fn content_hash(&self) -> u64 {
        self.hash
    }

    /// Sizes of the parts of the pack.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        let weights = self.layers().map(|layer| {
            let of_weights = match layer.weights() {
                Weights::Floats(weights) => 4 * weights.len(),
                Weights::Bytes { rows, scales } => rows.len() + 4 * scales.len(),
            };
            of_weights + 4 * layer.biases().len()
        });
        Sizes {
            weights: weights.sum(),
            table: self.lead_table.bytes.len(),
            card: self.card.len(),
            total: self.bytes.len(),
        }
    }
}

/// FNV-1a hash, 64 bits.
#[must_use]
pub fn content_hash(bytes: &[u8]) -> u64 {
    // Offset basis and prime of the reference.
    const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0100_0000_01b3;
    bytes.iter().fold(BASIS, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(PRIME)
    })
}

/// Checks the header and returns the hash and the bytes of the sections.
fn checked_body(bytes: &[u8]) -> Result<(u64, &[u8]), PackError> {
    let found = bytes.len();
    if found == 0 {
        return Err(PackError::Empty);
    }
    let magic = &MAGIC[..found.min(MAGIC.len())];
    if !bytes.starts_with(magic) {
        return Err(PackError::NotAPack);
    }
    let truncated = |expected| PackError::Truncated { expected, found };
    let (header, body) = bytes
        .split_first_chunk::<HEADER>()
        .ok_or(truncated(HEADER as u64))?;
    let mut header = Cursor::new(header);
    header.bytes(MAGIC.len())?;
    match header.u32()? {
        VERSION => {}
        0 => return Err(PackError::NotAPack),
        version => return Err(PackError::Newer(version)),
    }
    let expected = u64::from(header.u32()?);
    match expected.cmp(&(found as u64)) {
        core::cmp::Ordering::Greater => return Err(truncated(expected)),
        core::cmp::Ordering::Less => return Err(PackError::Longer { expected, found }),
        core::cmp::Ordering::Equal => {}
    }
    let expected = header.u64()?;
    let hash = content_hash(body);
    if hash != expected {
        return Err(PackError::Damaged {
            expected,
            found: hash,
        });
    }
    Ok((hash, body))
}

fn network<'a>(cursor: &mut Cursor<'a>) -> Result<[Option<Dense<'a>>; MOST_LAYERS], PackError> {
    let mut layers = [None; MOST_LAYERS];
    let count = cursor.count()?;
    if !(1..=MOST_LAYERS).contains(&count) {
        return Err(PackError::Layers(count));
    }
    let mut width = LENGTH;
    for (index, place) in layers.iter_mut().take(count).enumerate() {
        let layer = dense(cursor, index)?;
        let found = layer.inputs();
        if found != width {
            return Err(PackError::Fit {
                layer: index,
                expected: width,
                found,
            });
        }
        width = layer.outputs();
        *place = Some(layer);
    }
    if width != OUTPUTS {
        return Err(PackError::Outputs(width));
    }
    Ok(layers)
}

fn dense<'a>(cursor: &mut Cursor<'a>, layer: usize) -> Result<Dense<'a>, PackError> {
    let [inputs, outputs] = [cursor.u16()?, cursor.u16()?].map(usize::from);
    if let Some(&width) = [inputs, outputs]
        .iter()
        .find(|width| !(1..=WIDEST).contains(width))
    {
        return Err(PackError::Width { layer, width });
    }
    let kinds = cursor.array_of_bytes::<4>()?;
    let [kind, activation, 0, 0] = kinds else {
        return Err(PackError::Kind { layer });
    };
    let activation = match activation {
        0 => Activation::None,
        1 => Activation::Relu,
        2 => Activation::Tanh,
        _ => return Err(PackError::Kind { layer }),
    };
    let biases = cursor.finite(outputs)?;
    let weights = match kind {
        0 => Weights::Floats(cursor.finite(inputs * outputs)?),
        1 => Weights::Bytes {
            scales: cursor.finite(outputs)?,
            rows: cursor.bytes(inputs * outputs)?,
        },
        _ => return Err(PackError::Kind { layer }),
    };
    Dense::new(inputs, weights, biases, activation).ok_or(PackError::Kind { layer })
}

fn lead_table<'a>(cursor: &mut Cursor<'a>) -> Result<LeadTableBytes<'a>, PackError> {
    cursor.enter(Section::LeadTable);
    let [n, m, fields] = [cursor.count()?, cursor.count()?, cursor.count()?];
    let points = n.checked_mul(m);
    let values = points.and_then(|points| points.checked_mul(fields));
    let count = values.and_then(|values| values.checked_add(AXES));
    let bytes = cursor.peek();
    let numbers = cursor.finite(count.ok_or(cursor.ends())?)?;
    let (axes, values) = numbers
        .first()
        .zip(numbers.range(AXES, numbers.len() - AXES))
        .ok_or(cursor.ends())?;
    Ok(LeadTableBytes {
        n,
        m,
        fields,
        axes,
        values,
        bytes: &bytes[..size_of::<f32>() * numbers.len()],
    })
}
