//! What a complete recording shows about its data: corrupt cells, an output held over several rows.

use super::corrupt::{self, Fault};
use super::held::Held;
use super::places::Places;
use super::rhythm;
use super::{Cell, Gap, Note, Recording, Role};

/// Largest distance from the line through both neighbours, as a share of the range: files with six digits.
const ON_LINE: f64 = 2e-6;
/// At least this many samples for each change of slope.
const FEW_KNOTS: usize = 4;

impl Recording {
    /// Replaces or drops corrupt cells and rows without a new output, with a note on each kind.
    pub(super) fn clean(&mut self, places: &Places) {
        self.clean_input(places);
        self.clean_output(places);
        self.note_straight_lines();
        self.thin();
    }

    fn clean_input(&mut self, places: &Places) {
        let faults = corrupt::of_input(&self.input);
        let (mut replaced, mut dropped) = (Vec::new(), Vec::new());
        for (index, fault) in faults {
            let cell = self.cell(index, Role::Input, places);
            match fault {
                Fault::Replace(by) => {
                    self.input[index] = by;
                    replaced.push((cell, by));
                }
                Fault::Drop => dropped.push((index, cell)),
                Fault::Doubt(others) => self.notes.push(Note::CellInDoubt {
                    cell,
                    least: others.start,
                    most: others.end,
                }),
            }
        }
        self.note_replaced(&replaced);
        if let Some((_, first)) = dropped.first() {
            let (count, first) = (dropped.len() as u64, *first);
            self.notes.push(Note::OffLevelDropped { count, first });
        }
        let indices: Vec<usize> = dropped.into_iter().map(|(index, _)| index).collect();
        self.drop_points(&indices);
    }

    fn clean_output(&mut self, places: &Places) {
        let breaks: Vec<usize> = self.gaps.iter().map(|gap| gap.index).collect();
        let is_joined = |index: usize| breaks.binary_search(&index).is_err();
        let found = corrupt::of_output(&self.time_s, &self.output, is_joined);
        let mut replaced = Vec::new();
        for (index, by) in found {
            replaced.push((self.cell(index, Role::Output, places), by));
            self.output[index] = by;
        }
        self.note_replaced(&replaced);
    }

    fn note_replaced(&mut self, replaced: &[(Cell, f64)]) {
        if let Some(&(first, by)) = replaced.first() {
            let count = replaced.len() as u64;
            self.notes.push(Note::CellsReplaced { count, first, by });
        }
    }

    fn cell(&self, index: usize, role: Role, places: &Places) -> Cell {
        let values = match role {
            Role::Time => &self.time_s,
            Role::Input => &self.input,
            Role::Output => &self.output,
        };
        Cell {
            role,
            at: places.of(index),
            time_s: self.time_s[index],
            value: values[index],
        }
    }

    /// Drops points and leaves a gap in the place of each; none at the start and at the end.
    fn drop_points(&mut self, indices: &[usize]) {
        if indices.is_empty() || self.time_s.len() < indices.len() + 2 {
            return;
        }
        let mut gaps = std::mem::take(&mut self.gaps);
        for &index in indices.iter().rev() {
            gaps.iter_mut()
                .filter(|gap| gap.index > index)
                .for_each(|gap| gap.index -= 1);
            if index > 0 && index + 1 < self.time_s.len() {
                gaps.push(Gap {
                    index,
                    start_s: self.time_s[index - 1],
                    end_s: self.time_s[index + 1],
                });
            }
            for values in self.filled_columns() {
                values.remove(index);
            }
        }
        gaps.sort_by_key(|gap| gap.index);
        // Gaps with no point between them are one.
        gaps.dedup_by(|next, gap| {
            let is_same = next.index == gap.index;
            if is_same {
                gap.start_s = gap.start_s.min(next.start_s);
                gap.end_s = gap.end_s.max(next.end_s);
            }
            is_same
        });
        gaps.retain(|gap| gap.index > 0 && gap.index < self.time_s.len());
        self.gaps = gaps;
    }

    /// The columns, and the set-point if there is one.
    fn filled_columns(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let set_point = Some(&mut self.set_point).filter(|values| !values.is_empty());
        [&mut self.time_s, &mut self.input, &mut self.output]
            .into_iter()
            .chain(set_point)
    }

    /// Notes an output of straight lines between few samples, irregularly spaced, as a historian draws it.
    fn note_straight_lines(&mut self) {
        if self.samples_per_point > 1 {
            return;
        }
        let (time_s, output) = (&self.time_s, &self.output);
        let (least, most) = output
            .iter()
            .fold((f64::MAX, f64::MIN), |(least, most), &y| {
                (least.min(y), most.max(y))
            });
        let is_knot = |i: &usize| {
            let share = (time_s[*i] - time_s[i - 1]) / (time_s[i + 1] - time_s[i - 1]);
            let line = output[i - 1] + share * (output[i + 1] - output[i - 1]);
            (output[*i] - line).abs() > ON_LINE * (most - least)
        };
        let moves = |i: &usize| output[*i] != output[i - 1];
        let knots: Vec<usize> = (1..output.len().saturating_sub(1))
            .filter(is_knot)
            .collect();
        let moving = (1..output.len()).filter(moves).count();
        let lengths_s: Vec<f64> = knots.iter().map(|knot| time_s[*knot]).collect();
        let is_irregular = rhythm::spread_s(&lengths_s).is_some();
        if is_irregular && 2 * moving > output.len() && FEW_KNOTS * knots.len() < output.len() {
            self.notes.push(Note::Interpolated {
                knots: knots.len(),
                samples: output.len(),
            });
        }
    }

