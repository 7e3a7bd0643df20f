//! Sentences about recordings: why a file could not be read, what the reader noted, and which flags
//! help.

use std::borrow::Cow;

use onecycle_link::{ChosenBy, Note, ReadError, Recording, RecordingError, Role, TimeUnit};

/// What is wrong with a file, where, and what to do.
pub fn refusal(error: &ReadError) -> String {
    let advice = match error {
        ReadError::AmbiguousTime {
            step,
            possible,
            usual,
            ..
        } => Some(Cow::Owned(advice_on_unit(*step, possible, *usual))),
        _ => advice_on_file(error).map(Cow::Borrowed),
    };
    advised(error.to_string(), advice)
}

/// What the reader chose, assumed or dropped, and the flag that changes a guess.
pub fn note(note: &Note) -> String {
    let advice = match note {
        Note::ColumnsChosen {
            by: ChosenBy::Position | ChosenBy::Values | ChosenBy::Word,
            ..
        } => Some("if that is wrong, give `time`, `input` and `output`"),
        Note::NamesOfController { .. } => Some("if that is wrong, give `input` and `output`"),
        Note::LogSignals { .. } => Some("choose others with `axis`, `loop` and `flight`"),
        Note::TagsChosen { .. } => Some("if that is wrong, give `tag`, or `input` and `output`"),
        Note::Compressed { .. } | Note::Interpolated { .. } => {
            Some("switch the compression of this tag off and record again")
        }
        Note::TimeUnitGuessed { .. } => Some("if that is wrong, give `time_unit`"),
        _ => None,
    };
    advised(note.to_string(), advice)
}

/// Share of a recording after the last change of the input from which the test has stopped early.
const STOPPED: f64 = 0.75;

/// That an input that has switched stops to do so long before the end of the recording, and what to do. `None` if it does not, and of
/// one step, which is made to be followed by rest.
pub fn input_stops(recording: &Recording) -> Option<String> {
    let (times_s, input) = (recording.time_s(), recording.input());
    let mut changes = (1..input.len()).rev().filter(|&i| input[i] != input[i - 1]);
    let last = changes.next()?;
    changes.next()?;
    let (start_s, end_s) = (*times_s.first()?, *times_s.last()?);
    let is_stopped = end_s - times_s[last] > STOPPED * (end_s - start_s);
    is_stopped.then(|| {
        format!(
            "The input changes for the last time at {:.1} s and the recording ends at {end_s:.1} s: after that it shows \
             disturbances only, as when a test fails. Repeat the test and let the input switch until the end.",
            times_s[last]
        )
    })
}

fn advised(fact: String, advice: Option<impl AsRef<str>>) -> String {
    match advice {
        Some(advice) => format!("{fact}; {}", advice.as_ref()),
        None => fact,
    }
}

/// The option for each possible unit; the most usual unit first.
fn advice_on_unit(step: f64, possible: &[TimeUnit], usual: Option<TimeUnit>) -> String {
    let Some(usual) = usual else {
        return "give `time_unit`, or the sample rate with `sample_rate`".to_owned();
    };
    let others = possible.iter().filter(|unit| **unit != usual);
    let others: Vec<String> = others
        .map(|unit| format!("`time_unit={}`", unit.symbol()))
        .collect();
    let rate = match step {
        1.0 => ", or, if the column counts rows, `sample_rate`",
        _ => "",
    };
    let (usual, others) = (usual.symbol(), others.join(" or "));
    format!("give `time_unit={usual}` or {others}{rate}")
}

