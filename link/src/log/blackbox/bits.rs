//! Encodings of numbers in blackbox frames.

/// The bytes of a frame, read one after another; zeros behind their end.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(super) fn taken(&self) -> usize {
        self.at
    }

    /// Whether more bytes were read than there are.
    pub(super) fn is_beyond(&self) -> bool {
        self.at > self.bytes.len()
    }

    #[inline]
    pub(super) fn byte(&mut self) -> u8 {
        let byte = self.bytes.get(self.at).copied().unwrap_or(0);
        self.at += 1;
        byte
    }

    /// Seven bits a byte, the lowest first; the eighth says that more follow, at most five in all.
    #[inline]
    pub(super) fn unsigned(&mut self) -> u32 {
        let mut value = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte();
            value |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return value;
            }
        }
        0
    }

    /// Signs alternate: 0, -1, 1, -2, ...
    #[inline]
    pub(super) fn signed(&mut self) -> i32 {
        let value = self.unsigned();
        (value >> 1) as i32 ^ -((value & 1) as i32)
    }

    /// The negative of a number of 14 bits.
    pub(super) fn negative_14_bit(&mut self) -> i32 {
        -extended(self.unsigned() & 0x3fff, 14)
    }

    /// A bit for each field says whether it is there. A single field has no such byte.
    pub(super) fn tag8_8svb(&mut self, values: &mut [i32]) {
        if let [only] = values {
            *only = self.signed();
            return;
        }
        let tag = self.byte();
        for (at, value) in values.iter_mut().enumerate() {
            *value = if tag >> at & 1 == 1 { self.signed() } else { 0 };
        }
    }

    /// Three fields of 2, 4 or 6 bits, or of 1 to 4 bytes each.
    pub(super) fn tag2_3s32(&mut self, values: &mut [i32]) {
        let lead = u32::from(self.byte());
        let fields = match lead >> 6 {
            0 => [lead >> 4, lead >> 2, lead].map(|bits| extended(bits & 3, 2)),
            1 => {
                let rest = u32::from(self.byte());
                [lead, rest >> 4, rest].map(|bits| extended(bits & 0xf, 4))
            }
            2 => {
                let (second, third) = (u32::from(self.byte()), u32::from(self.byte()));
                [lead, second, third].map(|bits| extended(bits & 0x3f, 6))
            }
            _ => self.bytes_each(lead),
        };
        put(values, &fields);
    }

    /// As before, but with 5, 5 and 4 or 8, 7 and 7 bits.
    pub(super) fn tag2_3s_variable(&mut self, values: &mut [i32]) {
        let lead = u32::from(self.byte());
        let fields = match lead >> 6 {
            0 => [lead >> 4, lead >> 2, lead].map(|bits| extended(bits & 3, 2)),
            1 => {
                let bits = lead << 8 | u32::from(self.byte());
                [
                    extended(bits >> 9 & 0x1f, 5),
                    extended(bits >> 4 & 0x1f, 5),
                    extended(bits & 0xf, 4),
                ]
            }
            2 => {
                let bits = lead << 16 | u32::from(self.byte()) << 8 | u32::from(self.byte());
                [
                    extended(bits >> 14 & 0xff, 8),
                    extended(bits >> 7 & 0x7f, 7),
                    extended(bits & 0x7f, 7),
                ]
            }
            _ => self.bytes_each(lead),
        };
        put(values, &fields);
    }

    /// Three fields of 1 to 4 bytes each, the lowest first, as the six bits of `lead` say.
    fn bytes_each(&mut self, lead: u32) -> [i32; 3] {
        let mut fields = [0; 3];
        for (at, field) in fields.iter_mut().enumerate() {
            let count = 1 + (lead >> (2 * at) & 3);
            let bits = (0..count)
                .map(|k| u32::from(self.byte()) << (8 * k))
                .fold(0, |a, b| a | b);
            *field = extended(bits, 8 * count);
        }
        fields
    }

    /// Four fields of 0, 4, 8 or 16 bits, the highest first, packed in half bytes.
    pub(super) fn tag8_4s16(&mut self, values: &mut [i32]) {
        let tag = u32::from(self.byte());
        let mut fields = [0; 4];
        // The lower half of the byte before, if it is not used yet.
        let mut half = None;
        for (at, field) in fields.iter_mut().enumerate() {
            let halves = [0, 1, 2, 4][(tag >> (2 * at) & 3) as usize];
            let mut bits = 0;
            for _ in 0..halves {
                bits = bits << 4
                    | match half.take() {
                        Some(half) => half,
                        None => {
                            let byte = u32::from(self.byte());
                            half = Some(byte & 0xf);
                            byte >> 4
                        }
                    };
            }
            *field = if halves == 0 {
                0
            } else {
                extended(bits, 4 * halves)
            };
        }
        put(values, &fields);
    }

    /// The same in logs of version 1: half bytes come in pairs.
    pub(super) fn tag8_4s16_v1(&mut self, values: &mut [i32]) {
        let tag = u32::from(self.byte());
        let mut fields = [0; 4];
        let mut at = 0;
        while at < 4 {
            match tag >> (2 * at) & 3 {
                1 => {
                    let byte = u32::from(self.byte());
                    fields[at] = extended(byte & 0xf, 4);
                    at += 1;
                    if at < 4 {
                        fields[at] = extended(byte >> 4, 4);
                    }
                }
                2 => fields[at] = extended(u32::from(self.byte()), 8),
                3 => {
                    let bits = u32::from(self.byte()) | u32::from(self.byte()) << 8;
                    fields[at] = extended(bits, 16);
                }
                _ => {}
            }
            at += 1;
        }
        put(values, &fields);
    }
}

