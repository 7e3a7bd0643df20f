//! What is known of a recording before any fit.

use super::prepare::{FLOOR, Prepared, prepare};
use super::record::Blocks;
use super::{ROWS, outliers, validate};
use crate::excitation::Recorded;
use crate::settings::Options;
use crate::signals::Signals;

/// What is known of a recording. `None` if no fit can be made.
pub(crate) fn recorded(signals: &Signals<'_>, options: &Options) -> Option<Recorded> {
    let mut prepared = prepare(signals, options, FLOOR).ok()?;
    let outliers = outliers::mark_far(&mut prepared.record);
    Some(describe(&prepared, outliers))
}

/// Whether past outputs explain the input, as they do that of a relay in a loop, and not a test signal of two levels.
pub(crate) fn input_follows(signals: &Signals<'_>, options: &Options) -> bool {
    prepare(signals, options, FLOOR).is_ok_and(|prepared| {
        let record = &prepared.record;
        let samples = (record.len() / ROWS).max(1);
        validate::follows(&Blocks::new(record, samples, 0.0))
    })
}

/// Measured properties of a record without its `outliers`.
pub(super) fn describe(prepared: &Prepared, outliers: usize) -> Recorded {
    let record = &prepared.record;
    let deviation = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>();
        (squares / values.len() as f64).sqrt()
    };
    let outputs: Vec<f64> = record.present_outputs().collect();
    let present = outputs.len();
    Recorded {
        start_s: prepared.start_s,
        end_s: prepared.start_s + record.time_s(record.len() - 1),
        sample_s: record.dt_s,
        samples: present,
        absent: record.len() - present - outliers,
        outliers,
        samples_per_row: 1,
        hold: record.hold,
        input_deviation: deviation(&record.input),
        output_deviation: deviation(&outputs),
        informative_rad_per_s: None,
        excited_rad_per_s: None,
    }
}
