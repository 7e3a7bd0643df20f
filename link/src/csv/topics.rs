//! MCAP with messages of ROS 2 as a table of one value a row: `joint_states.effort.shoulder`, `command.data`.

use super::error::ReadError;
use super::sheet::Sheet;
use crate::log::{Topic, Wanted, read_tables};

pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Most values of a table: 2^22, as many as are kept of one value a row.
const MOST_VALUES: usize = 1 << 22;

/// The numbers of all topics; of the signals `wanted` alone, if there are any.
///
/// # Errors
/// The log has no numbers, or too many.
pub(super) fn read(file: &[u8], wanted: &[&str]) -> Result<Sheet, ReadError> {
    let none = ReadError::NoNumbers {
        format: "MCAP log (of which messages of ROS 2 in CDR are read)",
    };
    let Ok(log) = read_tables(file, &Wanted::everything()) else {
        return Err(none);
    };
    let topics: Vec<&Topic> = log
        .flights
        .iter()
        .flat_map(|flight| &flight.topics)
        .collect();
    let mut sheet = Sheet::long();
    let mut count = 0;
    for topic in topics {
        for (at, values) in &topic.columns {
            let name = name_of(topic, &topic.fields[*at]);
            let is_wanted = wanted.is_empty() || wanted.contains(&name.as_str());
            // A stamp is no signal.
            if !is_wanted || name.contains(".stamp.") || name.ends_with(".timestamp") {
                continue;
            }
            for (time_s, value) in topic.time_s.iter().zip(values) {
                if value.is_finite() {
                    sheet.value(*time_s, &name, *value);
                    count += 1;
                }
            }
            if count > MOST_VALUES {
                return Err(ReadError::TooManyValues { limit: MOST_VALUES });
            }
        }
    }
    match sheet.is_empty() {
        true => Err(none),
        false => Ok(sheet),
    }
}

fn name_of(topic: &Topic, field: &str) -> String {
    match topic.instance {
        0 => format!("{}.{field}", topic.name),
        instance => format!("{}_{instance}.{field}", topic.name),
    }
}
