//! Tensors of `f32` in a file: safetensors, which PyTorch, JAX and NumPy read and write.
//!
//! ```text
//! u64, little endian    length of the header
//! header                JSON: { name: { "dtype": "F32", "shape": [..], "data_offsets": [from, to] },
//!                       "__metadata__": { name: string } }, then spaces up to a multiple of 8 bytes
//! bytes                 all numbers, little endian, row by row; offsets count from here
//! ```
//!
//! A reader trusts nothing: types, shapes, and that the tensors fill the bytes without a gap.
//!
//! Reference: Hugging Face, "safetensors: format", version 0.8. Written here in as many lines as
//! its crate would take to be called, and without what that brings along.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

/// Longest header: that of the reference implementation.
const LONGEST_HEADER: u64 = 100_000_000;

/// What PyTorch counts and nothing here reads, in integers.
const IGNORED: &str = "num_batches_tracked";

/// Key of the strings beside the tensors.
const METADATA: &str = "__metadata__";

/// A named tensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Its name.
    pub name: String,
    /// Its extent in each dimension.
    pub shape: Vec<usize>,
    /// Its elements, the last dimension fastest.
    pub values: Vec<f32>,
}

/// Tensors, and strings beside them. See the [module](super).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TensorFile {
    /// Tensors in the order of their bytes.
    pub tensors: Vec<Tensor>,
    /// Strings beside them.
    pub metadata: BTreeMap<String, String>,
}

/// What is wrong with a file of tensors.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TensorFileError {
    /// Shorter than its header.
    #[error("the file ends within its header, after {0} bytes: not safetensors, or cut off")]
    Short(usize),
    /// The header is not what it must be.
    #[error("the header of the file is not that of safetensors: {0}")]
    Header(String),
    /// Another type of number.
    #[error("tensor {name} holds numbers of type {dtype}, not F32")]
    Type {
        /// Its name.
        name: String,
        /// Its type.
        dtype: String,
    },
    /// Bytes that are not those of the shape, or not where they belong.
    #[error("tensor {name} claims bytes {from} to {to}, which its shape and neighbours do not fit")]
    Extent {
        /// Its name.
        name: String,
        /// Its first byte.
        from: usize,
        /// One after its last byte.
        to: usize,
    },
    /// Bytes after the last tensor.
    #[error("the tensors end at byte {end} of {length}")]
    Length {
        /// Where the last tensor ends.
        end: usize,
        /// Bytes there are.
        length: usize,
    },
    /// A tensor that is not there.
    #[error("tensor {0} is missing")]
    Missing(String),
    /// A tensor that nobody asked for.
    #[error("tensor {0} belongs to another network")]
    Unexpected(String),
    /// A tensor of another shape.
    #[error("tensor {name} must have shape {expected:?}, but has {found:?}")]
    Shape {
        /// Its name.
        name: String,
        /// The shape it must have.
        expected: Vec<usize>,
        /// The shape it has.
        found: Vec<usize>,
    },
    /// A number that no network can hold.
    #[error("tensor {name} holds {value:?}")]
    Value {
        /// Its name.
        name: String,
        /// The number.
        value: f32,
    },
}

impl Tensor {
    pub(super) fn expect_shape(&self, expected: &[usize]) -> Result<(), TensorFileError> {
        if self.shape == expected {
            return Ok(());
        }
        Err(TensorFileError::Shape {
            name: self.name.clone(),
            expected: expected.to_vec(),
            found: self.shape.clone(),
        })
    }

    /// Finite numbers, none negative if they are a `variance`.
    pub(super) fn expect_values(&self, variance: bool) -> Result<(), TensorFileError> {
        let is_wrong = |value: &&f32| !value.is_finite() || variance && **value < 0.0;
        match self.values.iter().find(is_wrong) {
            None => Ok(()),
            Some(&value) => Err(TensorFileError::Value {
                name: self.name.clone(),
                value,
            }),
        }
    }
}

/// A tensor as the header has it.
#[derive(serde::Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

