//! Positions of the points of a recording in its source.

use super::Position;

/// Positions by index. Memory grows only where positions skip: at dropped rows, comments and empty lines.
#[derive(Debug, Clone, Default)]
pub(super) struct Places {
    /// Index and position of the first point of each run without a skip.
    starts: Vec<(usize, Position)>,
}

impl Places {
    /// Adds the position of the point of this index; indices come in order.
    pub(super) fn push(&mut self, index: usize, at: Position) {
        if self.of(index) != Some(at) {
            self.starts.push((index, at));
        }
    }

    /// Position of a point; `None` if no point was added up to it.
    pub(super) fn of(&self, index: usize) -> Option<Position> {
        let after = self.starts.partition_point(|(start, _)| *start <= index);
        let (start, at) = *self.starts.get(after.checked_sub(1)?)?;
        let passed = (index - start) as u64;
        Some(match at {
            Position::Line(line) => Position::Line(line + passed),
            Position::Sample(sample) => Position::Sample(sample + passed),
        })
    }

    pub(super) fn clear(&mut self) {
        self.starts.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_skip_lines() {
        let mut places = Places::default();
        assert_eq!(places.of(0), None);
        for (index, line) in [2, 3, 5, 6, 9].into_iter().enumerate() {
            places.push(index, Position::Line(line));
        }
        let found: Vec<_> = (0..5).map(|index| places.of(index)).collect();
        assert_eq!(
            found,
            [2, 3, 5, 6, 9].map(|line| Some(Position::Line(line)))
        );
        assert_eq!(places.starts.len(), 3);
    }
}
