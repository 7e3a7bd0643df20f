//! Builds a recording from samples, one by one, in bounded memory.
//!
//! ```text
//! n <- 1
//! for each sample:
//!     add it to the group; if the group has n samples, store their mean as a point
//!     if a gap follows, drop an incomplete group
//!     if the store is full when a point is due, average the points in pairs, n <- 2 n
//! ```

use super::places::Places;
use super::rhythm::{self, Rhythm};
use super::{Column, Columns, Gap, MAX_POINTS, Note, Position, Recording, RecordingError, Role};

/// Largest number accepted: differences of such numbers and their weighted sums stay finite.
const LARGEST: f64 = 1e300;

/// A time that starts beyond this many seconds is counted from its first time stamp. At 1e7 s (115
/// days since power-up) a time stamp still resolves 2 ns.
pub(crate) const FAR_START_S: f64 = 1e7;

/// Maximum fraction of rows that lack a number.
const MOST_MISSING: f64 = 0.01;

/// Maximum fraction of rows that repeat a time stamp.
const MOST_DUPLICATES: f64 = 0.05;

/// Maximum fraction of samples dropped because of gaps.
const MOST_DROPPED: f64 = 0.1;

/// Maximum rounding of a time stamp, as a fraction of the sample period.
const COARSEST_STAMP: f64 = 0.01;

/// Maximum fraction of rows that the source marks as bad.
const MOST_BAD: f64 = 0.5;

/// Jitter above which the recording gets a note.
const NOTED_JITTER: f64 = 0.1;

/// Gathers samples into a [`Recording`] and averages them when there are too many to keep.
///
/// Samples that are not finite and samples that repeat a time stamp are dropped and counted.
/// [`finish`](Self::finish) returns an error if more than 1 % of the samples lack a number or more
/// than 5 % repeat a time stamp.
#[derive(Debug, Clone)]
pub struct RecordingBuilder {
    columns: Columns,
    max_points: usize,
    notes: Vec<Note>,

    time_s: Vec<f64>,
    input: Vec<f64>,
    output: Vec<f64>,
    /// Positions of the points, until they are averaged.
    places: Places,
    /// Empty unless there is a column for it.
    set_point: Vec<f64>,
    gaps: Vec<Gap>,
    samples_per_point: usize,
    group: Group,
    /// The newest sample: how long its input is held is known only when the next one arrives.
    newest: Option<Sample>,
    /// Found when the store is full for the first time, or else at the end.
    rhythm: Option<Rhythm>,

    origin_s: f64,
    largest_stamp_s: f64,
    rows: u64,
    missing: [Tally; 3],
    duplicates: Tally,
    bad: Tally,
    /// What the source says about the first bad sample.
    fault: String,
    has_own_stamps: bool,
    dropped: u64,
}

impl RecordingBuilder {
    /// An empty recording that keeps at most [`MAX_POINTS`] points.
    pub fn new(columns: Columns) -> Self {
        Self {
            columns,
            max_points: MAX_POINTS,
            notes: Vec::new(),
            time_s: Vec::new(),
            input: Vec::new(),
            output: Vec::new(),
            places: Places::default(),
            set_point: Vec::new(),
            gaps: Vec::new(),
            samples_per_point: 1,
            group: Group::default(),
            newest: None,
            rhythm: None,
            origin_s: 0.0,
            largest_stamp_s: 0.0,
            rows: 0,
            missing: [Tally::default(); 3],
            duplicates: Tally::default(),
            bad: Tally::default(),
            fault: String::new(),
            has_own_stamps: false,
            dropped: 0,
        }
    }

    /// Keeps at most this many points (at least 4, rounded down to an even number).
    #[must_use]
    pub fn with_max_points(mut self, max_points: usize) -> Self {
        self.max_points = max_points.max(4) & !1;
        self
    }

    /// Gives the signals other names and units than those at the start.
    pub(crate) fn name_signals(
        &mut self,
        input: Column,
        output: Column,
        set_point: Option<Column>,
    ) {
        (self.columns.input, self.columns.output) = (input, output);
        self.columns.set_point = set_point;
    }

    /// Adds a note.
    pub fn note(&mut self, note: Note) {
        self.notes.push(note);
    }

    /// Adds a sample: its time stamp in seconds, the input held from that time on, and the output
    /// measured at that time. A sample that is not finite, or repeats the time stamp before, is
    /// dropped and counted.
    ///
    /// # Errors
    /// The time stamp is smaller than the one before, or a number is beyond 1e300.
    pub fn push(
        &mut self,
        at: Position,
        time_s: f64,
        input: f64,
        output: f64,
    ) -> Result<(), RecordingError> {
        self.push_with(at, time_s, [input, output], None)
    }

