//! Bytes of a log with look-ahead, in a buffer of bounded size.

use std::io::{ErrorKind, Read};

use super::error::LogError;

/// Bytes of the buffer: room for four ULog messages of the largest size.
const BUFFER_BYTES: usize = 1 << 19;

/// A reader that shows the next bytes before they are taken.
pub(super) struct Source<R> {
    reader: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// Bytes taken so far.
    position: u64,
    ended: bool,
}

impl<R: Read> Source<R> {
    pub(super) fn new(reader: R) -> Self {
        Self {
            reader,
            buffer: vec![0; BUFFER_BYTES],
            start: 0,
            end: 0,
            position: 0,
            ended: false,
        }
    }

    /// Bytes taken so far: the offset of the next byte in the log.
    pub(super) fn position(&self) -> u64 {
        self.position
    }

    /// The next `count` bytes; fewer only at the end of the log. At most half the buffer.
    pub(super) fn peek(&mut self, count: usize) -> Result<&[u8], LogError> {
        if self.end - self.start < count && !self.ended {
            self.fill(count)?;
        }
        let end = self.end.min(self.start + count);
        Ok(&self.buffer[self.start..end])
    }

    /// Takes `count` bytes, or what is left.
    pub(super) fn skip(&mut self, count: usize) -> Result<(), LogError> {
        let mut left = count;
        loop {
            let taken = left.min(self.end - self.start);
            self.start += taken;
            self.position += taken as u64;
            left -= taken;
            if left == 0 || self.ended {
                return Ok(());
            }
            self.fill(1)?;
        }
    }

    fn fill(&mut self, count: usize) -> Result<(), LogError> {
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        while self.end < count.min(BUFFER_BYTES) && !self.ended {
            match self.reader.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.ended = true,
                Ok(read) => self.end += read,
                Err(reason) if reason.kind() == ErrorKind::Interrupted => {}
                Err(reason) => {
                    let position = self.position;
                    return Err(LogError::Interrupted { position, reason });
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives at most 1000 bytes a call.
    struct Slow<'a>(&'a [u8]);

    impl Read for Slow<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let count = buffer.len().min(1000);
            self.0.read(&mut buffer[..count])
        }
    }

    #[test]
    fn bytes_come_in_order_over_the_end_of_the_buffer() {
        let bytes: Vec<u8> = (0..2 * BUFFER_BYTES + 77)
            .map(|at| (at * 7 % 251) as u8)
            .collect();
        let mut source = Source::new(Slow(&bytes));
        let mut at = 0;
        while at < bytes.len() {
            let expected = &bytes[at..bytes.len().min(at + 5000)];
            assert_eq!(source.peek(5000).unwrap(), expected);
            source.skip(4999).unwrap();
            at += 4999;
        }
        assert_eq!(source.position(), bytes.len() as u64);
        assert!(source.peek(1).unwrap().is_empty());
    }
}
