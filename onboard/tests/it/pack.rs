//! Valid packs, and invalid bytes.

use onecycle_onboard::floats::Floats;
use onecycle_onboard::gains::LeadTable;
use onecycle_onboard::network::{Activation, Weights};
use onecycle_onboard::pack::{
    DEFAULT, HEADER, MAGIC, OUTPUTS, Pack, PackError, Section, Sizes, VERSION, content_hash,
};
use onecycle_onboard::signature::LENGTH;
use proptest::prelude::*;

/// Offsets of the sections of the pack below, from the start of the file.
const SECOND_LAYER: usize = HEADER + 4 + 8 + 4 * 2 + 4 * 2 + 2 * LENGTH;
const INPUTS: usize = SECOND_LAYER + 8 + 4 * OUTPUTS + 4 * OUTPUTS * 2;
const OUTPUT_SCALING: usize = INPUTS + 4 * 2 * LENGTH;
const DOMAIN: usize = OUTPUT_SCALING + 4 * 16;
const UNKNOWN: usize = DOMAIN + 4 * 7;
const PRIOR: usize = UNKNOWN + 4 + 4 + 4 * 2;
const LEAD_TABLE: usize = PRIOR + 4 * 12;
const SELF_TEST: usize = LEAD_TABLE + 12 + 4 * 4 + 4 * 6;
const CARD: usize = SELF_TEST + 4 + 4 * (LENGTH + OUTPUTS);
const TOTAL: usize = CARD + 4 + 4;

/// A network of two layers with known outputs: with `x' = (x - 1) 2`,
///
/// ```text
/// h_0 = relu(0.5 (2 x'_0 - x'_1) + 1)      bytes, scale 0.5
/// h_1 = relu(0.25 * 4 x'_33)               bytes, scale 0.25
/// y_i = i h_0 + h_1 - i                    f32
/// ```
fn body() -> Vec<u8> {
    let mut body = Vec::new();
    let mut rows = [[0_u8; LENGTH]; 2];
    rows[0][..2].copy_from_slice(&[2, 0xff]);
    rows[1][LENGTH - 1] = 4;
    body.extend(2_u32.to_le_bytes());
    body.extend([LENGTH as u8, 0, 2, 0, 1, 1, 0, 0]);
    body.extend(le([1.0, 0.0]));
    body.extend(le([0.5, 0.25]));
    body.extend(rows.concat());
    body.extend([2, 0, OUTPUTS as u8, 0, 0, 0, 0, 0]);
    body.extend(le((0..OUTPUTS).map(|i| -(i as f32))));
    body.extend(le((0..OUTPUTS).flat_map(|i| [i as f32, 1.0])));
    body.extend(le([1.0; LENGTH]));
    body.extend(le([2.0; LENGTH]));
    body.extend(le([1.0, 8.0, 8.0, 1.0, 1.0, 1.5, 2.0, 1.25]));
    body.extend(le([-1.0, 0.0, 0.0, -9.0, 4.0, 0.25, 0.5, 9.0]));
    body.extend(le([3.0, 8.0, 0.25, 0.75, -0.75, -0.5, 0.375]));
    body.extend(le([4.5]));
    body.extend(2_u32.to_le_bytes());
    body.extend(le([0.125, 7.0]));
    body.extend(le([2.0, 0.125, 0.0625]));
    body.extend(le([0.5, 0.0, 0.0, 0.25, 0.125, 0.0, -0.25, 0.0, 0.0625]));
    body.extend([1_u32, 2, 3].map(u32::to_le_bytes).concat());
    body.extend(le([-1.0, 1.0, 0.0, 2.0]));
    body.extend(le([10.0, 11.0, 12.0, 20.0, 21.0, 22.0]));
    body.extend(1_u32.to_le_bytes());
    body.extend(le(signature()));
    body.extend(le(outputs()));
    body.extend(4_u32.to_le_bytes());
    body.extend(b"{  }");
    body
}

/// `x'_0 = 3`, `x'_1 = 2`, `x'_33 = 5`: `h_0 = 0.5 (6 - 2) + 1 = 3`, `h_1 = 5`.
fn signature() -> [f32; LENGTH] {
    let mut signature = [1.0; LENGTH];
    (signature[0], signature[1], signature[LENGTH - 1]) = (2.5, 2.0, 3.5);
    signature
}