fn advice_on_file(error: &ReadError) -> Option<&'static str> {
    use ReadError as E;
    Some(match error {
        E::Empty | E::NoData { .. } => "expected rows of time, output and input",
        E::NotText { .. } => "export the recording as CSV first",
        E::MatTooLarge => "save fewer variables, or a part of the recording",
        E::MatNoTable { .. } => {
            "save time, input and output as vectors of the same length, outside of cells and objects"
        }
        E::TooLarge { .. } => "export less time, or fewer signals",
        E::BadJson { is_cut: true, .. } => "export it again",
        E::BadJson { .. } => "a table of text does not begin with { or [",
        E::JsonNoTable => "write rows such as {\"t\": 0, \"u\": 1, \"y\": 2}, one on each line",
        E::NoPower => "log the output of the heater beside its temperature",
        E::NoNumbers { .. } => "record the input and the output of the process as numbers",
        E::NulByte { .. } => "cut the file before that line",
        E::LineTooLong { .. } => "a recording has one short row per line",
        E::UnclosedQuote { .. } => "close or remove the quote",
        E::OneColumn { .. } => {
            "separate time, output and input by comma, semicolon, tab, | or blanks"
        }
        E::RaggedRow { .. } => {
            "correct the line, or separate the columns by semicolons if they hold decimal commas"
        }
        E::NoDbc { .. } => "give the DBC file of the bus with `dbc`",
        E::NoCanTimes => "record with `candump -l` or `candump -ta`",
        E::BadDbc { .. } => {
            "lines begin with BO_ and SG_, as in SG_ Speed : 0|16@1+ (0.1,0) [0|0] \"rpm\" ECU"
        }
        E::NotANumber { .. } => "correct it or leave it empty",
        E::NoNumber { .. } => {
            "choose another with `input` or `output`, or export it with its values"
        }
        E::MixedDecimals { .. } => "export it with one of them and without separators of thousands",
        E::SeveralLoops { .. } => "choose one with `tag`",
        E::NoSuchLoop { .. } => {
            "choose another with `tag`, or the columns with `input` and `output`"
        }
        E::UnknownTag { role, .. } => match role {
            Role::Input => "choose it with `input`",
            _ => "choose it with `output`",
        },
        E::TooManyValues { .. } => "export one loop, or less time",
        E::ClockTime { .. } => {
            "export seconds from the start, or date and time of day in one column, or give the sample \
             rate with `sample_rate`"
        }
        E::AmbiguousDate { .. } => "export the dates as yyyy-mm-dd, or seconds from the start",
        E::TimeGoesBack { .. } => "keep one run and cut the rest",
        E::UnknownColumn { role, .. } | E::AmbiguousColumn { role, .. } => match role {
            Role::Time => "choose it with `time`, or give the sample rate with `sample_rate`",
            Role::Input => "choose it with `input`",
            Role::Output => "choose it with `output`",
            _ => return None,
        },
        E::InputOrOutput { .. } => "choose them with `input` and `output`",
        E::InputOfWhat { .. } => {
            "say what acts on the process with `input` and what is measured with `output`"
        }
        E::MixedUnits { .. } => "export plain numbers in one unit",
        E::SameColumn { .. } => "choose another column",
        E::Recording(error) => return advice_on_samples(error),
        _ => return None,
    })
}