impl TensorFile {
    /// The bytes of the file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut header = Map::new();
        if !self.metadata.is_empty() {
            header.insert(METADATA.to_owned(), json!(self.metadata));
        }
        let mut from = 0;
        for tensor in &self.tensors {
            let to = from + size_of::<f32>() * tensor.values.len();
            let entry =
                json!({ "dtype": "F32", "shape": tensor.shape, "data_offsets": [from, to] });
            header.insert(tensor.name.clone(), entry);
            from = to;
        }
        let mut header = Value::Object(header).to_string();
        let padded = header.len().next_multiple_of(8);
        header.extend(std::iter::repeat_n(' ', padded - header.len()));
        let mut bytes = Vec::with_capacity(8 + padded + from);
        bytes.extend((padded as u64).to_le_bytes());
        bytes.extend(header.as_bytes());
        for value in self.tensors.iter().flat_map(|tensor| &tensor.values) {
            bytes.extend(value.to_le_bytes());
        }
        bytes
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// Says what is wrong with the file, and with which tensor.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TensorFileError> {
        let short = || TensorFileError::Short(bytes.len());
        let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(short)?;
        let length = u64::from_le_bytes(*length);
        if length > LONGEST_HEADER {
            let reason = format!("it claims to be {length} bytes long");
            return Err(TensorFileError::Header(reason));
        }
        let (header, data) = rest.split_at_checked(length as usize).ok_or_else(short)?;
        let bad_header = |error: serde_json::Error| TensorFileError::Header(error.to_string());
        let mut header: Map<String, Value> = serde_json::from_slice(header).map_err(bad_header)?;
        let metadata = match header.remove(METADATA) {
            None => BTreeMap::new(),
            Some(strings) => serde_json::from_value(strings).map_err(bad_header)?,
        };
        let mut entries = (header.into_iter())
            .map(|(name, entry)| {
                let entry: Entry = serde_json::from_value(entry)?;
                Ok((name, entry))
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(bad_header)?;
        entries.sort_by_key(|(_, entry)| entry.data_offsets);

        let mut tensors = Vec::new();
        let mut end = 0;
        for (name, entry) in entries {
            let [from, to] = entry.data_offsets;
            let values = data.get(from..to).filter(|_| from == end);
            end = to;
            if name.ends_with(IGNORED) && values.is_some() {
                continue;
            }
            let elements = (entry.shape.iter()).try_fold(1_usize, |n, m| n.checked_mul(*m));
            let size = elements.and_then(|n| n.checked_mul(size_of::<f32>()));
            if entry.dtype != "F32" {
                let dtype = entry.dtype;
                return Err(TensorFileError::Type { name, dtype });
            }
            let Some(values) = values.filter(|values| Some(values.len()) == size) else {
                return Err(TensorFileError::Extent { name, from, to });
            };
            let (values, _) = values.as_chunks();
            tensors.push(Tensor {
                name,
                shape: entry.shape,
                values: values
                    .iter()
                    .map(|bytes| f32::from_le_bytes(*bytes))
                    .collect(),
            });
        }
        if end != data.len() {
            let length = data.len();
            return Err(TensorFileError::Length { end, length });
        }
        Ok(Self { tensors, metadata })
    }

    /// Removes a tensor.
    ///
    /// # Errors
    /// Where there is none of this name.
    pub fn take(&mut self, name: &str) -> Result<Tensor, TensorFileError> {
        match self.tensors.iter().position(|tensor| tensor.name == name) {
            Some(i) => Ok(self.tensors.remove(i)),
            None => Err(TensorFileError::Missing(name.to_owned())),
        }
    }

    /// Expects that every tensor has been taken.
    pub(super) fn expect_nothing_left(&self) -> Result<(), TensorFileError> {
        match self.tensors.first() {
            None => Ok(()),
            Some(tensor) => Err(TensorFileError::Unexpected(tensor.name.clone())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> TensorFile {
        let tensor = |name: &str, shape: &[usize], values: &[f32]| Tensor {
            name: name.to_owned(),
            shape: shape.to_vec(),
            values: values.to_vec(),
        };
        TensorFile {
            tensors: vec![
                tensor("b", &[2, 1], &[1.0, -2.5]),
                tensor("a", &[], &[f32::MIN_POSITIVE]),
                tensor("none", &[0, 3], &[]),
            ],
            metadata: [("k".to_owned(), "v \" \u{e9}".to_owned())].into(),
        }
    }

    /// A file of this header and so many bytes of data.
    fn file(header: &str, data: usize) -> Vec<u8> {
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.extend(header.as_bytes());
        bytes.extend(vec![0; data]);
        bytes
    }

    #[test]
    fn bytes_come_back() {
        let bytes = example().to_bytes();
        // The header is padded, so the numbers are aligned: two and one of four bytes.
        assert_eq!((bytes.len() - 3 * 4) % 8, 0);
        let mut read = TensorFile::from_bytes(&bytes).unwrap();
        // An empty tensor has no bytes to be sorted by.
        read.tensors
            .sort_by_key(|tensor| std::cmp::Reverse(tensor.values.len()));
        assert_eq!(read, example());
        assert_eq!(
            TensorFile::from_bytes(&TensorFile::default().to_bytes()),
            Ok(TensorFile::default())
        );
    }

    #[test]
    fn every_fault_has_its_sentence() {
        let bytes = example().to_bytes();
        let cases: [(Vec<u8>, &str); 11] = [
            (vec![1, 2, 3], "ends within its header, after 3"),
            (bytes[..20].to_vec(), "ends within its header, after 20"),
            (vec![255; 16], "bytes long"),
            (file("{]", 0), "not that of safetensors"),
            (file(r#"{"a":{"dtype":"F32"}}"#, 0), "missing field"),
            (
                file(
                    r#"{"a":{"dtype":"F16","shape":[2],"data_offsets":[0,4]}}"#,
                    4,
                ),
                "tensor a holds numbers of type F16",
            ),
            (
                file(
                    r#"{"a":{"dtype":"F32","shape":[2],"data_offsets":[0,4]}}"#,
                    4,
                ),
                "tensor a claims bytes 0 to 4",
            ),
            (
                file(
                    r#"{"a":{"dtype":"F32","shape":[1],"data_offsets":[4,8]}}"#,
                    8,
                ),
                "tensor a claims bytes 4 to 8",
            ),
            (
                file(
                    r#"{"a":{"dtype":"F32","shape":[1],"data_offsets":[4,0]}}"#,
                    8,
                ),
                "tensor a claims bytes 4 to 0",
            ),
            (
                file(
                    r#"{"a":{"dtype":"F32","shape":[4294967296,4294967296],"data_offsets":[0,4]}}"#,
                    4,
                ),
                "tensor a claims",
            ),
            (bytes[..bytes.len() - 1].to_vec(), "tensor a claims bytes 8"),
        ];
        for (bytes, sentence) in cases {
            let error = TensorFile::from_bytes(&bytes).unwrap_err().to_string();
            assert!(error.contains(sentence), "{error}");
        }
        let mut long = bytes;
        long.push(0);
        let error = TensorFile::from_bytes(&long).unwrap_err();
        assert_eq!(error.to_string(), "the tensors end at byte 12 of 13");
    }
}