/// `3 i + 5 - i`.
fn outputs() -> [f32; OUTPUTS] {
    std::array::from_fn(|i| 2.0 * i as f32 + 5.0)
}

fn le(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

/// A file of these sections with a valid length and hash.
fn file(body: &[u8]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(((HEADER + body.len()) as u32).to_le_bytes());
    bytes.extend(content_hash(body).to_le_bytes());
    bytes.extend(body);
    bytes
}

/// Error for the file with other bytes from `offset` on and a valid hash.
fn refused(offset: usize, bytes: &[u8]) -> PackError {
    let mut body = body();
    body[offset - HEADER..][..bytes.len()].copy_from_slice(bytes);
    Pack::read(&file(&body))
        .map(|pack| pack.content_hash())
        .unwrap_err()
}

#[test]
fn everything_comes_back() {
    let bytes = file(&body());
    let pack = Pack::read(&bytes).unwrap();
    let layers: Vec<_> = pack.layers().collect();
    assert_eq!((layers[0].inputs(), layers[0].outputs()), (LENGTH, 2));
    assert_eq!(layers[0].activation(), Activation::Relu);
    assert!(matches!(layers[0].weights(), Weights::Bytes { .. }));
    assert_eq!((layers[1].inputs(), layers[1].outputs()), (2, OUTPUTS));
    assert_eq!(layers[1].activation(), Activation::None);
    assert!(matches!(layers[1].weights(), Weights::Floats(_)));
    assert!(pack.input_offsets().iter().all(|offset| offset == 1.0));
    assert!(pack.input_scales().iter().all(|scale| scale == 2.0));
    let scaling = pack.output_scaling();
    assert_eq!(scaling.scales, [1.0, 8.0, 8.0, 1.0]);
    assert_eq!(scaling.temperatures, [1.0, 1.5, 2.0, 1.25]);
    assert_eq!(scaling.lowest, [-1.0, 0.0, 0.0, -9.0]);
    assert_eq!(scaling.highest, [4.0, 0.25, 0.5, 9.0]);
    let domain = pack.domain();
    assert_eq!(domain.ln_samples, [3.0, 8.0]);
    assert_eq!((domain.duty, domain.beta), ([0.25, 0.75], [-0.75, -0.5]));
    assert_eq!(domain.phase_margin_rad, 0.375);
    assert_eq!(pack.unknown_threshold(), 4.5);
    assert_eq!(pack.calibration().first(), Some([0.125, 7.0]));
    assert_eq!(pack.prior().mean, [2.0, 0.125, 0.0625]);
    assert_eq!(pack.prior().root[1], [0.25, 0.125, 0.0]);
    let table = pack.lead_table();
    assert_eq!((table.n, table.m, table.fields), (1, 2, 3));
    assert_eq!(table.axes, [-1.0, 1.0, 0.0, 2.0]);
    assert_eq!((table.values.len(), table.get(0)), (6, Some(10.0)));
    assert_eq!((table.get(5), table.get(6)), (Some(22.0), None));
    assert_eq!(table.bytes, &bytes[LEAD_TABLE + 12..SELF_TEST]);
    // These numbers are not a lead table: the first, a phase margin, is negative.
    assert_eq!(pack.gains_table(), None);
    assert_eq!(pack.card(), "{  }");
    assert_eq!(pack.content_hash(), content_hash(&bytes[HEADER..]));
    // Two layers of 2 biases, 2 scales, 68 bytes; 14 biases, 28 weights.
    let weights = 4 * 4 + 2 * LENGTH + 4 * 3 * OUTPUTS;
    let (table, card, total) = (4 * 4 + 4 * 6, 4, TOTAL);
    assert_eq!(
        pack.sizes(),
        Sizes {
            weights,
            table,
            card,
            total
        }
    );
    assert_eq!(bytes.len(), TOTAL);
}

#[test]
fn outputs_are_those_by_hand() {
    let bytes = file(&body());
    let pack = Pack::read(&bytes).unwrap();
    assert_eq!(pack.outputs(&signature()), outputs());
    assert_eq!(
        pack.self_tests().collect::<Vec<_>>(),
        [(signature(), outputs())]
    );
    assert_eq!(pack.self_test(), Some(0.0));
    // h_0 = relu(0.5 (-4 + 2) + 1) = 0, h_1 = relu(-2) = 0.
    let low = pack.outputs(&[0.0; LENGTH]);
    assert_eq!(low, std::array::from_fn(|i| -(i as f32)));
    assert!(pack.outputs(&[f32::NAN; LENGTH])[0].is_nan());
}

// Output 13 is 31 and should be 62: the difference is 31 / 62.
#[test]
fn a_self_test_that_fails_is_seen() {
    let mut body = body();
    let last = CARD - HEADER - 4;
    body[last..last + 4].copy_from_slice(&62_f32.to_le_bytes());
    assert_eq!(Pack::read(&file(&body)).unwrap().self_test(), Some(0.5));
    // Without a self-test there is no difference.
    body.splice(SELF_TEST - HEADER..CARD - HEADER, 0_u32.to_le_bytes());
    assert_eq!(Pack::read(&file(&body)).unwrap().self_test(), None);
}

#[test]
fn domains_hold_what_is_between_their_limits() {
    let bytes = file(&body());
    let domain = *Pack::read(&bytes).unwrap().domain();
    let at = |duty, ln_samples| {
        let mut signature = signature();
        [signature[LENGTH - 2], signature[LENGTH - 1]] = [duty, ln_samples];
        signature
    };
    assert!(domain.holds(&at(0.5, 5.0), -0.73));
    assert!(domain.holds(&at(0.25, 8.0), -0.75));
    assert!(!domain.holds(&at(0.2, 5.0), -0.73));
    assert!(!domain.holds(&at(0.5, 8.1), -0.73));
    assert!(!domain.holds(&at(0.5, 5.0), -0.8));
    assert!(!domain.holds(&at(f32::NAN, 5.0), -0.73));
}

// Test values published with the algorithm.
#[test]
fn the_hash_is_fnv_1a() {
    assert_eq!(content_hash(b""), 0xcbf2_9ce4_8422_2325);
    assert_eq!(content_hash(b"a"), 0xaf63_dc4c_8601_ec8c);
    assert_eq!(content_hash(b"foobar"), 0x8594_4171_f739_67e8);
}

#[test]
fn a_build_without_a_pack_says_so() {
    match Pack::embedded() {
        Ok(pack) => {
            assert!(pack.self_test().is_some_and(|worst| worst < 1e-5));
            let table = pack.gains_table().unwrap();
            assert_eq!(LeadTable::from_bytes(pack.lead_table().bytes), Ok(*table));
            let margin = f64::from(pack.domain().phase_margin_rad);
            assert_eq!(table.phase_margin_rad(), margin);
        }
        Err(error) => assert_eq!((error, DEFAULT), (PackError::Empty, &[][..])),
    }
}

// ---------------------------------------------------------------- damage

#[test]
fn a_pack_cut_off_anywhere_is_refused() {
    let bytes = file(&body());
    for length in 0..bytes.len() {
        let error = Pack::read(&bytes[..length]).unwrap_err();
        match length {
            0 => assert_eq!(error, PackError::Empty),
            _ => assert!(matches!(error, PackError::Truncated { found, .. } if found == length)),
        }
    }
    let longer = [&bytes[..], &[0]].concat();
    let (expected, found) = (bytes.len() as u64, bytes.len() + 1);
    assert_eq!(
        Pack::read(&longer),
        Err(PackError::Longer { expected, found })
    );
}

// In the magic bytes, the version, the length, the hash, or anywhere after them.
#[test]
fn every_flipped_bit_is_seen() {
    let mut bytes = file(&body());
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        let error = Pack::read(&bytes).unwrap_err();
        let fits = match bit / 8 {
            0..8 => error == PackError::NotAPack,
            8..12 => matches!(error, PackError::Newer(_) | PackError::NotAPack),
            12..16 => matches!(
                error,
                PackError::Truncated { .. } | PackError::Longer { .. }
            ),
            _ => matches!(error, PackError::Damaged { .. }),
        };
        assert!(fits, "bit {bit}: {error}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(Pack::read(&bytes).is_ok());
}

#[test]
fn a_newer_pack_is_named() {
    let mut bytes = file(&body());
    bytes[8] = 2;
    let error = Pack::read(&bytes).unwrap_err();
    assert_eq!(error, PackError::Newer(2));
    let sentence = error.to_string();
    assert!(sentence.contains("made by a newer onecycle"), "{sentence}");
    assert!(sentence.contains("update"), "{sentence}");
}

// What only a faulty writer produces: the hash is valid, the content is not.
#[test]
fn every_section_is_checked() {
    let network = HEADER;
    let nan = f32::NAN.to_le_bytes();
    let value = |section, index| PackError::Value { section, index };
    let limits = |section, index| PackError::Limits { section, index };
    let cases: [(usize, &[u8], PackError); 23] = [
        (network, &[0], PackError::Layers(0)),
        (network, &[7], PackError::Layers(7)),
        (
            network + 4,
            &[129],
            PackError::Width {
                layer: 0,
                width: 129,
            },
        ),
        (network + 6, &[0], PackError::Width { layer: 0, width: 0 }),
        (network + 8, &[2], PackError::Kind { layer: 0 }),
        (network + 9, &[3], PackError::Kind { layer: 0 }),
        (network + 10, &[1], PackError::Kind { layer: 0 }),
        (network + 12 + 4, &nan, value(Section::Network, 1)),
        (
            SECOND_LAYER,
            &[3, 0, 9],
            PackError::Fit {
                layer: 1,
                expected: 2,
                found: 3,
            },
        ),
        (INPUTS - 4, &nan, value(Section::Network, 27)),
        (INPUTS, &nan, value(Section::Inputs, 0)),
        (OUTPUT_SCALING - 4, &nan, value(Section::Inputs, LENGTH - 1)),
        (OUTPUT_SCALING, &[0; 4], value(Section::Outputs, 0)),
        (OUTPUT_SCALING + 28, &[0; 4], value(Section::Outputs, 3)),
        (OUTPUT_SCALING + 36, &le([9.0]), limits(Section::Outputs, 1)),
        (DOMAIN + 8, &le([0.8]), limits(Section::Domain, 1)),
        (DOMAIN + 24, &nan, value(Section::Domain, 0)),
        (UNKNOWN + 4, &[255; 4], PackError::Ends(Section::Unknown)),
        (LEAD_TABLE, &[255; 12], PackError::Ends(Section::LeadTable)),
        (LEAD_TABLE + 28, &nan, value(Section::LeadTable, 4)),
        (SELF_TEST, &[255; 4], PackError::Ends(Section::SelfTest)),
        (CARD, &[3], PackError::Left(1)),
        (CARD + 4, &[0xff], PackError::Card),
    ];
    for (offset, bytes, expected) in cases {
        let error = refused(offset, bytes);
        assert_eq!(error, expected, "at {offset}");
        let sentence = error.to_string();
        assert!(
            sentence.len() > 30 && !sentence.contains('\n'),
            "{sentence}"
        );
    }
    assert_eq!(refused(CARD, &[5]), PackError::Ends(Section::Card));
}

#[test]
fn a_network_of_other_outputs_is_refused() {
    let mut body = body();
    // Only the first layer.
    body.drain(SECOND_LAYER - HEADER..INPUTS - HEADER);
    body[0] = 1;
    assert_eq!(Pack::read(&file(&body)), Err(PackError::Outputs(2)));
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Pack::read(&bytes).is_err());
        let named = [&MAGIC[..], &VERSION.to_le_bytes(), &bytes].concat();
        prop_assert!(Pack::read(&named).is_err());
        // Six of 2^32 values are a valid number of layers.
        prop_assert!(Pack::read(&file(&bytes)).is_err());
    }

    // A pack that passes the checks can be used.
    #[test]
    fn no_change_behind_the_hash_makes_it_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in proptest::option::of(any::<prop::sample::Index>()),
    ) {
        let mut body = body();
        for (index, byte) in changes {
            let index = index.index(body.len());
            body[index] = byte;
        }
        if let Some(cut) = cut {
            body.truncate(cut.index(body.len()));
        }
        let bytes = file(&body);
        if let Ok(pack) = Pack::read(&bytes) {
            let _ = pack.outputs(&signature());
            let _ = pack.self_test();
            prop_assert_eq!(pack.sizes().total, bytes.len());
            prop_assert!(pack.layers().count() >= 1);
        }
    }

    #[test]
    fn floats_are_the_bytes_they_lie_in(values in proptest::collection::vec(-1e9_f32..1e9, 0..9)) {
        let bytes = le(values.iter().copied());
        let floats = Floats::new(&bytes).unwrap_or_default();
        prop_assert_eq!(floats.iter().collect::<Vec<_>>(), values);
    }
}