fn advice_on_samples(error: &RecordingError) -> Option<&'static str> {
    use RecordingError as E;
    Some(match error {
        E::TooLarge { .. } => "check the units or cut that row",
        E::TimeGoesBack { .. } => "keep one run and cut the rest",
        E::TimeConstant { .. } => {
            "choose another column with `time`, or give the sample rate with `sample_rate`"
        }
        E::TooManyMissing { .. } => "choose another column or cut the recording",
        E::TooManyBad { .. } => "export raw samples of a time when the sensor worked",
        E::TooManyDuplicates { .. } => {
            "the time column is too coarse: give the sample rate with `sample_rate`"
        }
        E::StampsTooCoarse { .. } => {
            "subtract the first time stamp before writing the file, or give the sample rate with \
             `sample_rate`"
        }
        E::TooManyGaps { .. } => "cut it to one stretch without gaps",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use onecycle_link::{CsvOptions, read_from};

    use super::*;

    #[track_caller]
    fn assert_refused(text: &str, expected: &str) {
        let error = read_from(text.as_bytes(), &CsvOptions::default()).unwrap_err();
        assert_eq!(refusal(&error), expected);
    }

    /// A table of 100 valid rows after a header, one of which is replaced.
    fn table_with(row: usize, text: &str) -> String {
        let valid = |i: usize| format!("{},{i}.5,1\n", i as f64 / 10.0);
        let rows = (0..100).map(|i| {
            if i == row {
                format!("{text}\n")
            } else {
                valid(i)
            }
        });
        std::iter::once("t,pv,u\n".to_owned()).chain(rows).collect()
    }

    #[test]
    fn files_that_are_not_tables() {
        assert_refused(
            "",
            "the file is empty; expected rows of time, output and input",
        );
        assert_refused(
            "t,pv,u\n",
            "found no row of numbers in 1 line; expected rows of time, output and input",
        );
        assert_refused(
            "PK\x03\x04\x14\0\x06\0",
            "this is not a text table but a zip archive (an .xlsx workbook is one); \
             export the recording as CSV first",
        );
        assert_refused(
            "t\n1\n2\n",
            "line 2 has a single column; \
             separate time, output and input by comma, semicolon, tab, | or blanks",
        );
        assert_refused(
            "t,pv,u\n0,\"1,2\n",
            "line 2 opens a quote and does not close it; close or remove the quote",
        );
        assert_refused(
            &"1,".repeat(1 << 20),
            "line 1 is longer than 65536 bytes; a recording has one short row per line",
        );
    }

    #[test]
    fn rows_and_cells() {
        assert_refused(
            "t,pv,u\n0,1,0,5\n0,2,1,5\n",
            "line 2 has 4 cells where 3 are expected; correct the line, \
             or separate the columns by semicolons if they hold decimal commas",
        );
        assert_refused(
            &table_with(40, "4,abc,1"),
            "line 42, \"pv\" (column 2): \"abc\" is not a number; \
             correct it or leave it empty",
        );
        assert_refused(
            &table_with(40, "4,\"1,234\",1"),
            "line 42, \"pv\" (column 2): \"1,234\" and earlier cells mix decimal commas and decimal \
             points; export it with one of them and without separators of thousands",
        );
        assert_refused(
            &table_with(40, "4,1e305,1"),
            "the output at line 42 is 1e305, beyond 1e300; check the units or cut that row",
        );
        assert_refused(
            &table_with(40, "4,nan,1").replace("5,50.5,1", "5,,1"),
            "2 of 100 rows have no number in the output (pv), the first at line 42; \
             at most 1 % may be missing; choose another column or cut the recording",
        );
    }

    #[test]
    fn a_test_that_stops_early() {
        let stops = |last: usize| {
            let time_s: Vec<f64> = (0..100_u32).map(f64::from).collect();
            let input: Vec<f64> = (0..100)
                .map(|i| f64::from(u8::from(i < last && i + 3 != last)))
                .collect();
            let output: Vec<f64> = time_s.iter().map(|t| t.sin()).collect();
            input_stops(&Recording::from_samples(&time_s, &input, &output).unwrap())
        };
        let found = stops(20).unwrap();
        assert!(
            found.starts_with("The input changes for the last time at 20.0 s"),
            "{found}"
        );
        assert_eq!((stops(60), stops(100)), (None, None));
    }

    #[test]
    fn times() {
        assert_refused(
            "12:00,1,1\n12:01,2,1\n",
            "line 1, column 1: \"12:00\" is not a date with a time of day; \
             export seconds from the start, or date and time of day in one column, or give the \
             sample rate with `sample_rate`",
        );
        assert_refused(
            "t,y,u\n1/2/2024 12:00,1,1\n1/4/2024 12:00,2,1\n",
            "line 3, \"t\" (column 1): \"1/4/2024 12:00\" does not show which number is the day and \
             which the month; export the dates as yyyy-mm-dd, or seconds from the start",
        );
        assert_refused(
            &table_with(40, "3.85,4,1"),
            "time goes back on line 42: 3.85 follows 3.9; keep one run and cut the rest",
        );
        assert_refused(
            "t,pv,u\n5,1,1\n5,2,1\n5,3,1\n",
            "time does not change: all 3 rows have the same time stamp; \
             choose another column with `time`, or give the sample rate with `sample_rate`",
        );
        let coarse: String = (0..100).map(|i| format!("{},{i},1\n", i / 2)).collect();
        assert_refused(
            &format!("t,pv,u\n{coarse}"),
            "50 of 100 rows repeat the time stamp of the row before, the first at line 3; \
             at most 5 % may; the time column is too coarse: give the sample rate with `sample_rate`",
        );
        let far: String = (0..100)
            .map(|i| format!("{:e},{i},1\n", 1e18 + 1024.0 * f64::from(i)))
            .collect();
        assert_refused(
            &format!("time_us,pv,u\n{far}"),
            "time stamps as large as 1.000e12 s cannot resolve a sample period of 1.023e-3 s; \
             subtract the first time stamp before writing the file, or give the sample rate with \
             `sample_rate`",
        );
    }

    #[test]
    fn units_of_time_in_doubt() {
        assert_refused(
            "t,y,u\n0,1,1\n1,2,1\n2,3,1\n",
            "\"t\" (column 1) gives no unit of time: a step of 1 is 1 ms or 1 s; give `time_unit=s` or \
             `time_unit=ms`, or, if the column counts rows, `sample_rate`",
        );
        assert_refused(
            "t,y,u\n0,1,1\n4000,2,1\n8000,3,1\n",
            "\"t\" (column 1) gives no unit of time: a step of 4000 is 4000 us or 4000 ms; give \
             `time_unit=us` or `time_unit=ms`",
        );
        assert_refused(
            "t,y,u\n50000000000000000,1,1\n50000000000100000,2,1\n",
            "\"t\" (column 1) gives no unit of time: a step of 100000 is no usual sample period in any \
             unit; give `time_unit`, or the sample rate with `sample_rate`",
        );
    }

    #[test]
    fn too_long_and_too_many_gaps() {
        // 1 Hz at first, then 0.1 Hz: once the store of 64 points is full, each increment is a gap.
        let time = |i| if i < 100 { i } else { 10 * i };
        let rows: String = (0..1000).map(|i| format!("{},1,1\n", time(i))).collect();
        let options = CsvOptions::default().max_points(64);
        let error = read_from(format!("t,pv,u\n{rows}").as_bytes(), &options).unwrap_err();
        let sentence = refusal(&error);
        let is_advised = sentence.ends_with("; cut it to one stretch without gaps");
        assert!(sentence.contains("gaps leave") && is_advised, "{sentence}");
    }

    #[test]
    fn columns() {
        assert_refused(
            "a,b,c\n0,0,0\n1,1,1\n",
            "no column is known to be the time; \
             the columns are \"a\" (column 1), \"b\" (column 2), \"c\" (column 3); \
             choose it with `time`, or give the sample rate with `sample_rate`",
        );
        assert_refused(
            "t,pv,a,b\n0,0,0,1\n1,1,1,1\n",
            "no column is known to be the input; the columns are \"t\" (column 1), \
             \"pv\" (column 2), \"a\" (column 3), \"b\" (column 4); choose it with `input`",
        );
        assert_refused(
            "t,y,pv,u\n0,0,0,1\n1,1,1,1\n",
            "several columns may be the output: \"y\" (column 2), \"pv\" (column 3); \
             choose it with `output`",
        );
        assert_refused(
            "0,0,0\n0.1,1,1\n0.2,0,1\n",
            "the values of column 2 and column 3 do not show which is the input and which the \
             output; choose them with `input` and `output`",
        );
        let same = CsvOptions::default().input_column("2").output_column("pv");
        let error = read_from(&b"t,pv,u\n0,1,1\n1,2,1\n"[..], &same).unwrap_err();
        let expected =
            "\"pv\" (column 2) cannot be both the input and the output; choose another column";
        assert_eq!(refusal(&error), expected);
    }

    #[test]
    fn guesses_name_the_flags_that_change_them() {
        let rows: String = (0..30)
            .map(|i| format!("{},{i}.5,{}\n", 70 * i, i / 15))
            .collect();
        let recording = read_from(rows.as_bytes(), &CsvOptions::default()).unwrap();
        let notes: Vec<String> = recording.notes().iter().map(note).collect();
        let expected = [
            "time is column 1, input is column 3, output is column 2, found by how few values the \
             input takes; if that is wrong, give `time`, `input` and `output`",
            "the time column gives no unit; its time stamps were read in ms; if that is wrong, give \
             `time_unit`",
        ];
        assert_eq!(notes, expected);
    }
}