    /// Keeps only the rows with a new output, if no other row tells anything.
    fn thin(&mut self) {
        if self.samples_per_point > 1 || !self.gaps.is_empty() {
            return;
        }
        let Some(held) = Held::find(&self.output) else {
            return;
        };
        let is_kept = !held.has_changes_of(&self.input);
        let period_s = self.sample_period_s * held.rows as f64;
        self.notes.push(Note::OutputHeld {
            rows: held.rows,
            period_s,
            is_kept,
        });
        if !is_kept {
            self.sample_period_s = period_s;
            for values in self.filled_columns() {
                *values = held.thinned(values);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1000 samples at 1 kHz: a relay that switches every 50 samples from the first on, and a triangle.
    fn columns() -> [Vec<f64>; 3] {
        let of = |value: fn(u32) -> f64| (0..1000).map(value).collect();
        [
            of(|i| f64::from(i) / 1000.0),
            of(|i| if i / 50 % 2 == 0 { 1.0 } else { -1.0 }),
            of(|i| (f64::from(i) % 100.0 - 50.0).abs()),
        ]
    }

    fn notes(recording: &Recording) -> Vec<String> {
        recording.notes().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn replaced_cells_are_named() {
        let [time_s, mut input, mut output] = columns();
        let clean = Recording::from_samples(&time_s, &input, &output).unwrap();
        assert_eq!(clean.notes(), []);
        (input[320], input[720], output[510]) = (-9.0, 4.0, 1000.0);
        let found = Recording::from_samples(&time_s, &input, &output).unwrap();
        assert_eq!((found.input(), found.gaps()), (clean.input(), clean.gaps()));
        assert!((found.output()[510] - clean.output()[510]).abs() < 1e-9);
        let expected = [
            "replaced 2 single values of the input that are at neither of its two levels, the first at \
             sample 320 (0.32 s): -9.0 by 1.0",
            "replaced 1 single peak of the output by the line between its neighbours, the first at sample \
             510 (0.51 s): 1000.0 by 40.0",
        ];
        assert_eq!(notes(&found), expected);
    }

    // Cells 349 and 350 lie on both sides of a switch, the others at the ends, where nothing is cut in two.
    #[test]
    fn a_cell_beside_a_switch_leaves_a_gap() {
        let [time_s, mut input, output] = columns();
        for at in [0, 349, 350, 998, 999] {
            input[at] = -9.0;
        }
        let found = Recording::from_samples(&time_s, &input, &output).unwrap();
        assert_eq!(found.len(), 995);
        let gaps: Vec<_> = (found.gaps().iter())
            .map(|gap| (gap.index, gap.start_s, gap.end_s))
            .collect();
        assert_eq!(gaps, [(348, 0.348, 0.351)]);
        assert_eq!(found.time_s()[348], 0.351);
        let expected = "dropped 5 rows whose input is at neither of its two levels, the first at sample 0 (0.0 s): \
                        -9.0";
        assert_eq!(notes(&found), [expected]);
    }

    #[test]
    fn a_spike_of_a_smooth_input_is_noted() {
        let [time_s, _, output] = columns();
        let mut input: Vec<f64> = time_s.iter().map(|t| (20.0 * t).sin()).collect();
        input[320] = -9.0;
        let found = Recording::from_samples(&time_s, &input, &output).unwrap();
        assert_eq!(found.input(), input);
        assert_eq!(notes(&found).len(), 1);
        assert!(notes(&found)[0].starts_with("the input at sample 320 (0.32 s) is -9.0, "));
    }

    #[test]
    fn a_slow_sensor_in_a_fast_log() {
        let [time_s, input, output] = columns();
        let held: Vec<f64> = (0..1000)
            .map(|i| output[i / 5 * 5] + i.div_euclid(5) as f64)
            .collect();
        let found = Recording::from_samples(&time_s, &input, &held).unwrap();
        assert_eq!((found.len(), found.sample_period_s()), (200, 0.005));
        assert_eq!(found.time_s()[1], 0.005);
        let expected = "the output changes at every 5th row only: its sample period is 0.005 s; kept only the \
                        rows with a new output";
        assert_eq!(notes(&found), [expected]);
        // A relay that switches in between: every row tells when.
        let shifted: Vec<f64> = (0..1000).map(|i| input[(i + 2) % 1000]).collect();
        let found = Recording::from_samples(&time_s, &shifted, &held).unwrap();
        assert_eq!(found.len(), 1000);
        assert!(notes(&found)[0].ends_with("its sample period is 0.005 s"));
    }
}
