//! What a user should know beside the numbers, in plain words.

use std::fmt;

use super::{Identification, Options};

/// Something weakly determined, or off.
#[derive(Clone, Debug, PartialEq)]
pub enum Remark {
    /// Damping cannot be told from none: `K` and `T_body` have no upper bound.
    NoDampingSeen,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoDampingSeen => write!(f, "no damping seen"),
        }
    }
}

pub(super) fn remarks(_found: &Identification, _options: &Options) -> Vec<Remark> {
    vec![]
}
