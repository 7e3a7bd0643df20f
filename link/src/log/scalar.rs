//! Numbers in binary logs: little-endian, as `f64`.

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of a number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at the start of `bytes`; NaN if there are too few. Integers beyond 2^53 are rounded.
    #[inline]
    pub(super) fn read(self, bytes: &[u8]) -> f64 {
        match self {
            Self::I8 => first(bytes).map(|b| f64::from(i8::from_le_bytes(b))),
            Self::U8 => first(bytes).map(|b| f64::from(u8::from_le_bytes(b))),
            Self::I16 => first(bytes).map(|b| f64::from(i16::from_le_bytes(b))),
            Self::U16 => first(bytes).map(|b| f64::from(u16::from_le_bytes(b))),
            Self::I32 => first(bytes).map(|b| f64::from(i32::from_le_bytes(b))),
            Self::U32 => first(bytes).map(|b| f64::from(u32::from_le_bytes(b))),
            Self::I64 => first(bytes).map(|b| i64::from_le_bytes(b) as f64),
            Self::U64 => first(bytes).map(|b| u64::from_le_bytes(b) as f64),
            Self::F16 => first(bytes).map(|b| half(u16::from_le_bytes(b))),
            Self::F32 => first(bytes).map(|b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => first(bytes).map(f64::from_le_bytes),
        }
        .unwrap_or(f64::NAN)
    }
}

#[inline]
fn first<const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
    bytes.first_chunk().copied()
}

/// An IEEE 754 number of 16 bits.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let exponent = i32::from(bits >> 10 & 0x1f);
    let fraction = f64::from(bits & 0x3ff) / 1024.0;
    sign * match exponent {
        0 => fraction * 2_f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2_f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision() {
        // 1, -2, the smallest and the largest number, infinity.
        assert_eq!(half(0x3c00), 1.0);
        assert_eq!(half(0xc000), -2.0);
        assert_eq!(half(0x0001), 2_f64.powi(-24));
        assert_eq!(half(0x7bff), 65504.0);
        assert_eq!(half(0x7c00), f64::INFINITY);
        assert!(half(0x7c01).is_nan());
    }

    #[test]
    fn numbers_are_little_endian_and_signed() {
        assert_eq!(Scalar::I16.read(&[0xfe, 0xff]), -2.0);
        assert_eq!(Scalar::U16.read(&[0xfe, 0xff]), 65534.0);
        assert_eq!(Scalar::F32.read(&1.5_f32.to_le_bytes()), 1.5);
        assert!(Scalar::U32.read(&[1, 2, 3]).is_nan());
    }
}
