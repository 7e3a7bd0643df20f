//! Numbers out of bytes.

/// Takes numbers from bytes, zeros after their end.
pub(crate) struct Numbers<'a>(pub(crate) &'a [u8]);

impl Numbers<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut taken = [0; N];
        let count = N.min(self.0.len());
        taken[..count].copy_from_slice(&self.0[..count]);
        self.0 = &self.0[count..];
        taken
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    /// Any single, NaN and infinities too.
    pub(crate) fn single(&mut self) -> f32 {
        f32::from_le_bytes(self.bytes())
    }

    /// Any double, NaN and infinities too.
    pub(crate) fn double(&mut self) -> f64 {
        f64::from_le_bytes(self.bytes())
    }

    /// From 0 to 1, in 65,536 steps.
    pub(crate) fn share(&mut self) -> f64 {
        f64::from(u16::from_le_bytes(self.bytes())) / f64::from(u16::MAX)
    }

    /// Between two positive numbers, evenly in their logarithm.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share())
    }
}
