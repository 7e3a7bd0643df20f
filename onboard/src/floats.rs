//! Rows of `f32` numbers read in place from little-endian bytes at any address.
//!
//! Flash and files hold bytes. A slice of `f32` would have to be aligned, which needs a copy; decoding four
//! bytes is a single load on a little-endian machine.
//!
//! ```
//! use onecycle_onboard::floats::Floats;
//!
//! let floats = Floats::new(&[0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0]).unwrap_or_default();
//! assert_eq!((floats.get(0), floats.get(1), floats.get(2)), (Some(1.0), Some(-2.0), None));
//! ```

/// Borrowed row of numbers. See the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Floats<'a>(&'a [[u8; 4]]);

impl<'a> Floats<'a> {
    /// The numbers in these bytes; `None` if their length is not a multiple of four.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Option<Self> {
        let (numbers, rest) = bytes.as_chunks();
        rest.is_empty().then_some(Self(numbers))
    }

    /// Number of numbers.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether the row is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Number `index`, counted from 0; `None` after the last.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<f32> {
        self.0.get(index).copied().map(f32::from_le_bytes)
    }

    /// Iterator over the numbers.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.0.iter().copied().map(f32::from_le_bytes)
    }

    /// The first `N` numbers; `None` if there are fewer.
    #[must_use]
    pub fn first<const N: usize>(&self) -> Option<[f32; N]> {
        let numbers: &[[u8; 4]; N] = self.0.first_chunk()?;
        Some(numbers.map(f32::from_le_bytes))
    }

    /// `count` numbers from `first` on; `None` if there are fewer.
    #[must_use]
    pub fn range(&self, first: usize, count: usize) -> Option<Self> {
        let end = first.checked_add(count)?;
        self.0.get(first..end).map(Self)
    }

    /// The bytes, four per number.
    pub(crate) fn chunks(&self) -> &'a [[u8; 4]] {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 1.5 = 0x3fc00000, -0.25 = 0xbe800000.
    const BYTES: [u8; 9] = [0, 0, 0xc0, 0x3f, 0, 0, 0x80, 0xbe, 7];

    #[test]
    fn numbers_are_decoded_at_any_address() {
        let mut shifted = [0; 9];
        shifted[1..].copy_from_slice(&BYTES[..8]);
        for bytes in [&BYTES[..8], &shifted[1..]] {
            let floats = Floats::new(bytes).unwrap();
            assert_eq!((floats.len(), floats.is_empty()), (2, false));
            assert_eq!((floats.get(0), floats.get(1)), (Some(1.5), Some(-0.25)));
            assert_eq!(floats.iter().sum::<f32>(), 1.25);
            assert_eq!(floats.first(), Some([1.5]));
            assert_eq!(
                floats.range(1, 1).and_then(|rest| rest.first()),
                Some([-0.25])
            );
        }
    }

    #[test]
    fn what_is_not_there_is_none() {
        assert_eq!(Floats::new(&BYTES), None);
        let floats = Floats::new(&BYTES[..8]).unwrap();
        assert_eq!((floats.get(2), floats.get(usize::MAX)), (None, None));
        assert_eq!(floats.first::<3>(), None);
        assert_eq!(
            (floats.range(1, 2), floats.range(1, usize::MAX)),
            (None, None)
        );
        assert!(Floats::default().is_empty());
    }
}