    /// Adds a sample of input and output with its set-point. `None`, or a set-point that is not finite or beyond 1e300:
    /// that of the sample before.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn push_with(
        &mut self,
        at: Position,
        time_s: f64,
        [input, output]: [f64; 2],
        set_point: Option<f64>,
    ) -> Result<(), RecordingError> {
        self.rows += 1;
        for (role, value) in Role::ALL.into_iter().zip([time_s, input, output]) {
            if !value.is_finite() {
                self.missing[role as usize].add(at);
                return Ok(());
            }
            if value.abs() > LARGEST {
                return Err(RecordingError::TooLarge { at, role, value });
            }
        }
        if self.newest.is_none() && time_s.abs() > FAR_START_S {
            self.origin_s = time_s;
            self.note(Note::CountedFromFirst {
                first: format!("{time_s:?} s"),
            });
        }
        self.largest_stamp_s = self.largest_stamp_s.max(time_s.abs());
        let time_s = time_s - self.origin_s;
        if let Some(newest) = self.newest {
            if time_s < newest.time_s {
                let before_s = newest.time_s;
                return Err(RecordingError::TimeGoesBack {
                    at,
                    before_s,
                    after_s: time_s,
                });
            }
            if time_s == newest.time_s {
                self.duplicates.add(at);
                return Ok(());
            }
            self.settle(newest, time_s);
        }
        let known = set_point.filter(|value| value.abs() <= LARGEST);
        let before = self.newest.map_or(0.0, |newest| newest.set_point);
        self.newest = Some(Sample {
            at,
            time_s,
            input,
            output,
            set_point: known.unwrap_or(before),
        });
        Ok(())
    }

    /// Leaves out a sample that its source marks as bad: it was not measured, so it is a gap and no fault of the file.
    /// `fault` is what the source says about it.
    pub fn leave_out(&mut self, at: Position, fault: &str) {
        if self.bad.first.is_none() {
            fault.clone_into(&mut self.fault);
        }
        self.bad.add(at);
    }

    /// Says that the output has stamps of its own, which show whether it was stored by exception or compression.
    pub(crate) fn mark_own_stamps(&mut self) {
        self.has_own_stamps = true;
    }

    /// Returns the recording.
    ///
    /// # Errors
    /// Too few samples, too many dropped, or time stamps that cannot resolve the sample period.
    pub fn finish(mut self) -> Result<Recording, RecordingError> {
        let (rhythm, newest) = self.check()?;
        self.group.add(newest, rhythm.median_s());
        self.store_full_group(rhythm.median_s());
        let dropped_before_gaps = self.dropped;
        self.dropped += self.group.samples as u64;
        let points = self.time_s.len();
        self.gaps.retain(|gap| gap.index < points);

        let samples = self.rows - self.missing.iter().map(|tally| tally.count).sum::<u64>();
        if points < 2 || dropped_before_gaps as f64 > MOST_DROPPED * samples as f64 {
            return Err(RecordingError::TooManyGaps {
                samples_per_point: self.samples_per_point,
                dropped: dropped_before_gaps,
                samples,
            });
        }
        self.note_what_happened(&rhythm);
        let mut recording = Recording {
            time_s: self.time_s,
            input: self.input,
            output: self.output,
            set_point: self.set_point,
            samples_per_point: self.samples_per_point,
            sample_period_s: rhythm.period_s(),
            jitter: rhythm.jitter(),
            gaps: self.gaps,
            columns: self.columns,
            notes: self.notes,
            relay_beta: None,
            output_filter_hz: None,
        };
        recording.clean(&self.places);
        Ok(recording)
    }

    /// Refuses too few rows, too many missing or repeated ones, and coarse time stamps.
    fn check(&mut self) -> Result<(Rhythm, Sample), RecordingError> {
        let rows = self.rows;
        let missing: u64 = self.missing.iter().map(|tally| tally.count).sum();
        let worst = Role::ALL
            .into_iter()
            .max_by_key(|&role| self.missing[role as usize].count);
        if let Some(role) = worst
            && let Some(first) = self.missing[role as usize].first
            && missing as f64 > MOST_MISSING * rows as f64
        {
            return Err(RecordingError::TooManyMissing {
                count: missing,
                rows,
                role,
                column: self.columns.of(role).name.clone(),
                first,
            });
        }
        if let Some(first) = self.bad.first
            && self.bad.count as f64 > MOST_BAD * (rows + self.bad.count) as f64
        {
            return Err(RecordingError::TooManyBad {
                count: self.bad.count,
                rows: rows + self.bad.count,
                first,
                fault: self.fault.clone(),
            });
        }
        let stamps = rows - missing - self.duplicates.count;
        let newest = match self.newest {
            Some(newest) if stamps >= 2 => newest,
            _ if self.duplicates.count > 0 => return Err(RecordingError::TimeConstant { rows }),
            _ => return Err(RecordingError::TooShort { rows: stamps }),
        };
        let rhythm = match self.rhythm.take() {
            Some(rhythm) => rhythm,
            None => self.find_rhythm(newest.time_s),
        };
        let period_s = rhythm.period_s();
        if self.largest_stamp_s * f64::EPSILON > COARSEST_STAMP * period_s {
            let largest_s = self.largest_stamp_s;
            return Err(RecordingError::StampsTooCoarse {
                largest_s,
                period_s,
            });
        }
        let count = self.duplicates.count;
        if let Some(first) = self.duplicates.first
            && count as f64 > MOST_DUPLICATES * rows as f64
        {
            return Err(RecordingError::TooManyDuplicates { count, rows, first });
        }
        Ok((rhythm, newest))
    }

    /// Puts the newest sample into the group, now that the next time stamp is known.
    fn settle(&mut self, sample: Sample, next_s: f64) {
        if self.rhythm.is_none() && self.time_s.len() == self.max_points {
            self.rhythm = Some(self.find_rhythm(sample.time_s));
        }
        let increment_s = next_s - sample.time_s;
        let median_s = self.rhythm.as_ref().map_or(increment_s, Rhythm::median_s);
        let gap = self
            .rhythm
            .as_mut()
            .is_some_and(|rhythm| rhythm.is_gap(increment_s));
        self.group
            .add(sample, if gap { median_s } else { increment_s });
        self.store_full_group(median_s);
        if gap {
            let incomplete = std::mem::take(&mut self.group);
            self.dropped += incomplete.samples as u64;
            let start_s = if incomplete.samples > 0 {
                incomplete.start_s
            } else {
                sample.time_s
            };
            self.add_gap(Gap {
                index: self.time_s.len(),
                start_s,
                end_s: next_s,
            });
        }
    }

    /// Rhythm and gaps of the samples stored so far (each is still one point) up to `next_s`.
    fn find_rhythm(&mut self, next_s: f64) -> Rhythm {
        let stamps = || self.time_s.iter().copied().chain([next_s]);
        let increments_s = stamps().zip(stamps().skip(1)).map(|(a, b)| b - a).collect();
        let mut rhythm = Rhythm::around_median(increments_s);
        for index in 1..=self.time_s.len() {
            let start_s = self.time_s[index - 1];
            let end_s = self.time_s.get(index).copied().unwrap_or(next_s);
            if rhythm.is_gap(end_s - start_s) {
                self.gaps.push(Gap {
                    index,
                    start_s,
                    end_s,
                });
            }
        }
        rhythm
    }

    /// Stores the group as a point if it is full; averages the stored points if there is no room.
    fn store_full_group(&mut self, median_s: f64) {
        if self.group.samples == self.samples_per_point && self.time_s.len() == self.max_points {
            self.average_in_pairs(median_s);
        }
        if self.group.samples == self.samples_per_point {
            let group = std::mem::take(&mut self.group);
            if let Some(at) = group.at.filter(|_| self.samples_per_point == 1) {
                self.places.push(self.time_s.len(), at);
            }
            self.time_s.push(group.start_s);
            self.input.push(group.input);
            self.output.push(group.output);
            if self.columns.set_point.is_some() {
                self.set_point.push(group.set_point);
            }
        }
    }

    /// Averages the points in pairs, so that each has twice as many samples. A single point left
    /// before a gap is dropped; a single point left at the end becomes the first half of the group.
    fn average_in_pairs(&mut self, median_s: f64) {
        let stored = self.time_s.len();
        let point_s = self.samples_per_point as f64 * median_s;
        let gaps = std::mem::take(&mut self.gaps);
        let mut kept = 0;
        let mut start = 0;
        for gap in gaps.into_iter().map(Some).chain([None]) {
            let end = gap.map_or(stored, |gap| gap.index);
            let end_s = match gap {
                Some(_) => self.time_s[end - 1] + point_s,
                None => self.group.start_s,
            };
            for first in (start..end.saturating_sub(1)).step_by(2) {
                let after_s = if first + 2 < end {
                    self.time_s[first + 2]
                } else {
                    end_s
                };
                let mut pair = self.point(first, self.time_s[first + 1]);
                pair.append(&self.point(first + 1, after_s));
                self.time_s[kept] = pair.start_s;
                self.input[kept] = pair.input;
                self.output[kept] = pair.output;
                if let Some(set_point) = self.set_point.get_mut(kept) {
                    *set_point = pair.set_point;
                }
                kept += 1;
            }
            let odd = (end - start) % 2 == 1;
            if let Some(gap) = gap {
                let start_s = if odd {
                    self.time_s[end - 1]
                } else {
                    gap.start_s
                };
                self.dropped += if odd {
                    self.samples_per_point as u64
                } else {
                    0
                };
                self.add_gap(Gap {
                    index: kept,
                    start_s,
                    ..gap
                });
            } else if odd {
                let mut pair = self.point(end - 1, end_s);
                pair.append(&self.group);
                self.group = pair;
            }
            start = end;
        }
        self.time_s.truncate(kept);
        self.input.truncate(kept);
        self.output.truncate(kept);
        self.set_point.truncate(kept);
        self.samples_per_point *= 2;
        self.places.clear();
    }

    /// A stored point as a group that ends at the given time.
    fn point(&self, index: usize, end_s: f64) -> Group {
        Group {
            at: None,
            start_s: self.time_s[index],
            samples: self.samples_per_point,
            held_s: end_s - self.time_s[index],
            input: self.input[index],
            output: self.output[index],
            set_point: self.set_point.get(index).copied().unwrap_or(0.0),
        }
    }

    /// Adds a gap, or extends the last gap if no point lies between the two.
    fn add_gap(&mut self, gap: Gap) {
        match self.gaps.last_mut() {
            Some(last) if last.index == gap.index => last.end_s = gap.end_s,
            _ if gap.index == 0 => {}
            _ => self.gaps.push(gap),
        }
    }

    fn note_what_happened(&mut self, rhythm: &Rhythm) {
        for role in Role::ALL {
            let Tally { count, first } = self.missing[role as usize];
            if let Some(first) = first {
                self.notes.push(Note::RowsDropped { role, count, first });
            }
        }
        let Tally { count, first } = self.bad;
        if let Some(first) = first {
            let fault = std::mem::take(&mut self.fault);
            self.notes.push(Note::BadLeftOut {
                count,
                first,
                fault,
            });
        }
        let Tally { count, first } = self.duplicates;
        if let Some(first) = first {
            self.notes.push(Note::DuplicatesDropped { count, first });
        }
        if self.samples_per_point > 1 {
            let (samples_per_point, dropped) = (self.samples_per_point, self.dropped);
            self.notes.push(Note::Averaged {
                samples_per_point,
                dropped,
            });
        }
        let length_s = |gap: &Gap| gap.end_s - gap.start_s;
        let longest = self
            .gaps
            .iter()
            .max_by(|a, b| length_s(a).total_cmp(&length_s(b)));
        if let Some(longest) = longest {
            let (longest_s, at_s) = (length_s(longest), longest.start_s);
            self.notes.push(Note::Gaps {
                count: self.gaps.len(),
                longest_s,
                at_s,
            });
        }
        if let Some((least_s, most_s)) =
            rhythm::spread_s(&self.time_s).filter(|_| self.has_own_stamps)
        {
            self.notes.push(Note::Compressed { least_s, most_s });
        } else if rhythm.jitter() > NOTED_JITTER {
            let (jitter, sample_period_s) = (rhythm.jitter(), rhythm.period_s());
            self.notes.push(Note::Jitter {
                jitter,
                sample_period_s,
            });
        }
    }
}