fn put(values: &mut [i32], fields: &[i32]) {
    for (value, field) in values.iter_mut().zip(fields) {
        *value = *field;
    }
}

/// The number of two's complement in the lowest `count` bits.
#[inline]
fn extended(bits: u32, count: u32) -> i32 {
    ((bits << (32 - count)) as i32) >> (32 - count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variable_bytes() {
        // 300 = 0b10_0101100: bytes 0xac, 0x02. Signed numbers 0, -1, 1, -2 are 0, 1, 2, 3.
        assert_eq!(Cursor::new(&[0xac, 0x02]).unsigned(), 300);
        let mut cursor = Cursor::new(&[0, 1, 2, 3]);
        assert_eq!([(); 4].map(|()| cursor.signed()), [0, -1, 1, -2]);
        assert_eq!(
            Cursor::new(&[0xff, 0xff, 0xff, 0xff, 0x0f]).unsigned(),
            u32::MAX
        );
        // A sixth byte would be needed: no number.
        assert_eq!(Cursor::new(&[0xff; 8]).unsigned(), 0);
        let mut cursor = Cursor::new(&[0x80]);
        cursor.unsigned();
        assert!(cursor.is_beyond());
    }

    #[test]
    fn groups_of_bits() {
        let mut values = [0; 3];
        Cursor::new(&[0b00_01_11_10]).tag2_3s32(&mut values);
        assert_eq!(values, [1, -1, -2]);
        Cursor::new(&[0b0100_0111, 0b1000_0001]).tag2_3s32(&mut values);
        assert_eq!(values, [7, -8, 1]);
        Cursor::new(&[0b1001_1111, 0x20, 0x01]).tag2_3s32(&mut values);
        assert_eq!(values, [31, -32, 1]);
        // Sizes 1, 2 and 4 bytes: selectors 0, 1 and 3 from the lowest bits.
        Cursor::new(&[0b1111_0100, 0xff, 0x00, 0x80, 1, 0, 0, 0x80]).tag2_3s32(&mut values);
        assert_eq!(values, [-1, -32768, i32::MIN + 1]);
        // 5, 5 and 4 bits; 8, 7 and 7 bits.
        Cursor::new(&[0b0101_1111, 0b0000_1000]).tag2_3s_variable(&mut values);
        assert_eq!(values, [15, -16, -8]);
        Cursor::new(&[0b1010_0000, 0b0011_1111, 0b1000_0001]).tag2_3s_variable(&mut values);
        assert_eq!(values, [-128, 63 * 2 + 1 - 128, 1]);
    }

    #[test]
    fn half_bytes() {
        let mut values = [0; 4];
        // 4, 16, 0 and 8 bits: -1, 0x1234, 0, -2.
        Cursor::new(&[0b10_00_11_01, 0xf1, 0x23, 0x4f, 0xe0]).tag8_4s16(&mut values);
        assert_eq!(values, [-1, 0x1234, 0, -2]);
        Cursor::new(&[0b10_11_01_01, 0x1f, 0x34, 0x12, 0xfe]).tag8_4s16_v1(&mut values);
        assert_eq!(values, [-1, 1, 0x1234, -2]);
        let mut two = [9; 2];
        Cursor::new(&[0b10, 0x01]).tag8_8svb(&mut two);
        assert_eq!(two, [0, -1]);
    }
}
