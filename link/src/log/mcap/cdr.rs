//! Messages of ROS 2: the text of their definition (`ros2msg`), and their bytes (CDR).
//!
//! ```text
//! uint64 timestamp            name and type of a field; `#` begins a comment, `=` a constant
//! float32[3] xyz              3 columns xyz[0] to xyz[2]
//! geometry_msgs/Point p       columns p.x, p.y, p.z; its definition follows behind a line of ===, `MSG: geometry_msgs/Point`
//! float32[] ranges            16 columns ranges[0] to ranges[15], NaN where it is shorter (also `[<=N]`); text has no column
//! string[] name               labels: `position[0]` of a sensor_msgs/JointState is called `position.shoulder`
//! ```
//! In the bytes every number lies at a multiple of its size, counted behind the header of 4 bytes; sequences and text begin
//! with their number of elements (u32).

use std::collections::HashMap;

use crate::log::scalar::Scalar;

/// Maximum number of columns of a message, and of definitions inside each other.
const MOST_COLUMNS: usize = 4096;
const DEEPEST: usize = 8;
/// Columns of a sequence of numbers: more are no signals.
const OF_SEQUENCE: usize = 16;
/// Bytes of the header, and its kind: CDR, little-endian.
const HEADER: usize = 4;
const LITTLE_ENDIAN: u8 = 1;

/// How the bytes of a message are read.
#[derive(Debug, PartialEq)]
pub(super) struct Layout {
    /// Names of the columns.
    pub(super) names: Vec<String>,
    /// The column `timestamp`.
    pub(super) timestamp: Option<usize>,
    /// The columns of seconds and nanoseconds of the header.
    pub(super) stamp: Option<[usize; 2]>,
    parts: Vec<Part>,
}

#[derive(Debug, PartialEq)]
enum Part {
    Number(Scalar),
    Text,
    /// Numbers that have columns.
    Numbers(Scalar),
    /// Texts that name the elements of sequences.
    Labels,
    Sequence(Vec<Part>),
}

/// A field of a definition.
struct Field<'a> {
    kind: &'a str,
    name: &'a str,
    count: Count,
}

enum Count {
    One,
    Fixed(usize),
    Any,
}

/// The layout of messages of the type `name`. `None`: the text does not define it, or it is too large.
pub(super) fn layout_of(name: &str, text: &str) -> Option<Layout> {
    let mut definitions: HashMap<&str, Vec<Field<'_>>> = HashMap::new();
    let mut own = last(name);
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if let Some(next) = line.strip_prefix("MSG:") {
            own = last(next.trim());
        } else if !line.starts_with("===") {
            let fields = definitions.entry(own).or_default();
            fields.extend(field_of(line));
        }
    }
    let mut names = Vec::new();
    let parts = parts_of(&definitions, last(name), "", Some(&mut names), DEEPEST)?;
    let place = |wanted| names.iter().position(|name| name == wanted);
    let timestamp = place("timestamp");
    let stamp = place("header.stamp.sec").zip(place("header.stamp.nanosec"));
    let stamp = stamp.map(|(seconds, rest)| [seconds, rest]);
    Some(Layout {
        names,
        timestamp,
        stamp,
        parts,
    })
}

/// The type without its package.
fn last(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

/// The field of a line. `None`: an empty line or a constant.
fn field_of(line: &str) -> Option<Field<'_>> {
    let (kind, rest) = line.split_once(char::is_whitespace)?;
    let mut words = rest.split_whitespace();
    let name = words.next()?;
    if name.contains('=') || words.next().is_some_and(|next| next.starts_with('=')) {
        return None;
    }
    let (kind, count) = match kind.split_once('[') {
        None => (kind, Count::One),
        Some((kind, size)) => {
            let size = size.trim_end_matches(']');
            (kind, size.parse().map_or(Count::Any, Count::Fixed))
        }
    };
    Some(Field { kind, name, count })
}

