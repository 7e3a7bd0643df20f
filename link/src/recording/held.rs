//! An output held over several rows: the sensor is slower than the log.

/// Share of the changes of the output that must lie on the grid of the sensor.
const ON_GRID: f64 = 0.9;
/// Fewest changes that show a grid.
const FEWEST_CHANGES: usize = 20;

/// The sensor of a log that is faster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Held {
    /// Rows of the log for each new value.
    pub(super) rows: usize,
    /// Index of the first row with a new value.
    pub(super) first: usize,
}

impl Held {
    /// The grid of an output that changes at every `rows`-th row only; a value that happens to repeat does not matter.
    pub(super) fn find(output: &[f64]) -> Option<Self> {
        let changes: Vec<usize> = changes(output).collect();
        let mut lengths: Vec<usize> = changes.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if changes.len() < FEWEST_CHANGES {
            return None;
        }
        let middle = lengths.len() / 2;
        let (_, &mut rows, _) = lengths.select_nth_unstable(middle);
        if rows < 2 {
            return None;
        }
        let mut phases = vec![0_usize; rows];
        changes.iter().for_each(|change| phases[change % rows] += 1);
        let (first, most) = phases.iter().enumerate().max_by_key(|(_, count)| **count)?;
        let is_grid = *most as f64 >= ON_GRID * changes.len() as f64;
        is_grid.then_some(Self { rows, first })
    }

    /// Whether a signal changes at rows with a new value of the output only.
    pub(super) fn has_changes_of(&self, signal: &[f64]) -> bool {
        changes(signal).all(|change| change % self.rows == self.first)
    }

    /// The rows with a new value.
    pub(super) fn thinned(&self, values: &[f64]) -> Vec<f64> {
        let kept = values.iter().skip(self.first).step_by(self.rows);
        kept.copied().collect()
    }
}

/// Indices at which a signal differs from the sample before.
fn changes(signal: &[f64]) -> impl Iterator<Item = usize> + '_ {
    (1..signal.len()).filter(|&i| signal[i] != signal[i - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fifth_row_from_the_third() {
        let held: Vec<f64> = (0..300).map(|i| f64::from((i + 2) / 5).sin()).collect();
        let found = Held::find(&held).unwrap();
        assert_eq!(found, Held { rows: 5, first: 3 });
        assert!(found.has_changes_of(&held));
        // Row 3 is the first of its value: sin(1), then sin(2).
        assert_eq!(found.thinned(&held)[..2], [1_f64.sin(), 2_f64.sin()]);
        let switches = |at: usize| (0..300).map(|i| f64::from(i >= at)).collect::<Vec<_>>();
        assert!(found.has_changes_of(&switches(53)));
        assert!(!found.has_changes_of(&switches(54)));
    }

    #[test]
    fn other_outputs_are_not_held() {
        let sine = |i: i32| (f64::from(i) / 20.0).sin();
        let smooth: Vec<f64> = (0..300).map(sine).collect();
        assert_eq!(Held::find(&smooth), None);
        // A coarse sensor: runs of all lengths.
        let coarse: Vec<f64> = (0..3000).map(|i| (10.0 * sine(i)).round()).collect();
        assert_eq!(Held::find(&coarse), None);
        assert_eq!(Held::find(&[1.0; 100]), None);
    }
}