/// One row.
#[derive(Debug, Clone, Copy)]
struct Sample {
    at: Position,
    time_s: f64,
    input: f64,
    output: f64,
    set_point: f64,
}

/// Consecutive samples without a gap between them: mean output, and means of the input and the set-point over time.
#[derive(Debug, Clone, Default)]
struct Group {
    /// Position of the first sample.
    at: Option<Position>,
    start_s: f64,
    samples: usize,
    held_s: f64,
    input: f64,
    output: f64,
    set_point: f64,
}

impl Group {
    fn add(&mut self, sample: Sample, held_s: f64) {
        let Sample {
            at,
            time_s: start_s,
            input,
            output,
            set_point,
        } = sample;
        self.append(&Self {
            at: Some(at),
            start_s,
            samples: 1,
            held_s,
            input,
            output,
            set_point,
        });
    }

    fn append(&mut self, next: &Self) {
        if self.samples == 0 {
            *self = next.clone();
            return;
        }
        let held_s = self.held_s + next.held_s;
        let samples = self.samples + next.samples;
        // In this form the mean of equal numbers is exactly that number.
        self.input += (next.input - self.input) * (next.held_s / held_s);
        self.set_point += (next.set_point - self.set_point) * (next.held_s / held_s);
        self.output += (next.output - self.output) * (next.samples as f64 / samples as f64);
        self.held_s = held_s;
        self.samples = samples;
    }
}

/// A count of rows with the position of the first.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    count: u64,
    first: Option<Position>,
}

impl Tally {
    fn add(&mut self, at: Position) {
        self.count += 1;
        self.first.get_or_insert(at);
    }
}
