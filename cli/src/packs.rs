//! Packs of identifiers: where one is, and whether it can be used.

use std::borrow::Cow;
use std::convert::Infallible;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use onecycle::request::{MOST_OF_A_PACK, PackFile};
use onecycle_onboard::pack::{DEFAULT, Pack, SELF_TEST_TOLERANCE};

use crate::failure::Failure;
use crate::reading::bytes_at_most;

/// Where a pack is.
#[derive(Clone, Debug, PartialEq)]
pub enum PackSource {
    /// In the program.
    Embedded,
    /// In a file.
    File(PathBuf),
}

impl FromStr for PackSource {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            "default" => Self::Embedded,
            path => Self::File(path.into()),
        })
    }
}

impl fmt::Display for PackSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Embedded => f.write_str("default"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

impl PackSource {
    /// Its name as a path, for messages.
    pub fn path(&self) -> PathBuf {
        match self {
            Self::Embedded => PathBuf::from("default"),
            Self::File(path) => path.clone(),
        }
    }

    /// Its bytes.
    pub fn bytes(&self) -> Result<Cow<'static, [u8]>, Failure> {
        match self {
            Self::Embedded => Ok(Cow::Borrowed(DEFAULT)),
            Self::File(path) => bytes_at_most(path, MOST_OF_A_PACK).map(Cow::Owned),
        }
    }

    /// The pack in its bytes.
    pub fn read<'a>(&self, bytes: &'a [u8]) -> Result<Pack<'a>, Failure> {
        Pack::read(bytes).map_err(|error| Failure::unreadable(&self.path(), error.to_string()))
    }

    /// What a request takes. `None`: the built-in pack.
    pub(crate) fn file(&self) -> Result<Option<PackFile>, Failure> {
        let Self::File(path) = self else {
            return Ok(None);
        };
        Ok(Some(PackFile {
            name: path.display().to_string(),
            bytes: bytes_at_most(path, MOST_OF_A_PACK)?,
        }))
    }
}

/// Whether a pack passes its self-test. `worst` is the largest difference of an output from the stored one; `None` if the
/// pack stores no test signature. A difference that is not a number fails.
pub fn passes(worst: Option<f32>) -> bool {
    worst.is_none_or(|worst| worst <= SELF_TEST_TOLERANCE)
}