/// Parts of a definition; `names` gets the columns, unless it lies in a sequence.
fn parts_of(
    definitions: &HashMap<&str, Vec<Field<'_>>>,
    own: &str,
    prefix: &str,
    mut names: Option<&mut Vec<String>>,
    deepest: usize,
) -> Option<Vec<Part>> {
    let deeper = deepest.checked_sub(1)?;
    let mut parts = Vec::new();
    for field in definitions.get(own)? {
        let name = format!("{prefix}{}", field.name);
        let one = |name: &str, names: Option<&mut Vec<String>>| {
            let kind = field.kind.split("<=").next().unwrap_or_default();
            if kind == "string" {
                return Some(vec![Part::Text]);
            }
            match scalar_of(kind) {
                Some(scalar) => {
                    if let Some(names) = names {
                        names.push(name.to_owned());
                    }
                    Some(vec![Part::Number(scalar)])
                }
                None => {
                    let prefix = format!("{name}.");
                    parts_of(definitions, last(kind), &prefix, names, deeper)
                }
            }
        };
        match field.count {
            Count::One => parts.extend(one(&name, names.as_deref_mut())?),
            Count::Any => parts.push(match (scalar_of(field.kind), names.as_deref_mut()) {
                (Some(scalar), Some(names)) => {
                    names.extend((0..OF_SEQUENCE).map(|at| format!("{name}[{at}]")));
                    Part::Numbers(scalar)
                }
                (None, Some(_)) if (field.kind, &*name) == ("string", "name") => Part::Labels,
                _ => Part::Sequence(one(&name, None)?),
            }),
            Count::Fixed(count) => {
                for at in 0..count {
                    parts.extend(one(&format!("{name}[{at}]"), names.as_deref_mut())?);
                    if parts.len() > MOST_COLUMNS {
                        return None;
                    }
                }
            }
        }
        if parts.len() > MOST_COLUMNS {
            return None;
        }
    }
    Some(parts)
}

fn scalar_of(kind: &str) -> Option<Scalar> {
    Some(match kind {
        "int8" | "bool" => Scalar::I8,
        "uint8" | "byte" | "char" => Scalar::U8,
        "int16" => Scalar::I16,
        "uint16" => Scalar::U16,
        "int32" => Scalar::I32,
        "uint32" => Scalar::U32,
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        "float32" => Scalar::F32,
        "float64" => Scalar::F64,
        _ => return None,
    })
}

impl Layout {
    /// Names of the columns if the elements of sequences have these labels.
    pub(super) fn labelled(&self, labels: &[String]) -> Vec<String> {
        let label = |name: &String| {
            let (bare, at) = name.strip_suffix(']')?.rsplit_once('[')?;
            Some(format!("{bare}.{}", labels.get(at.parse::<usize>().ok()?)?))
        };
        let all = self.names.iter();
        all.map(|name| label(name).unwrap_or_else(|| name.clone()))
            .collect()
    }

    /// Reads the columns of a message into `row`, and the labels of its sequences. `None`: the message is too short, or of another
    /// encoding.
    pub(super) fn read(
        &self,
        message: &[u8],
        row: &mut Vec<f64>,
        labels: &mut Vec<String>,
    ) -> Option<()> {
        row.clear();
        labels.clear();
        let (header, bytes) = message.split_at_checked(HEADER)?;
        (header[..2] == [0, LITTLE_ENDIAN]).then_some(())?;
        let mut cursor = Cursor {
            bytes,
            at: 0,
            labels,
        };
        cursor.read(&self.parts, Some(row))
    }
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    labels: &'a mut Vec<String>,
}

