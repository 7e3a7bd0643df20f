//! Reader that takes numbers from the front of the remaining bytes and knows the current section.

use super::error::{PackError, Section};
use crate::floats::Floats;

/// Remaining bytes and current section.
pub(super) struct Cursor<'a> {
    rest: &'a [u8],
    section: Section,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            section: Section::Network,
        }
    }

    pub(super) fn enter(&mut self, section: Section) {
        self.section = section;
    }

    pub(super) fn left(&self) -> usize {
        self.rest.len()
    }

    /// Error: the section continues after the last byte.
    pub(super) fn ends(&self) -> PackError {
        PackError::Ends(self.section)
    }

    /// All remaining bytes.
    pub(super) fn peek(&self) -> &'a [u8] {
        self.rest
    }

    pub(super) fn bytes(&mut self, count: usize) -> Result<&'a [u8], PackError> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(self.ends())?;
        self.rest = rest;
        Ok(taken)
    }

    pub(super) fn array_of_bytes<const N: usize>(&mut self) -> Result<[u8; N], PackError> {
        let (taken, rest) = self.rest.split_first_chunk().ok_or(self.ends())?;
        self.rest = rest;
        Ok(*taken)
    }

    pub(super) fn u16(&mut self) -> Result<u16, PackError> {
        self.array_of_bytes().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, PackError> {
        self.array_of_bytes().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, PackError> {
        self.array_of_bytes().map(u64::from_le_bytes)
    }

    /// Number of following items, which may exceed the memory.
    pub(super) fn count(&mut self) -> Result<usize, PackError> {
        usize::try_from(self.u32()?).map_err(|_| self.ends())
    }

    /// The next `count` numbers, all finite.
    pub(super) fn finite(&mut self, count: usize) -> Result<Floats<'a>, PackError> {
        let length = count.checked_mul(size_of::<f32>()).ok_or(self.ends())?;
        let floats = Floats::new(self.bytes(length)?).ok_or(self.ends())?;
        match floats.iter().position(|value| !value.is_finite()) {
            None => Ok(floats),
            Some(index) => Err(PackError::Value {
                section: self.section,
                index,
            }),
        }
    }

    /// The next `N` numbers, all finite, copied.
    pub(super) fn array<const N: usize>(&mut self) -> Result<[f32; N], PackError> {
        self.finite(N)?.first().ok_or(self.ends())
    }

    /// The next `N` numbers, all positive, copied.
    pub(super) fn positive<const N: usize>(&mut self) -> Result<[f32; N], PackError> {
        let values = self.array()?;
        match values.iter().position(|&value| value <= 0.0) {
            None => Ok(values),
            Some(index) => Err(PackError::Value {
                section: self.section,
                index,
            }),
        }
    }

    /// Rejects limits whose lower value exceeds the upper one.
    pub(super) fn ordered(
        &self,
        mut limits: impl Iterator<Item = (f32, f32)>,
    ) -> Result<(), PackError> {
        match limits.position(|(low, high)| low > high) {
            None => Ok(()),
            Some(index) => Err(PackError::Limits {
                section: self.section,
                index,
            }),
        }
    }
}
