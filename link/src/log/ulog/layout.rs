//! Formats of ULog: names, types and offsets of the columns of a row.

use std::collections::HashMap;

use crate::log::scalar::Scalar;
use crate::log::tables::text_of;

/// Maximum number of types inside each other.
const DEEPEST: usize = 8;

/// Maximum size of a row in bytes: sizes are numbers of 16 bits.
const LARGEST: usize = 1 << 16;

/// A member of a format as written: `float[3] xyz`.
#[derive(Debug, Clone)]
pub(super) struct Member {
    type_name: String,
    count: usize,
    name: String,
}

/// A number in a row.
#[derive(Debug, Clone)]
pub(super) struct LogColumn {
    pub(super) name: String,
    pub(super) offset: usize,
    pub(super) scalar: Scalar,
}

/// Where the numbers of a row are.
#[derive(Debug, Clone, Default)]
pub(super) struct Layout {
    pub(super) columns: Vec<LogColumn>,
    pub(super) time_offset: usize,
    /// Bytes without the padding at the end, which the firmware leaves out.
    least: usize,
    /// Bytes with it.
    whole: usize,
}

impl Layout {
    /// Whether a row may have this many bytes.
    pub(super) fn fits(&self, size: usize) -> bool {
        (self.least..=self.whole).contains(&size)
    }
}

/// Name and members of a format: `name:type member;type member;`.
pub(super) fn members_of(payload: &[u8]) -> Option<(String, Vec<Member>)> {
    let text = text_of(payload, LARGEST);
    let (name, members) = text.split_once(':')?;
    let members = members
        .split(';')
        .filter(|member| !member.trim().is_empty());
    let members: Option<Vec<Member>> = members.map(member_of).collect();
    Some((name.to_owned(), members?))
}

fn member_of(text: &str) -> Option<Member> {
    let (type_name, name) = text.trim().split_once(' ')?;
    let (type_name, count) = match type_name.split_once('[') {
        Some((type_name, count)) => (type_name, count.strip_suffix(']')?.parse().ok()?),
        None => (type_name, 1),
    };
    (count <= LARGEST).then(|| Member {
        type_name: type_name.to_owned(),
        count: if text.contains('[') { count } else { 0 },
        name: name.trim().to_owned(),
    })
}

/// The layout of a format. `None`: it is unknown, too large, or its rows have no time.
pub(super) fn layout_of(formats: &HashMap<String, Vec<Member>>, name: &str) -> Option<Layout> {
    let mut layout = Layout::default();
    add(&mut layout, formats, name, "", DEEPEST)?;
    layout
        .columns
        .iter()
        .find(|c| c.name == "timestamp" && c.scalar == Scalar::U64)
        .map(|column| column.offset)
        .map(|offset| Layout {
            time_offset: offset,
            ..layout
        })
}

fn add(
    layout: &mut Layout,
    formats: &HashMap<String, Vec<Member>>,
    name: &str,
    prefix: &str,
    depth: usize,
) -> Option<()> {
    let members = formats.get(name).filter(|_| depth > 0)?;
    for member in members {
        for at in 0..member.count.max(1) {
            let name = match member.count {
                0 => format!("{prefix}{}", member.name),
                _ => format!("{prefix}{}[{at}]", member.name),
            };
            let offset = layout.whole;
            if let Some(scalar) = scalar_of(&member.type_name) {
                layout.whole += scalar.size();
                if !member.name.starts_with("_padding") {
                    layout.columns.push(LogColumn {
                        name,
                        offset,
                        scalar,
                    });
                    layout.least = layout.whole;
                }
            } else if member.type_name == "char" {
                layout.whole += 1;
                layout.least = layout.whole;
            } else {
                add(
                    layout,
                    formats,
                    &member.type_name,
                    &format!("{name}."),
                    depth - 1,
                )?;
            }
            // A type without members would be repeated for nothing.
            if layout.whole == offset || layout.whole > LARGEST {
                return None;
            }
        }
    }
    Some(())
}

/// The type of this name, if it is a number.
pub(super) fn scalar_of(name: &str) -> Option<Scalar> {
    Some(match name {
        // A bool as pyulog reads it: firmware has logged others than 0 and 1.
        "int8_t" | "bool" => Scalar::I8,
        "uint8_t" => Scalar::U8,
        "int16_t" => Scalar::I16,
        "uint16_t" => Scalar::U16,
        "int32_t" => Scalar::I32,
        "uint32_t" => Scalar::U32,
        "int64_t" => Scalar::I64,
        "uint64_t" => Scalar::U64,
        "float" => Scalar::F32,
        "double" => Scalar::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formats(texts: &[&str]) -> HashMap<String, Vec<Member>> {
        texts
            .iter()
            .filter_map(|text| members_of(text.as_bytes()))
            .collect()
    }

    // 8 + 2 * (4 + 3 * 2) + 1 = 29 bytes, and 3 of padding that may be missing.
    #[test]
    fn nested_types_and_arrays_have_their_offsets() {
        let formats = formats(&[
            "outer:uint64_t timestamp;inner[2] pair;uint8_t flag;uint8_t[3] _padding0;",
            "inner:float value;int16_t[3] xyz;",
        ]);
        let layout = layout_of(&formats, "outer").unwrap();
        let place = |name: &str| {
            let column = layout
                .columns
                .iter()
                .find(|column| column.name == name)
                .unwrap();
            (column.offset, column.scalar)
        };
        assert_eq!(place("pair[1].xyz[2]"), (8 + 10 + 4 + 4, Scalar::I16));
        assert_eq!(place("flag"), (28, Scalar::U8));
        assert!(layout.fits(29) && layout.fits(32) && !layout.fits(28) && !layout.fits(33));
    }

    #[test]
    fn hostile_formats_are_refused() {
        let formats = formats(&[
            "loop:uint64_t timestamp;loop again;",
            "empty:",
            "many:uint64_t timestamp;empty[60000] nothing;",
            "large:uint64_t timestamp;double[60000] values;",
            "timeless:float value;",
        ]);
        for name in ["loop", "many", "large", "timeless", "unknown"] {
            assert!(layout_of(&formats, name).is_none(), "{name}");
        }
        assert!(members_of(b"far:float[99999999999999999999] value;").is_none());
    }
}