impl Cursor<'_> {
    fn read(&mut self, parts: &[Part], mut row: Option<&mut Vec<f64>>) -> Option<()> {
        for part in parts {
            match part {
                Part::Number(scalar) => {
                    let value = self.number(*scalar)?;
                    if let Some(row) = row.as_deref_mut() {
                        row.push(value);
                    }
                }
                Part::Text => {
                    let count = self.count()?;
                    self.pass(count)?;
                }
                Part::Numbers(scalar) => self.numbers(*scalar, row.as_deref_mut())?,
                Part::Labels => {
                    for _ in 0..self.count()? {
                        let count = self.count()?;
                        let from = self.at;
                        self.pass(count)?;
                        if self.labels.len() < OF_SEQUENCE {
                            let text = String::from_utf8_lossy(&self.bytes[from..self.at]);
                            self.labels.push(text.trim_end_matches('\0').to_owned());
                        }
                    }
                }
                Part::Sequence(parts) => {
                    let count = self.count()?;
                    if let [Part::Number(scalar)] = parts.as_slice() {
                        if count > 0 {
                            self.align(scalar.size());
                        }
                        self.pass(count.checked_mul(scalar.size())?)?;
                        continue;
                    }
                    for _ in 0..count {
                        let before = self.at;
                        self.read(parts, None)?;
                        // Elements without bytes would never end.
                        (self.at > before).then_some(())?;
                    }
                }
            }
        }
        Some(())
    }

    /// A sequence whose first elements have columns.
    fn numbers(&mut self, scalar: Scalar, row: Option<&mut Vec<f64>>) -> Option<()> {
        let count = self.count()?;
        if count > 0 {
            self.align(scalar.size());
        }
        let from = self.at;
        self.pass(count.checked_mul(scalar.size())?)?;
        let value = |at: usize| match at < count {
            true => scalar.read(&self.bytes[from + at * scalar.size()..]),
            false => f64::NAN,
        };
        if let Some(row) = row {
            row.extend((0..OF_SEQUENCE).map(value));
        }
        Some(())
    }

    fn count(&mut self) -> Option<usize> {
        self.number(Scalar::U32).map(|count| count as usize)
    }

    fn number(&mut self, scalar: Scalar) -> Option<f64> {
        self.align(scalar.size());
        let from = self.at;
        self.pass(scalar.size())?;
        Some(scalar.read(&self.bytes[from..self.at]))
    }

    fn align(&mut self, size: usize) {
        self.at = self.at.next_multiple_of(size);
    }

    fn pass(&mut self, count: usize) -> Option<()> {
        let end = self.at.checked_add(count)?;
        (end <= self.bytes.len()).then(|| self.at = end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "uint64 timestamp # us\nuint8 NONE = 0\nbool ok\nstring<=8 name\nfloat32[2] xy\n\
        Point[<=3] path\nPoint p\nint16[] more\nuint8 last 7\n\
        ================\nMSG: some_msgs/Point\nfloat64 x\nbyte kind\n";

    // By hand, places behind the header: timestamp 0, ok 8, count 12, "ab\0" 16, xy 20, count of path 28, x 32, kind 40,
    // p.x 48, p.kind 56, count of more 60, 2 x 2 bytes 64, last 68.
    #[test]
    fn a_message_by_hand() {
        let layout = layout_of("my/msg/Test", TEXT).unwrap();
        let mut names = ["timestamp", "ok", "xy[0]", "xy[1]", "p.x", "p.kind"]
            .map(str::to_owned)
            .to_vec();
        names.extend((0..16).map(|at| format!("more[{at}]")));
        names.push("last".to_owned());
        assert_eq!(layout.names, names);
        assert_eq!(layout.timestamp, Some(0));
        let mut bytes = vec![0_u8; 4 + 69];
        bytes[1] = 1;
        let mut put = |at: usize, value: &[u8]| {
            bytes[4 + at..4 + at + value.len()].copy_from_slice(value);
        };
        put(0, &123_u64.to_le_bytes());
        put(8, &[1]);
        put(12, &3_u32.to_le_bytes());
        put(16, b"ab\0");
        put(20, &1.5_f32.to_le_bytes());
        put(24, &(-2.5_f32).to_le_bytes());
        put(28, &1_u32.to_le_bytes());
        put(32, &9.0_f64.to_le_bytes());
        put(48, &4.0_f64.to_le_bytes());
        put(56, &[200]);
        put(60, &2_u32.to_le_bytes());
        put(68, &[7]);
        put(64, &5_i16.to_le_bytes());
        let (mut row, mut labels) = (Vec::new(), Vec::new());
        layout.read(&bytes, &mut row, &mut labels).unwrap();
        assert_eq!(row[..8], [123.0, 1.0, 1.5, -2.5, 4.0, 200.0, 5.0, 0.0]);
        assert!(row[8..22].iter().all(|value| value.is_nan()));
        assert_eq!(row[22..], [7.0]);
        // Every shorter message is refused, and so is one that is big-endian.
        for length in 0..bytes.len() {
            let read = layout.read(&bytes[..length], &mut row, &mut labels);
            assert_eq!(read, None, "{length}");
        }
        bytes[1] = 0;
        assert_eq!(layout.read(&bytes, &mut row, &mut labels), None);
    }

    // A type inside itself, one that is not defined, and too many columns.
    #[test]
    fn definitions_that_have_no_end() {
        for text in ["Test own\n", "Other other\n", "uint8[5000] many\n"] {
            assert_eq!(layout_of("my/msg/Test", text), None, "{text}");
        }
    }
}
